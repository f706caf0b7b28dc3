"""Resistance that no gauge reads: its columns against the equations, and what the mass makes of it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from types import MappingProxyType

import numpy as np
import pytest

from recoil_identification.calibration.calibration import Calibration
from recoil_identification.calibration.methods import Beside, calibrated_mass
from recoil_identification.rows.causes import Cause
from recoil_identification.rows.row_noise import RowNoise
from recoil_identification.rows.unread_resistance import (
    FORCE,
    SHARE,
    SLIDE,
    force_shapes,
    shape_of_force,
    unread_causes,
)
from recoil_processing.double_integral import integrate
from recoil_processing.filters import LowPass
from recoil_processing.shot.regression import Regression, build_regression
from recoil_processing.shot.sensor_scales import ScaleUncertainty
from recoil_rigs.mechanism.model import Mechanism
from tests.builders.bench_shots import (
    ELEVATION_RAD,
    GRAVITY_M_S2,
    MASS_KG,
    bench_motion,
    bench_rig,
    bench_shot,
    bench_signals,
)

LOW_PASS = LowPass(300.0)
EXACT = ScaleUncertainty(0.0, (0.0, 0.0, 0.0), 0.0)


def mechanism(u: Mapping[str, float] | None = None, **stated: float) -> Mechanism:
    """Return the bench's, with what is stated of forces that nobody reads."""
    m = bench_rig().mechanism
    return replace(m, **stated, u=MappingProxyType({**m.u, **(u or {})}))


@cache
def travelled() -> tuple[np.ndarray, np.ndarray]:
    """Return travel and velocity as the acceleration that is felt tells them: gravity adds a fiftieth at the end."""
    recorded, _ = regressions(mechanism())
    velocity = np.maximum(integrate(recorded.inside * recorded.acceleration_m_s2, recorded.step_s), 0.0)
    return integrate(recorded.inside * velocity, recorded.step_s), recorded.inside * velocity


def regressions(m: Mechanism, push_n: np.ndarray | float = 0.0) -> tuple[Regression, Regression]:
    """Set up the bench shot before and behind the filter, with a force that moves it and that no gauge reads."""
    signals = bench_signals(bench_shot())
    downhill = GRAVITY_M_S2 * math.sin(ELEVATION_RAD)
    acceleration = signals.series["recoil_acceleration"]
    velocity = integrate(np.nan_to_num(acceleration + downhill), signals.step_s)
    recorded = build_regression(signals, m, acceleration, velocity, -downhill)
    plain = build_regression(signals, mechanism(), acceleration, velocity, -downhill)
    moved = (plain.force_n + push_n * recorded.inside) / MASS_KG
    recorded = replace(recorded, acceleration_m_s2=moved, release_n_s=0.0, u_release_n_s=0.0)
    return recorded, recorded.filtered(LOW_PASS)


def causes(m: Mechanism) -> dict[str, Cause]:
    recorded, filtered = regressions(m)
    return {one.source: one for one in unread_causes(filtered, recorded, m, recorded.acceleration_m_s2)}


def behind(recorded: Regression, column: np.ndarray) -> np.ndarray:
    return LOW_PASS.apply(column, recorded.rate_hz)


def smooth(recorded: Regression, column: np.ndarray) -> np.ndarray:
    """Pass a force through a quarter of the cut-off, too: a share of it has none of its noise."""
    return LowPass(0.25 * LOW_PASS.cutoff_hz).apply(behind(recorded, column), recorded.rate_hz)


# ------------------------------------------------------------------------------------------ columns


@pytest.mark.parametrize("share", [0.0, 0.02, -0.01])
def test_a_share_is_one_of_brake_and_recuperator_as_they_read(share: float) -> None:
    m = mechanism({"unread_share": 0.01}, unread_share=share)
    cause = causes(m)[SHARE]
    recorded, _ = regressions(m)
    assert (cause.u, cause.unit, cause.kind, cause.scope) == (0.01, "1", "B", "rig")
    assert not cause.acceleration_m_s2.any()
    motion = bench_motion()
    read_n = -np.column_stack([m.brake_area * motion.brake_pa, m.recuperator_area * motion.recuperator_pa])
    for column, force_n in zip((1, 2), read_n.T, strict=True):
        expected = smooth(recorded, recorded.inside * force_n)
        # at the release itself the stop still holds a part of it
        later = recorded.times_s > recorded.interval_s[0] + 0.03
        np.testing.assert_allclose(cause.forces_n[later, column], expected[later], atol=1e-4 * np.abs(expected).max())
    assert not cause.forces_n[:, 0].any()


