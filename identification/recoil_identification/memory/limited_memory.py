"""Limited-memory least squares: a fresh estimate at every sample from the last `window` samples alone.

Limited memory (finite history, rectangular sliding window) lets parameters vary while a shot runs. The
textbook forms subtract the row that leaves the window; after a shot of thousands of m/s^2 that leaves
round-off which buries the quiet part that follows. Here nothing is subtracted: see `windows`.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from recoil_identification.memory.least_squares import LeastSquaresFit, least_squares
from recoil_identification.memory.limited_memory_batch import BatchEstimates
from recoil_identification.memory.samples import ScaledRecord, checked_samples
from recoil_identification.memory.window_policy import WindowPolicy
from recoil_identification.memory.windowed_estimates import (
    REASONS,
    WindowedEstimates,
    WindowOperator,
    WindowStatus,
)

__all__ = [
    "REASONS",
    "LeastSquaresFit",
    "WindowOperator",
    "WindowStatus",
    "WindowedEstimates",
    "least_squares",
    "limited_memory_least_squares",
]


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
    workers: int = 1,
    out: WindowedEstimates | None = None,
) -> WindowedEstimates:
    """Estimate the parameters of ``response = regressors @ parameters`` in every window of a record.

    A row with a NaN, or with weight zero, is a missing sample: it is counted out of the windows that
    cover it and has no effect on any other. Scratch memory is a few tens of megabytes whatever the
    record's length, and grows with the window where one window alone takes more.

    Parameters
    ----------
    regressors : array_like, shape (n_samples, n_parameters)
        In any units. Never modified.
    response : array_like, shape (n_samples,) or (n_samples, n_outputs)
        In any unit. Never modified. Outputs share the regressors and their factorisation; a sample that is
        missing in one is missing in all.
    window
        Samples of a window, at least ``n_parameters + 1``.
    weights : array_like, shape (n_samples,), optional
        Proportional to one over the variance of the response; finite, not negative.
    operator : {"auto", "gram", "qr"}
        ``"auto"`` sums products and computes those windows again by rotations whose regressors are
        nearly collinear or whose residuals are next to nothing. ``"gram"`` never does: its error is
        about 30 eps / `smallest_pivot`, ten times that where a shot leaves the window. ``"qr"`` rotates everywhere.
    min_excitation : float or array_like, shape (n_parameters,), optional
        Least weighted sum of squares of each regressor in a window.
    max_relative_error
        Largest standard error of the first parameter over its magnitude, in every output.
    minimum_count
        Least number of samples present in a window, ``n_parameters + 1`` if omitted.
    partial
        Whether the first ``window - 1`` rows are estimated from the samples that there are.
    workers
        Threads that share the work. The results are the same to the last bit whatever their number.
    out
        Results of an earlier call with as many samples, parameters and outputs, whose memory is used again: what
        they held is lost. With several regressors asking for new memory takes up to a fifth of the time.

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
    if isinstance(workers, bool) or not isinstance(workers, int | np.integer):
        raise TypeError(f"workers must be an integer number, found {workers!r}")
    if workers < 1:
        raise ValueError(f"workers must be at least 1, found {workers}")
    columns, outputs, weight = checked_samples(regressors, response, weights, many_outputs=True, scanned_later=True)
    n_samples, n_parameters = columns.shape
    policy = WindowPolicy(n_parameters, window, min_excitation, max_relative_error, minimum_count, partial)
    one_output = outputs.ndim == 1
    tables = columns, outputs[:, np.newaxis] if one_output else outputs
    if out is not None:
        _check_memory(out, n_samples, n_parameters, outputs.shape)
    with np.errstate(under="ignore"):  # a product too small for float64 is as good as zero in every sum here
        block = min(int(window), max(n_samples, 1))
        record = ScaledRecord.of(*tables, weight, block)
        estimates = BatchEstimates(record, policy, int(workers), out)
        if operator == "qr":
            estimates.by_rotations(np.ones(n_samples, dtype=np.bool_))
        else:
            sound = estimates.by_products()
            if not sound and operator == "auto":
                estimates.by_rotations(estimates.unsound)
            elif not sound:
                estimates.forget_unsound()
    return estimates.finished(one_output)


def _check_memory(out: WindowedEstimates, n_samples: int, n_parameters: int, response_shape: tuple[int, ...]) -> None:
    """Refuse results of another shape, or ones that are a part of others."""
    expected = (n_samples, n_parameters, *response_shape[1:])
    if out.parameters.shape != expected:
        raise ValueError(f"out must hold parameters of the shape {expected}, found {out.parameters.shape}")
    if (out.pivots is None) != (n_parameters == 1) or not all(
        np.moveaxis(values, 0, -1).flags.c_contiguous and values.flags.writeable
        for values in (out.parameters, out.standard_errors, out.residual_sum_of_squares, out.marks)
    ):
        raise ValueError("out must be what limited_memory_least_squares has returned, whole")
