"""Interface of every live source.

A `Device` is opened, read block by block and closed. A block is what one read returned, with the
host's monotonic time at its return; nothing in it is decoded. What happens to the device itself
(lost, opened again, unreadable entries) comes as blocks of kind `EVENT` in the same order as the data,
so that whoever keeps the blocks keeps the whole story.
"""

from __future__ import annotations

import json
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

from recoil_acquisition.files.strict_json import read_json
from recoil_acquisition.frames import can_rows

CAN = "can"
"""Kind of a block of rows of CAN frames, see `recoil_acquisition.frames.can_rows`."""

SERIAL = "serial"
"""Kind of a block of a serial port's bytes as they came."""

STREAM = "stream"
"""Kind of a block of any other device's bytes or packets, cut anywhere: the kind of its source says what they are."""

EVENT = "event"
"""Kind of a block that says what happened to the device, see `event_block`."""

CHANGED = "changed"
"""Name of an event: a device sends other channels, units, scales or rates than before."""

IDLE = "idle"
"""Kind of a block without payload: the device was looked at and had nothing."""

LATE_S = 0.25
"""Time from which on what waited before it was read is late: the process or its machine stood still."""

LARGEST_PIECE = 1 << 19
"""Bytes of a block, beyond which it is cut before it is recorded: half of the longest payload of a log."""

LONGEST_DETAIL = 1 << 14
"""Characters of an event's detail that are recorded: of six bytes each at most, they fit into a record of a log."""

_NOBODY_LOOKED_NS = 200_000_000
"""Time in which a reading thread looks up twice, however silent its source."""
_BELIEVED_AFTER_NS = 250_000_000


@dataclass(frozen=True, slots=True)
class Block:
    """Result of one read of a device.

    Attributes
    ----------
    source
        Name of the source.
    host_ns
        The host's monotonic clock when the read returned, ns (`time.monotonic_ns`).
    payload
        Data: whole rows of `frames.can_rows.ROW_SIZE` bytes of kind `CAN`, the bytes of the port of kind `SERIAL`,
        those of any other device of kind `STREAM`, a JSON object of kind `EVENT`, nothing of kind `IDLE`.
    kind
        Kind of the data: `CAN`, `SERIAL`, `STREAM`, `EVENT` or `IDLE`.
    empty_ns
        Time of the same clock when the source was last found empty: the payload arrived after it, and at `host_ns` at
        the latest. A read comes soon after it, unless the process or its machine stood still. None if it is unknown.
    """

    source: str
    host_ns: int
    payload: bytes
    kind: str
    empty_ns: int | None = None

    @property
    def is_data(self) -> bool:
        """Whether it holds frames of a bus or bytes of a port."""
        return self.kind not in (EVENT, IDLE)

    def late_s(self, before_ns: int | None) -> float:
        """Return how long its payload may have waited because nobody read.

        A source that is read all the time and never found empty is busy, not late.

        Parameters
        ----------
        before_ns
            Time at which the block before was read; None if there was none.
        """
        if self.empty_ns is None or before_ns is None:
            return 0.0
        return (self.host_ns - max(self.empty_ns, before_ns)) / 1e9


@dataclass(frozen=True)
class DeviceEvent:
    """Something that happened to a device.

    Attributes
    ----------
    name
        Name of the event: ``opened``, ``lost``, ``reopened``, ``stalled``, ``unreadable``, ``unanswered``,
        ``undecoded``, ``described``, ``changed`` or ``closed``.
    detail
        Text in one line.
    """

    name: str
    detail: str


def pieces(block: Block) -> Iterator[Block]:
    """Cut a block of data into pieces that the log takes, rows of a bus between two rows; they share its times."""
    step = LARGEST_PIECE
    if block.kind == CAN:
        step -= step % can_rows.ROW_SIZE
    for start in range(0, len(block.payload), step):
        yield replace(block, payload=block.payload[start : start + step])


def event_block(source: str, host_ns: int, name: str, detail: str) -> Block:
    """Return the block that records an event; of a detail that is longer than `LONGEST_DETAIL` it says how long it is.

    A library's message may hold all that a device sent: the log takes no record of any length.
    """
    detail = " ".join(detail.split())
    if len(detail) > LONGEST_DETAIL:
        detail = f"{detail[:LONGEST_DETAIL]} ... (cut, {len(detail)} characters)"
    text = json.dumps({"event": name, "detail": detail}, ensure_ascii=False)
    return Block(source, host_ns, text.encode(), EVENT)


