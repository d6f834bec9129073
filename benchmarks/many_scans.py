"""Planning an archive of ten thousand scans: rows that lie by themselves (the baseline), and in packs.

    .venv/bin/python -m benchmarks.many_scans [SCANS [FOLDER [s3]]]

The graph is that of `benchmarks.engine`, 40 steps a scan; all has run before. Every figure is of a new process. FOLDER
keeps the store; it is made in some ten minutes, and takes 4 GB on a disk with blocks of 4096 bytes. With `s3`, a copy
of the packed store is planned from an object store on this machine as well; it needs `pip install s3fs 'moto[server]'`.
"""

import logging
import os
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from benchmarks.engine import SHAPE, in_process, write_package
from pipelines.engine.store.store import open_store

SCANS = 8500
"""340,000 steps."""
ROUNDS = 3
CACHES = Path("/proc/sys/vm/drop_caches")
"""What is written here empties the cache of files (proc(5)); only root may."""


def main() -> None:
    scans = int(sys.argv[1]) if len(sys.argv) > 1 else SCANS
    with tempfile.TemporaryDirectory() as temporary:
        place = Path(sys.argv[2] if len(sys.argv) > 2 else temporary)
        if not place.exists() or not any(place.iterdir()):
            write_package(place)
            seconds = in_process("prepare", "footscan", place, place / "runs", scans)["seconds"]
            print(f"{scans} scans run in {seconds:.0f} s")
        _show("by themselves", place, scans)
        start = time.perf_counter()
        files = open_store(place / "runs/store").files
        files.pack(files.many_by_themselves())
        print(f"packed in {time.perf_counter() - start:.1f} s")
        _show("in packs", place, scans)
        if "s3" in sys.argv[3:]:
            _show_object_store(place, scans)


def _show_object_store(place: Path, scans: int) -> None:
    import fsspec
    from moto.server import ThreadedMotoServer

    logging.getLogger("werkzeug").setLevel(logging.ERROR)
    server = ThreadedMotoServer(port=0)
    server.start()
    host, port = server.get_host_and_port()
    os.environ |= {
        "AWS_ENDPOINT_URL": f"http://{host}:{port}",
        "AWS_ACCESS_KEY_ID": "anyone",
        "AWS_SECRET_ACCESS_KEY": "anything",
        "AWS_DEFAULT_REGION": "us-east-1",
    }
    bucket = fsspec.filesystem("s3")
    bucket.mkdir("feet")
    bucket.put(str(place / "runs/store"), "feet/store", recursive=True)
    _show("in packs, in an object store", place, scans, "s3://feet/store")
    server.stop()


def _show(title: str, place: Path, scans: int, url: str | None = None) -> None:
    store = url or place / "runs/store"
    small = open_store(store).files.place
    count = sum(1 for folder in ("actions", "latest", "packs") for _ in small.sizes(folder))
    print(f"\nrows {title}: {count} files for {scans * len(SHAPE)} steps")
    known = place / "runs/known.sqlite"
    cases: dict[str, Callable[[], None]] = {
        "the first time on this machine": lambda: known.unlink(missing_ok=True),
        "warm": lambda: None,
        "cold cache of files": _drop_caches,
    }
    for name, before in cases.items():
        seconds = []
        for _ in range(ROUNDS):
            before()
            seconds.append(in_process("plan_once", "footscan", place, place / "runs", scans, store)["seconds"])
        print(f"  {name:<34}{min(seconds):7.1f} s ({', '.join(f'{one:.1f}' for one in seconds)})", flush=True)


def _drop_caches() -> None:
    os.sync()
    try:
        CACHES.write_text("3")
    except OSError:
        print("  the cache of files cannot be emptied here: the next figures are of a warm one")


if __name__ == "__main__":
    main()
