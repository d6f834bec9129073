"""The plane of the glass plate, from the skin that is pressed onto it.

Skin on glass lies in one plane; the skin beside it rises, and is spread over all heights. So the heights above the
right plane have a narrow peak at 0 and a broad tail above it. The plane and the shares of peak and tail are fitted
together by expectation maximisation (A. Dempster, N. Laird and D. Rubin, J. R. Stat. Soc. B 39(1), 1977), for each
camera below the glass. What two cameras disagree about is their systematic error, which no number of points reduces:
the standard deviations follow from it.

The cameras look through the plate, which stood at Z = 0 when they were calibrated. A plate of plane faces displaces a
ray by a length that depends on its angle, not on where along the ray the plate stands: a plate that was moved along its
normal changes nothing in the map. A tilt changes the angle. For a camera that looks up at 45 degrees through glass of
index 1.5, half a degree about Y displaces what it sees by 0.007 thicknesses, 0.04 mm in 6 mm; upwards on one side of
the laser plane and downwards on the other, so that the mean of the cameras hardly errs, and their difference shows in
the standard deviation.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from footscan.cloud.points import PLANE_MM, copied, joined, stripe_step
from footscan.cloud.views import View
from footscan.compiled import compiled
from footscan.rows import distinct_rows
from footscan.side_by_side import together
from schemas.glass import CALIBRATED, GlassPlane, Plane, Term

Floats = NDArray[np.float64]

TERMS: tuple[Term, ...] = ("height", "tilt_y", "tilt_x")
"""Names of the terms of a plane Z = height + along X + across Y."""
REACH_MM = 8.0
"""Heights between which the contact is looked for: the 3 mm of a plate that was moved, and 1 degree over half a foot of
300 mm. Chosen by hand."""
LARGEST_TILT_DEG = 1.5
"""Largest tilt of a plate: 10 mm in the 400 mm of the travel, more than any frame of a plate allows."""
GUESS_STEP_DEG, GUESS_BIN_MM, GUESS_BINS = 0.25, 0.1, 6
"""Steps of the tilts that are tried first: they leave 0.27 mm over half a foot, less than half the height of the layer
in which points are counted."""
STRIP_MM, FEWEST_IN_STRIP = 4.0, 4
"""Pieces of stripe that count once for the first guess, whatever their number of points. Chosen by hand."""
FEWEST = 200
"""Points near the glass below which no contact is looked for. Chosen by hand."""
BAND_MM = 1.0
"""Heights on either side of the plane that are fitted: soft skin rises out of them within a few millimetres. Chosen by
hand."""
SIGMA_MM = (0.02, 0.25)
"""Least and largest standard deviation of points in the plane: from what a good camera resolves to the noise of dim
stripes, beyond which contact cannot be told from skin that rises. Chosen by hand."""
REWEIGHTINGS = 40
"""Rounds of expectation maximisation: in 39 of 40 drawn worlds the plane has settled to less than 1 µm by then."""
FIRST_SHARES = (0.6, 0.3, 0.1)
"""Shares of contact, rising skin and strays from which it starts. Chosen by hand."""
TINY = 1e-300
"""Divisor instead of a sum of weights that are all 0."""
SOLE_SHARE = (0.01, 0.99)
"""Quantiles of the points near the glass at which the sole ends. Chosen by hand."""
PROMINENT = 3.0
"""Contact is so many times as frequent as rising skin within two standard deviations of the plane. Drawn feet have 4 to
20; an arch without contact up to 1.6, a sole that is bent along the foot with a radius of 3 m up to 1.3."""
LEAST_MM2 = 200.0
"""Least area of contact: the heel of a child's foot of 120 mm has twice as much. Chosen by hand."""
FEWEST_CAMERAS = 2
"""One camera alone does not show its own error."""
AGREED_MM, AGREED_TIMES = 0.2, 4.0
"""A camera is left out if its plane is farther than this from the median of all, and than so many median distances: it
was knocked. Drawn cameras that were not knocked are within 0.1 mm."""
LEAST_SD_MM, LEAST_SD_CAMERAS = 0.02, 2
"""Deviation of a camera's plane that is assumed at least, and the number of cameras that this assumption counts for: by
chance, two to four cameras may agree better. 0.02 mm is the scatter of drawn calibrations whose corners are located to
0.05 px."""
SUPPORTED_MM = 0.2
"""A term is supported if its standard deviation displaces the glass by less than this at the ends of the foot; that is
less than the 0.3 mm from which measures count as wrong."""
SPANNED = 0.5
"""... and a tilt only if four standard deviations of the contact are this share of the sole: a heel alone, or a strip
of the plate that shines beside the foot, says little of the glass at the toes. Heel and ball have 1.2 along X. Chosen
by hand."""
SIGNIFICANT = 3.0
"""A plane off zero by so many standard deviations of any term takes the place of Z = 0."""


