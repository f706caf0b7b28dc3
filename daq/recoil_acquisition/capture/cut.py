"""Out of the log: one shot's capture, complete and verified, or not there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from recoil_acquisition.capture.engine import SETTLE_S
from recoil_acquisition.capture.session_record import LiveRecord
from recoil_acquisition.devices.described import DESCRIBED
from recoil_acquisition.devices.device import EVENT, LATE_S, DeviceEvent, event_of
from recoil_acquisition.errors import CorruptFileError, StoreError, system_errors_as
from recoil_acquisition.log.capture import capture_holds, capture_scan, write_capture
from recoil_acquisition.log.folder import Log
from recoil_acquisition.log.record import OWN, UNNUMBERED, Kind
from recoil_acquisition.shot.acquisition import AcquiredEvent, Acquisition

SCHEMA = "recoil-daq/capture/1"

ACQUISITION = "acquisition"
"""Key of the declaration of a capture under which it says how its shot was acquired."""

BEHIND_NS = round(SETTLE_S * 1e9)
"""Time behind the span in which what arrives is cut with it. What was read later is cut too if it may have arrived
before."""


@dataclass
class Cut:
    """One source's data and events in a span.

    Attributes
    ----------
    blocks, bytes
        Numbers of blocks and of bytes of data.
    late_s
        Longest time that data of the source may have waited before it was read.
    """

    blocks: int = 0
    bytes: int = 0
    late_s: float = 0.0
    events: list[tuple[int, DeviceEvent]] = field(default_factory=list)


def cuts_of(log: Log, session: LiveRecord, start_ns: int | None, stop_ns: int | None) -> dict[str, Cut]:
    """Return what each source has in a span of host time, and just behind it; None for no limit."""
    cuts = {source.name: Cut() for source in session.sources}
    read_ns: dict[str, int] = {}
    for record in log.records(start_ns=start_ns, stop_ns=_behind(stop_ns)):
        if record.source == OWN:
            continue
        block = session.block(record)
        cut, before_ns = cuts[block.source], read_ns.get(block.source)
        if block.kind == EVENT:
            if (event := event_of(block)).name != DESCRIBED:  # what is said again and again is nothing that happened
                cut.events.append((block.host_ns, event))
            continue
        read_ns[block.source] = block.host_ns
        if not block.is_data:
            continue
        cut.blocks += 1
        cut.bytes += len(block.payload)
        cut.late_s = max(cut.late_s, block.late_s(before_ns))
    return cuts


def write_shot(
    log: Log, session: LiveRecord, path: Path, acquisition: Acquisition, start_ns: int, stop_ns: int
) -> Acquisition:
    """Write the capture of a shot, with what each source has in it.

    Parameters
    ----------
    log
        Log, which may still be written; what was appended before the call counts.
    path
        File to be made, with its folder.
    acquisition
        Record of the acquisition without what the log has of its sources.
    start_ns, stop_ns
        Host time.

    Returns
    -------
    Acquisition
        Record with what the log has, as it stands in the capture.

    Raises
    ------
    StoreError
        If the file exists, cannot be written, or does not read back as it was written. Nothing is left then.
    """
    whole = with_cuts(acquisition, cuts_of(log, session, start_ns, stop_ns), path.name)
    _make_folder(path.parent)
    write_capture(log, path, start_ns, _behind(stop_ns), {"schema": SCHEMA, ACQUISITION: whole.to_json()})
    return whole


def write_everything(log: Log, path: Path, declaration: Mapping[str, Any]) -> None:
    """Write a capture of all that a log holds; raises StoreError as `write_shot`."""
    _make_folder(path.parent)
    write_capture(log, path, None, None, {"schema": SCHEMA, **declaration})


def capture_has(log: Log, path: Path, start_ns: int | None, stop_ns: int | None) -> bool:
    """Return whether a capture that was written before holds all that a log has of a span of time, byte for byte."""
    return capture_holds(log, path, start_ns, _behind(stop_ns))


def acquisition_in(path: Path) -> Acquisition | None:
    """Return how the shot of a capture was acquired; None if it does not say so, or is no capture."""
    try:
        with capture_scan(path) as scan:
            for record in scan:
                if record.number == UNNUMBERED and record.kind == Kind.SHOT:
                    return acquisition_of_declaration(record.said)
    except (StoreError, CorruptFileError, ValueError):
        return None
    return None


def acquisition_of_declaration(declaration: Mapping[str, Any]) -> Acquisition | None:
    """Return how the shot of a declaration was acquired; None if it says nothing of it, ValueError if it is damaged."""
    document = declaration.get(ACQUISITION)
    return Acquisition.from_json(document) if isinstance(document, dict) else None


def with_cuts(acquisition: Acquisition, cuts: Mapping[str, Cut], file: str) -> Acquisition:
    """Return an acquisition with what each source has in the capture of a name."""
    sources = []
    for source in acquisition.sources:
        cut = cuts[source.name]
        sources.append(
            replace(
                source,
                file=file if cut.blocks else "",
                blocks=cut.blocks,
                bytes=cut.bytes,
                pre_s=source.pre_s if cut.blocks else None,
                late=source.late or cut.late_s > LATE_S,
                late_s=cut.late_s,
                events=tuple(
                    AcquiredEvent((host_ns - acquisition.trigger_ns) / 1e9, event.name, event.detail)
                    for host_ns, event in cut.events
                ),
            )
        )
    return replace(acquisition, sources=tuple(sources))


def _behind(stop_ns: int | None) -> int | None:
    return None if stop_ns is None else stop_ns + BEHIND_NS


def _make_folder(folder: Path) -> None:
    with system_errors_as(StoreError, folder, "written"):
        folder.mkdir(parents=True, exist_ok=True)
