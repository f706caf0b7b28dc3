from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from recoil_identification.calibration import methods
from recoil_identification.calibration.calibration import Calibration
from recoil_identification.calibration.methods import Beside
from recoil_identification.estimate.mass import ACCELERATION, FRICTION, GAUGES, RANDOM, MassEstimate, reverse_mass
from recoil_identification.rows.camera_rows import CameraRows
from recoil_identification.rows.row_noise import RowNoise
from recoil_identification.rows.sensor_priors import CAMERA_SCALE, RELEASE, ZERO
from recoil_processing.double_integral import DoubleIntegral
from recoil_processing.filters import LowPass
from recoil_processing.shot.error_source import ErrorSource, SourceKind
from recoil_processing.shot.regression import Regression, spaced_rows
from recoil_processing.shot.sensor_scales import ScaleUncertainty
from tests.builders.bench_shots import MASS_KG, bench_regression
from tests.builders.calibrations import a_calibration

SCALES = ScaleUncertainty(0.005, (0.006, 0.004, 0.004), 150.0)
U_BIAS = 0.2


def calibrated_mass(
    regression: Regression,
    scales: ScaleUncertainty,
    u_bias: float,
    camera: CameraRows | None = None,
    sigma: float = 1.0,
) -> Calibration:
    """Estimate from rows whose errors are known to be of that size."""
    noise = RowNoise(np.full(regression.times_s.size, sigma), 1.0, math.inf)
    return methods.calibrated_mass(regression, scales, u_bias, noise=noise, beside=Beside(camera=camera))


@cache
def exact() -> Regression:
    """Filtered, with Newton's law in every row; no impulse is expected at the release."""
    regression = replace(bench_regression(), release_n_s=0.0).filtered(LowPass(300.0))
    return replace(regression, acceleration_m_s2=regression.force_n / MASS_KG)


def measured(
    *,
    gauges: tuple[float, float, float] = (0.0, 0.0, 0.0),
    friction_n: float = 0.0,
    acceleration: float = 0.0,
    bias_m_s2: float = 0.0,
    release_m_s: float = 0.0,
    noise: np.ndarray | None = None,
) -> Regression:
    """Let sensors with errors read the exact shot; the noise is white on the rows."""
    truth = exact()
    forces = truth.forces_n.copy()
    forces[:, :3] *= 1.0 + np.array(gauges)
    forces[:, 3] += friction_n * truth.friction_direction
    a = (1 + acceleration) * truth.acceleration_m_s2 + bias_m_s2 * truth.released + release_m_s * truth.release_per_s
    if noise is not None:
        a[spaced_rows(truth)] += noise
    return replace(truth, forces_n=forces, acceleration_m_s2=a)


def tracked(
    *, camera: float = 0.0, u_rel: float = 0.001, sigma_m: float = 1e-4, noise: np.ndarray | None = None, **errors: Any
) -> CameraRows:
    """Let a camera see what an accelerometer with errors felt; no noise but the camera's own is in its frames."""
    true, felt = exact(), measured(**errors)
    onset_s, end_s = true.interval_s
    times_s = np.arange(onset_s + 5e-4, end_s, 1e-3)

    def travel(acceleration: np.ndarray) -> np.ndarray:
        return DoubleIntegral.of(acceleration, float(true.times_s[0]), true.step_s).at(times_s)[0]

    released = errors.get("release_m_s", 0.0) * true.release_per_s
    recorded_m = (1.0 + camera) * travel(true.acceleration_m_s2 + released)
    return CameraRows(
        times_s=times_s,
        recorded_m=recorded_m if noise is None else recorded_m + sigma_m * noise,
        sigma_m=np.full(times_s.size, sigma_m),
        onset_s=onset_s,
        density=0.0,
        felt_m=travel(felt.acceleration_m_s2),
        other_m=np.zeros(times_s.size),
        certain_m=np.zeros(times_s.size),
        free_m=travel(true.released),
        velocity_m_s=np.gradient(recorded_m, times_s),
        zeros_m=np.zeros((times_s.size, 0)),
        sizes=(),
        bends=np.zeros((times_s.size, 2)),
        u_rel=u_rel,
        u_other_rel=0.0,
        u_other_zero_m_s2=0.0,
        u_distortion_m=0.0,
        clock="camera",
        drift=0.0,
        u_rate=0.0,
    )


