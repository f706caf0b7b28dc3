"""Choice of an ARX model's orders: every candidate fitted to the same rows, compared by one criterion.

Criteria compare only on the same data. So a row counts if the largest candidate can use it, and all
candidates are fitted to those rows, however little of the past they need themselves.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from recoil_acquisition.errors import IdentificationError
from recoil_identification.arx.estimation import arx_regressors, checked_record, estimate_arx, residuals
from recoil_identification.arx.model import ArxModel, ArxOrders
from recoil_identification.arx.residual_tests import whiteness

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

Criterion = Literal["aic", "aicc", "bic", "fpe", "validation"]
WHITENESS_LAGS = 20
"""Lags of the whiteness test of each candidate, where it has so many rows."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """One set of orders and what came of it.

    Attributes
    ----------
    model
        None where it could not be estimated.
    validation_loss
        Mean square of the errors one sample ahead on the rows kept for validation; NaN without them.
    whiteness_p
        Probability of so much correlation in white residuals; NaN where it cannot be told.
    refusal
        Why there is no model; empty if there is one.
    """

    orders: ArxOrders
    model: ArxModel | None
    validation_loss: float = math.nan
    whiteness_p: float = math.nan
    refusal: str = ""

    def score(self, criterion: Criterion) -> float:
        """Return the criterion, smaller is better; infinite where it is not known."""
        if self.model is None:
            return math.inf
        value = self.validation_loss if criterion == "validation" else float(getattr(self.model, criterion))
        return math.inf if math.isnan(value) else value


@dataclass(frozen=True, eq=False)
class OrderTable:
    """All candidates.

    Attributes
    ----------
    candidates
        In the order in which they were asked for.
    criterion
        That decides.
    estimation, validation : ndarray of bool, shape (n_samples,)
        Rows that every candidate was fitted to, and rows kept to judge it by.
    """

    candidates: tuple[Candidate, ...]
    criterion: Criterion
    estimation: Flags
    validation: Flags

    @property
    def ranked(self) -> tuple[Candidate, ...]:
        """Candidates that could be estimated, the best first; of equals the one with fewer parameters."""
        found = [c for c in self.candidates if c.model is not None]
        return tuple(sorted(found, key=lambda c: (c.score(self.criterion), c.orders.n_parameters, c.orders)))

    @property
    def best(self) -> ArxModel:
        """The model with the least criterion."""
        model = self.ranked[0].model
        if model is None:  # pragma: no cover - only candidates with a model are ranked
            raise RuntimeError("a ranked candidate has no model")
        return model

    def near(self, margin: float) -> tuple[ArxModel, ...]:
        """Return the models whose criterion is within a margin of the best one's, the best first."""
        ranked = self.ranked
        limit = ranked[0].score(self.criterion) + margin
        return tuple(c.model for c in ranked if c.model is not None and c.score(self.criterion) <= limit)


def order_grid(na: Sequence[int], nb: Sequence[int], delay: Sequence[int] = (0,)) -> list[ArxOrders]:
    """Combine all orders.

    Returns
    -------
    list of ArxOrders

    Raises
    ------
    ValueError
        If one is empty or has a negative number.
    """
    grid = [ArxOrders(i, j, d) for i in na for j in nb for d in delay]
    if not grid:
        raise ValueError("na, nb and delay need one order each at least")
    return grid


