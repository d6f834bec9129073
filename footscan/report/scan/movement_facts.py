"""Facts of the foot's movement while it was scanned, as heads that film the same skin show it."""

from footscan.report.markup import facts, number
from footscan.surface.errors.scan_errors import UNSEEN_SWAY_MM
from schemas.movement import MovementReport


def movement_facts(movement: MovementReport) -> str:
    """Tremor and slow movement, root mean squares, or that no heads show the latter.

    >>> "is not known" in movement_facts(MovementReport(tremor_mm=0.05))
    True
    """
    tremor = f"{number(movement.tremor_mm, 2)} mm{', moved back' if movement.x_mm else ''}"
    pairs = [("Tremor along X", tremor)]
    if movement.agreement is not None:
        pairs.append(("Correlation between heads", number(movement.agreement, 2)))
    if movement.sway_by_axis_mm is None:
        return facts(pairs) + _UNSEEN
    along, across = (f"{number(size, 2)} mm" for size in movement.sway_by_axis_mm)
    if movement.y_mm:
        across += ", moved back"
    return facts([*pairs, ("Slow movement along X", along), ("Slow movement along Y", across)])


_UNSEEN = (
    '<p class="note">Whether the foot swayed slowly is not known: no two heads passed the same skin at different '
    f"times. The measures count with {UNSEEN_SWAY_MM:g} mm; a much larger sway makes them wrong. Heads that start some "
    "millimetres apart would show it.</p>"
)
