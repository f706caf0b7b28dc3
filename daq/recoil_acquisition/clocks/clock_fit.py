"""Relation of a device's clock to the host's, from the stamps that both gave to the same frames.

A host's stamp is late, never early: by the time on the line, in the adapter's buffer, in the kernel, and until
the reading program was scheduled. So the relation ``host = a + b * device`` is the line along the lower edge of
all differences ``host - device``. Three things must not bend it:

- a stall of the host, after which many frames come at once with late stamps: the device's stamps go on evenly, so it
  is no step of the device's clock;
- a single wrong stamp of the device, which is left out;
- a step of the device's clock, which is found, located and taken out. The device's stamps have a break there that
  the host's have not, and the lower edge lies elsewhere on the two sides.

The slope is the weighted median of the slopes between lower points of the same side of all steps (H. Theil, Nederl.
Akad. Wetensch. Proc. 53, 1950; P. K. Sen, J. Amer. Statist. Assoc. 63, 1968), of slopes that a clock can
have. The level is the median of the points about the shortest interval that holds a third of them, after
P. J. Rousseeuw and A. M. Leroy's shortest half (Robust Regression and Outlier Detection, 1987). Uncertainties are
those of a median where errors are normal: sqrt(pi / 2) times those of least squares.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.clocks.clock_breaks import FEWEST, find_breaks, join_parts, keep_order, step_by_count
from recoil_acquisition.numerics.normal_distribution import MAD_TO_SIGMA, MEDIAN_LOSS

Seconds = NDArray[np.float64]
Instants = NDArray[np.int64]

RESOLUTION_S = 1e-9
"""Resolution of stamps in whole nanoseconds."""

_POINTS = 96
"""Lower points over the whole record."""
_AGREEING_WIDTHS = 4.0
"""A third of normal errors lies within 0.86 sigma: what is four times that away is no error of the same kind."""


@dataclass(frozen=True, eq=False)
class Side:
    """The frames between two steps, the lower points that agree, and where their lower edge lies."""

    frames: NDArray[np.intp]
    points: NDArray[np.intp]
    level_s: float


def side_of(frames: NDArray[np.intp], lowest: NDArray[np.intp], flat: Seconds) -> Side:
    """Return a side of which those lower points count that agree about its level.

    Parameters
    ----------
    frames, lowest
        Frames of the side, and its lower points.
    flat : ndarray of float64, shape (n_frames,)
        Differences ``host - device`` of all frames, the drift taken out.
    """
    points = lowest[_agreeing(flat[lowest])]
    return Side(frames, points, float(np.median(flat[points])))


def _share(size: int, whole: int) -> int:
    """Return how many lower points a side of a size gets."""
    return int(np.clip(round(_POINTS * size / whole), 1 if size < 2 * FEWEST else 2, max(size // FEWEST, 1)))


def lower_points(r: Seconds, frames: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return the lowest frame of each of some runs of frames of one side.

    Parameters
    ----------
    r : ndarray of float64, shape (n_frames,)
        Differences ``host - device`` of all frames.
    frames
        Frames of the side.
    """
    runs = np.array_split(frames, _share(frames.size, r.size))
    return np.array([run[np.argmin(r[run])] for run in runs], dtype=np.intp)


def _agreeing(values: Seconds) -> NDArray[np.bool_]:
    """Return which values lie about the shortest interval that holds a third of them; the others were late."""
    ordered = np.sort(values)
    third = max(math.ceil(values.size / 3), 2)
    if ordered.size <= third:
        return np.ones(values.size, dtype=bool)
    widths = ordered[third - 1 :] - ordered[: ordered.size - third + 1]
    at = int(np.argmin(widths))
    width_s = max(float(widths[at]), RESOLUTION_S)
    middle = (ordered[at] + ordered[at + third - 1]) / 2
    return np.asarray(np.abs(values - middle) <= _AGREEING_WIDTHS * width_s)


def slope_between(
    x: Seconds, r: Seconds, points: Sequence[NDArray[np.intp]], largest_drift: float
) -> tuple[float, bool]:
    """Return the weighted median of the slopes between points of the same side, and whether there is any.

    Parameters
    ----------
    x, r : ndarray of float64, shape (n_frames,)
        The device's stamps, and the differences ``host - device``, s.
    points
        Points of each side.
    largest_drift
        Slopes beyond it are no clock's.
    """
    slopes, weights = [], []
    for p in points:
        one, other = np.triu_indices(p.size, k=1)
        dx = x[p][other] - x[p][one]
        apart = dx > 0
        between = (r[p][other] - r[p][one])[apart] / dx[apart]
        possible = np.abs(between) <= largest_drift
        slopes.append(between[possible])
        weights.append(dx[apart][possible])
    slope, weight = np.concatenate(slopes), np.concatenate(weights)
    if not slope.size:
        return 0.0, False
    order = np.argsort(slope)
    reached = np.cumsum(weight[order])
    return float(slope[order][np.searchsorted(reached, reached[-1] / 2)]), True


