"""The process of the virtual world: start, orders, end."""

import json
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from queue import Empty, Queue
from typing import Any, Self

from pipelines.live.virtual.world import SubjectName, World
from schemas.base.errors import Fault

ANSWER_SECONDS = 120.0
"""Longest silence of the process before it counts as dead; chosen by hand."""
END_SECONDS = 30.0
"""Time in which the process must end before it is killed; chosen by hand."""


class WorldProcess:
    """A virtual world in a process of its own; a context manager."""

    def __init__(self, world: World, progress: Callable[[int, int], None] | None = None) -> None:
        """Start the process and wait for its pictures, whose progress is reported to `progress`.

        Raises
        ------
        Fault
            The process could not be started.
        """
        command = [sys.executable, "-m", "pipelines.live.virtual.world", world.model_dump_json()]
        self.subject = world.subject
        """The subject on the glass."""
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, start_new_session=True
        )  # Ctrl-C goes to the scanner, which ends this process last
        self._messages: Queue[dict[str, Any] | None] = Queue()
        self._reader = threading.Thread(target=self._read, name="virtual world", daemon=True)
        self._reader.start()
        try:
            offer = self._answer("ready", progress)
        except BaseException:
            self.close()
            raise
        self.port = str(offer["port"])
        self.cameras: dict[int, str] = {int(camera): url for camera, url in offer["cameras"].items()}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def put(self, subject: SubjectName, progress: Callable[[int, int], None] | None = None) -> None:
        """Put another subject onto the glass."""
        self.order({"put": subject}, progress)
        self.subject = subject

    def write_known(self, file: Path) -> None:
        """Write the known measures of the foot on the glass into a file."""
        self.order({"known": str(file.resolve())})

    def order(self, order: dict[str, Any], progress: Callable[[int, int], None] | None = None) -> None:
        """Send an order of `pipelines.live.virtual.world.obey`, and wait until it is done."""
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(json.dumps(order) + "\n")
            self._process.stdin.flush()
        except OSError:
            raise Fault("the virtual world has ended") from None
        self._answer("done", progress)

    def close(self) -> None:
        """End the process."""
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

    def _answer(self, name: str, progress: Callable[[int, int], None] | None) -> Any:
        while True:
            try:
                message = self._messages.get(timeout=ANSWER_SECONDS)
            except Empty:
                raise Fault(f"the virtual world has been silent for {ANSWER_SECONDS:g} s") from None
            if message is None:
                raise Fault("the virtual world has ended")
            if name in message:
                return message[name]
            if progress is not None and "pictures" in message:
                progress(*message["pictures"])

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            self._messages.put(json.loads(line))
        self._messages.put(None)
