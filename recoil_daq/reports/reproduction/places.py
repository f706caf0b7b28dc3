"""Places in which reports stand, and the documents of targets."""

from __future__ import annotations

from pathlib import Path

from recoil_acquisition.errors import ReadError
from recoil_daq.arguments import named_report
from recoil_identification.report.document.report_files import (
    REPORT_FILE,
)
from recoil_identification.targets import target_names

ANEW = "identify the shot anew"


def find_reports(place: str | Path) -> list[Path]:
    """Return the reports of a place: a ``report.json``, the folder of one, or a folder of such folders.

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
    found = reports_in(place)
    if not found:
        targets = targets_in(place)
        raise ReadError(
            "no report in this folder",
            path=place,
            expected=f"a {REPORT_FILE}, or folders with one each",
            remedy=f"name the target's own file: {', '.join(map(str, targets))}" if targets else None,
        )
    return found


def targets_in(folder: Path) -> list[Path]:
    """Return the documents of targets in a folder and in those in it, in the order of their names."""
    names = [f"{target}.json" for target in target_names()]
    return sorted(path for name in names for path in (*folder.glob(name), *folder.glob(f"*/{name}")))


def reports_in(folder: Path) -> list[Path]:
    """Return the ``report.json`` of a folder and of those in it, in the order of their names."""
    return sorted([*folder.glob(REPORT_FILE), *folder.glob(f"*/{REPORT_FILE}")])