SMALLEST_STEP_S = 2e-3
"""Smallest jump of the clock that is distinguished from the host's own scatter."""

LARGEST_DRIFT = 0.01
"""Drift that no clock has against another; what looks like it is a host that was late."""

_AGREEING_SIGMAS = 4.0
_AGREEING_DELAYS = 3.0
"""Sigmas, or typical delays, by which host and packet counter may differ where they show the same step."""


@dataclass(frozen=True)
class FoundStep:
    """A step of the device's clock.

    Attributes
    ----------
    index
        Number of the first frame behind the step.
    device_ns
        Stamp of the first frame behind the step.
    host_ns
        Host time of the first frame behind the step.
    step_s
        Jump of the clock, positive forward.
    u_step_s
        Standard uncertainty.
    """

    index: int
    device_ns: int
    host_ns: int
    step_s: float
    u_step_s: float


@dataclass(frozen=True)
class ClockFit:
    """The line ``host - host_zero = offset + (1 + drift) * (device - device_zero)``, steps taken out of ``device``.

    Attributes
    ----------
    device_zero_ns, host_zero_ns
        The stamps of the first frame.
    offset_s, u_offset_s
        Offset and its standard uncertainty at the first frame; negative by the first frame's own delay. The shortest
        delay of all is part of the offset: it is not identifiable from the stamps.
    drift, u_drift
        Drift and its standard uncertainty; 0 and infinite if the stamps do not show it.
    wrong_stamps
        Frames whose stamp by the device belongs to no side of any step; they were left out.
    order_faults
        Places where the packet counter does not go forward; None if there is no counter.
    typical_delay_s, largest_delay_s
        Median and maximum of how late the host's stamps are, compared with the line.
    scatter_s
        Robust standard deviation of the lower points about the line.
    """

    device_zero_ns: int
    host_zero_ns: int
    offset_s: float
    u_offset_s: float
    drift: float
    u_drift: float
    steps: tuple[FoundStep, ...]
    wrong_stamps: tuple[int, ...]
    order_faults: int | None
    typical_delay_s: float
    largest_delay_s: float
    scatter_s: float
    frames: int

    def device_instants_ns(self, device_ns: Instants, host_ns: Instants) -> Instants:
        """Return when the fitted frames were, on the device's clock as it was before its first step.

        Steps are taken out. A wrong stamp is replaced by the line's value at the host's, less the typical delay,
        or spread evenly between its neighbours where that would put it out of order.

        Parameters
        ----------
        device_ns, host_ns : ndarray of int64, shape (n_frames,)
            Times of the frames as they were fitted.

        Returns
        -------
        ndarray of int64, shape (n_frames,)
        """
        instants = device_ns.astype(np.int64, copy=True)
        for step in self.steps:
            instants[step.index :] -= whole_ns(np.float64(step.step_s))
        wrong = np.array(self.wrong_stamps, dtype=np.intp)
        on_line_s = (host_ns[wrong] - self.host_zero_ns) / 1e9 - self.offset_s - self.typical_delay_s
        instants[wrong] = self.device_zero_ns + whole_ns(on_line_s / (1.0 + self.drift))
        return keep_order(instants, wrong)

    def to_json(self) -> dict[str, Any]:
        """Return it in JSON types: of the wrong stamps their number, and None for an infinite uncertainty."""
        values = asdict(self)
        values["steps"] = list(values["steps"])
        values["wrong_stamps"] = len(self.wrong_stamps)
        values["u_drift"] = self.u_drift if math.isfinite(self.u_drift) else None
        return values


def whole_ns(times_s: Seconds | np.float64) -> Instants:
    """Round seconds to nanoseconds, within what int64 holds: a damaged file can hold stamps of any distance."""
    return np.asarray(np.round(np.clip(times_s * 1e9, -(2.0**62), 2.0**62)), dtype=np.int64)