def event_of(block: Block) -> DeviceEvent:
    """Return the event that a block records; ValueError if it is a block of another kind or damaged."""
    if block.kind != EVENT:
        raise ValueError(f"a block of kind {block.kind!r} records no event")
    try:
        content = read_json(block.payload)
        return DeviceEvent(str(content["event"]), str(content["detail"]))
    except (ValueError, KeyError, TypeError) as error:
        raise ValueError(f"this block records no event: {block.payload[:80]!r}") from error


def interrupts(block: Block) -> bool:
    """Return whether a block says that the device was lost or opened again: nothing is continued over it."""
    return block.kind == EVENT and event_of(block).name in ("lost", "reopened")


def joined(blocks: Sequence[Block]) -> list[Block]:
    """Join the blocks of data of each source, up to its next event or silence.

    Each takes the times of its last part.

    Parameters
    ----------
    blocks
        Blocks in the order in which they came. Sources stay apart; among them the order is lost.
    """
    parts: dict[str, list[Block]] = {}
    made: list[Block] = []

    def close(source: str) -> None:
        waiting = parts.pop(source, [])
        if waiting:
            payload = b"".join(part.payload for part in waiting)
            made.append(Block(source, waiting[-1].host_ns, payload, waiting[-1].kind, waiting[-1].empty_ns))

    for block in blocks:
        if not block.is_data:
            close(block.source)
            made.append(block)
        else:
            parts.setdefault(block.source, []).append(block)
    for source in tuple(parts):
        close(source)
    return made


@dataclass(frozen=True)
class Counters:
    """Counts of what a device met since it was made.

    Attributes
    ----------
    received
        Frames of a bus, its error frames not counted; bytes of a port; what the kind of another device counts.
    bad
        Entries that the driver could not read, and what the check of the stream found damaged.
    skipped_bytes
        Bytes outside of good frames; None where nothing checks the stream's frames.
    counter_gaps
        Places where a packet counter misses frames; None where no counter is checked.
    kernel_drops
        Frames or bytes that the kernel dropped before they could be read; None where the platform does not say.
    reopened
        Number of times that the device was lost and opened again.
    error_frames
        Error frames of a bus.
    queue_high_water
        Most frames, or bytes of a port, that were found waiting at once.
    """

    received: int = 0
    bad: int = 0
    skipped_bytes: int | None = None
    counter_gaps: int | None = None
    kernel_drops: int | None = None
    reopened: int = 0
    error_frames: int = 0
    queue_high_water: int = 0


class EmptyLook:
    """Last time that a source was found empty, as far as that can be believed.

    A driver hands on what it holds in pieces: right behind the first piece nothing seems to wait. So what is seen soon
    after nobody looked for a while is not believed.

    Attributes
    ----------
    empty_ns
        Monotonic host time: all that arrived before it was read by the time of the last look. At first it is that of
        opening.
    """

    def __init__(self) -> None:
        self.empty_ns = self._looked_ns = time.monotonic_ns()
        self._believed_from_ns = 0

    def looked(self, at_ns: int, *, empty: bool) -> None:
        """Note a look, at a time before it."""
        if at_ns - self._looked_ns > _NOBODY_LOOKED_NS:
            self._believed_from_ns = at_ns + _BELIEVED_AFTER_NS
        self._looked_ns = at_ns
        if empty and at_ns >= self._believed_from_ns:
            self.empty_ns = at_ns


class TellingDevice(Protocol):
    """Device that knows of its signals what a rig need not declare."""

    @property
    def units(self) -> Mapping[str, str]:
        """Unit of each of its signals, as it spells it, by their names, once it is open."""


class Device(Protocol):
    """One live source. It is read by one thread; `counters` may be asked for by any."""

    @property
    def name(self) -> str:
        """Name of the source."""

    @property
    def kind(self) -> str:
        """Kind of its data blocks: `CAN`, `SERIAL` or `STREAM`."""

    @property
    def counters(self) -> Counters:
        """Counts of what it received and lost so far."""

    @property
    def bytes_per_s(self) -> float:
        """Most bytes per second that its blocks hold, once it is open: space for them is reserved."""

    def open(self) -> None:
        """Open it.

        Raises
        ------
        DeviceError
            In one line: what is wrong, and what to do.
        ValueError
            If it is open already.
        """

    def read(self, timeout_s: float) -> Block | None:
        """Return the next block, or None if nothing came in time.

        A device that is lost while it is read says so by an event, and is opened again by later reads
        with growing pauses; read does not raise for it. ValueError if it was never opened.
        """

    def close(self) -> tuple[Block, ...]:
        """Read what still waits, close, and return it; further calls return nothing."""
