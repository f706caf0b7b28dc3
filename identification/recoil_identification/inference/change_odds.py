"""The odds of a mass that changes, and the size of a change that they find.

A change is a drift or a step at one of many instants, each with its Bayes factor against none
(`recoil_identification.inference.score`): drift and step are as likely as each other beforehand, and each instant as
the others. A change of a given size moves the scores of all of them by its share of each, and their errors are drawn
with the correlation that the rows give them; the size that is found in nineteen of twenty draws is what could hide.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import lru_cache

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_identification.inference.score import Scores

LEAST_FACTOR = 3.0
"""Logarithm of the Bayes factor beyond which the mass is said to change: 20 to 1, strong in the words of Kass and
Raftery."""
FOUND = 0.95
"""Share of shots in which a change of the size that could hide is found."""
DRAWS, SEED = 500, 1
"""Draws of the scores' errors: the share is then known to 1 %."""
MOST_LN = 10.0
"""Logarithm of a mass beyond which a change of it is none that could be."""
FIRST, DOUBLINGS, HALVINGS = 6.0, 4, 10
"""Size that is tried first, in its standard uncertainties, how often it is doubled, and halved between."""


def ln_odds_of_change(ln_bayes_factors: Array) -> Array:
    """Return the logarithm of the odds of a change against none, shape (...,).

    Parameters
    ----------
    ln_bayes_factors : ndarray, shape (..., n_changes)
        Logarithms of the factors, that of the drift first, those of the steps behind it.
    """
    steps = ln_bayes_factors[..., 1:]
    of_step = np.logaddexp.reduce(steps, axis=-1) - math.log(steps.shape[-1])
    return np.asarray(np.logaddexp(ln_bayes_factors[..., 0], of_step) - math.log(2.0))


def found_size(scores: Scores, sd: Array, change: int, least: float = LEAST_FACTOR) -> float:
    """Return which share of the mass must change to be found in `FOUND` of shots; infinite where none is.

    The scores are of changes of its logarithm: a mass that falls has to fall by less.

    Parameters
    ----------
    scores
        Scores of all changes, the drift first.
    sd : ndarray, shape (n_changes,)
        Standard deviation of each if there is one.
    change
        Place of the change that is there.
    least
        Logarithm of the odds beyond which a mass is said to change.
    """
    if not scores.identifiable[change]:
        return math.inf
    values, vectors = np.linalg.eigh(scores.correlation)
    errors = _drawn(values.size) @ (vectors * np.sqrt(np.maximum(values, 0.0))).T
    per_size = scores.correlation[change] * math.sqrt(float(scores.information[change]))

    def share(size: float) -> float:
        drawn = Scores(errors + size * per_size, scores.correlation, scores.identifiable, scores.information, _NONE)
        return float(np.mean(ln_odds_of_change(drawn.ln_bayes_factors(sd)) > least))

    low, high = 0.0, FIRST / math.sqrt(float(scores.information[change]))
    for _ in range(DOUBLINGS):
        if share(high) >= FOUND:
            break
        low, high = high, 2.0 * high
    else:
        return math.inf
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if share(middle) >= FOUND else (middle, high)
    return math.expm1(high) if high < MOST_LN else math.inf


def could_hide_text(sizes_percent: Mapping[str, float], of: str) -> str:
    """Say which changes would be found in nineteen cases of twenty.

    Parameters
    ----------
    sizes_percent
        Size of a ``drift`` and a ``step`` that are, percent of the mass; of more than all of it none is.
    of
        Plural of what is counted: ``shots``, ``campaigns``.
    """
    ways = {"drift": "over the travel", "step": "at once"}
    told = [f"{size:.2g} % {ways[kind]}" for kind, size in sizes_percent.items() if size < 100.0]
    if not told:
        return f"none would be in 19 {of} of 20, whatever its size: all may hide"
    return f"in 19 {of} of 20 one of {' or '.join(told)} would be, a smaller one may hide"


_NONE = np.zeros((0, 0))


@lru_cache(maxsize=4)
def _drawn(count: int) -> Array:
    """Draw from a standard normal distribution, shape (DRAWS, count); most shots ask for the same."""
    drawn = np.random.default_rng(SEED).standard_normal((DRAWS, count))
    drawn.setflags(write=False)
    return drawn
