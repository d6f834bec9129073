"""Small pieces of HTML. All data of a scan pass through `text`, which escapes them."""

import base64
from collections.abc import Iterable, Sequence
from html import escape

UNITS = {"mm": ("mm", 1), "mm2": ("mm²", 0), "mm3": ("mm³", 0), "deg": ("°", 1), "1": ("", 3)}
"""How the unit of a measure is written, and the decimals of its values."""
NARROW_SPACE = "\N{NARROW NO-BREAK SPACE}"


def text(value: object) -> str:
    """Escape `value` for use between tags and within quoted attributes; control characters are replaced.

    >>> text("<b>&")
    '&lt;b&gt;&amp;'
    """
    return escape("".join(c if c.isprintable() or c in "\n\t" else "\N{REPLACEMENT CHARACTER}" for c in str(value)))


def number(value: float, decimals: int = 0) -> str:
    """Write `value` with a fixed number of decimals, a minus sign and narrow spaces between thousands.

    >>> number(265.14, 1)
    '265.1'
    """
    digits = f"{abs(value):,.{decimals}f}".replace(",", NARROW_SPACE)
    return f"\N{MINUS SIGN}{digits}" if value < 0 and digits.strip("0.") else digits


def number_or_dash(value: float | None, decimals: int = 0) -> str:
    """Write `value` as `number` does, and a dash where there is none.

    >>> number_or_dash(265.14, 1), number_or_dash(None)
    ('265.1', '–')
    """
    return "–" if value is None else number(value, decimals)


def plus_minus(deviation: float | None, decimals: int) -> str:
    """Write one standard deviation as the cell beside a value with as many decimals.

    >>> plus_minus(0.234, 1), plus_minus(None, 1)
    ('± 0.23', '')
    """
    return "" if deviation is None else f"± {number(deviation, decimals + 1)}"


def words(name: str) -> str:
    """Write the identifier `name` as a phrase.

    >>> words("ball_girth")
    'Ball girth'
    """
    phrase = name.replace("_", " ")
    return phrase[:1].upper() + phrase[1:]


def breakable(name: str) -> str:
    """Escape the identifier `name`, and let lines break after its dots and underscores."""
    return text(name).replace("_", "_<wbr>").replace(".", ".<wbr>")


def table(
    headings: Sequence[str], rows: Iterable[Sequence[str]], numeric: Iterable[int] = (), kind: str = "plain"
) -> str:
    """A table of cells that are markup already; the columns in `numeric` are right-aligned.

    The first cell of each row is its heading. `kind` is the CSS class of the table.
    On a narrow screen the table scrolls in a box of its own.
    """
    right = set(numeric)
    marks = [' class="n"' if column in right else "" for column in range(len(headings))]
    head = "".join(f'<th scope="col"{mark}>{cell}</th>' for mark, cell in zip(marks, headings, strict=True))
    body = "".join(
        f'<tr><th scope="row"{marks[0]}>{row[0]}</th>'
        + "".join(f"<td{mark}>{cell}</td>" for mark, cell in zip(marks[1:], row[1:], strict=True))
        + "</tr>\n"
        for row in rows
    )
    top = f"<thead><tr>{head}</tr></thead>\n" if any(headings) else ""
    return f'<div class="wide"><table class="{kind}">\n{top}<tbody>\n{body}</tbody></table></div>'


def facts(pairs: Iterable[tuple[str, str]]) -> str:
    """Pairs of name and value, as many in a row as fit; both are markup already."""
    return '<dl class="facts">' + "".join(f"<div><dt>{n}</dt><dd>{v}</dd></div>" for n, v in pairs) + "</dl>"


def key(meanings: Iterable[tuple[str, tuple[int, int, int]]]) -> str:
    """A legend of colours: pairs of markup and RGB."""
    marks = (f'<span><i style="background:rgb{colour}"></i>{meaning}</span>' for meaning, colour in meanings)
    return f'<p class="key">{"".join(marks)}</p>'


def section(title: str, *parts: str) -> str:
    """A part of the page under its own heading; `parts` are markup already."""
    return f"<section>\n<h2>{text(title)}</h2>\n" + "\n".join(parts) + "\n</section>"


def data_uri(kind: str, content: bytes) -> str:
    """Encode `content` of the media type `kind` as a data URI."""
    return f"data:{kind};base64,{base64.b64encode(content).decode('ascii')}"
