"""One opened file of camera tracks, whatever its format."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.errors import ReadError
from recoil_acquisition.quantity import find_unit
from recoil_acquisition.readers.column_recording import ColumnRecording
from recoil_acquisition.readers.reader import Declarations, SignalHeader
from recoil_acquisition.readers.text.cells import unique_names
from recoil_acquisition.readers.tracks.columns import Column
from recoil_acquisition.readers.tracks.faults import find_track_faults
from recoil_acquisition.readers.tracks.frame_time import FrameClock
from recoil_acquisition.timebase import AbsoluteStart, TimeBase
from recoil_acquisition.track import Track

PIXELS = ("px", "pixel", "pixels")
"""Spellings of pixels, in any case."""

LOW_LIKELIHOOD = 0.6
"""Likelihood below which the usual practice takes a position for lost; here it is counted and kept."""


@dataclass(frozen=True, eq=False)
class TrackTable:
    """The content of a file of tracks.

    Attributes
    ----------
    path : Path
    reader : str
        Name of the format's reader.
    columns : tuple of Column
    values : ndarray of float64, shape (n_frames, n_columns)
        In the file's units; NaN where the file has no number.
    clock : FrameClock
    metadata : mapping
    notes : tuple of str
    incomplete : str
        How it shows that the file was cut off; empty if nothing shows that.
    minus_one_is_lost : bool
        Whether a feature whose coordinates are all exactly -1 is lost.
    """

    path: Path
    reader: str
    columns: tuple[Column, ...]
    values: NDArray[np.float64]
    clock: FrameClock
    metadata: Mapping[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    incomplete: str = ""
    minus_one_is_lost: bool = False


def refuse_layout(declared: Declarations, path: Path) -> None:
    """Refuse a file that was recognised by its content although its source declares a layout.

    Raises
    ------
    ReadError
        If the source declares a layout: it would not be followed.
    """
    if declared.layout is not None:
        raise ReadError(
            f"source {declared.clock!r} declares a layout, and the file was recognised without it",
            path=path,
            expected="a source whose `match` pattern fits the file's name",
            remedy="add `match` to the source in the rig file, or leave out its `layout`",
        )


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


class TrackRecording(ColumnRecording):
    """One opened file of camera tracks.

    Parameters
    ----------
    table : TrackTable
        Its values are taken over and changed: lost coordinates become NaN.
    declared : Declarations

    Raises
    ------
    ReadError
        If the unit of a coordinate is unknown.
    """

    absolute_start: AbsoluteStart | None = None

    def __init__(self, table: TrackTable, declared: Declarations) -> None:
        check_units(table.columns, table.path)
        self.path, self.reader, self.incomplete = table.path, table.reader, table.incomplete
        self._columns, self._values = table.columns, table.values
        self._frames = table.clock.numbers
        try:
            self._frame_times = TimeBase.stamped(declared.clock, table.clock.times_s)
        except ValueError as error:
            raise ReadError(
                f"the frames have no times that increase: {error}", path=table.path, remedy="export one clip per file"
            ) from error
        self._features: dict[str, list[int]] = {}
        for i, column in enumerate(table.columns):
            if column.kind == "position":
                self._features.setdefault(column.feature, []).append(i)
        notes = [*([table.incomplete] if table.incomplete else []), *table.notes, *table.clock.notes]
        notes += self._mark_lost(minus_one=table.minus_one_is_lost)
        faults = find_track_faults({track.name: track.positions for track in self.tracks()}, self._frames)
        notes += [*faults.notes, *self._about_scores()]
        derived = [c.name for c in table.columns if c.kind == "derived"]
        if derived:
            notes.append(f"columns that the tracking software derived carry its own filter: {', '.join(derived)}")
        signal_columns = [i for i, c in enumerate(table.columns) if c.kind not in ("frame", "time")]
        if not signal_columns:
            raise ReadError(
                "no coordinate of a feature in this file",
                path=table.path,
                found=", ".join(c.name for c in table.columns) or "no columns",
                remedy="export the features' positions, or declare `layout` of this source in the rig file",
            )
        names, repeats = unique_names([table.columns[i].name for i in signal_columns])
        self._column = dict(zip(names, signal_columns, strict=True))
        self.signals = tuple(
            SignalHeader(n, table.columns[i].unit, len(table.values), metadata={"kind": table.columns[i].kind})
            for n, i in self._column.items()
        )
        self.metadata: Mapping[str, Any] = {
            **table.metadata,
            "frame_rate_hz": table.clock.rate_hz,
            "repeated_frames": list(faults.repeated_frames),
        }
        self.notes = (*notes, *repeats)

    @property
    def _time_base(self) -> TimeBase:
        return self._frame_times

    def _mark_lost(self, *, minus_one: bool) -> list[str]:
        """Set coordinates of lost features to NaN and count them."""
        notes = []
        for feature, at in self._features.items():
            values = self._values[:, at]
            marked = (values == -1).all(axis=1) & (minus_one and len(at) > 1)
            empty = np.isnan(values).any(axis=1)
            angles = [i for i, c in enumerate(self._columns) if c.kind == "angle" and c.feature == feature]
            self._values[np.flatnonzero(marked)[:, None], [*at, *angles]] = np.nan
            lost = int((marked | empty).sum())
            if lost:
                kinds = f"{int(marked.sum())} marked -1, {int(empty.sum())} empty"
                notes.append(f"{feature or 'feature1'}: lost in {lost} of {len(values)} frames ({kinds})")
        return notes

    def _about_scores(self) -> list[str]:
        """Count positions that the tracking software itself holds to be doubtful."""
        notes = []
        for i, column in enumerate(self._columns):
            low = int((self._values[:, i] < LOW_LIKELIHOOD).sum()) if column.kind == "score" else 0
            if low:
                notes.append(
                    f"{column.name}: below {LOW_LIKELIHOOD:g} in {low} of {len(self._values)} frames; "
                    "the positions are kept"
                )
        return notes

    def read(self, name: str, start: int = 0, stop: int | None = None) -> NDArray[np.float64]:
        """Read samples of one signal in the file's unit, lost ones NaN, shape (stop - start,)."""
        return self._values[start:stop, self._index(name)].copy()

    def tracks(self) -> tuple[Track, ...]:
        """Return the features' paths; a frame that lost one coordinate lost them all."""
        tracks = []
        for n, (feature, at) in enumerate(self._features.items(), start=1):
            positions = self._values[:, at].copy()
            positions[np.isnan(positions).any(axis=1)] = np.nan
            axes = tuple(self._columns[i].axis for i in at)
            tracks.append(
                Track(
                    feature or f"feature{n}", axes, positions, self._frames, self._columns[at[0]].unit, self._time_base
                )
            )
        return tuple(tracks)
