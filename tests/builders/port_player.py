"""Numbered frames that are played into a pseudo-terminal or onto a bus, and what of them was found afterwards.

What a frame holds follows from its number and from the pulses that were fired, so that every byte that comes back can
be compared. The instant at which the write of each returned is kept, on the clock that all processes share.
"""

from __future__ import annotations

import struct
import threading
import time
from array import array
from binascii import crc_hqx
from bisect import bisect_right
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_rigs.twin.transports import PseudoTerminal
from tests.builders.live_logs import rows_in, stream_in

FRAME_BYTES = 34
MESSAGE = 288
"""Identifier of the message that the bundled rig's database declares."""

PULSE_FRAMES = 20
PULSE_M_S2 = 100.0
REST_M_S2 = 1.0
_SYNC = b"\xaa\x55"
_BODY = struct.Struct("<HI5fI")


def serial_frame(number: int, acceleration_m_s2: float = REST_M_S2) -> bytes:
    """Return a frame of the framing that the bundled rig `mixed` declares; its status is the whole number."""
    body = _BODY.pack(number & 0xFFFF, number * 1000 & 0xFFFFFFFF, 0.01, 0.02, acceleration_m_s2, 0.0, 20.0, number)
    # the checksum's polynomial and start are those of binascii's
    return _SYNC + body + crc_hqx(body, 0xFFFF).to_bytes(2, "little")


def can_data(number: int) -> bytes:
    """Return the data of a message: its number, and the counter where the database has it."""
    return struct.pack("<IHBB", number, 0, number & 0xFF, 0)


class Player:
    """Sends frames 0, 1, 2, ... at a mean rate from a thread of its own, between entering and leaving.

    Parameters
    ----------
    send : callable
        Sends some frames, given the first one's number and how many; False if they were not taken.
    rate_hz : float
    most : int
        Frames that are sent together at most, if so many are due.

    Attributes
    ----------
    begun : int
        Frames whose sending began.
    returned_ns : array of int64
        The host's monotonic clock when the sending of each frame had returned.
    cpu_s : float
        Processor time of the thread.
    """

    def __init__(self, send: Callable[[int, int], bool], rate_hz: float, *, most: int = 1) -> None:
        self._send = send
        self._rate_hz = rate_hz
        self._most = most
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="player", daemon=True)
        self.begun = 0
        self.returned_ns = array("q")
        self.cpu_s = 0.0

    def __enter__(self) -> Player:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

    def end(self) -> None:
        """Send nothing more, once what is being sent is taken."""
        self._stopping.set()
        if self._thread.ident is not None:
            self._thread.join()

    def stop(self) -> None:
        """End for good."""
        self.end()

    def sent_before(self, time_ns: int) -> int:
        """Return how many frames had been sent before an instant."""
        return bisect_right(self.returned_ns, time_ns)

    def _run(self) -> None:
        began = time.monotonic()
        while not self._stopping.is_set():
            due = int((time.monotonic() - began) * self._rate_hz)
            while (count := min(due - self.begun, self._most)) > 0 and not self._stopping.is_set():
                first = self.begun
                self.begun += count
                if not self._send(first, count):
                    return
                now_ns = time.monotonic_ns()
                self.returned_ns.extend([now_ns] * count)
            self.cpu_s = time.thread_time()
            self._stopping.wait(0.001)


