"""A page that stands alone: what it shows is in it, and a browser is told to load nothing else."""

from collections.abc import Iterable

from footscan.report.markup import text
from footscan.report.style import STYLE
from footscan.report.viewer import SCRIPT, SCRIPT_DIGEST

_POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src '" + SCRIPT_DIGEST + "'"
"""A browser refuses whatever is not on the page itself."""


def page(*, title: str, kicker: str, heading: str, parts: Iterable[str], with_viewer: bool = True) -> str:
    """A self-contained HTML page.

    Parameters
    ----------
    title, kicker : any text; the kicker stands above the heading
    heading, parts : markup
    with_viewer : whether one of the parts holds a `footscan.report.viewer.viewer`, which needs its script
    """
    return _PAGE.format(
        policy=_POLICY,
        title=text(title),
        style=STYLE,
        kicker=text(kicker),
        heading=heading,
        parts="\n".join(parts),
        script=f"<script>{SCRIPT}</script>\n" if with_viewer else "",
    )


_PAGE = """\
<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="{policy}">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>
{style}</style>
</head>
<body>
<header><p>{kicker}</p><h1>{heading}</h1></header>
<main>
{parts}
</main>
{script}</body>
</html>
"""
