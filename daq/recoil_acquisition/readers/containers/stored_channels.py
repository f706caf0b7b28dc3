"""A recording of the channels of a container format, which must hold at least one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from recoil_acquisition.errors import ReadError
from recoil_acquisition.readers.recording import Recording, StoredChannel
from recoil_acquisition.timebase import AbsoluteStart


def container_recording(
    path: Path,
    reader: str,
    channels: Sequence[StoredChannel],
    metadata: Mapping[str, Any],
    notes: Sequence[str],
    incomplete: str = "",
    absolute_start: AbsoluteStart | None = None,
) -> Recording:
    """Return the recording of a container's channels; the parameters are those of `Recording`.

    Raises
    ------
    ReadError
        If there is no channel: nothing in the file can be used, and `notes` say why.
    """
    if not channels:
        found = "; ".join(list(notes)[:6]) or "nothing"
        raise ReadError("no time history in this file", path=path, found=found)
    return Recording(
        path, reader, channels, metadata=metadata, notes=notes, incomplete=incomplete, absolute_start=absolute_start
    )
