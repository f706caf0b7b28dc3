"""Instants of the physics that a channel's samples show: its stamps, laid on the source's beat, less the chain's delay.

Whatever compares channels of two clocks takes their instants from here, so that a clock's alignment and the signals
that are mapped by it mean the same.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.channel import Channel
from recoil_acquisition.clocks.timebase import TimeBase, rounded_step_s
from recoil_acquisition.frames.count_cycle import CountCycle, find_cycle
from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_acquisition.readers.time.counted_beat import frame_numbers
from recoil_acquisition.shot.shot import ClockAlignment, Shot
from recoil_processing.alignment.aliasing import USUAL_ORDER
from recoil_processing.alignment.alignment_budget import with_uncertainty
from recoil_processing.alignment.delays import (
    Delay,
    DelayPart,
    declared_delay,
    exposure_delay,
    filter_delay,
    mount_delay,
    sum_of,
)
from recoil_processing.alignment.stamps import EvenStamps, even_stamps, share_at_stamps
from recoil_processing.filters.analog_filter import AnalogLowPass
from recoil_rigs.rig import ChannelSpec, Sensor, Source
from recoil_rigs.shots.fired_shot import FiredChannel, FiredShot

STAMPED_KINDS = ("can", "serial")
"""Kinds of source whose samples are stamped one by one, and late."""
RECORDER_KINDS = ("dewetron",)
"""Kinds of source whose stamps are those of one converter."""
JITTERS = 1e-4
"""Share of a step from which on stamps jitter, and are not just rounded."""
SURELY = 2.0
"""Standard uncertainties by which the signals must tell that samples were taken at the stamps."""
MOST_REMEMBERED = 100_000
"""Stamps of which the beat is remembered; of more it is found anew each time, and takes no memory."""


@dataclass(frozen=True, eq=False)
class Instants(ReadOnlyArrays):
    """Instants of a channel's samples, on its source's clock.

    Attributes
    ----------
    times_s : ndarray, shape (n_samples,)
        Times of the physics: on the source's even beat where it has one, the delay taken off.
    stamps
        Figures of how the beat was found; ``line`` is ``none`` where the stamps are taken as they are, and
        ``scatter_s`` then what they jitter by about a beat.
    delay
        Delay that was taken off.
    """

    times_s: Array
    stamps: EvenStamps
    delay: Delay

    @property
    def u_s(self) -> float:
        """Standard uncertainty that all of them share, seconds."""
        return math.hypot(self.delay.u_s, self.stamps.u_line_s)

    def stamps_to_json(self) -> dict[str, Any]:
        """Return how the beat was found, in JSON types; nothing but the line where there is none."""
        stamps = self.stamps
        if not stamps.even:
            return {"line": stamps.line} | ({"scatter_s": stamps.scatter_s} if stamps.scatter_s else {})
        return {
            "line": stamps.line,
            "step_s": stamps.step_s,
            "scatter_s": stamps.scatter_s,
            "wait_s": stamps.wait_s,
            "u_line_s": stamps.u_line_s,
        }


def delay_of(spec: ChannelSpec, source: Source) -> Delay:
    """Return what the rig declares of the delay between the physics and a channel's stamps.

    Parameters
    ----------
    source
        Source of the channel.
    """
    sensor = spec.sensor
    parts = []
    # a delay that is declared is that of the whole chain, the filter's included; 0 is stated by who knows it
    if "delay_s" in sensor.model_fields_set or sensor.filter_hz is None:
        parts.append(declared_delay(sensor.delay_s, sensor.u_delay_s or 0.0))
    else:
        parts.append(filter_delay(sensor.filter_hz, sensor.filter_type, sensor.filter_order, sensor.u_delay_s))
    if spec.u_line_s:
        parts.append(DelayPart("orifice or line", 0.0, spec.u_line_s))
    if sensor.resonance_hz is not None and sensor.resonance_damping is not None:
        parts.append(mount_delay(sensor.resonance_hz, sensor.resonance_damping))
    if source.exposure_s is not None:
        parts.append(exposure_delay(source.exposure_s, source.exposure_stamp))
    return sum_of(parts)


def anti_alias_filter(sensor: Sensor) -> AnalogLowPass | None:
    """Return a sensor's anti-alias filter as far as it is declared; of second order where its order is not."""
    if sensor.filter_hz is None:
        return None
    if sensor.filter_type is None:
        return AnalogLowPass(sensor.filter_hz, "butterworth", USUAL_ORDER)
    return AnalogLowPass(sensor.filter_hz, sensor.filter_type, sensor.filter_order or USUAL_ORDER)


