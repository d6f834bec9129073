"""The identity of code covers all modules that a step reaches by import, without comments and docstrings."""

from typing import Any

import pytest

from pipelines.engine.actions import libraries
from pipelines.engine.actions.code import CodeIdentity, code_identity, code_text
from pipelines.engine.files.digest import sha256

STEP = """
from PACKAGE.first import prepare
import numpy

def run(inputs, parameters, places):
    return prepare()
"""


@pytest.fixture
def tree(package: Any) -> Any:
    """A step that reaches a helper over three imports, with every form of import."""
    package.write("step", STEP)
    package.write("first", "from PACKAGE import second\n\ndef prepare():\n    return second.go()\n")
    package.write("second", "def go():\n    import PACKAGE.inner.third as third\n    return third.VALUE\n")
    package.write("inner.__init__", "")
    package.write("inner.third", "VALUE = b'1'\n")
    package.write("stranger", "VALUE = 1\n")
    return package


def identity(package: Any) -> CodeIdentity:
    return code_identity(package.load("step"))


def test_all_that_is_reached_counts(tree: Any) -> None:
    found = identity(tree)
    names = ["", ".first", ".inner", ".inner.third", ".second", ".step"]
    assert [name for name in found.modules if name != tree.name] == [f"{tree.name}{name}" for name in names[1:]]
    assert list(found.libraries) == ["numpy", "python"]


@pytest.mark.parametrize(
    ("module", "source"),
    [
        ("inner.third", "VALUE = b'2'\n"),
        ("inner.third", "VALUE = b'1'\nOTHER = 1\n"),
        ("inner.third", "VALUE = '1'\n"),
        ("inner.__init__", "import sys\nsys.dont_write_bytecode = True\n"),
        ("second", "def go(x=1):\n    import PACKAGE.inner.third as third\n    return third.VALUE\n"),
        ("step", STEP.replace("prepare()", "prepare() + b''")),
    ],
)
def test_change_of_what_runs_changes_the_identity(tree: Any, module: str, source: str) -> None:
    before = identity(tree)
    tree.write(module, source)
    assert identity(tree) != before


@pytest.mark.parametrize(
    ("module", "source"),
    [
        ("inner.third", "# a remark\nVALUE = (  # another\n    b'1'\n)\n\n\n"),
        ("inner.third", '"""What it is."""\n\nVALUE = b"1"\n"""What it means."""\n'),
        ("first", 'from PACKAGE import second\ndef prepare():\n    """Says more\n    than before."""\n    return '
                  "second.go(\n    )\n"),
        ("inner.__init__", '"""A package."""\n'),
        ("stranger", "VALUE = 2\n"),
    ],
)  # fmt: skip
def test_comments_docstrings_layout_and_strangers_do_not(tree: Any, module: str, source: str) -> None:
    before = identity(tree)
    tree.write(module, source)
    assert identity(tree) == before


def test_text_that_is_used_is_no_docstring(package: Any) -> None:
    for first, second in (
        ('NAME = "a"', 'NAME = "b"'),
        ('print("a")', 'print("b")'),
        ("def f():\n  return 'a'", "def f():\n  return 'b'"),
    ):
        package.write("step", first)
        before = identity(package)
        package.write("step", second)
        assert identity(package) != before


def test_imports_may_run_in_a_circle(package: Any) -> None:
    package.write("step", "import PACKAGE.other\n")
    package.write("other", "import PACKAGE.step\n")
    assert len(identity(package).modules) == 3


def test_version_of_a_library_counts(tree: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    before = identity(tree)
    tree.forget()
    monkeypatch.setattr(libraries, "_version", lambda _: "999")
    after = identity(tree)
    assert after.modules == before.modules
    assert after.libraries == before.libraries | {"numpy": "999"}


def test_library_that_is_not_installed_is_said(package: Any) -> None:
    package.write("step", "def run():\n    import no_such_library\n")
    with pytest.raises(ModuleNotFoundError, match="no_such_library"):
        identity(package)


def test_libraries_of_the_projects_own_steps() -> None:
    assert {"numpy", "numba", "llvmlite", "simplejpeg"} <= set(code_identity("pipelines.steps.extract").libraries)
    assert "footscan.stripe.ridge" in code_identity("pipelines.steps.extract").modules
    assert "footscan.cloud.fusion.fuse" not in code_identity("pipelines.steps.extract").modules
    assert "footscan.report.scan.page" in code_identity("pipelines.steps.report").modules


def test_the_texts_of_a_step_have_the_digests_of_its_identity() -> None:
    modules = code_identity("pipelines.steps.fuse").modules
    assert {module: sha256(code_text(module)) for module in modules} == modules
