"""The samples of a channel group of an MDF 4 file: all of its channels in one call, when the first is asked for."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.channel import RawCounts
from recoil_acquisition.readers.bounded_file import BoundedFile
from recoil_acquisition.readers.mdf.library import opened

Kept = NDArray[np.int64] | None
"""Indices of the samples that the time base has; None if it has all."""


@dataclass(eq=False)
class HeldGroup:
    """The channels of one group; its samples as stored, which the time base may have fewer of.

    Attributes
    ----------
    path : Path
    index : int
        Of the group.
    channels : tuple of int
        Those that are read.
    count : int
        Number of samples that the group states.
    signals : dict
        asammdf's signals by channel, once they were read.
    """

    path: Path
    index: int
    channels: tuple[int, ...]
    count: int
    signals: dict[int, Any] = field(default_factory=dict)

    def signal(self, channel: int) -> Any:
        """Return one channel as stored, with its conversion."""
        if not self.signals:
            with BoundedFile(self.path) as file, opened(file) as mdf:
                wanted = [(None, self.index, c) for c in self.channels]
                read = mdf.select(wanted, raw=True, copy_master=False, ignore_value2text_conversions=True)
            if any(len(signal.samples) != self.count for signal in read):
                raise ValueError(f"group {self.index} has not the {self.count} samples that it states")
            self.signals = dict(zip(self.channels, read, strict=True))
        return self.signals[channel]

    def samples(self, channel: int, kept: Kept, start: int, stop: int) -> NDArray[np.float64]:
        """Return samples of one channel in its unit, invalid ones NaN, shape (stop - start,)."""
        signal = self.signal(channel)
        chosen = slice(start, stop) if kept is None else kept[start:stop]
        stored = np.array(signal.samples[chosen])
        values = stored if signal.conversion is None else signal.conversion.convert(stored)
        samples = np.array(values, dtype=np.float64)
        if signal.invalidation_bits is not None:
            samples[np.asarray(signal.invalidation_bits, bool)[chosen]] = np.nan
        return samples

    def counts(
        self, channel: int, kept: Kept, unit: str, gain: float, offset: float, start: int, stop: int
    ) -> RawCounts | None:
        """Return the integers of one channel of linear conversion; None if any of them is invalid."""
        signal = self.signal(channel)
        if signal.invalidation_bits is not None and np.any(signal.invalidation_bits):
            return None
        chosen = slice(start, stop) if kept is None else kept[start:stop]
        return RawCounts(np.array(signal.samples[chosen]), gain, offset, unit)
