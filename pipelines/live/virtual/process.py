"""The virtual world as a process beside the scanner's: started, given orders, and ended."""

import json
import subprocess
import sys
import threading
from collections.abc import Callable
from queue import Empty, Queue
from types import TracebackType
from typing import Any, Self

from pipelines.live.virtual.world import SubjectName, World
from schemas.base.errors import Fault

ANSWER_SECONDS = 120.0
"""Between two signs of life."""
END_SECONDS = 30.0


class WorldProcess:
    """A virtual world in a process of its own; a context manager."""

    def __init__(self, world: World, progress: Callable[[int, int], None] | None = None) -> None:
        """Starts it and waits until its pictures are there, of which `progress` hears.

        Raises
        ------
        Fault
            It could not be started.
        """
        command = [sys.executable, "-m", "pipelines.live.virtual.world", world.model_dump_json()]
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, start_new_session=True
        )  # Ctrl-C is for the scanner, which ends this as its last act
        self._said: Queue[dict[str, Any] | None] = Queue()
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

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def put(self, subject: SubjectName, progress: Callable[[int, int], None] | None = None) -> None:
        """Puts something else onto the glass."""
        self.order({"put": subject}, progress)

    def order(self, order: dict[str, Any], progress: Callable[[int, int], None] | None = None) -> None:
        """As `virtual_world.obey`; waits until it is done."""
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(json.dumps(order) + "\n")
            self._process.stdin.flush()
        except OSError:
            raise Fault("the virtual world has ended") from None
        self._answer("done", progress)

    def close(self) -> None:
        """Ends the process."""
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
                said = self._said.get(timeout=ANSWER_SECONDS)
            except Empty:
                raise Fault(f"the virtual world is silent since {ANSWER_SECONDS:g} s") from None
            if said is None:
                raise Fault("the virtual world has ended")
            if name in said:
                return said[name]
            if progress is not None and "pictures" in said:
                progress(*said["pictures"])

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            self._said.put(json.loads(line))
        self._said.put(None)
