"""Statuses of a live session, and states as the displays get them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from recoil_acquisition.capture.engine import Level
from recoil_acquisition.capture.status import ChannelStatus, LiveStatus, SourceStatus
from recoil_acquisition.devices.device import Counters
from recoil_daq.live.range_state import RangeShot, RangeSource, RangeState, source_state
from recoil_daq.live.shot import LiveShot
from tests.builders.range_states import day

COUNTED = Counters(received=80_000, counter_gaps=0, queue_high_water=41)
CAN = SourceStatus("can", "can", 8000.0, 0.01, COUNTED, "", "frames")
IMU = SourceStatus("imu", "serial", 34_000.0, 0.02, Counters(received=340_000, counter_gaps=0, skipped_bytes=0), "")
EVERYTHING = Counters(
    counter_gaps=3, kernel_drops=12, bad=1, skipped_bytes=40, reopened=2, error_frames=7, queue_high_water=99
)
"""Losses of every kind."""
BRAKE = ChannelStatus("p_brake", "can", "Pa", Level(1.52e6, 1.4e6, 1.6e6), (0.0, 16e6), 8e6)
RATE = ChannelStatus("gyro_carriage", "imu", "rad/s", Level(0.0, -0.001, 0.002), (-1.0, 1.0), None)
SILENT = ChannelStatus("gyro_tipping", "imu", "rad/s", None, (-1.0, 1.0), None)


def status(**changes: Any) -> LiveStatus:
    made = LiveStatus(
        state="armed",
        sources=(CAN, IMU),
        channels=(BRAKE, RATE, SILENT),
        shots=2,
        armed_s=3725.0,
        disk_free_bytes=83_200_000_000,
        journal_bytes=1_000_000,
        unsynced_s=0.1,
        unseen_bytes=0,
    )
    return replace(made, **changes)


def state_of(status: LiveStatus, shots: Sequence[LiveShot] = ()) -> RangeState:
    """Return the state of a session of live sources only."""
    sources = [RangeSource(s.name, s.kind, source_state(s, lost=False), s) for s in status.sources]
    shown = tuple(RangeShot.of(shot) for shot in shots)
    peaks = next((shot.peaks for shot in reversed(shown) if shot.peaks), {})
    return day(
        state=status.state, since_s=0.0, alert=status.alert, next_shot="", sources=tuple(sources), shots=shown,
        channels=tuple(one.with_peak(peaks.get(one.name)) for one in status.channels), triggered=status.shots,
        armed_s=status.armed_s, notices=(), campaign=None, watched=None, disk_free_bytes=status.disk_free_bytes,
        journal_bytes=status.journal_bytes, unsynced_s=status.unsynced_s, unseen_bytes=status.unseen_bytes,
    )  # fmt: skip
