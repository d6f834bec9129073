"""Guides an operator through a calibration, or through a check, placement by placement.

It knows nothing of terminals and pages: they show its `view` and call its methods, one at a time.
"""

import datetime
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path
from typing import Protocol

import numpy as np

from footscan.calibration.capture.standing import Complaint
from footscan.calibration.travel.body import TURN_DEG, Body, standard_body
from footscan.report.calibration.planes import HEAD_COLUMNS, planes_of_heads
from footscan.report.calibration.standing_picture import body_picture, placement_picture
from pipelines.live.calibrating.body_film import travel_over
from pipelines.live.calibrating.filmed import FilmedPlacements, Purpose, interrupted_session, new_session
from pipelines.live.calibrating.judging import SeenPlacements
from pipelines.live.calibrating.outcomes import (
    StoredCalibration,
    StoredCheck,
    add_planes,
    calibrate_session,
    check_session,
    use_calibration,
)
from pipelines.live.calibrating.settings import GuideSettings
from pipelines.live.calibrating.stills import Stills, still_x_mm
from pipelines.live.calibrating.view import Action, Outcome, Step, View
from pipelines.live.light import ScanLight
from schemas.base.errors import RefusedInput
from schemas.calibration import Calibration, read_calibration
from schemas.rig import Rig

FEWEST = 3
"""Placements from which a scanner can be calibrated, unless the object has fewer. Chosen by hand."""


class StandingScanner(Protocol):
    """A scanner that films standing objects. Failures are raised as `FootscanError`."""

    rig: Rig

    def stills(self, light: ScanLight | None) -> Stills:
        """Film what stands at `still_x_mm`; without a light, choose one first."""
        ...

    def film_body(self, place: Path, body: Body, light: ScanLight | None) -> None:
        """Film the body, one head after the other, into the folder `place`."""
        ...

    def waiting_for(self, words: str) -> AbstractContextManager[None]:
        """Reserve the scanner for work that does not need its devices."""
        ...


