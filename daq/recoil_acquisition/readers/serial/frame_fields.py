"""Numbers that frames of an unknown layout seem to hold: a counter, the device's clock, values, and their byte order.

Only the manual says what they mean. What is found is where they stand, and of what type: a counter goes up by one from
frame to frame, a clock by nearly the same, bytes that are no floating-point number make values without a size, and
two bytes are a whole number in the order in which it goes from frame to frame by less.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.errors import FramingError
from recoil_acquisition.frames.checksum import CHECKSUMS
from recoil_acquisition.frames.declaration import framing_from_table
from recoil_acquisition.frames.scan import find_frames

FEWEST_ROWS = 32
"""Frames below which nothing is found in them."""
_COUNTS = 0.9
"""Share of the steps between frames that are one, of a counter; some frames may be lost."""
_EVEN = 0.05
"""Relative spread of a clock's steps about the usual one, of most of them."""
_SOUND = 0.98
"""Share of the values that must be numbers of a size that an instrument gives."""
_SIZES = (1e-7, 1e7)
_SMOOTHER = 4.0
"""Factor by which whole numbers go by less from frame to frame in the right order of their bytes."""
_CARRIES = 3
"""Changes of the upper part of a number, of more than two bytes, by which it is known."""
_HEAD_AND_SPACE = 16
"""Bytes in which a counter or a clock may stand: those at the beginning of the frame."""

COUNTER_FIELD, CLOCK_FIELD = "counter", "device_time"
"""Names that the field which counts frames, and that of the device's clock, get."""

CLOCK_MODULO = 1 << 32
"""Ticks with which that clock begins anew."""

Rows = NDArray[np.uint8]


@dataclass(frozen=True)
class FrameFields:
    """Fields that are found in frames.

    Attributes
    ----------
    framing
        Framing with its fields, as a rig file has it.
    counter
        Name of the field that counts frames; empty if none does.
    clock
        Name of the field of the device's clock; empty if none is found.
    tick_s
        Duration of a tick of that clock by the host's times; None without these.
    values, counts
        Names of the fields that hold floating-point values, and whole numbers whose scale the manual tells.
    """

    framing: Mapping[str, Any]
    counter: str
    clock: str
    tick_s: float | None
    values: tuple[str, ...]
    counts: tuple[str, ...] = ()

    @property
    def found(self) -> str:
        """Say what was found in each frame, and what was not, in a few words."""
        order = f"{self.framing['endian']} endian"
        kinds = [f"{len(self.values)} floating-point values"] if self.values else []
        for bits in (16, 24, 32):
            of_size = [name for name in self.counts if name.startswith(f"i{bits}_")]
            kinds += [f"{len(of_size)} whole numbers of {bits} bits, {order},"] if of_size else []
        counter = "a counter" if self.counter else "no counter"
        clock = "the device's clock" if self.clock else "no clock of the device"
        return f"{' and '.join(kinds)} in each frame, {counter}, {clock}"


def find_fields(framing: Mapping[str, Any], stream: bytes, duration_s: float | None = None) -> FrameFields | None:
    """Find numbers in the frames of a framing that lacks its fields.

    Parameters
    ----------
    framing
        Framing of frames of one fixed length, without ``fields``.
    stream
        Bytes of the port.
    duration_s
        Time that the host took to read them; None if that is not known.

    Returns
    -------
    FrameFields or None
        None where frames have no fixed length, or hold nothing that is found.
    """
    length = framing.get("length", {}).get("fixed") if framing.get("kind") == "sync" else None
    rows = None if length is None else _rows(framing, stream, length)
    if rows is None or len(rows) < FEWEST_ROWS:
        return None
    checksum = framing.get("checksum", {}).get("algo")
    stop = rows.shape[1] - (CHECKSUMS[checksum].size if checksum in CHECKSUMS else 0)
    start = len(bytes.fromhex(framing["sync"]))
    layouts = [_layout(rows, start, stop, order) for order in ("little", "big")]
    best = max(layouts, key=lambda one: (one.clock_step > 0, one.counter_bytes, one.bytes_of_values))
    if not best.bytes_of_values:
        return None
    table: dict[str, Any] = {**framing, "endian": best.order, "fields": best.fields}
    if best.counter_bytes:
        table["counter"] = {"field": COUNTER_FIELD, "modulo": 1 << (8 * best.counter_bytes)}
    tick_s = _tick_s(best.clock_step, duration_s, len(rows))
    if tick_s is not None:
        table["device_time"] = {"field": CLOCK_FIELD, "tick_s": tick_s, "modulo": CLOCK_MODULO}
    counter, clock = COUNTER_FIELD if best.counter_bytes else "", CLOCK_FIELD if best.clock_step else ""
    return FrameFields(table, counter, clock, tick_s, best.values, best.counts)