class _Contact(NamedTuple):
    """The contact as one camera sees it."""

    points: NDArray[np.void]
    weights: Floats
    """(N,) probability of each point to be contact."""
    terms: Floats
    """(3,) height at X = Y = 0, mm, and rises along X and Y."""
    covariance: Floats
    """(3, 3) of the terms, by the scatter from stripe to stripe."""


class _Mean(NamedTuple):
    """The mean plane of several cameras."""

    centre: Floats
    """(2,) X and Y of the middle of the contact, mm."""
    extent: Floats
    """(2,) standard deviations of X and Y of the contact, mm."""
    terms: Floats
    """(3,) height there, mm, and rises along X and Y."""
    deviations: Floats
    """(3,) of the terms, which hardly correlate there."""
    cameras: list[int]
    area_mm2: float
    stripes: int
    """Number of stripe planes that meet the contact."""


def estimate_glass(points: NDArray[np.void], views: Mapping[int, View]) -> GlassPlane:
    """Estimate height and tilt of the glass from the skin on it.

    Parameters
    ----------
    points : (N,) of `POINT_DTYPE`, mm, scanner frame, all finite; what is no foot may be among them
    views : camera -> view, mm

    Examples
    --------
    Two cameras see a sole whose middle, 40 mm broad, lies on glass that stands 1 mm too high:

    >>> from footscan.cloud.points import make_points
    >>> x, y = (grid.ravel() for grid in np.meshgrid(np.arange(0.0, 200, 2), np.arange(-30.0, 30, 0.25)))
    >>> z = 1.0 + 0.3 * np.maximum(np.abs(y) - 20.0, 0.0)
    >>> seen = [make_points(np.column_stack([x, y, z]), camera, (x / 2).astype(int)) for camera in (5, 6)]
    >>> views = {camera: View(np.array([0.0, 0.0, -140.0]), np.empty((0, 2))) for camera in (5, 6)}
    >>> glass = estimate_glass(np.concatenate(seen), views)
    >>> glass.corrected, round(glass.below_foot_mm, 2), glass.supported
    (True, 1.0, ['height', 'tilt_y', 'tilt_x'])
    """
    below = [camera for camera, view in views.items() if view.centre[2] < 0]
    near = points.compress(np.isin(points["camera"], below) & points["supported"] & (np.abs(points["z"]) <= REACH_MM))
    seen = [near.compress(near["camera"] == camera) for camera in np.unique(near["camera"])]
    guesses = together(partial(_first_guess, of_camera) for of_camera in seen)
    fitted = np.ones(len(TERMS), np.bool_)
    while True:
        found = together(partial(_contact, *of_camera, fitted) for of_camera in zip(seen, guesses, strict=True))
        contacts = _agreeing([contact for contact in found if contact is not None])
        if len(contacts) < FEWEST_CAMERAS:
            return GlassPlane()
        mean = _mean(contacts, fitted)
        ends = np.quantile(_xy(near), SOLE_SHARE, axis=0)
        at_ends = mean.deviations * [1.0, *np.abs(ends - mean.centre).max(axis=0)]
        is_narrow = 4.0 * mean.extent < SPANNED * np.ptp(ends, axis=0)
        is_vague = (at_ends > SUPPORTED_MM) | (fitted & [False, *is_narrow])
        is_steep = np.abs(mean.terms[1:]).max() > math.tan(math.radians(LARGEST_TILT_DEG))
        if is_vague[0] or is_steep or mean.area_mm2 < LEAST_MM2:
            return GlassPlane()
        if not is_vague.any():
            return _document(mean, ends, fitted)
        fitted &= ~is_vague


