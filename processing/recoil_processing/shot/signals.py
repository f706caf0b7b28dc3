"""Signals that the equation of motion needs, on one grid of instants of the reference clock.

Here, and only here, channels of different clocks come together: each is evaluated at the grid's
instants through its clock's alignment. Before that the sensors' offsets are taken off, from what is
known of the mechanism at rest: angular rates and gauge pressures of breech and brake are zero, an
accelerometer feels gravity resolved on its axis. The recuperator's pressure is not zero at rest and
is left as it is. What is mended of the samples on the way is listed with them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from recoil_acquisition.channel import Channel
from recoil_acquisition.clocks.timebase import TimeBase
from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_acquisition.shot.shot import ClockAlignment
from recoil_processing.gaps import LONGEST_STEP, bridge
from recoil_processing.noise import robust_sigma, welch_satterthwaite
from recoil_processing.outliers import agreeing
from recoil_processing.shot.channel_repair import ChannelRepair, level_samples, mend_samples
from recoil_processing.shot.error_source import ErrorSource, SourceKind
from recoil_processing.shot.instants import instants
from recoil_processing.shot.mechanism_onset import onset_s
from recoil_processing.shot.onset import LEAST_LEVEL_SAMPLES
from recoil_rigs.shots.fired_shot import FiredShot

BASELINE_MARGIN_S = 1e-3
"""Time kept between the pre-trigger baseline and the onset of force."""
LEAST_BASELINE_S = 5e-3
"""Length below which there is not enough pre-trigger baseline to take offsets from."""


@dataclass(frozen=True)
class Offset:
    """Offset that was taken off one channel.

    Attributes
    ----------
    value, u
        Offset and its standard uncertainty, in SI units of the channel; the latter is the noise's over the root of the
        samples, infinite where there was no pre-trigger baseline, and zero where nothing is known of the channel at
        rest.
    noise
        Standard deviation per sample in the pre-trigger baseline, SI; NaN where there was none.
    degrees_of_freedom
        Degrees of freedom of `u`: the samples of the baseline less one; infinite where `u` is not of any.
    """

    value: float
    u: float
    noise: float
    degrees_of_freedom: float = math.inf


@dataclass(frozen=True, eq=False)
class GaugeReading(ReadOnlyArrays):
    """Reading of one of several gauges of a pressure, Pa, without its offset, shape (n,)."""

    channel: str
    samples: Array
    offset: Offset


@dataclass(frozen=True, eq=False)
class Signals(ReadOnlyArrays):
    """Signals on one uniform grid of the reference clock; SI; NaN where an instrument lost samples.

    Attributes
    ----------
    start_s, step_s
        Start and step of the grid.
    series : mapping of str to ndarray, shape (n,)
        Series by role, a body's forces by their names; only what the shot has. Where several gauges measured one
        pressure it is their mean.
    offsets
        Offsets that were taken off, as the series.
    baseline_s
        Begin and end of the pre-trigger baseline; equal if there is none.
    onset_s
        First instant of force.
    repairs
        Repairs of the samples, in the order in which they were done.
    left : mapping of ErrorSource to ndarray, shape (n,)
        Errors of standard size that repairs may have left in the series, each with the series that it is in.
    gauges
        Series of each gauge alone, by role, where several gauges measured it.
    unused
        Channels of such a role that lost more samples than another, or whose clock could not be aligned.
    """

    start_s: float
    step_s: float
    series: Mapping[str, Array]
    offsets: Mapping[str, Offset]
    baseline_s: tuple[float, float]
    onset_s: float
    repairs: tuple[ChannelRepair, ...] = ()
    left: Mapping[ErrorSource, Array] = field(default_factory=dict)
    gauges: Mapping[str, tuple[GaugeReading, ...]] = field(default_factory=dict)
    unused: tuple[str, ...] = ()

    @property
    def times_s(self) -> Array:
        """The instants, shape (n,)."""
        count = next(iter(self.series.values())).size
        return np.asarray(self.start_s + self.step_s * np.arange(count))

    @property
    def in_baseline(self) -> Flags:
        """Samples of the pre-trigger baseline, shape (n,)."""
        times = self.times_s
        return np.asarray((times >= self.baseline_s[0]) & (times < self.baseline_s[1]))

    @property
    def rate_hz(self) -> float:
        """Samples per second of the grid."""
        return 1.0 / self.step_s

    def get(self, role: str, otherwise: float = 0.0) -> Array:
        """Return a series, or a constant where the shot has no such channel."""
        if role in self.series:
            return self.series[role]
        return np.full(next(iter(self.series.values())).size, otherwise)


def collect_signals(fired: FiredShot, alignments: Mapping[str, ClockAlignment]) -> Signals:
    """Bring the channels of a shot that the equation of motion needs onto one grid.

    Parameters
    ----------
    fired
        Shot and rig: channels, mechanism, and the sensors' delays and time constants.
    alignments
        Alignments by clock; a channel whose clock is missing here, or failed, is left out.

    Raises
    ------
    IdentificationError
        If no channel of the reference clock can carry the grid, or it shows no shot.
    """
    mechanism = fired.rig.mechanism
    names, carriers = mechanism.series(fired.rig.forces), mechanism.grid_series(fired.rig.forces)
    carrier = next(
        (
            one.recorded
            for name in carriers
            for one in fired.of_series(name)[:1]
            if one.recorded.time_base.clock == fired.shot.reference_clock
        ),
        None,
    )
    if carrier is None:
        raise IdentificationError(
            "nothing to build the regression's grid on",
            expected=f"a channel of role {' or '.join(carriers)} on the reference clock {fired.shot.reference_clock!r}",
            found=", ".join(f"{c.role} on {c.time_base.clock}" for c in fired.shot.channels.values() if c.role)
            or "no roles",
            remedy="declare its role in the rig file",
        )
    base = carrier.time_base
    if base.count < LEAST_LEVEL_SAMPLES:
        raise IdentificationError(
            f"{carrier.name} has {base.count} samples",
            expected="a record of the shot",
            remedy="check its file, or record faster",
        )
    start, step, count = _grid_of(carrier, fired)
    grid = np.asarray(start + step * np.arange(count), dtype=np.float64)
    read: dict[str, Array] = {}
    left_in: dict[str, dict[str, Array]] = {}
    repairs: list[ChannelRepair] = []
    by_role: dict[str, list[str]] = {}
    unused: list[tuple[str, str]] = []
    for series_name, one in ((name, one) for name in names for one in fired.of_series(name)):
        channel = one.recorded
        alignment = alignments.get(channel.time_base.clock)
        # what only helps to tell a speed must not be guessed
        doubted = ("failed", "ambiguous") if series_name in mechanism.sure_roles else ("failed",)
        if channel.time_base.clock != fired.shot.reference_clock and (alignment is None or alignment.status in doubted):
            unused.append((series_name, channel.name))
            continue
        mended = mend_samples(channel, one.spec, one.source.kind)
        samples = mended.samples
        if one.source.kind == "camera" and series_name in mechanism.sure_roles:
            samples = agreeing(channel.time_base.times_s, samples)
        dated = replace(at_instants(channel, fired), samples=samples)
        read[channel.name] = on_grid(dated, alignment, grid)
        left_in[channel.name] = {
            cause: np.array([bridge(on_grid(replace(dated, samples=one), alignment, grid)) for one in shapes])
            for cause, shapes in mended.left.items()
        }
        by_role.setdefault(series_name, []).append(channel.name)
        if mended.repairs:
            times = dated.time_base.times_s if alignment is None else alignment.to_reference(dated.time_base.times_s)
            repairs += [ChannelRepair.of(channel.name, channel.role, repair, times) for repair in mended.repairs]
    for role, channels in by_role.items():
        lost = {name: int(np.count_nonzero(~np.isfinite(read[name]))) for name in channels}
        by_role[role] = [name for name in channels if lost[name] == min(lost.values())]
        unused += [(role, name) for name in channels if name not in by_role[role]]
    first = {role: read[channels[0]] for role, channels in by_role.items()}
    onset = onset_s(mechanism, grid, first, [force.name for force in fired.rig.forces])
    baseline_end = max(start, onset - BASELINE_MARGIN_S)
    baseline_s = (start, baseline_end) if baseline_end - start >= LEAST_BASELINE_S else (start, start)
    series: dict[str, Array] = {}
    offsets: dict[str, Offset] = {}
    left: dict[ErrorSource, Array] = {}
    gauges: dict[str, tuple[GaugeReading, ...]] = {}
    in_baseline = (grid >= baseline_s[0]) & (grid < baseline_s[1])
    for role, channels in by_role.items():
        found = []
        for name in channels:
            samples, spec = read[name], fired.channels[name].spec
            baseline = samples[in_baseline & np.isfinite(samples)]
            noise = robust_sigma(baseline)
            if baseline.size >= LEAST_LEVEL_SAMPLES:
                level = level_samples(fired.shot.channels[name], samples, step, in_baseline, spec, noise)
                samples = level.samples
                repairs += [ChannelRepair.of(name, role, repair, grid) for repair in level.repairs]
                left_in[name] |= level.left
            for cause, shapes in left_in[name].items():
                of_gauge = "" if len(channels) == 1 else f" of {name}"
                left |= {
                    _left_source(role, cause, number, len(shapes), of_gauge): shape / len(channels)
                    for number, shape in enumerate(shapes, start=1)
                }
            found.append(GaugeReading(name, *_at_rest(samples, in_baseline, mechanism.at_rest.get(role), noise)))
        series[role], offsets[role] = found[0].samples, found[0].offset
        if len(found) > 1:
            gauges[role] = tuple(found)
            series[role] = np.asarray(np.mean([one.samples for one in found], axis=0))
            offsets[role] = _of_mean([one.offset for one in found])
    return Signals(
        *(start, step, series, offsets, baseline_s, onset, tuple(repairs), left),
        gauges=gauges,
        # what was left out and has no other in its place is missing, not set aside
        unused=tuple(name for series_name, name in unused if series_name in by_role),
    )


def _left_source(role: str, cause: str, number: int, count: int, of_gauge: str) -> ErrorSource:
    """Return the source of an error that a repair may have left; one that has several shapes is of a bridge."""
    if count == 1:
        return ErrorSource(SourceKind.REPAIR, role, f"{cause}{of_gauge}")
    return ErrorSource(SourceKind.BRIDGED_SHAPE, role, f"{number}{of_gauge}")


def _grid_of(carrier: Channel, fired: FiredShot) -> tuple[float, float, int]:
    """Return start, step and number of the even instants that a channel's samples lie on, or lie among."""
    base = carrier.time_base
    if base.step_s is not None:
        return base.start_s, base.step_s, base.count
    found = instants(carrier, fired)
    start_s, end_s = (float(found.times_s[at] + found.delay.delay_s) for at in (0, -1))
    if found.stamps.even:
        return start_s, found.stamps.step_s, round((end_s - start_s) / found.stamps.step_s) + 1
    step_s = 1.0 / base.rate_hz
    return start_s, step_s, int((end_s - start_s) / step_s) + 1