def test_slides_hold_by_the_velocity() -> None:
    m = mechanism({"slide_friction": 40.0})
    cause = causes(m)[SLIDE]
    recorded, _ = regressions(m)
    assert (cause.u, cause.unit, cause.kind, cause.scope) == (40.0, "N s/m", "B", "rig")
    expected = -behind(recorded, recorded.inside * travelled()[1])
    np.testing.assert_allclose(cause.forces_n[:, 1], expected, atol=0.01 * np.abs(expected).max())
    assert not cause.forces_n[:, [0, 2]].any()


def matern(apart: np.ndarray) -> np.ndarray:
    d = math.sqrt(3.0) * np.abs(apart) / 0.35
    return (1.0 + d) * np.exp(-d)


def test_all_shapes_together_are_a_force_of_variance_one_at_every_place_and_correlated_over_a_third_of_the_stroke() -> (
    None
):
    shapes, places = force_shapes(), np.linspace(0.0, 1.0, 60)
    assert 6 <= shapes.shape[1] <= 12
    np.testing.assert_allclose((shapes**2).sum(axis=1), 1.0, atol=0.03)
    np.testing.assert_allclose(shapes @ shapes.T, matern(places[:, np.newaxis] - places), atol=0.03)
    # shapes have nothing in common, the largest first
    energy = shapes.T @ shapes
    np.testing.assert_allclose(energy - np.diag(np.diag(energy)), 0.0, atol=1e-9)
    assert np.all(np.diff(np.diag(energy)) < 0)


def test_a_force_of_unknown_shape_comes_up_with_the_travel_and_holds_the_brakes_rod() -> None:
    m = mechanism(unread_force=0.003)
    recorded, filtered = regressions(m)
    found = causes(m)
    assert list(found) == [shape_of_force(number) for number in range(force_shapes().shape[1])]
    peak_n = np.abs(filtered.forces_n[filtered.inside, 1:].sum(axis=1)).max()
    travel_m = travelled()[0]
    share = np.clip(travel_m / travel_m.max(), 0.0, 1.0)
    size_n = 0.003 * peak_n * -np.expm1(-share / 0.01) * recorded.inside
    total = np.zeros(share.size)
    for number, cause in enumerate(found.values()):
        assert (cause.u, cause.unit, cause.kind, cause.scope) == (1.0, "1", "B", "rig")
        shape = np.interp(share, np.linspace(0.0, 1.0, 60), force_shapes()[:, number])
        # a resistance: more of it makes the force that is signed as the brake's too little negative
        expected = -behind(recorded, size_n * shape)
        np.testing.assert_allclose(cause.forces_n[:, 1], expected, atol=0.01 * np.abs(expected).max())
        assert not cause.forces_n[:, [0, 2]].any()
        total += cause.forces_n[:, 1] ** 2
    late = (share > 0.1) & (share < 0.98) & recorded.inside
    np.testing.assert_allclose(np.sqrt(total[late]), 0.003 * peak_n, rtol=0.05)


def test_what_the_rig_states_as_exact_is_no_cause() -> None:
    assert causes(mechanism()) == {}
    stated = mechanism({"unread_share": 0.0, "slide_friction": 0.0}, unread_share=0.02, slide_friction=50.0)
    assert causes(stated) == {}
    assert set(causes(mechanism({"unread_share": 0.005}, unread_share=0.02))) == {SHARE}


# ------------------------------------------------------------------------------------------ what the mass makes of it


