"""The breech force by the motion: two methods and the gauge beside one another."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_identification.targets.forces.force_inversion import InvertedForce, invert_force
from recoil_identification.targets.forces.force_record import ForceRecord
from recoil_identification.targets.forces.input_estimate import InputEstimate, estimate_input

REST_OF_GAUGE_S = 1e-3
"""Time before the release, s: what the gauge shows earlier is its noise."""


@dataclass(frozen=True, eq=False)
class MotionForce(ReadOnlyArrays):
    """The force by both methods, on the instants of the first, and by the gauge.

    Attributes
    ----------
    gauge
        The gauge's force, freed of noise and stress waves in the same way.
    systematic_n : mapping of str to ndarray, shape (n,)
        Error of the force by cause, see the record.
    free : ndarray of bool, shape (n,)
        Samples from the release on.
    """

    record: ForceRecord
    kalman: InputEstimate
    inverted: InvertedForce
    gauge: InputEstimate | None
    systematic_n: Mapping[str, Array]
    free: NDArray[np.bool_]

    @property
    def times_s(self) -> Array:
        """The instants, shape (n,)."""
        return self.kalman.times_s

    @property
    def u_systematic_n(self) -> Array:
        """Standard uncertainty that both methods have in common, shape (n,)."""
        return np.sqrt(sum((error**2 for error in self.systematic_n.values()), np.zeros(self.times_s.size)))

    @property
    def u_kalman_n(self) -> Array:
        """Standard uncertainty of the Kalman estimate, shape (n,)."""
        return np.hypot(self.kalman.u_force_n, self.u_systematic_n)

    @property
    def u_inverted_n(self) -> Array:
        """Standard uncertainty of the inversion, shape (n,)."""
        return np.hypot(self.inverted.u_force_n, self.u_systematic_n)

    @property
    def u_gauge_n(self) -> Array:
        """Standard uncertainty of the gauge's force; NaN where there is none, shape (n,)."""
        if self.gauge is None:
            return np.full(self.times_s.size, np.nan)
        scale = self.record.u_gauge * self.gauge.force_n
        grid = self.record.measured.times_s
        zeros = (np.interp(self.times_s, grid, zero) for zero in self.record.gauge_zero_n.values())
        return np.sqrt(self.gauge.u_force_n**2 + scale**2 + sum(zero**2 for zero in zeros))

    @property
    def inertia_n(self) -> Array:
        """m3 a' of the Kalman estimate: its force less the measured resistance; NaN before the release, shape (n,)."""
        measured = self.record.measured
        return self.blank(self.kalman.force_n) - np.interp(self.times_s, measured.times_s, measured.resistance_n)

    def blank(self, values: Array) -> Array:
        """Return values without those before the release, where the motion does not tell the force."""
        return np.where(self.free, values, np.nan)

    def u_impulse_n_s(self, random_n_s: float) -> float:
        """Return the standard uncertainty of the impulse from the release on, given that of one method alone."""
        step = float(self.times_s[1] - self.times_s[0])
        return math.hypot(random_n_s, *(step * float(e[self.free].sum()) for e in self.systematic_n.values()))


def estimate_motion_force(record: ForceRecord) -> MotionForce:
    """Estimate the breech force by both methods.

    Raises
    ------
    IdentificationError
        If too little of the record is there.
    """
    try:
        kalman = estimate_input(record.measured, record.tracked, record.modes)
        inverted = invert_force(
            record.measured,
            record.tracked,
            error_covariance_n2=kalman.error_covariance_n2,
            factor=kalman.factor,
            onset_s=record.onset_s,
            held_n=record.held_n,
            times_s=kalman.times_s,
        )
    except ValueError as error:
        raise IdentificationError(
            f"breech force by the motion: {error}",
            expected="a record of the accelerometer through the shot",
            remedy="check for lost samples, or record faster",
        ) from error
    free = kalman.times_s >= record.onset_s
    grid = record.measured.times_s
    systematic = {cause: np.interp(kalman.times_s, grid, error) for cause, error in record.systematic_n.items()}
    return MotionForce(record, kalman, inverted, _by_gauge(record), systematic, free)


def _by_gauge(record: ForceRecord) -> InputEstimate | None:
    """Free the gauge's force of noise and stress waves in the same way, so that peaks can be compared."""
    if record.gauge_n is None:
        return None
    silent = record.gauge_n[record.measured.times_s < record.onset_s - REST_OF_GAUGE_S]
    silent = silent[np.isfinite(silent)]
    if silent.size < 20 or np.isfinite(record.gauge_n).mean() < 0.5:
        return None
    nothing = np.zeros(record.gauge_n.size)
    peak = float(np.nanmax(record.gauge_n))
    alone = replace(
        record.measured,
        force_n=record.gauge_n,
        resistance_n=nothing,
        carried_m_s2=nothing,
        noise_n=max(float(np.std(silent)), 1e-6 * peak),
        u_gain=0.0,
        u_zero_m_s2=float(np.std(silent)) / math.sqrt(silent.size) / record.measured.mass_kg,
    )
    return estimate_input(alone, None, record.modes)
