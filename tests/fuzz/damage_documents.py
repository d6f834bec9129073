"""Documents and tables with hostile values in place of sound ones: the form is right, so that it is read to the end."""

import csv
import io
import json
from random import Random
from typing import Any

import yaml

HOSTILE: tuple[Any, ...] = (
    *(None, True, False, "", " ", [], {}, 0, -1, 1, 2**31, 2**62, 2**64, -(2**63), 10**400, 0.0, -0.0, 1e-320),
    *(1e9, 1e15, 1e154, 1e200, 1e308, -1e308, float("inf"), float("-inf"), float("nan"), "nan", "inf", "1e308", "0x10"),
    *("9" * 5000, "x" * 5000, "\0", "a\0b", "a\nb", "\x1b[31m", "../../../etc/passwd", "/etc/passwd", "/dev/zero", "."),
    *("..", "~", "C:\\x", "file:///etc/passwd", "s3://nowhere", "=1+1", "{0}", "%s", "[red]", "\u202e", "\ud800", "é"),
    *([1] * 3000, [[]] * 3000, ["x"] * 3000, {"a": 1}, {str(n): n for n in range(3000)}, [[[[[[[[1]]]]]]]]),
    *("footscan.scan/2", "footscan.measures/2", "footscan.calibration/99", "2026-02-30", "999999-01-01"),
)


def damage_document(random: Random, name: str, content: bytes) -> tuple[bytes, str]:
    """A JSON or YAML document with some of its values replaced, taken out or repeated, and what was done."""
    text = content.decode()
    value: Any = json.loads(text) if name.endswith(".json") else yaml.safe_load(text)
    words = [_replace_one(random, value) for _ in range(random.choice((1, 1, 1, 2, 5)))]
    if name.endswith(".json"):
        return json.dumps(value).encode("utf-8", "replace"), "; ".join(words)
    return yaml.safe_dump(value, allow_unicode=True).encode("utf-8", "replace"), "; ".join(words)


def damage_table(random: Random, content: bytes) -> tuple[bytes, str]:
    """A CSV with some of its cells replaced, or rows in great number, and what was done."""
    rows = list(csv.reader(io.StringIO(content.decode())))
    words = []
    for _ in range(random.choice((1, 1, 2, 5))):
        row = random.randrange(len(rows))
        if random.random() < 0.1:
            rows += [list(rows[row]) for _ in range(random.choice((1, 3000)))]
            words.append(f"row {row} repeated")
        elif rows[row]:
            cell, hostile = random.randrange(len(rows[row])), str(random.choice(HOSTILE))
            rows[row][cell] = hostile.encode("utf-8", "replace").decode()
            words.append(f"cell {row}, {cell} = {hostile[:30]!r}")
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue().encode("utf-8", "replace"), "; ".join(words)


def _replace_one(random: Random, value: Any) -> str:
    holder, path = value, []
    while isinstance(holder, dict | list) and holder:
        key = random.choice(list(holder) if isinstance(holder, dict) else range(len(holder)))
        path.append(str(key))
        inner = holder[key]
        if not (isinstance(inner, dict | list) and inner) or random.random() < 0.15:
            return f"{'.'.join(path)} {_spoil(random, holder, key)}"
        holder = inner
    return "nothing to replace"


def _spoil(random: Random, holder: Any, key: Any) -> str:
    kind = random.random()
    if kind < 0.08:
        del holder[key]
        return "taken out"
    if kind < 0.16 and isinstance(holder, dict):
        name = random.choice(("x" * 300, "format", "unit", f"{key}s", "", "\0", "__class__"))
        holder[name] = holder[key]
        return f"also as {name[:20]!r}"
    if kind < 0.22 and isinstance(holder, list):
        holder += [holder[key]] * random.choice((1, 1000))
        return "repeated"
    holder[key] = random.choice(HOSTILE)
    return f"= {str(holder[key])[:40]!r}"
