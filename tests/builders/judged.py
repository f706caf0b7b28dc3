"""How intervals are judged over many answers: by what they cover, by how wide they are, and by their worst group."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

LEAST_OF_A_GROUP = 20
"""Answers from which on a group's share is judged: of 20 whose intervals hold 95 % each, 17 hold in 98 of 100 cases."""
MISSED = 0.05
"""Share of intervals of 95 % that need not hold."""


def interval_score(low: float, high: float, truth: float) -> float:
    """Return the width of a 95 % interval, and twenty times twice what it misses the truth by: less is better.

    T. Gneiting and A. E. Raftery, Strictly proper scoring rules, prediction, and estimation, J. Am. Stat. Assoc. 102
    (2007), equation (43).
    """
    return high - low + 2.0 / MISSED * max(low - truth, truth - high, 0.0)


def halves(values: Sequence[float]) -> list[str]:
    """Say of each value whether it is one of the larger half."""
    middle = np.nanmedian(values)
    return ["larger u" if value > middle else "smaller u" for value in values]


def worst_group(holds: Sequence[bool], groups: Mapping[str, Sequence[object]]) -> tuple[float, str]:
    """Return the least share of intervals that hold in any group that is large enough, and the name of that group.

    Parameters
    ----------
    holds
        Whether each interval holds.
    groups
        Of each way to part them, the group of each.
    """
    shares = [(1.0, "no group is large enough")]
    for way, of in groups.items():
        for group in dict.fromkeys(of):
            its = [held for held, one in zip(holds, of, strict=True) if one == group]
            if len(its) >= LEAST_OF_A_GROUP:
                shares.append((float(np.mean(its)), f"{way} {group}: {sum(its)} of {len(its)}"))
    return min(shares)
