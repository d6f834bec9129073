"""Films are shared between test runs as long as they are what their code made."""

from pathlib import Path

import pytest
from shared_folders import once_a_code

from pipelines.engine.actions.code import CodeIdentity


@pytest.fixture
def made() -> list[str]:
    """The name of each folder that was made, in order."""
    return []


@pytest.fixture
def film(tmp_path: Path, made: list[str]) -> object:
    def write(folder: Path) -> None:
        folder.mkdir()
        (folder / "cam1.avi").write_bytes(b"film")
        made.append(folder.name)

    return lambda: once_a_code(tmp_path)("scan", write)


def test_films_are_made_once(film, made) -> None:
    assert (film() / "cam1.avi").read_bytes() == b"film"
    assert film() == film()
    assert len(made) == 1


@pytest.mark.parametrize("content", [b"spoiled", None])
def test_a_spoiled_film_is_made_anew(film, made, content) -> None:
    picture = film() / "cam1.avi"
    if content is None:
        picture.unlink()
    else:
        picture.write_bytes(content)
    assert (film() / "cam1.avi").read_bytes() == b"film"
    assert len(made) == 2


def test_another_code_makes_its_own_films(film, made, monkeypatch: pytest.MonkeyPatch) -> None:
    before = film()
    other = CodeIdentity({"footscan.virtual.filming.record": "another"}, {})
    monkeypatch.setattr("shared_folders.code_identity", lambda _: other)
    assert film() != before
    assert not before.exists()
    assert len(made) == 2


def test_what_was_cut_off_is_not_taken(tmp_path: Path) -> None:
    def cut_off(folder: Path) -> None:
        folder.mkdir()
        raise KeyboardInterrupt

    for _ in range(2):
        with pytest.raises(KeyboardInterrupt):
            once_a_code(tmp_path)("scan", cut_off)
    assert not list((tmp_path / "scan").glob("*.sha256"))
