"""A warning is logged if others can write to a store."""

import logging
import os
from pathlib import Path

import pytest

from pipelines.engine.store import permissions as trust
from pipelines.engine.store.permissions import warn_if_others_can_write
from pipelines.engine.store.store import Store, open_store


@pytest.fixture
def warnings(caplog: pytest.LogCaptureFixture) -> pytest.LogCaptureFixture:
    caplog.set_level(logging.WARNING)
    return caplog


def made(store: Store, mode: int, folder: str = "") -> Path:
    path = Path(store.files.path(folder))
    for part in (Path(store.files.path("")), path):
        part.mkdir(parents=True, exist_ok=True)
        part.chmod(0o755)
    if folder:
        path.parent.chmod(0o755)
    path.chmod(mode)
    return path


def test_a_store_of_ones_own_is_trusted(store: Store, warnings: pytest.LogCaptureFixture) -> None:
    warn_if_others_can_write(store)  # not there yet
    made(store, 0o755)
    made(store, 0o700, "blobs")
    warn_if_others_can_write(open_store(Path(store.files.path(""))))
    warn_if_others_can_write(open_store("memory://trust"))
    assert warnings.messages == []


@pytest.mark.parametrize("mode", [0o775, 0o757, 0o777, 0o1777])
@pytest.mark.parametrize("folder", ["", "actions", "blobs/ab", "actions/00", "pins/P0001"])
def test_others_can_write(store: Store, warnings: pytest.LogCaptureFixture, mode: int, folder: str) -> None:
    path = made(store, mode, folder)
    warn_if_others_can_write(store)
    warn_if_others_can_write(store)
    expected = "other users can write to it and so exchange results, expected 'chmod -R go-w'"
    assert warnings.messages == [f"{path}: {expected}"]


def test_the_group_of_a_workflow_is_no_other(store: Store, warnings: pytest.LogCaptureFixture) -> None:
    path = made(store, 0o2770, "blobs/ab")
    warn_if_others_can_write(store, path.stat().st_gid)
    assert warnings.messages == []
    warn_if_others_can_write(store, path.stat().st_gid + 1)
    assert len(warnings.messages) == 1
    path.chmod(0o2777)
    trust._warn.cache_clear()
    warn_if_others_can_write(store, path.stat().st_gid)
    assert len(warnings.messages) == 2


def test_another_owner(store: Store, warnings: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch) -> None:
    path = made(store, 0o755)
    monkeypatch.setattr(os, "geteuid", lambda: path.stat().st_uid + 1)
    warn_if_others_can_write(store)
    assert warnings.messages == [f"{path}: belongs to another user, who can exchange results, expected your own store"]
