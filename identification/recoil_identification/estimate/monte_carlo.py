"""Propagation of distributions by a Monte Carlo method, and how the GUM's linear result compares with it.

JCGM 101:2008, "Supplement 1 to the GUM": blocks of draws are taken until mean, standard uncertainty and both
ends of the interval are known to the numerical tolerance (7.9), the probabilistically symmetric and the
shortest coverage interval are stated (5.3.3, 5.3.4), and the GUM's interval is compared with the former (8.1).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_identification.estimate.budget import COVERAGE

Draw = Callable[[np.random.Generator, int], Array]

SEED = 0
"""Seed of the draws."""
BLOCK = 10_000
"""Draws of a block: at least 10^4, and 100 / (1 - p) of them lie outside (7.9.4)."""
LEAST_BLOCKS = 5
"""Fewest blocks: from fewer the scatter of the blocks' results, which decides, is itself hardly known."""
DIGITS = 2
"""Significant digits of the standard uncertainty that are meaningful."""


class IntervalBy(StrEnum):
    """How the interval of a mass came about."""

    GUM = "GUM"
    """The mass and k standard uncertainties."""
    LOGARITHM = "GUM in ln m"
    """The same of its logarithm."""
    MONTE_CARLO = "Monte Carlo"
    """The draws, since they do not validate the GUM's (JCGM 101:2008, 8.2)."""


@dataclass(frozen=True)
class MonteCarlo:
    """Result of the draws of a measurand.

    Attributes
    ----------
    mean, u
        Mean and standard uncertainty in the measurand's unit.
    interval
        Probabilistically symmetric, 95 %.
    shortest
        The shortest that holds 95 %.
    tolerance
        Numerical tolerance: half of the last of `DIGITS` significant digits of `u`.
    scatter
        Largest of twice the standard deviations of mean, u, and both ends of the interval.
    """

    draws: int
    seed: int
    mean: float
    u: float
    interval: tuple[float, float]
    shortest: tuple[float, float]
    tolerance: float
    scatter: float

    @property
    def converged(self) -> bool:
        """True if the results are known to the tolerance."""
        return self.scatter <= self.tolerance

    def validates(self, interval: tuple[float, float]) -> bool:
        """Whether the ends of another interval are off by no more than the tolerance and the scatter (8.1)."""
        return max(map(abs, self.differences(interval))) <= self.tolerance + self.scatter

    def differences(self, interval: tuple[float, float]) -> tuple[float, float]:
        """How far the ends of another interval are off, such as the GUM's: low, high."""
        return interval[0] - self.interval[0], interval[1] - self.interval[1]

    def __str__(self) -> str:
        low, high = self.interval
        found = f"{self.mean:.6g}, u {self.u:.3g}, 95 % {low:.6g} to {high:.6g}"
        return f"{found}, of {self.draws} draws (seed {self.seed})"


def numerical_tolerance(u: float, digits: int = DIGITS) -> float:
    """Half of the last of some significant digits of a standard uncertainty (7.9.2); 0 for no uncertainty."""
    if not u > 0:
        return 0.0
    return 0.5 * 10.0 ** (int(f"{u:.{digits - 1}e}".partition("e")[2]) - (digits - 1))


def propagate(draw: Draw, *, seed: int = SEED, most_blocks: int = 40) -> MonteCarlo | None:
    """Draw from a measurand's distribution until the results are known to the tolerance.

    Parameters
    ----------
    draw
        Given a generator and a number, returns as many independent values of the measurand.
    most_blocks
        Largest number of blocks of `BLOCK` draws; where they do not suffice the result says so.

    Returns
    -------
    MonteCarlo or None
        Distribution of the measurand; None where a draw is not finite: the measurand then has no distribution to speak
        of.

    Raises
    ------
    ValueError
        If fewer than `LEAST_BLOCKS` are allowed.
    """
    if most_blocks < LEAST_BLOCKS:
        raise ValueError(f"most_blocks must be at least {LEAST_BLOCKS}, not {most_blocks}")
    rng = np.random.default_rng(seed)
    blocks: list[Array] = []
    results: list[tuple[float, float, float, float]] = []
    scatter = tolerance = math.inf
    while len(blocks) < most_blocks:
        block = np.sort(draw(rng, BLOCK))
        if not np.isfinite(block).all():
            return None
        blocks.append(block)
        results.append((float(block.mean()), float(block.std(ddof=1)), *_symmetric(block)))
        if len(blocks) < LEAST_BLOCKS:
            continue
        of_blocks = np.array(results)
        scatter = float(2 * np.max(of_blocks.std(axis=0, ddof=1)) / math.sqrt(len(blocks)))
        tolerance = numerical_tolerance(float(np.mean(of_blocks[:, 1])))
        if scatter <= tolerance:
            break
    values = np.sort(np.concatenate(blocks))
    return MonteCarlo(
        draws=int(values.size),
        seed=seed,
        mean=float(values.mean()),
        u=float(values.std(ddof=1)),
        interval=_symmetric(values),
        shortest=_shortest(values),
        tolerance=tolerance,
        scatter=scatter,
    )


def _symmetric(values: Array) -> tuple[float, float]:
    """Return the interval of sorted values with as many below as above (7.7.2)."""
    inside = round(COVERAGE * values.size)
    below = (values.size - inside + 1) // 2
    return float(values[below]), float(values[min(below + inside, values.size - 1)])


def _shortest(values: Array) -> tuple[float, float]:
    """Return the shortest interval of sorted values (7.7.4)."""
    inside = round(COVERAGE * values.size)
    widths = values[inside:] - values[: values.size - inside]
    first = int(np.argmin(widths))
    return float(values[first]), float(values[first + inside])
