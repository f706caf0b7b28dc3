"""Many frames at once: what a search would return frame by frame, taken from its bytes as arrays.

`frames.search` is the definition. A block takes the frames at the front of the bytes, counts what the
search would count, and leaves to it whatever it cannot settle.
"""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from recoil_acquisition.frames.acceptance import FEWEST_ROWS, Acceptance
from recoil_acquisition.frames.byte_stuffing import Mask, Octets, Places, decode_cobs_packets, decode_slip_packets
from recoil_acquisition.frames.frame_set import FrameCollection, FrameCounters
from recoil_acquisition.frames.framing import Framing
from recoil_acquisition.frames.search import PacketSearch, Search, SyncSearch

_MOST_FRAMES = 4096
_MOST_BYTES = 1 << 17
_FEWEST_ALIKE = 64
"""Number of frames of one length that are worth being judged apart from what follows them."""

Judged = tuple[bytes, Places, Mask, Mask]
"""Bytes that begin with frames, their lengths, and which are good and of a known type."""


class BatchSearch(ABC):
    """Taking of the frames at the front of a search's bytes.

    Parameters
    ----------
    counters
        Counters that what is met is added to.
    """

    def __init__(self, framing: Framing, acceptance: Acceptance, counters: FrameCounters) -> None:
        self._framing = framing
        self._acceptance = acceptance
        self._counters = counters

    @abstractmethod
    def take(self, end: int, frames: FrameCollection) -> bool:
        """Take the frames before byte ``end`` of the buffer if they are many; return whether it is worth going on."""


