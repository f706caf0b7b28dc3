"""A correlation written out."""

from __future__ import annotations

import numpy as np

from recoil_identification.inference.correlation import Correlation


def lower_factor(correlation: Correlation) -> np.ndarray:
    """Return the lower factor, from what whitening does to every row alone."""
    return np.linalg.inv(correlation.whitened(np.eye(correlation.factor.shape[0])))
