"""Lag of one low-passed signal behind another, with an uncertainty that holds for the few rows of a shot.

``y_i = g r(t_i + shift + drift (t_i - origin)) + c`` is solved by Gauss-Newton; further columns, whose sizes are
unknown but for what was known of them, may stand beside both. The uncertainty is the largest of

- the curvature with the residual's variance, as if the residual were noise;
- the sandwich covariance with the residuals where they occur: what two sensors do not have in common is largest in
  the motion. A row that bends the fit to itself hides its own error (HC2 of J. G. MacKinnon and H. White,
  J. Econometrics 29(3), 1985). Neighbouring rows are taken as independent or as correlated (W. K. Newey and
  K. D. West, Econometrica 55(3), 1987).

What the fit cannot see because it bends to it is the caller's: `LagSolution.influence` says how any error of the rows
moves the lag (`recoil_processing.alignment.aliasing`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_processing.filters import LowPass

if TYPE_CHECKING:
    from scipy.interpolate import PPoly


GRID_PER_PERIOD = 10
"""Points of the source's grid per period of the cut-off."""
STRIDE = 4
"""Samples of that grid from one row to the next: rows 2.5 times per period, about as many as carry information of
their own."""
LEAST_ROWS_IN_COMMON = 20
"""Number of rows below which the records hardly overlap."""
LONGEST_STEP_S = 5e-3
"""Time by which the offset may move at once."""
MOST_STEPS = 20
"""Steps of Gauss-Newton; three or four are usual."""
NEGLIGIBLE_STEP = 1e-2
"""Share of the offset's uncertainty below which a step is no step."""
MOST_CONDITION = 1e8
"""Condition number of the scaled columns; with more and they are not independent."""
CORRELATED_ROWS = (0, 3, 6)
"""Rows over which residuals may be correlated: not at all, one period of the cut-off, two."""
LEAST_HIDDEN = 0.05
"""Smallest share of its own error that a row is taken to show."""


@dataclass(frozen=True, eq=False)
class LagRows(ReadOnlyArrays):
    """Both low-passed signals.

    The clocks map by ``t_ref = t + shift + drift (t - origin)``: shift and drift are nearly independent
    wherever the source's clock has its zero.

    Attributes
    ----------
    beside : ndarray, shape (n_rows, n_own)
        Columns on the source's clock of what may be wrong with its values.
    parts
        Parts of the reference whose own shares of it may be off, as curves.
    u : ndarray, shape (n_own + n_parts,)
        Standard uncertainties of the columns' sizes, and of the parts' shares.
    """

    times_s: Array
    values: Array
    origin_s: float
    curve: PPoly
    slope: PPoly
    first_s: float
    last_s: float
    beside: Array
    parts: tuple[PPoly, ...] = ()
    u: Array = field(default_factory=lambda: np.zeros(0))

    @classmethod
    def of(
        cls,
        grid_s: Array,
        smooth: Array,
        trusted: Flags,
        start_s: float,
        step_s: float,
        target: Array,
        target_trusted: Flags | None,
        low_pass: LowPass,
        beside: Array | None = None,
        parts: Sequence[Array] = (),
        u: Array | None = None,
    ) -> LagRows:
        """Take rows of the source's grid, and the reference between its samples.

        Parameters
        ----------
        grid_s, smooth : ndarray, shape (n_grid,)
            Grid and the low-passed source on it, `GRID_PER_PERIOD` times per period of the cut-off.
        trusted : ndarray of bool, shape (n_grid,)
            Flags, false where a gap is within the filter's reach.
        start_s, step_s
            Time base of the reference.
        target : ndarray, shape (n_reference,)
            Reference, low-passed alike.
        target_trusted : ndarray of bool, shape (n_reference,), optional
            All of it if left out. Where it is not, at the lag that the two are at already, rows are left out.
        low_pass
            Low-pass of both records; within its reach of the reference's ends no row is used.
        beside : ndarray, shape (n_grid, n_own), optional
        parts : sequence of ndarray, shape (n_reference,), optional
        u : ndarray, shape (n_own + n_parts,), optional
            Arrays as `beside`, `parts` and `u` are, of the rows, low-passed alike.
        """
        from scipy.interpolate import CubicSpline

        times_s = start_s + step_s * np.arange(target.size)
        curve = CubicSpline(times_s, target)
        end_s = start_s + step_s * (target.size - 1)
        at = np.arange(0, grid_s.size, STRIDE)
        sound = trusted[at]
        if target_trusted is not None:
            place = np.clip(np.round((grid_s[at] - start_s) / step_s).astype(np.int64), 0, target.size - 1)
            sound &= target_trusted[place]
        at = at[sound]
        reach = low_pass.reach_s
        origin = 0.5 * float(grid_s[0] + grid_s[-1])
        return cls(
            grid_s[at],
            smooth[at],
            origin,
            curve,
            curve.derivative(),
            start_s + reach,
            end_s - reach,
            beside=np.zeros((at.size, 0)) if beside is None else beside[at],
            parts=tuple(CubicSpline(times_s, part) for part in parts),
            u=np.zeros(0) if u is None else u,
        )


