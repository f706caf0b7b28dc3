"""Numbers out of frames, for a whole capture at once."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.frames.acceptance import cell_value
from recoil_acquisition.frames.field import Elements, Field, FrameType
from recoil_acquisition.frames.frame_set import FrameSet
from recoil_acquisition.frames.framing import Framing
from recoil_acquisition.frames.number import numbers_at
from recoil_acquisition.numerics.read_only import ReadOnlyArrays

Places = NDArray[np.int64]

_MOST_LAYOUTS = 64


@dataclass(frozen=True, eq=False)
class FieldSeries(ReadOnlyArrays):
    """One field over all frames that hold it.

    Attributes
    ----------
    frames : ndarray of int64, shape (n_samples,)
        Numbers of those frames in the capture.
    raw : ndarray, shape (n_samples,)
        Numbers as stored: int64 or float64.
    """

    field: Field
    frames: NDArray[np.int64]
    raw: NDArray[Any]

    @property
    def values(self) -> NDArray[np.float64]:
        """Scaled values in the declared unit, shape (n_samples,)."""
        return self.raw.astype(np.float64) * self.field.scale + self.field.offset


def decode_fields(framing: Framing, frames: FrameSet, only: Collection[str] | None = None) -> dict[str, FieldSeries]:
    """Decode the fields of every frame.

    Parameters
    ----------
    only
        Names of the fields that are wanted; all if left out.

    Returns
    -------
    dict of str to FieldSeries
        Series by the fields' names, in the declared order.
    """
    series: dict[str, FieldSeries] = {}
    for whole, chosen in zip(framing.types, _of_types(framing, frames), strict=True):
        frame_type = whole
        if only is not None:
            frame_type = replace(whole, fields=tuple(field for field in whole.fields if field.name in only))
        if framing.kind == "delimiter":
            series |= _from_lines(framing, frame_type, frames, chosen)
        elif frame_type.elements is not None:
            series |= _from_elements(framing, frame_type, frame_type.elements, frames, chosen)
        else:
            series |= _from_places(framing, frame_type, frames, chosen)
    return series


def _of_types(framing: Framing, frames: FrameSet) -> list[Places]:
    """Return the numbers of the frames of each type; a frame is of the first type that fits."""
    if framing.kind == "delimiter":
        number = {id(frame_type): i for i, frame_type in enumerate(framing.types)}
        found: list[list[int]] = [[] for _ in framing.types]
        for i in range(frames.begins.size):
            frame_type = framing.type_of(frames.frame(i))
            if frame_type is not None:
                found[number[id(frame_type)]].append(i)
        return [np.array(one, dtype=np.int64) for one in found]
    left = np.ones(frames.begins.size, dtype=bool)
    chosen = []
    for frame_type in framing.types:
        fits = left & _fits(frame_type, frames)
        left &= ~fits
        chosen.append(np.flatnonzero(fits).astype(np.int64))
    return chosen


def _fits(frame_type: FrameType, frames: FrameSet) -> NDArray[np.bool_]:
    when = frame_type.when
    if when is None:
        return np.ones(frames.begins.size, dtype=bool)
    data = np.frombuffer(frames.buffer, dtype=np.uint8)
    fits = frames.lengths >= when.at + len(when.equals)
    for i, byte in enumerate(when.equals):
        fits[fits] = data[frames.begins[fits] + when.at + i] == byte
    return fits


def _from_places(framing: Framing, frame_type: FrameType, frames: FrameSet, chosen: Places) -> dict[str, FieldSeries]:
    series = {}
    for field in frame_type.fields:
        held = chosen[frames.lengths[chosen] - framing.trailer >= field.at + field.size]
        series[field.name] = FieldSeries(field, held, numbers_at(frames.buffer, frames.begins[held] + field.at, field))
    return series


def _from_elements(
    framing: Framing, frame_type: FrameType, elements: Elements, frames: FrameSet, chosen: Places
) -> dict[str, FieldSeries]:
    """Read fields out of elements; one too short for a field does not hold it, and of several the first counts."""
    found: dict[str, list[tuple[Places, int]]] = {field.name: [] for field in frame_type.fields}
    for numbers, places in _layouts(framing, frames, elements, chosen):
        for field in frame_type.fields:
            for identifier, at, size in places:
                if identifier == field.element and field.at + field.size <= size:
                    found[field.name].append((numbers, at + field.at))
                    break
    series = {}
    for field in frame_type.fields:
        none = np.zeros(0, dtype=np.int64)
        held = np.concatenate([none, *(numbers for numbers, _ in found[field.name])])
        begins = np.concatenate([none, *(frames.begins[numbers] + at for numbers, at in found[field.name])])
        order = np.argsort(held, kind="stable")
        series[field.name] = FieldSeries(field, held[order], numbers_at(frames.buffer, begins[order], field))
    return series


def _layouts(
    framing: Framing, frames: FrameSet, elements: Elements, chosen: Places
) -> Iterator[tuple[Places, list[tuple[int, int, int]]]]:
    """Group frames whose elements stand alike, each with identifier, first byte in the frame, and size of each.

    A device sends few different layouts; where there are many, each frame is one group.
    """
    data = np.frombuffer(frames.buffer, dtype=np.uint8)
    left = chosen
    for _ in range(_MOST_LAYOUTS):
        if not left.size:
            return
        first, length = int(frames.begins[left[0]]), int(frames.lengths[left[0]])
        end = length - framing.trailer
        places = elements.places(frames.buffer[first : first + length], elements.start, end)
        behind = places[-1][1] + places[-1][2] if places else elements.start
        heads = [range(at - elements.head, at) for _, at, _ in places]
        if behind + elements.head <= end:
            heads.append(range(behind, behind + elements.head))  # of one that does not fit, and might elsewhere
        alike = frames.lengths[left] == length
        for at in (at for head in heads for at in head):
            alike[alike] = data[frames.begins[left[alike]] + at] == data[first + at]
        yield left[alike], places
        left = left[~alike]
    for i in range(left.size):
        frame = frames.frame(int(left[i]))
        yield left[i : i + 1], elements.places(frame, elements.start, len(frame) - framing.trailer)


def _from_lines(framing: Framing, frame_type: FrameType, frames: FrameSet, chosen: Places) -> dict[str, FieldSeries]:
    separator = framing.separator.encode()
    rows = [frames.frame(i).split(separator) for i in chosen.tolist()]
    return {
        field.name: FieldSeries(field, chosen, np.array([cell_value(cells, field) for cells in rows], dtype=np.float64))
        for field in frame_type.fields
    }


def unwrap(counts: NDArray[Any], modulo: int) -> NDArray[Any]:
    """Undo the wrapping of a counter: a step of up to half the modulo is forward, more is backward.

    Parameters
    ----------
    counts : ndarray, shape (n,)
        Counts as stored.
    modulo
        Value at which it wraps; 0 if it never does.

    Returns
    -------
    ndarray, shape (n,)
        Counts from the first, which becomes 0.
    """
    if not counts.size:
        return counts
    if not modulo:
        return np.asarray(counts - counts[0])
    steps = np.mod(np.diff(counts), modulo)
    steps = np.where(steps > modulo // 2, steps - modulo, steps)
    return np.concatenate([np.zeros(1, dtype=counts.dtype), np.cumsum(steps)])


def gaps(counts: NDArray[np.int64], modulo: int, step: int = 1) -> tuple[int, int]:
    """Count the places where a packet counter misses frames, and the frames that are missing.

    Parameters
    ----------
    counts : ndarray of int64, shape (n,)
    step
        Number by which the counter grows from one frame to the next.

    Returns
    -------
    tuple of int
        Gaps and missing frames; repeated, backward and odd counts are gaps, and those of less than two steps
        have no missing frames.
    """
    steps = np.diff(unwrap(counts, modulo))
    return int((steps != step).sum()), int((steps[steps > step] // step - 1).sum())
