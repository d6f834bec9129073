"""What follows from the places of the heads: whether a scan is corrected, what is reported, and what is in doubt."""

from collections.abc import Mapping

import numpy as np

from footscan.cloud.fusion.stripes import Floats
from footscan.cloud.heads.equations import HeadFit
from schemas.heads import FILM_BODY, HeadPlace, HeadsReport
from schemas.parameters.heads import HeadParameters

HALF_MM = np.array([1.0, 50.0, 50.0, 130.0])
"""Displacement, mm, at the border of a foot by a unit of each number of a head: feet are 100 mm broad and high, and 260
mm long."""
SIGNIFICANT = 4.0
"""Standard deviations from which a number of a head is not zero. Chosen by hand: a scan has a dozen of them."""
LEAST_GAIN, LEAST_GAIN_FILMED = 0.9, 0.6
"""Cameras of two heads must agree better by this factor, or the heads stay where they are; by the second where a film
has shown all laser planes. Maps that err by a tenth of a millimetre look a little like turned heads: a filmed scanner
(`draw_assembled`, seed 503) whose heads were right gave 0.8. A head that is off gives 0.2. Chosen by hand."""

STRAYS_MM, STRAYS_SPREADS = 0.05, 2.6
"""Straying of a head beyond which its motor has lost steps: this far, and so many robust standard deviations of the
distances between cameras of two heads. Chosen by hand: scanners as designed (`draw_assembled`, seeds 701 and 702) have
0.2 of these, scanners that a body calibrated (803 to 807, 961 to 970) 0.5 to 2.5, heads that lost 1.5 mm 3 to 5."""


def report_of(
    nothing: HeadsReport,
    heads: Mapping[int, int],
    fit: HeadFit,
    unmoved_mm: float,
    parameters: HeadParameters,
    *,
    filmed: bool = False,
) -> HeadsReport:
    """Report the places of the heads; those that the scan does not show are 0.

    Parameters
    ----------
    nothing : the report of a scan that shows no places
    heads : camera -> number of its head
    unmoved_mm : robust standard deviation of the distances between cameras of two heads, with the heads as calibrated
    filmed : a film has shown where the laser planes of all heads lie
    """
    shown = np.any(np.abs(fit.places) > np.maximum(SIGNIFICANT * fit.sd, parameters.smallest_mm / HALF_MM), axis=0)
    places = np.asarray(np.round(np.where(shown, fit.places, 0.0), 6), np.float64)
    largest = float(np.abs(places @ np.diag(HALF_MM)).sum(axis=1).max())
    least_gain = LEAST_GAIN_FILMED if filmed else LEAST_GAIN
    is_corrected = bool(shown.any() and fit.spread_mm < least_gain * unmoved_mm)
    if not is_corrected:
        places, largest = np.zeros_like(places), 0.0
    numbers = sorted(set(heads.values()))
    return HeadsReport(
        heads=[
            _place(number, [camera for camera in sorted(heads) if heads[camera] == number], of_head, sd)
            for number, of_head, sd in zip(numbers, places, fit.sd, strict=True)
        ],
        points=nothing.points,
        x_mm=nothing.x_mm,
        comparisons=nothing.comparisons,
        before_mm=round(unmoved_mm, 5),
        after_mm=round(fit.spread_mm, 5),
        largest_mm=round(largest, 4),
        strays_mm=nothing.strays_mm,
        is_corrected=is_corrected,
        warnings=[_correction(numbers, places)] if is_corrected else [],
        doubt=_straying(nothing.strays_mm, fit.spread_mm) or _doubt(places, largest, parameters),
    )


def _place(head: int, cameras: list[int], place: Floats, sd: Floats) -> HeadPlace:
    offset, yaw, pitch, scale = (float(value) for value in place)
    deviations = [round(float(value), 6) for value in sd]
    return HeadPlace(head=head, cameras=cameras, offset_mm=offset, yaw=yaw, pitch=pitch, scale=scale, sd=deviations)


def _correction(numbers: list[int], places: Floats) -> str:
    """Say how far heads are off.

    >>> print(_correction([1, 3], np.array([[0.31, 0.0, 0.0, 0.0], [-0.31, 0.002, 0.0, 0.0]])))
    heads are not where the calibration says, and the scan was corrected: head 1 by +0.31 mm; head 3 by -0.31 mm, \
turned by 0.11 degrees; if other scans show the same, film the body that shows the laser planes (`footscan calibrate \
film`, or “Calibrate or check” in the console)
    """
    parts = []
    for number, (offset, yaw, pitch, scale) in zip(numbers, places.tolist(), strict=True):
        turn = np.degrees(np.hypot(yaw, pitch))
        part = f"head {number} by {offset:+.2f} mm"
        part += f", turned by {turn:.2f} degrees" if turn else ""
        parts.append(part + (f", its travel {100 * scale:+.2f} %" if scale else ""))
    todo = f"if other scans show the same, film the body that shows the laser planes ({FILM_BODY})"
    return "heads are not where the calibration says, and the scan was corrected: " + "; ".join([*parts, todo])


def _doubt(places: Floats, largest: float, parameters: HeadParameters) -> str | None:
    """The reason for which measures are uncertain, if there is one."""
    turn, scale = (float(np.ptp(places[:, columns], axis=0).max()) for columns in ([1, 2], [3]))
    reasons = []
    if largest > parameters.largest_mm:
        reasons.append(f"points of a head lie {largest:.2f} mm off along the travel")
    if turn > parameters.largest_turn:
        reasons.append(f"laser planes are turned against each other by {np.degrees(turn):.2f} degrees")
    if scale > parameters.largest_scale:
        reasons.append(f"the travels of two heads differ by {100 * scale:.2f} %")
    if not reasons:
        return None
    return f"{', '.join(reasons)}: film the body that shows the laser planes ({FILM_BODY})"


def _straying(strays_mm: float, spread_mm: float) -> str | None:
    """The reason for doubt if a head strays, and so has lost steps.

    >>> print(_straying(0.15, 0.04))
    a head is not at one place along its travel, as after lost steps of its motor: see that nothing brakes the heads, \
home them, then scan again
    >>> _straying(0.15, 0.1) is None
    True
    """
    if strays_mm < max(STRAYS_MM, STRAYS_SPREADS * spread_mm):
        return None
    return (
        "a head is not at one place along its travel, as after lost steps of its motor: see that nothing brakes the "
        "heads, home them, then scan again"
    )
