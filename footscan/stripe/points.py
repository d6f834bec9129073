"""The stripe points of a frame or a film."""

import numpy as np
from numpy.typing import NDArray

STRIPE_DTYPE = np.dtype(
    [
        ("frame", "<i4"),
        ("i", "<f8"),
        ("j", "<f8"),
        ("width", "<f4"),
        ("peak", "<f4"),
        ("score", "<f4"),
        ("saturation", "<f4"),
        ("sigma", "<f4"),
    ]
)
"""One point of the stripe.

frame : number of the frame in its film, from 0
i, j : centre of the stripe, px, image frame: column and row, the centre of the top-left pixel at (0, 0)
width : full width at half height across the stripe, px
peak : red at the centre, grey levels 0 to 255
score : 0 to 1, the contrast of the stripe, relative to itself plus `faintest_contrast`, times its symmetry across
saturation : 0 to 1, the part of the width in which red is saturated
sigma : expected standard deviation of the centre across the stripe, px
"""

StripePoints = NDArray[np.void]
"""(N,) of `STRIPE_DTYPE`."""
