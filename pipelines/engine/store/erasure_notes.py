"""Notes in a store of those who are being forgotten: what was cut off does not go unnoticed."""

from pipelines.engine.store.store import Store

FOLDER = "forgetting"


def note_name(subject: str) -> str:
    """The file of a note, by `patient` or `patient/scan`."""
    return f"{FOLDER}/{subject}.json"


def cut_off(store: Store) -> list[str]:
    """Whose erasure has begun and not ended."""
    names = (name for name, _ in store.files.sizes(FOLDER))
    return [name.removeprefix(f"{FOLDER}/").removesuffix(".json") for name in names if name.endswith(".json")]
