"""Holds the house to its plan: directions of import, short modules, rooms that say what they are."""

import ast
import re
import shutil
import subprocess
import sys
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("pipelines", "footscan", "schemas")
LONGEST_MODULE = 400
MOST_MODULES = 17
PUBLIC = {"footscan/__init__.py", "footscan/measure/__init__.py"}
"""What a script imports."""
MOST_PARAMETERS = 9
"""Of a compiled loop: what belongs together goes in as one named tuple."""
KINDS = {"pipelines/steps", "schemas"}
"""Folders in which each module is one of a kind: a step, a document."""

ORCHESTRATION = {"dask", "distributed", "typer", "click", "rich"}
NEUTRAL = {"child_process", "clock", "compiled", "open3d_without_plots"}
"""How processes end, clocks run, loops are compiled and a library loads says nothing of what is computed."""
CONTRACTS_MAY_USE = sys.stdlib_module_names | {"pydantic", "yaml", "schemas"}

# In pieces, so that this file does not trip over itself.
MACHINE_FOLDERS = ("root/", "work/", r"home/[\w.-]+", r"Users/[\w.-]+")
REGISTRY_HOSTS = tuple(f"{name}.org" for name in ("pypi", "pythonhosted", "anaconda", "npmjs"))
MACHINE_PATH = rf"(?<![\w.~)}}-])/(?:{'|'.join(MACHINE_FOLDERS)})"
TRACE = re.compile("|".join((MACHINE_PATH, *map(re.escape, REGISTRY_HOSTS))).encode())


def test_imports_run_pipelines_footscan_schemas_and_never_back() -> None:
    assert forbidden_imports(ROOT) == []


def test_modules_are_short() -> None:
    assert long_modules(ROOT) == []


def test_compiled_loops_take_few_parameters() -> None:
    assert wide_loops(ROOT) == []


def test_no_circle_of_modules_or_of_rooms() -> None:
    assert circles(ROOT) == []


def test_folders_are_small() -> None:
    assert large_folders(ROOT) == []


def test_every_package_folder_says_what_it_is() -> None:
    assert silent_folders(ROOT) == []


def test_no_file_in_git_tells_of_one_machine() -> None:
    if not (ROOT / ".git").exists() or shutil.which("git") is None:
        pytest.skip("not a git checkout, or no git here to list its files")
    assert traces_of_a_machine(ROOT, files_in_git(ROOT)) == []


@pytest.mark.parametrize(
    ("module", "statement"),
    [
        ("schemas/scan.py", "import footscan.stripe.extract"),
        ("schemas/scan.py", "from pipelines.engine import plan"),
        ("schemas/scan.py", "import numpy as np"),
        ("schemas/parameters/fusion.py", "from footscan import cloud"),
        ("footscan/stripe/extract.py", "from pipelines.engine.actions.key import key"),
        ("footscan/stripe/extract.py", "import dask.array"),
        ("footscan/stripe/extract.py", "from typer import Typer"),
        ("footscan/stripe/extract.py", "def late():\n    import rich.progress"),
        ("footscan/stripe/extract.py", "import importlib\nimportlib.import_module('click')"),
        ("footscan/stripe/extract.py", "__import__('pipelines.scan')"),
        ("footscan/stripe/extract.py", "from . import profile"),
        ("footscan/stripe/extract.py", "from footscan.virtual.optics.lens import Lens"),
        ("footscan/verify/compare.py", "from footscan import virtual"),
        ("footscan/virtual/optics/lens.py", "from footscan.calibration.models.fit import fit"),
        ("footscan/virtual/optics/lens.py", "from footscan import frames"),
    ],
)
def test_a_forbidden_import_is_seen(tmp_path: Path, module: str, statement: str) -> None:
    build(tmp_path, {module: statement})
    [complaint] = forbidden_imports(tmp_path)
    assert complaint.startswith(f"{module}:{statement.count(chr(10)) + 1}: ")