def alternating(sigma: float) -> np.ndarray:
    """Noise that drifts nowhere."""
    size = spaced_rows(exact()).size
    return sigma * np.where(np.arange(size) % 2 == 0, 1.0, -1.0)


def generalized_least_squares(
    regression: Regression, scales: ScaleUncertainty, u_bias: float, sigma: float
) -> tuple[float, float]:
    """Mass and its uncertainty with the sensors' errors in a dense covariance, the inverse mass the one unknown."""
    rows = spaced_rows(regression)
    a, forces, released = regression.acceleration_m_s2[rows], regression.forces_n[rows], regression.released[rows]
    f, sliding, release = forces.sum(axis=1), regression.friction_direction[rows], regression.release_per_s[rows]
    k = 1.0 / reverse_mass(regression, scales).mass_kg
    for _ in range(20):
        # columns: what one error of each sensor does to the rows
        effects = [(-k * forces[:, j], u) for j, u in enumerate(scales.gauges)]
        effects += [(-k * sliding, scales.friction_n), (k * f, scales.acceleration), (released, u_bias)]
        effects.append((release, k * regression.u_release_n_s))
        table = np.column_stack([effect for effect, _ in effects])
        covariance = (table * np.array([u**2 for _, u in effects])) @ table.T + sigma**2 * np.eye(a.size)
        weights = np.linalg.solve(covariance, f)
        k = float(weights @ a / (weights @ f))
    return 1.0 / k, float(1.0 / k**2 / math.sqrt(weights @ f))


@pytest.mark.parametrize(
    "errors", [{}, {"gauges": (0.002, -0.001, 0.003), "friction_n": 60.0, "acceleration": -0.002, "bias_m_s2": 0.1}]
)
def test_it_is_generalized_least_squares_with_the_calibrations_in_the_covariance(errors):
    found = calibrated_mass(measured(**errors, noise=alternating(1.0)), SCALES, U_BIAS).estimate
    mass, u = generalized_least_squares(measured(**errors, noise=alternating(1.0)), SCALES, U_BIAS, 1.0)
    # the dense covariance is linear in errors that the estimator takes exactly: products of errors are left
    assert found.mass_kg == pytest.approx(mass, abs=0.01 * u)
    assert found.u_kg == pytest.approx(u, rel=2e-3)


def test_with_nothing_left_free_it_is_the_reverse_estimate():
    regression = measured(noise=np.random.default_rng(3).normal(0.0, 2.0, alternating(1.0).size))
    regression, nothing = replace(regression, u_release_n_s=0.0), ScaleUncertainty(0.0, (0.0, 0.0, 0.0), 0.0)
    reverse = reverse_mass(regression, nothing)
    found = calibrated_mass(regression, nothing, 0.0, sigma=reverse.residual_m_s2)
    assert found.estimate.mass_kg == pytest.approx(reverse.mass_kg, rel=1e-9)
    assert found.estimate.u_kg == pytest.approx(reverse.u_kg, rel=0.02)
    assert [r.source for r in found.estimate.budget] == [RANDOM]
    assert found.pulls == {}


def test_as_the_calibrations_tighten_it_tends_to_the_reverse_estimate():
    regression = replace(measured(gauges=(0.01, -0.01, 0.0), noise=alternating(2.0)), u_release_n_s=0.0)
    reverse = reverse_mass(regression, SCALES).mass_kg
    apart = []
    for share in (1.0, 0.1, 0.01):
        scales = ScaleUncertainty(share * 0.005, (share * 0.006, share * 0.004, share * 0.004), share * 150.0)
        apart.append(abs(calibrated_mass(regression, scales, share * U_BIAS, sigma=5.0).estimate.mass_kg - reverse))
    assert apart[0] > 5 * apart[1] > 25 * apart[2]


