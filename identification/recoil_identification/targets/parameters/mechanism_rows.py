"""The recorded motion and loads of a shot as rows of the equations of motion, and what each sensor may have wrong.

All columns pass one and the same low-pass, and the rows are taken as far apart as it makes their errors
independent. What the equations make of them is computed from these columns: an error of a sensor moves its
column, and all columns that were computed from it, along a known direction. That is what lets an estimator
treat the sensors' errors as unknowns that calibrations restrict, instead of taking the regressor for exact.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_identification.targets.parameters.sensor_errors import RELEASED, SensorError
from recoil_rigs.mechanism.mechanism_regressor import LOADS, Geometry, load_directions, regressor

Columns = Mapping[str, Array]


@dataclass(frozen=True, eq=False)
class MechanismRows(ReadOnlyArrays):
    """Rows of the equations of motion.

    Attributes
    ----------
    times_s : ndarray, shape (n,)
    columns : mapping of str to ndarray, shape (n,)
        ``acc`` of the recoiling part as its accelerometer reads, ``held`` that reading where the stop holds the
        part; ``f_x``, ``f_y`` of the carriage; ``w1``, ``w2``, ``dw1``, ``dw2``, ``alpha``, ``beta``, ``x``, ``dx``;
        the forces of the fifth equation by `recoil_identification.targets.parameters.sensor_errors.RELEASED`;
        the loads of `recoil_rigs.mechanism.mechanism_regressor.LOADS` that are measured.
    place
        Place of the recoiling part's accelerometer from A in battery, tipping axes, m.
    carriage_place
        Place of the carriage's accelerometers from C, carriage axes, m.
    rest
        Values of the loads' columns, while nothing moves.
    recoils : ndarray of bool, shape (n,)
        Rows in which the fifth equation can be trusted: from the onset of force to the end of recoil.
    trusted : ndarray of bool, shape (n,)
        Rows from the onset on without lost samples.
    noise
        Standard deviation of the columns of accelerations in the pre-trigger baseline; none without one.
    baseline_s
        Length of the pre-trigger baseline.
    cutoff_hz
        Cut-off of the low-pass.
    """

    times_s: Array
    columns: Columns
    errors: tuple[SensorError, ...]
    geometry: Geometry
    place: tuple[float, float]
    carriage_place: tuple[float, float]
    rest: Mapping[str, float]
    recoils: Flags
    trusted: Flags
    noise: Mapping[str, float]
    baseline_s: float
    cutoff_hz: float

    @property
    def measured(self) -> Flags:
        """Which of the loads of `recoil_rigs.mechanism.mechanism_regressor` are measured, shape (7,)."""
        return np.array([name in self.columns or name == "resistance" for name in LOADS])

    def corrected(self, errors: Array) -> MechanismRows:
        """Take errors of the sensors off, shape (n_errors,)."""
        columns = dict(self.columns)
        geometry = self.geometry
        for size, error in zip(errors, self.errors, strict=True):
            for name, direction in error.directions.items():
                columns[name] = columns[name] - size * direction
            if error.geometry:
                geometry = replace(geometry, **{error.geometry: getattr(geometry, error.geometry) - size})
        return replace(self, columns=columns, geometry=geometry)

    def every(self, step: int) -> MechanismRows:
        """Take every so many-th row."""
        kept = slice(None, None, step)
        return replace(
            self,
            times_s=self.times_s[kept],
            columns={name: column[kept] for name, column in self.columns.items()},
            errors=tuple(
                replace(e, directions={name: d[kept] for name, d in e.directions.items()}) for e in self.errors
            ),
            recoils=self.recoils[kept],
            trusted=self.trusted[kept],
        )

    def state(self) -> tuple[Array, Array, Array]:
        """Return q, q' and q'' as the sensors saw them, shape (n, 5) each; xi and eta are left zero."""
        c, k = self.columns, self.geometry
        px, py = self.carriage_place
        along = c["f_x"] + py * c["dw1"] + px * c["w1"] ** 2
        across = c["f_y"] - px * c["dw1"] + py * c["w1"] ** 2
        c1, s1 = np.cos(k.phi10 + c["alpha"]), np.sin(k.phi10 + c["alpha"])
        forward, up = c1 * along - s1 * across, s1 * along + c1 * across
        turned = k.phi20 - k.phi10 + c["beta"]
        cd, sd = np.cos(turned), np.sin(turned)
        A5, A6 = k.XA * cd + k.YA * sd, k.YA * cd - k.XA * sd
        a5 = cd * along + sd * across - c["dw1"] * A6 - c["w1"] ** 2 * A5
        ddx = c["acc"] + a5 + (c["x"] - self.place[0]) * c["w2"] ** 2 - self.place[1] * c["dw2"]
        zero = np.zeros_like(ddx)
        q = np.column_stack([zero, zero, c["alpha"], c["beta"], c["x"]])
        qd = np.column_stack([zero, zero, c["w1"], c["w2"] - c["w1"], c["dx"]])
        qdd = np.column_stack([forward, up - k.g, c["dw1"], c["dw2"] - c["dw1"], ddx])
        return q, qd, qdd

    def equations(self) -> tuple[Array, Array]:
        """Return ``Y`` and ``Q`` of the change since rest, shapes (n, 5, 12) and (n, 5).

        Loads that are not measured are left out of Q. In the fifth equation both sides are zero while the
        part is held.
        """
        c, k = self.columns, self.geometry
        Y = regressor(k, *self.state())
        rest = np.zeros((1, 5))
        Y -= regressor(k, rest, rest, rest)
        squared, angular = c["w2"] ** 2, c["dw2"]
        Y[:, 4, 8] = c["acc"] - c["held"] - self.place[0] * squared - self.place[1] * angular
        Y[:, 4, 9], Y[:, 4, 10] = squared, angular
        B = load_directions(k, c["alpha"], c["beta"])
        at_rest = load_directions(k, 0.0, 0.0)
        Q = np.zeros(Y.shape[:2])
        for j, name in enumerate(LOADS):
            if name in c:
                Q += B[:, :, j] * c[name][:, np.newaxis] - at_rest[:, j] * self.rest[name]
        Q[:, 4] = sum(c[name] for name in RELEASED)
        return Y, Q
