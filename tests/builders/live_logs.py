"""Logs of live sessions, and what is in captures of them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.capture.cut import ACQUISITION
from recoil_acquisition.capture.session_record import KINDS, LiveRecord
from recoil_acquisition.devices.device import Block
from recoil_acquisition.frames import can_rows
from recoil_acquisition.log.capture import read_capture
from recoil_acquisition.log.record import OWN, UNNUMBERED, Kind, Record, pack_json, pack_record
from recoil_acquisition.log.writer import LogWriter
from recoil_acquisition.readers.captured import CapturedSource, sources_of


def append(writer: LogWriter, record: LiveRecord, blocks: Iterable[Block]) -> None:
    """Append blocks as the acquisition does."""
    for block in blocks:
        number, kind = record.number(block.source), KINDS[block.kind]
        writer.append(number, kind, block.host_ns, block.payload, empty_ns=block.empty_ns)


def source_in(path: Path, name: str) -> CapturedSource:
    """Return what a capture holds of a source."""
    return next(source for source in sources_of(read_capture(path)) if source.name == name)


def stream_in(path: Path, name: str) -> bytes:
    """Return all bytes of a port in a capture."""
    return b"".join(r.payload for r in source_in(path, name).records if r.kind == Kind.SERIAL)


def rows_in(path: Path, name: str) -> NDArray[np.void]:
    """Return all rows of a bus in a capture."""
    payload = b"".join(r.payload for r in source_in(path, name).records if r.kind == Kind.CAN)
    return can_rows.parse_rows(payload)


def declared(content: bytes, acquisition: Mapping[str, Any]) -> bytes:
    """Return a capture with the declaration of a shot's acquisition at its end."""
    payload = pack_json({ACQUISITION: acquisition})
    return content + pack_record(content[4:12], Record(UNNUMBERED, OWN, Kind.SHOT, 0, payload, None, None, 0, 0))