def above_glass(points: NDArray[np.void], plane: Plane) -> NDArray[np.void]:
    """Replace Z of points (N,) of `POINT_DTYPE` by their height above the glass, mm; on the calibrated glass they stay.

    >>> from footscan.cloud.points import make_points
    >>> print(above_glass(make_points(np.array([[100.0, 0.0, 3.0]]), camera=5), Plane(1.0, 0.01, 0.0))["z"])
    [1.]
    """
    if plane == CALIBRATED:
        return points
    moved = copied(points)
    moved["z"] -= np.float32(plane.height) + plane.along * points["x"] + plane.across * points["y"]
    return moved


def moved_warning(glass: GlassPlane, limit_mm: float) -> Iterator[str]:
    """Say that the plate was moved if it is farther than `limit_mm` from Z = 0 somewhere below the foot.

    >>> print(*moved_warning(GlassPlane(below_foot_mm=1.52, largest_mm=1.6, corrected=True), 0.5))
    The sole stands 1.52 mm above the calibrated glass: the plate was moved since the calibration; calibrate anew
    """
    if not glass.corrected or glass.largest_mm <= limit_mm:
        return
    where = f"{abs(glass.below_foot_mm):.2f} mm {'above' if glass.below_foot_mm > 0 else 'below'} the calibrated glass"
    known = (("X", glass.tilt_x_deg, glass.tilt_x_sd_deg), ("Y", glass.tilt_y_deg, glass.tilt_y_sd_deg))
    tilts = [f"{tilt:.2f} degrees about {axis}" for axis, tilt, sd in known if sd is not None]
    is_tilted = bool(tilts) and glass.largest_mm - abs(glass.below_foot_mm) > limit_mm / 2.0
    tilted = f", tilted by {' and '.join(tilts)}" if is_tilted else ""
    yield f"The sole stands {where}{tilted}: the plate was moved since the calibration; calibrate anew"


def _xy(points: NDArray[np.void]) -> Floats:
    return np.column_stack([points["x"], points["y"]]).astype(np.float64)


def _first_guess(points: NDArray[np.void]) -> Floats:
    """The plane (3,) with most pieces of stripe in a layer around it, however noisy they are."""
    pieces = _pieces(points)
    x, y, z = (pieces[axis].astype(np.float64) for axis in "xyz")
    steps = round(LARGEST_TILT_DEG / GUESS_STEP_DEG)
    rises = np.tan(np.radians(GUESS_STEP_DEG * np.arange(-steps, steps + 1)))
    most, guess = 0, np.zeros(3)
    for along in rises:
        for across in rises:
            height = z - along * x - across * y
            lowest = height.min(initial=0.0)
            counts = np.bincount(((height - lowest) / GUESS_BIN_MM).astype(np.int64), minlength=GUESS_BINS)
            in_layer = np.convolve(counts, np.ones(GUESS_BINS, np.int64), "valid")
            fullest = int(in_layer.argmax())
            if in_layer[fullest] > most:
                most = int(in_layer[fullest])
                guess = np.array([lowest + (fullest + 0.5 * GUESS_BINS) * GUESS_BIN_MM, along, across])
    return guess


