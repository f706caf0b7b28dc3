"""A share that was counted, with what chance leaves open of it."""

from __future__ import annotations

from scipy.stats import binomtest


def share(hits: int, count: int) -> str:
    """Say how many of how many, with the exact binomial 95 % interval."""
    low, high = binomtest(hits, count).proportion_ci(0.95, "exact")
    return f"{hits} of {count} ({hits / count:.3f}, 95 %: {low:.3f} to {high:.3f})"