def test_imports_with_the_stream_are_free(tmp_path: Path) -> None:
    build(
        tmp_path,
        {
            "schemas/scan.py": "import json\nimport yaml\nfrom pydantic import Field\nfrom schemas.frames import GROUP",
            "footscan/stripe/extract.py": "import numpy\nfrom footscan.frames.reader import read\nimport schemas.scan",
            "footscan/virtual/lens.py": "from footscan.virtual.glass import bend\nfrom schemas.scan import Scan",
            "pipelines/scan.py": "import dask\nfrom footscan.virtual.lens import Lens\nimport footscan.stripe.extract",
        },
    )
    assert forbidden_imports(tmp_path) == []


def test_a_module_of_one_line_too_many_is_seen(tmp_path: Path) -> None:
    line = "x = 1\n"
    build(tmp_path, {"footscan/a.py": line * 401, "pipelines/b.py": line * 400, "tests/test_c.py": line * 402})
    assert long_modules(tmp_path) == ["footscan/a.py: 401 lines", "tests/test_c.py: 402 lines"]


def test_a_loop_of_one_parameter_too_many_is_seen(tmp_path: Path) -> None:
    names = [f"array_{n}" for n in range(MOST_PARAMETERS)]
    few, many = ", ".join(names), ", ".join([*names, "*", "last"])
    source = f"@compiled\ndef few({few}): ...\n@compiled\ndef many({many}): ...\ndef plain({many}): ...\n"
    build(tmp_path, {"footscan/stripe/profile.py": source})
    assert wide_loops(tmp_path) == ["footscan/stripe/profile.py: many takes 10 parameters"]


def test_a_silent_folder_is_seen(tmp_path: Path) -> None:
    build(
        tmp_path,
        {
            "footscan/__init__.py": '"""The science."""\n',
            "footscan/stripe/extract.py": "",
            "footscan/cloud/__init__.py": "",
            "schemas/__init__.py": '"""The contracts."""\nfrom schemas.scan import Scan\n',
            "pipelines/templates/page.html": "",
        },
    )
    assert silent_folders(tmp_path) == [
        "footscan/cloud/__init__.py: not a docstring alone",
        "footscan/stripe: no __init__.py",
        "schemas/__init__.py: not a docstring alone",
    ]


def test_a_circle_is_seen(tmp_path: Path) -> None:
    build(
        tmp_path,
        {
            "footscan/stripe/a.py": "from footscan.mesh.grid import cells",
            "footscan/mesh/grid.py": "import numpy",
            "footscan/mesh/other.py": "def late():\n    from footscan.stripe import b",
            "footscan/stripe/b.py": "",
            "pipelines/one.py": "if TYPE_CHECKING:\n    from pipelines.two import Two",
            "pipelines/two.py": "from pipelines.one import One",
        },
    )
    assert circles(tmp_path) == [
        "footscan.mesh -> footscan.stripe -> footscan.mesh",
        "pipelines.one -> pipelines.two -> pipelines.one",
    ]


def test_a_large_folder_is_seen(tmp_path: Path) -> None:
    names = ("__init__", *"abcdefghijklmnopqr")
    build(tmp_path, {f"footscan/{room}/{name}.py": "" for room in ("one", "two") for name in names})
    build(tmp_path, {"footscan/three/board_a.py": "", "footscan/three/board_b.py": "", "footscan/three/board_c.py": ""})
    (tmp_path / "footscan/two/r.py").unlink()
    assert large_folders(tmp_path) == ["footscan/one: 18 modules", "footscan/three: 3 modules board_*"]


@pytest.mark.parametrize(
    ("path", "trace"),
    [
        ("root/scans", "root/"),
        ("work/scans", "work/"),
        ("home/anna", "home/anna"),
        ("Users/anna/scans", "Users/anna"),
    ],
)
def test_a_path_of_one_machine_is_seen(tmp_path: Path, path: str, trace: str) -> None:
    build(tmp_path, {"notes.md": f"first\nthe films lie in `/{path}`\n"})
    assert traces_of_a_machine(tmp_path, [tmp_path / "notes.md"]) == [f"notes.md:2: /{trace}"]