class SyncBlock(BatchSearch):
    """Frames whose heads state their lengths and that follow each other without a gap, up to the first bad one."""

    def __init__(self, search: SyncSearch, framing: Framing, acceptance: Acceptance, counters: FrameCounters) -> None:
        super().__init__(framing, acceptance, counters)
        self._search = search
        # where frames behind a bad one were judged in vain, fewer are judged together
        self._most = 2 * FEWEST_ROWS
        self._not_before = 0
        self._by_head: dict[bytes, int] = {}

    def take(self, end: int, frames: FrameCollection) -> bool:
        """Take the good frames up to the first bad one; leave that, and what cannot be a frame, to the search."""
        search, framing = self._search, self._framing
        # a frame that the sync bytes must follow is left to the search while they are not there
        room = end - (len(framing.sync) if framing.look_ahead else 0)
        if search.offset < self._not_before or room - search.at < FEWEST_ROWS * search.smallest:
            return False
        judged = self._equal(room) or self._any(room)
        if judged is None:
            return False
        data, lengths, good, known = judged
        count = len(lengths)
        taken = count if good.all() else int(good.argmin())
        self._most = min(2 * self._most, _MOST_FRAMES) if 2 * taken > count else max(self._most // 2, FEWEST_ROWS)
        if taken:
            behind = np.cumsum(lengths[:taken])
            size = int(behind[-1])
            frames.add_block(data[:size], lengths[:taken], behind + search.offset)
            search.advance_to(search.at + size)
            self._counters.received += taken
            if self._acceptance.selective:
                self._counters.unknown_types += taken - int(known[:taken].sum())
        return taken == count

    def _equal(self, room: int) -> Judged | None:
        """Judge the frames at the front that begin like the first; None if too few do."""
        search, framing = self._search, self._framing
        buffer, sync, at = search.buffer, framing.sync, search.at
        length = framing.length.of(buffer, at)
        count = min((room - at) // length, self._most) if search.smallest <= length <= framing.maximum else 0
        if count < FEWEST_ROWS or not buffer.startswith(sync, at):
            return None
        data = bytes(buffer[at : at + count * length])
        alike = count
        for place in {*range(len(sync)), *range(framing.length.at, framing.length.head)}:
            column = data[place::length]
            alike = min(alike, count - len(column.lstrip(column[:1])))
        if alike < min(count, _FEWEST_ALIKE):
            return None
        if framing.look_ahead and not buffer.startswith(sync, at + alike * length):
            alike -= 1
        rows = np.frombuffer(data, dtype=np.uint8, count=alike * length).reshape(alike, length)
        return data, np.full(alike, length, dtype=np.int64), *self._acceptance.good_rows(rows)

    def _any(self, room: int) -> Judged | None:
        """Judge what looks like frames at the front; None if that are too few."""
        search, framing, most, look_ahead = self._search, self._framing, self._most, self._framing.look_ahead
        sync, begin, behind, known = framing.sync, framing.length.at, framing.length.head, self._by_head
        room = min(room - search.at, _MOST_BYTES)
        data = bytes(search.buffer[search.at : search.at + room + len(sync)])
        at, lengths = 0, list[int]()
        while len(lengths) < most and data.startswith(sync, at):
            head = data[at + begin : at + behind]
            length = known.get(head) or self._new_length(head, data, at)
            if not length or at + length > room or (look_ahead and not data.startswith(sync, at + length)):
                break
            at += length
            lengths.append(length)
        if len(lengths) < FEWEST_ROWS:
            # all that stands before is left to the search: looking at it again would find as few
            self._not_before = search.offset + at
            return None
        sizes = np.array(lengths, dtype=np.int64)
        return data, sizes, *self._acceptance.good_frames(data[:at], sizes)

    def _new_length(self, head: bytes, data: bytes, at: int) -> int:
        """Return the length of a frame, and remember it by the bytes that state it; 0 if it is impossible."""
        length = self._framing.length.of(data, at)
        if not self._search.smallest <= length <= self._framing.maximum:
            return 0
        self._by_head[head] = length
        return length


class PacketBlock(BatchSearch):
    """Packets between delimiters, good and bad."""

    def __init__(self, search: PacketSearch, framing: Framing, acceptance: Acceptance, counters: FrameCounters) -> None:
        super().__init__(framing, acceptance, counters)
        self._search = search
        self._decode = decode_cobs_packets if framing.kind == "cobs" else decode_slip_packets

    def take(self, end: int, frames: FrameCollection) -> bool:
        """Take all whole packets, and count the bad ones among them."""
        search = self._search
        end = min(end, search.at + _MOST_BYTES)
        if search.overlong or search.buffer.count(search.delimiter, search.at, end) < FEWEST_ROWS:
            return False
        octets = np.frombuffer(bytes(search.buffer[search.at : end]), dtype=np.uint8)
        stops = np.flatnonzero(octets == search.delimiter[0])
        starts = np.concatenate([stops[:1] * 0, stops[:-1] + 1])
        held = starts < stops
        extents = stops - starts + 1
        if not held.all():
            # a delimiter right before a packet belongs to it; more of them are skipped
            extents[1:] += ~held[:-1]
            starts, stops, extents = starts[held], stops[held], extents[held]
            if len(stops) < FEWEST_ROWS:
                return False
        size = int(stops[-1]) + 1
        decoded, lengths, sound = self._decode(octets[:size], starts, stops)
        sound &= (stops - starts <= search.longest) & (lengths <= self._framing.maximum)
        if not sound.all():
            decoded, lengths = _chosen(decoded, lengths, sound)
            stops, extents = stops[sound], extents[sound]
            self._counters.bad_length += len(sound) - len(stops)
        good = self._good(decoded, lengths)
        if not good.all():
            decoded, lengths = _chosen(decoded, lengths, good)
            stops, extents = stops[good], extents[good]
        frames.add_block(decoded.tobytes(), lengths, stops + (search.offset + 1))
        self._counters.skipped_bytes += size - int(extents.sum())
        search.advance_to(search.at + size)
        return True

    def _good(self, decoded: Octets, lengths: Places) -> Mask:
        """Return which frames are good, and count them and the others."""
        good, known = self._acceptance.good_frames(decoded.tobytes(), lengths)
        if not good.all():
            ends = np.cumsum(lengths)
            for i in np.flatnonzero(~good).tolist():
                fault = self._acceptance.fault_of(decoded[ends[i] - lengths[i] : ends[i]].tobytes())
                if fault is not None:
                    self._counters.note(fault)
                else:  # what arrays give never differs; if it did, one by one is the definition
                    good[i] = True
        received = int(good.sum())
        self._counters.received += received
        if self._acceptance.selective:
            self._counters.unknown_types += received - int((good & known).sum())
        return good


def _chosen(octets: Octets, lengths: Places, chosen: Mask) -> tuple[Octets, Places]:
    """Return the bytes and lengths of some of the frames that follow each other in an array."""
    return octets[np.repeat(chosen, lengths)], lengths[chosen]


def block_for(search: Search, framing: Framing, acceptance: Acceptance, counters: FrameCounters) -> BatchSearch | None:
    """Return what takes many frames of a search at once; None if nothing does."""
    if not acceptance.by_rows:
        return None
    if isinstance(search, SyncSearch):
        return SyncBlock(search, framing, acceptance, counters)
    if isinstance(search, PacketSearch):
        return PacketBlock(search, framing, acceptance, counters)
    return None