@dataclass(frozen=True, eq=False)
class LagSolution(ReadOnlyArrays):
    """Shift, drift and gain behind the last step.

    Attributes
    ----------
    u_shift_s
        Standard uncertainty of the mapped time in the middle of the motion.
    residual_share
        Root mean square of the residual over that of the source's signal.
    rows
        Number of rows that the shift rests on: the square of the sum of their information over the sum of its squares.
    influence : ndarray, shape (n_inside,)
        Shift of the mapped time in the middle of the motion per unit of each row's value.
    inside : ndarray of bool, shape (n_rows,)
        Rows that were used.
    converged
        Whether the last step was negligible.
    """

    shift_s: float
    drift: float
    gain: float
    u_shift_s: float
    u_drift: float
    u_gain: float
    residual_share: float
    rows: float
    influence: Array
    inside: Flags
    converged: bool


def solve_lag(rows: LagRows, shift_s: float, *, drift_allowance: float) -> LagSolution | str:
    """Find shift and drift, from a shift that is right within the correlation's lobe.

    Parameters
    ----------
    shift_s
        Shift to start from.
    drift_allowance
        Standard deviation of the drift's prior, which has the mean 0; without a drift if 0.

    Returns
    -------
    LagSolution or str
        A sentence where the shift is not identifiable.
    """
    steps, drift = 0, 0.0
    while True:
        solution = _step(rows, shift_s, drift, drift_allowance)
        if isinstance(solution, str):
            return solution
        steps += 1
        shift_s, drift = solution.shift_s, solution.drift
        if solution.converged or steps == MOST_STEPS:
            return solution


def _step(rows: LagRows, shift_s: float, drift: float, drift_allowance: float) -> LagSolution | str:
    mapped = rows.times_s + shift_s + drift * (rows.times_s - rows.origin_s)
    inside = (mapped > rows.first_s) & (mapped < rows.last_s)
    if rows.times_s.size < LEAST_ROWS_IN_COMMON:
        return "hardly any sample is far enough from a gap"
    if np.count_nonzero(inside) < LEAST_ROWS_IN_COMMON:
        return "the two records hardly overlap"
    since, values = rows.times_s[inside] - rows.origin_s, rows.values[inside]
    model, rate = rows.curve(mapped[inside]), rows.slope(mapped[inside])
    own = np.column_stack([model, np.ones_like(model), rows.beside[inside]])
    gain = float(np.linalg.lstsq(own, values, rcond=None)[0][0])
    beside = np.column_stack([rows.beside[inside], *(gain * part(mapped[inside]) for part in rows.parts)])
    design = np.column_stack([model, gain * rate, gain * rate * since, np.ones_like(model), beside])
    variance = _residual_variance(design, values)
    known = np.maximum([drift_allowance, *rows.u], 1e-12)
    prior = np.zeros((known.size, design.shape[1]))
    prior[np.arange(known.size), [2, *range(4, design.shape[1])]] = math.sqrt(variance) / known
    full, target = np.vstack([design, prior]), np.concatenate([values, -prior[:, 2] * drift])
    scale = np.sqrt((full**2).sum(axis=0))
    if not np.all(scale > 0) or np.linalg.cond(full / scale) > MOST_CONDITION:
        return "the offset is not identifiable from what both records show"
    bread = np.linalg.inv((full / scale).T @ (full / scale)) / np.outer(scale, scale)
    solution = bread @ (full.T @ target)
    residual = values - design @ solution
    information = rate**2
    pick = np.zeros(design.shape[1])
    pick[1:3] = 1.0, float(np.average(since, weights=information))
    covariance = _covariance(design, residual, prior, variance, bread, pick)
    step = float(np.clip(solution[1], -LONGEST_STEP_S, LONGEST_STEP_S))
    u_shift, u_drift, u_gain = np.sqrt([pick @ covariance @ pick, covariance[2, 2], covariance[0, 0]]).tolist()
    return LagSolution(
        shift_s=shift_s + step,
        drift=drift + float(solution[2]),
        gain=float(solution[0]),
        u_shift_s=u_shift,
        u_drift=min(u_drift, drift_allowance),
        u_gain=u_gain,
        residual_share=float(np.std(residual) / max(float(np.std(values)), 1e-300)),
        rows=float(information.sum() ** 2 / (information**2).sum()),
        influence=np.asarray(design @ (bread @ pick)),
        inside=inside,
        converged=abs(step) < max(NEGLIGIBLE_STEP * math.sqrt(float(covariance[1, 1])), 1e-10),
    )


def _residual_variance(design: Array, target: Array) -> float:
    solution, *_ = np.linalg.lstsq(design, target, rcond=None)
    residual = target - design @ solution
    return float(max(residual @ residual / max(target.size - design.shape[1], 1), 1e-300))


def _covariance(design: Array, residual: Array, prior: Array, variance: float, bread: Array, pick: Array) -> Array:
    """Covariance by the curvature, or by the residuals where they occur, whichever gives most for `pick`."""
    leverage = np.einsum("ij,jk,ik->i", design, bread, design)
    products = design * (residual / np.sqrt(np.maximum(1.0 - leverage, LEAST_HIDDEN)))[:, None]
    best = bread * variance
    for rows in CORRELATED_ROWS:
        scores = products.T @ products + variance * prior.T @ prior
        for lag in range(1, rows + 1):
            cross = products[lag:].T @ products[:-lag]
            scores += (1.0 - lag / (rows + 1)) * (cross + cross.T)
        candidate = bread @ scores @ bread
        if pick @ candidate @ pick > pick @ best @ pick:
            best = candidate
    return best