def instants(channel: Channel, fired: FiredShot) -> Instants:
    """Find when the physics was that a channel's samples show.

    Stamps of a bus or a port lie above the source's beat by a wait of their own; they are laid on the
    line along their lower edge, and gaps are counted by the source's message counter where a channel of the
    shot has it. Of a recorder whose stamps jitter about an even beat the converter is taken to be clocked, and its
    samples lie on the beat, unless the shot's signals show that they were taken at the stamps; the whole jitter is in
    the uncertainty. Stamps that have no beat are the instants, and so are those of other sources.

    Parameters
    ----------
    fired
        Shot, which may have the counter's channel, and its rig.
    """
    own = fired.channels[channel.name]
    source = own.source
    delay = delay_of(own.spec, source)
    stamps = EvenStamps(channel.time_base.times_s, "none")
    if source.kind in RECORDER_KINDS and channel.time_base.stamps_s is not None:
        stamps = _recorded(channel, fired.shot)
    elif source.kind in STAMPED_KINDS:
        stamps = _beat(channel.time_base.times_s, _counts(channel, own, fired))
        if not stamps.even:
            # a counter that was reset or read wrongly contradicts the stamps
            stamps = _beat(channel.time_base.times_s)
    return Instants(np.asarray(stamps.times_s - delay.delay_s), stamps, delay)


def jitter_s(channel: Channel, fired: FiredShot) -> float:
    """Return the standard deviation of a recorder's stamps about their beat, of which the samples may have a part."""
    own = fired.channels.get(channel.name)
    if own is None or own.source.kind not in RECORDER_KINDS:
        return 0.0
    return instants(channel, fired).stamps.scatter_s


def with_chains(found: ClockAlignment, sides: Sequence[tuple[Channel, Instants]], *u_s: float) -> ClockAlignment:
    """Return an alignment with what its method cannot know: the delays of both sides, and how the beat was found.

    Parameters
    ----------
    sides
        Channels that it was found by and their instants, the source's first.
    *u_s
        Standard uncertainties of the offset beside the method's own.
    """
    delays = [part for channel, side in sides for part in side.delay.to_json(channel.name)]
    u_offset_s = math.hypot(found.u_offset_s, *u_s)
    return with_uncertainty(found, u_offset_s, delays=delays, stamps=sides[0][1].stamps_to_json())


_JITTER: WeakKeyDictionary[Shot, dict[TimeBase, EvenStamps]] = WeakKeyDictionary()
"""Beat of a recorder's jittering stamps, by shot and time base: all of its channels ask."""


def _recorded(channel: Channel, shot: Shot) -> EvenStamps:
    """Understand a recorder's stamps: on the beat, or at the stamps where the signals say so or there is no beat."""
    known = _JITTER.setdefault(shot, {})
    base = next((one for one in known if one.same_instants(channel.time_base)), channel.time_base)
    if base not in known:
        known[base] = _understood(base, [c for c in shot.channels.values() if c.time_base.same_instants(base)])
    return known[base]


def _understood(base: TimeBase, channels: Sequence[Channel]) -> EvenStamps:
    # stamps that are rounded to more than half a step are counted by their numbers, not by their steps
    counts = None if rounded_step_s(base.times_s) is None else np.arange(base.count)
    beat = _beat(base.times_s, counts)
    if not beat.even or beat.scatter_s <= JITTERS * beat.step_s:
        return beat
    places = np.round((beat.times_s - beat.times_s[0]) / beat.step_s).astype(np.int64)
    share, u = share_at_stamps([c.measured for c in channels], base.times_s - beat.times_s, places, beat.step_s)
    u_s = math.hypot(beat.u_line_s, beat.scatter_s)
    if share - 0.5 > SURELY * u:
        return EvenStamps(base.times_s, "none", beat.step_s, beat.scatter_s, 0.0, u_s)
    return replace(beat, u_line_s=u_s)


def _beat(times_s: Array, counts: NDArray[np.int64] | None = None) -> EvenStamps:
    if not 0 < times_s.size <= MOST_REMEMBERED:
        return even_stamps(times_s, counts)
    return _remembered(times_s.tobytes(), None if counts is None else counts.tobytes())


@lru_cache(maxsize=16)
def _remembered(stamps: bytes, counts: bytes | None) -> EvenStamps:
    """Find the beat of stamps once: the channels of a message share them, and each comparison of clocks asks anew.

    By their bytes: who made an array may still write to it.
    """
    return even_stamps(np.frombuffer(stamps), None if counts is None else np.frombuffer(counts, dtype=np.int64))


def _counts(channel: Channel, own: FiredChannel, fired: FiredShot) -> NDArray[np.int64] | None:
    """Return the unwrapped message counter of a channel's samples; None where the shot has none that can be read."""
    source = own.source
    counters, modulo = source.counters or (), None
    message = own.spec.signal.rpartition(".")[0]
    if source.framing is not None and isinstance(source.framing.get("counter"), dict):
        table = source.framing["counter"]
        counters, modulo = (str(table.get("field")),), table.get("modulo")
    for other in fired.channels.values():
        counter = other.recorded
        if (
            other.source.name != source.name
            or other.spec.signal not in counters
            or other.spec.signal.rpartition(".")[0] != message
            or not counter.time_base.same_instants(channel.time_base)
        ):
            continue
        values = np.asarray(counter.samples, dtype=np.float64)
        held = np.isfinite(values)
        if np.any(values[held] != np.round(values[held])):
            return None
        whole = np.where(held, values, 0.0).astype(np.int64)
        return frame_numbers(whole, held, CountCycle(modulo) if isinstance(modulo, int) else find_cycle(whole[held]))
    return None
