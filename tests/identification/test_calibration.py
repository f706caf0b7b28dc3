from __future__ import annotations

import math
from dataclasses import astuple, dataclass, replace
from functools import cache

import numpy as np
import pytest

from recoil_identification import calibration
from recoil_identification.calibration import Calibration
from recoil_identification.mass import ACCELERATION, FRICTION, GAUGES, RANDOM, MassEstimate, reverse_mass
from recoil_identification.row_noise import RowNoise
from recoil_identification.sensor_priors import CAMERA_GAIN, CAMERA_ZERO, ZERO, CameraScale
from recoil_processing.filters import LowPass
from recoil_processing.shot.regression import Regression, spaced_rows
from recoil_processing.shot.sensor_scales import ScaleUncertainty
from tests.builders.bench_shots import MASS_KG, bench_regression
from tests.builders.calibrations import a_calibration

SCALES = ScaleUncertainty(0.005, (0.006, 0.004, 0.004), 150.0)
U_BIAS = 0.2


@dataclass(frozen=True)
class Camera:
    """What a camera's alignment finds, as `CameraScale.of_constant` takes it."""

    gain: float = 1.0
    u_gain: float = 0.0006
    bias_m_s2: float = 0.0
    u_bias_m_s2: float = 0.3
    correlation: float = -0.6
    u_rel: float = 0.001

    def __call__(self) -> CameraScale:
        return CameraScale.of_constant(*astuple(self))


CAMERA = Camera()


def calibrated_mass(
    regression: Regression, scales: ScaleUncertainty, u_bias: float, camera: Camera | None, sigma: float = 1.0
) -> Calibration:
    """Estimate from rows whose errors are known to be of that size."""
    noise = RowNoise(np.full(regression.times_s.size, sigma), 1.0, math.inf)
    return calibration.calibrated_mass(regression, scales, u_bias, None if camera is None else camera(), noise=noise)


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


def alternating(sigma: float) -> np.ndarray:
    """Noise that drifts nowhere."""
    size = spaced_rows(exact()).size
    return sigma * np.where(np.arange(size) % 2 == 0, 1.0, -1.0)


def generalized_least_squares(
    regression: Regression, scales: ScaleUncertainty, u_bias: float, camera: CameraScale | None, sigma: float
) -> tuple[float, float]:
    """Mass and its uncertainty with the sensors' errors in a dense covariance, the inverse mass the one unknown."""
    rows = spaced_rows(regression)
    a, forces, released = regression.acceleration_m_s2[rows], regression.forces_n[rows], regression.released[rows]
    f, sliding, release = forces.sum(axis=1), regression.friction_direction[rows], regression.release_per_s[rows]
    k = 1.0 / reverse_mass(regression, scales).mass_kg
    for _ in range(20):
        # columns: what one error of each sensor does to the rows, and to the camera's gain and constant
        effects = [(-k * forces[:, j], 0.0, 0.0, u) for j, u in enumerate(scales.gauges)]
        effects.append((-k * sliding, 0.0, 0.0, scales.friction_n))
        effects.append((k * f, -1.0, 0.0, scales.acceleration))
        effects.append((released, 0.0, -1.0, u_bias))
        effects.append((release, 0.0, 0.0, k * regression.u_release_n_s))
        table = np.array([[*rows_, g, c] for rows_, g, c, _ in effects]).T
        covariance = (table * np.array([u**2 for *_, u in effects])) @ table.T
        covariance[np.arange(a.size), np.arange(a.size)] += sigma**2
        target, regressor = np.array([*a, 0.0, 0.0]), np.array([*f, 0.0, 0.0])
        if camera is None:
            covariance, target, regressor = covariance[:-2, :-2], target[:-2], regressor[:-2]
        else:
            target[-2:] = camera.gain - 1.0, camera.bias_m_s2
            own = camera.correlation * camera.u_gain * camera.u_bias_m_s2
            covariance[-2:, -2:] += [[camera.u_gain**2 + camera.u_rel**2, own], [own, camera.u_bias_m_s2**2]]
        weights = np.linalg.solve(covariance, regressor)
        k = float(weights @ target / (weights @ regressor))
    return 1.0 / k, float(1.0 / k**2 / math.sqrt(weights @ regressor))


