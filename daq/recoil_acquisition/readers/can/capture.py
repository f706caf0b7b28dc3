"""Captures of CAN buses as this project records them live, decoded by the bus's database.

The capture holds two stamps of every frame (`frames.can_capture_file`). Samples are dated by the interface's
own clock where it gave one to every frame, counted from the first frame, with the steps of that clock
taken out as far as the host's stamps show them; else by the host's clock.
"""

from __future__ import annotations

import datetime as dt
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.clock_fit import ClockFit, fit_clock
from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.frames import can_capture_file as capture
from recoil_acquisition.readers.can.frames import EXTENDED, ID_MASK, CanFrames, CanLog
from recoil_acquisition.readers.can.recording import CanRecording, declared_database
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.time.clock_notes import notes_of_clock
from recoil_acquisition.timebase import AbsoluteStart

CUT = "the file ends inside a record: it may have been cut"
_SHOWN = 200


class CanCaptureReader:
    """Reader of captures of CAN buses."""

    name = "CAN capture"

    def open(self, path: Path, declared: Declarations) -> CanCaptureRecording:
        """Open a capture; raises `ReadError` if it is damaged, or the database is missing or wrong."""
        database = declared_database(declared, path)
        try:
            content = capture.parse_capture(path.read_bytes())
        except OSError as error:
            raise ReadError(f"cannot be read: {error.strerror}", path=path) from error
        except ValueError as error:
            raise CorruptFileError(
                "no first line of a CAN capture",
                path=path,
                place="byte 0",
                expected=capture.MAGIC.decode().strip(),
            ) from error
        return CanCaptureRecording(path, content, database, declared)


class CanCaptureRecording(CanRecording):
    """One opened capture.

    Parameters
    ----------
    path : Path
    content : CanCapture
    database : cantools.database.can.Database
    declared : Declarations

    Attributes
    ----------
    device_ns, host_ns : ndarray of int64, shape (n_frames,)
        Both stamps of every data frame, as recorded.
    clock_fit : ClockFit or None
        How they relate; None if the interface gave no stamps of its own.
    """

    def __init__(self, path: Path, content: capture.CanCapture, database: Any, declared: Declarations) -> None:
        records = content.records
        flags = records["flags"]
        sound = (records["length"] <= capture.LONGEST) & (flags & ~np.uint16(capture.KNOWN_FLAGS) == 0)
        special = capture.REMOTE | capture.ERROR | capture.EVENT | capture.ANCHOR
        frames = records[sound & (flags & special == 0)]
        self.device_ns: NDArray[np.int64] = frames["device_ns"].astype(np.int64)
        self.host_ns: NDArray[np.int64] = frames["host_ns"].astype(np.int64)
        notes: list[str] = [CUT] if content.cut else []
        events = records[sound & (flags & capture.EVENT != 0)]
        anchors = records[sound & (flags & capture.ANCHOR != 0)]
        error_frames = records[sound & (flags & capture.ERROR != 0)]
        self.clock_fit = _fit(frames, events)
        times_s, start = _instants(self.device_ns, self.host_ns, self.clock_fit, anchors)
        metadata = {
            "data_frames": int(frames.size),
            "error_frames": int(error_frames.size),
            "remote_frames": int((sound & (flags & capture.REMOTE != 0)).sum()),
            "damaged_entries": int((~sound).sum()),
            "dated_by": "host" if self.clock_fit is None else "interface",
            "device_time_of_first_frame_ns": int(self.device_ns[0]) if frames.size else None,
            "host_time_of_first_frame_ns": int(self.host_ns[0]) if frames.size else None,
            "clock_fit": None if self.clock_fit is None else self.clock_fit.to_json(),
            "events": [{"host_ns": int(event["host_ns"]), "text": capture.text_of(event)} for event in events[:_SHOWN]],
            "error_frame_times": [
                {"host_ns": int(one["host_ns"]), "class": int(one["id"])} for one in error_frames[:_SHOWN]
            ],
        }
        notes += _losses(metadata, self.clock_fit, events)
        key = frames["id"] & np.uint32(ID_MASK) | np.where(frames["flags"] & capture.EXTENDED, EXTENDED, 0)
        log = CanLog(
            CanFrames(
                time_s=times_s,
                key=key.astype(np.uint32),
                channel=frames["channel"].astype(np.int64),
                length=frames["length"].astype(np.int64),
                data=np.ascontiguousarray(frames["data"]),
            ),
            start,
            tuple(notes),
            CUT if content.cut else "",
            metadata,
        )
        super().__init__(path, CanCaptureReader.name, log, database, declared)


def _fit(frames: NDArray[np.void], events: NDArray[np.void]) -> ClockFit | None:
    """Fit the interface's clock if it stamped every frame; it may have begun anew where the bus was opened anew."""
    if not frames.size or not (frames["flags"] & capture.DEVICE_TIME != 0).all():
        return None
    reopened = [event["host_ns"] for event in events if capture.text_of(event).startswith("reopened")]
    host_ns = frames["host_ns"].astype(np.int64)
    breaks = np.searchsorted(host_ns, reopened).tolist() if (np.diff(host_ns) >= 0).all() else []
    return fit_clock(frames["device_ns"].astype(np.int64), host_ns, breaks=breaks)


def _instants(
    device_ns: NDArray[np.int64], host_ns: NDArray[np.int64], fit: ClockFit | None, anchors: NDArray[np.void]
) -> tuple[NDArray[np.float64], AbsoluteStart | None]:
    """Return the frames' instants in s from the first, and the wall clock's time of the first."""
    if not host_ns.size:
        return np.zeros(0), None
    if fit is None:
        times_s = (host_ns - host_ns[0]) / 1e9
        zero_ns = int(host_ns[0])
    else:
        corrected = fit.device_instants_ns(device_ns, host_ns)
        times_s = (corrected - corrected[0]) / 1e9
        zero_ns = int(host_ns[0]) + round(fit.offset_s * 1e9)
    if not anchors.size:
        return times_s, None
    wall_ns = zero_ns - int(anchors[0]["host_ns"]) + int(anchors[0]["device_ns"])
    try:
        instant = dt.datetime(1970, 1, 1) + dt.timedelta(microseconds=wall_ns // 1000)
    except OverflowError:
        return times_s, None
    return times_s, AbsoluteStart(
        instant.isoformat(timespec="microseconds"), "UTC", "host's clock when the device was opened"
    )


def _losses(metadata: dict[str, Any], fit: ClockFit | None, events: NDArray[np.void]) -> list[str]:
    """Say what a user must know before trusting the samples."""
    notes = []
    if metadata["error_frames"]:
        notes.append(f"{metadata['error_frames']} error frames: frames may be missing around them")
    if metadata["damaged_entries"]:
        notes.append(f"{metadata['damaged_entries']} entries are damaged and were left out")
    lost = [text for text in map(capture.text_of, events) if text.startswith("lost")]
    if lost:
        notes.append(f"the bus was lost {len(lost)} times while it was recorded: frames are missing there")
    unreadable = [text for text in map(capture.text_of, events) if text.startswith("unreadable")]
    if unreadable:
        notes.append(f"the driver could not read some entries: {'; '.join(unreadable[:4])}")
    if fit is None:
        notes.append("samples are dated by the host's clock: their instants are uncertain by its delay")
        return notes
    return notes + notes_of_clock(fit, "interface")
