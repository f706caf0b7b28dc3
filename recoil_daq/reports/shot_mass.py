"""Mass of a live shot, in the process that stays warm for it."""

from __future__ import annotations

import math
import tempfile
from contextlib import suppress
from pathlib import Path
from typing import Any

from recoil_acquisition.errors import RecoilDaqError
from recoil_daq.reports.identify import identify_file


def shot_mass(task: tuple[Path, Path]) -> dict[str, Any]:
    """Identify a shot file, and write its report into a folder of reports, over one of before.

    Returns
    -------
    dict
        ``value``, ``u`` and ``U95`` in kg, ``E_n`` (null where the specification is not known or nothing is uncertain),
        ``valid``, ``reason``, the first of those that speak against it, and ``report``, its folder.

    Raises
    ------
    RecoilDaqError
        As `identify_file`.
    """
    path, reports = task
    found = identify_file(path, out=reports, overwrite=True)
    mass = found.document["mass"]
    u = math.hypot(mass["u"], mass["u_specification"])
    return {
        "value": mass["value"],
        "u": mass["u"],
        "U95": mass["U95"],
        "E_n": (mass["value"] - mass["specification"]) / (2.0 * u) if u > 0 else None,
        "valid": found.valid,
        "reason": next(iter(found.reasons), ""),
        "report": str(found.folder),
    }


def warm(path: Path | None) -> None:
    """Do what the first shot would have to wait for: load the libraries, and identify a shot that is there."""
    if path is not None:
        with tempfile.TemporaryDirectory(prefix="recoil-daq-") as folder, suppress(RecoilDaqError):
            identify_file(path, out=folder)
