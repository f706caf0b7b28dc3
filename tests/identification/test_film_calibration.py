from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from recoil_identification.film_calibration import FilmCalibration
from recoil_identification.mass import MassEstimate
from recoil_processing.shot.regression import Regression
from tests.builders.bench_shots import MASS_KG, bench_regression

GAUGES = np.array([0.01, -0.02, 0.03])
FRICTION_N = 200.0


def calibration(covariance: np.ndarray | None = None, u_camera: float = 0.0) -> FilmCalibration:
    estimate = MassEstimate("camera", MASS_KG, (), 100, 1.0)
    covariance = np.zeros((4, 4)) if covariance is None else covariance
    return FilmCalibration(estimate, GAUGES, FRICTION_N, 0.0, covariance, u_camera, {}, {})


def misread(r: Regression) -> Regression:
    """Let the gauges read high by their errors, and the friction be declared too large."""
    forces = r.forces_n * [*(1.0 + GAUGES), 1.0]
    forces[:, 3] += FRICTION_N * r.friction_direction
    return replace(r, forces_n=forces)


def test_what_the_gauges_read_wrongly_is_taken_off():
    true = bench_regression()
    _, force = calibration().correct(misread(true))
    assert np.allclose(force[true.used], true.force_n[true.used], rtol=1e-12, atol=1e-6)


def test_errors_that_are_left_add_up_to_their_covariance():
    r, rng = bench_regression(), np.random.default_rng(1)
    root = rng.normal(size=(4, 4)) * [[1e-3], [1e-3], [1e-3], [50.0]]
    found = calibration(root @ root.T).errors_left(r)
    columns = np.column_stack([r.forces_n[:, :3], r.friction_direction]) / MASS_KG
    k = int(np.argmax(np.abs(r.force_n)))
    assert found[k] @ found[k] == pytest.approx(columns[k] @ (root @ root.T) @ columns[k])


def test_the_cameras_scale_is_one_of_them():
    r = bench_regression()
    found = calibration(u_camera=0.002).errors_left(r)
    assert np.allclose(found[:, -1], 0.002 * r.force_n / MASS_KG)
    assert not np.any(found[:, :-1])