def test_large_errors_are_taken_exactly_not_to_first_order():
    errors = {"gauges": (0.04, -0.03, 0.02), "friction_n": 300.0, "acceleration": 0.03, "bias_m_s2": 2.0}
    # the friction and the scales relative to one another are free, the accelerometer is known by the camera
    wide = ScaleUncertainty(0.5, (0.5, 0.5, 0.5), 1e4)
    shot = errors | {"gauges": (0.0, -0.03, 0.02)}
    tight = replace(wide, gauges=(1e-7, 0.5, 0.5))
    found = calibrated_mass(measured(**shot), tight, math.inf, tracked(**shot, u_rel=1e-6, sigma_m=1e-8))
    assert found.estimate.mass_kg == pytest.approx(MASS_KG, rel=1e-5)
    np.testing.assert_allclose(found.gauge_errors, [0.0, -0.03, 0.02], atol=2e-4)
    assert found.acceleration_error == pytest.approx(0.03, abs=1e-5)
    assert found.bias_m_s2 == pytest.approx(2.0, abs=1e-3)
    assert found.friction_error_n == pytest.approx(300.0, abs=10.0)


def test_corrections_undo_the_errors_of_the_sensors():
    errors = {"gauges": (0.03, -0.02, 0.01), "friction_n": 200.0, "acceleration": 0.02, "bias_m_s2": 3.0}
    estimate = MassEstimate("calibrated", MASS_KG, (), 10, 0.0)
    found = a_calibration(estimate, **errors)
    a, force = found.correct(measured(**errors))
    np.testing.assert_allclose(a, exact().acceleration_m_s2, atol=1e-9)
    np.testing.assert_allclose(force, exact().force_n, atol=1e-6)


@pytest.mark.parametrize(
    ("source", "errors"),
    [
        (GAUGES[0], {"gauges": (1e-4, 0.0, 0.0)}),
        (GAUGES[1], {"gauges": (0.0, 1e-4, 0.0)}),
        (GAUGES[2], {"gauges": (0.0, 0.0, 1e-4)}),
        (FRICTION, {"friction_n": 5.0}),
        (ACCELERATION, {"acceleration": 1e-4}),
        (ZERO, {"bias_m_s2": 0.01}),
    ],
)
def test_a_sensitivity_is_what_the_mass_does_when_the_sensor_reads_high(source, errors):
    noise = alternating(1.0)
    # the camera sees an accelerometer that reads high, too
    high, low = ({k: np.multiply(v, sign).tolist() for k, v in errors.items()} for sign in (1.0, -1.0))
    masses = [
        calibrated_mass(measured(**e, noise=noise), SCALES, U_BIAS, tracked(**e)).estimate.mass_kg for e in (high, low)
    ]
    size = float(np.max(np.abs(np.hstack(list(errors.values())))))
    budget = {r.source: r for r in calibrated_mass(measured(noise=noise), SCALES, U_BIAS, tracked()).estimate.budget}
    assert budget[source].sensitivity == pytest.approx((masses[0] - masses[1]) / (2 * size), rel=0.02, abs=0.05)
    units = {FRICTION: "N", ZERO: "m/s^2"}
    assert budget[source].sensitivity_per == units.get(source, "1")


def test_a_cameras_sensitivity_is_what_the_mass_does_when_the_camera_reads_high():
    shot = measured(noise=alternating(1.0))
    high, low = (calibrated_mass(shot, SCALES, U_BIAS, tracked(camera=by)).estimate.mass_kg for by in (1e-4, -1e-4))
    budget = {r.source: r for r in calibrated_mass(shot, SCALES, U_BIAS, tracked()).estimate.budget}
    assert budget[CAMERA_SCALE].sensitivity == pytest.approx((high - low) / 2e-4, rel=0.02)


