"""The recoil resistance over time: by breech gauge and motion, by its own gauges, and by the fitted law."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_identification.shot.identified import Identification
from recoil_identification.targets.resistance.packing_friction import Friction
from recoil_identification.targets.resistance.resistance_fit import FittedBrake, FittedGas
from recoil_identification.targets.resistance.resistance_record import ResistanceRecord
from recoil_processing.shot.sensor_scales import ScaleUncertainty
from recoil_rigs.mechanism.model import Mechanism

FORCE_OVER = 0.02
"""Share of the peak breech force below which the motion shows the resistance nearly alone."""
LEAST_SAMPLES = 50
"""Fewest samples to compare."""


@dataclass(frozen=True, eq=False)
class ResistanceOverTime(ReadOnlyArrays):
    """The resistance from the release to the end of recoil, N, shape (n,) each.

    Attributes
    ----------
    motion_n, u_motion_n
        Resistance and its standard uncertainty by breech gauge and motion, behind the low-pass; NaN where not trusted.
    brake_n, recuperator_n
        Forces by the gauges, as recorded.
    friction_n
        Friction as identified.
    law_n
        The fitted law; NaN where there is none.
    """

    motion_n: Array
    u_motion_n: Array
    brake_n: Array
    recuperator_n: Array
    friction_n: Array
    law_n: Array
    breech_n: Array

    @property
    def measured_n(self) -> Array:
        """Gauges and friction together."""
        return np.asarray(self.brake_n + self.recuperator_n + self.friction_n)

    def law_departure(self, force_errors_n: Mapping[str, Array]) -> tuple[float, float] | None:
        """Return by how much the law exceeds the motion's resistance behind the pulse, on the average, and its u.

        Parameters
        ----------
        force_errors_n : mapping of str to ndarray, shape (n,)
            Errors by cause that the gauges and the friction may be wrong by.

        Returns
        -------
        tuple of float or None
            N; None where less than 50 samples can be compared.
        """
        over = np.flatnonzero(self.breech_n > FORCE_OVER * float(np.max(self.breech_n)))
        late = np.arange(self.law_n.size) > (over[-1] if over.size else 0)
        both = late & np.isfinite(self.law_n) & np.isfinite(self.motion_n)
        if np.count_nonzero(both) < LEAST_SAMPLES:
            return None
        errors = [float(np.mean(error[both])) for error in force_errors_n.values()]
        u = math.hypot(float(np.mean(self.u_motion_n[both])), *errors)
        return float(np.mean((self.law_n - self.motion_n)[both])), u


def resistance_over_time(
    found: Identification,
    record: ResistanceRecord,
    gas: FittedGas | str,
    brake: FittedBrake | str,
    friction: Friction,
    m: Mechanism,
    scales: ScaleUncertainty,
) -> ResistanceOverTime:
    """Compare the resistance by the motion, by the gauges and by the law, on the instants of the record."""
    first = int(np.searchsorted(found.route.filtered.times_s, record.times_s[0] - 1e-9))
    part = slice(first, first + record.times_s.size)
    regression, calibration = found.route.filtered, found.route.calibration
    acceleration, _ = calibration.correct(regression)
    breech = (regression.forces_n[part, 0] + record.breech_lacks_n) / (1.0 + float(calibration.gauge_errors[0]))
    a, specification = acceleration[part], found.specification
    motion = np.where(regression.trusted[part], breech - specification.mass_kg * a, np.nan)
    u = np.hypot(scales.gauges[0] * breech, specification.mass_kg * a * min(scales.acceleration, record.u_scale))
    u = np.hypot(u, specification.u_kg * a)
    x, v = record.travel_m, record.velocity_m_s
    law, sliding = np.full(x.size, np.nan), friction.value_n + m.slide_friction * v
    if not isinstance(gas, str) and not isinstance(brake, str):
        law = m.recuperator_area * gas.law.pressure(x) + brake.profile.force(x, v) + sliding
    return ResistanceOverTime(
        motion_n=motion,
        u_motion_n=u,
        brake_n=m.brake_area * record.brake_pa,
        recuperator_n=m.recuperator_area * record.recuperator_pa,
        friction_n=sliding,
        law_n=law,
        breech_n=breech,
    )
