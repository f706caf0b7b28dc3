"""Shapes in which optics bend the picture of a travel."""

from __future__ import annotations

import numpy as np

from recoil_acquisition.numerics.arrays import Array


def picture_bends(positions_m: Array) -> tuple[Array, Array]:
    """Return what optics may add to a travel, at most one and shape (n,) each: a bow and an S.

    A lens bends a straight line into a bow, the next smaller distortion into an S. Both are zero at both ends of the
    travel, whose scale was calibrated.
    """
    share = positions_m / max(float(np.max(positions_m, initial=0.0)), 1e-12)
    bow = 4.0 * share * (1.0 - share)
    return bow, 2.6 * bow * (1.0 - 2.0 * share)