@pytest.mark.whole_way
@pytest.mark.parametrize("with_camera", [False, True])
def test_the_stated_interval_covers_the_mass_as_often_as_it_says(with_camera):
    rng = np.random.default_rng(20130901)
    sigma, draws = 2.0, 400
    size = spaced_rows(exact()).size
    inside, z, normalised_residuals = 0, [], []
    for _ in range(draws):
        gauges = tuple(rng.normal(0.0, SCALES.gauges))
        acceleration, friction = rng.normal(0.0, SCALES.acceleration), rng.normal(0.0, SCALES.friction_n)
        bias = rng.normal(0.0, U_BIAS)
        release = rng.normal(0.0, exact().u_release_n_s / MASS_KG)
        camera = None
        errors = {
            "gauges": gauges, "friction_n": friction, "acceleration": acceleration, "bias_m_s2": bias,
            "release_m_s": release,
        }  # fmt: skip
        if with_camera:
            frames = rng.standard_normal(tracked().times_s.size)
            camera = tracked(camera=rng.normal(0.0, 0.001), noise=frames, **errors)
        found = calibrated_mass(measured(**errors, noise=rng.normal(0.0, sigma, size)), SCALES, U_BIAS, camera, sigma)
        low, high = found.estimate.interval_kg
        inside += low <= MASS_KG <= high
        z.append((found.estimate.mass_kg - MASS_KG) / found.estimate.u_kg)
        drawn = (*GAUGES, FRICTION, ZERO, RELEASE, *((ACCELERATION, CAMERA_SCALE) if with_camera else ()))
        normalised_residuals.append([found.normalised_residuals[source] for source in drawn])
    assert 0.92 <= inside / draws <= 0.98
    assert abs(np.mean(z)) < 4 / math.sqrt(draws)
    # what a sensor's departure is measured by has a standard deviation of one, and is nothing where without
    # the camera the accelerometer's scale and the mass cannot be told apart
    assert with_camera or found.normalised_residuals[ACCELERATION] == 0.0
    np.testing.assert_allclose(np.std(normalised_residuals, axis=0), 1.0, atol=0.15)


def test_what_the_stop_gives_at_the_release_is_found_and_taken_off():
    given = 0.5 * exact().u_release_n_s / MASS_KG
    with_stop, without = (measured(release_m_s=v, noise=alternating(0.2)) for v in (given, 0.0))
    found = calibrated_mass(with_stop, SCALES, U_BIAS, tracked(release_m_s=given), 0.2)
    assert given > 1e-3
    assert found.release_m_s == pytest.approx(given, rel=0.2)
    assert found.estimate.mass_kg == pytest.approx(
        calibrated_mass(without, SCALES, U_BIAS, tracked(), 0.2).estimate.mass_kg, abs=0.02
    )
    a, _ = found.correct(with_stop)
    at_release = exact().release_per_s > 0.5 * exact().release_per_s.max()
    off = np.abs(with_stop.acceleration_m_s2 - exact().acceleration_m_s2)[at_release]
    assert np.abs(a - exact().acceleration_m_s2)[at_release].max() < 0.6 * off.min()


@pytest.mark.whole_way
def test_the_errors_left_are_those_that_draws_of_the_sensors_leave():
    rng, left = np.random.default_rng(5), []
    for _ in range(150):
        errors = {
            "gauges": tuple(rng.normal(0.0, SCALES.gauges)),
            "acceleration": rng.normal(0.0, SCALES.acceleration),
            "friction_n": rng.normal(0.0, SCALES.friction_n),
            "bias_m_s2": rng.normal(0.0, U_BIAS),
            "release_m_s": rng.normal(0.0, exact().u_release_n_s / MASS_KG),
        }
        shot = measured(**errors, noise=rng.normal(0.0, 1.0, alternating(1.0).size))
        found = calibrated_mass(shot, SCALES, U_BIAS, None)
        # the noise stands at the rows alone: what is corrected is looked at between them
        a, force = found.correct(measured(**errors))
        left.append(a - force / MASS_KG)
    stated = np.sqrt((found.errors_left(shot) ** 2).sum(axis=1))
    between = spaced_rows(exact())[2:-2:5] + 3
    np.testing.assert_allclose(np.std(left, axis=0)[between], stated[between], rtol=0.25)


