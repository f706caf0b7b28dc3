"""All that may be wrong of a shot's forces and motion, for whoever weighs them as recorded or behind its own filter."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recoil_identification.rows.breech_chain import chain_causes
from recoil_identification.rows.causes import Cause, causes_of
from recoil_identification.rows.unread_resistance import unread_causes
from recoil_processing.shot.regression import Regression
from recoil_processing.shot.signals import Signals
from recoil_rigs.shots.fired_shot import FiredShot


def recorded_causes(
    recorded: Regression, signals: Signals, fired: FiredShot, acceleration_m_s2: NDArray[np.float64] | None = None
) -> tuple[Cause, ...]:
    """List the causes of a shot, what resists unread and the breech chain, each as it acts on the recorded rows.

    Parameters
    ----------
    recorded
        Regression before any filter.
    acceleration_m_s2 : ndarray, shape (n,), optional
        Acceleration of the recoil, which tells travel and velocity; the regression's if left out.
    """
    moved = recorded.acceleration_m_s2 if acceleration_m_s2 is None else acceleration_m_s2
    return (
        *causes_of(recorded, recorded, signals, fired),
        *unread_causes(recorded, recorded, fired.rig.mechanism, moved),
        *chain_causes(recorded, recorded, signals, fired.rig),
    )
