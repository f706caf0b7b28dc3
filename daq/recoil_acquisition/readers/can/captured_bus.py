"""Captures of CAN buses as this project records them live, decoded by the bus's database.

A capture holds two stamps of every frame (`recoil_acquisition.frames.can_rows`). Samples are dated by the interface's
own clock where it gave one to every frame, counted from the first frame, with the steps of that clock
taken out as far as the host's stamps show them; else by the host's clock.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.clocks.clock_fit import ClockFit, fit_clock
from recoil_acquisition.clocks.host_clock import Anchor
from recoil_acquisition.clocks.timebase import AbsoluteStart
from recoil_acquisition.frames import can_rows
from recoil_acquisition.log.record import Kind
from recoil_acquisition.readers.can.buses import bus_number
from recoil_acquisition.readers.can.frames import FD_LENGTHS, CanFrames, CanLog, keys_of_rows, notes_on_entries
from recoil_acquisition.readers.can.recording import CanRecording, declared_database
from recoil_acquisition.readers.captured import CapturedEvent, CapturedSource
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.time.clock_notes import notes_of_clock
from recoil_acquisition.remark import Caution, CautionCode, Note, NoteCode, Remark

NAME = "recoil-daq capture"
_SHOWN = 200
_STAMPED_BY = {can_rows.DEVICE_TIME: "interface", can_rows.STAMPED: "hardware"}
"""Clock that stamped the frames, in a shot file's words."""


def open_bus(path: Path, source: CapturedSource, declared: Declarations) -> CanCaptureRecording:
    """Open the bus of a capture; raises `recoil_acquisition.errors.ReadError` if the database is missing or wrong."""
    return CanCaptureRecording(path, source, declared_database(declared, path), declared)


class CanCaptureRecording(CanRecording):
    """One opened bus of a capture.

    Attributes
    ----------
    device_ns, host_ns : ndarray of int64, shape (n_frames,)
        Stamps of every data frame by the interface and by the host, as recorded, ns.
    clock_fit
        Relation of the interface's clock to the host's; None if the interface gave no stamps of its own.
    """

    def __init__(self, path: Path, source: CapturedSource, database: Any, declared: Declarations) -> None:
        payloads = [record.payload for record in source.records if record.kind == Kind.CAN]
        # every record by itself: what is left of one that is no whole row must not shift the rows of the next
        rows = can_rows.parse_rows(b"".join(one[: len(one) - len(one) % can_rows.ROW_SIZE] for one in payloads))
        partial = sum(len(one) % can_rows.ROW_SIZE > 0 for one in payloads)
        flags = rows["flags"]
        unknown = flags & ~np.uint16(can_rows.KNOWN_FLAGS) != 0
        sound = (rows["length"] <= can_rows.LONGEST) & ~unknown
        sound &= (rows["length"] <= FD_LENGTHS[8]) | (flags & (can_rows.FD | can_rows.ERROR) != 0)
        frames = rows[sound & (flags & (can_rows.REMOTE | can_rows.ERROR) == 0)]
        self.device_ns: NDArray[np.int64] = frames["device_ns"].astype(np.int64)
        self.host_ns: NDArray[np.int64] = frames["host_ns"].astype(np.int64)
        notes: list[Remark] = [Note(NoteCode.CUT, None, source.incomplete)] if source.incomplete else []
        events = source.events
        error_frames = rows[sound & (flags & can_rows.ERROR != 0)]
        self.clock_fit = _fit(frames, events)
        times_s, start = _instants(self.device_ns, self.host_ns, self.clock_fit, source.anchor)
        metadata = {
            "data_frames": int(frames.size),
            "error_frames": int(error_frames.size),
            "remote_frames": int((sound & (flags & can_rows.REMOTE != 0)).sum()),
            "damaged_entries": int((~sound & ~unknown).sum()) + partial,
            "unknown_entries": int(unknown.sum()),
            "dated_by": "host" if self.clock_fit is None else _STAMPED_BY[int(frames["flags"][0]) & can_rows.STAMPED],
            "device_time_of_first_frame_ns": int(self.device_ns[0]) if frames.size else None,
            "host_time_of_first_frame_ns": int(self.host_ns[0]) if frames.size else None,
            "clock_fit": None if self.clock_fit is None else self.clock_fit.to_json(),
            "events": [asdict(event) for event in events[:_SHOWN]],
            "error_frame_times": [
                {"host_ns": int(one["host_ns"]), "class": int(one["id"])} for one in error_frames[:_SHOWN]
            ],
        }
        notes += _losses(metadata, self.clock_fit, events)
        log = CanLog(
            CanFrames(
                time_s=times_s,
                key=keys_of_rows(frames),
                channel=frames["channel"].astype(np.int64),
                length=frames["length"].astype(np.int64),
                data=np.ascontiguousarray(frames["data"]),
            ),
            start,
            tuple(notes),
            source.incomplete,
            metadata,
            not_known=f"flags of {metadata['unknown_entries']} entries are not known" if unknown.any() else "",
        )
        # a device of one channel is one bus, whatever other logs call it; of several a row has the number
        wanted = None if declared.captured_bus is None else bus_number(declared.captured_bus)
        super().__init__(path, NAME, log, database, replace(declared, bus=wanted))


def _fit(frames: NDArray[np.void], events: Sequence[CapturedEvent]) -> ClockFit | None:
    """Fit the interface's clock if one stamped every frame; it may have begun anew where the bus was opened anew."""
    if can_rows.clock_of(frames["flags"]) is None:
        return None
    reopened = [event.host_ns for event in events if event.name == "reopened"]
    host_ns = frames["host_ns"].astype(np.int64)
    breaks = np.searchsorted(host_ns, reopened).tolist() if (np.diff(host_ns) >= 0).all() else []
    return fit_clock(frames["device_ns"].astype(np.int64), host_ns, breaks=breaks)


def _instants(
    device_ns: NDArray[np.int64], host_ns: NDArray[np.int64], fit: ClockFit | None, anchor: Anchor | None
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
    if anchor is None:
        return times_s, None
    origin = "host's clock when the device was opened"
    return times_s, AbsoluteStart.since_1970(anchor.wall_of(zero_ns), "UTC", origin)


def _losses(metadata: dict[str, Any], fit: ClockFit | None, events: Sequence[CapturedEvent]) -> list[Remark]:
    """Say what a user must know before trusting the samples."""
    notes = notes_on_entries(metadata["error_frames"], metadata["damaged_entries"])
    if metadata["unknown_entries"]:
        notes.append(
            Caution(
                CautionCode.UNKNOWN_ENTRIES,
                None,
                f"{metadata['unknown_entries']} entries have flags that are not known: they were not read",
            )
        )
    lost = [event for event in events if event.name == "lost"]
    if lost:
        text = f"the bus was lost {len(lost)} times while it was recorded: frames are missing there"
        notes.append(Note(NoteCode.LOST, None, text))
    unreadable = [f"{event.name}: {event.detail}" for event in events if event.name == "unreadable"]
    if unreadable:
        text = f"the driver could not read some entries: {'; '.join(unreadable[:4])}"
        notes.append(Note(NoteCode.LEFT_OUT, None, text))
    if fit is None:
        text = "samples are dated by the host's clock: their instants are uncertain by its delay"
        return [*notes, Note(NoteCode.TIME, None, text)]
    return [*notes, *notes_of_clock(fit, "interface")]