def test_the_errors_left_are_as_exact_as_their_covariance_whatever_the_units():
    # one gauge is known exactly
    scales = replace(SCALES, gauges=(*SCALES.gauges[:2], 0.0))
    found, shot = calibrated_mass(measured(noise=alternating(1.0)), scales, U_BIAS, None), measured()
    n = shot.times_s.size
    rows = {"regression": shot, "rows": np.arange(n), "sigma_m_s2": np.ones(n), "changes": None}
    slopes = replace(found.block, **rows).linearised(found.values)[1][:, 1:]
    kept = len(found.block.unknowns)
    covariance = found.inferred.covariance[1:kept, 1:kept]
    # a friction's variance in N^2 beside that of a scale
    assert np.ptp(np.log10(np.diag(covariance)[np.diag(covariance) > 0])) > 8
    expected = np.einsum("ni,ij,nj->n", slopes, covariance, slopes)
    np.testing.assert_allclose((found.errors_left(shot) ** 2).sum(axis=1), expected, rtol=1e-9, atol=1e-12)


def test_a_sensor_beyond_its_uncertainty_stands_out():
    found = calibrated_mass(measured(gauges=(0.06, 0.0, 0.0), noise=alternating(1.0)), SCALES, U_BIAS, tracked())
    assert max(found.normalised_residuals, key=lambda s: abs(found.normalised_residuals[s])) == GAUGES[0]
    assert found.normalised_residuals[GAUGES[0]] > 5
    assert 0 < found.pulls[GAUGES[0]] < found.normalised_residuals[GAUGES[0]]


@pytest.mark.parametrize("off", [0.03, 0.06, 0.2])
def test_a_misfit_is_not_taken_for_noise(off):
    sound, wrong = (
        methods.calibrated_mass(measured(gauges=(by, 0.0, 0.0), noise=alternating(1.0)), SCALES, U_BIAS)
        for by in (0.0, off)
    )
    assert max(abs(w) for w in wrong.normalised_residuals.values()) > 100 * off
    # rows that alternate have all in the upper half of the band, by which their noise is read
    np.testing.assert_allclose(wrong.noise.sizes_m_s2, sound.noise.sizes_m_s2, rtol=1e-3)
    assert wrong.noise.unexplained_share == 0.0


def test_without_a_baseline_the_zero_is_found_from_the_shot_itself():
    found = calibrated_mass(measured(bias_m_s2=4.0, noise=alternating(1.0)), SCALES, math.inf, None)
    assert found.bias_m_s2 == pytest.approx(4.0, abs=2.0)
    assert ZERO not in found.pulls
    biased = calibrated_mass(measured(bias_m_s2=4.0, noise=alternating(1.0)), SCALES, 1e-3, None)
    assert abs(found.estimate.mass_kg - MASS_KG) < abs(biased.estimate.mass_kg - MASS_KG) + found.estimate.u_kg


# ------------------------------------------------------------------------------------------ areas and standards


def with_parts(**parts: tuple[tuple[ErrorSource, float], ...]) -> ScaleUncertainty:
    return replace(SCALES, parts=parts)


def by_source(found: Calibration) -> dict[str, float]:
    return {row.source: row.u_kg for row in found.estimate.budget}


