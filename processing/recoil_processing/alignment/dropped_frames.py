"""Pictures that a camera lost, or wrote twice, without its file's times knowing of it.

From such a picture on every frame is one period early (late). Given the accelerometer, that is a change of
the model of `alignment.motion_alignment` of known size and unknown place: positions are compared with the
travel one period on, ``k (D(t + T) - D(t))``, from some frame on. A jump of the track is distinguished from it: there
the tail is constant, and its size unknown. Whitened as the positions are, the gain in log-likelihood of a
tail c over the residual r is ``r'c - |c|^2 / 2``, and ``(r'c)^2 / (2 |c|^2)`` with its size at its best, c
taken off what the model's own columns explain of it: the generalised likelihood ratio of Willsky and
Jones (1976), IEEE Trans. Autom. Control 21(1). Products and energies of all tails come from two passes over
the frames. Before and behind the motion, and where it is slow, a missing picture cannot be seen, and
nothing is lost by it.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_processing.alignment.frame_fault import FrameFault
from recoil_processing.alignment.motion_least_squares import MotionModel, MotionSolution
from recoil_processing.alignment.motion_solver import MotionSolver

Rows = NDArray[np.int64]

LEAST_GAIN = 8.0
"""Least rise of the log-likelihood: for one place it is 4 standard deviations, which chance exceeds once in 30,000."""
LEAST_JUMP_GAIN = 12.5
"""Gain in likelihood of a jump: 5 standard deviations, for it may be of any size, and each few frames show one of
their own."""
JUMP_LIKELIER = 6.0
"""Log-likelihood by which a jump must be better than a missing picture. It has a size to choose: one that is as likely
anywhere within a centimetre, and is then known to some 20 um, is paid for by ln 500."""
MOST_FAULTS = 4
"""Number of faults that are looked for in one record; one with more of them is no record of a clock."""
CREDIBLE = 0.95
"""Probability of the range of frames that a fault is stated to lie in."""


@dataclass(frozen=True)
class _Candidate:
    """A correction: first frame of the model that it concerns, credible range of it, sign or size, gain."""

    place: int
    low: int
    high: int
    missing: int
    jump_m: float
    gain: float


def find_frame_faults(
    model: MotionModel,
    solution: MotionSolution,
    solver: MotionSolver,
    *,
    rows: Rows,
    repeated: Flags,
    period_s: float,
    drift_allowance: float,
) -> tuple[FrameFault, ...]:
    """Find the places where one picture is missing or is there twice, or where the track jumps.

    Parameters
    ----------
    model
        Model of the track with the file's times.
    solution
        Solution of the model's fit.
    solver
        Solver that made the solution.
    rows : ndarray of int, shape (n_frames,)
        Numbers of the file's frames that the model has.
    repeated : ndarray of bool, shape (n_file_frames,)
        Frames of the file that repeat the position before exactly: they show where a picture was written twice.
    period_s
        Period of the frames.
    drift_allowance
        Allowance for the drift that the fit used.

    Returns
    -------
    tuple of FrameFault
        Faults in the order of the frames; empty where no correction raises the log-likelihood enough. A jump is the
        only one then: what else is wrong is not identifiable beside it.
    """
    if not _suspicious(model, solution, period_s):
        return ()
    # frames that a correction would move out of the recorder's record, or into it, would change the likelihood
    mapped, reach = model.mapped_s(solution.shift_s, solution.drift), (MOST_FAULTS + 1) * period_s
    stay = model.integral.covers(mapped - reach) & model.integral.covers(mapped + reach)
    model, rows = _chosen(model, stay), rows[stay]
    search = _Search(solver, solution, period_s, drift_allowance)
    steps = _steps(search, model, rows, repeated)
    jump = search.jump(model)
    if jump is None or jump.gain < sum(step.log_likelihood_gain for step in steps) + JUMP_LIKELIER:
        return tuple(sorted(steps, key=lambda step: step.index))
    first, last = int(rows[jump.low - 1]) + 1, int(rows[jump.high])
    time_s = float(model.times_s[jump.place])
    return (FrameFault(int(rows[jump.place]), first, last, time_s, 0, period_s, jump.gain, jump.jump_m),)


def _steps(search: _Search, model: MotionModel, rows: Rows, repeated: Flags) -> list[FrameFault]:
    """Missing and repeated pictures, the worst first."""
    file_times, steps = model.times_s, list[FrameFault]()
    while len(steps) < MOST_FAULTS:
        candidates = [found for missing in (1, -1) if (found := search.step(model, missing)) is not None]
        if not candidates:
            break
        worst = max(candidates, key=lambda found: found.gain)
        missing, place = worst.missing, worst.place
        first, last = int(rows[worst.low - 1]) + 1, int(rows[worst.high])
        index = int(rows[place - 1]) + 1 if missing < 0 else int(rows[place])
        twice = first + np.flatnonzero(repeated[first : last + 1])
        if missing < 0 and twice.size == 1:
            index = first = last = int(twice[0])
        time_s = float(np.interp(index, rows, file_times))
        steps.append(FrameFault(index, first, last, time_s, missing, search.period_s, worst.gain))
        model = _moved(model, place, missing * search.period_s)
        keep = _increasing(model.times_s)
        model, rows, file_times = _chosen(model, keep), rows[keep], file_times[keep]
    return steps


@dataclass(frozen=True, eq=False)
class _Search:
    solver: MotionSolver
    about: MotionSolution
    period_s: float
    drift_allowance: float
    _starts: dict[MotionModel, tuple[MotionSolution, float] | str] = field(default_factory=dict, init=False, repr=False)

    def start(self, model: MotionModel) -> tuple[MotionSolution, float] | str:
        """Solve a model that several corrections start from, once."""
        if model not in self._starts:
            self._starts[model] = self.solve(model)
        return self._starts[model]

    def solve(self, model: MotionModel) -> tuple[MotionSolution, float] | str:
        return self.solver.likeliest(model, self.about.shift_s, self.about.drift, self.drift_allowance)

    def step(self, model: MotionModel, missing: int) -> _Candidate | None:
        """Find the best place of a missing (1) or repeated (-1) picture; None if none is good enough."""
        later_s = missing * self.period_s
        start = self.start(model)
        if isinstance(start, str):
            return None
        about, place = start[0], -1
        for _ in range(3):
            # at first it is the faulty record that decides the place, which is linear about a wrong offset
            curve, inside = _step_gains(model, about, later_s), np.flatnonzero(about.inside)
            if curve.max() < 0.5 * LEAST_GAIN:
                return None
            last, place = place, int(inside[int(np.argmax(curve))])
            if place == last:
                break
            moved = _moved(model, place, later_s)
            keep = _increasing(moved.times_s)
            found = self.solve(_chosen(moved, keep))
            if isinstance(found, str):
                return None
            after, density = found
            again = self.solver.step(model, after.shift_s, after.drift, density, self.drift_allowance)
            if again is None:
                return None
            about = again
        as_given = start if keep.all() else self.solve(_chosen(model, keep))
        if isinstance(as_given, str):
            return None
        gain = after.log_likelihood - as_given[0].log_likelihood
        return None if gain < LEAST_GAIN else _Candidate(place, *_credible(curve, inside), missing, 0.0, gain)

    def jump(self, model: MotionModel) -> _Candidate | None:
        """Find the best place and size of a jump of the track; None if none is good enough."""
        start = self.start(model)
        if isinstance(start, str):
            return None
        about = start[0]
        for _ in range(3):
            # its size is that at the noise without it; with it, the accelerometer seems noisier than it is
            products, energies = _tails(about, np.ones(int(about.inside.sum())))
            curve = np.where(energies > 0, 0.5 * products**2 / np.where(energies > 0, energies, 1.0), 0.0)
            best, inside = int(np.argmax(curve)), np.flatnonzero(about.inside)
            if curve[best] < LEAST_JUMP_GAIN:
                return None
            place, size_m = int(inside[best]), float(products[best] / energies[best])
            positions = model.positions_m.copy()
            positions[place:] -= size_m
            found = self.solve(replace(model, positions_m=positions))
            if isinstance(found, str):
                return None
            after, density = found
            again = self.solver.step(model, after.shift_s, after.drift, density, self.drift_allowance)
            if again is None:
                return None
            about = again
        gain = after.log_likelihood - start[0].log_likelihood
        return None if gain < LEAST_JUMP_GAIN else _Candidate(place, *_credible(curve, inside), 0, size_m, gain)


def _suspicious(model: MotionModel, solution: MotionSolution, period_s: float) -> bool:
    """Whether a correction seems to raise the likelihood; by half is enough, as this is about a wrong fit."""
    if max(_step_gains(model, solution, sign * period_s).max() for sign in (1, -1)) > 0.5 * LEAST_GAIN:
        return True
    products, energies = _tails(solution, np.ones(int(solution.inside.sum())))
    return bool(np.any(products**2 > LEAST_JUMP_GAIN * energies))


def _step_gains(model: MotionModel, solution: MotionSolution, later_s: float) -> Array:
    """Gain in log-likelihood if the frames from each one on were taken later, shape (n_inside,)."""
    mapped = model.mapped_s(solution.shift_s, solution.drift)[solution.inside]
    ahead, travel = model.integral.at(mapped + later_s)[0], model.integral.at(mapped)[0]
    products, energies = _tails(solution, solution.gain * (ahead - travel))
    return np.asarray(products - 0.5 * energies)


def _tails(solution: MotionSolution, column: Array) -> tuple[Array, Array]:
    """Products of the residual with whitened tails of a column, and the tails' energies that are not the model's.

    At i, of the column with zeros before i; shape (n_inside,) each. The first one is zero: what is wrong from
    the first frame on is no fault but another offset.
    """
    rows = np.column_stack([solution.residual, solution.basis])[: column.size]
    weighted = solution.walk.whiten_transposed(rows) * column[:, None]
    tails = np.cumsum(weighted[::-1], axis=0)[::-1]
    whole = solution.walk.tail_energies(column)
    energies = whole - (tails[:, 1:] ** 2).sum(axis=1)
    # what the model explains all but rounding of contains nothing
    blind = energies < 1e-9 * whole
    blind[0] = True
    return np.where(blind, 0.0, tails[:, 0]), np.where(blind, 0.0, energies)


def _credible(curve: Array, inside: Rows) -> tuple[int, int]:
    weights = np.exp(curve - curve.max())
    share = np.cumsum(weights) / weights.sum()
    low, high = np.searchsorted(share, [0.5 * (1 - CREDIBLE), 0.5 * (1 + CREDIBLE)])
    return max(int(inside[low]), 1), int(inside[min(int(high), inside.size - 1)])


def _moved(model: MotionModel, place: int, later_s: float) -> MotionModel:
    times = model.times_s.copy()
    times[place:] += later_s
    return replace(model, times_s=times)


def _increasing(times_s: Array) -> Flags:
    # a repeated picture, moved back, falls upon the one that it repeats
    return np.asarray(np.diff(times_s, prepend=-np.inf) > 1e-3 * float(np.median(np.diff(times_s))))


def _chosen(model: MotionModel, which: Flags) -> MotionModel:
    return model if which.all() else replace(model, times_s=model.times_s[which], positions_m=model.positions_m[which])
