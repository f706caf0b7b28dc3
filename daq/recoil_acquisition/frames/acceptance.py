"""Acceptance of bytes that look like a frame."""

from __future__ import annotations

import math

from recoil_acquisition.frames.field import Field, FrameType
from recoil_acquisition.frames.framing import Framing
from recoil_acquisition.frames.number import number_at


class Acceptance:
    """Demands of a framing on a frame, besides its place in the stream.

    Attributes
    ----------
    selective
        Whether a frame can be of no known type.
    """

    def __init__(self, framing: Framing) -> None:
        self._framing = framing
        self._checksum = framing.checksum
        self._separator = framing.separator.encode()
        self.selective = all(frame_type.when is not None for frame_type in framing.types)
        self._checks_values = any(field.checked for frame_type in framing.types for field in frame_type.fields)
        self._asks_type = self._checks_values or (framing.only_known and self.selective)

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


def cell_value(cells: list[bytes], field: Field) -> float | None:
    """Return the finite number in a field's cell of a line, unscaled; None if there is none."""
    try:
        cell = cells[field.at]
        value = float(cell)
    except (ValueError, IndexError):
        return None
    # Python reads 1_0 as 10; no device writes that, and damage may
    return value if math.isfinite(value) and b"_" not in cell else None