def test_an_area_has_a_row_of_its_own_and_moves_nothing():
    regression = measured(noise=alternating(1.0))
    whole, apart = (
        calibrated_mass(regression, scales, U_BIAS, tracked())
        for scales in (SCALES, with_parts(breech_pressure=((ErrorSource(SourceKind.AREA, "bore_area"), 0.004),)))
    )
    assert apart.estimate.mass_kg == pytest.approx(whole.estimate.mass_kg, rel=1e-9)
    assert apart.estimate.u_kg == pytest.approx(whole.estimate.u_kg, rel=1e-6)
    rows, before = by_source(apart), by_source(whole)[GAUGES[0]]
    # 0.6 % in all
    assert rows["bore_area"] == pytest.approx(before * 0.004 / 0.006, rel=1e-6)
    assert rows["breech_pressure sensitivity"] == pytest.approx(
        before * math.sqrt(0.006**2 - 0.004**2) / 0.006, rel=1e-6
    )
    assert GAUGES[0] not in rows


def test_what_a_standard_is_off_all_its_gauges_are_off_together():
    regression = measured(noise=alternating(1.0))
    standard = ((ErrorSource(SourceKind.STANDARD, "dead weight"), 0.003),)
    roles = ("breech_pressure", "brake_pressure", "recuperator_pressure")
    shared = calibrated_mass(regression, with_parts(**dict.fromkeys(roles, standard)), U_BIAS, tracked())
    alone = calibrated_mass(regression, SCALES, U_BIAS, tracked())
    assert shared.estimate.u_kg > 1.1 * alone.estimate.u_kg
    # a common factor of all forces is one of the mass, but for what accelerometer and camera know better
    assert by_source(shared)["standard dead weight"] / MASS_KG == pytest.approx(0.003, rel=0.1)
    # by the textbook: the same covariance written out
    sigma, u = 1.0, np.array(SCALES.gauges)
    rows = spaced_rows(regression)
    forces = regression.forces_n[rows]
    columns = np.column_stack([
        -forces.sum(axis=1), -forces[:, :3], -regression.friction_direction[rows], forces.sum(axis=1)
    ]) / MASS_KG  # fmt: skip
    columns = np.column_stack([columns, regression.released[rows], regression.release_per_s[rows]]) / sigma
    known = np.zeros((8, 8))
    known[1:4, 1:4] = np.linalg.inv(np.diag(u**2 - 0.003**2) + 0.003**2)
    known[4, 4], known[6, 6] = SCALES.friction_n**-2, U_BIAS**-2
    camera = tracked()
    known[5, 5] += SCALES.acceleration**-2
    # frames: the accelerometer's scale and zero, the camera's scale, its place and its clock
    seen = np.column_stack([
        -camera.felt_m, -camera.free_m, camera.felt_m, np.ones_like(camera.felt_m), camera.velocity_m_s
    ]) / camera.sigma_m[0]  # fmt: skip
    about = seen.T @ seen + np.diag([0.0, 0.0, camera.u_rel**-2, 1e4, 1e6])
    known[np.ix_([5, 6], [5, 6])] += np.linalg.inv(np.linalg.inv(about)[:2, :2])
    kept = [0, 1, 2, 3, 4, 5, 6] + ([7] if np.any(columns[:, 7]) else [])
    if 7 in kept:
        known[7, 7] = (alone.m0_kg / regression.u_release_n_s) ** 2
    covariance = np.linalg.inv((columns.T @ columns + known)[np.ix_(kept, kept)])
    assert shared.inferred.u("ln mass") == pytest.approx(math.sqrt(covariance[0, 0]), rel=5e-3)


def test_a_standard_that_is_all_of_a_certificate_leaves_the_sensor_nothing_of_its_own():
    parts = dict.fromkeys(("breech_pressure", "brake_pressure"), ((ErrorSource(SourceKind.STANDARD, "s"), 0.004),))
    found = calibrated_mass(measured(noise=alternating(1.0)), with_parts(**parts), U_BIAS, tracked())
    assert by_source(found)[GAUGES[1]] == pytest.approx(0.0, abs=1e-3)
    assert found.inferred.converged
