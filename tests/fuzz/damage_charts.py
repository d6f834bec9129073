"""Damage to a calibration chart: what people mistype and spreadsheets spoil, and worse."""

import math
from collections.abc import Callable
from random import Random

from damage_text import damage_text

Rows = list[list[str]]
"""The header, and the cells of each control point."""
RowDamage = Callable[[Random, Rows], str]
"""Changes the rows and says how."""

NUMBERS = ("x", "y", "z", "i", "j")
MISTYPED = (
    *("nan", "NaN", "inf", "-inf", "1e308", "-1e308", "1e-320", "1e-400", "1e6", "-1e6", "1000001", "1e5", "-5", "0"),
    *("-0", "639", "640", "479", "480", "1,5", "12.3.4", "O", "1_000", "٣", "0x10", "1e", "--3", "+7", "=A1", "null"),
    *("None", "#REF!", "½", "1/2", "TRUE", "-", ".", '"'),
    *("", " ", "\u00a012", "1 2", "5 mm", "9" * 400, "0." + "0" * 400 + "1"),
)
CAMERAS = (
    *("0", "-1", "1000000000", "999999999", "1e9", "1.0", "one", "01", "٣", "2147483648", "+1", "8", "2", "", "1 2"),
)
SEPARATORS = ((";", "semicolons for commas"), ("\t", "tabs for commas"), (" ", "blanks for commas"), (", ", ""))


def damage_chart(random: Random, content: bytes) -> tuple[bytes, list[str]]:
    """The bytes of a chart with one to three things done to it, and which."""
    rows = [line.split(",") for line in content.decode().splitlines()]
    words = [_fewer_cameras(random, rows)]
    in_bytes = random.random() < 0.3
    count = random.choice((0, 1)) if in_bytes else random.choice((1, 1, 1, 2, 3))
    words += [random.choice(ROW_DAMAGES)(random, rows) for _ in range(count) if rows]
    separator, words_of_it = (",", None) if random.random() < 0.96 else random.choice(SEPARATORS)
    damaged = "".join(separator.join(row) + "\n" for row in rows).encode()
    if words_of_it:
        words.append(words_of_it)
    if in_bytes:
        damaged, what = damage_text(random, damaged)
        words.append(what)
    return damaged, [word for word in words if word]


def _fewer_cameras(random: Random, rows: Rows) -> str:
    """No damage: the fewer cameras, the more charts in the same time."""
    cameras = sorted({row[0] for row in rows[1:]})
    kept = cameras if random.random() < 0.08 else random.sample(cameras, random.choice((1, 2, 3)))
    rows[1:] = [row for row in rows[1:] if row[0] in kept]
    return f"cameras {', '.join(sorted(kept))}"


def _column(rows: Rows, name: str) -> int:
    """Where the column of x, y, z, i or j stands, as far as the header still tells."""
    found = [k for k, cell in enumerate(rows[0]) if cell.strip().lower()[:1] == name and cell[:2] != "ca"]
    return found[0] if found else 0


def _points(random: Random, rows: Rows) -> list[list[str]]:
    """All rows of points, or those of one camera, that are wide enough to be changed."""
    points = [row for row in rows[1:] if len(row) > max(_column(rows, name) for name in NUMBERS)]
    if points and random.random() < 0.6:
        camera = random.choice(points)[0]
        points = [row for row in points if row[0] == camera]
    return points


def _map(points: list[list[str]], column: int, change: Callable[[float], float]) -> None:
    for row in points:
        try:
            row[column] = f"{change(float(row[column])):.12g}"
        except (ValueError, OverflowError):
            continue  # damaged before


def _cell(random: Random, rows: Rows) -> tuple[int, int]:
    line = random.randrange(len(rows))
    return line, random.randrange(max(len(rows[line]), 1))


def _value_mistyped(random: Random, rows: Rows) -> str:
    line, column = _cell(random, rows)
    if not rows[line]:
        return ""
    was, now = rows[line][column], random.choice(MISTYPED)
    rows[line][column] = now
    return f"line {line + 1}: {was!r} became {now[:20]!r}"


def _digits_mistyped(random: Random, rows: Rows) -> str:
    points = _points(random, rows)
    words = []
    for _ in range(random.choice((1, 1, 2, 4)) if points else 0):
        row = random.choice(points)
        column = _column(rows, random.choice(NUMBERS))
        was = row[column]
        row[column] = _mistype(random, was)
        words.append(f"camera {row[0]}, point {row[1]}: {was} became {row[column]}")
    return "; ".join(words)


def _mistype(random: Random, text: str) -> str:
    """`text` as a tired person writes it."""
    if not text:
        return "0"
    k = random.randrange(len(text))
    return random.choice(
        (
            text[:k] + text[k + 1 :],
            text[:k] + text[k] + text[k:],
            text[:k] + text[k + 1 : k + 2] + text[k] + text[k + 2 :],
            text[:k] + random.choice("0123456789") + text[k + 1 :],
            text[1:] if text.startswith("-") else "-" + text,
            text.replace(".", "") if "." in text else text[:k] + "." + text[k:],
            text + "0",
        )
    )


