"""The equation of motion (36) with its sensors' errors, as rows of an inference.

The accelerometer reads ``a = e^al a' + b`` while the part is free, gauge j reads ``F_j = e^g_j F_j,true``, and the
friction is declared by ``df`` too large, so that with the mass ``m = m0 e^mu``

    a = e^(al - mu) [sum_j F_j e^-g_j + R - df s] / m0 + b + v d + S z + noise

with the friction's direction s. While the part is let go, battery stop and packing push it on with what no gauge
reads: an impulse d at the release that gives it the velocity v. The columns of S are shapes in which the
accelerometer's zero may have shifted at the shot; what else may be wrong (`recoil_identification.rows.causes`) adds to
the readings F_j, and to that of the accelerometer, shapes of unknown size. The logarithm of the mass is mu throughout,
unless shapes are given in which it changes while the part moves.

Logarithms are taken because the rows do not change under a common factor of mass and forces, nor under one of mass
and acceleration: in logarithms these directions are the same everywhere.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_identification.inference.unknown import Unknown
from recoil_identification.rows.causes import Cause
from recoil_processing.shot.error_source import ErrorSource, SourceKind
from recoil_processing.shot.regression import Regression

LARGEST_STEP = 0.3
"""Largest change of a scale in one iteration: a shot that no calibration fits would otherwise throw a scale far off."""

PIECES = 12
"""Number of pieces of the travel, in each of which a mass that changes goes from one value to the next."""

MASS = Unknown("ln mass", scope="rig", largest_step=LARGEST_STEP)
FRICTION = Unknown("friction declared too large", "N", "rig")
ZERO = Unknown("zero of recoil_acceleration", "m/s^2")
RELEASE = Unknown("velocity at the release", "m/s", "rig")
CAMERA = Unknown("ln camera", scope="sensor", largest_step=LARGEST_STEP)
"""Logarithm of the camera's scale."""


def gauge(force: str) -> Unknown:
    """Return the logarithm of the scale of a measured force, by its name."""
    return Unknown(f"ln {force}", scope="sensor", largest_step=LARGEST_STEP)


def scale_of(role: str) -> Unknown:
    """Return the logarithm of the scale of what measured the motion, by its role."""
    return Unknown(f"ln {role}", scope="sensor", largest_step=LARGEST_STEP)


ACCELERATION = scale_of("recoil_acceleration")


def shift(number: int) -> Unknown:
    """Return the size of one of the shapes, counted from 0, in which the zero may have shifted."""
    return Unknown(f"shift {number + 1} of the zero", "m/s^2")


def change(number: int) -> Unknown:
    """Return the size of one of the shapes, counted from 0, in which the mass's logarithm changes."""
    return Unknown(ErrorSource(SourceKind.MASS_CHANGE, detail=f"{number + 1}"), largest_step=LARGEST_STEP)


def ramps(times_s: Array, interval_s: tuple[float, float], count: int) -> Array:
    """Return pieces of equal length, one after the other, in which something rises from 0 to 1; shape (n, count)."""
    nodes = np.linspace(*interval_s, count + 1)
    return np.asarray(np.clip((times_s[:, np.newaxis] - nodes[:-1]) / np.diff(nodes), 0.0, 1.0))


