"""Numbers out of frames, for a whole capture at once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from daq.frames.decoder import cell_value
from daq.frames.framing import TYPE_SIZES, Elements, Field, FrameType, Framing
from daq.frames.scan import FrameSet


@dataclass(frozen=True, eq=False)
class FieldSeries:
    """One field over all frames that hold it.

    Attributes
    ----------
    field : Field
    frames : ndarray of int64, shape (n_samples,)
        Numbers of those frames in the capture.
    raw : ndarray, shape (n_samples,)
        As stored: int64 or float64.
    """

    field: Field
    frames: NDArray[np.int64]
    raw: NDArray[Any]

    @property
    def values(self) -> NDArray[np.float64]:
        """Scaled values in the declared unit, shape (n_samples,)."""
        return self.raw.astype(np.float64) * self.field.scale + self.field.offset


def decode_fields(framing: Framing, frames: FrameSet) -> dict[str, FieldSeries]:
    """Decode every field of every frame.

    Parameters
    ----------
    framing : Framing
    frames : FrameSet

    Returns
    -------
    dict of str to FieldSeries
        By the field's name, in the declared order.
    """
    series: dict[str, FieldSeries] = {}
    left = np.ones(frames.begins.size, dtype=bool)
    for frame_type in framing.types:
        chosen = np.flatnonzero(left & _fits(framing, frame_type, frames))
        left[chosen] = False
        if framing.kind == "delimiter":
            found = _from_lines(framing, frame_type, frames, chosen)
        elif frame_type.elements is not None:
            found = _from_elements(framing, frame_type, frame_type.elements, frames, chosen)
        else:
            found = _from_places(framing, frame_type, frames, chosen)
        series |= found
    return series


def _fits(framing: Framing, frame_type: FrameType, frames: FrameSet) -> NDArray[np.bool_]:
    when = frame_type.when
    if when is None:
        return np.ones(frames.begins.size, dtype=bool)
    if framing.kind == "delimiter":
        one = Framing(framing.kind, (frame_type,), separator=framing.separator)
        return np.array([one.type_of(frames.frame(i)) is not None for i in range(frames.begins.size)], dtype=bool)
    data = np.frombuffer(frames.buffer, dtype=np.uint8)
    fits = frames.lengths >= when.at + len(when.equals)
    for i, byte in enumerate(when.equals):
        fits[fits] = data[frames.begins[fits] + when.at + i] == byte
    return fits


def _from_places(
    framing: Framing, frame_type: FrameType, frames: FrameSet, chosen: NDArray[np.intp]
) -> dict[str, FieldSeries]:
    trailer = framing.checksum.size if framing.checksum else 0
    series = {}
    for field in frame_type.fields:
        held = chosen[frames.lengths[chosen] - trailer >= field.at + field.size]
        series[field.name] = FieldSeries(
            field, held.astype(np.int64), _numbers(frames.buffer, frames.begins[held] + field.at, field)
        )
    return series


def _from_elements(
    framing: Framing, frame_type: FrameType, elements: Elements, frames: FrameSet, chosen: NDArray[np.intp]
) -> dict[str, FieldSeries]:
    """Walk through the elements of each frame; an element too short for a field does not hold it."""
    trailer = framing.checksum.size if framing.checksum else 0
    places: dict[str, list[tuple[int, int]]] = {field.name: [] for field in frame_type.fields}
    by_element: dict[int, list[Field]] = {}
    for field in frame_type.fields:
        by_element.setdefault(field.element or 0, []).append(field)
    for i in chosen.tolist():
        at, end = int(frames.begins[i]) + elements.start, int(frames.begins[i] + frames.lengths[i]) - trailer
        for identifier, begin, size in _elements_between(frames.buffer, at, end, elements):
            for field in by_element.get(identifier, ()):
                if field.at + field.size <= size and (not places[field.name] or places[field.name][-1][0] != i):
                    places[field.name].append((i, begin + field.at))
    series = {}
    for field in frame_type.fields:
        found = np.array(places[field.name], dtype=np.int64).reshape(-1, 2)
        series[field.name] = FieldSeries(field, found[:, 0], _numbers(frames.buffer, found[:, 1], field))
    return series


def _elements_between(buffer: bytes, at: int, end: int, elements: Elements) -> list[tuple[int, int, int]]:
    """Return identifier, first byte and size of each element's data, up to the first that does not fit."""
    order: Literal["big", "little"] = "big" if elements.big_endian else "little"
    id_size, length_size = TYPE_SIZES[elements.id_type], TYPE_SIZES[elements.length_type]
    found = []
    while at + id_size + length_size <= end:
        id_at, length_at = (at, at + id_size) if elements.id_first else (at + length_size, at)
        identifier = int.from_bytes(buffer[id_at : id_at + id_size], order)
        size = int.from_bytes(buffer[length_at : length_at + length_size], order) - elements.length_includes
        at += id_size + length_size
        if size < 0 or at + size > end:
            break
        found.append((identifier, at, size))
        at += size
    return found


def _from_lines(
    framing: Framing, frame_type: FrameType, frames: FrameSet, chosen: NDArray[np.intp]
) -> dict[str, FieldSeries]:
    lines = [frames.frame(i) for i in chosen.tolist()]
    return {
        field.name: FieldSeries(
            field,
            chosen.astype(np.int64),
            np.array([cell_value(line, field, framing.separator) for line in lines], dtype=np.float64),
        )
        for field in frame_type.fields
    }


def _numbers(buffer: bytes, begins: NDArray[np.int64], field: Field) -> NDArray[Any]:
    """Read one binary number at each of some bytes of a buffer, shape (n,)."""
    data = np.frombuffer(buffer, dtype=np.uint8)
    rows = data[begins[:, None] + np.arange(field.size)]
    if not field.big_endian:
        rows = rows[:, ::-1]
    if field.type[0] == "f":
        return np.ascontiguousarray(rows).view(f">f{field.size}").reshape(-1).astype(np.float64)
    value = np.zeros(begins.size, dtype=np.int64)
    for column in rows.T:
        value = value << 8 | column
    if field.type[0] == "i":
        value -= (value >> (8 * field.size - 1)) << (8 * field.size)
    return value


def unwrap(counts: NDArray[Any], modulo: int) -> NDArray[Any]:
    """Undo the wrapping of a counter: a step of up to half the modulo is forward, more is backward.

    Parameters
    ----------
    counts : ndarray, shape (n,)
        As stored.
    modulo : int
        Value at which it wraps; 0 if it never does.

    Returns
    -------
    ndarray, shape (n,)
        Counted from the first, which becomes 0.
    """
    if not counts.size:
        return counts
    if not modulo:
        return np.asarray(counts - counts[0])
    steps = np.mod(np.diff(counts), modulo)
    steps = np.where(steps > modulo // 2, steps - modulo, steps)
    return np.concatenate([np.zeros(1, dtype=counts.dtype), np.cumsum(steps)])


def gaps(counts: NDArray[np.int64], modulo: int) -> tuple[int, int]:
    """Count the places where a packet counter misses frames, and the frames that are missing.

    Parameters
    ----------
    counts : ndarray of int64, shape (n,)
    modulo : int

    Returns
    -------
    tuple of int
        Gaps and missing frames; repeated or backward counts are gaps without missing frames.
    """
    steps = np.diff(unwrap(counts, modulo))
    return int((steps != 1).sum()), int((steps[steps > 1] - 1).sum())
