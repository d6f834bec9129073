"""Editing what a person decides for a scan: landmarks and choices, tried first, then written and measured."""

import contextlib
import datetime
import importlib
import threading
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Annotated

import numpy as np
import yaml
from pydantic import Field

from footscan.mesh.mesh import Mesh
from footscan.recordings.decisions import CHOICES_FILE, LANDMARKS_FILE, Decisions, decisions_of
from footscan.recordings.scans import RecordedScan, read_scan
from footscan.verify.nearest import MeshSurface
from pipelines.archive.job import Job
from pipelines.archive.planning import PlannedJob, draw_steps, plan_job
from pipelines.archive.running import ScanEnd, run_job
from pipelines.archive.selection import Selection
from pipelines.archive.table import CSV, update_results_table
from pipelines.arrays import unpack
from pipelines.engine.actions.step import Step
from pipelines.engine.audit import input_digests
from pipelines.engine.files.atomic import write_atomically
from pipelines.engine.pool import Threads
from pipelines.engine.run import content_of
from pipelines.scan import EXPORTED
from schemas.base.errors import Finding, RefusedInput
from schemas.base.model import Document, Posture, canonical_json
from schemas.choices import Choices, Decided, ExportFormat
from schemas.landmarks import LandmarkPosition, ManualLandmarks, Places
from schemas.measures import Axis, Measures
from schemas.parameters.foot import MeasureParameters
from schemas.sizes import People

MAY_RUN = {"measure", "sizes.json", "quality.json", "report", *EXPORTED.values()}
"""Steps that a decision may run again. If another one would run, the results are not those of the present films,
calibration and parameters, and a landmark would be set on a surface that is about to change."""


class Edit(Document):
    """Landmarks and choices as a page sends them."""

    landmarks: dict[str, LandmarkPosition] = Field(default_factory=dict)
    """All that a person has set, mm, in the scanner's frame; others are found by the program."""
    axis: Axis | None = None
    posture: Posture | None = None
    people: People | None = None
    exports: list[ExportFormat] = Field(default_factory=list)
    notes: Annotated[str, Field(max_length=2000)] = ""
    by: Annotated[str, Field(max_length=80)] = ""


