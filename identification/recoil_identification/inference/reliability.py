"""How large an error of what is known beforehand would have to be before the rows tell it, and what it does until then.

W. Baarda, A testing procedure for use in geodetic networks, 1968: internal reliability is the smallest error that the
w-test of an observation tells with a stated probability, external reliability its effect on an unknown.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri

from recoil_acquisition.numerics.normal_distribution import CRITICAL_VALUE
from recoil_identification.inference.estimate import LEAST_REDUNDANCY, Estimate
from recoil_identification.inference.unknown import Prior

POWER = 0.8
"""Probability with which the smallest error that is told is told, as Baarda takes it."""
NONCENTRALITY = CRITICAL_VALUE + float(ndtri(POWER))
"""Mean of w, in its standard deviations, for which it is beyond the critical value with that probability: 4.13."""


@dataclass(frozen=True)
class Reliability:
    """Effect of an error in one direction among the sources.

    Attributes
    ----------
    smallest_told
        Size that the rows tell with a probability of `POWER`; infinite where they can tell none.
    answer
        Change of the unknown for an error of one.
    """

    smallest_told: float
    answer: float


def reliability(estimate: Estimate, priors: Sequence[Prior], error: Mapping[str, float], unknown: str) -> Reliability:
    """Say what an error of some sources together would do.

    With observations of covariance C, of which C - A S A' is what the residuals have (A the rows, S the covariance of
    the unknowns), an error d c moves the mean of the test of direction c by ``d sqrt(c' C^-1 (C - A S A') C^-1 c)``,
    and the unknowns by ``d S A' C^-1 c``.

    Parameters
    ----------
    estimate, priors
        Estimate and the priors that it was made with, those that are exact among them or not.
    error
        Source -> by how much its stated value is too large, for an error of one.
    unknown
        Unknown whose answer is wanted.

    Raises
    ------
    ValueError
        If a source or the unknown is none of the estimate's.
    """
    names = [one.name for one in estimate.unknowns]
    if unknown not in names:
        raise ValueError(f"no unknown: {unknown}; there are {', '.join(names)}")
    if strangers := error.keys() - set(estimate.sources):
        raise ValueError(f"no source: {', '.join(sorted(strangers))}; there are {', '.join(estimate.sources)}")
    weight, redundancy, moved = 0.0, 0.0, np.zeros(len(names))
    for prior in (one for one in priors if not one.exact):
        direction = np.array([error.get(source, 0.0) for source in prior.sources])
        weighted = np.linalg.solve(prior.covariance, direction)
        weight += float(direction @ weighted)
        moved[[names.index(name) for name in prior.unknowns]] += prior.rows.T @ weighted
    redundancy = weight - float(moved @ estimate.covariance @ moved)
    told = redundancy > LEAST_REDUNDANCY * weight
    return Reliability(
        smallest_told=NONCENTRALITY / math.sqrt(redundancy) if told else math.inf,
        answer=float(estimate.covariance[names.index(unknown)] @ moved),
    )
