"""One module decides the size of the frames."""

import ast
from pathlib import Path

from schemas.base.image_size import FRAME_SIZE, ImageSize

ROOT = Path(__file__).parents[3]
SIDES = ({480, 640}, {479, 639}, {240, 320})
"""Rows and columns, the last of each, and their middle."""


def numbers_of(module: Path) -> set[float]:
    """All numbers in the code of a module, which its texts are no part of."""
    constants = (node.value for node in ast.walk(ast.parse(module.read_bytes())) if isinstance(node, ast.Constant))
    return {value for value in constants if isinstance(value, int | float)}


def test_a_size_has_two_orders() -> None:
    size = ImageSize(rows=3, columns=4)
    assert (*size, size.px, str(size)) == (3, 4, (4, 3), "4 x 3")
    assert FRAME_SIZE == (480, 640)


def test_no_other_module_knows_the_size_of_the_frames() -> None:
    modules = [module for room in ("footscan", "pipelines", "schemas") for module in (ROOT / room).rglob("*.py")]
    knowing = [
        module.relative_to(ROOT).as_posix()
        for module, numbers in zip(modules, map(numbers_of, modules), strict=True)
        if any(sides <= numbers for sides in SIDES)
    ]
    assert knowing == ["schemas/base/image_size.py"]