@dataclass
class ScanEditor:
    """The editor of one scan of a job.

    Raises
    ------
    RefusedInput
        The scan cannot be read, is not measured yet, or would not be measured from the surface that it has.
    """

    job: Job
    """The job of which the scan is, with all its scans or with this one."""
    folder: Path
    """Folder of the scan."""
    _lock: threading.Lock = field(default_factory=threading.Lock)

    @property
    def scan(self) -> RecordedScan:
        """The scan as it is now."""
        return read_scan(self.folder, self.job.archive_of(self.folder))

    @property
    def decisions(self) -> Decisions:
        """What is decided for it now."""
        return decisions_of(self.scan)

    @property
    def results(self) -> Path:
        """Folder of its results."""
        document = self.scan.document
        return self.job.results / document.patient / document.scan

    @cached_property
    def mesh(self) -> Mesh:
        """The surface, mm, scanner frame."""
        arrays = unpack(self._planned_measuring[1]["surface"])
        return Mesh(arrays["vertices"], arrays["faces"], filled=arrays.get("filled"))

    def measures(self) -> Measures:
        """The measures that are delivered."""
        try:
            return Measures.model_validate_json((self.results / "measures.json").read_bytes())
        except (OSError, ValueError):
            raise RefusedInput(self.results, "has no measures, expected 'footscan run' first") from None

    def on_surface(self, point: LandmarkPosition) -> LandmarkPosition:
        """The place of the surface that is nearest to a point, mm, scanner frame."""
        x, y, z = self._surface.nearest(np.array([point])).places[0].round(3).tolist()
        return x, y, z

    def tried(self, edit: Edit) -> Measures:
        """The measures with these landmarks and choices, by the step that a run executes; nothing is written."""
        points = {name: self.on_surface(point) for name, point in edit.landmarks.items()}
        Places(**points)  # refuses a name that is none
        with self._lock:
            step, inputs = self._planned_measuring
            posture = edit.posture or self.scan.document.posture
            parameters = MeasureParameters(side=self.scan.document.side, posture=posture, axis=edit.axis or "toe2")
            if points:
                inputs = {**inputs, "landmarks": canonical_json(points).encode()}
            places = {"landmarks": self.folder / LANDMARKS_FILE}
            measures = Measures.model_validate_json(
                importlib.import_module(step.module).run(inputs, parameters, places)
            )
        if measures.finding is not None:
            raise Finding(measures.finding)
        return measures

    def save(self, edit: Edit) -> ScanEnd:
        """Write landmarks.yaml and choices.yaml, and measure the scan anew.

        Raises
        ------
        RefusedInput, Finding
            As in `tried`; nothing is written then.
        Fault
            The files cannot be written.
        """
        self.tried(edit)
        with self._lock:
            before, scan = self.decisions, self.scan
            now = Decided(by=edit.by or None, at=datetime.datetime.now(datetime.UTC).replace(microsecond=0))
            write_landmarks(scan.folder / LANDMARKS_FILE, self._landmarks(edit, before.landmarks, now))
            write_choices(scan.folder / CHOICES_FILE, _choices(edit, before.choices, now))
            [end] = run_job(self._planned(), Threads(self.job.threads), lambda _: None)
        if (self.job.results / CSV).exists():
            update_results_table([end], list(self._others()), self.job)
        return end

    def _others(self) -> Iterator[RecordedScan]:
        """The other scans of the job that can be read."""
        for folder in self.job.folders:
            if folder != self.folder:
                with contextlib.suppress(RefusedInput):
                    yield read_scan(folder, self.job.archive_of(folder))

    def _landmarks(self, edit: Edit, before: ManualLandmarks, now: Decided) -> ManualLandmarks:
        """The landmarks of an edit; those that were not moved keep who set them."""
        old = before.points()
        points = {
            name: old[name] if name in old and np.allclose(old[name], point, atol=1e-3) else self.on_surface(point)
            for name, point in edit.landmarks.items()
        }
        decided = {name: before.decided.get(name, now) if old.get(name) == points[name] else now for name in points}
        return ManualLandmarks(format="footscan.landmarks/1", landmarks=Places(**points), decided=decided)

    def _planned(self) -> PlannedJob:
        """The plan of this scan alone."""
        job = replace(self.job, folders=[self.folder], selection=Selection(), fail_fast=False)
        planned = plan_job(job, reasons=True)
        for refused in planned.refused:
            raise refused.error
        others = sorted({waiting.kind for waiting in planned.waiting} - MAY_RUN)
        if others or not (self.results / "measures.json").is_file():
            problem = (
                "is not measured with its present films, calibration and parameters, expected 'footscan run' first"
            )
            raise RefusedInput(self.folder, problem)
        return planned

    @cached_property
    def _surface(self) -> MeshSurface:
        return MeshSurface((self.mesh.vertices, self.mesh.faces))

    @cached_property
    def _planned_measuring(self) -> tuple[Step, dict[str, bytes]]:
        """The step that measures, and its inputs apart from landmarks."""
        planned = self._planned()
        [found] = planned.scans
        plan = planned.workspace.plan(draw_steps(found.scan, planned))
        [step] = [one.step for one in plan.steps if one.step.kind == "measure"]
        digests = input_digests(step, {one.step.name: one.outcome for one in plan.steps})
        with planned.workspace as workspace:
            return step, {
                name: content_of(step, source, digests[name], workspace.store)
                for name, source in step.inputs.items()
                if name != "landmarks"
            }


def write_landmarks(file: Path, landmarks: ManualLandmarks) -> None:
    """Write landmarks.yaml, or remove it where none is set; Fault if that fails."""
    document = landmarks.model_dump(mode="json", exclude_none=True)
    document["landmarks"] = {name: list(point) for name, point in landmarks.points().items()}
    _write(file, document if landmarks.points() else None)


def write_choices(file: Path, choices: Choices) -> None:
    """Write choices.yaml, or remove it where nothing is chosen; Fault if that fails."""
    document = choices.model_dump(mode="json", exclude_defaults=True)
    _write(file, document if document.keys() - {"format", "decided"} else None)


def _write(file: Path, document: Mapping[str, object] | None) -> None:
    if document is not None:
        text = yaml.safe_dump({"format": document["format"], **document}, sort_keys=False, default_flow_style=None)
        write_atomically(file, text.encode())
    elif file.exists():
        file.unlink()


def _choices(edit: Edit, before: Choices, now: Decided) -> Choices:
    changed = before.model_copy(
        update={
            "axis": edit.axis,
            "posture": edit.posture,
            "people": edit.people,
            "exports": edit.exports,
            "notes": edit.notes,
        }
    )
    return before if changed == before else changed.model_copy(update={"decided": now})
