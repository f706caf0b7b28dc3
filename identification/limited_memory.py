"""Limited-memory least squares: a fresh estimate at every sample from the last `window` samples alone.

Limited memory (finite history, rectangular sliding window) lets parameters vary while a shot runs. The
textbook forms subtract the row that leaves the window; after a shot of thousands of m/s^2 that leaves
round-off which buries the quiet part that follows. Here nothing is subtracted: see `windows`.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from identification.least_squares import LeastSquaresFit, least_squares
from identification.limited_memory_stream import LimitedMemory
from identification.samples import ScaledRecord, checked_samples
from identification.windowed_estimates import (
    REASONS,
    WindowedEstimates,
    WindowEstimate,
    WindowOperator,
    WindowPolicy,
    WindowStatus,
    is_sound,
    judged,
)
from identification.windows import (
    FloatArray,
    Solution,
    gram_of_windows,
    merge_factors,
    packed_rows,
    qr_of_runs,
    solve_gram,
    solve_qr,
)

__all__ = [
    "REASONS",
    "LeastSquaresFit",
    "LimitedMemory",
    "WindowEstimate",
    "WindowOperator",
    "WindowStatus",
    "WindowedEstimates",
    "least_squares",
    "limited_memory_least_squares",
]

GRAM_SAMPLES = 8192
"""Samples at a time for sums of products: the scratch stays in the processor's cache."""
QR_SAMPLES = 4096
"""Windows at a time that are merged from two factors, for the same reason."""
QR_BYTES = 24 * 2**20
"""Scratch for the factors of the blocks that are rotated together; one block at least."""


def limited_memory_least_squares(
    regressors: ArrayLike,
    response: ArrayLike,
    window: int,
    *,
    weights: ArrayLike | None = None,
    operator: Literal["auto", "gram", "qr"] = "auto",
    min_excitation: float | ArrayLike | None = None,
    max_relative_error: float | None = None,
    minimum_count: int | None = None,
    partial: bool = False,
) -> WindowedEstimates:
    """Estimate the parameters of ``response = regressors @ parameters`` in every window of a record.

    A row with a NaN, or with weight zero, is a missing sample: it is counted out of the windows that
    cover it and has no effect on any other. Scratch memory is a few tens of megabytes whatever the
    record's length, and grows with the window where one window alone takes more.

    Parameters
    ----------
    regressors : array_like, shape (n_samples, n_parameters)
        In any units. Never modified.
    response : array_like, shape (n_samples,)
        In any unit. Never modified.
    window : int
        Samples of a window, at least ``n_parameters + 1``.
    weights : array_like, shape (n_samples,), optional
        Proportional to one over the variance of the response; finite, not negative.
    operator : {"auto", "gram", "qr"}
        ``"auto"`` sums products and computes those windows again by rotations whose regressors are
        nearly collinear or whose residuals are next to nothing. ``"gram"`` never does: its error is
        about 30 eps / `smallest_pivot`, ten times that where a shot leaves the window. ``"qr"`` rotates everywhere.
    min_excitation : float or array_like, shape (n_parameters,), optional
        Least weighted sum of squares of each regressor in a window.
    max_relative_error : float, optional
        Largest standard error of the first parameter over its magnitude.
    minimum_count : int, optional
        Least number of samples present in a window, ``n_parameters + 1`` if omitted.
    partial : bool, default False
        Whether the first ``window - 1`` rows are estimated from the samples that there are.

    Returns
    -------
    WindowedEstimates
        Row k from samples ``k - window + 1`` to k.

    Raises
    ------
    ValueError
        For shapes that do not fit, infinite samples, weights that are not finite or negative, a window
        that is too short, or limits out of range.
    TypeError
        For complex samples or a window that is not an integer.

    Notes
    -----
    A regressor's samples below 2^-150 of its largest in the record count as zero. The standard errors
    hold for errors that are independent from sample to sample; they are far too small behind a low-pass
    filter. Where a regressor is nearly constant beside its mean, take the mean off before: the smallest
    pivot is uncentred.
    """
    if operator not in ("auto", "gram", "qr"):
        raise ValueError(f'operator must be "auto", "gram" or "qr", found {operator!r}')
    columns, response_column, weight = checked_samples(regressors, response, weights)
    n_samples, n_parameters = columns.shape
    policy = WindowPolicy(n_parameters, window, min_excitation, max_relative_error, minimum_count, partial)
    with np.errstate(under="ignore"):  # a product too small for float64 is as good as zero in every sum here
        record = ScaledRecord.of(columns, response_column, weight, min(int(window), max(n_samples, 1)))
        estimates = _Estimates(record, policy)
        if operator == "qr":
            estimates.by_rotations(np.ones(n_samples, dtype=np.bool_))
        else:
            unsound = estimates.by_products()
            if operator == "auto":
                estimates.by_rotations(unsound)
    return estimates.finished()