def estimated(m: Mechanism, push_n: np.ndarray | float = 0.0) -> Calibration:
    """Estimate with sensors that are exact, so that what no gauge reads is all that is unknown."""
    recorded, filtered = regressions(m, push_n)
    known = unread_causes(filtered, recorded, m, recorded.acceleration_m_s2)
    # each phase counts as the other
    noise = RowNoise(np.hypot(1e-3, 1e-4 * filtered.acceleration_m_s2), 1.0, math.inf)
    return calibrated_mass(filtered, EXACT, 0.0, noise=noise, beside=Beside(known))


def test_a_stated_share_and_a_stated_slide_friction_are_in_the_forces() -> None:
    push_n = -(0.02 * (BRAKE_N + RECUPERATOR_N) + 60.0 * bench_motion().velocity_m_s)
    stated = mechanism(unread_share=0.02, slide_friction=60.0)
    assert estimated(stated, push_n).estimate.mass_kg == pytest.approx(MASS_KG, rel=1e-4)
    # and without them the mass would take them for its own
    assert estimated(mechanism(), push_n).estimate.mass_kg < 0.99 * MASS_KG


BRAKE_N = bench_rig().mechanism.brake_area * bench_motion().brake_pa
RECUPERATOR_N = bench_rig().mechanism.recuperator_area * bench_motion().recuperator_pa


@pytest.mark.parametrize("share", [0.008, -0.008])
def test_a_share_that_no_gauge_reads_is_found_with_its_sign_and_leaves_the_mass(share: float) -> None:
    found = estimated(mechanism({"unread_share": 0.01}), -share * (BRAKE_N + RECUPERATOR_N))
    assert found.inferred.value(SHARE) == pytest.approx(share, rel=0.01)
    assert found.estimate.mass_kg == pytest.approx(MASS_KG, rel=1e-4)


def test_slide_friction_is_found_with_its_sign() -> None:
    found = estimated(mechanism({"slide_friction": 40.0}), -30.0 * travelled()[1])
    assert found.inferred.value(SLIDE) == pytest.approx(30.0, rel=0.01)
    assert found.estimate.mass_kg == pytest.approx(MASS_KG, rel=1e-4)


@pytest.mark.exhaustive
def test_a_resistance_that_changes_over_the_travel_is_found_by_its_shapes() -> None:
    m = mechanism(unread_force=0.003)
    travel_m = travelled()[0]
    bump_n = 150.0 * np.sin(2.0 * np.pi * travel_m / travel_m.max())
    with_shapes, without = estimated(m, -bump_n), estimated(mechanism(), -bump_n)
    assert abs(with_shapes.estimate.mass_kg - MASS_KG) < 0.2 * abs(without.estimate.mass_kg - MASS_KG)
    recorded, _ = regressions(m)
    names = [shape_of_force(number) for number in range(force_shapes().shape[1])]
    told_n = sum(with_shapes.inferred.value(name) * causes(m)[name].forces_n[:, 1] for name in names)
    late = (travel_m > 0.1 * travel_m.max()) & (travel_m < 0.9 * travel_m.max()) & recorded.inside
    np.testing.assert_allclose(told_n[late], -bump_n[late], atol=30.0)


def test_its_shapes_have_one_row_in_the_budget_and_the_condition_that_all_is_read_takes_them_out() -> None:
    m = mechanism({"unread_share": 0.01}, unread_force=0.002)
    found = estimated(m)
    rows = {row.source: row for row in found.estimate.budget}
    assert set(rows) >= {SHARE, FORCE}
    assert not any(source.startswith("shape ") for source in rows)
    each = [found.inferred.contribution(shape_of_force(number), "ln mass") for number in range(force_shapes().shape[1])]
    assert rows[FORCE].u_kg == pytest.approx(found.estimate.mass_kg * math.hypot(*each), rel=1e-9)
    assert rows[FORCE].scope == rows[SHARE].scope == "rig"
    assert found.estimate.u_kg == pytest.approx(found.estimate.mass_kg * found.inferred.u("ln mass"), rel=1e-9)
    bare = estimated(mechanism())
    assert found.without_unread.inferred.u("ln mass") == pytest.approx(bare.inferred.u("ln mass"), rel=1e-6)
    assert found.without_unread.inferred.value("ln mass") == pytest.approx(bare.inferred.value("ln mass"), abs=1e-9)
    assert bare.without_unread is bare
