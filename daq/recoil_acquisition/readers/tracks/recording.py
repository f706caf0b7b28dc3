"""One opened file of camera tracks, whatever its format."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.clocks.timebase import TimeBase
from recoil_acquisition.errors import ReadError
from recoil_acquisition.quantities.quantity import find_unit
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording, SignalHeader, StoredChannel
from recoil_acquisition.readers.statements import Statements, statements_in
from recoil_acquisition.readers.text.cells import unique_names
from recoil_acquisition.readers.tracks.columns import Column
from recoil_acquisition.readers.tracks.faults import find_track_faults
from recoil_acquisition.readers.tracks.frame_time import FrameClock
from recoil_acquisition.readers.tracks.layout import PIXELS
from recoil_acquisition.remark import Note, NoteCode, Remark
from recoil_acquisition.track import Track

LOW_LIKELIHOOD = 0.6
"""Likelihood below which the usual practice takes a position for lost; here it is counted and kept."""


@dataclass(frozen=True, eq=False)
class TrackTable:
    """The content of a file of tracks.

    Attributes
    ----------
    reader
        Name of the format's reader.
    values : ndarray of float64, shape (n_frames, n_columns)
        Numbers in the file's units; NaN where the file has none.
    incomplete
        Sign by which it shows that the file was cut off; empty if nothing shows that.
    minus_one_is_lost
        Whether a feature whose coordinates are all exactly -1 is lost.
    """

    path: Path
    reader: str
    columns: tuple[Column, ...]
    values: NDArray[np.float64]
    clock: FrameClock
    metadata: Mapping[str, Any] = field(default_factory=dict)
    notes: tuple[Remark, ...] = ()
    incomplete: str = ""
    minus_one_is_lost: bool = False


def check_units(columns: Sequence[Column], path: Path) -> None:
    """Check that coordinates are in pixels or a length, and angles in an angle, where the file states a unit.

    Raises
    ------
    ReadError
        If a unit is unknown, or is one of something else.
    """
    for column in columns:
        quantity = {"position": "displacement", "angle": "angle"}.get(column.kind)
        if quantity is None or not column.unit or (quantity == "displacement" and column.unit.casefold() in PIXELS):
            continue
        unit = find_unit(column.unit)
        if unit is None or quantity not in unit.quantities:
            raise ReadError(
                f"the unit of column {column.name!r} is not known as that of {quantity}",
                path=path,
                expected="px, mm, cm, m, in or ft" if quantity == "displacement" else "deg or rad",
                found=repr(column.unit),
                remedy="declare the columns and their `unit` in `layout` of this source in the rig file, "
                "or export in one of these",
            )


def track_recording(table: TrackTable, declared: Declarations) -> Recording:
    """Return the recording of a file of camera tracks.

    Parameters
    ----------
    table
        Table whose values are taken over and changed: lost coordinates become NaN.

    Raises
    ------
    ReadError
        If the unit of a coordinate is unknown, time does not increase, or there is no coordinate.
    """
    check_units(table.columns, table.path)
    try:
        frame_times = TimeBase.stamped(declared.clock, table.clock.times_s)
    except ValueError as error:
        raise ReadError(
            f"the frames have no times that increase: {error}", path=table.path, remedy="export one clip per file"
        ) from error
    features = _Features(table, frame_times)
    notes: list[Remark] = [Note(NoteCode.CUT, None, table.incomplete)] if table.incomplete else []
    notes += [*table.notes, *table.clock.notes]
    notes += features.mark_lost()
    faults = find_track_faults({track.name: track.positions for track in features.tracks()}, table.clock.numbers)
    notes += [*faults.notes, *_about_scores(table)]
    of_text = [c.name for c in table.columns if c.kind == "text"]
    if of_text:
        text = f"columns that hold text were left out: {', '.join(of_text)}"
        notes.append(Note(NoteCode.LEFT_OUT, None, text))
    derived = [c.name for c in table.columns if c.kind == "derived"]
    if derived:
        text = f"columns that the tracking software derived carry its own filter: {', '.join(derived)}"
        notes.append(Note(NoteCode.TRACK, None, text))
    at = [i for i, c in enumerate(table.columns) if c.kind not in ("frame", "time", "text")]
    if not at:
        raise ReadError(
            "no coordinate of a feature in this file",
            path=table.path,
            found=", ".join(c.name for c in table.columns) or "no columns",
            remedy="export the features' positions, or declare `layout` of this source in the rig file",
        )
    names, repeats = unique_names([table.columns[i].name for i in at])
    head = table.metadata.get("header", ())
    lines = [head] if isinstance(head, str) else list(head)
    beside = Statements({**statements_in(lines), **table.metadata.get("attributes", {})})
    channels = [
        StoredChannel(
            SignalHeader(name, table.columns[i].unit, len(table.values), metadata={"kind": table.columns[i].kind}),
            frame_times,
            partial(_samples, table.values, i),
            beside=beside,
        )
        for name, i in zip(names, at, strict=True)
    ]
    metadata = {
        **table.metadata,
        "frame_rate_hz": table.clock.rate_hz,
        "repeated_frames": list(faults.repeated_frames),
    }
    return Recording(
        table.path, table.reader, channels, metadata=metadata, notes=(*notes, *repeats), incomplete=table.incomplete,
        tracks=features.tracks,
    )  # fmt: skip


def _samples(values: NDArray[np.float64], column: int, start: int, stop: int) -> NDArray[np.float64]:
    return values[start:stop, column].copy()


class _Features:
    """The features of a table, each with the columns of its coordinates."""

    def __init__(self, table: TrackTable, frame_times: TimeBase) -> None:
        self._table, self._frame_times = table, frame_times
        self._columns_of: dict[str, list[int]] = {}
        for i, column in enumerate(table.columns):
            if column.kind == "position":
                self._columns_of.setdefault(column.feature, []).append(i)

    def mark_lost(self) -> list[Remark]:
        """Set coordinates of lost features to NaN and count them."""
        table = self._table
        notes: list[Remark] = []
        for feature, at in self._columns_of.items():
            values = table.values[:, at]
            marked = (values == -1).all(axis=1) & (table.minus_one_is_lost and len(at) > 1)
            empty = np.isnan(values).any(axis=1)
            angles = [i for i, c in enumerate(table.columns) if c.kind == "angle" and c.feature == feature]
            table.values[np.flatnonzero(marked)[:, None], [*at, *angles]] = np.nan
            lost = int((marked | empty).sum())
            if lost:
                kinds = f"{int(marked.sum())} marked -1, {int(empty.sum())} empty"
                name = feature or "feature1"
                text = f"{name}: lost in {lost} of {len(values)} frames ({kinds})"
                notes.append(Note(NoteCode.LOST, name, text))
        return notes

    def tracks(self) -> tuple[Track, ...]:
        """Return the features' paths; a frame that lost one coordinate lost them all."""
        tracks, table = [], self._table
        for n, (feature, at) in enumerate(self._columns_of.items(), start=1):
            positions = table.values[:, at].copy()
            positions[np.isnan(positions).any(axis=1)] = np.nan
            axes = tuple(table.columns[i].axis for i in at)
            unit = table.columns[at[0]].unit
            tracks.append(
                Track(feature or f"feature{n}", axes, positions, table.clock.numbers, unit, self._frame_times)
            )
        return tuple(tracks)


def _about_scores(table: TrackTable) -> list[Remark]:
    """Count positions that the tracking software itself holds to be doubtful."""
    notes: list[Remark] = []
    for i, column in enumerate(table.columns):
        low = int((table.values[:, i] < LOW_LIKELIHOOD).sum()) if column.kind == "score" else 0
        if low:
            text = (
                f"{column.name}: below {LOW_LIKELIHOOD:g} in {low} of {len(table.values)} frames; "
                "the positions are kept"
            )
            notes.append(Note(NoteCode.TRACK, column.name, text))
    return notes
