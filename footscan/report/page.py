"""A self-contained HTML page, whose content security policy lets a browser load nothing else."""

import base64
import hashlib
from collections.abc import Iterable, Sequence

from footscan.report.markup import text
from footscan.report.style import STYLE


def page(
    *,
    title: str,
    kicker: str,
    heading: str,
    parts: Iterable[str],
    scripts: Sequence[str] = (),
    style: str = "",
    pictures: str = "data:",
) -> str:
    """A self-contained HTML page.

    Parameters
    ----------
    title, kicker : any text; the kicker stands above the heading
    heading, parts : markup
    scripts : JavaScript that runs once the page is loaded; a browser runs only these scripts, by their digests
    style : CSS in addition to that of all pages
    pictures : permitted sources of pictures, as in a content security policy; default: the page itself
    """
    digests = "".join(f" 'sha256-{base64.b64encode(hashlib.sha256(s.encode()).digest()).decode()}'" for s in scripts)
    return _PAGE.format(
        policy=f"default-src 'none'; img-src {pictures}; style-src 'unsafe-inline'; script-src{digests or ' ' + _NONE}",
        title=text(title),
        style=STYLE + style,
        kicker=text(kicker),
        heading=heading,
        parts="\n".join(parts),
        scripts="".join(f"<script>{script}</script>\n" for script in scripts),
    )


_NONE = "'none'"
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
{scripts}</body>
</html>
"""
