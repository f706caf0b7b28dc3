"""A signal's swing in a shot, in a few numbers, and the roles of several signals by them.

A shot is rest, a blow and what follows. Where a signal rests, how far and where to it goes first, and how large that is
beside its neighbours of the same quantity tells recoiling part from carriage, and breech from brake: the breech has the
highest pressure, the recuperator's is preloaded; the recoiling part is accelerated most, the carriage's upright
accelerometer feels gravity at rest, and the tipping part is turned more suddenly than the carriage.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_processing.noise import noise_sigma

_Figure = Callable[["Swing"], float]

REST_SHARE, LEAST_REST = 0.05, 20
"""Share of the record in which it is taken to rest, and the least samples of that."""
MEAN_S = 5e-4
"""Length of the moving mean by which ringing and noise are not taken for the blow, s."""
DRIVE_S = 2e-2
"""Time from the onset in which the blow drives what a signal measures: ringing has its way at once, a push adds up."""
SLOPE_S = 2e-3
"""Length of the means whose change is the steepness, s."""
FIRST_SHARE = 0.2
"""Share of the peak from which on a swing counts as the first."""
MOVES_SIGMA = 8.0
"""Multiples of the noise of the moving mean by which a signal must swing to have moved."""
LEAST_OVER_WANDER = 2.0
"""Multiples of what it wanders by in the first part by which it must swing, too."""
SAME_SHARE = 0.1
"""Share by which two gauges of one pressure may differ in their peaks."""


@dataclass(frozen=True)
class Swing:
    """Swing of a signal, in its own unit.

    Attributes
    ----------
    base
        Level at rest: the median of the first twentieth.
    peak
        Largest distance from it of a mean over half a millisecond, with its sign.
    first
        Sign of the first swing that reaches a fifth of the peak, 1 or -1; 0 of a signal that does not move.
    onset
        Sample at which that is.
    steepest
        Largest change of a mean over two milliseconds from one to the next, per second.
    noise
        Standard deviation of the noise at rest.
    moves
        Whether it goes further than its noise does.
    push
        Side to which the signal goes in the first `DRIVE_S`: its integral over that of its size, from -1 to 1. Ringing
        leaves nothing of it, whatever side it begins on.
    """

    base: float
    peak: float
    first: int
    onset: int
    steepest: float
    noise: float
    moves: bool
    push: float = 0.0


# a file may hold numbers that are no measurement, whose squares overflow
@np.errstate(over="ignore", invalid="ignore")
def swing_of(samples: Array, rate_hz: float) -> Swing | None:
    """Return what a signal does; None if there are too few samples to tell.

    Parameters
    ----------
    samples : ndarray, shape (n,)
        Samples; lost ones are NaN.
    """
    present = samples[np.isfinite(samples)]
    rest = present[: max(LEAST_REST, int(REST_SHARE * present.size))]
    if present.size < 2 * LEAST_REST or not rate_hz > 0:
        return None
    base = float(np.median(rest))
    length = max(1, min(round(MEAN_S * rate_hz), present.size // 4))
    mean = np.convolve(present - base, np.full(length, 1.0 / length), mode="valid")
    size = np.abs(mean)
    at = int(size.argmax())
    peak = float(mean[at])
    onset = int(np.flatnonzero(size >= FIRST_SHARE * abs(peak))[0])
    noise = noise_sigma(rest)
    # what wanders at rest as far is no blow either; a record may begin in motion, though
    wander = float(np.std(mean[: max(rest.size - length, 1)]))
    moves = abs(peak) > max(MOVES_SIGMA * noise / math.sqrt(length), LEAST_OVER_WANDER * wander)
    first = int(np.sign(mean[onset])) if moves else 0
    driven = present[onset : onset + max(round(DRIVE_S * rate_hz), 1)] - base
    size_driven = float(np.abs(driven).sum())
    push = float(driven.sum()) / size_driven if moves and size_driven > 0 else 0.0
    return Swing(base, peak, first, onset, _steepest(present, rate_hz), noise, moves, push)


FARTHEST_SIGMA = 20.0
"""Multiples of the usual spread of a long record's cells by which one must stand out for a blow to be in it."""


