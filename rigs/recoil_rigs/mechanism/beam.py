"""The clamped-free Euler-Bernoulli beam: its eigenfunctions and their integrals.

With ``phi'''' = beta^4 phi``, clamped at s = 0 and free at s = length, the eigenvalues ``z = beta length`` solve
``cos z cosh z = -1`` (S. Timoshenko, "Vibration Problems in Engineering", section on lateral vibrations of bars):
1.8751, 4.6941, 7.8548, ... The functions are normalised so that the mean of their square is one. Plain arrays, SI.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays

_NODES = 40
"""Nodes of Gauss's quadrature over the length: exact to rounding for the first few functions."""
LARGEST_MODES = 4
"""Higher ones need rotatory inertia and shear, which are not in this beam."""


def eigenvalues(count: int) -> Array:
    """Return the first eigenvalues z, shape (count,).

    Raises
    ------
    ValueError
        If the count is negative or above `LARGEST_MODES`.
    """
    if not 0 <= count <= LARGEST_MODES:
        raise ValueError(f"from 0 to {LARGEST_MODES} modes, not {count}")
    found = []
    for j in range(count):
        z = (j + 0.5) * math.pi
        for _ in range(60):
            # cos z + 1 / cosh z: of the same roots, and it does not grow
            value, slope = math.cos(z) + 1 / math.cosh(z), -math.sin(z) - math.tanh(z) / math.cosh(z)
            z, before = z - value / slope, z
            if z == before:
                break
        found.append(z)
    return np.array(found)


def shapes(length_m: float, count: int, s_m: ArrayLike) -> tuple[Array, Array]:
    """Return the eigenfunctions and their slopes.

    Parameters
    ----------
    s_m : array_like, shape (n,)
        Places from the clamp.

    Returns
    -------
    values : ndarray, shape (count, n)
    slopes : ndarray, shape (count, n)
        1/m.
    """
    place = np.asarray(s_m, dtype=np.float64) / length_m
    values, slopes = [], []
    for z in eigenvalues(count):
        share = (math.sinh(z) - math.sin(z)) / (math.cosh(z) + math.cos(z))
        u = z * place
        values.append(np.cosh(u) - np.cos(u) - share * (np.sinh(u) - np.sin(u)))
        slopes.append(z / length_m * (np.sinh(u) + np.sin(u) - share * (np.cosh(u) - np.cos(u))))
    shape = (count, place.size)
    return np.array(values).reshape(shape), np.array(slopes).reshape(shape)


def natural_frequencies(length_m: float, mass_kg: float, stiffness_n_m2: float, count: int) -> Array:
    """Return the angular natural frequencies of a uniform clamped-free beam, rad/s, shape (count,).

    ``w = z^2 sqrt(EI / (mu length^4))`` with the mass per length ``mu``.
    """
    return np.asarray(eigenvalues(count) ** 2 * math.sqrt(stiffness_n_m2 / (mass_kg * length_m**3)))


@dataclass(frozen=True, eq=False)
class BeamIntegrals(ReadOnlyArrays):
    """Integrals of a uniform beam's eigenfunctions over its mass; x is the distance of a place from an origin.

    Attributes
    ----------
    first : ndarray, shape (n,)
        Integral of phi_i, kg.
    moment : ndarray, shape (n,)
        Integral of x phi_i, kg m.
    shortening : ndarray, shape (n, n)
        Integral of ``g_ij(s) = int_0^s phi_i' phi_j'``, kg/m: a beam that bends draws each of its places towards the
        clamp by half of ``q^T g q``.
    shortening_moment : ndarray, shape (n, n)
        Integral of x g_ij, kg.
    """

    first: Array
    moment: Array
    shortening: Array
    shortening_moment: Array


def integrals(length_m: float, mass_kg: float, root_m: float, count: int) -> BeamIntegrals:
    """Integrate the eigenfunctions of a beam whose clamp lies at ``x = root_m``."""
    nodes, weights = np.polynomial.legendre.leggauss(_NODES)
    s = 0.5 * length_m * (nodes + 1)
    w = 0.5 * mass_kg * weights
    values, slopes = shapes(length_m, count, s)
    # a slope at s draws all that lies beyond it: integrating by parts leaves one integral
    beyond = length_m - s
    moment_beyond = root_m * beyond + 0.5 * (length_m**2 - s**2)
    return BeamIntegrals(
        values @ w,
        values @ (w * (root_m + s)),
        (slopes * (w * beyond)) @ slopes.T,
        (slopes * (w * moment_beyond)) @ slopes.T,
    )
