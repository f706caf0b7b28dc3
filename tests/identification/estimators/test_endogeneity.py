from __future__ import annotations

import math

import numpy as np
import pytest

from recoil_acquisition.errors import IdentificationError
from recoil_identification.estimators.endogeneity import durbin_wu_hausman
from recoil_identification.estimators.errors_in_variables import neighbouring_force
from tests.builders.recoil_scenario import MASS_KG, record_recoil, true_recoil

TRUE = true_recoil()
A = TRUE.acceleration_m_s2[TRUE.moving]


def test_the_noise_of_a_ringing_accelerometer_biases_plain_least_squares_and_the_sentence_says_by_how_much():
    shot = record_recoil(1)
    a, f = shot.acceleration_m_s2[TRUE.moving], shot.force_n[TRUE.moving]
    found = durbin_wu_hausman(a, f, neighbouring_force(f, 5))
    assert found.biased
    assert found.statistic < -10
    assert found.plain_kg == pytest.approx(a @ f / (a @ a))
    assert -8 < found.bias_percent < -2
    assert str(found).startswith("plain least squares of force on acceleration is biased by -")
    assert f"{found.instrumental_kg:.2f} kg" in str(found)


def test_noise_of_the_force_alone_seldom_alarms():
    found = []
    for seed in range(60):
        f = MASS_KG * A + np.random.default_rng(seed).normal(0.0, 3e4, A.size)
        found.append(durbin_wu_hausman(A, f, neighbouring_force(f, 5)))
    assert np.mean([one.biased for one in found]) <= 0.15
    assert all(one.p == pytest.approx(math.erfc(abs(one.statistic) / math.sqrt(2))) for one in found)
    quiet = next(one for one in found if not one.biased)
    assert str(quiet).startswith("no bias of plain least squares")


def test_samples_that_are_not_used_do_not_matter():
    shot = record_recoil(2)
    a, f = shot.acceleration_m_s2, shot.force_n
    used = np.zeros(a.shape, dtype=bool)
    used[TRUE.moving] = True
    broken = np.where(used, a, np.nan)
    instrument = neighbouring_force(f, 5)
    inside = durbin_wu_hausman(a[used], f[used], instrument[used])
    assert durbin_wu_hausman(broken, f, instrument, used=used) == inside


def test_an_instrument_that_is_the_acceleration_compares_nothing():
    with pytest.raises(IdentificationError, match="nothing to compare"):
        durbin_wu_hausman(A, MASS_KG * A, 2.0 * A)
