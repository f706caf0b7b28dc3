"""Every device of a rig opened and listened to: whether each channel is there, at which rate, noise and level."""

from __future__ import annotations

import threading
import time
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from recoil_acquisition.capture.live_source import LiveChannel, LiveSamples, LiveSource, open_source, signals_of
from recoil_acquisition.devices.device import EVENT, Block, Counters
from recoil_acquisition.devices.reader_thread import DeviceReader
from recoil_acquisition.devices.tick_clock import START_S
from recoil_acquisition.errors import DeviceError, RecoilDaqError
from recoil_acquisition.files.temporary_folder import temporary_folder
from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.shot.quality_check import Verdict
from recoil_daq.live.first_contact import KEPT_S, FirstContact
from recoil_daq.live.sensor_range import allowed
from recoil_daq.live.shot import losses_of, lost_anything
from recoil_daq.live.trigger_at_rest import ConditionAtRest, conditions_at_rest
from recoil_rigs.rig import Rig
from recoil_rigs.shots.live_sources import found_by, live_sources, told_by
from recoil_rigs.twin import simulate_shot
from recoil_rigs.twin.player import TwinPlayer
from recoil_rigs.twin.range_day import is_virtual_rig

LISTEN_S = 5.0
SETTLE_S = START_S + 0.1
"""Nothing is dated before a clock of ticks has begun; what an adapter had queued comes within it, too."""
LEAST_SAMPLES = 8
NEAR_RANGE = 0.95
"""Share of half its range, beyond which no sensor stands at rest."""


@dataclass(frozen=True)
class ChannelHeard:
    """Signal heard of one channel, or of a source without any.

    Attributes
    ----------
    source, channel, unit
        Names of source and channel, and the channel's SI unit.
    mean, noise
        Mean and standard deviation of the samples, in `unit`; None if there are too few.
    finding
        Sentence that states what speaks against the channel, and what to do next.
    value
        Last sample, in the unit in which people read the channel; empty if nothing came.
    noise_shown
        Noise in that unit; empty if there are too few samples.
    noise_of_range
        Noise as a share of the channel's range; None where none is declared.
    stamped_by
        Clock that stamped the samples: that of ``hardware``, ``adapter`` or ``sensor``, the ``kernel`` at the arrival,
        or the ``host`` when it reads; empty if nothing came.
    triggers
        Conditions of the rig's trigger on the channel, over what was heard.
    """

    source: str
    channel: str
    unit: str
    rate_hz: float
    mean: float | None
    noise: float | None
    verdict: Verdict
    finding: str
    value: str = ""
    noise_shown: str = ""
    noise_of_range: float | None = None
    stamped_by: str = ""
    triggers: tuple[ConditionAtRest, ...] = ()


def device_document(rig: Rig, heard: Sequence[ChannelHeard]) -> dict[str, Any]:
    """Return the document of ``check --devices --json``."""
    return {
        "schema": "recoil-daq/check-devices/1",
        "rig": rig.name,
        "file": str(rig.path),
        "virtual": is_virtual_rig(rig),
        "channels": [asdict(one) for one in heard],
    }


