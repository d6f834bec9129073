"""Scans with actions in the store that were removed from the archive."""

import os
from collections.abc import Collection
from pathlib import Path

from pipelines.engine.trace import Actions


def vanished_scans(actions: Actions, present: Collection[str], archives: Collection[Path]) -> list[str]:
    """Find the scans (`patient/scan`) whose films and scan.yaml were in one of these archives and are deleted.

    The places of the films are those of the last run. Scans in other folders may belong to another workflow, and a
    missing or empty archive may be a disk that is not mounted: both are left out.

    Parameters
    ----------
    present : collection of str
        Scans that the archives contain.
    archives : collection of Path
        Folders of the archives.
    """
    roots = [archive.resolve() for archive in archives if archive.is_dir() and list(archive.iterdir())]
    films: dict[str, list[Path]] = {}
    for latest in actions.latest:
        scan = latest.step.rpartition("/")[0]
        places = (latest.sources.get(name) for name in ("film", "background", "travel", "positions"))
        films.setdefault(scan, []).extend(Path(place) for place in places if isinstance(place, str))
    return sorted(
        scan
        for scan, places in films.items()
        if scan not in present
        and places
        and all(any(place.is_relative_to(root) for root in roots) for place in places)
        and not any(os.path.lexists(place) or os.path.lexists(place.parent / "scan.yaml") for place in places)
    )
