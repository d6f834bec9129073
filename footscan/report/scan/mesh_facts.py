"""Facts of a mesh: counts, holes, filled shares, quality of its triangles."""

from footscan.report.markup import facts, number
from schemas.quality import MeshQuality


def mesh_facts(mesh: MeshQuality, cloud_points: int) -> str:
    """Counts, shares and quality of the triangles as far as known; `cloud_points` is the size of the mesh's cloud."""
    closed = mesh.open_edges == 0 and mesh.non_manifold_edges == 0
    counts = {
        "Cloud points": cloud_points,
        "Vertices": mesh.vertices,
        "Triangles": mesh.triangles,
        "Parts": mesh.components,
        "Open edges": mesh.open_edges,
        "Non-manifold edges": mesh.non_manifold_edges,
        "Holes": mesh.holes,
    }
    pairs = [("Closed", "Yes" if closed else "No"), *((name, number(count)) for name, count in counts.items())]
    if mesh.holes:
        pairs.append(("Largest hole", f"{number(mesh.largest_hole_mm, 1)} mm around"))
    shares = {"Filled": mesh.filled_share, "Flat cut": mesh.cut_share or None}
    pairs += [(name, f"{number(100 * share, 1)} %") for name, share in shares.items() if share is not None]
    qualities = {"Triangle quality": mesh.triangle_quality, "Of the worst 1 %": mesh.worst_triangles}
    pairs += [(name, number(quality, 2)) for name, quality in qualities.items() if quality is not None]
    return facts(pairs) + _NOTE


_NOTE = (
    '<p class="note">Shares are of the area. '
    "A triangle’s quality is 1 where its sides are equal, 0 where it is flat.</p>"
)
