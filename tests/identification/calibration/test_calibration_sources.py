"""What a calibration says of each source, against the equation written out and against estimates without the source."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from recoil_acquisition.numerics.normal_distribution import CRITICAL_VALUE
from recoil_identification.calibration import methods
from recoil_identification.calibration.calibration import Calibration
from recoil_identification.calibration.methods import Beside
from recoil_identification.estimate.mass import ACCELERATION, FRICTION, GAUGES, RANDOM, MassEstimate
from recoil_identification.inference.solve import solve
from recoil_identification.inference.unknown import Prior
from recoil_identification.rows.causes import DISTORTIONS, Cause
from recoil_identification.rows.equation_of_motion import RELEASE as RELEASE_VELOCITY
from recoil_identification.rows.equation_of_motion import EquationOfMotion
from recoil_identification.rows.row_noise import RowNoise
from recoil_identification.rows.sensor_priors import CAMERA_SCALE, RELEASE, ZERO
from recoil_processing.shot.error_source import ErrorSource, SourceKind
from recoil_processing.shot.regression import Regression, spaced_rows
from tests.builders.bench_shots import MASS_KG
from tests.builders.written_out_motion import acceleration_m_s2, drawn_motion, drawn_values
from tests.identification.calibration.test_calibration import (
    SCALES,
    U_BIAS,
    alternating,
    calibrated_mass,
    exact,
    measured,
    tracked,
)

FEW = st.integers(0, 2)


def stated(block: EquationOfMotion, priors: list[Prior]) -> Calibration:
    """Say what is known of all unknowns; nothing was solved for."""
    return Calibration(
        estimate=MassEstimate("stated", block.m0_kg, (), 10, 0.0),
        noise=RowNoise(np.ones(1), 1.0, math.inf),
        block=block,
        inferred=solve(block.all_unknowns, [], priors),
        common=(),
        own=(),
    )


@st.composite
def stated_ones(draw: st.DrawFn) -> tuple[Calibration, dict[str, float]]:
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    block = drawn_motion(rng, draw(FEW), draw(FEW))
    values = drawn_values(rng, block.unknowns)
    return stated(block, [Prior.of(name, name, 0.0, value) for name, value in values.items()]), values


# ------------------------------------------------------------------------------------------ corrections


@pytest.mark.whole_way
@given(stated_ones())
def test_newtons_law_leaves_of_corrected_columns_what_the_equation_leaves_of_the_recorded_ones(drawn):
    found, values = drawn
    regression = found.block.regression
    a, force_n = found.correct(regression)
    for at, read in enumerate(regression.acceleration_m_s2):
        left = float(read) - acceleration_m_s2(found.block, values, at)
        mass_kg = found.m0_kg * math.exp(values["ln mass"])
        scale = math.exp(values["ln recoil_acceleration"])
        assert a[at] - force_n[at] / mass_kg == pytest.approx(left / scale, rel=1e-8, abs=1e-8)


@given(stated_ones())
def test_what_the_corrected_acceleration_would_have_been_read_as_is_what_was_read(drawn):
    found, values = drawn
    r = found.block.regression
    again = math.exp(values["ln recoil_acceleration"]) * found.correct(r)[0]
    again += values["zero of recoil_acceleration"] * r.released + values["velocity at the release"] * r.release_per_s
    for cause in found.block.causes:
        again += values[cause.source] * cause.acceleration_m_s2
    if r.shifts is not None:
        assert found.shifts_m_s2.tolist() == [values[f"shift {i + 1} of the zero"] for i in range(r.shifts.shape[1])]
        again += r.shifts @ found.shifts_m_s2
    np.testing.assert_allclose(again, r.acceleration_m_s2, rtol=1e-9, atol=1e-9)


@given(st.integers(0, 2**32 - 1))
def test_a_cause_that_is_left_in_adds_its_size_of_its_shape_and_no_other_does(seed):
    rng = np.random.default_rng(seed)
    block = drawn_motion(rng, 0, 2)
    values = drawn_values(rng, block.unknowns)
    found = stated(block, [Prior.of(name, name, 0.0, value) for name, value in values.items()])
    first = block.causes[0]
    without, kept = (found.correct(block.regression, but) for but in ("", first.source))
    size = values[first.source]
    by_acceleration = size * first.acceleration_m_s2 / math.exp(values["ln recoil_acceleration"])
    gauges = np.exp([-values[f"ln {role}_pressure"] for role in ("breech", "brake", "recuperator")])
    np.testing.assert_allclose(kept[0] - without[0], by_acceleration, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(without[1] - kept[1], size * first.forces_n @ gauges, rtol=1e-9, atol=1e-6)


@pytest.mark.whole_way
@given(st.integers(0, 2**32 - 1), FEW, FEW, FEW)
def test_the_errors_left_have_the_covariance_of_all_errors_but_the_mass_in_the_written_equation(
    seed, shifts, causes, changes
):
    rng = np.random.default_rng(seed)
    block = drawn_motion(rng, shifts, causes, changes)
    values, names = drawn_values(rng, block.unknowns), block.unknowns
    u = np.array([abs(one) for one in drawn_values(rng, names).values()])
    # errors of calibrations hang together
    mixed = np.eye(len(names)) + 0.3 * rng.normal(size=(len(names), len(names)))
    covariance = (u[:, np.newaxis] * mixed) @ (u[:, np.newaxis] * mixed).T
    found = stated(block, [Prior(names, names, np.eye(len(names)), np.array([*values.values()]), covariance)])
    constant = replace(block, changes=None)
    kept = [names.index(name) for name in constant.unknowns[1:]]
    slopes = np.zeros((block.regression.times_s.size, len(kept)))
    for column, at in enumerate(kept):
        step = 1e-3 * u[at]
        for row in range(slopes.shape[0]):
            up, down = (
                acceleration_m_s2(constant, values | {names[at]: values[names[at]] + by}, row) for by in (step, -step)
            )
            slopes[row, column] = (up - down) / (2 * step)
    expected = slopes @ covariance[np.ix_(kept, kept)] @ slopes.T
    errors = found.errors_left(block.regression)
    np.testing.assert_allclose(errors @ errors.T, expected, rtol=1e-4, atol=1e-6 * np.abs(expected).max())


# ------------------------------------------------------------------------------------------ rows and priors


@pytest.mark.parametrize("n_shifts", [0, 2])
def test_the_residual_is_that_of_the_written_equation_over_the_rows_that_nothing_free_takes(n_shifts):
    regression = measured(noise=alternating(1.0))
    if n_shifts:
        since = np.maximum(regression.times_s - regression.interval_s[0], 0.0)
        regression = regression.with_shifts(np.column_stack([since > 0, since]).astype(np.float64))
    found = calibrated_mass(regression, SCALES, U_BIAS)
    rows = spaced_rows(regression)
    left = [
        float(regression.acceleration_m_s2[at]) - acceleration_m_s2(found.block, found.values, int(at)) for at in rows
    ]
    assert found.estimate.rows == rows.size
    # mass, zero and release are free, and so is each shift
    free = 3 + n_shifts
    assert found.estimate.residual_m_s2 == pytest.approx(
        math.sqrt(math.fsum(one**2 for one in left) / (rows.size - free))
    )


def test_a_zero_that_shifted_at_the_shot_is_found_with_its_uncertainty_and_taken_off():
    clean = measured(noise=alternating(0.3))
    step = (clean.times_s >= clean.interval_s[0] + 0.02).astype(np.float64)
    shaped = clean.with_shifts(step[:, np.newaxis])
    assert shaped.shifts is not None
    shot = replace(shaped, acceleration_m_s2=shaped.acceleration_m_s2 + 7.0 * shaped.shifts[:, 0])
    found, sound = (calibrated_mass(one, SCALES, U_BIAS, sigma=0.3) for one in (shot, shaped))
    assert found.shifts_m_s2[0] - sound.shifts_m_s2[0] == pytest.approx(7.0, rel=1e-3)
    assert abs(found.shifts_m_s2[0] - 7.0) < 3 * found.u_shifts_m_s2[0] < 2.0
    np.testing.assert_allclose(found.correct(shot)[0], sound.correct(shaped)[0], rtol=1e-3, atol=0.02)
    # without a shape there is none
    assert calibrated_mass(clean, SCALES, U_BIAS).shifts_m_s2.size == 0


def test_an_impulse_that_is_expected_at_the_release_is_no_departure():
    velocity_m_s = 0.02
    shot = replace(measured(release_m_s=velocity_m_s, noise=alternating(0.2)), release_n_s=velocity_m_s * MASS_KG)
    found = calibrated_mass(shot, SCALES, U_BIAS, sigma=0.2)
    assert found.release_m_s == pytest.approx(velocity_m_s, rel=0.02)
    assert abs(found.pulls[RELEASE]) < 0.05
    # how far it may be off is an impulse, too
    (row,) = [row for row in found.estimate.budget if row.source == RELEASE]
    assert row.u_source == pytest.approx(shot.u_release_n_s / found.m0_kg)


@pytest.mark.parametrize("source", [GAUGES[1], FRICTION, ZERO])
def test_to_forget_a_source_is_to_estimate_without_its_certificate(source):
    shot = measured(gauges=(0.002, -0.004, 0.003), bias_m_s2=0.2, noise=alternating(1.0))
    unknown = 1e6
    scales = {
        GAUGES[1]: replace(SCALES, gauges=(SCALES.gauges[0], unknown, SCALES.gauges[2])),
        FRICTION: replace(SCALES, friction_n=unknown * SCALES.friction_n),
    }
    whole = calibrated_mass(shot, SCALES, U_BIAS, tracked())
    forgotten = whole.without_prior(source)
    anew = calibrated_mass(shot, scales.get(source, SCALES), math.inf if source == ZERO else U_BIAS, tracked())
    assert forgotten.estimate is whole.estimate
    assert source not in forgotten.pulls
    assert whole.pulls.keys() - forgotten.pulls.keys() == {source}
    for name, value in anew.values.items():
        u = anew.inferred.u(name)
        assert forgotten.values[name] - (math.log(anew.m0_kg / whole.m0_kg) if name == "ln mass" else 0.0) == (
            pytest.approx(value, abs=1e-3 * u if math.isfinite(u) else 1e-9)
        )
        assert forgotten.inferred.u(name) == pytest.approx(u, rel=1e-3)


def a_cause(regression: Regression) -> Cause:
    forces_n = np.zeros((regression.times_s.size, 3))
    forces_n[:, 1] = 0.0056 * regression.released
    return Cause(
        ErrorSource(SourceKind.ZERO, "brake_pressure"), "Pa", 2e3, "A", forces_n, np.zeros(regression.times_s.size)
    )


def test_each_row_of_the_budget_states_the_unit_of_its_source_and_how_its_uncertainty_was_found():
    shot = measured(noise=alternating(1.0))
    camera = replace(
        tracked(), u_other_rel=0.01, u_other_zero_m_s2=0.1, u_distortion_m=1e-4, other_m=0.01 * tracked().felt_m
    )
    noise = RowNoise(np.ones(shot.times_s.size), 1.0, 40.0)
    beside = Beside(causes=(a_cause(shot),), camera=camera)
    found = methods.calibrated_mass(shot, SCALES, U_BIAS, noise=noise, beside=beside)
    rows = {row.source: row for row in found.estimate.budget}
    units = {row.source: row.sensitivity_per for row in found.estimate.budget if row.source != RANDOM}
    assert units == {
        **dict.fromkeys((*GAUGES, ACCELERATION, CAMERA_SCALE), "1"),
        FRICTION: "N",
        ZERO: "m/s^2",
        RELEASE: "m/s",
        "brake_pressure zero": "Pa",
        "the carriage's part of the travel too large": "1",
        "zero of the carriage's part of the travel": "m/s^2",
        "place before the shot": "m",
        "camera late": "s",
        **dict.fromkeys(DISTORTIONS, "m"),
    }
    assert {source for source, row in rows.items() if row.kind == "A"} == {RANDOM, "brake_pressure zero"}
    assert rows[RANDOM].degrees_of_freedom == 40.0
    # the variance is theirs together
    assert math.fsum(row.u_kg**2 for row in rows.values()) == pytest.approx(
        (found.estimate.mass_kg * found.inferred.u("ln mass")) ** 2, rel=1e-6
    )


def test_a_cause_costs_the_mass_what_it_moves_it_by():
    shot = measured(noise=alternating(1.0))
    cause = a_cause(shot)
    noise = RowNoise(np.ones(shot.times_s.size), 1.0, math.inf)

    def found(by_pa: float) -> Calibration:
        forces_n = shot.forces_n.copy()
        # the reading lacks what the cause says it does
        forces_n[:, :3] -= by_pa * cause.forces_n
        moved = replace(shot, forces_n=forces_n)
        return methods.calibrated_mass(moved, SCALES, U_BIAS, noise=noise, beside=Beside(causes=(cause,)))

    (row,) = [row for row in found(0.0).estimate.budget if row.source == cause.source]
    up, down = (found(sign * cause.u).estimate.mass_kg for sign in (1.0, -1.0))
    assert row.sensitivity == pytest.approx((up - down) / (2 * cause.u), rel=0.01)
    assert row.u_kg == pytest.approx(abs(up - down) / 2, rel=0.01)


def test_every_unknown_that_anything_names_is_estimated_once():
    shot = measured(noise=alternating(1.0))
    area = replace(SCALES, parts={"breech_pressure": ((ErrorSource(SourceKind.AREA, "bore_area"), 0.004),)})
    names = [one.name for one in calibrated_mass(shot, area, U_BIAS, tracked()).inferred.unknowns]
    assert len(set(names)) == len(names)
    assert {"ln mass", "ln bore_area", "ln camera", "camera late", RELEASE_VELOCITY.name} <= set(names)
    alone = calibrated_mass(shot, SCALES, U_BIAS)
    assert [one.name for one in alone.inferred.unknowns] == [*alone.block.unknowns]


# ------------------------------------------------------------------------------------------ draws and the level


def test_a_draw_that_is_off_by_more_than_a_factor_e_is_none():
    block, ln_mass, u = drawn_motion(np.random.default_rng(3)), 0.4, 0.8
    exactly = [Prior.of(name, name, 0.0) for name in block.unknowns if name != "ln mass"]
    found = stated(block, [Prior.of("stated", "ln mass", u, ln_mass), *exactly])
    drawn = found.draws()(np.random.default_rng(3), 20_000)
    lost = np.isnan(drawn)
    assert np.mean(lost) == pytest.approx(2 * stats.norm.sf(1.0 / u), abs=0.01)
    # about the estimate, not about where it began
    logs = np.log(drawn[~lost] / found.m0_kg) - ln_mass
    assert np.abs(logs).max() <= 1.0 + 1e-12
    assert np.mean(logs) == pytest.approx(0.0, abs=0.02)
    assert np.std(logs) == pytest.approx(stats.truncnorm(-1.0 / u, 1.0 / u, scale=u).std(), rel=0.02)


def test_draws_lie_about_the_estimate_as_wide_as_its_uncertainty():
    found = calibrated_mass(measured(gauges=(0.004, 0.0, 0.0), noise=alternating(1.0)), SCALES, U_BIAS, tracked())
    drawn = found.draws()(np.random.default_rng(3), 20_000)
    assert np.mean(drawn) == pytest.approx(found.estimate.mass_kg, abs=0.03 * found.estimate.u_kg)
    assert np.std(drawn) == pytest.approx(found.estimate.u_kg, rel=0.02)


def test_one_sound_sensor_of_a_thousand_goes_beyond_the_critical_value():
    assert 2 * stats.norm.sf(CRITICAL_VALUE) == pytest.approx(1e-3, rel=0.01)


def test_a_zero_that_no_baseline_tells_has_no_prior_and_one_that_it_tells_has():
    shot = measured(noise=alternating(1.0))
    assert ZERO in calibrated_mass(shot, SCALES, U_BIAS).pulls
    assert ZERO not in calibrated_mass(shot, SCALES, math.inf).pulls
    assert exact().shifts is None
