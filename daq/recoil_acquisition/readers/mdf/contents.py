"""The contents of an MDF file, of whichever version: what its blocks say of the channel groups that they describe."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.readers.mdf.channel_groups import ChannelGroup, DataGroup, MdfChannel
from recoil_acquisition.readers.mdf.coded_conversion import CodedConversion
from recoil_acquisition.readers.mdf.number_conversion import NumberConversion


class MdfContents(Protocol):
    """All of a file."""

    def stored_bytes(self, stored: DataGroup) -> NDArray[np.uint8]:
        """Return the bytes of all records that are stored together, shape (n_bytes,), fewer if some are missing.

        Raises
        ------
        MdfDamageError
            If blocks are damaged.
        MdfUnsupportedError
            If they are stored in a way that is not read.
        """
        ...

    def name_of(self, group: ChannelGroup) -> str:
        """Return the name of a group; empty if it has none."""
        ...

    def unit_of(self, channel: MdfChannel) -> str:
        """Return the unit of a channel; empty if none is stated."""
        ...

    def comment_of(self, channel: MdfChannel) -> str:
        """Return the comment on a channel; empty if there is none."""
        ...

    def limits_of(self, channel: MdfChannel) -> tuple[float, float] | None:
        """Return the least and largest value that a channel is stated to have; None if no range is."""
        ...

    def conversion_of(self, channel: MdfChannel) -> NumberConversion | CodedConversion | str:
        """Return the conversion of a channel to numbers, or why it has none."""
        ...
