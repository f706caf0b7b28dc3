"""The unknowns by least squares from blocks of rows and from priors: Gauss and Newton's iteration, by triangles."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.numerics.arrays import Array
from recoil_identification.inference.block import Block
from recoil_identification.inference.estimate import LEAST_REDUNDANCY, Estimate
from recoil_identification.inference.unknown import Prior, Unknown, exactly_known

MOST_STEPS = 50
MOST_HALVINGS = 30
"""Most halvings of a step that would raise the misfit."""
ROUNDING = 1e-12
"""Share of the misfit by which it may seem to rise."""
NEGLIGIBLE = 1e-6
"""Length of a step, in standard uncertainties, that moves nothing any more."""
LARGEST_SHARE_LEFT = 1e-6
"""Share of an unknown, in directions that are not determined, up to which it is determined all the same."""
LEAST_PIVOT = 1e-12
"""Singular value over the largest one, of columns of length one, below which a direction is not determined."""


def solve(
    unknowns: Sequence[Unknown],
    blocks: Sequence[Block],
    priors: Sequence[Prior],
    start: Mapping[str, float] | None = None,
    *,
    most_steps: int = MOST_STEPS,
) -> Estimate:
    """Find the values that blocks and priors together make likeliest.

    Parameters
    ----------
    unknowns
        Unknowns of all blocks and priors, and no others.
    start
        Values to begin with, by name; 0 where there is none.
    most_steps
        Most steps of the iteration.

    Raises
    ------
    ValueError
        If two unknowns or sources share a name, or a block or a prior names an unknown that is none.
    """
    names = [unknown.name for unknown in unknowns]
    sources = tuple(source for prior in priors if not prior.exact for source in prior.sources)
    for kind, listed in (("unknown", names), ("source", sources)):
        if len(set(listed)) < len(listed):
            raise ValueError(f"each {kind} needs a name of its own: {', '.join(sorted(listed))}")
    places = {name: at for at, name in enumerate(names)}
    named = {name for block in blocks for name in block.unknowns} | {
        name for prior in priors for name in prior.unknowns
    }
    if strangers := named - places.keys():
        raise ValueError(f"no unknown: {', '.join(sorted(strangers))}; there are {', '.join(names)}")
    exact = exactly_known(priors)
    known = _Known.of([prior for prior in priors if not prior.exact], places)
    values = np.array([exact.get(name, (start or {}).get(name, 0.0)) for name in names])
    free = np.array([name not in exact for name in names])
    limits = np.array([unknown.largest_step for unknown in unknowns])
    converged, steps = False, 0
    triangle, misfit, rows = _triangle(blocks, values, places)
    while True:
        solution = _solution(triangle, known, values, free)
        if converged or steps == most_steps:
            break
        step = solution.step / max(float(np.max(np.abs(solution.step) / limits)), 1.0)
        before = misfit + known.misfit(values)
        for _ in range(MOST_HALVINGS):
            triangle, misfit, rows = _triangle(blocks, values + step, places)
            if misfit + known.misfit(values + step) <= before * (1.0 + ROUNDING):
                break
            step = 0.5 * step  # beyond what the linear model holds for
        else:  # nothing lowers it any more
            triangle, misfit, rows = _triangle(blocks, values, places)
            break
        values = values + step
        steps += 1
        converged = float(np.linalg.norm(solution.rows @ step)) < NEGLIGIBLE
    off = known.rows @ values - known.values
    contributions = solution.covariance @ known.whitened.T
    return Estimate(
        unknowns=tuple(unknowns),
        values=values,
        covariance=solution.covariance,
        determined=solution.determined,
        sources=sources,
        contributions=contributions,
        u_sources=np.diag(known.root).copy(),
        pulls=off / np.sqrt(np.diag(known.covariance)),
        normalised_residuals=known.normalised(off, solution.covariance),
        misfit=misfit + known.misfit(values),
        rows=rows,
        triangle=triangle,
        steps=steps,
        converged=converged,
    )


def expected(
    unknowns: Sequence[Unknown],
    blocks: Sequence[Block],
    priors: Sequence[Prior],
    values: Mapping[str, float],
    limits: Array,
) -> tuple[Array, Array]:
    """Return what blocks and priors expect of the unknowns about some values, where they are linear.

    Parameters
    ----------
    unknowns
        Unknowns of all blocks and priors, and no others.
    values
        Values of all unknowns, by name.
    limits : ndarray, shape (n_unknowns,)
        Standard deviation that each unknown has besides: what nothing determines stays within it.

    Returns
    -------
    step : ndarray, shape (n_unknowns,)
        Expected values less `values`; 0 for what is exactly known.
    root : ndarray, shape (n_unknowns, n_unknowns)
        Root S of their covariance ``S S'``.
    """
    places = {unknown.name: at for at, unknown in enumerate(unknowns)}
    exact = exactly_known(priors)
    known = _Known.of([prior for prior in priors if not prior.exact], places)
    here = np.array([values[unknown.name] for unknown in unknowns])
    triangle, _, _ = _triangle(blocks, here, places)
    left = known.left(here)
    free = np.array([unknown.name not in exact for unknown in unknowns])
    rows = np.vstack([triangle[:, :-1], known.whitened, np.diag(1.0 / limits)])[:, free]
    target = np.concatenate([triangle[:, -1], left, np.zeros(here.size)])
    scale = np.linalg.norm(rows, axis=0)
    reduced = np.asarray(np.linalg.qr(np.column_stack([rows / scale, target]), mode="r"))
    size = scale.size
    inverse = np.linalg.inv(reduced[:size, :size]) / scale[:, np.newaxis]
    step, root = np.zeros(here.size), np.zeros((here.size, here.size))
    step[free] = inverse @ reduced[:size, size]
    root[np.ix_(free, free)] = inverse
    return step, root


@dataclass(frozen=True, eq=False)
class _Known:
    """All priors as one: rows about all unknowns, their values and covariance, its root and that root's inverse."""

    rows: Array
    values: Array
    covariance: Array
    root: Array
    whitened: Array
    inverse: Array

    @classmethod
    def of(cls, priors: Sequence[Prior], places: Mapping[str, int]) -> _Known:
        n = sum(len(prior.sources) for prior in priors)
        rows, values, covariance = np.zeros((n, len(places))), np.zeros(n), np.zeros((n, n))
        at = 0
        for prior in priors:
            part = slice(at, at + len(prior.sources))
            rows[part, [places[name] for name in prior.unknowns]] = prior.rows
            values[part], covariance[part, part] = prior.values, prior.covariance
            at = part.stop
        root = np.asarray(np.linalg.cholesky(covariance), dtype=np.float64)
        whitened = np.asarray(np.linalg.solve(root, rows), dtype=np.float64)
        return cls(rows, values, covariance, root, whitened, np.asarray(np.linalg.inv(root), dtype=np.float64))

    def left(self, values: Array) -> Array:
        """Return what the values leave of the rows, over the root of their covariance."""
        return np.asarray(self.inverse @ (self.values - self.rows @ values))

    def misfit(self, values: Array) -> float:
        """Return the sum of squares of the rows' residuals, over their covariance."""
        left = self.left(values)
        return float(left @ left)

    def normalised(self, off: Array, covariance: Array) -> Array:
        """Return each row's residual over its own standard deviation: Baarda's w, of correlated observations too."""
        weights = np.linalg.inv(self.covariance)
        own = self.covariance - self.rows @ covariance @ self.rows.T
        variances = np.diag(weights @ own @ weights)
        judged = variances > LEAST_REDUNDANCY * np.diag(weights)
        return np.where(judged, (weights @ off) / np.sqrt(np.where(judged, variances, 1.0)), 0.0)