@dataclass(frozen=True)
class _Layout:
    """Fields of frames in one byte order; a counter and a clock of no size are none."""

    order: str
    fields: list[dict[str, Any]]
    counter_bytes: int
    clock_step: float
    values: tuple[str, ...]
    counts: tuple[str, ...]

    @property
    def bytes_of_values(self) -> int:
        """Number of bytes in which values were found."""
        return 4 * len(self.values) + sum(int(name[1:3]) // 8 for name in self.counts)


def _layout(rows: Rows, start: int, stop: int, order: str) -> _Layout:
    """Find the fields of frames, one behind the other."""
    fields: list[dict[str, Any]] = []
    values: list[str] = []
    counts: list[str] = []
    counter_bytes, clock_step, at = 0, 0.0, start
    while at < stop:
        head = at < _HEAD_AND_SPACE
        if head and not counter_bytes and (counter_bytes := _counting(rows, at, stop, order)):
            fields.append({"name": COUNTER_FIELD, "at": at, "type": f"u{8 * counter_bytes}"})
            at += counter_bytes
        elif head and not clock_step and at + 4 <= stop and (clock_step := _clock_step(rows, at, stop, order)):
            fields.append({"name": CLOCK_FIELD, "at": at, "type": "u32"})
            at += 4
        elif at + 4 <= stop and _is_value(rows, at, order):
            values.append(f"f32_at_{at}")
            fields.append({"name": values[-1], "at": at, "type": "f32"})
            at += 4
        elif size := _wide_count(rows, at, stop, order):
            counts.append(f"i{8 * size}_at_{at}")
            fields.append({"name": counts[-1], "at": at, "type": f"i{8 * size}"})
            at += size
        elif _is_count(rows, at, stop, order) and not (order == "big" and _is_count(rows, at + 1, stop, order)):
            counts.append(f"i16_at_{at}")
            fields.append({"name": counts[-1], "at": at, "type": "i16"})
            at += 2
        else:
            at += 1
    return _Layout(order, fields, counter_bytes, clock_step, tuple(values), tuple(counts))


def _rows(framing: Mapping[str, Any], stream: bytes, length: int) -> Rows | None:
    """Return the sound frames as rows of bytes, shape (n_frames, length)."""
    try:
        found = find_frames(framing_from_table({**framing, "fields": [{"name": "a", "at": 0, "type": "u8"}]}), stream)
    except FramingError:
        return None
    whole = found.begins[found.lengths == length]
    rows: Rows = np.frombuffer(found.buffer, dtype=np.uint8)[np.add.outer(whole, np.arange(length))]
    return rows


def _numbers(rows: Rows, at: int, size: int, order: str, kind: str = "u") -> NDArray[Any]:
    sign = "<" if order == "little" else ">"
    column = np.ascontiguousarray(rows[:, at : at + size])
    return column.view(f"{sign}{kind}{size}").ravel()


def _steps(rows: Rows, at: int, size: int, order: str) -> NDArray[np.int64]:
    """Return the steps of a number from frame to frame, which begins anew when it is full."""
    values: NDArray[np.int64] = _numbers(rows, at, size, order).astype(np.int64)
    return (values[1:] - values[:-1]) % np.int64(1 << (8 * size))


def _counting(rows: Rows, at: int, stop: int, order: str) -> int:
    """Return the bytes of a counter that stands there; 0 if none does."""
    for size in (4, 2, 1):
        if at + size <= stop:
            steps = _steps(rows, at, size, order)
            low = rows[1:, at if order == "little" else at + size - 1]
            carried = steps[low == 0]
            # a constant byte beside a counter of one byte is no part of it: nothing is carried over into it
            if np.mean(steps == 1) >= _COUNTS and (size == 1 or (carried.size and np.mean(carried == 1) >= 0.5)):
                return size
    return 0


def _clock_step(rows: Rows, at: int, stop: int, order: str) -> float:
    """Return the usual step of a clock that stands there, in its ticks; 0 if none does.

    Three of its bytes behind another one go up as evenly, or nearly: that place is none where the next is better.
    """
    usual, spread = _even_step(rows, at, order)
    if usual and at + 5 <= stop:
        _, next_spread = _even_step(rows, at + 1, order)
        return 0.0 if next_spread < 0.5 * spread else usual
    return usual


def _even_step(rows: Rows, at: int, order: str) -> tuple[float, float]:
    """Return the usual step of four bytes whose lowest one varies, and the steps' mean relative distance from it."""
    steps = _steps(rows, at, 4, order)
    usual = float(np.median(steps))
    low = rows[:, at if order == "little" else at + 3]
    if not 1 < usual < 1 << 31 or np.all(low == low[0]):
        return 0.0, np.inf
    # lost frames make steps that are longer, by however much
    off = np.minimum(np.abs(steps - usual) / usual, 1.0)
    return (usual, float(off.mean())) if np.mean(off <= _EVEN) >= _COUNTS else (0.0, np.inf)


def _is_value(rows: Rows, at: int, order: str) -> bool:
    """Return whether floating-point numbers of a size that an instrument gives stand there, and not always the same."""
    with np.errstate(invalid="ignore"):  # some of what is no number signals so
        values = _numbers(rows, at, 4, order, "f").astype(np.float64)
    sizes = np.abs(values[np.isfinite(values)])
    sound = np.count_nonzero((sizes == 0) | ((sizes > _SIZES[0]) & (sizes < _SIZES[1])))
    return bool(sound >= _SOUND * values.size and np.unique(values).size > max(FEWEST_ROWS // 4, values.size // 50))


def _wide_count(rows: Rows, at: int, stop: int, order: str) -> int:
    """Return the bytes, 4 or 3, of a whole number that stands there; 0 if none does.

    Its upper part changes where its lower two bytes begin anew, so that the number as a whole goes on by little. Of
    three bytes behind one that is always the same the four are such a number too, until it is below zero.
    """
    for size in (4, 3):
        if at + size > stop or not _carries(rows, at, size, order):
            continue
        inner = at + 1 if order == "big" else at
        if size == 4 and _carries(rows, inner, 3, order) and _rough(rows, inner, 3, order) < _rough(rows, at, 4, order):
            if order == "little":
                return 3
            continue
        return size
    return 0


def _carries(rows: Rows, at: int, size: int, order: str) -> bool:
    """Return whether the upper part of a number changes where its lower two bytes begin anew."""
    values = _wide(rows, at, size, order)
    upper, steps = values >> 16, np.abs(np.diff(values))
    changes = np.diff(upper) != 0
    return bool(np.count_nonzero(changes) >= _CARRIES and np.mean(steps[changes] < 1 << 14) >= _COUNTS)


def _rough(rows: Rows, at: int, size: int, order: str) -> float:
    return float(np.abs(np.diff(_wide(rows, at, size, order))).mean())


def _wide(rows: Rows, at: int, size: int, order: str) -> NDArray[np.int64]:
    """Return signed numbers of so many bytes."""
    part = rows[:, at : at + size]
    part = part if order == "big" else part[:, ::-1]
    whole = np.zeros(len(rows), dtype=np.int64)
    for k in range(size):
        whole = whole << 8 | part[:, k].astype(np.int64)
    return np.where(whole >= 1 << (8 * size - 1), whole - (1 << (8 * size)), whole)


def _is_count(rows: Rows, at: int, stop: int, order: str) -> bool:
    """Return whether a whole number of two bytes stands there: in the other order it would jump from frame to frame.

    A byte that is always the same before the number makes a smooth one with its upper byte as well.
    """
    if at + 2 > stop:
        return False
    other = "big" if order == "little" else "little"
    values, turned = (_numbers(rows, at, 2, one, "i").astype(np.int64) for one in (order, other))
    rough, rough_turned = (float(np.abs(np.diff(one)).mean()) for one in (values, turned))
    varies = np.unique(values).size > max(FEWEST_ROWS // 4, values.size // 50)
    return bool(varies and _SMOOTHER * rough < rough_turned)


def _tick_s(ticks: float, duration_s: float | None, count: int) -> float | None:
    """Return the decimal fraction of a second that is next to a tick by the host's times; None without them."""
    if not ticks or duration_s is None or not duration_s > 0:
        return None
    stated = duration_s / (ticks * (count - 1))
    power = round(float(np.log10(stated)))
    return float(f"1e{power}") if abs(stated / 10.0**power - 1.0) < 0.2 else None
