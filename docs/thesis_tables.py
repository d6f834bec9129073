"""Writes the two tables of the thesis, its figures beside ours, into docs/verification.md.

    .venv/bin/python docs/thesis_tables.py [FOLDER]

FOLDER (default: demo) is that of `footscan demo`; what is there already is taken.
"""

import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

DOCS = Path(__file__).resolve().parent
FOOTSCAN = Path(sys.executable).with_name("footscan")
MARKED = re.compile(r"(<!-- thesis: (\w+) -->\n).*?(<!-- end of thesis -->)", re.DOTALL)
THESIS_MEAN_MM, THESIS_MAX_MM = 0.35, 3.1
"""Distance of the thesis's foot to that of an industrial scanner."""
BLOCK_TURN_DEG = 5, 0
IS_NO_FOOT = 1
"""Exit status of a scan that cannot be measured; cloud and surface are there nevertheless."""
Figures = dict[str, Any]


def main() -> None:
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "demo")
    _footscan("demo", "--folder", folder)
    tables = {"block": _block_table(folder), "foot": _foot_table(folder)}
    page = DOCS / "verification.md"
    page.write_text(MARKED.sub(lambda found: found[1] + tables[found[2]] + found[3], page.read_text("utf-8")), "utf-8")
    print("\n".join(tables.values()))


def _block_table(folder: Path) -> str:
    """Table 6-1: the block of 150 x 100 x 50 mm."""
    turned, square = (_scanned_block(folder, turn) for turn in BLOCK_TURN_DEG)
    lines = [
        "| nominal mm | thesis | virtual scan | the same block square to the travel, `--turn-deg 0` |",
        "|---|---|---|---|",
    ]
    for ours, beside in zip(turned, square, strict=True):
        lines.append(f"| {ours['nominal_mm']:g} | {ours['thesis_mm']} | {_dimension(ours)} | {_dimension(beside)} |")
    return "\n".join(lines) + "\n"


def _scanned_block(folder: Path, turn_deg: int) -> list[Figures]:
    scan = folder / "blocks" / "P0001" / f"block-{turn_deg}"  # the demo measures all of its archive
    if not (scan / "scan.yaml").exists():
        _footscan("simulate", "scan", "--block", "--turn-deg", turn_deg, "--out", scan)
    calibration = folder / "calibration.json"
    _footscan("run", "--scan", scan, "--calibration", calibration, "--out", folder / "results", expected=IS_NO_FOOT)
    found = json.loads(_footscan("verify", "block", folder / "results" / "P0001" / scan.name, "--json"))
    rows: list[Figures] = found["table_6_1"]
    return rows


def _dimension(row: Figures) -> str:
    return f"{row['value_mm']:.3f} ± {row['uncertainty_mm']:.3f}"


def _foot_table(folder: Path) -> str:
    """The foot's distances to what it should be."""
    scan = next((folder / "archive").glob("*/demo-*/scan.yaml")).parent
    foot = folder / "results" / scan.parent.name / scan.name / "foot.stl"
    ours = json.loads(_footscan("compare", foot, scan / "truth.stl", "--json"))
    return (
        "| distance, mm | thesis, to an industrial scan | virtual scan, to the truth |\n"
        "|---|---|---|\n"
        f"| mean | {THESIS_MEAN_MM} | {ours['mean']:.3f} |\n"
        f"| standard deviation | | {ours['std']:.3f} |\n"
        f"| 95th percentile | | {ours['p95']:.3f} |\n"
        f"| 99th percentile | | {ours['p99']:.3f} |\n"
        f"| largest | {THESIS_MAX_MM} | {ours['max']:.3f} |\n"
    )


def _footscan(*arguments: object, expected: int = 0) -> str:
    done = subprocess.run([FOOTSCAN, *map(str, arguments)], check=False, stdout=subprocess.PIPE, text=True)
    if done.returncode != expected:
        raise SystemExit(done.returncode)  # the command has said why
    return done.stdout


if __name__ == "__main__":
    main()
