"""A part of a long recording: what it says of itself, and the samples of one span of time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.channel import RawCounts
from recoil_acquisition.readers.recording import Recording, SignalHeader, StoredChannel
from recoil_acquisition.remark import Note, NoteCode


def excerpt(recording: Recording, start_s: float, stop_s: float, why: str) -> Recording:
    """Return the samples of a recording from one instant to before another; its time zero stays the recording's.

    Nothing outside the span is read, but for stamps where a time base is not uniform.

    Parameters
    ----------
    recording
        Recording without tracks: a camera's recording is one shot's.
    start_s, stop_s
        Begin and end of the span on the source's clock, s.
    why
        Note on the excerpt.
    """
    return span_of(recording, start_s, stop_s, why, {"excerpt": {"start_s": start_s, "stop_s": stop_s}})


def span_of(
    recording: Recording, start_s: float, stop_s: float, why: str, metadata: Mapping[str, Any] = MappingProxyType({})
) -> Recording:
    """Return the samples of a recording as `excerpt` does, of a file that is one shot's all the same."""
    return Recording(
        recording.path,
        recording.reader,
        [_part(recording, header, start_s, stop_s) for header in recording.signals],
        metadata={**recording.metadata, **metadata},
        notes=lambda: (*recording.notes, Note(NoteCode.EXCERPT, None, why)),
        incomplete=recording.incomplete,
        absolute_start=lambda: recording.absolute_start,
        check_name=recording.check_name,
        aliases=recording.aliases,
    )


def _part(recording: Recording, header: SignalHeader, start_s: float, stop_s: float) -> StoredChannel:
    whole = recording.time_base(header.name)
    first, last = whole.span(start_s, stop_s)

    def samples(start: int, stop: int) -> NDArray[np.float64]:
        return recording.read(header.name, first + start, first + stop)

    def raw(start: int, stop: int) -> RawCounts | None:
        return recording.raw(header.name, first + start, first + stop)

    return StoredChannel(
        replace(header, sample_count=last - first),
        whole.part(first, last),
        samples,
        raw,
        lambda: recording.overloads(header.name),
    )
