"""Stiffness and damping from load and deflection behind one band-pass."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_identification.targets.stiffness.restoring_force import fit_restoring_force, rows_of, trace_restoring_force
from recoil_identification.targets.stiffness.support_filter import Band, Support, band_pass_rows
from recoil_processing.filters import LowPass

RATE = 5000.0
TIMES = np.arange(2000) / RATE
START = 0.05
INTERVAL = (START, 0.25)
ROWS = rows_of(TIMES, INTERVAL, np.ones(TIMES.size, dtype=bool), 80.0)
K, C = 3e7, 2e5


def swing(hz: float = 15.0, size: float = 1e-3) -> tuple[np.ndarray, np.ndarray]:
    """A damped swing from rest, and its rate."""
    since = np.maximum(TIMES - START, 0.0)
    w, decay = 2 * np.pi * hz, 12.0
    deflection = size * np.exp(-decay * since) * (1 - np.cos(w * since))
    return deflection, np.gradient(deflection, 1 / RATE)


def support(load, columns, contact=None) -> Support:
    bears = np.ones(TIMES.size) if contact is None else contact
    return Support("spring", TIMES, load, dict(zip(("k", "c"), columns, strict=False)), bears)


@pytest.mark.parametrize("band", [Band(80.0, 0.0, 0), Band(80.0, 5.0, 1), Band(80.0, 15.0, 2)])
def test_a_spring_with_a_damper_is_found_exactly(band):
    x, v = swing()
    fit = fit_restoring_force(support(K * x + C * v, (x, v)).filtered(band, START, ROWS))

    assert fit.identifiable
    assert fit.parameters == pytest.approx([K, C], rel=1e-6)
    assert fit.residual_share < 1e-6


def test_drift_of_the_deflection_does_not_bias():
    x, v = swing()
    since = np.maximum(TIMES - START, 0.0)
    drifted, drifting = x + 0.002 * since + 0.01 * since**2, v + 0.002 + 0.02 * since
    load = K * x + C * v

    plain = fit_restoring_force(support(load, (drifted, drifting)).filtered(Band(80.0, 0.0, 0), START, ROWS))
    aware = fit_restoring_force(support(load, (drifted, drifting)).filtered(Band(80.0, 5.0, 2), START, ROWS))

    assert abs(plain.parameters[0] / K - 1) > 0.05
    assert aware.parameters == pytest.approx([K, C], rel=5e-3)


def test_a_foot_off_the_ground_does_not_bias():
    x, v = swing(8.0)
    load = np.minimum(K * x + C * v, 2e4)  # at rest it presses with 20 kN; it cannot pull
    contact = (load < 2e4 - 1.0).astype(float)
    band = Band(80.0, 5.0, 1)

    blind = fit_restoring_force(support(load, (x, v)).filtered(band, START, ROWS))
    aware = fit_restoring_force(support(load, (x, v), contact).filtered(band, START, ROWS))

    assert contact[ROWS].mean() < 0.95
    assert abs(blind.parameters[0] / K - 1) > 0.05
    assert aware.parameters == pytest.approx([K, C], rel=1e-6)


def test_the_stated_uncertainty_is_that_of_the_scatter():
    x, v = swing()
    rng = np.random.default_rng(5)
    found = []
    for _ in range(150):
        load = K * x + C * v + rng.normal(0.0, 4e3, TIMES.size)
        found.append(fit_restoring_force(support(load, (x, v)).filtered(Band(80.0, 5.0, 1), START, ROWS)))
    values = np.array([fit.parameters for fit in found])
    stated = np.sqrt(np.mean([np.diag(fit.covariance) for fit in found], axis=0))

    assert np.all(stated / values.std(axis=0) > 0.85)
    assert np.all(stated / values.std(axis=0) < 1.6)
    assert np.mean(np.abs(values[:, 0] - K) < 1.96 * np.array([f.covariance[0, 0] ** 0.5 for f in found])) > 0.85


def test_columns_that_go_together_are_not_told_apart():
    x, _ = swing()
    fit = fit_restoring_force(support(K * x, (x, 0.01 * x + 1e-9 * TIMES)).filtered(Band(80.0, 0.0, 0), START, ROWS))

    assert not fit.identifiable
    assert set(fit.weakest) == {"k", "c"}


def test_a_support_that_never_bears_gives_no_number():
    x, v = swing()
    fit = fit_restoring_force(support(K * x, (x, v), np.zeros(TIMES.size)).filtered(Band(80.0, 0.0, 0), START, ROWS))

    assert not fit.identifiable
    assert np.isnan(fit.parameters).all()


def test_too_few_rows_are_not_identifiable():
    x, v = swing()
    fit = fit_restoring_force(support(K * x + C * v, (x, v)).filtered(Band(80.0, 5.0, 2), START, ROWS[:8]))

    assert not fit.identifiable


def test_the_trace_follows_a_stiffness_that_changes():
    since = np.maximum(TIMES - START, 0.0)
    x = 1e-3 * np.sin(2 * np.pi * 20.0 * since)
    v = np.gradient(x, 1 / RATE)
    late = TIMES > 0.15
    load = np.where(late, 2 * K, K) * x + C * v + np.random.default_rng(1).normal(0.0, 50.0, TIMES.size)

    trace = trace_restoring_force(support(load, (x, v)).filtered(Band(80.0, 0.0, 0), START, ROWS), 0.05)
    k = trace.parameters[:, 0]

    before = (trace.times_s > 0.105) & (trace.times_s < 0.14)
    behind = trace.times_s > 0.215
    assert k[before] == pytest.approx(K, rel=0.03)
    assert k[behind] == pytest.approx(2 * K, rel=0.03)
    assert np.isnan(k[:6]).all()


def test_the_trace_is_blank_where_the_foot_is_off_the_ground():
    x, v = swing()
    contact = np.where((TIMES > 0.12) & (TIMES < 0.16), 0.0, 1.0)
    passed = support(K * x + C * v, (x, v), contact).filtered(Band(80.0, 0.0, 0), START, ROWS)

    trace = trace_restoring_force(passed, 0.05)

    off = (trace.times_s > 0.121) & (trace.times_s < 0.159)
    assert off.any()
    assert np.isnan(trace.parameters[off]).all()


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([20.0, 80.0]))
def test_the_matrix_is_the_low_pass(seed, cutoff_hz):
    samples = np.cumsum(np.random.default_rng(seed).normal(size=TIMES.size))

    by_matrix = band_pass_rows(Band(cutoff_hz, 0.0, 0), TIMES, ROWS) @ samples

    assert np.allclose(by_matrix, LowPass(cutoff_hz).apply(samples, RATE)[ROWS], atol=1e-3 * np.ptp(samples))


@settings(max_examples=15, deadline=None)
@given(st.floats(-1e3, 1e3), st.floats(-1e4, 1e4))
def test_a_band_pass_lets_no_constant_and_no_straight_line_through(level, slope):
    passed = band_pass_rows(Band(80.0, 10.0, 0), TIMES, ROWS) @ (level + slope * TIMES)

    assert np.abs(passed).max() <= 1e-5 * (abs(level) + abs(slope) + 1.0)


def test_rows_leave_out_what_is_not_trusted():
    trusted = np.ones(TIMES.size, dtype=bool)
    trusted[ROWS[3]] = False

    rows = rows_of(TIMES, INTERVAL, trusted, 80.0)

    assert rows.tolist() == [row for row in ROWS if row != ROWS[3]]
    assert TIMES[rows[0]] >= INTERVAL[0]
    assert TIMES[rows[-1]] <= INTERVAL[1]
