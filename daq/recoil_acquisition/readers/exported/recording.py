"""One opened file of an export of this project: some channels in SI on one time base."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.clocks.timebase import TimeBase
from recoil_acquisition.readers.exported.header import ExportedHeader
from recoil_acquisition.readers.own_rows import about_rows, own_rows
from recoil_acquisition.readers.recording import Recording, StoredChannel
from recoil_acquisition.readers.statements import Statements
from recoil_acquisition.remark import Note, NoteCode, Remark

Columns = tuple[NDArray[np.float64], ...]


def exported_recording(
    reader: str, header: ExportedHeader, clock: str, row_count: int, read_columns: Callable[[], Columns], cut: str = ""
) -> Recording:
    """Return the recording of an export, whatever its format.

    Parameters
    ----------
    reader
        Name of the reader.
    clock
        Name of the source.
    row_count
        Rows that are there; fewer than promised where the file was cut.
    read_columns
        Function that reads the time and the channels, each of shape (n_rows,); asked once, when the first sample is.
    cut
        Other sign by which it shows that the file was cut off; empty if there is none.
    """
    short = header.count - row_count
    missing = f"{short} of {header.count} rows are missing at the end" if short else ""
    incomplete = "; ".join(filter(None, (missing, cut)))
    rows = _Rows(header, clock, incomplete, read_columns)
    channels = [
        StoredChannel(
            replace(signal, sample_count=row_count),
            rows.instants,
            partial(rows.samples, i),
            beside=Statements(signal.metadata, ("unit",)),
        )
        for i, signal in enumerate(header.signals, start=1)
    ]
    return Recording(
        header.path, reader, channels, metadata=header.metadata, notes=rows.notes, incomplete=incomplete,
        absolute_start=header.absolute_start,
    )  # fmt: skip


class _Rows:
    """The columns of an export, read when the first sample is asked for."""

    def __init__(
        self, header: ExportedHeader, clock: str, incomplete: str, read_columns: Callable[[], Columns]
    ) -> None:
        self._header, self._clock, self._incomplete, self._read_columns = header, clock, incomplete, read_columns

    @cached_property
    def _columns(self) -> Columns:
        return self._read_columns()

    @cached_property
    def _time_base(self) -> TimeBase:
        return self._header.time_base(self._clock, self._columns[0], "time column")

    def instants(self) -> TimeBase:
        return self._time_base

    def samples(self, column: int, start: int, stop: int) -> NDArray[np.float64]:
        return np.array(self._columns[column][start:stop])

    def notes(self) -> tuple[Remark, ...]:
        """Say which rows and samples are missing, and whether the clock was mapped."""
        lost = ((s.name, self._columns[i]) for i, s in enumerate(self._header.signals, start=1))
        losses = (note for name, column in lost for note in _about_lost(name, column))
        said = self._header.metadata
        own, reference = said.get("clock"), said.get("reference_clock")
        mapped = said.get("aligned") is True and own != reference
        cut = [Note(NoteCode.CUT, None, self._incomplete)] if self._incomplete else []
        text = f"the time was mapped from the clock {own!r} to {reference!r} when it was exported"
        return (*cut, *losses, *([Note(NoteCode.TIME, None, text)] if mapped else []))


def _about_lost(name: str, column: NDArray[np.float64]) -> tuple[Note, ...]:
    rows = own_rows(column)
    if rows is not None:
        return about_rows(name, column, rows)
    count = int(np.isnan(column).sum())
    text = f"{name}: {count} of {column.size} samples are lost"
    return (Note(NoteCode.LOST, name, text),) if count else ()
