"""The mass of a shot by another program: dense least squares from the mechanism's equation alone.

Nothing of the identification is used but the filtered rows, their weight and what is known of the sensors. With
``m a' = P - R`` and ``R`` the sum of brake, recuperator and friction, the accelerometer's reading is written down
again, its derivatives are taken by complex steps (W. Squire, G. Trapp, SIAM Review 40(1), 1998), and the minimum is
found by normal equations.
"""

from __future__ import annotations

import numpy as np
import pytest

from recoil_processing.shot.regression import spaced_rows
from tests.builders.virtual_shots import identified, virtual_shot

STEP = 1e-30


def reading(x: np.ndarray, breech: np.ndarray, brake: np.ndarray, recuperator: np.ndarray, friction: np.ndarray,
            direction: np.ndarray, free: np.ndarray, let_go: np.ndarray, m0: float) -> np.ndarray:  # fmt: skip
    """Return what an accelerometer reads: its scale times P - R over the mass, and what is added to that."""
    mass, p, k, r, df, scale, zero, velocity = x
    force = breech * np.exp(-p) + brake * np.exp(-k) + recuperator * np.exp(-r) + friction - df * direction
    return np.exp(scale) * force / (m0 * np.exp(mass)) + zero * free + velocity * let_go


def second_opinion(
    series: tuple[np.ndarray, ...],
    seen: np.ndarray,
    m0: float,
    sigma: float,
    known: list[tuple[np.ndarray, np.ndarray, np.ndarray]],
) -> tuple[float, float]:
    """Return the mass and its standard uncertainty; known are rows, values and covariances of what is known."""
    x = np.zeros(8)
    for _ in range(30):
        model = reading(x, *series, m0)
        slopes = np.column_stack([reading(x + 1j * STEP * np.eye(8)[i], *series, m0).imag / STEP for i in range(8)])
        normal, right = slopes.T @ slopes / sigma**2, slopes.T @ (seen - model) / sigma**2
        for rows, values, covariance in known:
            weight = np.linalg.inv(covariance)
            normal += rows.T @ weight @ rows
            right += rows.T @ weight @ (values - rows @ x)
        x = x + np.linalg.solve(normal, right)
    mass = m0 * np.exp(x[0])
    return mass, mass * np.sqrt(np.linalg.inv(normal)[0, 0])


@pytest.mark.parametrize("name", ["field-2013", "mixed"])
def test_a_program_that_shares_nothing_finds_the_same_mass_and_uncertainty(name: str) -> None:
    found, shot = identified(name), virtual_shot(name)
    rows, rig = found.fitted, shot.rig
    at = spaced_rows(rows)
    series = (
        *(rows.forces_n[at, j] for j in range(4)),
        rows.friction_direction[at],
        rows.released[at],
        rows.release_per_s[at],
    )
    m0 = found.calibration.m0_kg
    # what is known of each sensor by the rig file, which takes the areas for exact: gauges, friction, accelerometer
    roles = ("breech_pressure", "brake_pressure", "recuperator_pressure", "recoil_acceleration")
    *gauges, accelerometer = (next(c.sensor.u_rel for c in rig.channels if c.role == role) for role in roles)
    u = [*gauges, rig.mechanism.u["friction"], accelerometer]
    u += [found.signals.offsets["recoil_acceleration"].u, rows.u_release_n_s / m0]
    known = [(np.eye(8)[[1 + i]], np.zeros(1), np.array([[one**2]])) for i, one in enumerate(u)]
    # the camera: gain, and the constant that the accelerometer lacks, in the camera's scale
    d = found.alignments["camera"].details
    gain, u_camera = d["gain"], shot.shot.by_role("recoil_displacement").u_rel
    zero = -d["integration_constants"][2] / gain
    change = np.array([[-1.0 / gain, 0.0], [-zero / gain, -1.0 / gain]])
    shared = d["gain_bias_correlation"] * d["u_gain"] * d["u_bias_m_s2"]
    own = change @ np.array([[d["u_gain"] ** 2, shared], [shared, d["u_bias_m_s2"] ** 2]]) @ change.T
    known.append((np.eye(8)[[5, 6]], np.array([-np.log(gain), zero]), own + np.diag([u_camera**2, 0.0])))
    mass, uncertainty = second_opinion(series, rows.acceleration_m_s2[at], m0, found.calibration.noise_m_s2, known)
    assert mass == pytest.approx(found.calibration.estimate.mass_kg, rel=1e-6)
    assert uncertainty == pytest.approx(found.calibration.estimate.u_kg, rel=2e-6)
