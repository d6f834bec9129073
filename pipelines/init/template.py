"""The text of a new workflow.yaml, with comments."""

from collections.abc import Sequence

import yaml

TEMPLATE = """\
# The workflow that `footscan run` executes. Paths are relative to this file.
# docs/workflow.md has every field; `footscan config check` finds mistakes.
format: footscan.workflow/1

archive: {archive}   # folders with a scan.yaml, at any depth
{calibration}
results: {results}   # <patient>/<scan>/report.html and the other results

# exports: [obj, glb]           # formats of the mesh beside foot.stl and foot.ply: obj, wrl, 3mf, glb
# workers: 4                    # steps that run at once; default: the number of cores

# Parameters of the steps. What is left out keeps its default.
parameters: {{}}
#  extraction:
#    red_threshold: 18           # grey levels of the faintest stripe
#  outliers:
#    z_mm: [-0.5, 200]           # control volume; default: all that the calibration supports

# Options by name, for `footscan run --profile night`.
# profiles:
#   night:
#     since: 7d                  # scans of the last seven days
#     fail_fast: false
"""


def workflow_text(archive: str, calibrations: Sequence[str], results: str, *, is_needed: bool) -> str:
    """The text of a workflow.

    Parameters
    ----------
    archive, results : paths relative to the workflow
    calibrations : paths of the calibrations that were found; the first one is taken, the others are comments
    is_needed : True if some scans name no calibration
    """
    if calibrations:
        lines = [f"calibration: {_yaml(calibrations[0])}   # for scans that name none"]
        lines += [f"# calibration: {_yaml(other)}" for other in calibrations[1:]]
    elif is_needed:
        lines = ["# calibration: calibration.json   # none was found: see docs/calibration.md"]
    else:
        lines = ["# calibration: calibration.json   # each scan names its own"]
    return TEMPLATE.format(archive=_yaml(archive), calibration="\n".join(lines), results=_yaml(results))


def _yaml(text: str) -> str:
    """A text as YAML has it, with quotes where they are needed."""
    return yaml.safe_dump(text, width=10**6).splitlines()[0]
