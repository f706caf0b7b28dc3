"""Every device of a rig opened and listened to: whether each channel is there, at which rate, noise and level."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.capture.live_source import LiveChannel, LiveSource, open_source, signals_of
from recoil_acquisition.devices.device import CAN, EVENT, Block, Counters
from recoil_acquisition.devices.reader_thread import DeviceReader
from recoil_acquisition.errors import RecoilDaqError
from recoil_acquisition.shot import Verdict
from recoil_daq.live.losses import NONE, NOT_COUNTED, losses_of
from recoil_daq.live.sensor_range import allowed
from recoil_rigs.live_sources import live_sources
from recoil_rigs.rig import Rig
from recoil_rigs.twin import simulate_shot
from recoil_rigs.twin.player import TwinPlayer
from recoil_rigs.twin.range_day import is_virtual_rig

Array = NDArray[np.float64]

LISTEN_S = 2.0
SETTLE_S = 0.3
LEAST_SAMPLES = 8
NEAR_RANGE = 0.95
"""At rest no sensor stands so near the end of its range."""


@dataclass(frozen=True)
class ChannelHeard:
    """Signal heard of one channel, or of a source without any.

    Attributes
    ----------
    source, channel, unit
        The unit is that of SI.
    mean, noise
        Of the samples: mean and standard deviation; None if there are too few.
    finding
        What speaks against it, and what to do next.
    """

    source: str
    channel: str
    unit: str
    rate_hz: float
    mean: float | None
    noise: float | None
    verdict: Verdict
    finding: str


def check_devices(
    rig: Rig, *, listen_s: float = LISTEN_S, progress: Callable[[str], None] = lambda _: None
) -> tuple[ChannelHeard, ...]:
    """Listen to every device of a rig.

    Parameters
    ----------
    rig
        If its devices are virtual, they are played here.
    progress
        Told the name of each source.

    Returns
    -------
    tuple of ChannelHeard
        One per channel; one per source whose device cannot be opened.

    Raises
    ------
    DeviceError
        If the rig has no device at all.
    RigError, ReadError
        If units contradict, or a database is at fault.
    """
    if not is_virtual_rig(rig):
        return _listen(live_sources(rig), listen_s, progress)
    with tempfile.TemporaryDirectory(prefix="recoil-daq-") as folder:
        shot = simulate_shot(rig, Path(folder) / "0001", seed=1, shot="0001")
        with TwinPlayer(rig, [shot], silence_before_s=listen_s + SETTLE_S + 5.0) as player:
            return _listen(live_sources(rig, player.devices), listen_s, progress, player.start)


def _listen(
    sources: Sequence[LiveSource],
    listen_s: float,
    progress: Callable[[str], None],
    start: Callable[[], None] = lambda: None,
) -> tuple[ChannelHeard, ...]:
    """Open all devices and listen to them at the same time."""
    heard: list[ChannelHeard] = []
    blocks: dict[str, list[Block]] = {}
    readers: dict[str, DeviceReader] = {}
    try:
        for s in sources:
            progress(f"open {s.name}")
            try:
                device = open_source(s)
            except RecoilDaqError as error:
                heard.append(ChannelHeard(s.name, "", "", 0.0, None, None, "fail", str(error)))
                continue
            blocks[s.name] = []
            readers[s.name] = DeviceReader(device, blocks[s.name].append)
        start()
        for reader in readers.values():
            reader.start()
        progress(f"{listen_s:g} s")
        # what an adapter had queued before comes at once, and would make the rate too high
        time.sleep(SETTLE_S)
        begins_ns = time.monotonic_ns()
        time.sleep(listen_s)
        ends_ns = time.monotonic_ns()
    finally:
        for reader in readers.values():
            reader.stop()
    for s in sources:
        if s.name in readers:
            heard += _judged(s, blocks[s.name], (begins_ns, ends_ns), readers[s.name].device.counters)
    order = {s.name: i for i, s in enumerate(sources)}
    return tuple(sorted(heard, key=lambda one: order[one.source]))


def _judged(
    source: LiveSource, blocks: Sequence[Block], span_ns: tuple[int, int], counters: Counters
) -> list[ChannelHeard]:
    try:
        signals = signals_of(source, source.channels)
    except RecoilDaqError as error:
        return [ChannelHeard(source.name, "", "", 0.0, None, None, "fail", str(error))]
    values: dict[str, list[Array]] = {channel.name: [] for channel in source.channels}
    anything = False
    for block in blocks:
        within = span_ns[0] <= block.host_ns < span_ns[1]
        anything |= within and block.kind != EVENT
        for samples in signals.feed(block):
            if within:
                values[samples.channel].append(samples.values)
    listened_s = (span_ns[1] - span_ns[0]) / 1e9
    heard = []
    for channel in source.channels:
        samples_of = np.concatenate([np.zeros(0), *values[channel.name]])
        mean, noise = (float(samples_of.mean()), float(samples_of.std())) if samples_of.size else (None, None)
        verdict, finding = _judge(source, channel, samples_of, anything, counters)
        rate_hz = samples_of.size / listened_s
        heard.append(ChannelHeard(source.name, channel.name, channel.unit, rate_hz, mean, noise, verdict, finding))
    return heard


def _judge(
    source: LiveSource, channel: LiveChannel, values: Array, anything: bool, counters: Counters
) -> tuple[Verdict, str]:
    """Say what speaks against a channel, the worst first."""
    if not anything:
        return "fail", "the device is silent: check its power, its cable and its bit rate"
    if values.size < LEAST_SAMPLES:
        if source.kind == CAN:
            return "fail", f"no message holds {channel.signal}: check the database and that its node is on"
        skipped = "" if not counters.skipped_bytes else f"; {counters.skipped_bytes} bytes belong to no frame"
        return "fail", f"no frame holds {channel.signal}: check the framing and the baud rate{skipped}"
    if not np.isfinite(values).all():
        return "fail", "some samples are no numbers: check the framing"
    mean, noise = float(values.mean()), float(values.std())
    share = "there, and no range is declared to judge it by"
    if channel.range is not None:
        (low, high), (least, most) = channel.range, allowed(channel.range)
        middle, half = (low + high) / 2, (high - low) / 2
        if not least <= mean <= most:
            return "fail", f"rests at {mean:.4g} {channel.unit}, outside of its range: check the unit and the wiring"
        # a one-sided gauge rests at the end of its range that is zero
        at_zero = (mean < middle and least < low) or (mean > middle and most > high)
        if abs(mean - middle) > NEAR_RANGE * half and not at_zero:
            return "warn", f"rests at {mean:.4g} {channel.unit}, at the end of its range: check zero and wiring"
        share = f"noise is {100 * noise / (high - low):.2g} % of its range"
    if np.ptp(values) == 0:
        return "warn", f"always {mean:.4g} {channel.unit}: sensor not connected?"
    # a stream that is joined in its middle begins with bytes of half a frame
    losses = losses_of(replace(counters, skipped_bytes=0))
    if losses not in (NONE, NOT_COUNTED):
        return "warn", f"{losses}: check the cable and the bus load"
    return "ok", share
