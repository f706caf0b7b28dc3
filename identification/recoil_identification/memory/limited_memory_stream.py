"""Limited-memory least squares while the record is still growing, by samples or by packets of them."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from recoil_identification.memory.rotations import solve_qr, triangle_of_rows
from recoil_identification.memory.samples import checked_samples
from recoil_identification.memory.window_policy import WindowPolicy, is_sound, judged
from recoil_identification.memory.windowed_estimates import (
    QR_BIT,
    WindowedEstimates,
    WindowEstimate,
    WindowOperator,
    WindowStatus,
)
from recoil_identification.memory.windows import FloatArray, Packing, Solution, products_of_rows, solve_gram


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
        n_outputs: int | None = None,
        min_excitation: float | ArrayLike | None = None,
        max_relative_error: float | None = None,
        minimum_count: int | None = None,
        partial: bool = False,
    ) -> None:
        self._policy = WindowPolicy(n_parameters, window, min_excitation, max_relative_error, minimum_count, partial)
        if isinstance(n_outputs, bool) or not isinstance(n_outputs, int | np.integer | None):
            raise TypeError(f"n_outputs must be an integer number, found {n_outputs!r}")
        if n_outputs is not None and n_outputs < 1:
            raise ValueError(f"n_outputs must be at least 1, found {n_outputs}")
        self._one_output = n_outputs is None
        self._packing = Packing(int(n_parameters), 1 if n_outputs is None else int(n_outputs))
        self._rows = np.zeros((window, self._packing.n_columns))
        self._present = np.zeros(window, dtype=np.bool_)
        self._endings = np.zeros((window + 1, self._packing.n_entries))
        self._beginning = np.zeros(self._packing.n_entries)
        self._position = 0
        self._count = 0
        self._n_seen = 0

    def update(self, regressors: ArrayLike, response: ArrayLike, weight: float = 1.0) -> WindowEstimate:
        """Take one sample, and estimate from the window that ends with it.

        Parameters
        ----------
        regressors : array_like, shape (n_parameters,)
            NaN for a missing sample.
        response : float, or array_like of shape (n_outputs,)
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
        left = one.residual_sum_of_squares
        return WindowEstimate(
            parameters=one.parameters[0],
            standard_errors=one.standard_errors[0],
            residual_sum_of_squares=float(left[0]) if self._one_output else left[0],
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
        response : array_like, shape (n_samples,) or (n_samples, n_outputs)
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
        columns, outputs, weight = checked_samples(regressors, response, weights, many_outputs=not self._one_output)
        if columns.shape[1] != self._policy.n_parameters:
            raise ValueError(f"regressors must have {self._policy.n_parameters} columns, found {columns.shape[1]}")
        if not self._one_output and outputs.shape[1:] != (self._packing.n_outputs,):
            raise ValueError(f"response must have {self._packing.n_outputs} columns, found shape {outputs.shape}")
        rows = np.column_stack([columns, outputs])
        present = np.asarray(~np.isnan(rows).any(axis=1))
        if weight is not None:
            present &= weight > 0.0
            rows *= np.sqrt(weight)[:, np.newaxis]
        rows[~present] = 0.0
        with np.errstate(over="ignore", under="ignore"):
            products = products_of_rows(rows.T, self._packing).T
            if not np.isfinite(products).all():
                raise ValueError("regressors and response must have finite squares; a missing sample is NaN")
            pieces: list[WindowedEstimates] = []
            taken = 0
            while taken < rows.shape[0] or not pieces:
                piece = slice(taken, taken + self._policy.window - self._position)
                pieces.append(self._take(rows[piece], present[piece], products[piece]))
                taken = piece.stop
        return joined(pieces)

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
        solution = solve_gram(gram, self._packing)
        unsound = tried & ~is_sound(solution)
        for i in np.flatnonzero(unsound):
            window = np.concatenate([rows[: i + 1], self._rows[start + i + 1 :], self._rows[:start]])
            _replace(solution, int(i), solve_qr(triangle_of_rows(window, self._packing), self._packing))
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
            self._endings[:-1] = np.cumsum(products_of_rows(self._rows[::-1].T, self._packing).T, axis=0)[::-1]
            self._beginning, self._position = np.zeros_like(self._beginning), 0
        estimates, left = solution.parameters, solution.residual_sum_of_squares
        for values in (estimates, standard_errors, left):
            values[..., ~identified] = np.nan
        one = self._one_output
        return WindowedEstimates(
            parameters=estimates[:, 0].T if one else np.moveaxis(estimates, -1, 0),
            standard_errors=standard_errors[:, 0].T if one else np.moveaxis(standard_errors, -1, 0),
            residual_sum_of_squares=left[0] if one else left.T,
            marks=status | np.where(unsound, np.uint8(QR_BIT), np.uint8(0)),
            pivots=np.where(tried, solution.smallest_pivot, np.nan),
            counts=count,
            window=int(policy.window),
            first=self._n_seen - rows.shape[0],
        )


def joined(pieces: list[WindowedEstimates]) -> WindowedEstimates:
    """Join estimates of consecutive packets.

    Parameters
    ----------
    pieces : list of WindowedEstimates
        Of one stream, at least one.

    Returns
    -------
    WindowedEstimates
    """

    def of(name: str) -> NDArray[Any]:
        return np.concatenate([getattr(piece, name) for piece in pieces])

    return WindowedEstimates(
        parameters=of("parameters"),
        standard_errors=of("standard_errors"),
        residual_sum_of_squares=of("residual_sum_of_squares"),
        marks=of("marks"),
        pivots=of("smallest_pivot"),
        counts=of("count"),
        window=pieces[0].window,
        first=pieces[0].first,
    )


def _replace(solution: Solution, window: int, by: Solution) -> None:
    """Put the solution of one window in the place of another, in place."""
    for part in fields(Solution):
        getattr(solution, part.name)[..., window] = getattr(by, part.name)[..., 0]
