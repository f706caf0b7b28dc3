"""The mechanism with a flexible tube: assumed modes of a cantilever that is clamped to the recoiling part.

The tube lies along e5 from its clamp, ``root_m`` ahead of the recoiling part's centre of mass and ``offset_m`` above
it, and bends in the plane of motion by ``w(s, t) = sum phi_i(s) q_i(t)`` along e6, phi_i being the eigenfunctions of
`recoil_rigs.mechanism.beam`. A tube that bends becomes no longer: a place draws back by ``u = int_0^s w'^2 / 2`` (T. R.
Kane, R. R. Ryan, A. K. Banerjee, J. Guidance 10(2), 1987; without it the recoil would not stiffen the tube, which it
drags).
The tube is a part of the recoiling part: m3, b, d and J3c are those of both together, unbent.

With the velocity (v5, v6) of the centre of mass of the unbent part in tipping axes, its angular rate w2, the place
(x, offset) of a mass element and q' the modal rates, the kinetic energy that bending adds is, to second order,

    dT = int [-v5 w2 w + w2^2 offset w + (w2^2 w^2 + w'^2)/2 + w' (v6 + w2 x)
              - (v5 - w2 offset) u' - w2 (v6 + w2 x) u] dm,          w' = dw/dt, u' = du/dt.

Lagrange's equations in these rates (Boltzmann and Hamel) give the inertial forces of bending, where a5, a6 are the
accelerations of that centre of mass with gravity, ``a5 = -a'`` of equation (36), and S, H, G, K the integrals of
`recoil_rigs.mechanism.beam.BeamIntegrals`:

    f5 = -S q w2' - q G q'' - 2 w2 S q' - q' G q' + w2^2 q G q / 2
    f6 =  S q'' - w2' q G q / 2 - w2^2 S q - 2 w2 q G q'
    fw =  (-S q) a5 - (q G q / 2) a6 + [2 offset S q + q (m - K) q] w2' + (H + offset G q) q''
          + 2 w2 [offset S q' + q (m - K) q'] + offset q' G q'
    fq =  S a6 - G q a5 + (H + offset G q) w2' + m q'' - w2^2 [offset S + (m - K) q] + k q + c q'

so that of the identification equation becomes ``m3 a' = P - R_f + f5``: along the bore only terms enter that are
products of bending with a rotation or with bending. Arrays as in `recoil_rigs.mechanism.model`, states of 5 + n
coordinates.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_rigs.mechanism import model as rigid
from recoil_rigs.mechanism.beam import integrals, natural_frequencies
from recoil_rigs.mechanism.mechanism_parameters import Mechanism


@dataclass(frozen=True, eq=False)
class FlexibleTube(ReadOnlyArrays):
    """A tube in modal coordinates.

    Attributes
    ----------
    mass_kg
        Mass of the tube; also the modal mass, because the mean square of each eigenfunction is one.
    offset_m
        Height of the tube's axis above the recoiling part's centre of mass.
    first, moment, shortening, shortening_moment
        S, H, G, K, see `recoil_rigs.mechanism.beam.BeamIntegrals`.
    stiffness_n_m, damping_n_s_m : ndarray, shape (n,)
        Stiffness and damping of each mode.
    """

    mass_kg: float
    offset_m: float
    first: Array
    moment: Array
    shortening: Array
    shortening_moment: Array
    stiffness_n_m: Array
    damping_n_s_m: Array

    @property
    def modes(self) -> int:
        """Number of modes."""
        return int(self.first.size)


def uniform_tube(
    length_m: float,
    mass_kg: float,
    bending_stiffness_n_m2: float,
    modes: int,
    damping: float = 0.0,
    root_m: float = 0.0,
    offset_m: float = 0.0,
) -> FlexibleTube:
    """Return a uniform tube by its first eigenfunctions.

    Parameters
    ----------
    damping
        Ratio of each mode's damping to its critical one.
    root_m, offset_m
        Place of the clamp from the recoiling part's centre of mass, along e5 and e6.

    Raises
    ------
    ValueError
        If length, mass or stiffness is not positive, or there are more modes than `beam.LARGEST_MODES`.
    """
    if not (length_m > 0 and mass_kg > 0 and bending_stiffness_n_m2 > 0 and damping >= 0):
        raise ValueError("length, mass and bending stiffness must be positive, the damping not negative")
    found = integrals(length_m, mass_kg, root_m, modes)
    frequencies = natural_frequencies(length_m, mass_kg, bending_stiffness_n_m2, modes)
    return FlexibleTube(
        mass_kg,
        offset_m,
        found.first,
        found.moment,
        found.shortening,
        found.shortening_moment,
        mass_kg * frequencies**2,
        2 * damping * mass_kg * frequencies,
    )


class _State(NamedTuple):
    """A state in tipping axes, with what bending makes of it; each (...) or (..., n)."""

    q: Array
    rate: Array
    jacobian: Array  # (..., 3, 5): of v5, v6 and w2 by the rigid rates
    s_q: Array
    g_q: Array
    half_qgq: Array
    rest_q: Array  # (m - K) q
    c2: Array
    s2: Array


def _state(mechanism: Mechanism, tube: FlexibleTube, q: Array, qd: Array) -> _State:
    m, modal = mechanism, q[..., 5:]
    angle = m.phi20 - m.phi10 + q[..., 3]
    phi2 = m.phi20 + q[..., 2] + q[..., 3]
    c2, s2 = np.cos(phi2), np.sin(phi2)
    A5 = m.XA * np.cos(angle) + m.YA * np.sin(angle)
    A6 = m.YA * np.cos(angle) - m.XA * np.sin(angle)
    lever, zero, one = m.b - q[..., 4], np.zeros_like(c2), np.ones_like(c2)
    rows = [
        np.stack([c2, s2, -(A6 + m.d), -m.d * one, -one], axis=-1),
        np.stack([-s2, c2, A5 + lever, lever, zero], axis=-1),
        np.stack([zero, zero, one, one, zero], axis=-1),
    ]
    g_q = modal @ tube.shortening
    rest_q = tube.mass_kg * modal - modal @ tube.shortening_moment
    return _State(
        modal, qd[..., 5:], np.stack(rows, axis=-2), modal @ tube.first, g_q, 0.5 * (modal * g_q).sum(axis=-1), rest_q,
        c2, s2,
    )  # fmt: skip


def mass_matrix(mechanism: Mechanism, tube: FlexibleTube, q: ArrayLike) -> Array:
    """Return the mass matrix, shape (..., 5 + n, 5 + n): symmetric, and positive definite for small bending.

    Parameters
    ----------
    q : array_like, shape (..., 5 + n)
        ``[xi, eta, alpha, beta, x, q_1, ..., q_n]``, m and rad.
    """
    place = np.asarray(q, dtype=np.float64)
    n = tube.modes
    at = _state(mechanism, tube, place, np.zeros_like(place))
    D = np.zeros((*place.shape[:-1], 3 + n, 3 + n))
    D[..., 0, 2] = D[..., 2, 0] = -at.s_q
    D[..., 1, 2] = D[..., 2, 1] = -at.half_qgq
    D[..., 2, 2] = 2 * tube.offset_m * at.s_q + (at.q * at.rest_q).sum(axis=-1)
    D[..., 0, 3:] = D[..., 3:, 0] = -at.g_q
    D[..., 1, 3:] = D[..., 3:, 1] = tube.first
    D[..., 2, 3:] = D[..., 3:, 2] = tube.moment + tube.offset_m * at.g_q
    D[..., 3:, 3:] = tube.mass_kg * np.eye(n)
    B = np.zeros((*place.shape[:-1], 3 + n, 5 + n))
    B[..., :3, :5] = at.jacobian
    B[..., 3:, 5:] = np.eye(n)
    M = np.swapaxes(B, -1, -2) @ D @ B
    M = 0.5 * (M + np.swapaxes(M, -1, -2))
    M[..., :5, :5] += rigid.mass_matrix(mechanism, place[..., :5])
    return np.asarray(M, dtype=np.float64)


def velocity_terms(mechanism: Mechanism, tube: FlexibleTube, q: ArrayLike, qd: ArrayLike) -> Array:
    """Return h: centrifugal, Coriolis, gravity, elastic and damping terms, shape (..., 5 + n).

    Parameters
    ----------
    q, qd : array_like, shape (..., 5 + n)
    """
    place, rate = np.asarray(q, dtype=np.float64), np.asarray(qd, dtype=np.float64)
    m, at = mechanism, _state(mechanism, tube, place, rate)
    w1, w2 = rate[..., 2], rate[..., 2] + rate[..., 3]
    B = at.jacobian
    # accelerations of the unbent centre of mass where no coordinate accelerates, with gravity
    lever = B[..., 1, 3]
    a5 = -(w1**2) * (B[..., 1, 2] - lever) - w2**2 * lever + m.g * at.s2
    a6 = w1**2 * (B[..., 0, 2] + m.d) - w2**2 * m.d - 2 * w2 * rate[..., 4] + m.g * at.c2
    s_rate, g_rate = at.rate @ tube.first, at.rate @ tube.shortening
    rate_g_rate, q_g_rate = (at.rate * g_rate).sum(axis=-1), (at.q * g_rate).sum(axis=-1)
    f5 = -2 * w2 * s_rate - rate_g_rate + w2**2 * at.half_qgq
    f6 = -(w2**2) * at.s_q - 2 * w2 * q_g_rate
    fw = -a5 * at.s_q - a6 * at.half_qgq + tube.offset_m * rate_g_rate
    fw = fw + 2 * w2 * (tube.offset_m * s_rate + (at.rest_q * at.rate).sum(axis=-1))
    fq = (
        a6[..., None] * tube.first
        - a5[..., None] * at.g_q
        - w2[..., None] ** 2 * (tube.offset_m * tube.first + at.rest_q)
    )
    fq = fq + tube.stiffness_n_m * at.q + tube.damping_n_s_m * at.rate
    bending = np.einsum("...ij,...i->...j", B, np.stack([f5, f6, fw], axis=-1))
    h = np.concatenate([rigid.velocity_terms(m, place[..., :5], rate[..., :5]) + bending, fq], axis=-1)
    return np.asarray(h, dtype=np.float64)


def accelerations(mechanism: Mechanism, tube: FlexibleTube, q: ArrayLike, qd: ArrayLike, Q: ArrayLike) -> Array:
    """Solve the equations of motion, shape (..., 5 + n).

    Parameters
    ----------
    q, qd : array_like, shape (..., 5 + n)
    Q : array_like, shape (..., 5) or (..., 5 + n)
        Generalized forces; of the loads of `recoil_rigs.mechanism.model.generalized_forces` none acts on the tube.
    """
    forces = np.asarray(Q, dtype=np.float64)
    if forces.shape[-1] == 5:
        forces = np.concatenate([forces, np.zeros((*forces.shape[:-1], tube.modes))], axis=-1)
    right = forces - velocity_terms(mechanism, tube, q, qd)
    solved = np.linalg.solve(mass_matrix(mechanism, tube, q), right[..., np.newaxis])[..., 0]
    return np.asarray(solved, dtype=np.float64)


def kinetic_energy(mechanism: Mechanism, tube: FlexibleTube, q: ArrayLike, qd: ArrayLike) -> Array:
    """Return the kinetic energy, J, shape (...); q and qd as in `velocity_terms`."""
    rate = np.asarray(qd, dtype=np.float64)
    M = mass_matrix(mechanism, tube, q)
    return np.asarray(0.5 * np.einsum("...i,...ij,...j->...", rate, M, rate), dtype=np.float64)


def potential_energy(mechanism: Mechanism, tube: FlexibleTube, q: ArrayLike) -> Array:
    """Return the energy of weights and bending, J, shape (...); q as in `mass_matrix`."""
    place = np.asarray(q, dtype=np.float64)
    at = _state(mechanism, tube, place, np.zeros_like(place))
    weight = mechanism.g * (at.s_q * at.c2 - at.half_qgq * at.s2)
    elastic = 0.5 * (tube.stiffness_n_m * at.q**2).sum(axis=-1)
    return np.asarray(rigid.potential_energy(mechanism, place[..., :5]) + weight + elastic, dtype=np.float64)


def sag(mechanism: Mechanism, tube: FlexibleTube) -> tuple[Array, float]:
    """Return how the tube hangs at rest in battery.

    Returns
    -------
    q : ndarray, shape (n,)
        Modal coordinates, m.
    moment : float
        Moment that the sag adds to that of the weights about the trunnion, positive if it lowers the muzzle, N m.
    """
    c2, s2 = np.cos(mechanism.phi20), np.sin(mechanism.phi20)
    stiffness = np.diag(tube.stiffness_n_m) - mechanism.g * s2 * tube.shortening
    hangs = np.linalg.solve(stiffness, -mechanism.g * c2 * tube.first)
    bent = 0.5 * hangs @ tube.shortening @ hangs
    return hangs, float(-mechanism.g * (s2 * (tube.first @ hangs) + c2 * bent))
