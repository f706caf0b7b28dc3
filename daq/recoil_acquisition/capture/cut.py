"""Out of the journal: the captures of one span of time, complete and verified, or not there."""

from __future__ import annotations

import hashlib
import os
import shutil
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO

from recoil_acquisition.capture.session_record import LiveRecord
from recoil_acquisition.devices.capture_bytes import capture_bytes, capture_header
from recoil_acquisition.devices.device import CAN, EVENT, Block, DeviceEvent, event_of
from recoil_acquisition.errors import StoreError
from recoil_acquisition.journal.folder import Journal
from recoil_acquisition.log.segment import sync_folder

SUFFIX = {CAN: ".rdcc", "serial": ".rdsc"}
"""Ending of a capture, by kind of source."""

BEHIND_NS = 250_000_000
"""An adapter or a driver may hold back what was sent for so long, so what arrives so long behind the span is cut with
it. What was read later is cut too if it may have arrived before."""


@dataclass
class Cut:
    """What one source has in a span.

    Attributes
    ----------
    file : Path or None
        Its capture; None if there is no data.
    blocks, bytes : int
        Of data.
    late_s : float
        How long, at most, something of it may have waited before it was read.
    events : list of (host_ns, DeviceEvent)
    """

    file: Path | None = None
    blocks: int = 0
    bytes: int = 0
    late_s: float = 0.0
    events: list[tuple[int, DeviceEvent]] = field(default_factory=list)


def write_captures(
    journal: Journal,
    session: LiveRecord,
    folder: Path,
    prefix: str,
    start_ns: int | None,
    stop_ns: int | None,
    also: Callable[[Path, Mapping[str, Cut]], None] = lambda _folder, _cuts: None,
) -> dict[str, Cut]:
    """Write the captures of all sources for a span of time.

    Everything is written into a folder under a temporary name, forced to the disk, read back and compared, and
    then the folder gets its name.

    Parameters
    ----------
    journal : Journal
        May still be written; what was appended before the call counts.
    session : LiveRecord
    folder : Path
        To be made.
    prefix : str
        Of the files' names, which end with the source's.
    start_ns, stop_ns : int or None
        Host time; None for no limit.
    also : callable
        Writes what else belongs into the folder, before it gets its name.

    Returns
    -------
    dict of str to Cut
        By source.

    Raises
    ------
    StoreError
        If the folder exists, cannot be written, or does not read back as it was written. Nothing is left then.
    """
    if folder.exists():
        raise StoreError("the captures of this shot exist already", path=folder, remedy="move them elsewhere")
    temporary = folder.with_name(f".{folder.name}.partial")
    try:
        shutil.rmtree(temporary, ignore_errors=True)
        temporary.mkdir(parents=True)
        cuts = _write(journal, session, temporary, prefix, start_ns, stop_ns)
        also(temporary, cuts)
        temporary.rename(folder)
        sync_folder(folder.parent)
    except OSError as error:
        raise StoreError(
            f"cannot be written: {error.strerror or error}", path=folder, remedy="make room; the journal still has it"
        ) from error
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
    for cut in cuts.values():
        cut.file = None if cut.file is None else folder / cut.file.name
    return cuts


def captures_hold(
    journal: Journal, session: LiveRecord, folder: Path, prefix: str, start_ns: int | None, stop_ns: int | None
) -> bool:
    """Tell whether captures that were written before hold all that a journal has of a span of time.

    Parameters are those of `write_captures`. What is there beyond it does not matter.
    """
    for number, source in enumerate(session.sources):
        path = folder / f"{prefix}_{source.name}{SUFFIX[source.kind]}"
        digest = hashlib.sha256(capture_header(source.kind, session.anchor))
        data = False
        for block in _blocks(journal, session, number, start_ns, stop_ns):
            data |= block.kind != EVENT
            digest.update(capture_bytes(source.kind, block, session.anchor) if data else b"")
        try:
            if data and digest.hexdigest() != _digest(path):
                return False
        except OSError:
            return False
    return True


def take_name(temporary: Path, folder: Path) -> None:
    """Give a folder that is complete its name; StoreError if that is taken, or the system refuses."""
    try:
        if folder.exists():
            raise StoreError("the captures of this shot exist already", path=folder, remedy="move them elsewhere")
        temporary.rename(folder)
        sync_folder(folder.parent)
    except OSError as error:
        raise StoreError(f"cannot be named: {error.strerror or error}", path=folder) from error


def _write(
    journal: Journal, session: LiveRecord, folder: Path, prefix: str, start_ns: int | None, stop_ns: int | None
) -> dict[str, Cut]:
    cuts = {source.name: Cut() for source in session.sources}
    streams: dict[str, IO[bytes]] = {}
    digests = {}
    try:
        for number, source in enumerate(session.sources):
            cut, before_ns = cuts[source.name], None
            for block in _blocks(journal, session, number, start_ns, stop_ns):
                if block.kind == EVENT:
                    cut.events.append((block.host_ns, event_of(block)))
                else:
                    cut.blocks += 1
                    cut.bytes += len(block.payload)
                    cut.late_s = max(cut.late_s, _late_s(block, before_ns))
                    before_ns = block.host_ns
                    if cut.file is None:
                        cut.file = folder / f"{prefix}_{source.name}{SUFFIX[source.kind]}"
                        streams[source.name] = cut.file.open("xb")
                        digests[source.name] = hashlib.sha256()
                        _put(streams, digests, source.name, capture_header(source.kind, session.anchor))
                if cut.file is not None:
                    _put(streams, digests, source.name, capture_bytes(source.kind, block, session.anchor))
        for stream in streams.values():
            stream.flush()
            os.fsync(stream.fileno())
    finally:
        for stream in streams.values():
            stream.close()
    for name, digest in digests.items():
        _verify(cuts[name].file, digest.hexdigest())
    return cuts


def _late_s(block: Block, before_ns: int | None) -> float:
    """Return how long what a block holds may have waited because nobody read, given when the block before was read.

    A source that is read all the time and never found empty is busy, not late.
    """
    if block.empty_ns is None or before_ns is None:
        return 0.0
    return (block.host_ns - max(block.empty_ns, before_ns)) / 1e9


def _blocks(
    journal: Journal, session: LiveRecord, source: int, start_ns: int | None, stop_ns: int | None
) -> Iterator[Block]:
    """Yield what a source has in a span of time, and just behind it."""
    until_ns = None if stop_ns is None else stop_ns + BEHIND_NS
    return (session.block(record) for record in journal.records(source, start_ns, until_ns))


def _put(streams: Mapping[str, IO[bytes]], digests: Mapping[str, hashlib._Hash], name: str, data: bytes) -> None:
    streams[name].write(data)
    digests[name].update(data)


def _verify(path: Path | None, digest: str) -> None:
    if path is None:
        return
    if _digest(path) != digest:
        raise StoreError("does not read back as it was written", path=path, remedy="check the disk")


def _digest(path: Path) -> str:
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