@pytest.mark.parametrize("host", REGISTRY_HOSTS)
def test_a_registry_is_seen(tmp_path: Path, host: str) -> None:
    build(tmp_path, {"pip.conf": f"index-url = https://{host}/simple\n"})
    assert traces_of_a_machine(tmp_path, [tmp_path / "pip.conf"]) == [f"pip.conf:1: {host}"]


def test_paths_that_belong_to_no_machine_are_free(tmp_path: Path) -> None:
    build(
        tmp_path, {"notes.md": "~/work/scans ./home/anna results/root/x $HOME/work/ /dev/video0 https://a.org/work/\n"}
    )
    assert traces_of_a_machine(tmp_path, [tmp_path / "notes.md"]) == []


def test_git_lists_what_it_holds_and_nothing_else(tmp_path: Path) -> None:
    if shutil.which("git") is None:
        pytest.skip("no git here")
    build(tmp_path, {"kept with space.md": "", "gone.md": "", "scratch.md": ""})
    subprocess.run(["git", "init", "-q"], cwd=tmp_path, check=True)
    subprocess.run(["git", "add", "kept with space.md", "gone.md"], cwd=tmp_path, check=True)
    (tmp_path / "gone.md").unlink()
    assert files_in_git(tmp_path) == [tmp_path / "kept with space.md"]


def forbidden_imports(root: Path) -> list[str]:
    """One line an import that runs against the house's direction: `file:line: what it must not import`."""
    return [
        f"{module.relative_to(root)}:{line}: {name} ({reason})"
        for module in modules_of(root, PACKAGES)
        for line, name in imports_of(module)
        if (reason := reason_against(module.relative_to(root), name))
    ]


def reason_against(module: Path, imported: str) -> str | None:
    package, room = module.parts[:2]
    top, *below = imported.split(".")
    if not top:
        return "imports are absolute"
    if package == "schemas" and top not in CONTRACTS_MAY_USE:
        return "schemas imports pydantic, yaml and the standard library"
    if package == "footscan" and (top == "pipelines" or top in ORCHESTRATION):
        return "footscan knows nothing of the dataflow, of Dask or of a command line"
    if package == "footscan" and top == "footscan" and below and below[0] in NEUTRAL:
        return None
    if package == "footscan" and top == "footscan" and (below[:1] == ["virtual"]) != (room == "virtual"):
        return "the virtual scanner and the reconstruction share nothing but schemas"
    return None


def imports_of(module: Path) -> Iterator[tuple[int, str]]:
    """Line and dotted name of each import, be it late, conditional or by name; a relative one starts with its dots."""
    for node in ast.walk(ast.parse(module.read_bytes())):
        match node:
            case ast.Import(names=names):
                yield from ((node.lineno, alias.name) for alias in names)
            case ast.ImportFrom(module=origin, names=names, level=level):
                start = "." * level + (f"{origin}." if origin else "")
                yield from ((node.lineno, start + alias.name) for alias in names)
            case ast.Call(
                func=ast.Name(id="import_module" | "__import__") | ast.Attribute(attr="import_module"),
                args=[ast.Constant(value=str(name)), *_],
            ):
                yield node.lineno, name


def long_modules(root: Path) -> list[str]:
    modules = modules_of(root, (*PACKAGES, "tests", "benchmarks"))
    lengths = {module: len(module.read_bytes().splitlines()) for module in modules}
    return [f"{module.relative_to(root)}: {lines} lines" for module, lines in lengths.items() if lines > LONGEST_MODULE]


def circles(root: Path) -> list[str]:
    """Circles of imports, late ones and those for types alone included, of modules and of the rooms that they lie in.

    A room is a folder; a module that lies loose in a package is a room of its own.
    """
    names = {".".join(path.relative_to(root).with_suffix("").parts): path for path in modules_of(root, PACKAGES)}
    of_modules: dict[str, set[str]] = {name: set() for name in names}
    of_rooms: dict[str, set[str]] = {}
    for name, path in names.items():
        for _, imported in imports_of(path):
            target = imported if imported in names else imported.rpartition(".")[0]
            if target in names and target != name:
                of_modules[name].add(target)
                one, other = room_of(name), room_of(target)
                of_rooms.setdefault(one, set()).update({other} - {one})
    return [*first_circles(of_rooms), *([] if first_circles(of_rooms) else first_circles(of_modules))]


