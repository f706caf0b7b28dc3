"""Natural frequencies and damping ratios that stiffness and damping of the supports give the mechanism.

The tipping part swings on the elevating gear with its inertia about the trunnion, the recoiling part in battery;
the carriage with everything on it swings on the ground in three modes. The friction of the ground and the
weights' own small stiffness are left out.
"""

from __future__ import annotations

import math

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_rigs.mechanism.model import Mechanism, mass_matrix


def tipping_mode(mechanism: Mechanism, stiffness_n_m_rad: float, damping_n_m_s_rad: float) -> tuple[float, float]:
    """Return natural frequency, Hz, and damping ratio of the tipping part on the elevating gear, carriage at rest.

    ``w = sqrt(k / J)``, ``zeta = c / (2 sqrt(k J))``; NaN for a stiffness that is not positive.
    """
    inertia = float(mass_matrix(mechanism, np.zeros(5))[3, 3])
    if not stiffness_n_m_rad > 0:
        return math.nan, math.nan
    root = math.sqrt(stiffness_n_m_rad * inertia)
    return math.sqrt(stiffness_n_m_rad / inertia) / (2 * math.pi), damping_n_m_s_rad / (2 * root)


def ground_modes(mechanism: Mechanism, stiffness_n_m: Array, damping_n_s_m: Array) -> Array:
    """Return natural frequencies, Hz, and damping ratios of the carriage on the ground.

    Parameters
    ----------
    stiffness_n_m, damping_n_s_m : ndarray, shape (3,)
        Along at C, vertical at C, vertical at D.

    Returns
    -------
    ndarray, shape (3, 2)
        One row per mode, ascending; NaN where a mode does not oscillate. Eigenvalues of
        ``M q'' + C q' + K q = 0`` in [xi, eta, alpha] with the other parts held in battery.
    """
    M = mass_matrix(mechanism, np.zeros(5))[:3, :3]
    arm = mechanism.L * math.cos(mechanism.phi10)
    feet = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 1.0, arm]])
    modes = np.full((3, 2), np.nan)
    if not (np.isfinite(stiffness_n_m).all() and np.isfinite(damping_n_s_m).all()):
        return modes
    K, C = feet.T @ np.diag(stiffness_n_m) @ feet, feet.T @ np.diag(damping_n_s_m) @ feet
    state = np.block([[np.zeros((3, 3)), np.eye(3)], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]])
    roots = np.linalg.eigvals(state)
    swinging = sorted((root for root in roots if root.imag > 1e-9 * abs(root)), key=abs)
    for row, root in enumerate(swinging[:3]):
        modes[row] = abs(root) / (2 * math.pi), -root.real / abs(root)
    return modes


def derived_values(mechanism: Mechanism, values: Array) -> Array:
    """Return all derived quantities of the parameters in the order of `DERIVED`; shape (10,).

    Parameters
    ----------
    values : ndarray, shape (9,)
        Parameters in the order of `recoil_identification.targets.stiffness.stiffness_budget.SYMBOLS`.
    """
    k_e, c_e, k_x, c_x, _, k_c, c_c, k_d, c_d = (float(v) for v in values)
    modes = ground_modes(mechanism, np.array([k_x, k_c, k_d]), np.array([c_x, c_c, c_d]))
    return np.array([*tipping_mode(mechanism, k_e, c_e), *modes.ravel(), k_c + k_d, c_c + c_d])


DERIVED = (
    ("f_elevating", "natural frequency of the tipping part on the elevating gear", "Hz"),
    ("zeta_elevating", "damping ratio of the tipping part on the elevating gear", "1"),
    ("f_ground_1", "first natural frequency of the carriage on the ground", "Hz"),
    ("zeta_ground_1", "its damping ratio", "1"),
    ("f_ground_2", "second natural frequency of the carriage on the ground", "Hz"),
    ("zeta_ground_2", "its damping ratio", "1"),
    ("f_ground_3", "third natural frequency of the carriage on the ground", "Hz"),
    ("zeta_ground_3", "its damping ratio", "1"),
    ("k_ground_vertical", "vertical stiffness of both feet together", "N/m"),
    ("c_ground_vertical", "vertical damping of both feet together", "N s/m"),
)
"""Symbol, name and unit of what follows from the parameters."""
OF_BOTH_FEET = ("k_ground_vertical", "c_ground_vertical")
"""Symbols of those that are sums."""


def derived_with_u(mechanism: Mechanism, values: Array, covariance: Array) -> tuple[Array, Array]:
    """Return the derived quantities and their standard uncertainties, correlations included; shape (10,) each.

    Sensitivities by central differences of half a standard uncertainty to either side.
    """
    derived = derived_values(mechanism, values)
    steps = 0.5 * np.sqrt(np.diag(covariance))
    columns = []
    for i, step in enumerate(steps):
        if not step > 0:
            columns.append(np.zeros(derived.size))
            continue
        ahead, behind = values.copy(), values.copy()
        ahead[i] += step
        behind[i] -= step
        columns.append((derived_values(mechanism, ahead) - derived_values(mechanism, behind)) / (2 * step))
    slopes = np.column_stack(columns)
    # a derived quantity does not hang on a parameter that could not be identified unless it is NaN itself
    slopes, known = np.where(np.isfinite(slopes), slopes, 0.0), np.where(np.isfinite(covariance), covariance, 0.0)
    u = np.sqrt(np.einsum("ij,jk,ik->i", slopes, known, slopes))
    return derived, np.where(np.isfinite(derived), u, np.nan)