class PortPlayer(Player):
    """Plays into a pseudo-terminal, which it makes.

    Parameters
    ----------
    name : str
    rate_hz, most
        As of `Player`.

    Attributes
    ----------
    path : Path
        Of the port that the host opens.
    pulses : list of int
        Number of the first frame of each pulse.
    """

    def __init__(self, name: str, rate_hz: float = 1000.0, *, most: int = 1) -> None:
        super().__init__(self._write, rate_hz, most=most)
        self._port = PseudoTerminal(name)
        self._port.plug()
        self._fire = threading.Event()
        self.path: Path = self._port.path
        self.pulses: list[int] = []

    def stop(self) -> None:
        """End at once, which may cut off what is being sent, and take the port away."""
        self._port.abort()
        super().stop()
        self._port.close()

    def fire(self) -> int:
        """Let a pulse begin; return the number of its first frame once that is sent."""
        count = len(self.pulses)
        self._fire.set()
        ends = time.monotonic() + 5.0
        while len(self.pulses) == count or len(self.returned_ns) <= self.pulses[count]:
            assert time.monotonic() < ends, "the player sends nothing any more"
            time.sleep(0.0005)
        return self.pulses[count]

    def frame(self, number: int) -> bytes:
        """Return a frame as it was sent, or will be."""
        pulse = bisect_right(self.pulses, number) - 1
        pulsing = pulse >= 0 and number - self.pulses[pulse] < PULSE_FRAMES
        return serial_frame(number, PULSE_M_S2 if pulsing else REST_M_S2)

    def numbers(self, capture: Path, source: str) -> tuple[NDArray[np.int64], int]:
        """Find the frames of a port in a capture, as `numbers_in`."""
        return self.numbers_in(stream_in(capture, source))

    def numbers_in(self, stream: bytes) -> tuple[NDArray[np.int64], int]:
        """Find the frames in a stream that are as they were sent.

        Returns
        -------
        numbers : ndarray of int64, shape (n_frames,)
            In the order of the stream.
        outside : int
            Bytes that belong to none of them, but for a frame that is cut off at the end.
        """
        numbers, outside, following = [], 0, 0
        at, size = 0, len(stream)
        while at < size:
            frame, expected = stream[at : at + FRAME_BYTES], self.frame(following)
            if frame == expected or self._is_of(frame):
                following = int.from_bytes(frame[-6:-2], "little") + 1
                numbers.append(following - 1)
                at += FRAME_BYTES
            elif len(frame) < FRAME_BYTES and expected.startswith(frame):
                break
            else:
                outside += 1
                at += 1
        return np.array(numbers, dtype=np.int64), outside

    def _is_of(self, frame: bytes) -> bool:
        number = int.from_bytes(frame[-6:-2], "little")
        return len(frame) == FRAME_BYTES and number < self.begun and frame == self.frame(number)

    def _write(self, first: int, count: int) -> bool:
        if self._fire.is_set():
            self._fire.clear()
            self.pulses.append(first)
        return self._port.write(b"".join(map(self.frame, range(first, first + count))))


class BusPlayer(Player):
    """Plays onto a bus of python-can.

    Parameters
    ----------
    device : mapping
        The rig's ``device`` table of that bus.
    rate_hz : float
    """

    def __init__(self, device: Mapping[str, Any], rate_hz: float = 1000.0) -> None:
        import can

        super().__init__(self._put, rate_hz)
        self._message = can.Message
        self._bus = can.Bus(**device, ignore_config=True)

    def stop(self) -> None:
        """End, and leave the bus."""
        super().stop()
        self._bus.shutdown()

    def numbers(self, capture: Path, source: str) -> tuple[NDArray[np.int64], int]:
        """Find the messages of a bus in a capture, as `numbers_in`."""
        return self.numbers_in(rows_in(capture, source))

    def numbers_in(self, records: NDArray[np.void]) -> tuple[NDArray[np.int64], int]:
        """Find the messages that are as they were sent.

        Returns
        -------
        numbers : ndarray of int64, shape (n_messages,)
            In the order of the records.
        wrong : int
            Frames that are none of them.
        """
        plain = records
        octets = plain["data"].copy()
        numbers = octets[:, :4].copy().view("<u4").ravel().astype(np.int64)
        right = np.zeros_like(octets)
        right[:, :4] = octets[:, :4]
        right[:, 6] = numbers & 0xFF
        sound = (octets == right).all(axis=1) & (numbers < self.begun)
        sound &= (plain["id"] == MESSAGE) & (plain["length"] == 8)
        return numbers[sound], int((~sound).sum())

    def _put(self, first: int, count: int) -> bool:
        for number in range(first, first + count):
            self._bus.send(self._message(arbitration_id=MESSAGE, is_extended_id=False, data=can_data(number)))
        return True


@dataclass(frozen=True)
class Tally:
    """What became of the frames of one player.

    Attributes
    ----------
    sent : int
        Whose sending returned.
    due : int
        Of these, sent before the deadline: they must be there.
    found : int
        Different ones that were found as they were sent.
    lost : int
        Due and not found.
    wrong : int
        Found with other content; of a port, bytes outside of its frames.
    doubled : int
        Found again.
    disordered : int
        Found behind one with a higher number.
    """

    sent: int
    due: int
    found: int
    lost: int
    wrong: int
    doubled: int
    disordered: int

    def __add__(self, other: Tally) -> Tally:
        mine, others = vars(self), vars(other)
        return Tally(**{key: mine[key] + others[key] for key in mine})

    @property
    def sound(self) -> bool:
        """Whether all that is due was found, and nothing else is amiss."""
        return not (self.lost or self.wrong or self.doubled or self.disordered)


NOTHING = Tally(0, 0, 0, 0, 0, 0, 0)


def tally(player: Player, numbers: NDArray[np.int64], wrong: int, deadline_ns: int) -> Tally:
    """Count what was found of the frames that a player sent, and must be there if sent before a deadline."""
    unique = np.unique(numbers)
    due = player.sent_before(deadline_ns)
    return Tally(
        sent=len(player.returned_ns),
        due=due,
        found=unique.size,
        lost=due - int((unique < due).sum()),
        wrong=wrong,
        doubled=numbers.size - unique.size,
        disordered=int((np.diff(numbers) < 0).sum()),
    )
