"""Which band and which orders: the widest band in which a model leaves nothing behind.

Stress waves that leak through the low-pass are answers to the shot, not to the force as measured: they colour
the residuals, and higher orders then describe the leak. So the band is narrowed until the residuals of
a small model are white and independent of the force.

Orders are compared by Bayes' criterion. Criteria compare only on the same data, so a row counts if the largest
candidate can use it, and all candidates are fitted to those rows, however little of the past they need themselves.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.numerics.arrays import Flags
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_identification.targets.arx.decimated_record import DecimatedRecord
from recoil_identification.targets.arx.model import ArxModel, ArxOrders, arx_regressors, estimate_arx, residuals
from recoil_identification.targets.arx.residual_tests import LEVEL, ResidualTest, independence, whiteness
from recoil_identification.targets.arx.response import poles

LAGS = 20
"""Lags of the tests of the residuals, where there are rows enough."""
MARGIN = 10.0
"""Margin of the criterion within which a model whose residuals are white is preferred: beyond it evidence is
decisive."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """One set of orders and what came of it.

    Attributes
    ----------
    model
        Model of these orders; None where it could not be estimated.
    white
        Test of its residuals; None where there is none.
    refusal
        Reason why there is no model; empty if there is one.
    """

    orders: ArxOrders
    model: ArxModel | None
    white: ResidualTest | None = None
    refusal: str = ""


@dataclass(frozen=True, eq=False)
class OrderTable(ReadOnlyArrays):
    """All candidates.

    Attributes
    ----------
    candidates
        Candidates in the order in which they were asked for.
    rows : ndarray of bool, shape (n_samples,)
        Rows that every candidate was fitted to.
    """

    candidates: tuple[Candidate, ...]
    rows: Flags

    @property
    def ranked(self) -> tuple[tuple[ArxModel, Candidate], ...]:
        """Models with their candidates, the least criterion first; of equals the one with fewer parameters."""
        found = [(c.model, c) for c in self.candidates if c.model is not None]
        return tuple(sorted(found, key=lambda one: (one[0].bic, one[0].orders.n_parameters, one[0].orders)))

    def near(self, margin: float) -> tuple[ArxModel, ...]:
        """Return the models whose criterion is within a margin of the best one's, the best first."""
        ranked = self.ranked
        return tuple(model for model, _ in ranked if model.bic <= ranked[0][0].bic + margin)


@dataclass(frozen=True, eq=False)
class ArxChoice:
    """A model, what it was chosen from, and the tests of its residuals.

    Attributes
    ----------
    share
        Share of the shot's cut-off that the band has.
    white, independent
        Correlation in time, and with the force.
    """

    record: DecimatedRecord
    share: float
    table: OrderTable
    model: ArxModel
    white: ResidualTest
    independent: ResidualTest

    @property
    def passed(self) -> bool:
        """True if the residuals pass both tests."""
        return self.white.passed and self.independent.passed


def order_grid(na: Sequence[int], nb: Sequence[int], delay: Sequence[int] = (0,)) -> list[ArxOrders]:
    """Combine all orders."""
    return [ArxOrders(i, j, d) for i in na for j in nb for d in delay]


def choose_model(
    record_of: Callable[[float], DecimatedRecord], shares: Sequence[float], candidates: Sequence[ArxOrders]
) -> ArxChoice:
    """Choose band and orders.

    Parameters
    ----------
    record_of
        Function that gives the record for a share of the shot's cut-off.
    shares
        Shares in the order in which they are tried, descending; one at least.

    Returns
    -------
    ArxChoice
        Choice of the first band whose model passes both tests; of the last one if none does.

    Raises
    ------
    IdentificationError
        If no model can be estimated, or its residuals are too few to be tested.
    """
    choice = _choice(record_of(shares[0]), shares[0], candidates)
    for share in shares[1:]:
        if choice.passed:
            break
        choice = _choice(record_of(share), share, candidates)
    return choice


def compare_orders(record: DecimatedRecord, candidates: Sequence[ArxOrders]) -> OrderTable:
    """Fit every candidate to the same rows.

    Returns
    -------
    OrderTable
        A candidate that cannot be estimated stays in it, with the reason.

    Raises
    ------
    IdentificationError
        If no candidate can be estimated.
    """
    na = max(orders.na for orders in candidates)
    first = min(orders.delay for orders in candidates)
    last = max(orders.delay + orders.nb for orders in candidates)
    widest = arx_regressors(record.force_n, record.acceleration_m_s2, ArxOrders(na, last - first, first))
    usable = np.isfinite(widest).all(axis=1) & np.isfinite(record.acceleration_m_s2)
    rows = np.asarray(usable & record.rows)
    table = OrderTable(tuple(_candidate(record, orders, rows) for orders in candidates), rows)
    if not table.ranked:
        raise IdentificationError(
            "no model of any order can be estimated",
            expected=f"one of {len(candidates)}, from {int(rows.sum())} rows",
            found=table.candidates[0].refusal,
            remedy="check that the input has a signal in the rows that are fitted, or allow smaller orders",
        )
    return table


def _candidate(record: DecimatedRecord, orders: ArxOrders, rows: Flags) -> Candidate:
    try:
        model = estimate_arx(record.force_n, record.acceleration_m_s2, orders, step_s=record.step_s, rows=rows)
    except IdentificationError as error:
        return Candidate(orders, None, refusal=str(error))
    errors = np.where(rows, residuals(model, record.force_n, record.acceleration_m_s2), np.nan)
    try:
        white = whiteness(errors, _count_of_lags(model), n_dynamic=orders.na)
    except ValueError:  # a perfect fit, or rows too few to tell
        white = None
    return Candidate(orders, model, white)


def _count_of_lags(model: ArxModel) -> int:
    """Return how many lags a test of residuals looks at: `LAGS`, fewer of a short record, more than na."""
    return max(min(LAGS, model.n_rows // 4), model.orders.na + 1)


def _choice(record: DecimatedRecord, share: float, candidates: Sequence[ArxOrders]) -> ArxChoice:
    force, acceleration = record.force_n, record.acceleration_m_s2
    table = compare_orders(record, candidates)
    model = _preferred(table)
    errors = np.where(record.rows, residuals(model, force, acceleration), np.nan)
    lags = _count_of_lags(model)
    try:
        white = whiteness(errors, lags, n_dynamic=model.orders.na)
        independent = independence(errors, force, lags, arx_regressors(force, acceleration, model.orders))
    except ValueError as error:
        raise IdentificationError(
            f"the residuals of {model.n_rows} rows cannot be tested: {error}",
            remedy="check for lost samples in the identification interval",
        ) from error
    return ArxChoice(record, share, table, model, white, independent)


def _preferred(table: OrderTable) -> ArxModel:
    """Return the best stable model whose residuals are white and whose criterion is near the best; else the best."""
    best = table.ranked[0][0]
    for model, candidate in table.ranked:
        if model.bic > best.bic + MARGIN:
            break
        p_value = math.nan if candidate.white is None else candidate.white.p_value
        if p_value >= 1.0 - LEVEL and poles(model).stable:
            return model
    return best
