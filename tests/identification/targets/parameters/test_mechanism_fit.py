"""What noise of the sensors takes off a parameter is put back on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from recoil_identification.targets.forces.inertia_force import mass_alone
from recoil_identification.targets.parameters.base_parameters import BaseParameters
from recoil_identification.targets.parameters.mechanism_fit import MechanismFit, fit_mechanism
from recoil_identification.targets.parameters.mechanism_rows import MechanismRows
from recoil_identification.targets.parameters.recorded_rows import mechanism_rows
from recoil_identification.targets.target import Case
from recoil_processing.filters import LowPass
from recoil_rigs.shots.fired_shot import FiredShot
from tests.builders.load_cell_rigs import weighed_shot

NOISE_SHARE = 0.15
"""Of the root mean square of the acceleration: it takes the square of that, or more, off the mass."""


@pytest.fixture(scope="module")
def rows() -> MechanismRows:
    weighed = weighed_shot()
    case = Case(FiredShot(weighed.shot, weighed.rig))
    low_pass = LowPass(150.0)
    return mechanism_rows(case.fired, case.prepared, case.prepared.recorded, {}, low_pass, rows_hz=375.0)


def fitted(rows: MechanismRows) -> MechanismFit:
    m = weighed_shot().rig.mechanism
    return fit_mechanism(rows, [], m.m3, equations=(4,), unknowns=BaseParameters(*mass_alone(m)))


@pytest.mark.whole_way
def test_noise_of_the_accelerometer_does_not_lower_the_mass(rows: MechanismRows) -> None:
    quiet = fitted(rows).values[0]
    moving = (rows.columns["acc"] - rows.columns["held"])[rows.recoils]
    sigma = NOISE_SHARE * float(np.sqrt(np.mean(moving**2)))
    rng = np.random.default_rng(5)
    plain, corrected, u = [], [], []
    for _ in range(30):
        acc = rows.columns["acc"] + rng.normal(0.0, sigma, rows.times_s.size)
        found = fitted(replace(rows, columns={**rows.columns, "acc": acc}, noise={**rows.noise, "acc": sigma}))
        plain.append(found.inferred.values[-1] / quiet - 1.0)
        corrected.append(found.values[0] / quiet - 1.0)
        u.append(np.sqrt(found.covariance[0, 0]) / quiet)
    scatter = float(np.std(corrected, ddof=1))
    assert np.mean(plain) < -(NOISE_SHARE**2)
    assert abs(np.mean(corrected)) < 3.0 * scatter / np.sqrt(len(corrected))
    assert np.mean(u) == pytest.approx(scatter, rel=0.25)