@pytest.mark.parametrize("camera", [None, CAMERA, replace(CAMERA, gain=1.002, bias_m_s2=0.4)])
@pytest.mark.parametrize(
    "errors", [{}, {"gauges": (0.002, -0.001, 0.003), "friction_n": 60.0, "acceleration": -0.002, "bias_m_s2": 0.1}]
)
def test_it_is_generalized_least_squares_with_the_calibrations_in_the_covariance(camera, errors):
    found = calibrated_mass(measured(**errors, noise=alternating(1.0)), SCALES, U_BIAS, camera).estimate
    mass, u = generalized_least_squares(measured(**errors, noise=alternating(1.0)), SCALES, U_BIAS, camera, 1.0)
    # the dense covariance is linear in errors that the estimator takes exactly: products of errors are left
    assert found.mass_kg == pytest.approx(mass, abs=0.01 * u)
    assert found.u_kg == pytest.approx(u, rel=2e-3)


def test_cameras_gain_and_constant_count_as_the_correlated_pair_that_they_are():
    regression = measured(noise=alternating(1.0))
    by_correlation = []
    for correlation in (-0.95, 0.0, 0.95):
        camera = replace(CAMERA, gain=1.001, bias_m_s2=-0.5, correlation=correlation, u_rel=0.0)
        found = calibrated_mass(regression, SCALES, math.inf, camera).estimate
        mass, u = generalized_least_squares(regression, SCALES, 1e6, camera, 1.0)
        assert found.mass_kg == pytest.approx(mass, abs=0.02 * u)
        assert found.u_kg == pytest.approx(u, rel=5e-3)
        by_correlation.append(found.mass_kg)
    assert np.ptp(by_correlation) > 0.05  # it matters


def test_with_nothing_left_free_it_is_the_reverse_estimate():
    regression = measured(noise=np.random.default_rng(3).normal(0.0, 2.0, alternating(1.0).size))
    regression, nothing = replace(regression, u_release_n_s=0.0), ScaleUncertainty(0.0, (0.0, 0.0, 0.0), 0.0)
    reverse = reverse_mass(regression, nothing)
    found = calibrated_mass(regression, nothing, 0.0, None, reverse.residual_m_s2)
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
        apart.append(abs(calibrated_mass(regression, scales, share * U_BIAS, None, 5.0).estimate.mass_kg - reverse))
    assert apart[0] > 5 * apart[1] > 25 * apart[2]


def test_large_errors_are_taken_exactly_not_to_first_order():
    errors = {"gauges": (0.04, -0.03, 0.02), "friction_n": 300.0, "acceleration": 0.03, "bias_m_s2": 2.0}
    # the friction and the scales relative to one another are free, the accelerometer is known by the camera
    wide = ScaleUncertainty(0.5, (0.5, 0.5, 0.5), 1e4)
    camera = Camera(1.0 / 1.03, 1e-6, -2.0 / 1.03, 1e-5, 0.0, 1e-6)
    tight = replace(wide, gauges=(1e-7, 0.5, 0.5))
    found = calibrated_mass(measured(**errors | {"gauges": (0.0, -0.03, 0.02)}), tight, math.inf, camera)
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
    masses = []
    for e in (high, low):
        da, b = e.get("acceleration", 0.0), e.get("bias_m_s2", 0.0)
        camera = replace(CAMERA, gain=1.0 / (1.0 + da), bias_m_s2=-b)
        masses.append(calibrated_mass(measured(**e, noise=noise), SCALES, U_BIAS, camera).estimate.mass_kg)
    size = float(np.max(np.abs(np.hstack(list(errors.values())))))
    budget = {r.source: r for r in calibrated_mass(measured(noise=noise), SCALES, U_BIAS, CAMERA).estimate.budget}
    assert budget[source].sensitivity == pytest.approx((masses[0] - masses[1]) / (2 * size), rel=0.02, abs=0.05)
    units = {FRICTION: "N", ZERO: "m/s^2"}
    assert budget[source].sensitivity_per == units.get(source, "1")


