"""Text waves of Igor Pro (.itx): one block of waves of one step.

Layout: WaveMetrics, Igor Pro manual, "Igor Text File Format": ``WAVES/D 'acc', 'p'``, rows between ``BEGIN`` and
``END``, then ``X SetScale/P x 0,0.001,"s", 'acc','p'`` for start and step, and ``X SetScale y 0,0,"m/s^2", 'acc'`` for
each unit.
"""

from __future__ import annotations

import math
import re
from functools import partial
from pathlib import Path

import numpy as np

from recoil_acquisition.clocks.timebase import TimeBase
from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.readers.head import Claim, Head
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording, SignalHeader, StoredChannel

_NAME = re.compile(r"'([^']+)'")
_X_SCALE = re.compile(r'X SetScale/P x ([^,]+),([^,]+),"s", (.+)')
_Y_SCALE = re.compile(r"X SetScale y 0,0,\"([^\"]*)\", '([^']+)'")


class ItxReader:
    """Reader of Igor's text waves."""

    name, kind, suffixes = "Igor text waves", "dewetron", (".itx",)

    def claims(self, head: Head) -> Claim:
        """Be certain of the first lines."""
        return Claim.CERTAIN if head.text.startswith("IGOR\nWAVES/D") else Claim.NO

    def open(self, path: Path, declared: Declarations) -> Recording:
        """Open a file; raises `CorruptFileError` if it is damaged, or cut: what follows the rows is missing then."""
        try:
            lines = path.read_text("latin-1").split("\n")
        except OSError as error:
            raise ReadError(f"cannot be read: {error.strerror}", path=path) from error
        try:
            names, begin, end = _NAME.findall(lines[1]), lines.index("BEGIN"), lines.index("END")
            rows = [[float(cell) for cell in line.split("\t")[1:]] for line in lines[begin + 1 : end]]
            values = np.array(rows).reshape(len(rows), len(names))
            (scale,) = filter(None, map(_X_SCALE.fullmatch, lines[end:]))
            units = {name: unit for unit, name in (s.groups() for s in map(_Y_SCALE.fullmatch, lines[end:]) if s)}
            if not rows or set(names) != set(units) != set() or _NAME.findall(scale[3]) != names or lines[-1]:
                raise ValueError("names, units and the end do not go together")
            if not math.isfinite(float(scale[1])):
                raise ValueError("no start")
            base = TimeBase.uniform(declared.clock, float(scale[1]), float(scale[2]), len(rows))
        except (ValueError, LookupError, OverflowError) as error:
            raise CorruptFileError("the file is damaged", path=path, found=str(error)[:80]) from error
        headers = [SignalHeader(name, units[name], len(rows)) for name in names]
        channels = [StoredChannel(h, base, partial(_part, values[:, i])) for i, h in enumerate(headers)]
        return Recording(path, self.name, channels, metadata={})


def _part(column: np.ndarray, start: int, stop: int) -> np.ndarray:
    return column[start:stop].copy()