class Guide:
    """One session after the other, on one scanner."""

    def __init__(
        self,
        scanner: StandingScanner,
        settings: GuideSettings,
        put: Callable[[str], None] | None = None,
    ) -> None:
        """`put` puts `reference K` or `body` onto the glass of a virtual scanner."""
        self._scanner, self._settings, self._put = scanner, settings, put
        self._listeners: list[Callable[[View], None]] = []
        self._session: FilmedPlacements | None = None
        self._seen = SeenPlacements()
        self._light = settings.light
        self._body = settings.body or standard_body()
        self._stored: StoredCalibration | None = None
        self._view = self._first_view()

    @property
    def view(self) -> View:
        """The present state; usable from any thread."""
        return self._view

    def listen(self, listener: Callable[[View], None]) -> None:
        """Call `listener` with each new view, in the thread that works."""
        self._listeners.append(listener)

    def picture(self) -> str:
        """Draw the stripes of all placements, as SVG."""
        return self._seen.picture(self._view.number)

    def placement_picture(self) -> str | None:
        """Draw what is to be filmed and where it stands on the glass, as SVG; None if nothing is."""
        view, rig = self._view, self._scanner.rig
        if view.step == "body":
            return body_picture(self._body, still_x_mm(rig), travel_over(rig, self._body))
        if view.step not in {"place", "look"} or view.number is None:
            return None
        profile, placements = (
            np.array(corners, np.float64) for corners in (self._settings.reference.profile_mm, view.placements)
        )
        travel = (rig.travel.start_mm, rig.travel.end_mm)
        return placement_picture(profile, placements, view.number, view.taken, still_x_mm(rig), travel)

    def result_picture(self) -> bytes | None:
        """The figure of the calibration that was made, as PNG; None without one."""
        return None if self._stored is None else self._stored.picture.read_bytes()

    def begin(self, purpose: Purpose) -> None:
        """Begin a session, or go on with one that was interrupted."""
        settings, rig = self._settings, self._scanner.rig
        if purpose == "check" and rig.calibration is None:
            problem = "names none that could be checked, expected one of 'footscan calibrate film'"
            raise RefusedInput(settings.rig_file, problem, field="calibration")
        self._need("calibrate" if purpose == "calibration" else "check")
        cameras = [camera.id for camera in rig.cameras]
        args = (settings.captures, rig.scanner, purpose, settings.reference, cameras)
        earlier = interrupted_session(*args)
        self._session = session = earlier or new_session(*args)
        self._seen, self._stored, self._light = SeenPlacements(), None, settings.light
        self._view = View(
            "begin",
            "",
            (),
            purpose,
            str(session.folder),
            placements=settings.reference.placements_mm,
            drawn=self._view.drawn,
        )
        words = ""
        if earlier is not None:
            with self._scanner.waiting_for("reading the interrupted session"):
                frames = {number: session.frames(number) for number in session.numbers}
                for damaged in self._seen.recall(frames, session.reference):
                    session.drop(damaged)
            day = datetime.date.fromtimestamp(earlier.folder.stat().st_mtime).isoformat()
            words = f"An interrupted session of {day} goes on: discard it if a camera was touched since. "
        self._to_place(self._free_number(), words)

    def put(self) -> None:
        """Put what is to be filmed onto the glass of a virtual scanner."""
        self._need("put")
        assert self._put is not None
        number = self._view.number
        step: Step = "body" if self._view.step == "body" else "place"
        if step == "body" or number is None:
            what, subject, words = "body", "body", "A"
        else:
            what, subject, words = "object", f"reference {number}", f"{self._placement(number)}: a"
        with self._scanner.waiting_for(f"putting the virtual {what} onto the glass"):
            self._put(subject)
        words = f"{words} virtual {what} stands there now. Film it."
        actions = tuple(action for action in self._view.actions if action != "put")
        self._show(replace(self._view, step=step, words=words, complaints=(), actions=actions))

    def take(self) -> None:
        """Film the present placement, and judge it while the object stands there."""
        self._need("take")
        session, number = self._in_session(), self._view.number
        assert number is not None
        stills = self._scanner.stills(self._light)
        self._light = stills.light
        try:
            with self._scanner.waiting_for("judging the placement"):
                complaints = self._kept_and_judged(session, number, stills)
        except BaseException:  # such as a stop: a placement that was not judged is filmed again
            if not stills.problems:
                session.drop(number)
            raise
        self._to_look(number, complaints, is_kept=not stills.problems)

    def next(self) -> None:
        """Go on to the next placement that is not filmed."""
        self._need("next")
        self._to_place(self._free_number(after=self._view.number))

    def go(self, number: int) -> None:
        """Go to a placement, to film it now or again."""
        self._need("go")
        if not 0 <= number < len(self._view.placements):
            most = len(self._view.placements)
            raise RefusedInput("placement", f"expected 1 to {most}, found {number + 1}")
        self._to_place(number)

    def finish(self) -> None:
        """Calibrate or check from what is filmed."""
        self._need("finish")
        session, settings = self._in_session(), self._settings
        rig = self._scanner.rig
        numbers = session.numbers
        words = "calculating the calibration" if self._view.purpose == "calibration" else "checking the calibration"
        try:
            with self._scanner.waiting_for(words):
                session.finish(still_x_mm(rig))
                if self._view.purpose == "check":
                    tolerances = settings.drift_tolerance_mm, settings.placement_tolerance_mm
                    checked = check_session(session.folder, rig, *tolerances)
                else:
                    stored = calibrate_session(session.folder, rig, settings.rig_file, settings.placement_tolerance_mm)
        except RefusedInput as refused:
            session.reopen()
            self._to_refused(refused, numbers)
            return
        except BaseException:  # such as a stop: the session can be gone on with
            session.reopen()
            raise
        if self._view.purpose == "check":
            self._to_checked(checked)
        else:
            self._to_stored("calibrated", stored)

    def discard(self) -> None:
        """Remove what was filmed in this session."""
        self._need("discard")
        self._in_session().discard()
        self.end()

    def body(self) -> None:
        """Go on to the film of the body."""
        self._need("body")
        x_mm = still_x_mm(self._scanner.rig)
        words = (
            f"Put the body onto the glass, its middle at X = {x_mm:g} mm, its length at about {TURN_DEG:g} degrees to "
            "the travel. Then film it: the heads travel over it one after the other."
        )
        self._show(replace(self._view, step="body", words=words, actions=(*self._puts(), "film-body", "use", "end")))

    def film_body(self) -> None:
        """Film the body, find the laser planes, and store them in the calibration."""
        self._need("film-body")
        session, stored = self._in_session(), self._stored
        assert stored is not None
        film = session.folder / "body"
        self._scanner.film_body(film, self._body, self._light)
        with self._scanner.waiting_for("finding the laser planes"):
            stored = add_planes(stored, film, self._scanner.rig, self._body)
        self._to_stored("planes", stored)

    def use(self) -> None:
        """Name the calibration in rig.yaml: scans use it from now on."""
        self._need("use")
        assert self._stored is not None
        self._scanner.rig = use_calibration(self._stored, self._scanner.rig, self._settings.rig_file)
        words = f"Scans use {self._stored.file.name} from now on."
        self._show(replace(self._view, step="used", words=words, actions=("end",)))

    def end(self) -> None:
        """Leave the session; what was filmed stays."""
        self._session = None
        self._seen = SeenPlacements()
        self._show(replace(self._first_view(), drawn=self._view.drawn))

    def _first_view(self) -> View:
        is_calibrated = self._scanner.rig.calibration is not None
        words = "Calibrate the scanner with the reference object, or check whether its calibration still holds."
        if not is_calibrated:
            words = "The scanner has no calibration yet: calibrate it with the reference object."
        return View("begin", words, ("check", "calibrate") if is_calibrated else ("calibrate",))

    def _kept_and_judged(self, session: FilmedPlacements, number: int, stills: Stills) -> list[Complaint]:
        if not stills.problems:
            frames = {camera: jpeg for camera, (_, jpeg) in stills.frames.items()}
            session.keep(number, frames)
            self._seen.add(number, frames)
        tolerance_mm = self._settings.placement_tolerance_mm
        return self._seen.judge(number, stills, session.reference, session.numbers, tolerance_mm, self._known())

    def _to_place(self, number: int | None, before: str = "", complaints: tuple[Complaint, ...] = ()) -> None:
        session = self._in_session()
        if number is None:
            work = "Calibrate now." if self._view.purpose == "calibration" else "Check now."
            words = f"{before}All placements are filmed. {work}"
            self._show(self._filmed_view("filmed", words, None, complaints, ("finish", "go", "discard", "end")))
            return
        y, z = session.reference.placements_mm[number]
        x_mm = still_x_mm(self._scanner.rig)
        height = "on the glass" if z == 0 else f"raised by {z:g} mm"
        words = (
            f"{before}{self._placement(number)}: stand the object at "
            f"Y = {_signed(y)} mm, {height}, across the laser's plane at X = {x_mm:g} mm. Then film it."
        )
        actions = (*self._puts(), "take", *self._enough(), "go", "discard", "end")
        self._show(self._filmed_view("place", words, number, complaints, actions))

    def _to_look(self, number: int, complaints: list[Complaint], *, is_kept: bool) -> None:
        if any(complaint.kind in {"saturated", "faint"} for complaint in complaints):
            self._light = self._settings.light  # chosen anew when the placement is filmed again
        if not is_kept:
            words = f"Placement {number + 1} was not filmed."
            actions: tuple[Action, ...] = ("take", "go", "discard", "end")
        elif complaints:
            words = f"Placement {number + 1} is filmed, but something is wrong. Mend it and film it again."
            actions = (*self._puts(), "take", "next", *self._enough(), "go", "discard", "end")
        else:
            words = f"Placement {number + 1} is good."
            first: Action = "finish" if self._view.purpose == "check" else "next"
            others = tuple(action for action in ("next", *self._enough()) if action != first)
            actions = (first, "take", *others, "go", "discard", "end")
        self._show(self._filmed_view("look", words, number, tuple(complaints), actions))

    def _to_refused(self, refused: RefusedInput, numbers: tuple[int, ...]) -> None:
        """Go to the placement for which the capture was refused."""
        complaint = Complaint("elsewhere", f"{refused.field}: {refused.problem}")
        number = None
        if refused.field is not None and refused.field.startswith("frame "):
            number = numbers[int(refused.field.removeprefix("frame "))]
            complaint = Complaint("elsewhere", refused.problem)
        self._to_place(number, "It does not fit together. ", (complaint,))

    def _to_stored(self, step: Step, stored: StoredCalibration) -> None:
        self._stored = stored
        columns = ("camera", "points", "error, mm", "error on placements left out, mm")
        planes = planes_of_heads(stored.calibration)
        outcome = Outcome(columns, stored.rows(), stored.remarks(), str(stored.file), True, ("", *HEAD_COLUMNS), planes)
        more: tuple[Action, ...] = ("body",) if step == "calibrated" else ()
        advice = " A film of the body would show where the laser planes lie, too." if more else ""
        words = f"{stored.file.name} is stored.{advice} Use it for scans?"
        self._show(
            replace(self._view, step=step, words=words, complaints=(), actions=("use", *more, "end"), outcome=outcome)
        )

    def _to_checked(self, stored: StoredCheck) -> None:
        columns = ("camera", "points", "off in Y, mm", "off in Z, mm", "off in all, mm", "verdict")
        outcome = Outcome(
            columns, stored.rows(), stored.remarks(), str(stored.file), is_well=stored.check.verdict == "steady"
        )
        words = " ".join(stored.remarks())
        self._show(replace(self._view, step="checked", words=words, complaints=(), actions=("end",), outcome=outcome))

    def _filmed_view(
        self, step: Step, words: str, number: int | None, complaints: tuple[Complaint, ...], actions: tuple[Action, ...]
    ) -> View:
        return replace(
            self._view,
            step=step,
            words=words,
            actions=actions,
            number=number,
            taken=self._in_session().numbers,
            complaints=complaints,
            coverage=self._seen.coverage(),
            drawn=self._view.drawn + 1,
        )

    def _show(self, view: View) -> None:
        self._view = view
        for listener in self._listeners:
            listener(view)

    def _need(self, action: Action) -> None:
        if action not in self._view.actions:
            allowed = ", ".join(self._view.actions)
            raise RefusedInput("calibration", f"cannot {action} now, expected one of {allowed}")

    def _in_session(self) -> FilmedPlacements:
        assert self._session is not None, "an action of a session is allowed in one only"
        return self._session

    def _placement(self, number: int) -> str:
        return f"Placement {number + 1} of {len(self._view.placements)}"

    def _puts(self) -> tuple[Action, ...]:
        return () if self._put is None else ("put",)

    def _enough(self) -> tuple[Action, ...]:
        session = self._in_session()
        fewest = 1 if self._view.purpose == "check" else min(FEWEST, len(session.reference.placements_mm))
        return ("finish",) if len(session.numbers) >= fewest else ()

    def _free_number(self, after: int | None = None) -> int | None:
        """The next placement that is not filmed; a check needs one placement only."""
        session = self._in_session()
        taken = set(session.numbers)
        if self._view.purpose == "check" and taken:
            return None
        free = [number for number in range(len(session.reference.placements_mm)) if number not in taken]
        later = [number for number in free if after is not None and number > after]
        return next(iter([*later, *free]), None)

    def _known(self) -> Calibration | None:
        """The present calibration of the scanner, which judges the first placement; None if it cannot be read."""
        file = self._scanner.rig.calibration
        if file is None or not Path(file).is_file():
            return None
        try:
            return read_calibration(Path(file))
        except RefusedInput:
            return None


def _signed(mm: float) -> str:
    return f"{mm:+g}" if mm else "0"
