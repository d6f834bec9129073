"""Tables of the calibration models that were tried: their errors, and which was chosen."""

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from pipelines.cli.terminal.output import print_line, print_table
from schemas.calibration import view_name

if TYPE_CHECKING:
    from footscan.calibration.models.selection import ModelTrial

COLUMNS = ("model", "unknowns", "data", "own mm", "held-out mm", "uncertainty mm", "worst mm", "")
MEANING = (
    "Own: how far the model puts the points from where they are, root mean square, after it was fitted to them. "
    "Held-out: the same for points that it has not seen, left out of the fit in their turn. "
    "Uncertainty: how far it may swing between the points. The last two decide, added as squares."
)


def print_trials(trials: "Sequence[ModelTrial]") -> None:
    """Print the errors of each model by camera, or one row per model if all cameras choose the same."""
    tried = [trial for trial in trials if trial.status != "refused"]
    chosen = {trial.camera: trial.model for trial in trials if trial.status == "chosen"}
    cameras = sorted({trial.camera for trial in trials})
    if len(cameras) > 1 and len(chosen) == len(cameras) and len(set(chosen.values())) == 1:
        rows = [_row(model, [t for t in tried if t.model == model]) for model in _models(tried)]
        print_table(f"All {len(cameras)} cameras choose the same model", COLUMNS, rows)
    else:
        rows = [
            [view_name(trial.camera) if number == 0 else "", *_row(trial.model, [trial])]
            for camera in cameras
            for number, trial in enumerate(trial for trial in tried if trial.camera == camera)
        ]
        print_table("Models of each camera", ("camera", *COLUMNS), rows)
    print_line(MEANING)
    _print_refused(trials)


def print_models(trials: "Sequence[ModelTrial]") -> None:
    """Print the errors of all models, one column per camera."""
    columns, rows = _matrix(trials, chosen="{}*")
    print_table("Own and held-out error of each camera, mm rms; *: chosen", columns, rows)
    print_line(MEANING)
    _print_refused(trials)


def markdown_of_models(trials: "Sequence[ModelTrial]") -> str:
    """The same table as Markdown."""
    columns, rows = _matrix(trials, chosen="**{}**")
    lines = [columns, ["---", "---:", "---", *["---:"] * (len(columns) - 3)], *rows]
    return "".join("| " + " | ".join(line) + " |\n" for line in lines)


def _print_refused(trials: "Sequence[ModelTrial]") -> None:
    judged = set(_models(trial for trial in trials if trial.status != "refused"))
    if refused := [model for model in _models(trials) if model not in judged]:
        print_line(f"Too few data for: {'; '.join(refused)}.")


def _row(model: str, trials: "Sequence[ModelTrial]") -> list[str]:
    """The row of a model, for one camera or for several that chose the same."""
    chosen = any(trial.status == "chosen" for trial in trials)
    remarks = list(dict.fromkeys(trial.remark for trial in trials if trial.remark))
    return [
        model,
        str(trials[0].unknowns),
        _range([trial.observations for trial in trials], "{:d}"),
        _range([trial.rms_mm for trial in trials], "{:.3f}"),
        _range([trial.held_out_rms_mm for trial in trials], "{:.3f}"),
        _range([trial.region_sigma_mm for trial in trials], "{:.3f}"),
        _range([trial.worst_mm for trial in trials], "{:.3f}"),
        "chosen" if chosen else "; ".join(remarks[:1]),
    ]


def _matrix(trials: "Sequence[ModelTrial]", *, chosen: str) -> tuple[list[str], list[list[str]]]:
    """Two rows per model (fitted and held-out error), one column per camera."""
    cameras = sorted({trial.camera for trial in trials})
    rows = []
    for model in _models(trial for trial in trials if trial.status != "refused"):
        of_camera = {trial.camera: trial for trial in trials if trial.model == model}
        own = [_mm(of_camera[camera].rms_mm) for camera in cameras]
        held_out = [
            chosen.format(_mm(trial.held_out_rms_mm)) if trial.status == "chosen" else _mm(trial.held_out_rms_mm)
            for trial in (of_camera[camera] for camera in cameras)
        ]
        unknowns = str(next(iter(of_camera.values())).unknowns)
        rows += [[model, unknowns, "own", *own], ["", "", "held-out", *held_out]]
    return ["model", "unknowns", "error", *map(str, cameras)], rows


def _models(trials: "Iterable[ModelTrial]") -> list[str]:
    return list(dict.fromkeys(trial.model for trial in trials))


def _range(values: Sequence[float | None], form: str) -> str:
    known = [value for value in values if value is not None]
    if not known:
        return "-"
    low, high = form.format(min(known)), form.format(max(known))
    return low if low == high else f"{low} to {high}"


def _mm(value: float | None) -> str:
    if value is None:
        return "-"
    return f"{value:.2f}" if value < 100 else f"{value:.0f}"