def room_of(module: str) -> str:
    folder = module.rpartition(".")[0]
    return folder if "." in folder else module


def first_circles(arrows: dict[str, set[str]]) -> list[str]:
    """A shortest circle through the first name of each knot of names that reach each other."""
    found, seen = [], set()
    for start in sorted(arrows):
        paths = [[start]]
        visited: set[str] = set()
        while paths and start not in seen:
            path = paths.pop(0)
            for target in sorted(arrows.get(path[-1], ())):
                if target == start:
                    found.append(" -> ".join([*path, start]))
                    seen |= set(path)
                    paths.clear()
                    break
                if target not in visited:
                    visited.add(target)
                    paths.append([*path, target])
    return found


def wide_loops(root: Path) -> list[str]:
    """Functions compiled to machine code that take more parameters than one sees at a glance."""
    complaints = []
    for path in modules_of(root, PACKAGES):
        for function in ast.walk(ast.parse(path.read_bytes())):
            if not isinstance(function, ast.FunctionDef):
                continue
            is_compiled = any(isinstance(by, ast.Name) and by.id == "compiled" for by in function.decorator_list)
            taken = function.args
            count = len(taken.posonlyargs) + len(taken.args) + len(taken.kwonlyargs)
            if is_compiled and count > MOST_PARAMETERS:
                complaints.append(f"{path.relative_to(root).as_posix()}: {function.name} takes {count} parameters")
    return complaints


def large_folders(root: Path) -> list[str]:
    """Folders of more modules than one sees at a glance, and prefixes that should be a folder."""
    complaints = []
    modules = [path for path in modules_of(root, PACKAGES) if path.name != "__init__.py"]
    for folder in sorted({path.parent for path in modules}):
        here = [path.stem for path in modules if path.parent == folder]
        name = folder.relative_to(root).as_posix()
        if name not in KINDS and len(here) > MOST_MODULES:
            complaints.append(f"{name}: {len(here)} modules")
        prefixes = Counter(stem.partition("_")[0] for stem in here if "_" in stem)
        if name not in KINDS:
            complaints += [f"{name}: {n} modules {prefix}_*" for prefix, n in prefixes.items() if n > 2]
    return complaints


def silent_folders(root: Path) -> list[str]:
    """Package folders that do not introduce themselves by a docstring, or whose `__init__.py` holds more than it."""
    complaints = []
    for folder in sorted({module.parent for module in modules_of(root, PACKAGES)}):
        introduction = folder / "__init__.py"
        if not introduction.exists():
            complaints.append(f"{folder.relative_to(root)}: no __init__.py")
            continue
        tree = ast.parse(introduction.read_bytes())
        if introduction.relative_to(root).as_posix() not in PUBLIC and (
            ast.get_docstring(tree) is None or len(tree.body) > 1
        ):
            complaints.append(f"{introduction.relative_to(root)}: not a docstring alone")
    return complaints


def traces_of_a_machine(root: Path, files: Iterable[Path]) -> list[str]:
    """Absolute paths of one machine and hosts of package registries, in files of text or bytes."""
    return [
        f"{file.relative_to(root)}:{number}: {found.group().decode()}"
        for file in files
        for number, line in enumerate(file.read_bytes().split(b"\n"), start=1)
        for found in TRACE.finditer(line)
    ]


def files_in_git(root: Path) -> list[Path]:
    command = ["git", "-c", f"safe.directory={root}", "ls-files", "-z", "--cached"]
    listed = subprocess.run(command, cwd=root, check=True, capture_output=True).stdout.decode().split("\0")
    return [root / name for name in listed if (root / name).is_file()]


def modules_of(root: Path, folders: Iterable[str]) -> list[Path]:
    return sorted(module for folder in folders for module in (root / folder).rglob("*.py"))


def build(root: Path, files: dict[str, str]) -> None:
    for name, content in files.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(content)
