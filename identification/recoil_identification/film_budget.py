"""The budget of a camera's mass: what noise, clocks, zeros, repairs and the carriage's sensors contribute."""

from __future__ import annotations

import math

import numpy as np

from recoil_identification.budget import BudgetRow
from recoil_identification.filmed_recoil import FilmedRecoil
from recoil_processing.shot.clocks.forced_recoil import SCALES


def film_contributions(filmed: FilmedRecoil) -> tuple[float, tuple[BudgetRow, ...]]:
    """Evaluate what is uncertain of a film's mass but the gauges' scales.

    Returns
    -------
    u_random_kg : float
        Standard uncertainty by noise alone, the clocks' offset being known.
    rows : tuple of BudgetRow
        Of the clocks, the zeros, the repairs and the carriage's sensors.
    """
    found, clock = filmed.found, filmed.clock
    answers = np.abs(found.force_sensitivities_kg[SCALES:])
    rows = [
        BudgetRow(source, float(answer), kind)
        for source, kind, answer in zip(filmed.errors.sources, filmed.errors.kinds, answers, strict=True)
    ]
    held = filmed.mass_with(held=True)
    # what the offset costs the film, found with the mass or known beforehand
    offset_kg = math.sqrt(max(found.u_kg**2 + found.u_shift_kg**2 - held.u_kg**2, 0.0))
    drift_kg = filmed.mass_with(stretch=clock.u_drift).mass_kg - filmed.mass_with().mass_kg
    own = f"alignment of clock {clock.clock}"
    return held.u_kg, (*rows, BudgetRow(own, math.hypot(offset_kg, drift_kg), "B"))
