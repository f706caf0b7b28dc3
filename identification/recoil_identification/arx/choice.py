"""Which band and which orders: the widest band in which a model leaves nothing behind.

Stress waves that leak through the low-pass are answers to the shot, not to the force as measured: they colour
the residuals, and higher orders then describe the leak. So the band is narrowed until the residuals of
a small model are white and independent of the force.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.errors import IdentificationError
from recoil_identification.arx.decimated_record import DecimatedRecord
from recoil_identification.arx.estimation import arx_regressors
from recoil_identification.arx.mass import one_step_errors
from recoil_identification.arx.model import ArxModel, ArxOrders
from recoil_identification.arx.orders import OrderTable, compare_orders
from recoil_identification.arx.residual_tests import ResidualTest, independence, whiteness
from recoil_identification.arx.response import poles

LAGS = 20
"""Of the tests of the residuals, where there are rows enough."""
MARGIN = 10.0
"""Of the criterion, within which a model whose residuals are white is preferred: beyond it evidence is decisive."""
LEVEL = 0.99
"""Of the tests."""


@dataclass(frozen=True, eq=False)
class ArxChoice:
    """A model, what it was chosen from, and the tests of its residuals.

    Attributes
    ----------
    share
        Of the shot's cut-off that the band has.
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
        """Whether the residuals pass both tests."""
        return self.white.passed and self.independent.passed


def choose_model(
    record_of: Callable[[float], DecimatedRecord], shares: Sequence[float], candidates: Sequence[ArxOrders]
) -> ArxChoice:
    """Choose band and orders.

    Parameters
    ----------
    record_of
        Gives the record for a share of the shot's cut-off.
    shares
        In the order in which they are tried, descending.

    Returns
    -------
    ArxChoice
        Of the first band whose model passes both tests; of the last one if none does.

    Raises
    ------
    IdentificationError
        If no model can be estimated, or its residuals are too few to be tested.
    ValueError
        Without a share.
    """
    if not shares:
        raise ValueError("there is no band to choose from")
    choice = _choice(record_of(shares[0]), shares[0], candidates)
    for share in shares[1:]:
        if choice.passed:
            break
        choice = _choice(record_of(share), share, candidates)
    return choice


def count_of_lags(n_rows: int, na: int) -> int:
    """Return how many lags a test of residuals looks at: `LAGS`, fewer of a short record, more than na."""
    return max(min(LAGS, n_rows // 4), na + 1)


def _choice(record: DecimatedRecord, share: float, candidates: Sequence[ArxOrders]) -> ArxChoice:
    force, acceleration = record.force_n, record.acceleration_m_s2
    table = compare_orders(force, acceleration, candidates, criterion="bic", step_s=record.step_s, rows=record.rows)
    model = _preferred(table)
    errors = one_step_errors(model, record)
    lags = count_of_lags(model.n_rows, model.orders.na)
    regressors = arx_regressors(force, acceleration, model.orders)
    try:
        white = whiteness(errors, lags, n_dynamic=model.orders.na, level=LEVEL)
        independent = independence(errors, np.nan_to_num(force), lags, regressors=regressors, level=LEVEL)
    except ValueError as error:
        raise IdentificationError(
            f"the residuals of {model.n_rows} rows cannot be tested: {error}",
            remedy="check for lost samples in the identification interval",
        ) from error
    return ArxChoice(record, share, table, model, white, independent)


def _preferred(table: OrderTable) -> ArxModel:
    """Return the best stable model whose residuals are white and whose criterion is near the best; else the best."""
    limit = table.ranked[0].score(table.criterion) + MARGIN
    for candidate in table.ranked:
        if candidate.score(table.criterion) > limit:
            break
        model = candidate.model
        if model is not None and candidate.whiteness_p >= 1.0 - LEVEL and poles(model).stable:
            return model
    return table.best
