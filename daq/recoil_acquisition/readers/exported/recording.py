"""One opened file of an export of this project: some channels in SI on one time base."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.readers.column_recording import ColumnRecording
from recoil_acquisition.readers.exported.header import ExportedHeader
from recoil_acquisition.readers.reader import SignalHeader
from recoil_acquisition.timebase import AbsoluteStart, TimeBase


class ExportedRecording(ColumnRecording):
    """What both formats of an export have in common; the rows are read by the subclass.

    Parameters
    ----------
    header : ExportedHeader
    clock : str
        Name of the source.
    row_count : int
        Rows that are there; fewer than promised where the file was cut.
    """

    reader = ""

    def __init__(self, header: ExportedHeader, clock: str, row_count: int) -> None:
        self.path = header.path
        self._header = header
        self._clock = clock
        self.signals: tuple[SignalHeader, ...] = tuple(replace(s, sample_count=row_count) for s in header.signals)
        self._column = {signal.name: i for i, signal in enumerate(self.signals, start=1)}
        short = header.count - row_count
        self.incomplete = f"{short} of {header.count} rows are missing at the end" if short else ""

    @property
    @abstractmethod
    def _columns(self) -> tuple[NDArray[np.float64], ...]:
        """The time and the channels, each of shape (n_rows,)."""

    @cached_property
    def _time_base(self) -> TimeBase:
        return self._header.time_base(self._clock, self._columns[0], "time column")

    @property
    def metadata(self) -> Mapping[str, Any]:
        """What the file says about the shot, its clocks and its channels."""
        return self._header.metadata

    @property
    def notes(self) -> tuple[str, ...]:
        """What a user must know: rows that are missing, losses, a clock that was mapped."""
        lost = ((s.name, int(np.isnan(self._columns[i]).sum())) for i, s in enumerate(self.signals, start=1))
        losses = (
            f"{name}: {count} of {self.signals[0].sample_count} samples are lost" for name, count in lost if count
        )
        own, reference = self.metadata.get("clock"), self.metadata.get("reference_clock")
        mapped = self.metadata.get("aligned") is True and own != reference
        told = (f"the time was mapped from the clock {own!r} to {reference!r} when it was exported",) if mapped else ()
        return (*((self.incomplete,) if self.incomplete else ()), *losses, *told)

    @property
    def absolute_start(self) -> AbsoluteStart | None:
        """Wall-clock time of the time zero, if the shot knew it."""
        return self._header.absolute_start

    @property
    def times_s(self) -> NDArray[np.float64]:
        """All instants, seconds, shape (n_rows,); those of a file without channels too."""
        return self._time_base.times_s

    def read(self, name: str, start: int = 0, stop: int | None = None) -> NDArray[np.float64]:
        """Read samples of one channel in SI, lost ones NaN, shape (stop - start,)."""
        return np.array(self._columns[self._index(name)][start:stop])
