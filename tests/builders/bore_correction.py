"""The term by which a tube that bends corrects the identification equation, derived apart from its dynamics."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from recoil_rigs.mechanism.flexible_tube import FlexibleTube

Array = NDArray[np.float64]


def bore_correction(tube: FlexibleTube, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike) -> Array:
    """Return f5, by which bending corrects the identification equation: ``m3 a' = P - R_f + f5``, N, shape (...).

    Parameters
    ----------
    tube : FlexibleTube
    q, qd, qdd : array_like, shape (..., 5 + n)
    """
    place, rate, change = (np.asarray(v, dtype=np.float64) for v in (q, qd, qdd))
    modal, speed, gain = place[..., 5:], rate[..., 5:], change[..., 5:]
    w2, dw2 = rate[..., 2] + rate[..., 3], change[..., 2] + change[..., 3]
    G = tube.shortening
    turned = -dw2 * (modal @ tube.first) - 2 * w2 * (speed @ tube.first)
    drawn = -((modal @ G) * gain).sum(axis=-1) - ((speed @ G) * speed).sum(axis=-1)
    return np.asarray(turned + drawn + 0.5 * w2**2 * ((modal @ G) * modal).sum(axis=-1), dtype=np.float64)