@pytest.mark.parametrize(("source", "key", "size"), [(CAMERA_GAIN, "gain", 1e-4), (CAMERA_ZERO, "bias_m_s2", 0.01)])
def test_a_cameras_sensitivity_is_what_the_mass_does_when_the_camera_reads_high(source, key, size):
    uncorrelated = replace(CAMERA, correlation=0.0)
    masses = [
        calibrated_mass(
            measured(noise=alternating(1.0)), SCALES, U_BIAS,
            replace(uncorrelated, **{key: getattr(uncorrelated, key) + sign * size}),
        ).estimate.mass_kg
        for sign in (1, -1)
    ]  # fmt: skip
    found = calibrated_mass(measured(noise=alternating(1.0)), SCALES, U_BIAS, uncorrelated).estimate.budget
    budget = {r.source: r for r in found}
    assert budget[source].sensitivity == pytest.approx((masses[0] - masses[1]) / (2 * size), rel=0.02)


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
        if with_camera:
            own = rng.multivariate_normal(
                [0, 0],
                [[CAMERA.u_gain**2, CAMERA.correlation * CAMERA.u_gain * CAMERA.u_bias_m_s2],
                 [CAMERA.correlation * CAMERA.u_gain * CAMERA.u_bias_m_s2, CAMERA.u_bias_m_s2**2]],
            )  # fmt: skip
            gain = (1.0 + rng.normal(0.0, CAMERA.u_rel)) / (1.0 + acceleration) + own[0]
            camera = replace(CAMERA, gain=gain, bias_m_s2=-gain * bias + own[1])
        found = calibrated_mass(
            measured(gauges=gauges, friction_n=friction, acceleration=acceleration, bias_m_s2=bias,
                     release_m_s=release, noise=rng.normal(0.0, sigma, size)),
            SCALES, U_BIAS, camera, sigma,
        )  # fmt: skip
        low, high = found.estimate.interval_kg
        inside += low <= MASS_KG <= high
        z.append((found.estimate.mass_kg - MASS_KG) / found.estimate.u_kg)
        normalised_residuals.append(
            list({k: v for k, v in found.normalised_residuals.items() if with_camera or k != ACCELERATION}.values())
        )
    assert 0.92 <= inside / draws <= 0.98
    assert abs(np.mean(z)) < 4 / math.sqrt(draws)
    # what a sensor's departure is measured by has a standard deviation of one, and is nothing where without
    # the camera the accelerometer's scale and the mass cannot be told apart
    assert with_camera or found.normalised_residuals[ACCELERATION] == 0.0
    np.testing.assert_allclose(np.std(normalised_residuals, axis=0), 1.0, atol=0.15)


def test_what_the_stop_gives_at_the_release_is_found_and_taken_off():
    given = 0.5 * exact().u_release_n_s / MASS_KG
    with_stop, without = (measured(release_m_s=v, noise=alternating(0.2)) for v in (given, 0.0))
    found = calibrated_mass(with_stop, SCALES, U_BIAS, CAMERA, 0.2)
    assert given > 1e-3
    assert found.release_m_s == pytest.approx(given, rel=0.2)
    assert found.estimate.mass_kg == pytest.approx(
        calibrated_mass(without, SCALES, U_BIAS, CAMERA, 0.2).estimate.mass_kg, abs=0.02
    )
    a, _ = found.correct(with_stop)
    at_release = exact().release_per_s > 0.5 * exact().release_per_s.max()
    off = np.abs(with_stop.acceleration_m_s2 - exact().acceleration_m_s2)[at_release]
    assert np.abs(a - exact().acceleration_m_s2)[at_release].max() < 0.6 * off.min()


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


