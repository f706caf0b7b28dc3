"""Acceptance of bytes that look like a frame: one at a time, and as rows of equal length."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.frames.field import Field, FrameType
from recoil_acquisition.frames.framing import Framing
from recoil_acquisition.frames.number import number_at, numbers_of

Rows = NDArray[np.uint8]
Mask = NDArray[np.bool_]
Places = NDArray[np.int64]

FEWEST_ROWS = 12
"""Number of frames below which they are judged one by one: arrays gain nothing on them."""


class Acceptance:
    """Demands of a framing on a frame, besides its place in the stream.

    Attributes
    ----------
    selective
        Whether a frame can be of no known type.
    by_rows
        Whether `good_rows` can judge: not where values inside of elements are checked.
    """

    def __init__(self, framing: Framing) -> None:
        self._framing = framing
        self._checksum = framing.checksum
        self._separator = framing.separator.encode()
        self.selective = all(frame_type.when is not None for frame_type in framing.types)
        checked = [t for t in framing.types if any(field.checked for field in t.fields)]
        self._checks_values = bool(checked)
        self._asks_type = bool(checked) or (framing.only_known and self.selective)
        self.by_rows = all(frame_type.elements is None for frame_type in checked)

    def fault_of(self, frame: bytes) -> str | None:
        """Return the counter of what is wrong with a binary frame; None for a good one."""
        if self._checksum is not None and not self._checksum.holds(frame):
            return "bad_checksum"
        if not self._asks_type:
            return None
        frame_type = self._framing.type_of(frame)
        if frame_type is None:
            return "unknown_types" if self._framing.only_known else None
        if self._checks_values and not self._plausible(frame, frame_type):
            return "implausible"
        return None

    def _plausible(self, frame: bytes, frame_type: FrameType) -> bool:
        end = len(frame) - self._framing.trailer
        if frame_type.elements is None:
            return all(
                field.accepts(number_at(frame, field.at, field))
                for field in frame_type.fields
                if field.checked and field.at + field.size <= end
            )
        places = frame_type.elements.places(frame, frame_type.elements.start, end)
        for field in (field for field in frame_type.fields if field.checked):
            for identifier, begin, size in places:
                if identifier == field.element and field.at + field.size <= size:
                    if not field.accepts(number_at(frame, begin + field.at, field)):
                        return False
                    break
        return True

    def line(self, body: bytes) -> tuple[bytes, str | None]:
        """Return a line without its checksum, and the counter of what is wrong with it; None for a good one."""
        if self._checksum is not None:
            if not self._checksum.holds(body):
                return body, "bad_checksum"
            body = body[: -self._checksum.size]
        frame_type = self._framing.type_of(body)
        if frame_type is None:
            return body, "unknown_types" if self._framing.only_known else None
        cells = body.split(self._separator)
        try:
            values = [float(cells[field.at]) for field in frame_type.fields]
        except (ValueError, IndexError):
            return body, "bad_length"
        if not all(map(math.isfinite, values)) or (
            b"_" in body and any(b"_" in cells[field.at] for field in frame_type.fields)
        ):
            return body, "bad_length"
        for field, value in zip(frame_type.fields, values, strict=True) if self._checks_values else ():
            if not field.accepts(value):
                return body, "implausible"
        return body, None

    def good_rows(self, rows: Rows) -> tuple[Mask, Mask]:
        """Return which frames of equal length are good, and which are of a known type.

        Parameters
        ----------
        rows : ndarray of uint8, shape (n_frames, n_bytes)

        Returns
        -------
        good, known : ndarray of bool, shape (n_frames,)
        """
        good = np.ones(len(rows), dtype=bool) if self._checksum is None else self._right_checksums(rows)
        if not self.selective and not self._checks_values:
            return good, np.ones(len(rows), dtype=bool)
        left = np.ones(len(rows), dtype=bool)
        for frame_type in self._framing.types:
            fits = left & of_type(rows, frame_type)
            left &= ~fits
            for field in frame_type.fields:
                behind = field.at + field.size
                if field.checked and behind <= rows.shape[1] - self._framing.trailer:
                    good &= ~fits | _accepted(rows[:, field.at : behind], field)
        if self._framing.only_known:
            good &= ~left
        return good, ~left

    def good_frames(self, data: bytes, lengths: Places) -> tuple[Mask, Mask]:
        """Return which frames of any lengths are good, and which of these are of a known type.

        Parameters
        ----------
        data
            The frames one after the other.
        lengths : ndarray of int64, shape (n_frames,)

        Returns
        -------
        good, known : ndarray of bool, shape (n_frames,)
        """
        count = len(lengths)
        if count >= FEWEST_ROWS and (lengths == lengths[0]).all():
            return self.good_rows(np.frombuffer(data, dtype=np.uint8).reshape(count, int(lengths[0])))
        good, known = np.ones(count, dtype=bool), np.ones(count, dtype=bool)
        begins = np.cumsum(lengths) - lengths
        for length in set(lengths.tolist()):
            alike = np.flatnonzero(lengths == length)
            if alike.size >= FEWEST_ROWS:
                # overlapping rows, one from each byte on: taking some of them copies whole frames
                rows = np.ndarray((len(data) - length + 1, length), dtype=np.uint8, buffer=data, strides=(1, 1))
                good[alike], known[alike] = self.good_rows(rows[begins[alike]])
                continue
            for i, begin in zip(alike.tolist(), begins[alike].tolist(), strict=True):
                frame = data[begin : begin + length]
                good[i] = self.fault_of(frame) is None
                known[i] = not self.selective or self._framing.type_of(frame) is not None
        return good, known

    def _right_checksums(self, rows: Rows) -> Mask:
        checksum = self._checksum
        covered = rows.shape[1] - self._framing.trailer
        if checksum is None or covered < checksum.start:
            return np.zeros(len(rows), dtype=bool)
        if checksum.hexadecimal or checksum.mark:
            return np.array([checksum.holds(row.tobytes()) for row in rows], dtype=bool)
        shifts = np.arange(0, 8 * checksum.size, 8)
        stated = rows[:, covered:] @ (1 << (shifts[::-1] if checksum.big_endian else shifts))
        return np.asarray(checksum.algorithm.of_rows(rows[:, checksum.start : covered]) == stated)


def of_type(rows: Rows, frame_type: FrameType) -> Mask:
    """Return which rows a frame type's selector fits, shape (n_frames, n_bytes) -> (n_frames,)."""
    when = frame_type.when
    if when is None:
        return np.ones(len(rows), dtype=bool)
    if when.at + len(when.equals) > rows.shape[1]:
        return np.zeros(len(rows), dtype=bool)
    wanted = np.frombuffer(when.equals, dtype=np.uint8)
    return np.asarray((rows[:, when.at : when.at + len(when.equals)] == wanted).all(axis=1))


def _accepted(rows: Rows, field: Field) -> Mask:
    raw = numbers_of(rows, field)
    fits = np.ones(len(rows), dtype=bool)
    if field.type == "u64" and field.bits is None:
        fits &= raw >= 0
    if field.plausible is not None:
        with np.errstate(over="ignore", invalid="ignore"):
            values = raw.astype(np.float64) * field.scale + field.offset
        fits &= (values >= field.plausible[0]) & (values <= field.plausible[1])
    return fits


def cell_value(cells: list[bytes], field: Field) -> float | None:
    """Return the finite number in a field's cell of a line, unscaled; None if there is none."""
    try:
        cell = cells[field.at]
        value = float(cell)
    except (ValueError, IndexError):
        return None
    # Python reads 1_0 as 10; no device writes that, and damage may
    return value if math.isfinite(value) and b"_" not in cell else None