@dataclass(frozen=True, eq=False)
class _Solution:
    """One step and all rows; the covariance, and which unknowns are determined, where they are asked for.

    Attributes
    ----------
    inverse : ndarray, shape (n_free, n_rows)
        Generalised inverse of the rows of the free unknowns.
    seen : ndarray, shape (n_free,)
        Share of each free unknown that lies in directions that are determined.
    """

    step: Array
    rows: Array
    free: NDArray[np.bool_]
    inverse: Array
    seen: Array

    @cached_property
    def covariance(self) -> Array:
        found = np.zeros((self.step.size, self.step.size))
        found[np.ix_(self.free, self.free)] = self.inverse @ self.inverse.T
        return found

    @cached_property
    def determined(self) -> NDArray[np.bool_]:
        found = np.ones(self.step.size, dtype=bool)
        found[self.free] = self.seen > 1.0 - LARGEST_SHARE_LEFT
        return found


def _triangle(blocks: Sequence[Block], values: Array, places: Mapping[str, int]) -> tuple[Array, float, int]:
    """Return all blocks' rows as a triangle of derivatives and what is left, their misfit, and how many they are."""
    named = dict(zip(places, values.tolist(), strict=True))
    parts = [np.zeros((0, len(places) + 1))]
    for block in blocks:
        left, derivatives = block.linearised(named)
        part = np.zeros((left.size, len(places) + 1))
        part[:, [places[name] for name in block.unknowns]] = derivatives
        part[:, -1] = left
        parts.append(part)
    stacked = np.vstack(parts)
    misfit = float(stacked[:, -1] @ stacked[:, -1])
    triangle = np.zeros((len(places), len(places) + 1))
    reduced = np.asarray(np.linalg.qr(stacked, mode="r"))[: len(places)]
    triangle[: reduced.shape[0]] = reduced
    return triangle, misfit, stacked.shape[0]


def _solution(triangle: Array, known: _Known, values: Array, free: NDArray[np.bool_]) -> _Solution:
    """Solve for one step from the present values."""
    left = known.left(values)
    rows = np.vstack([triangle[:, :-1], known.whitened])
    target = np.concatenate([triangle[:, -1], left])
    own = rows[:, free]
    scale = np.sqrt((own**2).sum(axis=0))
    scale[scale == 0] = 1.0
    u, sizes, directions = np.linalg.svd(own / scale, full_matrices=False)
    kept = sizes > LEAST_PIVOT * sizes.max(initial=0.0)
    inverse = (directions[kept].T / sizes[kept]) @ u[:, kept].T / scale[:, np.newaxis]
    step = np.zeros(values.size)
    step[free] = inverse @ target
    return _Solution(step, rows, free, inverse, (directions[kept] ** 2).sum(axis=0))
