"""Open3D loads without what draws its plots; the plots still work for those who call them."""

import subprocess
import sys

PLOTTING = ("dash", "plotly", "IPython")


def in_new_process(program: str) -> list[str]:
    done = subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, text=True)
    return done.stdout.split()


def test_loading_open3d_loads_nothing_that_plots() -> None:
    program = f"""
import sys
from footscan.open3d_without_plots import o3d
print(*[name in sys.modules for name in {PLOTTING}], len(o3d.geometry.TriangleMesh.create_box().triangles))
"""
    assert in_new_process(program) == ["False", "False", "False", "12"]


def test_a_plot_is_made_when_it_is_asked_for() -> None:
    program = """
from footscan.open3d_without_plots import o3d
figure = o3d.visualization.get_plotly_fig([o3d.geometry.TriangleMesh.create_box()])
print(type(figure).__name__)
"""
    assert in_new_process(program) == ["Figure"]
