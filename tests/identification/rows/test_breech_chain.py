"""The shapes of the breech chain against what a virtual rig's sensors make of them, and what the mass makes of them."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from types import MappingProxyType

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid
from scipy.signal import lsim

from recoil_identification.calibration.calibration import Calibration
from recoil_identification.calibration.methods import Beside, calibrated_mass
from recoil_identification.rows.breech_chain import (
    MUZZLE_BRAKE,
    TUBE,
    chain_causes,
    gauge_ahead_of,
    hysteresis_of,
    linearity_of,
)
from recoil_identification.rows.causes import Cause
from recoil_identification.rows.row_noise import RowNoise
from recoil_processing.filters import LowPass
from recoil_processing.shot.regression import Regression
from recoil_processing.shot.sensor_scales import ScaleUncertainty
from recoil_rigs.rig import Rig
from tests.builders.bench_shots import (
    BORE_M2,
    BRAKE_M2,
    MASS_KG,
    bench_motion,
    bench_regression,
    bench_rig,
    bench_signals,
)

LOW_PASS = LowPass(300.0)
EXACT = ScaleUncertainty(0.0, (0.0, 0.0, 0.0), 0.0)
FULL_PA = 250e6
CHAMBER_M, PROJECTILE_KG, BORE_M = 0.5, 15.0, 2.0
BREECH, BRAKE = "breech_pressure", "brake_pressure"
LINEARITY, HYSTERESIS, AHEAD = linearity_of(BREECH), hysteresis_of(BREECH), gauge_ahead_of(BREECH)
BENT = "range = [0.0, 250e6], u_linearity_rel = 0.005"
AT_MOUTH = "gauge_ahead = { chamber_length_m = 0.5, projectile_mass_kg = 15.0, u_share = 0.01 }"


@cache
def stated(breech: str = "", brake: str = "", u_muzzle: float = 0.0, tube_hz: float = 0.0, muzzle: float = 0.0) -> Rig:
    rig = bench_rig(**{key: said for key, said in (("p_breech", breech), ("p_brake", brake)) if said})
    of_exit = {"projectile_mass": PROJECTILE_KG, "bore_length": BORE_M}
    m = replace(rig.mechanism, tube_axial_hz=tube_hz, muzzle_brake=muzzle, **of_exit)
    return replace(rig, mechanism=replace(m, u=MappingProxyType({**m.u, "muzzle_brake": u_muzzle})))


ONE = {
    LINEARITY: stated(BENT),
    HYSTERESIS: stated(BENT),
    AHEAD: stated(AT_MOUTH),
    MUZZLE_BRAKE: stated(u_muzzle=0.05),
}
ALL = stated(f"{BENT}, {AT_MOUTH}", "u_linearity_rel = 0.002, range = [0.0, 40e6]", 0.05, 900.0)


def causes(rig: Rig) -> dict[str, Cause]:
    recorded = bench_regression(rig=rig)
    found = chain_causes(recorded.filtered(LOW_PASS), recorded, bench_signals(rig=rig), rig)
    return {one.source: one for one in found}


def errors_n(recorded: Regression) -> dict[str, np.ndarray]:
    """Return by how much too little the breech force is for a size of one, by the equations as they are printed."""
    p, step, free = bench_motion().breech_pa, recorded.step_s, recorded.released
    z, y, peak = p / FULL_PA, p / p.max(), int(np.argmax(p))
    force_n = BORE_M2 * p * free
    travel_m = cumulative_trapezoid(cumulative_trapezoid(force_n, dx=step, initial=0.0), dx=step, initial=0.0)
    travel_m /= PROJECTILE_KG
    exit_s = float(np.interp(BORE_M, travel_m, recorded.times_s))
    behind_s = np.maximum(recorded.times_s - exit_s, 0.0)
    return {
        LINEARITY: -BORE_M2 * FULL_PA * 2.0 * z * (1.0 - z) * free,
        HYSTERESIS: -BORE_M2 * FULL_PA * np.where(np.arange(p.size) > peak, y * (1.0 - y), 0.0) * free,
        AHEAD: force_n * (CHAMBER_M / (CHAMBER_M + travel_m)) ** 2,
        MUZZLE_BRAKE: -force_n * (1.0 - np.exp(-behind_s / 3e-4)),
    }


# ------------------------------------------------------------------------------------------ columns


@pytest.mark.parametrize(
    ("source", "u", "scope"),
    [(LINEARITY, 0.005, "sensor"), (HYSTERESIS, 0.005, "sensor"), (AHEAD, 0.01, "sensor"), (MUZZLE_BRAKE, 0.05, "rig")],
)
def test_a_shape_is_the_one_of_its_equation_in_the_breech_force(source: str, u: float, scope: str) -> None:
    recorded, cause = bench_regression(rig=ALL), causes(ALL)[source]
    assert (cause.u, cause.unit, cause.kind, cause.scope) == (u, "1", "B", scope)
    expected = LOW_PASS.apply(errors_n(recorded)[source], recorded.rate_hz)
    np.testing.assert_allclose(cause.forces_n[:, 0], expected, atol=2e-3 * np.abs(expected).max())
    assert not cause.forces_n[:, 1:].any()
    assert not cause.acceleration_m_s2.any()


def test_the_line_of_another_gauge_is_bent_in_its_own_column_and_sense() -> None:
    recorded, cause = bench_regression(rig=ALL), causes(ALL)[linearity_of(BRAKE)]
    z = bench_motion().brake_pa / 40e6
    # a brake gauge that reads too much makes the force that holds too large: signed as it is, it reads too little back
    expected = LOW_PASS.apply(BRAKE_M2 * 40e6 * 2.0 * z * (1.0 - z) * recorded.released, recorded.rate_hz)
    np.testing.assert_allclose(cause.forces_n[:, 1], expected, atol=2e-3 * np.abs(expected).max())
    assert not cause.forces_n[:, [0, 2]].any()


def test_without_a_range_what_a_gauge_reads_at_most_is_its_full_scale() -> None:
    recorded, cause = bench_regression(), causes(stated("u_linearity_rel = 0.005"))[LINEARITY]
    p = bench_motion().breech_pa
    z = p / p.max()
    expected = LOW_PASS.apply(-BORE_M2 * p.max() * 2.0 * z * (1.0 - z) * recorded.released, recorded.rate_hz)
    np.testing.assert_allclose(cause.forces_n[:, 0], expected, atol=2e-3 * np.abs(expected).max())


@pytest.mark.parametrize(("tube_hz", "apart"), [(2400.0, 0.05), (1000.0, 0.15)])
def test_a_tube_far_above_the_cut_off_adds_what_its_swing_does(tube_hz: float, apart: float) -> None:
    recorded, cause = bench_regression(), causes(stated(tube_hz=tube_hz))[TUBE]
    assert (cause.u, cause.unit, cause.scope) == (1.0, "1", "rig")
    force_n = recorded.force_n
    w = 2.0 * math.pi * tube_hz
    _, swings_n, _ = lsim(([2.0, 0.0, 0.0], [1.0, 0.02 * w, w**2]), force_n, recorded.times_s - recorded.times_s[0])
    swung_n = LOW_PASS.apply(swings_n, recorded.rate_hz)
    used = recorded.inside & recorded.before_the_turn
    np.testing.assert_allclose(cause.forces_n[used, 0], swung_n[used], atol=apart * np.abs(swung_n[used]).max())
    assert not cause.forces_n[:, 1:].any()


def test_what_a_rig_does_not_state_or_states_as_none_is_no_cause() -> None:
    assert causes(stated()) == {}
    exact = "u_linearity_rel = 0, gauge_ahead = { chamber_length_m = 0.5, projectile_mass_kg = 15.0, u_share = 0 }"
    assert causes(stated(exact, muzzle=0.1)) == {}


def test_of_two_gauges_each_has_half_of_the_force_by_its_own_name() -> None:
    rig = stated(BENT)
    first = next(one for one in rig.channels if one.role == BREECH)
    second = first.model_copy(update={"name": "p_other", "signal": "p_other"})
    recorded, signals = bench_regression(), bench_signals()
    both = replace(rig, channels=(*rig.channels, second))
    found = {one.source: one for one in chain_causes(recorded.filtered(LOW_PASS), recorded, signals, both)}
    assert set(found) == {f(name) for f in (linearity_of, hysteresis_of) for name in ("p_breech", "p_other")}
    total = found[linearity_of("p_breech")].forces_n + found[linearity_of("p_other")].forces_n
    np.testing.assert_allclose(total, causes(rig)[LINEARITY].forces_n, atol=1e-6)


# ------------------------------------------------------------------------------------------ what the mass makes of it


def estimated(rig: Rig, off: dict[str, float], scales: ScaleUncertainty = EXACT) -> Calibration:
    """Estimate from a shot whose breech gauge reads what its chain makes of the force, by the printed equations."""
    recorded, signals = bench_regression(rig=rig), bench_signals(rig=rig)
    truth_n = bench_regression().force_n
    error_n = sum((size * errors_n(recorded)[source] for source, size in off.items()), np.zeros_like(truth_n))
    read = recorded.forces_n.copy()
    read[:, 0] -= error_n
    moved = replace(recorded, acceleration_m_s2=truth_n / MASS_KG, forces_n=read, release_n_s=0.0, u_release_n_s=0.0)
    filtered = moved.filtered(LOW_PASS)
    known = chain_causes(filtered, recorded, signals, rig)
    # each phase counts as the other
    noise = RowNoise(np.hypot(1e-2, 1e-3 * filtered.acceleration_m_s2), 1.0, math.inf)
    return calibrated_mass(filtered, scales, 0.0, noise=noise, beside=Beside(known))


@pytest.mark.parametrize("source", [LINEARITY, HYSTERESIS, AHEAD, MUZZLE_BRAKE])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_stated_shape_is_found_with_its_sign_and_leaves_the_mass(source: str, sign: float) -> None:
    size = sign * causes(ALL)[source].u
    found = estimated(ONE[source], {source: size})
    assert found.inferred.value(source) == pytest.approx(size, rel=0.05)
    # and a rig that states nothing would take it for its mass
    plain_kg, stated_kg = estimated(stated(), {source: size}).estimate.mass_kg, found.estimate.mass_kg
    assert abs(plain_kg - MASS_KG) > 0.03
    assert abs(stated_kg - MASS_KG) < 0.1 * abs(plain_kg - MASS_KG)


SCALES = ScaleUncertainty(0.005, (0.006, 0.004, 0.004), 150.0)


@pytest.mark.parametrize("source", [LINEARITY, HYSTERESIS, AHEAD, MUZZLE_BRAKE])
def test_its_row_of_the_budget_is_what_moving_it_and_estimating_anew_gives(source: str) -> None:
    found = estimated(ONE[source], {}, SCALES)
    row = next(one for one in found.estimate.budget if one.source == source)
    u = causes(ALL)[source].u
    # what is off by its u and known to none of it stays in the mass as far as the shot does not tell it
    up, down = (estimated(ONE[source], {source: sign * u}, SCALES).estimate.mass_kg for sign in (1.0, -1.0))
    assert row.sensitivity is not None
    assert row.u_kg == pytest.approx(abs(up - down) / 2, abs=0.02 * found.estimate.u_kg)
    assert row.sensitivity * u == pytest.approx((up - down) / 2, abs=0.02 * found.estimate.u_kg)
    assert row.scope == causes(ALL)[source].scope
