"""LabVIEW measurement files (.lvm) of one rate, with tabs and without X columns.

Layout: National Instruments, "Specification for the LabVIEW Measurement File (.lvm)".
"""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path

import numpy as np

from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.readers.head import Claim, Head
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording, SignalHeader, StoredChannel
from recoil_acquisition.timebase import TimeBase

FIRST, END = "LabVIEW Measurement", "***End_of_Header***"


class LvmReader:
    """Reader of LabVIEW measurement files."""

    name, kind, suffixes = "LabVIEW measurement", "dewetron", (".lvm",)

    def claims(self, head: Head) -> Claim:
        """Be certain of the first line."""
        return Claim.CERTAIN if head.text.startswith(FIRST) else Claim.NO

    def open(self, path: Path, declared: Declarations) -> Recording:
        """Open a file; raises `CorruptFileError` if it is damaged."""
        try:
            *lines, cut = path.read_text("latin-1").splitlines(keepends=True) or [""]
        except OSError as error:
            raise ReadError(f"cannot be read: {error.strerror}", path=path) from error
        lines, cut = (lines, cut) if not cut.endswith("\n") else ([*lines, cut], "")
        cells = [line.rstrip("\r\n").split("\t") for line in lines]
        ends = [i for i, row in enumerate(cells) if row[0] == END]
        try:
            said = {row[0]: row[1:] for row in cells[ends[0] : ends[1]]}
            names, step_s, start_s = cells[ends[1] + 1][1:-1], float(said["Delta_X"][0]), float(said["X0"][0])
            rows = [row[1 : len(names) + 1] for row in cells[ends[1] + 2 :]]
            values = np.array([[float(cell) for cell in row] for row in rows]).reshape(len(rows), len(names))
            units = [*said.get("Y_Unit_Label", []), *[""] * len(names)]
            if not rows or not names or len(set(names)) < len(names) or not math.isfinite(start_s):
                raise ValueError("no rows, or no names that differ")
            base = TimeBase.uniform(declared.clock, start_s, step_s, len(rows))
        except (ValueError, LookupError, OverflowError) as error:
            raise CorruptFileError("the file is damaged", path=path, found=str(error)[:80]) from error
        missing = max(int(count) for count in said["Samples"] if count.isdigit()) - len(rows)
        short = f"{missing} of the stated rows are not in the file" if missing > 0 or cut else ""
        headers = map(SignalHeader, names, units, [len(rows)] * len(names))
        channels = [StoredChannel(h, base, partial(_part, values[:, i])) for i, h in enumerate(headers)]
        return Recording(path, self.name, channels, metadata=said, notes=[short] * bool(short), incomplete=short)


def _part(column: np.ndarray, start: int, stop: int) -> np.ndarray:
    return column[start:stop].copy()