def _pieces(points: NDArray[np.void]) -> NDArray[np.void]:
    """The point of median height of each piece of one camera's stripes."""
    strip = np.floor(points["y"] / STRIP_MM).astype(np.int64)
    order = np.lexsort([points["z"], strip, points["frame"]])
    is_next = (np.diff(strip[order]) != 0) | (np.diff(points["frame"][order]) != 0)
    bounds = np.concatenate([[0], np.flatnonzero(is_next) + 1, [len(points)]])
    counts = np.diff(bounds)
    return np.asarray(points.take(order[(bounds[:-1] + counts // 2)[counts >= FEWEST_IN_STRIP]]))


def _contact(points: NDArray[np.void], guess: Floats, fitted: NDArray[np.bool_]) -> _Contact | None:
    """Fit the plane of one camera's contact, and the probability of each point to be in it; None without contact.

    Terms that are not `fitted` (3,) are those of the calibrated glass, 0.
    """
    near = points.compress(
        np.abs(points["z"] - guess[0] - guess[1] * points["x"] - guess[2] * points["y"]) <= 2.0 * BAND_MM
    )
    if len(near) < FEWEST:
        return None
    x, y, z = (near[axis].astype(np.float64) for axis in "xyz")
    terms, sigma, shares = guess * fitted, SIGMA_MM[1], np.array(FIRST_SHARES)
    terms[0] = guess[0] if fitted.all() else np.median(z - terms[1] * x - terms[2] * y)
    weights, sums = np.zeros(len(near)), np.zeros((4, 4))
    for _ in range(REWEIGHTINGS):
        shares, sums = _expect(x, y, z, terms, sigma, shares, weights)
        inverse = np.linalg.pinv(sums[:3, :3][np.ix_(fitted, fitted)], hermitian=True)
        terms[fitted] = inverse @ sums[:3, 3][fitted]
        residual = np.array([*-terms, 1.0])
        spread = float(residual @ sums @ residual) / max(float(sums[0, 0]), TINY)
        sigma = math.sqrt(min(max(spread, SIGMA_MM[0] ** 2), SIGMA_MM[1] ** 2))
    if shares[0] <= PROMINENT * shares[1] * 4.0 * sigma / BAND_MM:
        return None
    pull = weights * (z - terms[0] - terms[1] * x - terms[2] * y)
    stripe = near["frame"] - near["frame"].min()
    by_stripe = np.column_stack([np.bincount(stripe, pull * place) for place in (np.ones(len(x)), x, y)])
    covariance = np.zeros((3, 3))
    covariance[np.ix_(fitted, fitted)] = inverse @ (by_stripe.T @ by_stripe)[np.ix_(fitted, fitted)] @ inverse
    return _Contact(near, weights, terms, covariance)


@compiled
def _expect(
    x: Floats, y: Floats, z: Floats, terms: Floats, sigma: float, shares: Floats, weights: Floats
) -> tuple[Floats, Floats]:
    """Write the probability of each point to be contact into `weights` (N,).

    Returns
    -------
    shares : (3,) of contact, rising skin and strays.
    sums : (4, 4) of the products of 1, x, y and z with each other, by these weights.
    """
    found, sums, place = np.zeros(3), np.zeros((4, 4)), np.ones(4)
    for n in range(len(x)):
        weights[n] = 0.0
        height = z[n] - terms[0] - terms[1] * x[n] - terms[2] * y[n]
        if abs(height) >= BAND_MM:
            continue
        ratio = height / sigma
        contact = shares[0] * math.exp(-0.5 * ratio * ratio) / (math.sqrt(2.0 * math.pi) * sigma)
        rising = shares[1] * 0.5 * (1.0 + math.erf(ratio / math.sqrt(2.0))) / BAND_MM  # as noisy
        stray = shares[2] * 0.5 / BAND_MM
        likely = contact + rising + stray
        if likely <= 0.0:
            continue
        weights[n] = contact / likely
        found[0] += contact / likely
        found[1] += rising / likely
        found[2] += stray / likely
        place[1], place[2], place[3] = x[n], y[n], z[n]
        for i in range(4):
            for j in range(4):
                sums[i, j] += weights[n] * place[i] * place[j]
    return found / max(found.sum(), TINY), sums


def _agreeing(contacts: Sequence[_Contact]) -> list[_Contact]:
    """The contacts without those whose plane is far from the median of all."""
    if len(contacts) < 3:
        return list(contacts)
    centre, extent = _middle(contacts)
    terms = np.array([_at(contact, centre)[0] for contact in contacts])
    apart = np.linalg.norm((terms - np.median(terms, axis=0)) * [1.0, *extent], axis=1)
    limit = max(AGREED_MM, AGREED_TIMES * float(np.median(apart)))
    return [contact for contact, distance in zip(contacts, apart, strict=True) if distance <= limit]


def _middle(contacts: Sequence[_Contact]) -> tuple[Floats, Floats]:
    """Mean (2,) and standard deviation (2,) of X and Y of the contact, mm."""
    places = np.concatenate([_xy(contact.points) for contact in contacts])
    weights = np.concatenate([contact.weights for contact in contacts])
    centre = np.average(places, axis=0, weights=weights)
    return centre, np.sqrt(np.average((places - centre) ** 2, axis=0, weights=weights))


def _at(contact: _Contact, centre: Floats) -> tuple[Floats, Floats]:
    """The terms (3,) of a contact with the height at `centre`, and their variances (3,)."""
    moved = np.eye(3)
    moved[0, 1:] = centre
    return moved @ contact.terms, np.diag(moved @ contact.covariance @ moved.T)


def _mean(contacts: Sequence[_Contact], fitted: NDArray[np.bool_]) -> _Mean:
    """The mean of the cameras' planes; its deviations follow from their scatter, and from that of their stripes."""
    centre, extent = _middle(contacts)
    terms, variances = (np.array(values) for values in zip(*(_at(one, centre) for one in contacts), strict=True))
    least = LEAST_SD_MM / np.maximum([1.0, *extent], 1e-9)
    mean = terms.mean(axis=0)
    scatter = np.sum((terms - mean) ** 2, axis=0) + LEAST_SD_CAMERAS * least**2
    variance = scatter / (len(contacts) - 1 + LEAST_SD_CAMERAS) + variances.mean(axis=0)
    pressed = joined(contact.points.compress(contact.weights > 0.5) for contact in contacts)
    step = max(stripe_step(pressed), PLANE_MM)
    stripe = np.round(pressed["plane"] / step).astype(np.int64)
    pieces = distinct_rows(np.column_stack([stripe, np.floor(pressed["y"] / STRIP_MM).astype(np.int64)]))
    return _Mean(
        centre,
        extent,
        mean,
        np.sqrt(variance / len(contacts)) * fitted,
        cameras=[int(contact.points["camera"][0]) for contact in contacts],
        area_mm2=len(pieces.rows) * step * STRIP_MM,
        stripes=len(np.unique(stripe)),
    )


def _document(mean: _Mean, ends: Floats, fitted: NDArray[np.bool_]) -> GlassPlane:
    """The plane as it is reported; `ends` (2, 2) are the least and greatest X and Y of the sole, mm."""
    height, along, across = mean.terms
    deviations = mean.deviations
    corners = [height + (np.array([x, y]) - mean.centre) @ [along, across] for x in ends[:, 0] for y in ends[:, 1]]
    return GlassPlane(
        height_mm=float(height - mean.centre @ [along, across]),
        height_sd_mm=float(np.linalg.norm(deviations * [1.0, *mean.centre])) if fitted.all() else None,
        tilt_x_deg=math.degrees(math.atan(across)),
        tilt_x_sd_deg=math.degrees(deviations[2]) if fitted[2] else None,
        tilt_y_deg=math.degrees(math.atan(-along)) + 0.0,
        tilt_y_sd_deg=math.degrees(deviations[1]) if fitted[1] else None,
        below_foot_mm=float(height),
        below_foot_sd_mm=float(deviations[0]),
        largest_mm=float(np.abs(corners).max()),
        cameras=mean.cameras,
        contact_mm2=mean.area_mm2,
        stripes=mean.stripes,
        supported=[term for term, is_fitted in zip(TERMS, fitted, strict=True) if is_fitted],
        corrected=bool(np.any(np.abs(mean.terms) > SIGNIFICANT * deviations)),
    )