def _column_of_one_value(random: Random, rows: Rows) -> str:
    name, value = random.choice(NUMBERS), random.choice(MISTYPED)
    for row in _points(random, rows):
        row[_column(rows, name)] = value
    return f"all {name} are {value[:20]!r}"


def _swapped_in_a_row(random: Random, rows: Rows) -> str:
    points = _points(random, rows)
    one, other = random.sample(NUMBERS, 2)
    a, b = _column(rows, one), _column(rows, other)
    chosen = random.sample(points, min(len(points), random.choice((1, 1, 2, 1000))))
    for row in chosen:
        row[a], row[b] = row[b], row[a]
    return f"{one} and {other} swapped in {len(chosen)} rows"


def _swapped_between_rows(random: Random, rows: Rows) -> str:
    points = _points(random, rows)
    if len(points) < 2:
        return ""
    one, other = random.sample(points, 2)
    columns = [_column(rows, name) for name in random.choice((("i", "j"), ("y", "z"), ("i",), ("z",), NUMBERS))]
    for column in columns:
        one[column], other[column] = other[column], one[column]
    return f"camera {one[0]}: columns {columns} of points {one[1]} and {other[1]} swapped"


def _header_changed(random: Random, rows: Rows) -> str:
    if not rows[0]:
        return ""
    k = random.randrange(len(rows[0]))
    was = rows[0][k]
    others = (was.upper(), f" {was} ", f"{was}s", "i", "y_cm", "z_mm")
    now = random.choice((*("", "x", "I", "kamera", "x_m", "y_inch", "col", "u", '"'), *others))
    rows[0][k] = now
    return f"header {was!r} became {now!r}"


