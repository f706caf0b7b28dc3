"""Commands to a serial device: to make it talk, to ask it again and again, to make it stop."""

from __future__ import annotations

import math
from dataclasses import dataclass

from recoil_acquisition.frames.framing import Command, Framing, Poll


@dataclass(frozen=True)
class SerialCommands:
    """The commands of a device.

    Attributes
    ----------
    start
        Commands that are sent in order whenever the port was opened.
    stop
        Commands that are sent in order before the port is closed.
    poll
        Requests, each sent again and again at its own pace, never one before the last was answered or given up;
        empty for a device that talks by itself.
    """

    start: tuple[Command, ...] = ()
    stop: tuple[Command, ...] = ()
    poll: tuple[Poll, ...] = ()

    @classmethod
    def of(cls, framing: Framing) -> SerialCommands:
        """Take the commands that a framing declares."""
        return cls(framing.start_commands, framing.stop_commands, framing.poll)


class PollClock:
    """Says which request is due, driven by whoever reads the port: there is no thread.

    Attributes
    ----------
    unanswered
        Requests after which nothing came in time.
    """

    def __init__(self, polls: tuple[Poll, ...]) -> None:
        self.unanswered = 0
        self._polls = polls
        self._due_s = [-math.inf] * len(polls)
        self._give_up_s: float | None = None

    def restart(self) -> None:
        """Forget what was asked: the port was opened just now."""
        self._due_s = [-math.inf] * len(self._polls)
        self._give_up_s = None

    def answered(self) -> None:
        """Note that bytes came."""
        self._give_up_s = None

    def request(self, now_s: float) -> bytes | None:
        """Return the request that is to be sent now, if one is."""
        if not self._polls:
            return None
        if self._give_up_s is not None:
            if now_s < self._give_up_s:
                return None
            self.unanswered += 1
            self._give_up_s = None
        turn = min(range(len(self._polls)), key=self._due_s.__getitem__)
        if now_s < self._due_s[turn]:
            return None
        poll = self._polls[turn]
        # What could not be asked in time is left out, so that late requests do not come in a burst
        late = now_s - self._due_s[turn] > poll.every_s
        self._due_s[turn] = now_s + poll.every_s if late else self._due_s[turn] + poll.every_s
        self._give_up_s = now_s + poll.timeout_s
        return poll.request
