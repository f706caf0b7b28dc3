"""What an estimate leaves of each kind of its rows, beside what it should leave.

If every row is as uncertain as it says, and everything known beforehand, too, the residuals of a least-squares estimate
have the covariance 1 - H, H being the projection on the rows' derivatives (D. A. Belsley, E. Kuh, R. E. Welsch,
Regression Diagnostics, 1980): of each kind of rows the squares of the residuals sum up to the sum of 1 - h.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recoil_identification.rows.late_readings import GAS
from recoil_identification.shot.identified import Identification
from recoil_identification.shot.shot_summary import LN_MASS_DRIFT, STEPS_AT, ShotSummary, ln_mass_step

Array = NDArray[np.float64]

LEAST_LEFT = 0.05
"""Part of a row's variance that the estimate leaves, below which it tells nothing of the row."""


@dataclass(frozen=True, eq=False)
class Residuals:
    """What is left of rows of one kind.

    Attributes
    ----------
    left : ndarray, shape (n_rows,)
    variances : ndarray, shape (n_rows,)
        What their squares are expected to be.
    """

    left: Array
    variances: Array

    @property
    def mean(self) -> float:
        """Mean of the residuals, each over its standard deviation."""
        return float(np.mean(self.left / np.sqrt(self.variances)))

    @property
    def mean_square(self) -> float:
        """Mean square of the residuals over what it should be."""
        return float(np.sum(self.left**2) / np.sum(self.variances))

    @property
    def freedom(self) -> float:
        """Degrees of freedom of the mean square."""
        return float(np.sum(self.variances))


def residuals_of(found: Identification) -> dict[str, Residuals]:
    """Return what is left of the rows of motion, frames and gauges, and of those of the summary, by their kind."""
    calibration = found.route.calibration
    names = [one.name for one in calibration.inferred.unknowns]
    motion, kinds = calibration.block.rows.size, dict[str, list[Residuals]]()
    for number, block in enumerate((calibration.rows, *calibration.further)):
        left, derivatives = block.linearised(calibration.values)
        at = [names.index(name) for name in block.unknowns]
        of = _judged(left, derivatives, calibration.inferred.covariance[np.ix_(at, at)])
        if number == 0:
            kinds["motion"], kinds["frames"] = [_part(of, slice(motion))], [_part(of, slice(motion, None))]
        else:
            kinds.setdefault("late readings" if GAS.name in block.unknowns else "gauges", []).append(of)
    assert found.summary is not None
    for name, one in _of_summary(found.summary).items():
        kinds[f"summary, {name}"] = [one]
    whole = {kind: joined(several) for kind, several in kinds.items()}
    return {kind: one for kind, one in whole.items() if one.left.size}


def joined(several: Iterable[Residuals]) -> Residuals:
    """Put rows of one kind together."""
    listed = list(several)
    return Residuals(np.concatenate([one.left for one in listed]), np.concatenate([one.variances for one in listed]))


def _judged(left: Array, derivatives: Array, covariance: Array) -> Residuals:
    return Residuals(left, 1.0 - np.einsum("ni,ij,nj->n", derivatives, covariance, derivatives))


def _part(of: Residuals, rows: slice) -> Residuals:
    """Take some rows, less those that the estimate takes as they are."""
    left, variances = of.left[rows], of.variances[rows]
    told = variances > LEAST_LEFT
    return Residuals(left[told], variances[told])


def _of_summary(summary: ShotSummary) -> dict[str, Residuals]:
    """Return what the shot's own estimate leaves of the rows of its summary: that by them and by the certificates."""
    fixed = {LN_MASS_DRIFT, *map(ln_mass_step, STEPS_AT)}
    u = np.array([math.hypot(*(u for _, u in one.influences)) for one in summary.parameters])
    free = [k for k, one in enumerate(summary.parameters) if one.name not in fixed and (k == 0 or u[k] > 0)]
    known = [k for k in free if k > 0]  # nothing is known of the mass beforehand
    prior = np.eye(len(summary.parameters))[known] / u[known, np.newaxis]
    rows = np.vstack([summary.triangle, prior])[:, free]
    seen = np.concatenate([summary.seen, -summary.reference[known] / u[known]])
    size = np.linalg.norm(rows, axis=0)
    solution, *_ = np.linalg.lstsq(rows / size, seen, rcond=None)
    left = (seen - rows / size @ solution)[: len(summary.parameters)]
    inverse = np.linalg.pinv(rows / size)
    of = Residuals(left, 1.0 - np.einsum("nk,kn->n", summary.triangle[:, free] / size, inverse[:, : left.size]))
    told = np.abs(summary.triangle).max(axis=1) > 1e-9 * np.abs(summary.triangle).max()
    return {one.name: _part(of, slice(k, k + 1)) for k, one in enumerate(summary.parameters) if told[k]}
