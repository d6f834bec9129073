"""A console that serves its pages to a browser."""

import importlib.util
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from pipelines.console.console import Console
from pipelines.console.server import server_of
from pipelines.console.web import listen

STAND_IN = Path(__file__).parents[1] / "pipelines" / "console" / "stand_in.py"


def console_stand_in(results: Path, **options: Any) -> Any:
    """The stand-in of a scanner as in the tests of the server."""
    spec = importlib.util.spec_from_file_location("console_stand_in", STAND_IN)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.StandIn(results, **options)


@contextmanager
def served(console: Console) -> Iterator[str]:
    """The address of a server that runs."""
    with listen("127.0.0.1", 0) as listening:
        server: Any = server_of(console, "127.0.0.1", None)
        thread = threading.Thread(target=lambda: server.run(sockets=[listening]), daemon=True)
        thread.start()
        yield f"http://127.0.0.1:{listening.getsockname()[1]}"
        console.closing.set()
        server.should_exit = True
        thread.join(60)
        assert not thread.is_alive(), "the server ends although pages look at it"
