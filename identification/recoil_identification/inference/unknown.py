"""Unknowns, and what is known of them beforehand."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays

Scope = Literal["sensor", "rig", "shot"]
ROUNDING = 1e-9
"""Correlation by which the two halves of a covariance may differ."""


@dataclass(frozen=True)
class Unknown:
    """A number that is looked for.

    Attributes
    ----------
    unit
        ``1`` for a logarithm: of a scale's error, or of a mass over a first estimate.
    scope
        Reach of its value: every shot of a sensor, every shot of a rig, or this shot alone.
    largest_step
        Largest amount by which one iteration may move it: far away a linear model says nothing.
    """

    name: str
    unit: str = "1"
    scope: Scope = "shot"
    largest_step: float = math.inf


@dataclass(frozen=True, eq=False)
class Prior(ReadOnlyArrays):
    """Knowledge of some unknowns beforehand: ``rows @ unknowns`` is ``values``, with a covariance.

    Attributes
    ----------
    sources
        Name of each row, as a budget lists it.
    unknowns
        Names of the columns.
    rows : ndarray, shape (n_rows, n_unknowns)
    values : ndarray, shape (n_rows,)
    covariance : ndarray, shape (n_rows, n_rows)
        Positive definite, or the one variance of a row about one unknown is zero: that unknown is then exactly known.
    degrees_of_freedom
        Degrees of freedom of the covariance (JCGM 100:2008, G.4); infinite where it is taken as known.

    Raises
    ------
    ValueError
        If the shapes do not agree, a number is not finite, or the covariance is none.
    """

    sources: tuple[str, ...]
    unknowns: tuple[str, ...]
    rows: Array
    values: Array
    covariance: Array
    degrees_of_freedom: float = math.inf

    def __post_init__(self) -> None:
        super().__post_init__()
        n, k = len(self.sources), len(self.unknowns)
        shapes = self.rows.shape, self.values.shape, self.covariance.shape
        if shapes != ((n, k), (n,), (n, n)):
            raise ValueError(f"a prior of {n} rows about {k} unknowns cannot have the shapes {shapes}")
        if not all(np.isfinite(part).all() for part in (self.rows, self.values, self.covariance)):
            raise ValueError(f"the prior {', '.join(self.sources)} must be finite")
        if not self.exact and not _is_covariance(self.covariance):
            raise ValueError(f"the covariance of {', '.join(self.sources)} must be symmetric and positive definite")

    @classmethod
    def of(cls, source: str, unknown: str, u: float, value: float = 0.0, degrees_of_freedom: float = math.inf) -> Prior:
        """State the value and the standard uncertainty of one unknown."""
        return cls((source,), (unknown,), np.ones((1, 1)), np.array([value]), np.array([[u**2]]), degrees_of_freedom)

    @property
    def exact(self) -> bool:
        """True if it states an unknown exactly."""
        return self.rows.shape == (1, 1) and self.rows[0, 0] != 0 and self.covariance[0, 0] == 0


@dataclass(frozen=True)
class Reliability:
    """Knowledge of a standard uncertainty.

    Attributes
    ----------
    degrees_of_freedom
        Degrees of freedom of it.
    u_rel
        Share to which it is known if it is a guess; 0 where a certificate's degrees of freedom tell that.
    """

    degrees_of_freedom: float
    u_rel: float = 0.0


def exactly_known(priors: Sequence[Prior]) -> dict[str, float]:
    """Return the values of the unknowns that priors say exactly.

    Raises
    ------
    ValueError
        If two of them contradict one another.
    """
    found: dict[str, float] = {}
    for prior in priors:
        if prior.exact:
            name, value = prior.unknowns[0], float(prior.values[0] / prior.rows[0, 0])
            if found.setdefault(name, value) != value:
                raise ValueError(f"{name} cannot be exactly {found[name]!r} and {value!r}")
    return found


def _is_covariance(matrix: Array) -> bool:
    try:
        np.linalg.cholesky(matrix)
    except np.linalg.LinAlgError:
        return False
    size = np.sqrt(np.diag(matrix))
    return bool(np.all(np.abs(matrix - matrix.T) <= ROUNDING * np.outer(size, size)))
