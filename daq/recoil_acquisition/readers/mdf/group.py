"""The samples of the channel groups of an MDF file that are stored together, read when the first is asked for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.channel import RawCounts
from recoil_acquisition.readers.mdf.channel import UNSIGNED
from recoil_acquisition.readers.mdf.channel_groups import ChannelGroup, MdfChannel, MdfDamageError
from recoil_acquisition.readers.mdf.contents import MdfContents
from recoil_acquisition.readers.mdf.number_conversion import NumberConversion
from recoil_acquisition.readers.mdf.records import Records, split

Kept = NDArray[np.int64] | None
"""Indices of the samples that the time base has; None if it has all."""


class StoredGroups:
    """Channel groups whose records are stored together.

    Parameters
    ----------
    contents
        Reads the file again.
    """

    def __init__(self, groups: tuple[ChannelGroup, ...], contents: Callable[[], MdfContents]) -> None:
        self._groups, self._contents = groups, contents
        self._held: dict[int, Records] = {}

    def records(self, group: ChannelGroup) -> Records:
        """Return the records of a group; those of all groups are held from then on."""
        if not self._held:
            self._held = self.read(self._contents())
        return self._held[group.at]

    def read(self, contents: MdfContents) -> dict[int, Records]:
        """Return the records of each group by its address.

        Raises
        ------
        MdfDamageError
            If blocks are damaged, or hold fewer records than a group states.
        MdfUnsupportedError
            If they are stored in a way that is not read.
        """
        found, _ = split(contents.stored_bytes(self._groups[0].stored), self._groups, counted=True)
        records = {}
        for group, one in zip(self._groups, found, strict=True):
            if len(one.rows) < group.count and one.samples is None:
                raise MdfDamageError(f"samples are missing: {len(one.rows)} of {group.count} records are in the blocks")
            records[group.at] = Records(group, one.rows[: group.count], one.samples)
        return records


@dataclass(frozen=True, eq=False)
class NumberChannel:
    """A channel of numbers."""

    stored: StoredGroups
    group: ChannelGroup
    channel: MdfChannel
    conversion: NumberConversion
    kept: Kept

    def _part(self, start: int, stop: int) -> Records:
        rows = self.stored.records(self.group).rows
        return Records(self.group, rows[start:stop] if self.kept is None else rows[self.kept[start:stop]])

    def samples(self, start: int, stop: int) -> NDArray[np.float64]:
        """Return samples in the channel's unit, invalid ones NaN, shape (stop - start,)."""
        part = self._part(start, stop)
        samples = self.conversion.applied(part.numbers(self.channel))
        samples[~part.valid(self.channel)] = np.nan
        return samples

    def counts(self, unit: str, gain: float, offset: float, start: int, stop: int) -> RawCounts | None:
        """Return the integers of a channel of linear conversion; None if any of them is invalid."""
        if not self.stored.records(self.group).valid(self.channel).all():
            return None
        size = next(size for size in (1, 2, 4, 8) if 8 * size >= self.channel.bits)
        kind = "u" if self.channel.data_type in UNSIGNED else "i"
        return RawCounts(self._part(start, stop).integers(self.channel).astype(f"{kind}{size}"), gain, offset, unit)
