"""What the equation of motion needs, on one grid of instants of the reference clock.

Here, and only here, channels of different clocks come together: each is evaluated at the grid's
instants through its clock's alignment. Before that the sensors' offsets are taken off, from what is
known of the mechanism at rest: angular rates and gauge pressures of breech and brake are zero, an
accelerometer feels gravity resolved on its axis. The recuperator's pressure is not zero at rest and
is left as it is.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from daq.channel import Channel
from daq.errors import IdentificationError
from daq.shot import ClockAlignment, Shot
from processing.motion_alignment import integrate
from processing.noise import noise_sigma, robust_sigma
from rigs.mechanism import Mechanism
from rigs.rig import Rig

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

QUIET_MARGIN_S = 1e-3
"""Kept between the quiet part and the onset of force."""
LEAST_QUIET_S = 5e-3
"""Below this there is not enough silence to take offsets from."""
ONSET_SIGMA = 6.0
"""Noise multiples that count as force."""


@dataclass(frozen=True)
class Offset:
    """What was taken off one channel.

    Attributes
    ----------
    value, u : float
        In SI units of the channel; the uncertainty is the noise's over the root of the samples.
    noise : float
        Standard deviation per sample in the quiet part, SI.
    """

    value: float
    u: float
    noise: float


@dataclass(frozen=True, eq=False)
class Signals:
    """Signals on one uniform grid of the reference clock; SI; NaN where an instrument lost samples.

    Attributes
    ----------
    start_s, step_s : float
        The grid.
    series : mapping of str to ndarray, shape (n,)
        By role; only roles that the shot has.
    offsets : mapping of str to Offset
        By role.
    quiet_s : tuple of float
        Begin and end of the silence before the shot; equal if there is none.
    onset_s : float
        First instant of force.
    """

    start_s: float
    step_s: float
    series: Mapping[str, Array]
    offsets: Mapping[str, Offset]
    quiet_s: tuple[float, float]
    onset_s: float

    @property
    def times_s(self) -> Array:
        """The instants, shape (n,)."""
        count = next(iter(self.series.values())).size
        return np.asarray(self.start_s + self.step_s * np.arange(count))

    @property
    def rate_hz(self) -> float:
        """Samples per second of the grid."""
        return 1.0 / self.step_s

    def get(self, role: str, otherwise: float = 0.0) -> Array:
        """Return a series, or a constant where the shot has no such channel."""
        if role in self.series:
            return self.series[role]
        return np.full(next(iter(self.series.values())).size, otherwise)


GRID_ROLES = ("recoil_acceleration", "breech_pressure")
SERIES_ROLES = (
    "recoil_acceleration", "carriage_acceleration_x", "carriage_acceleration_y", "carriage_rate", "tipping_rate",
    "breech_pressure", "brake_pressure", "recuperator_pressure",
)  # fmt: skip


def static_value(role: str, mechanism: Mechanism) -> float | None:
    """Return what a channel reads at rest in battery, SI; None where that is not known.

    The recoiling part's accelerometer points along -e5, so it feels ``-g sin(phi20)``; the carriage's
    feel ``g sin(phi10)`` and ``g cos(phi10)`` (specific force; `rigs.mechanism.carriage_specific_force`).
    """
    g = mechanism.g
    return {
        "recoil_acceleration": -g * math.sin(mechanism.phi20),
        "carriage_acceleration_x": g * math.sin(mechanism.phi10),
        "carriage_acceleration_y": g * math.cos(mechanism.phi10),
        "carriage_rate": 0.0,
        "tipping_rate": 0.0,
        "breech_pressure": 0.0,
        "brake_pressure": 0.0,
    }.get(role)


def collect_signals(shot: Shot, rig: Rig, alignments: Mapping[str, ClockAlignment]) -> Signals:
    """Bring the channels of a shot that the equation of motion needs onto one grid.

    Parameters
    ----------
    shot : Shot
    rig : Rig
        For the mechanism and the sensors' delays and time constants.
    alignments : mapping of str to ClockAlignment
        By clock; a channel whose clock is missing here, or failed, is left out.

    Returns
    -------
    Signals

    Raises
    ------
    IdentificationError
        If no channel of the reference clock can carry the grid.
    """
    carrier = next(
        (c for role in GRID_ROLES if (c := shot.by_role(role)) and c.time_base.clock == shot.reference_clock), None
    )
    if carrier is None:
        raise IdentificationError(
            "nothing to build the regression's grid on",
            expected=f"a channel of role {' or '.join(GRID_ROLES)} on the reference clock {shot.reference_clock!r}",
            found=", ".join(f"{c.role} on {c.time_base.clock}" for c in shot.channels.values() if c.role) or "no roles",
            remedy="declare its role in the rig file",
        )
    base = carrier.time_base
    start, step = base.start_s, base.step_s or float(np.median(np.diff(base.times_s)))
    count = base.count if base.step_s else int((base.end_s - start) / step) + 1
    grid = np.asarray(start + step * np.arange(count), dtype=np.float64)
    series: dict[str, Array] = {}
    for role in SERIES_ROLES:
        channel = shot.by_role(role)
        if channel is None:
            continue
        alignment = alignments.get(channel.time_base.clock)
        if channel.time_base.clock != shot.reference_clock and (alignment is None or alignment.status == "failed"):
            continue
        series[role] = on_grid(channel, alignment, grid, rig.channel(channel.name).sensor.delay_s)
    onset = find_onset(grid, series)
    quiet_end = max(start, onset - QUIET_MARGIN_S)
    quiet = (start, quiet_end) if quiet_end - start >= LEAST_QUIET_S else (start, start)
    offsets: dict[str, Offset] = {}
    for role in list(series):
        time_constant = rig.channel(_channel(shot, role).name).sensor.time_constant_s
        series[role], offsets[role] = _at_rest(
            series[role], (grid >= quiet[0]) & (grid < quiet[1]), static_value(role, rig.mechanism), time_constant, step
        )
    return Signals(start, step, series, offsets, quiet, onset)


def on_grid(channel: Channel, alignment: ClockAlignment | None, grid_s: Array, delay_s: float) -> Array:
    """Evaluate a channel at instants of the reference clock.

    Parameters
    ----------
    channel : Channel
    alignment : ClockAlignment or None
        None for a channel of the reference clock.
    grid_s : ndarray, shape (n,)
    delay_s : float
        By which the chain delays the signal; the stamps are later than the physics by it.

    Returns
    -------
    ndarray, shape (n,)
        Cubic interpolation between neighbours; NaN beyond the record and within gaps longer than
        two and a half steps.
    """
    from scipy.interpolate import CubicSpline

    times = channel.time_base.times_s - delay_s
    if alignment is not None:
        times = alignment.to_reference(times)
    samples = np.asarray(channel.samples, dtype=np.float64)
    if times.shape == grid_s.shape and np.allclose(times, grid_s, rtol=0, atol=1e-9):
        return samples.copy()
    present = np.isfinite(samples)
    t, y = times[present], samples[present]
    if t.size < 4:
        return np.full(grid_s.shape, np.nan)
    values = CubicSpline(t, y)(grid_s)
    step = float(np.median(np.diff(t)))
    after = np.clip(np.searchsorted(t, grid_s, side="right"), 1, t.size - 1)
    in_gap = (t[after] - t[after - 1] > 2.5 * step) & (np.abs(grid_s - t[after - 1]) > 1e-12)
    values[in_gap | (grid_s < t[0] - 1e-12) | (grid_s > t[-1] + 1e-12)] = np.nan
    return np.asarray(values)


def find_onset(times_s: Array, series: Mapping[str, Array]) -> float:
    """Find the first instant of force: breech pressure if it was measured, acceleration otherwise.

    The first sample above a fiftieth of the peak, traced back to where the signal last lay within
    `ONSET_SIGMA` of its noise.

    Raises
    ------
    IdentificationError
        If the signal never leaves its noise.
    """
    role = "breech_pressure" if "breech_pressure" in series else "recoil_acceleration"
    signal = np.nan_to_num(series[role] - np.nanmedian(series[role][: max(8, series[role].size // 50)]))
    sigma = max(noise_sigma(series[role][: max(64, series[role].size // 50)]), 1e-12)
    peak = float(np.max(signal))
    if peak < 20 * sigma:
        raise IdentificationError(
            f"{role} shows no shot: its peak is {peak / sigma:.1f} times its noise",
            expected="at least 20 times",
            remedy="check that the file is of this shot and the sensor was connected",
        )
    above = int(np.argmax(signal > max(0.02 * peak, ONSET_SIGMA * sigma)))
    silent = np.flatnonzero(signal[: above + 1] < 3 * sigma)
    return float(times_s[silent[-1]] if silent.size else times_s[0])


def _channel(shot: Shot, role: str) -> Channel:
    channel = shot.by_role(role)
    if channel is None:
        raise KeyError(role)
    return channel


def _at_rest(
    samples: Array, quiet: Flags, static: float | None, time_constant_s: float | None, step_s: float
) -> tuple[Array, Offset]:
    """Take a channel's offset off, and undo the droop of an AC-coupled chain.

    A charge amplifier's first-order high-pass ``s / (s + 1/T)`` is inverted exactly by
    ``y + integral(y) / T`` from rest.
    """
    silence = samples[quiet]
    silence = silence[np.isfinite(silence)]
    noise = robust_sigma(silence) if silence.size else math.nan
    if silence.size < 8 or static is None:
        return samples, Offset(0.0, math.inf if static is not None else 0.0, noise)
    offset = float(np.mean(silence)) - static
    u = float(np.std(silence)) / math.sqrt(silence.size)
    corrected = samples - offset
    if time_constant_s is not None:
        moving = np.nan_to_num(corrected - static)
        corrected = corrected + integrate(moving, step_s) / time_constant_s
    return corrected, Offset(offset, u, noise)
