"""Mass of a live shot, in the process that stays warm for it."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Any

from recoil_acquisition.errors import RecoilDaqError
from recoil_acquisition.files.temporary_folder import temporary_folder
from recoil_acquisition.remark import NoteCode
from recoil_daq.recording.conversion import ConversionTask, convert
from recoil_daq.recording.overview import write_filtered, write_index
from recoil_daq.reports.identify import identify_file
from recoil_identification.report.document.report_files import CURVES_FILE
from recoil_identification.shot.identified import Options
from recoil_processing.shot.thinned import THINNED_TO_HZ
from recoil_rigs.rig import Rig, load_rig
from recoil_rigs.twin import simulate_shot

_OTHER_RIG = "mixed"
"""Rig whose virtual shot warms the process, where the rig itself has none: it has a source of every kind."""


def shot_mass(task: tuple[Path, Path, bool]) -> dict[str, Any]:
    """Identify a shot file, and write its report into a folder of reports, over one of before.

    Parameters
    ----------
    task
        Shot file, folder of the reports, and whether the fastest channels are thinned.

    Returns
    -------
    dict
        ``value``, ``u`` and ``U95`` in kg, ``E_n`` (null where the specification is not known or nothing is uncertain),
        ``valid``, ``reason``, the first of those that speak against it, ``report``, its folder, ``thinned_hz``, the
        rate to which channels were thinned (null where none was), ``bare``, whether nobody stated what was added,
        so that the specification is that of the bare rig, ``peaks`` and ``peaks_u``, those of the report. The curves of
        the report are written beside the shot's overview.

    Raises
    ------
    RecoilDaqError
        As `identify_file`.
    """
    path, reports, thin = task
    found = identify_file(path, out=reports, options=Options(thin=thin), overwrite=True)
    is_thinned = any(one["code"] == NoteCode.THINNED for one in found.document["findings"])
    write_filtered(path.parent, found.shot, found.document, found.folder / CURVES_FILE)
    write_index(path.parent)
    mass, row = found.document["mass"], found.document.get("shot_log") or {}
    return {
        "value": mass["value"],
        "u": mass["u"],
        "U95": mass["U95"],
        "E_n": found.document["E_n"],
        "valid": found.valid,
        "reason": next(iter(found.reasons), ""),
        "report": str(found.folder),
        "thinned_hz": THINNED_TO_HZ if is_thinned else None,
        "bare": "added_mass_kg" not in row,
        "peaks": found.document["peaks"],
        "peaks_u": found.document.get("peaks_u") or {},
    }


def warm(task: tuple[Path, Path | None, bool]) -> None:
    """Do what the first shot would have to wait for: convert a virtual shot, and identify the last one, or that.

    Nothing of it stays. What is wrong with the rig or the shot is said when it matters.

    Parameters
    ----------
    task
        Rig file, last shot file that is there (None if there is none), and whether shots are identified.
    """
    path, last, identify = task
    with temporary_folder() as name, suppress(RecoilDaqError, OSError):
        folder = Path(name)
        rig = load_rig(path)
        rig = rig if rig.twin else load_rig(_OTHER_RIG)
        made = _converted(rig, folder)
        shot_file = last or made
        if identify and shot_file is not None:
            identify_file(shot_file, out=folder / "reports")


def _converted(rig: Rig, folder: Path) -> Path | None:
    """Fire a virtual shot and convert it; return its shot file, None if there is none."""
    fired = simulate_shot(rig, folder / "files", seed=1, shot="0001")
    _, document = convert(ConversionTask.of(rig, fired.files, "0001", folder / "shots"))
    return Path(document["file"]) if "file" in document else None
