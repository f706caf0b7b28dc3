"""A correlation written out."""

from __future__ import annotations

import numpy as np

from recoil_identification.inference.correlation import Correlation


def lower_factor(correlation: Correlation) -> np.ndarray:
    """Return the whole lower factor: what makes correlated rows of independent ones."""
    size = correlation.near.shape[1] + correlation.last.shape[0]
    return np.linalg.inv(correlation.whitened(np.eye(size)))
