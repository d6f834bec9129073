"""The process of the virtual world: start, orders, end."""

import json
import subprocess
import sys
import threading
from contextlib import ExitStack
from pathlib import Path
from queue import Empty, Queue
from tempfile import TemporaryDirectory
from typing import Any, Self

from footscan import clock
from pipelines.live.virtual.world import SubjectName, World
from schemas.base.errors import Fault

ANSWER_SECONDS = 120.0
"""Longest silence of the process before it counts as dead; chosen by hand."""
END_SECONDS = 30.0
"""Time in which the process must end before it is killed; chosen by hand."""


class WorldProcess:
    """A virtual world in a process of its own; a context manager."""

    def __init__(self, world: World) -> None:
        """Start the process; its clock is that of this process until `close`.

        Raises
        ------
        Fault
            The process could not be started.
        """
        self._open = ExitStack()
        folder = Path(
            self._open.enter_context(TemporaryDirectory(prefix="footscan-clock-", ignore_cleanup_errors=True))
        )
        command = [sys.executable, "-m", "pipelines.live.virtual.world", world.model_dump_json(), str(folder / "clock")]
        self.subject = world.subject
        """The subject on the glass."""
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, start_new_session=True
        )  # Ctrl-C goes to the scanner, which ends this process last
        self._messages: Queue[dict[str, Any] | None] = Queue()
        self._reader = threading.Thread(target=self._read, name="virtual world", daemon=True)
        self._reader.start()
        try:
            offer = self._answer("ready")
            self._open.enter_context(clock.following(folder / "clock"))
        except BaseException:
            self.close()
            raise
        self.port = str(offer["port"])
        self.cameras: dict[int, str] = {int(camera): url for camera, url in offer["cameras"].items()}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def put(self, subject: SubjectName) -> None:
        """Put another subject onto the glass."""
        self.order({"put": subject})
        self.subject = subject

    def write_known(self, file: Path) -> None:
        """Write the known measures of the foot on the glass into a file."""
        self.order({"known": str(file.resolve())})

    def order(self, order: dict[str, Any]) -> None:
        """Send an order of `pipelines.live.virtual.world.obey`, and wait until it is done."""
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(json.dumps(order) + "\n")
            self._process.stdin.flush()
        except OSError:
            raise Fault("the virtual world has ended") from None
        self._answer("done")

    def close(self) -> None:
        """End the process, and go by the system's clock again."""
        if self._process.stdin is not None:
            self._process.stdin.close()
        try:
            self._process.wait(END_SECONDS)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._reader.join()
        if self._process.stdout is not None:
            self._process.stdout.close()
        self._open.close()

    def _answer(self, name: str) -> Any:
        while True:
            try:
                message = self._messages.get(timeout=ANSWER_SECONDS)
            except Empty:
                raise Fault(f"the virtual world has been silent for {ANSWER_SECONDS:g} s") from None
            if message is None:
                raise Fault("the virtual world has ended")
            if name in message:
                return message[name]

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            self._messages.put(json.loads(line))
        self._messages.put(None)