def test_a_sensor_beyond_its_uncertainty_stands_out():
    found = calibrated_mass(measured(gauges=(0.06, 0.0, 0.0), noise=alternating(1.0)), SCALES, U_BIAS, CAMERA)
    assert max(found.normalised_residuals, key=lambda s: abs(found.normalised_residuals[s])) == GAUGES[0]
    assert found.normalised_residuals[GAUGES[0]] > 5
    assert 0 < found.pulls[GAUGES[0]] < found.normalised_residuals[GAUGES[0]]


def test_a_misfit_is_not_taken_for_noise():
    regression = measured(gauges=(0.8, 0.0, 0.0), noise=alternating(1.0))
    found = calibration.calibrated_mass(regression, SCALES, U_BIAS, None)
    assert max(abs(w) for w in found.normalised_residuals.values()) > 10
    assert found.noise.sigma_m_s2 == pytest.approx(1.0, rel=0.15)


def test_without_a_silence_the_zero_is_found_from_the_shot_itself():
    found = calibrated_mass(measured(bias_m_s2=4.0, noise=alternating(1.0)), SCALES, math.inf, None)
    assert found.bias_m_s2 == pytest.approx(4.0, abs=2.0)
    assert ZERO not in found.pulls
    biased = calibrated_mass(measured(bias_m_s2=4.0, noise=alternating(1.0)), SCALES, 1e-3, None)
    assert abs(found.estimate.mass_kg - MASS_KG) < abs(biased.estimate.mass_kg - MASS_KG) + found.estimate.u_kg


# ------------------------------------------------------------------------------------------ areas and standards


def with_parts(**parts: tuple[tuple[str, float], ...]) -> ScaleUncertainty:
    return replace(SCALES, parts=parts)


def by_source(found: Calibration) -> dict[str, float]:
    return {row.source: row.u_kg for row in found.estimate.budget}


def test_an_area_has_a_row_of_its_own_and_moves_nothing():
    regression = measured(noise=alternating(1.0))
    whole, apart = (
        calibrated_mass(regression, scales, U_BIAS, CAMERA)
        for scales in (SCALES, with_parts(breech_pressure=(("bore_area", 0.004),)))
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
    standard = (("standard dead weight", 0.003),)
    roles = ("breech_pressure", "brake_pressure", "recuperator_pressure")
    shared = calibrated_mass(regression, with_parts(**dict.fromkeys(roles, standard)), U_BIAS, CAMERA)
    alone = calibrated_mass(regression, SCALES, U_BIAS, CAMERA)
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
    camera, scale = CAMERA(), SCALES.acceleration
    own = (
        np.array([[-1.0 / camera.gain, 0.0], [0.0, 1.0]]) @ camera.covariance @ [[-1.0 / camera.gain, 0.0], [0.0, 1.0]]
    )
    known[5, 5] += scale**-2
    known[np.ix_([5, 6], [5, 6])] += np.linalg.inv(own + np.diag([camera.u_rel**2, 0.0]))
    kept = [0, 1, 2, 3, 4, 5, 6] + ([7] if np.any(columns[:, 7]) else [])
    if 7 in kept:
        known[7, 7] = (alone.m0_kg / regression.u_release_n_s) ** 2
    covariance = np.linalg.inv((columns.T @ columns + known)[np.ix_(kept, kept)])
    assert shared.inferred.u("ln mass") == pytest.approx(math.sqrt(covariance[0, 0]), rel=5e-3)


def test_a_standard_that_is_all_of_a_certificate_leaves_the_sensor_nothing_of_its_own():
    parts = dict.fromkeys(("breech_pressure", "brake_pressure"), (("standard s", 0.004),))
    found = calibrated_mass(measured(noise=alternating(1.0)), with_parts(**parts), U_BIAS, CAMERA)
    assert by_source(found)[GAUGES[1]] == pytest.approx(0.0, abs=1e-3)
    assert found.inferred.converged