def cell_means(samples: Array, length: int) -> Array:
    """Return the means of a record cut into cells, NaN of one that is all lost; what is left over is the last cell.

    Parameters
    ----------
    samples : ndarray, shape (n,)
        Samples; lost ones are NaN.
    length
        Samples of a cell.

    Returns
    -------
    ndarray, shape (ceil(n / length),)
    """
    padded = np.full(-(-samples.size // length) * length, np.nan)
    padded[: samples.size] = samples
    cells = padded.reshape(-1, length)
    counts = np.isfinite(cells).sum(axis=1)
    return np.where(counts > 0, np.nansum(cells, axis=1) / np.maximum(counts, 1), np.nan)


def farthest_cell(means: Array) -> int | None:
    """Return the cell of a long record that is farthest from where it mostly is; None where none stands out.

    Parameters
    ----------
    means : ndarray, shape (n_cells,)
        See `cell_means`.
    """
    present = means[np.isfinite(means)]
    if present.size < LEAST_REST:
        return None
    usual = float(np.median(present))
    size = np.abs(np.nan_to_num(means, nan=usual) - usual)
    at = int(size.argmax())
    # 1.4826 times the median distance is the standard deviation of a normal distribution
    spread = 1.4826 * float(np.median(np.abs(present - usual)))
    return at if size[at] > FARTHEST_SIGMA * spread and size[at] > 0 else None


def _steepest(samples: Array, rate_hz: float) -> float:
    """Return the largest change of a mean over `SLOPE_S` from one to the next, per second."""
    length = max(1, min(round(SLOPE_S * rate_hz), samples.size // 4))
    mean = np.convolve(samples, np.full(length, 1.0 / length), mode="valid")
    return float(np.abs(mean[length:] - mean[:-length]).max()) * rate_hz / length


@dataclass(frozen=True)
class ShotRole:
    """A role that a signal has by what it does in the shot.

    Attributes
    ----------
    lead
        Factor by which the figure that decides exceeds that of the next signal; infinite where there is no other.
    reason
        Figure that decides, in words.
    """

    role: str
    lead: float
    reason: str


def roles_of_gun(swings: Mapping[str, tuple[str, Swing]]) -> dict[str, ShotRole]:
    """Return the roles that signals of one shot of a gun have by what they do.

    Parameters
    ----------
    swings
        Quantity and swing by the signal's name, SI; of signals that repeat each other one alone.

    Returns
    -------
    dict of str to ShotRole
        Roles by signal; a signal that does not move has none.
    """
    moving = _moving(swings)
    found: dict[str, ShotRole] = {}
    pressures = _by(moving, "pressure", _peak)
    if len(pressures) > 1:
        first, *others = pressures
        found[first] = ShotRole("breech_pressure", _lead(moving, pressures, _peak), "largest peak of the pressures")
        others.sort(key=lambda name: -moving[name][1].base)
        if len(others) > 1:
            lead = _lead(moving, [others[0], *others[1:]], lambda one: one.base)
            found[others[0]] = ShotRole("recuperator_pressure", lead, "highest pressure at rest of the others")
            found[others[-1]] = ShotRole("brake_pressure", lead, "lowest pressure at rest of the others")
    accelerations = _by(moving, "acceleration", _peak)
    if accelerations:
        lead = _lead(moving, accelerations, _peak)
        found[accelerations[0]] = ShotRole("recoil_acceleration", lead, "largest peak of the accelerations")
        others = sorted(accelerations[1:], key=lambda name: -abs(moving[name][1].base))
        if len(others) > 1:
            lead = _lead(moving, others, lambda one: abs(one.base))
            found[others[0]] = ShotRole("carriage_acceleration_y", lead, "feels gravity most at rest")
            found[others[1]] = ShotRole("carriage_acceleration_x", lead, "feels gravity less at rest")
    # the breech force turns the tipping part at once; the carriage follows, and may swing as far in the end
    rates = _by(moving, "angular_rate", _steepness)
    if len(rates) > 1:
        lead = _lead(moving, rates, _steepness)
        found[rates[0]] = ShotRole("tipping_rate", lead, "steepest of the angular rates")
        found[rates[1]] = ShotRole("carriage_rate", lead, "less steep than the other angular rate")
    return found | _travel(moving)


def roles_of_line(swings: Mapping[str, tuple[str, Swing]]) -> dict[str, ShotRole]:
    """Return the roles that signals have of one body on a line; as `roles_of_gun`."""
    moving = _moving(swings)
    forces = _by(moving, "force", _peak)
    found = {
        name: ShotRole("resisting_force", _lead(moving, [forces[0], name], _peak), "smaller than the largest force")
        for name in forces[1:]
    }
    if forces:
        lead = _lead(moving, forces, _peak)
        found[forces[0]] = ShotRole("driving_force", lead, "largest peak of the forces")
    for quantity, role in (("acceleration", "recoil_acceleration"), ("velocity", "recoil_velocity")):
        names = _by(moving, quantity, _peak)
        if names:
            found[names[0]] = ShotRole(role, _lead(moving, names, _peak), f"largest {quantity}")
    return found | _travel(moving)


def is_a_gun_shot(swings: Mapping[str, tuple[str, Swing]], least_pressures: int = 2) -> bool:
    """Whether signals may be of a shot of a gun: so many pressures rise, and something moves."""
    moving = _moving(swings)
    pressures = _by(moving, "pressure", _peak)
    moved = _by(moving, "acceleration", _peak) or _by(moving, "displacement", _peak)
    return len(pressures) >= least_pressures and bool(moved)


def is_a_line_shot(swings: Mapping[str, tuple[str, Swing]]) -> bool:
    """Whether signals are of one body on a line: a force, what moves, and no pressure."""
    moving = _moving(swings)
    if _by(moving, "pressure", _peak) or not _by(moving, "force", _peak):
        return False
    return any(_by(moving, quantity, _peak) for quantity in ("acceleration", "velocity", "displacement"))


def same_gauge(one: Swing, other: Swing) -> bool:
    """Whether two gauges of one clock swing so alike that they are of one pressure."""
    return abs(one.peak - other.peak) <= SAME_SHARE * max(abs(one.peak), abs(other.peak))


def _steepness(one: Swing) -> float:
    return one.steepest


def _peak(one: Swing) -> float:
    return abs(one.peak)


def _moving(swings: Mapping[str, tuple[str, Swing]]) -> dict[str, tuple[str, Swing]]:
    return {name: (quantity, one) for name, (quantity, one) in swings.items() if one.moves}


def _by(moving: Mapping[str, tuple[str, Swing]], quantity: str, figure: _Figure) -> list[str]:
    """Return the signals of a quantity, that of the largest figure first."""
    return sorted((name for name, (own, _) in moving.items() if own == quantity), key=lambda n: -figure(moving[n][1]))


def _lead(moving: Mapping[str, tuple[str, Swing]], names: Sequence[str], figure: _Figure) -> float:
    """Return the factor between the figures of the first and the second signal."""
    if len(names) < 2:
        return math.inf
    first, second = (figure(moving[name][1]) for name in names[:2])
    return math.inf if second <= 0 else first / second


def _travel(moving: Mapping[str, tuple[str, Swing]]) -> dict[str, ShotRole]:
    names = _by(moving, "displacement", _peak)
    if not names:
        return {}
    return {names[0]: ShotRole("recoil_displacement", _lead(moving, names, _peak), "largest travel")}