def halves(rows: Flags) -> tuple[Flags, Flags]:
    """Split rows into an earlier and a later half.

    Parameters
    ----------
    rows : ndarray of bool, shape (n_samples,)

    Returns
    -------
    earlier, later : ndarray of bool, shape (n_samples,)
    """
    chosen = np.flatnonzero(rows)
    later = np.zeros(np.shape(rows), dtype=np.bool_)
    later[chosen[chosen.size // 2 :]] = True
    return np.asarray(rows, dtype=np.bool_) & ~later, later


def compare_orders(
    input_: ArrayLike,
    output: ArrayLike,
    candidates: Iterable[ArxOrders],
    *,
    criterion: Criterion = "bic",
    step_s: float = 1.0,
    rows: Flags | None = None,
    validation: Flags | None = None,
) -> OrderTable:
    """Fit every candidate to the same rows.

    Parameters
    ----------
    input_, output : array_like, shape (n_samples,)
        Evenly sampled; NaN for a lost sample. Never modified.
    criterion : {"bic", "aic", "aicc", "fpe", "validation"}
        What decides. ``"validation"`` is the mean square error one sample ahead on the rows of `validation`.
    rows : ndarray of bool, shape (n_samples,), optional
        Instants whose equations are fitted; all if left out.
    validation : ndarray of bool, shape (n_samples,), optional
        Instants to judge by. They are not fitted, even where `rows` has them.

    Returns
    -------
    OrderTable
        A candidate that cannot be estimated stays in it, with the reason.

    Raises
    ------
    ValueError
        Without a candidate, for an unknown criterion, for validation without its rows, or as `estimate_arx`.
    TypeError
        As `estimate_arx`.
    IdentificationError
        If no candidate can be estimated, or no row is left for validation.
    """
    u, y = checked_record(input_, output)
    grid = tuple(candidates)
    if not grid:
        raise ValueError("there is no candidate to compare")
    if criterion not in get_args(Criterion):
        raise ValueError(f"criterion must be one of {', '.join(get_args(Criterion))}, not {criterion!r}")
    if criterion == "validation" and validation is None:
        raise ValueError("to judge by validation, say which rows are kept for it")
    for flags in (rows, validation):
        if flags is not None and np.shape(flags) != y.shape:
            raise ValueError(f"rows must have the shape {y.shape}, found {np.shape(flags)}")
    usable = usable_rows(u, y, grid)
    kept = np.zeros(y.size, dtype=np.bool_) if validation is None else usable & np.asarray(validation, dtype=np.bool_)
    fitted = (usable if rows is None else usable & np.asarray(rows, dtype=np.bool_)) & ~kept
    if validation is not None and not kept.any():
        raise IdentificationError(
            "no row is left for validation", expected="rows whose samples were all measured", found="none"
        )
    table = OrderTable(
        tuple(_candidate(u, y, orders, step_s, fitted, kept) for orders in grid), criterion, fitted, kept
    )
    if not table.ranked:
        raise IdentificationError(
            "no model of any order can be estimated",
            expected=f"one of {len(grid)}, from {int(fitted.sum())} rows",
            found=table.candidates[0].refusal,
            remedy="check that the input has a signal in the rows that are fitted, or allow smaller orders",
        )
    return table


def usable_rows(input_: Array, output: Array, candidates: Iterable[ArxOrders]) -> Flags:
    """Return the instants whose equations every candidate can use, shape (n_samples,)."""
    widest = tuple(candidates)
    na = max(orders.na for orders in widest)
    first = min(orders.delay for orders in widest)
    last = max(orders.delay + orders.nb for orders in widest)
    needed = arx_regressors(input_, output, ArxOrders(na, last - first, first))
    return np.asarray(np.isfinite(needed).all(axis=1) & np.isfinite(output))


def _candidate(u: Array, y: Array, orders: ArxOrders, step_s: float, fitted: Flags, kept: Flags) -> Candidate:
    try:
        model = estimate_arx(u, y, orders, step_s=step_s, rows=fitted)
    except IdentificationError as error:
        return Candidate(orders, None, refusal=str(error))
    errors = residuals(model, u, y)
    loss = float(np.mean(errors[kept] ** 2)) if kept.any() else math.nan
    return Candidate(orders, model, loss, _whiteness(errors, fitted, orders.na))


def _whiteness(errors: Array, fitted: Flags, na: int) -> float:
    inside = np.flatnonzero(fitted)
    span = np.where(fitted, errors, np.nan)[inside[0] : inside[-1] + 1]
    lags = max(min(WHITENESS_LAGS, inside.size // 4), na + 1)
    try:
        return whiteness(span, lags, n_dynamic=na).p_value
    except ValueError:  # a perfect fit, or rows too few to tell
        return math.nan
