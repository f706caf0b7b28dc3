"""Devices of a session that are lost at present, and the notices of what happens to them."""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping
from dataclasses import dataclass

from recoil_acquisition.capture.live_session import LiveSession
from recoil_acquisition.capture.live_source import LiveSource
from recoil_acquisition.devices.device import CHANGED, event_of
from recoil_daq.live.display import Display


@dataclass(frozen=True)
class _Loss:
    """Loss of a device, with what came of it per second before."""

    at_s: float
    rate_hz: float


class DeviceLosses:
    """Says what happened to the devices, and knows which are lost.

    Parameters
    ----------
    sources
        Live sources by their names; its content may change until the first event.
    """

    def __init__(self, sources: Mapping[str, LiveSource], display: Display) -> None:
        self._sources, self._display = sources, display
        self._lost: dict[str, _Loss] = {}

    @property
    def lost(self) -> tuple[str, ...]:
        """The sources whose devices are lost."""
        return tuple(self._lost)

    def look(self, session: LiveSession) -> None:
        """Say what happened since the last look, with the times at which it happened and not those of saying it."""
        for block in session.device_events():
            event, at_s = event_of(block), block.host_ns / 1e9
            wall = dt.datetime.fromtimestamp(session.record.anchor.wall_of(block.host_ns) / 1e9, dt.UTC)
            when = f"{wall:%H:%M:%S}.{wall.microsecond // 1000:03d}Z"
            if event.name == "stalled":
                self._display.notice(f"{block.source} was late at {when}: {event.detail}")
            elif event.name == "undecoded":
                text = f"{block.source} CANNOT BE READ LIVE since {when}: {event.detail}; it is recorded"
                self._display.notice(text)
            elif event.name == CHANGED:
                looked_at = {channel.name for channel in self._sources[block.source].channels}
                so = "; the trigger looks at it: DISARMED" if looked_at & set(session.trigger.channels) else ""
                self._display.notice(f"{block.source} CHANGED at {when}: {event.detail}{so}")
            elif event.name == "lost" and block.source not in self._lost:
                self._lost[block.source] = _Loss(at_s, session.rate_hz(block.source))
                self._display.notice(f"{block.source} LOST at {when}: {event.detail}")
            elif event.name == "reopened" and (loss := self._lost.pop(block.source, None)) is not None:
                missing_s = at_s - loss.at_s
                unit = self._sources[block.source].live_kind.counted
                about = f", about {missing_s * loss.rate_hz:.0f} {unit} at its rate before" if loss.rate_hz else ""
                self._display.notice(f"{block.source} is back at {when}: {missing_s:.2f} s are missing{about}")
