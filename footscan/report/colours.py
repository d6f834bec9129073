"""Colours of signed distances, and their colour bar."""

import numpy as np
from numpy.typing import NDArray

from footscan.report.markup import number

_STOPS = np.array(
    [[24, 62, 140], [67, 133, 196], [158, 202, 225], [244, 244, 240], [250, 190, 140], [224, 100, 68], [150, 22, 38]],
    np.float64,
)
"""Blue inside, nearly white at zero, red outside; lightness falls to both ends, for colour-blind readers too."""
_UNKNOWN = np.array([165, 165, 165], np.uint8)
"""Grey of an unknown distance."""
_LEAST_LIMIT_MM = 0.5
"""Shortest scale; chosen by hand."""
_SHARE = 0.98
"""Share of the distances that the scale covers at least; chosen by hand."""


def colour_limit(distance: NDArray[np.floating]) -> float:
    """End of the colour scale of (V,) signed distances, mm: a multiple of 0.5 mm that covers 98 % of them.

    >>> colour_limit(np.array([0.2, -0.9, np.nan]))
    1.0
    """
    finite = np.abs(distance[np.isfinite(distance)])
    if not finite.size:
        return _LEAST_LIMIT_MM
    return max(_LEAST_LIMIT_MM, float(np.ceil(np.quantile(finite, _SHARE) * 2)) / 2)


def distance_colours(distance: NDArray[np.floating], limit: float) -> NDArray[np.uint8]:
    """(V, 3) RGB of (V,) signed distances: blue from -`limit` down, red from +`limit` up, grey where not finite."""
    position = np.clip((np.asarray(distance, np.float64) / limit + 1) / 2, 0, 1) * (len(_STOPS) - 1)
    stops = np.arange(len(_STOPS))
    colours = np.column_stack([np.interp(position, stops, _STOPS[:, channel]) for channel in range(3)])
    colours[~np.isfinite(distance)] = _UNKNOWN
    return np.rint(colours).astype(np.uint8)


def colour_bar(limit: float, *, signed: bool = True) -> str:
    """Draw the colours from -`limit` to +`limit` mm as SVG with figures below; unsigned distances begin at 0."""
    steps = 100
    least = -limit if signed else 0.0
    colours = distance_colours(least + (np.arange(steps) + 0.5) / steps * (limit - least), limit)
    # Each step reaches below the next, so that no seam shows between them.
    bars = "".join(
        f'<rect x="{20 + 3 * k}" y="0" width="{300 - 3 * k}" height="14" fill="#{r:02x}{g:02x}{b:02x}"/>'
        for k, (r, g, b) in enumerate(colours)
    )
    figures = "".join(
        f'<text x="{20 + 75 * k}" y="30" text-anchor="middle">{"+" if signed and at > 0 else ""}{number(at, 2)}</text>'
        for k, at in enumerate(np.linspace(least, limit, 5).tolist())
    )
    meaning = ": blue lies inside it, red outside" if signed else ", to any side"
    return (
        '<figure class="bar"><svg viewBox="0 0 340 36" role="img" aria-label="Colour bar">'
        f'{bars}<rect class="frame" x="20" y="0" width="300" height="14"/>{figures}</svg>'
        f"<figcaption>Distance to the reference model in mm{meaning}</figcaption></figure>"
    )
