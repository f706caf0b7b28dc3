"""The vendors' files of the virtual rig, as bytes: recorder text, camera tracks, CAN logs, serial captures.

Layouts: the Dewesoft X text export as found in public files of its users (one header row, the unit in
the last parentheses of a name, CRLF); a table of tracks as ProAnalyst's users describe it (frame number,
time, X and Y per feature, ``-1`` for a lost marker); BLF and ASC as python-can writes them; the serial
capture as `recoil_acquisition.log.record` defines it.
"""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.log.record import OWN, SCHEMA, Kind, Record, pack_json, pack_record
from recoil_acquisition.numerics.arrays import Array, Flags

CAN_EPOCH_S = 1_772_438_400.0
"""Wall-clock time that a virtual CAN log gives for its zero: 2026-03-02 08:00 UTC, a whole second. A virtual rig must
not write the time of day, or the same seed would not give the same bytes."""

_CAN_DATE = "Mon Mar 02 08:00:00.000 2026"


def dewesoft_text(times_s: Array, columns: Mapping[str, Array], style: Literal["comma", "semicolon"]) -> bytes:
    """Return a Dewesoft X text export with relative time.

    Parameters
    ----------
    times_s : ndarray, shape (n,)
    columns : mapping of str to ndarray, shape (n,)
        Columns by name and unit as in the header, ``AI 1/acc_recoil (m/s2)``.
    style : {"comma", "semicolon"}
        Comma and decimal point, or semicolon, decimal comma and byte order mark.
    """
    separator = "," if style == "comma" else ";"
    row = separator.join(["%.6f"] + ["%.9g"] * len(columns)) + "\r\n"
    table = np.column_stack([times_s, *columns.values()])
    body = row * len(table) % tuple(table.ravel().tolist())
    header = separator.join(["Time (s)", *columns]) + "\r\n"
    if style == "semicolon":
        return (header + body.replace(".", ",")).encode("utf-8-sig")
    return (header + body).encode("utf-8")


def track_text(
    frames: NDArray[np.int64], frame_rate_hz: float, positions: Mapping[str, Array], lost: Flags, unit: str
) -> bytes:
    """Return a table of tracks.

    Parameters
    ----------
    frames : ndarray of int, shape (n,)
        Numbers of the frames in the file.
    positions : mapping of str to ndarray, shape (n, 2)
        X and Y of each feature, by its name.
    lost : ndarray of bool, shape (n,)
        Frames in which the markers were not found.
    """
    header = ["Frame", "Time (s)"] + [f"{name} - {axis} ({unit})" for name in positions for axis in "XY"]
    lines = [",".join(header)]
    values = np.column_stack(list(positions.values()))
    for frame, row, gone in zip(frames.tolist(), values.tolist(), lost.tolist(), strict=True):
        cells = ["-1"] * len(row) if gone else [f"{value:.4f}" for value in row]
        lines.append(",".join([str(frame), f"{frame / frame_rate_hz:.6f}", *cells]))
    return ("\r\n".join(lines) + "\r\n").encode("utf-8")


@dataclass(frozen=True)
class CanFrame:
    """One frame on the bus: its stamp on the log's clock, its identifier, its payload; an error frame has none.

    ``bus`` is the number that the log has for it.
    """

    stamp_s: float
    identifier: int
    extended: bool
    data: bytes | None
    bus: int = 1


class _KeptBytes(io.BytesIO):
    """A file in memory whose content outlives its closing, which python-can's writers insist on."""

    kept = b""

    def close(self) -> None:
        if not self.closed:
            self.kept = self.getvalue()
        super().close()


class _KeptText(io.StringIO):
    """The same for a file of text."""

    kept = ""

    def close(self) -> None:
        if not self.closed:
            self.kept = self.getvalue()
        super().close()


def can_log(frames: Sequence[CanFrame], style: Literal["blf", "asc"]) -> bytes:
    """Return a CAN log with its frames in the order of their stamps; the first stamp must be 0.

    Raises
    ------
    ValueError
        If the first stamp is not 0: the formats count from the first frame.
    """
    import can

    ordered = sorted(frames, key=lambda frame: frame.stamp_s)
    if not ordered or ordered[0].stamp_s != 0.0:
        raise ValueError("the first frame of a log must have stamp 0")
    kept = _KeptBytes() if style == "blf" else _KeptText()
    writer = can.BLFWriter(kept) if isinstance(kept, _KeptBytes) else can.ASCWriter(kept)
    for frame in ordered:
        writer.on_message_received(
            can.Message(
                timestamp=CAN_EPOCH_S + frame.stamp_s,
                arbitration_id=frame.identifier,
                is_extended_id=frame.extended,
                is_error_frame=frame.data is None,
                data=frame.data,
                channel=frame.bus - 1,  # python-can counts from 0, and its writers from 1
            )
        )
    writer.stop()
    if isinstance(kept, _KeptBytes):
        return kept.kept
    # the writer stamps its header with the time of day, in the machine's zone and language
    lines = kept.kept.splitlines()
    for i, line in enumerate(lines[:6]):
        for start in ("date ", "Begin Triggerblock "):
            if line.startswith(start):
                lines[i] = start + _CAN_DATE
    return ("\n".join(lines) + "\n").encode("ascii")


def serial_capture(name: str, records: Sequence[tuple[int, bytes]]) -> bytes:
    """Return a serial capture: records of a log, of its session and of what each read of the port returned.

    Parameters
    ----------
    name
        Name of the source.
    records
        Host time in ns and bytes, in order.
    """
    log_id = hashlib.sha256(name.encode()).digest()[:8]
    session = json.dumps({"sources": [{"name": name, "kind": "serial"}]})
    part = {"schema": SCHEMA, "longest_us": None, "part": 0, "of": 1, "text": session}
    packed, position = [pack_record(log_id, Record(0, OWN, Kind.SESSION, 0, pack_json(part), None, None, 0, 0))], 0
    for i, (host_ns, data) in enumerate(records):
        packed.append(pack_record(log_id, Record(i + 1, 0, Kind.SERIAL, host_ns, data, None, None, i, position)))
        position += len(data)
    return b"".join(packed)
