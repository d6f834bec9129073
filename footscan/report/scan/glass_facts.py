"""Facts of the glass during a scan: where the skin on it shows it to be."""

from footscan.report.markup import facts, number
from schemas.glass import GlassPlane


def glass_facts(glass: GlassPlane | None) -> str:
    """Height and tilts of the glass with their standard deviations, and the contact that shows them.

    >>> glass_facts(None)
    '<p class="note">Unknown: an earlier version made this quality.json.</p>'
    """
    if glass is None:
        return '<p class="note">Unknown: an earlier version made this quality.json.</p>'
    if not glass.supported:
        return '<p class="note">Not known from the sole: taken to be where it was calibrated.</p>'
    terms = {
        "Height below the foot": (glass.below_foot_mm, glass.below_foot_sd_mm, "mm"),
        "Tilt about X": (glass.tilt_x_deg, glass.tilt_x_sd_deg, "°"),
        "Tilt about Y": (glass.tilt_y_deg, glass.tilt_y_sd_deg, "°"),
    }
    pairs = [
        (name, "not shown" if sd is None else f"{number(value, 2)} ± {number(sd, 3)} {unit}")
        for name, (value, sd, unit) in terms.items()
    ]
    pairs += [
        ("Contact", f"{number(glass.contact_mm2 / 100.0, 1)} cm²"),
        ("Stripes on it", number(glass.stripes)),
        ("Cameras", ", ".join(map(str, glass.cameras))),
    ]
    return facts(pairs) + (_MOVED if glass.corrected else _IN_PLACE)


_IN_PLACE = '<p class="note">Within its standard deviations it is where it was calibrated.</p>'
_MOVED = (
    '<p class="note">Against the calibrated glass, ± one standard deviation. Points and measures were judged by this '
    "glass.</p>"
)
