"""The shell of all pages of the console: the bar with state and Stop, and the scripts."""

from collections.abc import Iterable

from footscan.report.markup import text


def shell(*, title: str, parts: Iterable[str], scripts: Iterable[str] = ()) -> str:
    """Return a page with the shell around its parts.

    Parameters
    ----------
    title : any text
    parts : markup
    scripts : names of files in `static` in addition to link.js
    """
    loaded = "".join(f'<script src="/static/{name}" defer></script>\n' for name in ("link.js", *scripts))
    return _PAGE.format(title=text(title), parts="\n".join(parts), scripts=loaded)


_PAGE = """\
<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<link rel="icon" href="data:,">
<link rel="stylesheet" href="/static/console.css">
{scripts}</head>
<body>
<header id="bar">
<a class="home" href="/">footscan</a>
<div id="state" data-level="unknown"><span role="status"><b id="state-name">Connecting to the server</b>
<span id="state-words"></span></span><span id="count"></span></div>
<progress id="progress" max="1" hidden aria-label="Progress"></progress>
<button id="stop" type="button" aria-keyshortcuts="Escape">Stop<small>Esc</small></button>
</header>
<main>
<p id="told" role="alert" hidden></p>
<p id="others" hidden><span>Another page is in charge. This page shows the state; “Stop” works here, too.</span>
<button id="take-over" type="button">Take over</button></p>
{parts}
</main>
</body>
</html>
"""