def fit_clock(
    device_ns: Instants,
    host_ns: Instants,
    *,
    counts: Instants | None = None,
    breaks: Sequence[int] = (),
    smallest_step_s: float = SMALLEST_STEP_S,
) -> ClockFit | None:
    """Fit the line below the host's stamps, and find the steps of the device's clock.

    Parameters
    ----------
    device_ns, host_ns : ndarray of int64, shape (n_frames,)
        Stamps in the order in which the frames were received, which is that of the host's.
    counts : ndarray of int64, shape (n_frames,), optional
        The frames' packet counter, unwrapped: says how many frames lie between two stamps.
    breaks
        Frames before which the device was opened anew: its clock may have begun anew there.

    Returns
    -------
    ClockFit or None
        None below two frames.

    Raises
    ------
    ValueError
        If the shapes differ.
    """
    if device_ns.shape != host_ns.shape or (counts is not None and counts.shape != device_ns.shape):
        raise ValueError("device, host and counter must have one value for each frame")
    if device_ns.size < 2:
        return None
    x = (device_ns - device_ns[0]) / 1e9
    y = (host_ns - host_ns[0]) / 1e9
    candidates = {*find_breaks(x, y, counts, smallest_step_s).tolist(), *breaks}
    parts, wrong = join_parts(x, y - x, sorted(candidates), smallest_step_s)
    lowest = [lower_points(y - x, part) for part in parts]
    drift, seen = slope_between(x, y - x, lowest, LARGEST_DRIFT)
    flat = y - x - drift * x
    sides = [side_of(part, points, flat) for part, points in zip(parts, lowest, strict=True)]
    residuals = np.concatenate([flat[side.points] - side.level_s for side in sides])
    delays = np.concatenate([flat[side.frames] - side.level_s for side in sides])
    scatter_s = max(MAD_TO_SIGMA * float(np.median(np.abs(residuals))), RESOLUTION_S)
    spread_s = math.sqrt(sum(float(((x[side.points] - x[side.points].mean()) ** 2).sum()) for side in sides))
    u_drift = MEDIAN_LOSS * scatter_s / spread_s if seen and spread_s > 0 else math.inf
    first = sides[0].points
    u_level_s = MEDIAN_LOSS * scatter_s / math.sqrt(first.size)
    u_lever_s = float(x[first].mean()) * u_drift if math.isfinite(u_drift) else 0.0
    return ClockFit(
        device_zero_ns=int(device_ns[0]),
        host_zero_ns=int(host_ns[0]),
        offset_s=sides[0].level_s,
        u_offset_s=math.hypot(u_level_s, u_lever_s),
        drift=drift,
        u_drift=u_drift,
        steps=_found_steps(
            x, sides, (drift, u_drift), (scatter_s, float(np.median(delays))), (device_ns, host_ns), counts
        ),
        wrong_stamps=tuple(wrong.tolist()),
        order_faults=None if counts is None else int((np.diff(counts) <= 0).sum()),
        typical_delay_s=float(np.median(delays)),
        largest_delay_s=float(delays.max()),
        scatter_s=scatter_s,
        frames=int(device_ns.size),
    )


def _found_steps(
    x: Seconds,
    sides: Sequence[Side],
    slope: tuple[float, float],
    lateness_s: tuple[float, float],
    stamps: tuple[Instants, Instants],
    counts: Instants | None,
) -> tuple[FoundStep, ...]:
    """Return the steps between neighbouring sides.

    Their size is what the host shows; where the packet counter shows the same and better, what the
    counter shows. No step is larger than what keeps the frames on both sides of it in order.
    """
    (drift, u_drift), (scatter_s, delay_s) = slope, lateness_s
    found = []
    for before, after in pairwise(sides):
        last, at = int(before.frames[-1]), int(after.frames[0])
        # Behind a step forward the differences are less by (1 + drift) times the step
        step_s = (before.level_s - after.level_s) / (1.0 + drift)
        u_levels_s = MEDIAN_LOSS * scatter_s * math.sqrt(1 / before.points.size + 1 / after.points.size)
        apart_s = float(x[after.points].mean() - x[before.points].mean()) - step_s
        u_step_s = math.hypot(u_levels_s, apart_s * u_drift if math.isfinite(u_drift) else 0.0)
        if min(before.points.size, after.points.size) < FEWEST:
            # So short a side can be late as a whole, by all of a read, which its scatter does not show
            u_step_s = math.hypot(u_step_s, delay_s)
        counted = None if counts is None else step_by_count(x, counts, last, at)
        if (
            counted is not None
            and counted[1] < u_step_s
            and abs(counted[0] - step_s) <= max(_AGREEING_SIGMAS * u_step_s, _AGREEING_DELAYS * delay_s)
        ):
            step_s, u_step_s = counted
        most_s = float(x[at] - x[last]) - (at - last + 1) * RESOLUTION_S
        if step_s > most_s:
            step_s, u_step_s = most_s, max(u_step_s, step_s - most_s)
        found.append(FoundStep(at, int(stamps[0][at]), int(stamps[1][at]), step_s, u_step_s))
    return tuple(found)
