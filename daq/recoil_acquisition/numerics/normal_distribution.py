"""Figures of the normal distribution that robust statistics and critical values are taken from."""

from __future__ import annotations

import math

MAD_TO_SIGMA = 1.482602218505602
"""Standard deviation over median absolute deviation: 1 / Phi^-1(3/4)."""

MEDIAN_LOSS = math.sqrt(math.pi / 2)
"""Standard error of a median over that of a mean, of many values."""

CRITICAL_VALUE = 3.29
"""Standard uncertainties that a normal deviate exceeds, to either side, once in 1000 times: as in Baarda's w-test."""

LEAST_PROBABILITY, MOST_PROBABILITY = 1e-12, 0.5
"""Bounds between which a probability is printed as a figure."""


def probability_text(p: float) -> str:
    """Say how probable chance is: of a probability that says nothing against it no figure is given."""
    if p > MOST_PROBABILITY:
        return f"p > {MOST_PROBABILITY:g}"
    return f"p = {p:.2g}" if p > LEAST_PROBABILITY else f"p < {LEAST_PROBABILITY:g}"