def check_devices(
    rig: Rig,
    *,
    listen_s: float = LISTEN_S,
    keep: FirstContact | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> tuple[ChannelHeard, ...]:
    """Listen to every device of a rig.

    Parameters
    ----------
    rig
        Rig whose devices are opened; virtual devices are played here.
    keep
        File of all that its one recorder says and is told, for `KEPT_S`.
    progress
        Function called with the name of each source.

    Returns
    -------
    tuple of ChannelHeard
        Channels that were listened to; one entry per source whose device cannot be opened.

    Raises
    ------
    DeviceError
        If the rig has no device at all, or not one recorder whose talk is to be kept.
    RigError, ReadError
        If units contradict, or a database is at fault.
    """
    if not is_virtual_rig(rig):
        return _listen(rig, None, listen_s, keep, progress)
    with temporary_folder() as folder:
        shot = simulate_shot(rig, Path(folder) / "0001", seed=1, shot="0001")
        all_s = listen_s if keep is None else max(listen_s, KEPT_S)
        with TwinPlayer(rig, [shot], silence_before_s=all_s + SETTLE_S + 5.0) as player:
            return _listen(rig, player.devices, listen_s, keep, progress, player.start)


def _listen(
    rig: Rig,
    tables: Mapping[str, Mapping[str, Any]] | None,
    listen_s: float,
    keep: FirstContact | None,
    progress: Callable[[str], None],
    start: Callable[[], None] = lambda: None,
) -> tuple[ChannelHeard, ...]:
    """Open all devices and listen to them at the same time."""
    sources, trigger = live_sources(rig, tables), rig.trigger
    heard: list[ChannelHeard] = []
    blocks: dict[str, list[Block]] = {}
    heard_out = threading.Event()
    readers: dict[str, DeviceReader] = {}
    kept = "" if keep is None else _kept(rig, sources)
    if keep is not None:
        keep.begin(rig.name, kept)
    try:
        for s in sources:
            progress(f"open {s.name}")
            try:
                device = open_source(s, keep.heard if keep is not None and s.name == kept else None)
            except RecoilDaqError as error:
                verdict: Verdict = "fail" if rig.source(s.name).required else "warn"
                heard.append(ChannelHeard(s.name, "", "", 0.0, None, None, verdict, str(error)))
                continue
            blocks[s.name] = []
            readers[s.name] = DeviceReader(device, partial(_append, blocks[s.name], heard_out))
        opened = {name: reader.device for name, reader in readers.items()}
        if told := told_by(sources, opened):
            sources = live_sources(rig, tables, told, found_by(sources, opened))
        start()
        for reader in readers.values():
            reader.start()
        progress(f"{listen_s:g} s")
        time.sleep(SETTLE_S)
        begins_ns = time.monotonic_ns()
        time.sleep(listen_s)
        ends_ns = time.monotonic_ns()
        heard_out.set()
        if kept in readers and (left_s := KEPT_S - SETTLE_S - listen_s) > 0:
            progress(f"{left_s:g} s more, to keep what {kept} says")
            time.sleep(left_s)
    finally:
        for name, reader in readers.items():
            try:
                reader.stop()
            except DeviceError as error:
                heard.append(ChannelHeard(name, "", "", 0.0, None, None, "fail", str(error)))
            if (stopped := reader.error) is not None:
                said = str(stopped) if isinstance(stopped, RecoilDaqError) else f"{type(stopped).__name__}: {stopped}"
                finding = f"its device has stopped: {said}"
                heard.append(ChannelHeard(name, "", "", 0.0, None, None, "fail", finding))
    span_ns, samples = (begins_ns, ends_ns), _Samples()
    for s in sources:
        if s.name in readers:
            heard += _judged(s, blocks[s.name], span_ns, readers[s.name].device.counters, samples)
    if trigger is not None:
        listened_s = round((ends_ns - begins_ns) / 1e9, 1)
        channels = {channel.name: channel for s in sources for channel in s.channels}
        at_rest = conditions_at_rest(trigger, channels, samples, listened_s)
        heard = [_with_trigger(one, [c for c in at_rest if c.channel == one.channel]) for one in heard]
    order = {s.name: i for i, s in enumerate(sources)}
    return tuple(sorted(heard, key=lambda one: order[one.source]))


def _kept(rig: Rig, sources: Sequence[LiveSource]) -> str:
    """Return the one source whose talk is kept; DeviceError if there is not one."""
    names = [one.name for one in sources if one.live_kind.keeps_talk]
    if len(names) != 1:
        raise DeviceError(
            f"rig {rig.name!r} has {len(names) or 'no'} recorders whose commands and stream can be kept",
            path=rig.path,
            expected='one source with such as `device = { oxygen = "192.0.2.10" }`',
            found=", ".join(names),
            remedy="keep a rig file with that source alone for it" if names else "leave --keep out",
        )
    return names[0]


def _append(blocks: list[Block], over: threading.Event, block: Block) -> None:
    if not over.is_set():
        blocks.append(block)


class _Samples(defaultdict[str, list[LiveSamples]]):
    """Samples of each channel, as they came within the time of listening."""

    def __init__(self) -> None:
        super().__init__(list)

    def of(self, channel: str) -> Array:
        """Return the values of a channel, shape (n_samples,)."""
        return np.concatenate([np.zeros(0), *(one.values for one in self[channel])])


def _with_trigger(heard: ChannelHeard, at_rest: Sequence[ConditionAtRest]) -> ChannelHeard:
    """Add what the trigger's conditions on a channel would do at rest; what they do wrong decides its verdict."""
    findings = [(one.fired > 0, one.finding) for one in at_rest if one.finding]
    if not findings or heard.verdict == "fail":
        return replace(heard, triggers=tuple(at_rest))
    fires = any(fired for fired, _ in findings)
    texts = [text for fired, text in findings if fired or not fires]
    if heard.verdict != "ok":
        texts.append(heard.finding)
    verdict: Verdict = "fail" if fires else "warn"
    return replace(heard, triggers=tuple(at_rest), verdict=verdict, finding="; ".join(texts))


def _judged(
    source: LiveSource, blocks: Sequence[Block], span_ns: tuple[int, int], counters: Counters, heard_of: _Samples
) -> list[ChannelHeard]:
    """Judge the channels of a source; their samples are added to `heard_of`."""
    within = [block for block in blocks if span_ns[0] <= block.host_ns < span_ns[1]]
    anything = any(block.kind != EVENT for block in within)
    try:
        with source.live_kind.at_work():
            signals = signals_of(source, source.channels)
            for block in blocks:
                for samples in signals.feed(block):
                    if span_ns[0] <= block.host_ns < span_ns[1]:
                        heard_of[samples.channel].append(samples)
            stamped = signals.stamped_by([block for block in within if block.is_data])
    except RecoilDaqError as error:
        return [ChannelHeard(source.name, "", "", 0.0, None, None, "fail", str(error))]
    listened_s = (span_ns[1] - span_ns[0]) / 1e9
    heard = []
    for channel in source.channels:
        values = heard_of.of(channel.name)
        mean, noise = (float(values.mean()), float(values.std())) if values.size else (None, None)
        verdict, finding = _judge(channel, values, anything, counters, signals.unheard(channel, counters))
        heard.append(
            ChannelHeard(
                source.name, channel.name, channel.unit, values.size / listened_s, mean, noise, verdict, finding,
                value=channel.shown(float(values[-1]), digits=3) if values.size and np.isfinite(values[-1]) else "",
                noise_shown="" if noise is None else channel.shown(noise, span=True, digits=3),
                noise_of_range=None if noise is None or channel.range is None else noise / np.ptp(channel.range).item(),
                stamped_by=stamped if values.size else "",
            )
        )  # fmt: skip
    return heard


def _judge(
    channel: LiveChannel, values: Array, anything: bool, counters: Counters, unheard: str
) -> tuple[Verdict, str]:
    """Say what speaks against a channel, the worst first; `unheard` is why nothing of it may have come."""
    if not anything:
        return "fail", "the device is silent: check its power, its cable and its bit rate"
    if values.size < LEAST_SAMPLES:
        return "fail", unheard
    if not np.isfinite(values).all():
        return "fail", "some samples are no numbers: check the framing"
    mean, noise = float(values.mean()), float(values.std())
    share = "there, and no range is declared to judge it by"
    if channel.range is not None:
        (low, high), (least, most) = channel.range, allowed(channel.range)
        middle, half = (low + high) / 2, (high - low) / 2
        if not least <= mean <= most:
            return "fail", f"rests at {channel.shown(mean)}, outside of its range: check the unit and the wiring"
        # a one-sided gauge rests at the end of its range that is zero
        at_zero = (mean < middle and least < low) or (mean > middle and most > high)
        if abs(mean - middle) > NEAR_RANGE * half and not at_zero:
            return "warn", f"rests at {channel.shown(mean)}, at the end of its range: check zero and wiring"
        share = f"noise is {100 * noise / (high - low):.2g} % of its range"
    if np.ptp(values) == 0:
        return "warn", f"always {channel.shown(mean)}: sensor not connected?"
    # a stream that is joined in its middle begins with bytes of half a frame
    lost = replace(counters, skipped_bytes=0)
    if lost_anything(lost):
        return "warn", f"{losses_of(lost)}: check the cable and the bus load"
    return "ok", share
