"""Places in which reports stand, and the documents of targets."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from recoil_acquisition.errors import ReadError
from recoil_daq.arguments import named_report
from recoil_identification.report.document.report_files import (
    REPORT_FILE,
)
from recoil_identification.targets import target_names

ANEW = "identify the shot anew"


DAY_DEPTH = 3
"""Folders between that of a day and a report in it, at most: of a campaign, its reports, and of one of these."""


def named_in(folder: Path, *names: str, depth: int = 1) -> list[Path]:
    """Return the files of some names in a folder and so many folders below it, in the order of their paths."""
    ways = [f"{'*/' * steps}{name}" for name in names for steps in range(depth + 1)]
    return sorted(path for way in ways for path in folder.glob(way))


def reports_in(folder: Path, *, depth: int = 1) -> list[Path]:
    """Return the ``report.json`` of a folder and so many folders below it."""
    return named_in(folder, REPORT_FILE, depth=depth)


def targets_in(folder: Path, *, depth: int = 1) -> list[Path]:
    """Return the documents of targets in a folder and so many folders below it."""
    return named_in(folder, *(f"{target}.json" for target in target_names()), depth=depth)


def find_reports(place: str | Path, within: Callable[[Path], list[Path]] = reports_in) -> list[Path]:
    """Return the reports of a place: a ``report.json``, the folder of one, or a folder of such folders.

    Parameters
    ----------
    within
        Function that lists what is looked for in a folder.

    Raises
    ------
    ReadError
        If there is none.
    """
    place = named_report(Path(place))
    if not place.is_dir():
        if not place.exists():
            raise ReadError("no such file or folder", path=place, remedy="check the name and the folder")
        return [place]
    found = within(place)
    if not found:
        targets = targets_in(place)
        raise ReadError(
            "no report in this folder",
            path=place,
            expected=f"a {REPORT_FILE}, or folders with one each",
            remedy=f"name the target's own file: {', '.join(map(str, targets))}" if targets else None,
        )
    return found
