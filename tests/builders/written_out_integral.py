"""A double integral by brute force: many short steps between samples."""

from __future__ import annotations

import numpy as np
from scipy.integrate import cumulative_trapezoid

SUBSTEPS = 60


def integrated_twice(times_s: np.ndarray, samples: np.ndarray, at_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the double and the single integral, at some instants, of straight lines through evenly spaced samples."""
    fine_s = np.linspace(times_s[0], times_s[-1], SUBSTEPS * (times_s.size - 1) + 1)
    velocity = cumulative_trapezoid(np.interp(fine_s, times_s, samples), fine_s, initial=0.0)
    travel = cumulative_trapezoid(velocity, fine_s, initial=0.0)
    return np.interp(at_s, fine_s, travel), np.interp(at_s, fine_s, velocity)
