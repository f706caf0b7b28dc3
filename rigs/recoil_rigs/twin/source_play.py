"""Plays one source: every frame at its time, with the faults that were declared, and the count of what happened."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from recoil_rigs.twin.can_replay import CanItem
from recoil_rigs.twin.faults import Faults, Interval, Played
from recoil_rigs.twin.serial_replay import SerialItem
from recoil_rigs.twin.transports import PseudoTerminal, SlcanAdapter, VirtualBus

DEVICE_BASE_S = 1000.0
"""Time of an interface's clock at the start of a play: since it was switched on."""

TICK_S = 0.001
"""Frames that are due within this time go out together, as from a USB adapter: nothing is early, and late by this."""


class SourcePlay:
    """One source's part of a play, in a thread of its own.

    Parameters
    ----------
    items
        Items in the order of their times.
    transport
        Transport that is plugged in before it begins.
    stop
        Ends the play when it is set.
    seed
        Seed of the faults that are drawn.

    Attributes
    ----------
    failure
        Error that ended the thread before its time; None if none did.
    at_s
        Time on the timeline before which everything was sent, s.
    """

    def __init__(
        self,
        name: str,
        items: Iterator[Any],
        transport: Any,
        faults: Faults,
        stop: threading.Event,
        seed: Sequence[int],
    ) -> None:
        self.transport = transport
        self.faults = faults
        self.played = self._counts()
        self.failure: BaseException | None = None
        self.at_s = 0.0
        self._items = items
        self._stop = stop
        self._rng = np.random.default_rng([*seed, 7])
        self._began_s = 0.0
        self._speed = 1.0
        self._back_s: float | None = None
        self.thread = threading.Thread(target=self._run, name=f"play {name}", daemon=True)

    @staticmethod
    def _counts() -> Any:
        return Played()

    def begin(self, began_s: float, speed: float) -> None:
        """Start the thread."""
        self._began_s, self._speed = began_s, speed
        self.thread.start()

    def close(self) -> None:
        """End the thread and take the device away."""
        if isinstance(self.transport, PseudoTerminal):
            self.transport.abort()
        if self.thread.ident is not None:
            self.thread.join()
        if isinstance(self.transport, PseudoTerminal):
            self.transport.close()
        else:
            self.transport.unplug()

    def _run(self) -> None:
        try:
            self._play()
        except BaseException as error:
            self.failure = error

    def _play(self) -> None:
        gone = list(self.faults.gone)
        for item in self._items:
            self.at_s = item.at_s
            while gone and item.at_s >= gone[0].at_s:
                if not self._wait(gone[0].at_s):
                    return
                self._unplug_until(gone.pop(0))
            if any(interval.holds(item.at_s) for interval in self.faults.gone):
                self._count_unplugged(item)
                continue
            self._plug_again(item.at_s)
            if not self._wait(self._release_s(item.at_s)):
                return
            self._send(item)
        self.played.stalls = len(self.faults.stalls)

    def _unplug_until(self, interval: Interval) -> None:
        self.played.unread_bytes += self.transport.unplug()
        self.played.disconnects += 1
        self._back_s = interval.end_s

    def _plug_again(self, at_s: float) -> None:
        if self._back_s is not None and at_s >= self._back_s:
            if self._wait(self._back_s):
                self.transport.plug()
            self._back_s = None

    def _release_s(self, at_s: float) -> float:
        """Return when something goes out that a stall may hold back."""
        return next((stall.end_s for stall in self.faults.stalls if stall.holds(at_s)), at_s)

    def _wait(self, at_s: float) -> bool:
        """Wait for a time of the play; False if the play is stopped."""
        due_s = self._began_s + at_s / self._speed
        late_s = time.monotonic() - due_s
        if late_s < 0:
            return not self._stop.wait(TICK_S - late_s)
        self.played.latest_s = max(self.played.latest_s, late_s)
        return not self._stop.is_set()

    def _count_unplugged(self, item: CanItem | SerialItem) -> None:
        if isinstance(item, CanItem) or item.whole:
            self.played.frames += 1
            self.played.unplugged += 1

    def _send(self, item: CanItem | SerialItem) -> None:
        if isinstance(item, CanItem):
            self._send_frame(item)
        else:
            self._send_bytes(item)

    def _send_frame(self, item: CanItem) -> None:
        played, transport = self.played, self.transport
        if item.error:
            self._send_error(item)
            return
        played.frames += 1
        if self.faults.lost_frames and self._rng.random() < self.faults.lost_frames:
            played.lost += 1
            return
        if not isinstance(transport, VirtualBus | SlcanAdapter) or not transport.send(item, DEVICE_BASE_S):
            played.not_open += 1
            return
        played.sent += 1
        if self.faults.error_frames and self._rng.random() < self.faults.error_frames:
            self._send_error(CanItem(item.at_s, item.stamp_s, 0x80, extended=False, data=bytes(8), error=True))

    def _send_error(self, item: CanItem) -> None:
        """Send an error frame, where the transport has any."""
        transport = self.transport
        if isinstance(transport, VirtualBus) and transport.send(item, DEVICE_BASE_S):
            self.played.error_frames += 1

    def _send_bytes(self, item: SerialItem) -> None:
        played, faults, data = self.played, self.faults, item.data
        played.frames += item.whole
        if item.whole and faults.lost_frames and self._rng.random() < faults.lost_frames:
            played.lost += 1
            return
        dropped = flipped = 0
        if faults.flipped_bytes:
            octets = np.frombuffer(data, dtype=np.uint8).copy()
            hit = np.flatnonzero(self._rng.random(octets.size) < faults.flipped_bytes)
            octets[hit] ^= (1 << self._rng.integers(8, size=hit.size)).astype(np.uint8)
            data, flipped = octets.tobytes(), int(hit.size)
        if faults.dropped_bytes:
            kept = self._rng.random(len(data)) >= faults.dropped_bytes
            dropped = int((~kept).sum())
            data = np.frombuffer(data, dtype=np.uint8)[kept].tobytes()
        if not isinstance(self.transport, PseudoTerminal) or not self.transport.write(data):
            played.not_open += item.whole
            return
        played.bytes_sent += len(data)
        played.bytes_dropped += dropped
        played.bytes_flipped += flipped
        if not item.whole:
            played.stray_bytes += len(data)
        elif dropped or flipped:
            played.damaged += 1
        else:
            played.sent += 1