def _of_mean(offsets: Sequence[Offset]) -> Offset:
    """Return the offset of the mean of several gauges, whose noise is independent."""
    count = len(offsets)
    value, u = math.fsum(one.value for one in offsets) / count, math.hypot(*(one.u for one in offsets)) / count
    freedom = welch_satterthwaite((one.u, one.degrees_of_freedom) for one in offsets)
    return Offset(value, u, math.hypot(*(one.noise for one in offsets)) / count, freedom)


def at_instants(channel: Channel, fired: FiredShot) -> Channel:
    """Return a channel whose stamps are those of the physics, see `recoil_processing.shot.instants`."""
    base, found = channel.time_base, instants(channel, fired)
    if not found.stamps.even and found.delay.delay_s == 0:
        return channel
    return replace(channel, time_base=TimeBase.stamped(base.clock, found.times_s, base.absolute_start))


def on_grid(channel: Channel, alignment: ClockAlignment | None, grid_s: Array, *, longest_gap_s: float = 0.0) -> Array:
    """Evaluate a channel at instants of the reference clock.

    Parameters
    ----------
    alignment
        Alignment of the channel's clock; None for the reference clock.
    grid_s : ndarray, shape (n,)
    longest_gap_s
        Length of a gap that may be bridged although it is longer than `LONGEST_STEP`.

    Returns
    -------
    ndarray, shape (n,)
        Cubic interpolation between neighbours; NaN beyond the record and within gaps longer than
        `LONGEST_STEP`. Samples at the grid's very instants are taken as they are, lost ones NaN.
    """
    times = channel.time_base.times_s
    if alignment is not None:
        times = alignment.to_reference(times)
    samples = channel.measured
    if times.shape == grid_s.shape and np.allclose(times, grid_s, rtol=0, atol=1e-9):
        return samples.copy()
    present = np.isfinite(samples)
    t, y = times[present], samples[present]
    if t.size < 4:
        return np.full(grid_s.shape, np.nan)
    # only here: a shot whose channels share one grid is ready half a second sooner
    from scipy.interpolate import CubicSpline

    values = CubicSpline(t, y)(grid_s)
    step = float(np.median(np.diff(t)))
    after = np.clip(np.searchsorted(t, grid_s, side="right"), 1, t.size - 1)
    between = np.minimum(np.abs(grid_s - t[after - 1]), np.abs(grid_s - t[after])) > 1e-9
    in_gap = (t[after] - t[after - 1] > max(LONGEST_STEP * step, longest_gap_s)) & between
    values[in_gap | (grid_s < t[0] - 1e-9) | (grid_s > t[-1] + 1e-9)] = np.nan
    return np.asarray(values)


def _at_rest(samples: Array, in_baseline: Flags, static: float | None, noise: float) -> tuple[Array, Offset]:
    """Take a channel's offset off."""
    baseline = samples[in_baseline]
    baseline = baseline[np.isfinite(baseline)]
    if baseline.size < LEAST_LEVEL_SAMPLES:
        return samples, Offset(0.0, math.inf if static is not None else 0.0, noise)
    if static is None:
        return samples, Offset(0.0, 0.0, noise)
    offset = float(np.mean(baseline)) - static
    u = float(np.std(baseline)) / math.sqrt(baseline.size)
    return samples - offset, Offset(offset, u, noise, baseline.size - 1.0)