def _header_without_rows(random: Random, rows: Rows) -> str:
    what = random.choice(("lost", "twice", "shuffled", "last", "in the middle", "alone"))
    if what == "lost":
        del rows[0]
    elif what == "twice":
        rows.insert(1, list(rows[0]))
    elif what == "shuffled":
        random.shuffle(rows[0])
    elif what == "alone":
        del rows[1:]
    else:
        rows.insert(len(rows) if what == "last" else len(rows) // 2, rows.pop(0))
    return f"header {what}"


def _columns_changed(random: Random, rows: Rows) -> str:
    width = min((len(row) for row in rows), default=0)
    if not width:
        return ""
    k, to = random.randrange(width), random.randrange(width)
    what = random.choice(("lost", "repeated", "moved", "added"))
    for row in rows:
        if what == "lost":
            del row[k]
        elif what == "repeated":
            row.insert(to, row[k])
        elif what == "moved":
            row.insert(to, row.pop(k))
        else:
            row.insert(to, random.choice(("", "1", "remark")))
    return f"column {k + 1} {what}"


def _cells_too_many_or_few(random: Random, rows: Rows) -> str:
    line = random.randrange(len(rows))
    if not rows[line]:
        return ""
    if random.random() < 0.5:
        rows[line].insert(random.randrange(len(rows[line]) + 1), random.choice(("", "1", "x")))
        return f"line {line + 1}: a cell too many"
    del rows[line][random.randrange(len(rows[line]))]
    return f"line {line + 1}: a cell too few"


def _other_unit(random: Random, rows: Rows) -> str:
    factor = random.choice((0.1, 10.0, 0.001, 1000.0, 25.4, 1 / 25.4))
    points = _points(random, rows)
    points = random.sample(points, max(1, len(points) // random.choice((1, 1, 2, 5)))) if points else []
    for name in ("x", "y", "z"):
        _map(points, _column(rows, name), lambda value: value * factor)
    return f"x, y, z of {len(points)} rows times {factor:g}"


def _header_of_other_unit(random: Random, rows: Rows) -> str:
    columns = random.choice((("x", "y", "z"), ("x", "y", "z"), ("y",), ("y", "z")))
    for name in columns:
        k = _column(rows, name)
        if rows[0]:
            rows[0][k] = rows[0][k].replace("mm", "CM").replace("cm", "mm").replace("CM", "cm")
    return f"header of {', '.join(columns)} in the other unit"


def _rows_repeated(random: Random, rows: Rows) -> str:
    points = _points(random, rows)
    chosen = random.sample(points, min(len(points), random.choice((1, 3, 1000))))
    renamed = random.random() < 0.7
    far = random.choice((0.0, 0.0, 1.0, 100.0))
    for number, row in enumerate(chosen):
        twin = list(row)
        if renamed:
            twin[1] = f"again{number}"
            _map([twin], _column(rows, "i"), lambda value: value + far)
        rows.append(twin)
    return f"{len(chosen)} rows repeated" + (f" under new names, {far:g} px away" if renamed else "")


def _rows_shuffled(random: Random, rows: Rows) -> str:
    points = rows[1:]
    random.shuffle(points)
    rows[1:] = points
    return "rows shuffled"


def _few_rows(random: Random, rows: Rows) -> str:
    keep, left, points = random.randrange(8), {}, []
    shuffled = random.sample(rows[1:], len(rows) - 1)
    for row in shuffled:
        camera = row[0] if row else ""
        left[camera] = left.get(camera, 0) + 1
        if left[camera] <= keep:
            points.append(row)
    rows[1:] = points
    return f"{keep} rows a camera"


def _degenerate(random: Random, rows: Rows) -> str:
    points = _points(random, rows)
    names = random.choice((("i", "j"), ("y", "z"), ("x", "y", "z", "i", "j")))
    a, b = (_column(rows, name) for name in names[-2:])
    what = random.choice(("at one place", "on a line", "nearly on a line", "at two places", "on a line but one"))
    if not points:
        return ""
    slope, height = random.choice((0.0, 1.0, -0.7, 1e-9)), random.uniform(0, 300)
    kept = points[1:] if what == "on a line but one" else points
    for number, row in enumerate(kept):
        if what == "at one place":
            for name in names:
                row[_column(rows, name)] = points[0][_column(rows, name)]
        elif what == "at two places":
            for name in names:
                row[_column(rows, name)] = points[number % 2][_column(rows, name)]
        else:
            away = random.gauss(0, 1e-6) if what.startswith("nearly") else 0.0
            _map([row], b, lambda _, row=row, away=away: height + slope * float(row[a]) + away)
    return f"{', '.join(names)} of {len(kept)} points {what}"


def _cameras_changed(random: Random, rows: Rows) -> str:
    value = random.choice(CAMERAS)
    points = _points(random, rows)
    if points and random.random() < 0.4:
        points = [random.choice(points)]
    if points and random.random() < 0.2:
        for row in points:
            row[0] = random.choice("12345678")
        return f"cameras of {len(points)} rows at random"
    for row in points:
        row[0] = value
    return f"camera of {len(points)} rows became {value!r}"


def _noise(random: Random, rows: Rows) -> str:
    names = random.choice((("i", "j"), ("y", "z"), ("x",), ("i",)))
    size = random.choice((0.1, 1.0, 5.0, 30.0, 300.0))
    for name in names:
        _map(_points(random, rows), _column(rows, name), lambda value: value + random.gauss(0, size))
    return f"{', '.join(names)} with noise of {size:g}"


def _other_axes(random: Random, rows: Rows) -> str:
    points = _points(random, rows)
    name, what, change = random.choice(
        (
            ("i", "mirrored", lambda value: 639 - value),
            ("j", "counted from below", lambda value: 479 - value),
            ("i", "twice as large", lambda value: 2 * value),
            ("j", "half as large", lambda value: value / 2),
            ("i", "1000 further", lambda value: value + 1000),
            ("j", "40 px further", lambda value: value + 40),
            ("y", "of the other sign", lambda value: -value),
            ("z", "of the other sign", lambda value: -value),
            ("z", "100 higher", lambda value: value + 100),
            ("y", "all zero", lambda value: 0 * value),
            ("z", "a millionth", lambda value: value * 1e-6),
            ("y", "a million times", lambda value: value * 1e6),
            ("i", "rounded to 20", lambda value: 20 * round(value / 20)),
            ("j", "exponential", lambda value: math.exp(value / 50)),
            ("i", "beyond counting", lambda value: value * 1e300),
        )
    )
    _map(points, _column(rows, name), change)
    return f"{name} of {len(points)} rows {what}"


def _names_changed(random: Random, rows: Rows) -> str:
    name = random.choice(
        ("", "P1", "a" * 10_000, "[bold]P[/bold]", "[/]", '"P\n1"', '"P,1"', '"P""1"', "é", "\u202eP", "%d", "\x1b[2J")
    )
    points = _points(random, rows)
    for row in points[: random.choice((1, 1000))]:
        row[1] = name
    return f"points named {name[:20]!r}"


def _unclosed_quote(random: Random, rows: Rows) -> str:
    line, column = _cell(random, rows)
    if not rows[line]:
        return ""
    rows[line][column] = random.choice(('"', "'", '""', '"\n', '"""')) + rows[line][column]
    return f"line {line + 1}: a quote before cell {column + 1}"


def _remarks(random: Random, rows: Rows) -> str:
    remark = random.choice((["# a remark"], [""], [], [""] * 7, ["-" * 80], ["camera 3 below"], ["\0"]))
    rows.insert(random.randrange(len(rows) + 1), list(remark))
    return f"a line {','.join(remark)[:20]!r} put in"


ROW_DAMAGES: tuple[RowDamage, ...] = (
    *(_value_mistyped, _value_mistyped, _digits_mistyped, _digits_mistyped, _digits_mistyped, _column_of_one_value),
    *(_swapped_in_a_row, _swapped_in_a_row, _swapped_between_rows, _header_changed, _header_without_rows),
    *(_columns_changed, _cells_too_many_or_few, _other_unit, _other_unit, _header_of_other_unit, _rows_repeated),
    *(_rows_shuffled, _few_rows, _few_rows, _degenerate, _degenerate, _cameras_changed, _cameras_changed, _noise),
    *(_noise, _other_axes, _other_axes, _names_changed, _unclosed_quote, _remarks),
)
"""What is done more often stands more often."""
