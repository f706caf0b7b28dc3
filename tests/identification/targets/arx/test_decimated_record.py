from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from recoil_identification.targets.arx.decimated_record import decimated, force_noise_n
from recoil_processing.filters import LowPass
from recoil_rigs.tables.force_input import AREAS
from tests.builders.bench_shots import MASS_KG, bench_motion, bench_regression, bench_rig, bench_shot, bench_signals

AREAS_M2 = {area: getattr(bench_rig().mechanism, area) for area in AREAS}


def test_recorded_signals_are_taken_sample_by_sample():
    recorded = bench_regression()
    record = decimated(recorded, recorded.acceleration_m_s2, recorded.force_n)
    assert (record.stride, record.step_s, record.low_pass) == (1, recorded.step_s, None)
    np.testing.assert_array_equal(record.times_s, recorded.times_s)
    np.testing.assert_array_equal(record.rows, recorded.used)


def test_filtered_signals_are_taken_a_little_closer_than_rows_with_errors_of_their_own():
    filtered = bench_regression().filtered(LowPass(400.0))
    record = decimated(filtered, filtered.acceleration_m_s2, filtered.force_n)
    assert record.stride == 20
    assert record.rate_hz == pytest.approx(1000.0)
    spaced = np.arange(int(np.argmax(filtered.inside)), filtered.times_s.size, record.stride)
    rows = spaced[(filtered.used & filtered.before_the_turn)[spaced]]
    np.testing.assert_array_equal(record.times_s[record.rows], filtered.times_s[rows])
    np.testing.assert_array_equal(record.force_n[record.rows], filtered.force_n[rows])


def test_a_narrower_band_keeps_force_and_acceleration_proportional():
    filtered = bench_regression().filtered(LowPass(400.0))
    exact = filtered.force_n / MASS_KG
    record = decimated(filtered, exact, filtered.force_n, share=0.5)
    assert record.low_pass == LowPass(200.0)
    assert record.stride == 40
    np.testing.assert_allclose(record.acceleration_m_s2, record.force_n / MASS_KG, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("share", [1.0, 0.5])
def test_what_cannot_be_trusted_is_lost_and_never_bridged(share):
    filtered = bench_regression().filtered(LowPass(400.0))
    trusted = filtered.trusted.copy()
    hole = (filtered.times_s > 0.08) & (filtered.times_s < 0.083)
    trusted[hole] = False
    record = decimated(replace(filtered, trusted=trusted), filtered.acceleration_m_s2, filtered.force_n, share=share)
    inside = (record.times_s > 0.08) & (record.times_s < 0.083)
    assert inside.any()
    assert np.isnan(record.force_n[inside]).all()
    assert np.isnan(record.acceleration_m_s2[inside]).all()
    assert not record.rows[inside].any()
    lost = np.isnan(record.force_n)
    # a further filter carries the bridge into its neighbourhood
    assert (lost.sum() > inside.sum()) == (share < 1.0)
    assert lost.sum() < 0.2 * lost.size


@pytest.mark.parametrize("share", [0.0, 1.5, np.nan])
def test_a_share_out_of_range_is_refused(share):
    filtered = bench_regression().filtered(LowPass(400.0))
    with pytest.raises(ValueError, match="share"):
        decimated(filtered, filtered.acceleration_m_s2, filtered.force_n, share=share)


def test_recorded_signals_have_no_band_to_narrow():
    recorded = bench_regression()
    with pytest.raises(ValueError, match="share"):
        decimated(recorded, recorded.acceleration_m_s2, recorded.force_n, share=0.5)


def noisy_force_n(seed: int, sigma_pa: float) -> float:
    motion, rng = bench_motion(), np.random.default_rng(seed)
    pressures = {"p_breech": motion.breech_pa, "p_brake": motion.brake_pa, "p_recuperator": motion.recuperator_pa}
    noisy = {name: p + sigma_pa * rng.standard_normal(p.size) for name, p in pressures.items()}
    return force_noise_n(bench_signals(bench_shot(**noisy)), bench_rig().forces, LowPass(2000.0))


def test_the_noise_of_the_force_is_that_of_the_gauges_behind_the_filter():
    # white noise of 20 kHz: two of ten kHz are left
    expected = 1e5 * np.sqrt(sum(area**2 for area in AREAS_M2.values())) * np.sqrt(2000.0 / 10_000.0)
    assert np.mean([noisy_force_n(seed, 1e5) for seed in range(6)]) == pytest.approx(expected, rel=0.1)


def test_without_a_baseline_the_noise_is_not_known():
    signals = replace(bench_signals(), baseline_s=(0.0, 0.0))
    assert np.isnan(force_noise_n(signals, bench_rig().forces, LowPass(400.0)))
