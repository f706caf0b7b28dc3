"""Mass of a live shot, in the process that stays warm for it."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from recoil_acquisition.errors import RecoilDaqError
from recoil_acquisition.files.temporary_folder import temporary_folder
from recoil_acquisition.remark import NoteCode
from recoil_acquisition.shot.shot import InputFile
from recoil_acquisition.store import shot_summary
from recoil_acquisition.store.shot_log import ShotLog
from recoil_daq.recording.conversion import ConversionTask, convert
from recoil_daq.recording.overview import write_filtered, write_index
from recoil_daq.reports.identify import identify_file, write_report
from recoil_daq.reports.output import Output
from recoil_identification.report.document.report_files import REPORT_FILE, read_document
from recoil_identification.shot.firing_record import Curves, curves_of
from recoil_identification.shot.identified import Options
from recoil_processing.shot.regression import PRESSURE_ROLES
from recoil_processing.shot.thinned import THINNED_TO_HZ
from recoil_rigs.rig import Rig, load_rig
from recoil_rigs.twin import simulate_shot

MOST_EARLIER = 50
"""Shots of before that the range shows."""
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
    curves: list[Curves] = []
    found = write_report(
        path, Output(reports, overwrite=True), options=Options(thin=thin),
        identified=lambda one: curves.append(curves_of(one, PRESSURE_ROLES)),
    )  # fmt: skip
    is_thinned = any(one["code"] == NoteCode.THINNED for one in found.document["findings"])
    for one in curves:
        write_filtered(path.parent, found.shot, found.document["interval_s"][0], one.times_s, one.values)
    write_index(path.parent)
    return told(found.document, found.folder, THINNED_TO_HZ if is_thinned else None)


def told(document: Mapping[str, Any], folder: Path, thinned_hz: float | None = None) -> dict[str, Any]:
    """Return what `shot_mass` does of a report in a folder."""
    mass = document["mass"]
    return {
        "value": mass["value"],
        "u": mass["u"],
        "U95": mass["U95"],
        "E_n": document["E_n"],
        "valid": document["valid"],
        "reason": next(iter(document["reasons"]), ""),
        "report": str(folder),
        "thinned_hz": thinned_hz,
        "bare": "added_mass_kg" not in (document.get("shot_log") or {}),
        "peaks": document["peaks"],
        "peaks_u": document.get("peaks_u") or {},
    }


def earlier_shots(out: Path) -> list[dict[str, Any]]:
    """Return the newest shots that are in a folder: what each was found to be good for, its mass, why it is left out.

    Returns
    -------
    list of dict
        For each shot file, in the order of their names: ``shot``, its name; ``document``, as
        `recoil_acquisition.store.shot_summary` returns it, with ``file``; ``mass``, as `shot_mass` returns it (None
        without a report of it); ``excluded``, a text. A file that cannot be read is left out.
    """
    found = []
    for path in sorted(out.glob("*.h5"))[-MOST_EARLIER:]:
        try:
            document = {**shot_summary(path), "file": str(path)}
            row = ShotLog.beside(path).row(path.stem)
        except RecoilDaqError:
            continue
        folder = out / "reports" / path.stem
        try:
            report = read_document(folder / REPORT_FILE)
            of_it = report["provenance"]["inputs"][0]["sha256"] == InputFile.of(path).sha256
            mass = told(report, folder) if of_it else None
        except (RecoilDaqError, LookupError, TypeError):
            mass = None
        excluded = "" if row is None else row.exclude
        found.append({"shot": path.stem, "document": document, "mass": mass, "excluded": excluded})
    return found


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
