"""Notes of erasures under way in a store; they reveal an interrupted erasure."""

from pipelines.engine.store.store import Store

FOLDER = "forgetting"
"""Folder of the notes in a store."""


def note_name(subject: str) -> str:
    """Return the file name of a note; `subject` is `patient` or `patient/scan`."""
    return f"{FOLDER}/{subject}.json"


def interrupted_erasures(store: Store) -> list[str]:
    """Return the subjects whose erasure has begun but not ended."""
    names = (name for name, _ in store.files.sizes(FOLDER))
    return [name.removeprefix(f"{FOLDER}/").removesuffix(".json") for name in names if name.endswith(".json")]
