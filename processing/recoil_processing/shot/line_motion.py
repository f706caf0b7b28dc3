"""The motion of a body on a straight line, by whatever of it was recorded.

An accelerometer on the body reads the specific force along the line, ``x'' + g sin(phi20)``. Where there is none, the
speed or the displacement is differentiated; what that leaves of noise the low-pass of both sides of the equation of
motion takes off. A record may begin while the body moves and hold several strokes; a rest is found where it begins or
ends with one.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_processing.double_integral import integrate
from recoil_processing.filters import LowPass
from recoil_processing.gaps import bridge, first_of_run
from recoil_processing.motion.derivative import first_derivative, second_derivative
from recoil_processing.noise import noise_sigma, robust_sigma

SMOOTH_SHARE = 0.1
"""Cut-off of a speed that is differentiated of a displacement, share of the rate."""
REST_SHARE, REST_SAMPLES = 0.02, 24
"""Share of a record at either end, and its samples at the least, by which a rest is told."""
QUICKER = 0.5
"""Cut-off of an acceleration that is differentiated, by which a rest is told, times the time in which a force changes:
three times its frequency."""
REST_LEVEL = 0.02
"""Share of the largest acceleration, or force, that a rest may move by."""
STEADY = 2.0
"""Multiple of the noise of neighbours that a rest may spread over where that is more."""
ZERO_LEVEL = 0.05
"""Share of the largest acceleration that the reading at rest may be off by: a motion that begins with an even
acceleration is no rest."""
NOISES = 6.0
"""Multiples of its noise that count as a motion, or a force."""
IN_A_ROW = 3
"""Samples in a row that must."""
TURNING_SHARE, TURNING_NOISES = 0.003, 3.0
"""Speed over which the friction turns: a share of the largest speed, or multiples of what the speed is
uncertain by."""


@dataclass(frozen=True, eq=False)
class LineMotion(ReadOnlyArrays):
    """Motion of a body along its line, on the grid of the signals.

    Attributes
    ----------
    role
        Role of what told the acceleration.
    acceleration_m_s2 : ndarray, shape (n,)
        Specific force along the line, as recorded; NaN where lost.
    velocity_m_s, travel_m : ndarray, shape (n,)
        Speed and place along the line.
    speed_told
        Whether a speed or a displacement was recorded; else the speed is the acceleration's integral, from rest on.
    turning_m_s
        Speed over which the friction turns from one direction to the other.
    driven : ndarray of bool, shape (n,)
        Samples at which the body moves, or is free to.
    interval_s
        First and last instant of force or motion.
    """

    role: str
    acceleration_m_s2: Array
    velocity_m_s: Array
    travel_m: Array
    speed_told: bool
    turning_m_s: float
    driven: Flags
    interval_s: tuple[float, float]

    @classmethod
    def of(
        cls,
        times_s: Array,
        series: Mapping[str, Array],
        forces: Sequence[Array],
        static_m_s2: float,
        u_zero_m_s2: float,
    ) -> LineMotion:
        """Return the motion that the series of a record tell.

        Parameters
        ----------
        times_s : ndarray, shape (n,)
            Instants, evenly spaced.
        series : mapping of str to ndarray, shape (n,)
            Series of the motion by role, offsets taken off.
        forces : sequence of ndarray, shape (n,)
            Readings of the forces, which tell with the motion where the body is driven.
        static_m_s2
            Specific force along the line at rest.
        u_zero_m_s2
            Standard uncertainty of an accelerometer's zero, by which an integrated speed drifts.

        Raises
        ------
        IdentificationError
            If nothing was recorded of the motion.
        """
        step_s = float(times_s[1] - times_s[0])
        acceleration = acceleration_on_line(series, step_s, static_m_s2)
        if acceleration is None:
            raise IdentificationError(
                "no usable channel tells the motion of the body",
                expected="a role recoil_acceleration, recoil_velocity or recoil_displacement",
                remedy="declare its role in the rig file, or mend the alignment",
            )
        role = telling_role(series)
        interval_s = driven_s(times_s, series, forces, static_m_s2)
        begins_s, ends_s = driven_s(times_s, series, forces, static_m_s2, moves=True)
        driven = (times_s >= begins_s) & (times_s <= ends_s)
        felt = bridge(acceleration, otherwise=static_m_s2) - static_m_s2
        velocity = velocity_on_line(series, felt, step_s)
        told = velocity is not None
        if velocity is None:
            velocity = integrate(np.where(driven, felt, 0.0), step_s)
        travel = integrate(velocity, step_s)
        if _usable(series, "recoil_displacement"):
            travel = bridge(series["recoil_displacement"], otherwise=0.0)
        fastest = float(np.max(np.abs(velocity), initial=0.0))
        u_speed = noise_sigma(velocity) if told else u_zero_m_s2 * float(np.count_nonzero(driven)) * step_s
        if not np.isfinite(u_speed):
            u_speed = 0.0
        turning = max(TURNING_SHARE * fastest, TURNING_NOISES * u_speed, 1e-12)
        return cls(role, acceleration, velocity, travel, told, turning, driven, interval_s)

    @property
    def friction_direction(self) -> Array:
        """Force of a dry friction per newton of it, shape (n,): against the speed, turning smoothly where it turns."""
        return np.asarray(-np.tanh(self.velocity_m_s / self.turning_m_s) * self.driven)


DIFFERENTIATED = {"recoil_velocity": first_derivative, "recoil_displacement": second_derivative}
"""How the acceleration is told by what is none."""
_MOTIONS = ("recoil_acceleration", "recoil_velocity", "recoil_displacement")


def acceleration_on_line(series: Mapping[str, Array], step_s: float, static_m_s2: float) -> Array | None:
    """Return the specific force along the line by the first that was recorded of acceleration, speed and displacement.

    Parameters
    ----------
    series : mapping of str to ndarray, shape (n,)
        Series by role; lost samples NaN.
    static_m_s2
        Specific force at rest, which a derivative lacks.

    Returns
    -------
    ndarray, shape (n,), or None
        Samples that a lost one reaches are lost; None where nothing was recorded.
    """
    for role in _MOTIONS:
        if not _usable(series, role):
            continue
        samples = series[role]
        if role == "recoil_acceleration":
            return samples
        return np.asarray(DIFFERENTIATED[role](samples, step_s) + static_m_s2)
    return None


def velocity_on_line(series: Mapping[str, Array], felt_m_s2: Array, step_s: float) -> Array | None:
    """Return the speed along the line by what was recorded of it, m/s, shape (n,); None where nothing was.

    The speed itself; else, beside an accelerometer, its integral with the speed at the beginning and the constant error
    that the displacement tells; else the displacement's derivative.

    Parameters
    ----------
    series : mapping of str to ndarray, shape (n,)
        Series by role.
    felt_m_s2 : ndarray, shape (n,)
        Acceleration along the line.
    """
    if _usable(series, "recoil_velocity"):
        return bridge(series["recoil_velocity"], otherwise=0.0)
    if not _usable(series, "recoil_displacement"):
        return None
    displacement = series["recoil_displacement"]
    if _usable(series, "recoil_acceleration"):
        gained, since_s = integrate(felt_m_s2, step_s), step_s * np.arange(felt_m_s2.size)
        columns = np.column_stack([np.ones_like(since_s), since_s, since_s**2 / 2.0])
        known = np.isfinite(displacement)
        left = displacement - integrate(gained, step_s)
        _, begins, off = np.linalg.lstsq(columns[known], left[known], rcond=None)[0]
        return np.asarray(gained + begins + off * since_s)
    travel = bridge(displacement, otherwise=0.0)
    return first_derivative(LowPass(SMOOTH_SHARE / step_s).apply(travel, 1.0 / step_s), step_s)


def changes_in_s(force_n: Array, step_s: float) -> float:
    """Return the time in which a force changes: its spread over that of its slope; infinite where it stays the same."""
    slope = float(np.std(np.gradient(force_n, step_s)))
    return float(np.std(force_n)) / slope if slope > 0 else math.inf


def telling_role(series: Mapping[str, Array]) -> str:
    """Return the role of what tells an acceleration along the line; empty where nothing does."""
    return next((one for one in _MOTIONS if _usable(series, one)), "")


def driven_s(
    times_s: Array, series: Mapping[str, Array], forces: Sequence[Array], static_m_s2: float, *, moves: bool = False
) -> tuple[float, float]:
    """Return the first and the last instant at which a body on a line is driven or moves.

    A record that does not begin, or end, with a rest is driven from its first instant on, or to its last: that of what
    tells the motion. What must be differentiated is looked at as quick as its noise lets a rest be told, down to what
    the forces change in.

    Parameters
    ----------
    times_s : ndarray, shape (n,)
        Instants, evenly spaced.
    series : mapping of str to ndarray, shape (n,)
        Series of the motion by role, one at least.
    forces : sequence of ndarray, shape (n,)
    static_m_s2
        Specific force at rest.
    moves
        Whether the motion alone is asked for.
    """
    role, step_s = telling_role(series), float(times_s[1] - times_s[0])
    read = () if moves else forces
    if role == "recoil_acceleration":
        return _between_rests_s(times_s, series[role], read, static_m_s2)
    seen = np.flatnonzero(np.isfinite(series[role]))
    first, stop = int(seen[0]), int(seen[-1]) + 1
    samples, differentiated = bridge(series[role][first:stop]), DIFFERENTIATED[role]
    cutoff_hz, changes_s = SMOOTH_SHARE / step_s, [changes_in_s(bridge(one, otherwise=0.0), step_s) for one in forces]
    slowest_hz = QUICKER / min(changes_s, default=math.inf)
    while True:
        low_pass = LowPass(cutoff_hz)
        # where its record ends the filter knows one side alone
        reach = min(low_pass.reach_samples(1.0 / step_s), samples.size // 4)
        slow = differentiated(low_pass.apply(samples, 1.0 / step_s), step_s)[reach : samples.size - reach]
        count = max(REST_SAMPLES, int(REST_SHARE * slow.size))
        noise = min(robust_sigma(slow[:count]), robust_sigma(slow[-count:]))
        cutoff_hz *= 0.5
        if NOISES * noise < REST_LEVEL * float(np.max(np.abs(slow))) or cutoff_hz < slowest_hz:
            break
    told = slice(first + reach, stop - reach)
    first_s, last_s = _between_rests_s(times_s[told], slow + static_m_s2, [one[told] for one in read], static_m_s2)
    # without a rest it moves as long as anything is told of it
    return (
        float(times_s[first]) if first_s == times_s[told][0] else first_s,
        float(times_s[stop - 1]) if last_s == times_s[told][-1] else last_s,
    )


def _between_rests_s(
    times_s: Array, acceleration_m_s2: Array, forces: Sequence[Array], static_m_s2: float
) -> tuple[float, float]:
    step_s = float(times_s[1] - times_s[0])
    acceleration = bridge(acceleration_m_s2, otherwise=static_m_s2)
    smooth = LowPass(SMOOTH_SHARE / step_s).apply(acceleration, 1.0 / step_s)
    # what shakes one way and the other is no motion yet: an accelerometer has both its own noise and the structure's
    raw = [acceleration, *(bridge(one, otherwise=0.0) for one in forces)]
    sides = [(smooth, raw[0]), *((one, one) for one in raw[1:])]
    first = _departure(sides, static_m_s2)
    last = _departure([(one[::-1], other[::-1]) for one, other in sides], static_m_s2)
    return float(times_s[first]), float(times_s[times_s.size - 1 - last])


def _departure(sides: Sequence[tuple[Array, Array]], static_m_s2: float) -> int:
    """Return the index of the last sample of the rest that a record begins with; 0 without any.

    Parameters
    ----------
    sides : sequence of pairs of ndarray, shape (n,)
        Series that are looked at, each with itself as recorded; acceleration first.
    """
    n = sides[0][0].size
    count = min(max(REST_SAMPLES, int(REST_SHARE * n)), n)
    found = n - 1
    for number, (side, raw) in enumerate(sides):
        start = side[:count]
        level = float(np.median(start))
        largest = float(np.max(np.abs(side - level), initial=0.0))
        spread = robust_sigma(start)
        off = abs(level - static_m_s2) if number == 0 else 0.0
        if number and largest <= 2.0 * NOISES * spread:  # a force that nothing is seen of
            continue
        steady = spread <= max(REST_LEVEL * largest, STEADY * noise_sigma(raw[:count]))
        if not largest > 0 or not steady or off > ZERO_LEVEL * largest:
            return 0
        moves = np.abs(side - level) > max(REST_LEVEL * largest, NOISES * spread)
        begins = first_of_run(moves, IN_A_ROW)
        if begins is not None:
            still = np.flatnonzero(np.abs(side[: begins + 1] - level) <= 0.5 * NOISES * spread)
            found = min(found, int(still[-1]) if still.size else 0)
    return found


def _usable(series: Mapping[str, Array], role: str) -> bool:
    return role in series and bool(np.isfinite(series[role]).any())
