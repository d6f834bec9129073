from pathlib import Path

from schemas.base.yaml_files import read_yaml
from schemas.parameters.scan import ScanParameters
from schemas.workflow import Workflow

WORKFLOW = Path(__file__).parents[2] / "workflow.yaml"


def test_the_projects_workflow_is_that_of_the_demo() -> None:
    workflow = read_yaml(WORKFLOW, Workflow)
    assert workflow.parameters == ScanParameters()
    assert (workflow.archive, workflow.calibration) == (["demo/archive"], "demo/calibration.json")
    assert (workflow.results, workflow.cache) == ("demo/results", None)
