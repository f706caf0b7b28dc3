"""Limited-memory least squares while the record is still growing, by samples or by packets of them."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
from numpy.typing import ArrayLike, NDArray

from identification.samples import checked_samples
from identification.windowed_estimates import (
    WindowedEstimates,
    WindowEstimate,
    WindowOperator,
    WindowPolicy,
    WindowStatus,
    is_sound,
    judged,
)
from identification.windows import FloatArray, Solution, packed_rows, solve_gram, solve_qr, triangle_of_rows


class LimitedMemory:
    """Sliding-window least squares that takes samples as they come.

    It keeps the last `window` rows, the sums of products of every ending of the block before, and the
    running sums of the block that is being filled. A sample costs the same whatever the window; one in
    `window` of them renews the endings. The estimates are those of `limited_memory_least_squares` with
    ``operator="auto"`` over the same samples, but for round-off. Packets cost far less per sample than
    samples one by one.

    Parameters
    ----------
    n_parameters : int
    window : int
        Samples of a window, at least ``n_parameters + 1``.
    min_excitation, max_relative_error, minimum_count, partial
        As for `limited_memory_least_squares`.

    Raises
    ------
    ValueError
        If the window is too short or a limit is out of range.
    TypeError
        If a number of samples is not an integer.
    """

    def __init__(
        self,
        n_parameters: int,
        window: int,
        *,
        min_excitation: float | ArrayLike | None = None,
        max_relative_error: float | None = None,
        minimum_count: int | None = None,
        partial: bool = False,
    ) -> None:
        self._policy = WindowPolicy(n_parameters, window, min_excitation, max_relative_error, minimum_count, partial)
        n_packed = packed_rows(n_parameters + 1)[-1].stop
        self._rows = np.zeros((window, n_parameters + 1))
        self._present = np.zeros(window, dtype=np.bool_)
        self._endings = np.zeros((window + 1, n_packed))
        self._beginning = np.zeros(n_packed)
        self._position = 0
        self._count = 0
        self._n_seen = 0

    def update(self, regressors: ArrayLike, response: float, weight: float = 1.0) -> WindowEstimate:
        """Take one sample, and estimate from the window that ends with it.

        Parameters
        ----------
        regressors : array_like, shape (n_parameters,)
            NaN for a missing sample.
        response : float
            NaN for a missing sample.
        weight : float, default 1.0
            Proportional to one over the variance of the response; zero for a missing sample.

        Returns
        -------
        WindowEstimate

        Raises
        ------
        ValueError, TypeError
            As `extend`.
        """
        one = self.extend(np.asarray(regressors)[np.newaxis], np.asarray(response)[np.newaxis], [weight])
        return WindowEstimate(
            parameters=one.parameters[0],
            standard_errors=one.standard_errors[0],
            residual_sum_of_squares=float(one.residual_sum_of_squares[0]),
            degrees_of_freedom=int(one.degrees_of_freedom[0]),
            count=int(one.count[0]),
            smallest_pivot=float(one.smallest_pivot[0]),
            operator=WindowOperator(one.operator[0]),
            status=WindowStatus(one.status[0]),
        )

    def extend(self, regressors: ArrayLike, response: ArrayLike, weights: ArrayLike | None = None) -> WindowedEstimates:
        """Take a packet of samples, and estimate from the windows that end with each of them.

        Parameters
        ----------
        regressors : array_like, shape (n_samples, n_parameters)
            A row with a NaN is a missing sample.
        response : array_like, shape (n_samples,)
            NaN is a missing sample.
        weights : array_like, shape (n_samples,), optional
            Proportional to one over the variance of the response; zero is a missing sample.

        Returns
        -------
        WindowedEstimates
            One row for each sample of the packet.

        Raises
        ------
        ValueError
            For shapes that do not fit, samples whose squares are not finite, weights that are not finite
            or negative. Nothing of the packet is taken then.
        TypeError
            For complex samples.
        """
        columns, response_column, weight = checked_samples(regressors, response, weights)
        if columns.shape[1] != self._policy.n_parameters:
            raise ValueError(f"regressors must have {self._policy.n_parameters} columns, found {columns.shape[1]}")
        rows = np.column_stack([columns, response_column])
        present = np.asarray(~np.isnan(rows).any(axis=1))
        if weight is not None:
            present &= weight > 0.0
            rows *= np.sqrt(weight)[:, np.newaxis]
        rows[~present] = 0.0
        with np.errstate(over="ignore", under="ignore"):
            products = _products(rows)
            if not np.isfinite(products).all():
                raise ValueError("regressors and response must have finite squares; a missing sample is NaN")
            pieces: list[WindowedEstimates] = []
            taken = 0
            while taken < rows.shape[0] or not pieces:
                piece = slice(taken, taken + self._policy.window - self._position)
                pieces.append(self._take(rows[piece], present[piece], products[piece]))
                taken = piece.stop
        return WindowedEstimates(
            **{f.name: np.concatenate([getattr(p, f.name) for p in pieces]) for f in fields(WindowedEstimates)}
        )

    def _take(self, rows: FloatArray, present: NDArray[np.bool_], products: FloatArray) -> WindowedEstimates:
        """Take rows that fit into the block, estimate, and begin a new block where this one is full."""
        policy, start = self._policy, self._position
        stop = start + rows.shape[0]
        count = self._count + np.cumsum(present.astype(np.int64) - self._present[start:stop])
        beginnings = np.cumsum(np.vstack([self._beginning, products]), axis=0)
        tried = count >= policy.needed_count
        status = np.where(tried, WindowStatus.IDENTIFIED, WindowStatus.TOO_FEW_SAMPLES).astype(np.uint8)
        if not policy.partial:
            short = np.arange(1, rows.shape[0] + 1) + self._n_seen < policy.window
            status[short], tried[short] = WindowStatus.WINDOW_NOT_FULL, False
        gram = np.ascontiguousarray((beginnings[1:] + self._endings[start + 1 : stop + 1]).T)
        solution = solve_gram(gram, policy.n_parameters + 1)
        operator = np.where(tried & ~is_sound(solution), WindowOperator.QR, WindowOperator.GRAM).astype(np.uint8)
        for i in np.flatnonzero(np.equal(operator, WindowOperator.QR)):
            window = np.concatenate([rows[: i + 1], self._rows[start + i + 1 :], self._rows[:start]])
            _replace(solution, int(i), solve_qr(triangle_of_rows(window), policy.n_parameters + 1))
        degrees_of_freedom = count - policy.n_parameters
        judgement, standard_errors = judged(
            solution, degrees_of_freedom, policy.min_excitation, policy.max_relative_error
        )
        status[tried] = judgement[tried]
        identified = np.equal(status, WindowStatus.IDENTIFIED)
        self._count += int(present.sum()) - int(self._present[start:stop].sum())
        self._rows[start:stop], self._present[start:stop] = rows, present
        self._beginning, self._position, self._n_seen = beginnings[-1], stop, self._n_seen + rows.shape[0]
        if stop == policy.window:
            self._endings[:-1] = np.cumsum(_products(self._rows[::-1]), axis=0)[::-1]
            self._beginning, self._position = np.zeros_like(self._beginning), 0
        return WindowedEstimates(
            parameters=np.where(identified, solution.parameters, np.nan).T,
            standard_errors=np.where(identified, standard_errors, np.nan).T,
            residual_sum_of_squares=np.where(identified, solution.residual_sum_of_squares, np.nan),
            degrees_of_freedom=np.maximum(degrees_of_freedom, 0),
            count=count,
            smallest_pivot=np.where(tried, solution.smallest_pivot, np.nan),
            operator=operator,
            status=status,
        )


def _products(rows: FloatArray) -> FloatArray:
    """Packed products of the columns of each row, shape (n_rows, n_packed)."""
    return np.concatenate([rows[:, j : j + 1] * rows[:, j:] for j in range(rows.shape[1])], axis=1)


def _replace(solution: Solution, window: int, by: Solution) -> None:
    """Put the solution of one window in the place of another, in place."""
    for part in fields(Solution):
        getattr(solution, part.name)[..., window] = getattr(by, part.name)[..., 0]