@dataclass(frozen=True, eq=False)
class EquationOfMotion(ReadOnlyArrays):
    """Rows of a filtered regression.

    Attributes
    ----------
    regression
        Regression with the columns of all samples.
    rows : ndarray of int, shape (n_rows,)
        Rows that count.
    m0_kg
        First estimate of the mass.
    sigma_m_s2 : ndarray, shape (n_rows,)
        Standard deviation of each row's error.
    causes
        Further errors that the readings may have.
    scale
        Scale of what measured the motion.
    changes : ndarray, shape (n, n_changes), or None
        Shapes in which the mass's logarithm changes.
    """

    regression: Regression
    rows: NDArray[np.intp]
    m0_kg: float
    sigma_m_s2: Array
    causes: tuple[Cause, ...] = ()
    scale: Unknown = ACCELERATION
    changes: Array | None = None

    @cached_property
    def gauges(self) -> tuple[Unknown, ...]:
        """Scales of the measured forces, in the order of their columns."""
        return tuple(map(gauge, self.regression.gauges))

    @cached_property
    def all_unknowns(self) -> tuple[Unknown, ...]:
        """Mass, gauges, friction, the motion's scale and zero, release, shifts, causes, and changes of the mass."""
        shifts = () if self.regression.shifts is None else range(self.regression.shifts.shape[1])
        changes = () if self.changes is None else range(self.changes.shape[1])
        return (
            *(MASS, *self.gauges, FRICTION, self.scale, ZERO, RELEASE),
            *(shift(i) for i in shifts),
            *(one.unknown for one in self.causes),
            *(change(i) for i in changes),
        )

    @property
    def unknowns(self) -> tuple[str, ...]:
        """Their names."""
        return tuple(unknown.name for unknown in self.all_unknowns)

    @cached_property
    def _added(self) -> Array:
        """Amounts that a size of one of each shape adds to the readings of the acceleration, shape (n_rows, n)."""
        r, at = self.regression, self.rows
        shifts = np.zeros((at.size, 0)) if r.shifts is None else r.shifts[at]
        causes = (one.acceleration_m_s2[at] for one in self.causes)
        return np.column_stack([r.released[at], r.release_per_s[at], shifts, *causes])

    @cached_property
    def _wrong_n(self) -> Array:
        """Amounts that a size of one of each cause makes the forces read too little, (n_rows, n_causes, n_gauges)."""
        none = np.zeros((self.rows.size, len(self.gauges)))
        return np.stack([none, *(one.forces_n[self.rows] for one in self.causes)], axis=1)[:, 1:]

    @cached_property
    def _beside_n(self) -> Array | None:
        """Amounts by which causes of size one act beside the measured forces, (n_rows, n_causes); None if none do."""
        if all(one.beside_n is None for one in self.causes):
            return None
        none = np.zeros(self.rows.size)
        each = (none if one.beside_n is None else one.beside_n[self.rows] for one in self.causes)
        return np.column_stack([*each])

    def linearised(self, values: Mapping[str, float]) -> tuple[Array, Array]:
        """Return what the equation leaves of the acceleration, and its derivatives, over the standard deviation."""
        r, at = self.regression, self.rows
        added, wrong_n = self._added, self._wrong_n
        changes = None if self.changes is None else self.changes[at]
        before = self.all_unknowns.index(ZERO)
        given = np.array([values[unknown.name] for unknown in self.all_unknowns[before:]])
        sizes, changed = given[: added.shape[1]], given[added.shape[1] :]
        first = sizes.size - len(self.causes)
        per_force = np.full(at.size, math.exp(values[self.scale.name] - values[MASS.name]) / self.m0_kg)
        scales = np.exp([-values[one.name] for one in self.gauges]) * per_force[:, np.newaxis]
        readings, felt = r.forces_n[at, :-1] + (sizes[first:] @ wrong_n), added.copy()
        felt[:, first:] += np.einsum("ncf,nf->nc", wrong_n, scales)
        gauges, friction = readings * scales, r.friction_direction[at] * per_force
        rigid = gauges.sum(axis=1) + r.forces_n[at, -1] * per_force - values[FRICTION.name] * friction
        if self._beside_n is not None:
            beside = self._beside_n * per_force[:, np.newaxis]
            felt[:, first:] += beside
            rigid = rigid + beside @ sizes[first:]
        by_change = np.zeros((at.size, 0))
        whole = rigid
        if changes is not None:
            smooth, less = r.smooth_force_n[at] * per_force, np.expm1(-changes @ changed)
            whole, by_change = rigid + smooth * less, -(smooth * (1.0 + less))[:, np.newaxis] * changes
        derivatives = np.column_stack([-whole, -gauges, -friction, whole, felt, by_change])
        modelled = whole + added @ sizes
        return (r.acceleration_m_s2[at] - modelled) / self.sigma_m_s2, derivatives / self.sigma_m_s2[:, np.newaxis]
