"""What kind of recording an MDF 4 file is: measured channels, a bus log, or both.

The blocks of an MDF file are chains of links. They are walked here before any library does: a chain
that comes back to itself would never end. From the head of a file alone the walk goes as far as the
head reaches.

Layout: ASAM MDF 4.1, as published in asammdf's documentation and in the *MDF4 programming
specification*: identification 64 bytes; each block begins with its id, 4 bytes, its length and its
number of links; HD -> DG -> CG -> CN; names are TX blocks.
"""

from __future__ import annotations

import mmap
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

BUS_NAMES = (
    "CAN_DataFrame", "CAN_RemoteFrame", "CAN_ErrorFrame", "CAN_OverloadFrame", "LIN_Frame", "LIN_WakeUp",
    "LIN_ChecksumError", "LIN_TransmissionError", "LIN_SyncError", "LIN_ReceiveError", "LIN_Spike", "LIN_LongDom",
    "FLX_Frame", "FLX_Pdu", "ETH_Frame", "MOST_Message", "MOST_Packet",
)  # fmt: skip
"""Beginnings of the channel names that ASAM's bus logging standard fixes."""
BUS_EVENT = 0x0002
"""Flag of a channel group that holds frames of a bus."""
MASTERS = (2, 3)
MOST_BLOCKS = 500_000
HD_AT = 64
UNFINALISED = b"UnFinMF 4."
"""Beginning of a file whose recorder has not yet, or never, put its counts in order."""


class MdfChainError(ValueError):
    """A chain of blocks that cannot be followed."""


@dataclass(frozen=True)
class GroupKind:
    """One channel group: whether it is of a bus, and how many channels beside the time it has."""

    is_bus: bool
    channel_count: int


def is_mdf4(head: bytes) -> bool:
    """Tell whether a file begins as MDF of version 4, finalised or not."""
    return head.startswith((b"MDF     4.", UNFINALISED)) and len(head) > HD_AT


def is_bus_logging(head: bytes) -> bool:
    """Tell whether a file's head shows bus frames and no measured channel beside them.

    A file whose channels are described behind its first samples shows neither in its head; it is taken
    for measured channels.

    Parameters
    ----------
    head : bytes
        The first `daq.readers.reader.HEAD_BYTES` bytes, or all of the file.
    """
    groups = list(iter_groups(head, strict=False)) if is_mdf4(head) else []
    return any(g.is_bus for g in groups) and not any(g.channel_count and not g.is_bus for g in groups)


def is_undecided(head: bytes) -> bool:
    """Tell whether a file begins as MDF 4 and describes its first channels behind the bytes given."""
    if not is_mdf4(head):
        return False
    groups = iter_groups(head, strict=False)
    return next(groups, None) is None


def is_bus_file(path: Path) -> bool:
    """Tell from all of a file what `is_bus_logging` tells from its head."""
    try:
        with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
            groups = list(iter_groups(data, strict=False))
    except (OSError, ValueError):
        return False
    return any(g.is_bus for g in groups) and not any(g.channel_count and not g.is_bus for g in groups)


def iter_groups(data: Any, *, strict: bool = True) -> Iterator[GroupKind]:
    """Walk the channel groups of a file.

    Parameters
    ----------
    data : bytes or mmap
        All of a file, or its head.
    strict : bool
        Whether a chain that leaves the data is an error, or the end of what can be told.

    Raises
    ------
    MdfChainError
        If a chain leaves the data (`strict`), comes back to itself, or has another block than it must.
    """
    walk = _Walk(data)
    try:
        for group_at in walk.chain(walk.links(HD_AT, b"##HD")[0], b"##DG"):
            links = walk.links(group_at, b"##DG")
            if strict:
                walk.follow_data(links[2])
            for at in walk.chain(links[1], b"##CG"):
                yield walk.group(at)
    except MdfChainError:
        if strict:
            raise


class _Walk:
    """A walk over blocks, each of which is met once."""

    def __init__(self, data: Any) -> None:
        self.data, self.size = data, len(data)
        self.met: set[int] = set()

    def links(self, at: int, name: bytes = b"##") -> tuple[int, ...]:
        if not HD_AT <= at <= self.size - 24 or at in self.met or len(self.met) > MOST_BLOCKS:
            raise MdfChainError(f"a link to byte {at} leads nowhere, or back")
        self.met.add(at)
        found, _, count = struct.unpack_from("<4s4xQQ", self.data, at)
        if not found.startswith(name) or count > (self.size - at - 24) // 8:
            raise MdfChainError(f"the block at byte {at} is {found!r} with {count} links, not {name!r}")
        links: tuple[int, ...] = struct.unpack_from(f"<{count}Q", self.data, at + 24)
        least = {b"##HD": 1, b"##DG": 3, b"##CG": 2, b"##CN": 3, b"##DL": 1, b"##HL": 1, b"##LD": 1}
        if count < least.get(found, 0):
            raise MdfChainError(f"the block at byte {at} has {count} links")
        return links

    def chain(self, at: int, name: bytes) -> Iterator[int]:
        while at:
            here = at
            yield here
            if here not in self.met:
                self.links(here, name)
            at = struct.unpack_from("<Q", self.data, here + 24)[0]
            if at in self.met:
                raise MdfChainError(f"the chain of {name!r} comes back to byte {at}")

    def group(self, at: int) -> GroupKind:
        links = self.links(at, b"##CG")
        flags_at = at + 24 + 8 * len(links) + 16
        if flags_at + 2 > self.size:
            raise MdfChainError(f"the channel group at byte {at} ends early")
        flags = struct.unpack_from("<H", self.data, flags_at)[0]
        is_bus, count = bool(flags & BUS_EVENT), 0
        for channel_at in self.chain(links[1], b"##CN"):
            channel = self.links(channel_at, b"##CN")
            kind_at = channel_at + 24 + 8 * len(channel)
            if kind_at >= self.size:
                raise MdfChainError(f"the channel at byte {channel_at} ends early")
            count += self.data[kind_at] not in MASTERS
            is_bus = is_bus or self.text(channel[2]).startswith(BUS_NAMES)
            self.compose(channel[1])
        return GroupKind(is_bus, count)

    def compose(self, at: int, depth: int = 0) -> None:
        """Follow the channels that a structure or an array consists of."""
        if not at:
            return
        if depth > 20:
            raise MdfChainError(f"structures within structures at byte {at}")
        if self.data[at : at + 4] != b"##CN":
            return
        for channel_at in self.chain(at, b"##CN"):
            self.compose(self.links(channel_at, b"##CN")[1], depth + 1)

    def follow_data(self, at: int) -> None:
        """Follow the lists of a group's samples."""
        if not at or bytes(self.data[at : at + 4]) not in (b"##HL", b"##DL", b"##LD"):
            return
        first = self.links(at)[0]
        if bytes(self.data[at : at + 4]) == b"##HL":
            at = first
            if at:
                self.links(at)
        while at:
            at = struct.unpack_from("<Q", self.data, at + 24)[0]
            if at:
                self.links(at)

    def text(self, at: int) -> str:
        if not HD_AT <= at <= self.size - 24 or bytes(self.data[at : at + 4]) not in (b"##TX", b"##MD"):
            return ""
        return bytes(self.data[at + 24 : at + 88]).split(b"\0")[0].decode("utf-8", "replace")
