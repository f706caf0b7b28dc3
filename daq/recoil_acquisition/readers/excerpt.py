"""A part of a long recording: what it says of itself, and the samples of one span of time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.channel import RawCounts
from recoil_acquisition.readers.reader import Recording, SignalHeader
from recoil_acquisition.timebase import AbsoluteStart, TimeBase
from recoil_acquisition.track import Track


class Excerpt:
    """The samples of a recording from one instant to before another; its time zero stays the recording's.

    Nothing outside the span is read, but for stamps where a time base is not uniform.

    Parameters
    ----------
    recording : Recording
        Without tracks: a film is one shot's.
    start_s, stop_s : float
        On the source's clock.
    why : str
        What is told of it in the notes.
    """

    def __init__(self, recording: Recording, start_s: float, stop_s: float, why: str) -> None:
        self._whole, self._start_s, self._stop_s, self._why = recording, start_s, stop_s, why

    @property
    def path(self) -> Path:
        """The file."""
        return self._whole.path

    @property
    def reader(self) -> str:
        """Name of the reader that opened it."""
        return self._whole.reader

    @cached_property
    def signals(self) -> tuple[SignalHeader, ...]:
        """The recording's signals, with as many samples as lie in the span."""
        return tuple(replace(header, sample_count=self.time_base(header.name).count) for header in self._whole.signals)

    @property
    def metadata(self) -> Mapping[str, Any]:
        """What the file says about itself, and the span."""
        return {**self._whole.metadata, "excerpt": {"start_s": self._start_s, "stop_s": self._stop_s}}

    @property
    def notes(self) -> tuple[str, ...]:
        """What the recording has to say, of all of it, and what part this is."""
        return (*self._whole.notes, self._why)

    @property
    def incomplete(self) -> str:
        """How it shows that the file was cut off; empty if nothing shows that."""
        return self._whole.incomplete

    @property
    def absolute_start(self) -> AbsoluteStart | None:
        """Wall-clock time of the recording's time zero, which the excerpt keeps."""
        return self._whole.absolute_start

    def read(self, name: str, start: int = 0, stop: int | None = None) -> NDArray[np.float64]:
        """Read samples of one signal within the span, shape (stop - start,)."""
        return self._whole.read(name, *self._numbers(name, start, stop))

    def raw(self, name: str, start: int = 0, stop: int | None = None) -> RawCounts | None:
        """Return the integers that the source stored for samples within the span, if it stored any."""
        return self._whole.raw(name, *self._numbers(name, start, stop))

    def time_base(self, name: str) -> TimeBase:
        """Return the instants of one signal within the span, on the source's clock."""
        whole = self._whole.time_base(name)
        return whole.part(*whole.span(self._start_s, self._stop_s))

    def tracks(self) -> tuple[Track, ...]:
        """Return nothing: this is no camera."""
        return ()

    def _numbers(self, name: str, start: int, stop: int | None) -> tuple[int, int]:
        """Return the numbers in the whole recording of samples numbered within the span."""
        first, last = self._whole.time_base(name).span(self._start_s, self._stop_s)
        low, high, _ = slice(start, stop).indices(last - first)
        return first + low, first + max(low, high)
