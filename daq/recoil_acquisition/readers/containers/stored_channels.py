"""Channels of a container file, each with its own way to its samples, as one recording.

Container formats (WAV, HDF5, MAT, TDMS, UFF, MDF) differ in how they say what they hold; once that
is known, a channel is a header, a time base, and a function that reads a part of its samples.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.channel import RawCounts
from recoil_acquisition.errors import CorruptFileError, MissingChannelError, ReadError, RecoilDaqError
from recoil_acquisition.readers.reader import SignalHeader
from recoil_acquisition.timebase import AbsoluteStart, TimeBase
from recoil_acquisition.track import Track


def _no_counts(_start: int, _stop: int) -> RawCounts | None:
    return None


@dataclass(frozen=True, eq=False)
class StoredChannel:
    """One channel of a container.

    Attributes
    ----------
    header : SignalHeader
    time_base : TimeBase
    samples : callable
        Reads samples ``start`` to ``stop`` (0 <= start <= stop <= count) into an array of the caller's own,
        float64, shape (stop - start,), in the file's unit.
    raw : callable
        Reads the stored integers of the same samples; None if there are none.
    """

    header: SignalHeader
    time_base: TimeBase
    samples: Callable[[int, int], NDArray[np.float64]]
    raw: Callable[[int, int], RawCounts | None] = _no_counts


@contextmanager
def damage_is_reported(path: Path, expected: str) -> Iterator[None]:
    """Turn what a library raises over a damaged file into a `CorruptFileError`.

    Parameters
    ----------
    path : Path
    expected : str
        What the file should have been, for the message.

    Raises
    ------
    ReadError
        If the file cannot be read at all.
    CorruptFileError
        If anything else is raised than this project's own errors: libraries answer damaged bytes with
        whatever exception the first wrong number leads to.
    """
    try:
        yield
    except RecoilDaqError:
        raise
    except (FileNotFoundError, IsADirectoryError, PermissionError) as error:
        raise ReadError(f"cannot be read: {error.strerror or error}", path=path, remedy="check the name") from error
    except Exception as error:
        text = " ".join(str(error).split())[:200] or "no message"
        raise CorruptFileError(
            "the file is damaged", path=path, expected=expected, found=f"{type(error).__name__}: {text}",
            remedy="copy or export it again",
        ) from error  # fmt: skip


class StoredRecording:
    """One opened container.

    Parameters
    ----------
    path : Path
    reader : str
        Name of the reader.
    channels : sequence of StoredChannel
        With unique names, in the file's order.
    metadata : mapping
        JSON types only.
    notes : sequence of str
    incomplete : str
    absolute_start : AbsoluteStart or None

    Raises
    ------
    ReadError
        If there is no channel: nothing in the file can be used, and `notes` say why.
    """

    def __init__(
        self,
        path: Path,
        reader: str,
        channels: Sequence[StoredChannel],
        metadata: Mapping[str, Any],
        notes: Sequence[str],
        incomplete: str = "",
        absolute_start: AbsoluteStart | None = None,
    ) -> None:
        if not channels:
            found = "; ".join(list(notes)[:6]) or "nothing"
            raise ReadError("no time history in this file", path=path, found=found)
        self.path = path
        self.reader = reader
        self.signals = tuple(channel.header for channel in channels)
        self.metadata = metadata
        self.notes = tuple(notes)
        self.incomplete = incomplete
        self.absolute_start = absolute_start
        self._channels = {channel.header.name: channel for channel in channels}

    def _find(self, name: str) -> StoredChannel:
        try:
            return self._channels[name]
        except KeyError:
            raise MissingChannelError(name, tuple(self._channels), path=self.path) from None

    def read(self, name: str, start: int = 0, stop: int | None = None) -> NDArray[np.float64]:
        """Read samples of one signal in the file's unit, lost ones NaN, shape (stop - start,)."""
        channel = self._find(name)
        first, last, _ = slice(start, stop).indices(channel.header.sample_count)
        with damage_is_reported(self.path, f"a whole file of {self.reader}"):
            return channel.samples(first, max(first, last))

    def raw(self, name: str, start: int = 0, stop: int | None = None) -> RawCounts | None:
        """Return the integers that the file holds of one signal, if it holds any."""
        channel = self._find(name)
        first, last, _ = slice(start, stop).indices(channel.header.sample_count)
        with damage_is_reported(self.path, f"a whole file of {self.reader}"):
            return channel.raw(first, max(first, last))

    def time_base(self, name: str) -> TimeBase:
        """Return the instants of one signal's samples."""
        return self._find(name).time_base

    def tracks(self) -> tuple[Track, ...]:
        """Return nothing: this is no camera."""
        return ()