class _Estimates:
    """The estimates being filled in, block by block, by one operator or the other."""

    def __init__(self, record: ScaledRecord, policy: WindowPolicy) -> None:
        n_samples, n_parameters = record.n_samples, policy.n_parameters
        self.record, self.policy = record, policy
        self.parameters = np.full((n_parameters, n_samples), np.nan)
        self.standard_errors = np.full((n_parameters, n_samples), np.nan)
        self.residual_sum_of_squares = np.full(n_samples, np.nan)
        self.smallest_pivot = np.full(n_samples, np.nan)
        self.operator = np.full(n_samples, WindowOperator.GRAM, dtype=np.uint8)
        present = np.cumsum(record.present, dtype=np.int64)
        self.count = present.copy()
        self.count[record.block :] -= present[: -record.block]
        self.status = np.full(n_samples, WindowStatus.IDENTIFIED, dtype=np.uint8)
        self.status[self.count < policy.needed_count] = WindowStatus.TOO_FEW_SAMPLES
        if not policy.partial:
            self.status[: policy.window - 1] = WindowStatus.WINDOW_NOT_FULL
        self.tried = np.equal(self.status, WindowStatus.IDENTIFIED)
        with np.errstate(over="ignore"):  # a limit beyond float64 is one that no window reaches
            self.min_excitation = np.ldexp(policy.min_excitation, -2 * (record.exponents[:-1] + record.weight_exponent))

    def by_products(self) -> NDArray[np.bool_]:
        """Fill every window by sums of products; return where they are not sound enough."""
        record = self.record
        unsound = np.zeros(record.n_samples, dtype=np.bool_)
        at_once = max(1, GRAM_SAMPLES // record.block)
        for first in range(0, record.n_blocks, at_once):
            stop = min(first + at_once, record.n_blocks)
            windows = slice(first * record.block, min(stop * record.block, record.n_samples))
            gram = gram_of_windows(record.rows(first - 1, stop))[:, : windows.stop - windows.start]
            solution = solve_gram(gram, record.n_columns)
            self._fill(windows, solution)
            unsound[windows] = ~is_sound(solution)
        return unsound

    def by_rotations(self, wanted: NDArray[np.bool_]) -> None:
        """Fill the wanted windows by rotations."""
        wanted = wanted & self.tried
        blocks = np.unique(np.flatnonzero(wanted) // self.record.block)
        n_packed = packed_rows(self.record.n_columns)[-1].stop
        at_once = max(1, QR_BYTES // (2 * 8 * n_packed * self.record.block))
        for start in range(0, blocks.size, at_once):
            self._rotate(blocks[start : start + at_once], wanted)
        self.operator[wanted] = WindowOperator.QR

    def _rotate(self, blocks: NDArray[np.intp], wanted: NDArray[np.bool_]) -> None:
        """Fill the wanted windows that end in some blocks."""
        record, block = self.record, self.record.block
        factors = qr_of_runs(self._beginnings_and_endings(blocks))
        n_packed, n_blocks = factors.shape[1], blocks.size
        positions_at_once = max(1, QR_SAMPLES // n_blocks)
        for position in range(0, block, positions_at_once):
            positions = np.arange(position, min(position + positions_at_once, block))
            windows = (blocks * block + positions[:, np.newaxis]).ravel()
            chosen = np.flatnonzero(wanted[np.minimum(windows, record.n_samples - 1)] & (windows < record.n_samples))
            beginning = factors[positions + 1, :, :n_blocks].swapaxes(0, 1).reshape(n_packed, -1).take(chosen, axis=1)
            ending = factors[block - 1 - positions, :, n_blocks:].swapaxes(0, 1).reshape(n_packed, -1)
            merge_factors(beginning, ending.take(chosen, axis=1), record.n_columns)
            self._fill(windows[chosen], solve_qr(beginning, record.n_columns))

    def _beginnings_and_endings(self, blocks: NDArray[np.intp]) -> FloatArray:
        """Rows of the blocks, then of the blocks before them backwards, shape (n_columns, 2 * n_blocks, block)."""
        runs = np.split(blocks, np.flatnonzero(np.diff(blocks) > 1) + 1)
        rows = [self.record.rows(int(run[0]) - 1, int(run[-1]) + 1) for run in runs]
        return np.concatenate([run[:, 1:] for run in rows] + [run[:, :-1, ::-1] for run in rows], axis=1)

    def _fill(self, windows: slice | NDArray[np.intp], solution: Solution) -> None:
        """Judge a solution, and put it back into the caller's units."""
        exponents, response_exponent = self.record.exponents[:-1, np.newaxis], self.record.exponents[-1]
        degrees_of_freedom = self.count[windows] - self.policy.n_parameters
        status, standard_errors = judged(
            solution, degrees_of_freedom, self.min_excitation, self.policy.max_relative_error
        )
        tried = self.tried[windows]
        self.status[windows] = np.where(tried, status, self.status[windows])
        self.smallest_pivot[windows] = np.where(tried, solution.smallest_pivot, np.nan)
        identified = np.equal(self.status[windows], WindowStatus.IDENTIFIED)
        half = (response_exponent - exponents) // 2  # a quotient of scales may lie beyond float64, its root never
        unit = np.where(identified, np.ldexp(1.0, half), np.nan)
        other_unit = np.ldexp(1.0, response_exponent - exponents - half)
        self.parameters[:, windows] = solution.parameters * unit * other_unit
        self.standard_errors[:, windows] = standard_errors * unit * other_unit
        unit_of_root = np.where(identified, np.ldexp(1.0, response_exponent + self.record.weight_exponent), np.nan)
        with np.errstate(over="ignore"):  # a sum of squares beyond float64 is infinite; the estimates are not
            self.residual_sum_of_squares[windows] = solution.residual_sum_of_squares * unit_of_root * unit_of_root

    def finished(self) -> WindowedEstimates:
        """Return what has been filled in."""
        return WindowedEstimates(
            parameters=self.parameters.T,
            standard_errors=self.standard_errors.T,
            residual_sum_of_squares=self.residual_sum_of_squares,
            degrees_of_freedom=np.maximum(self.count - self.policy.n_parameters, 0),
            count=self.count,
            smallest_pivot=self.smallest_pivot,
            operator=self.operator,
            status=self.status,
        )
