"""The mass by a camera's track and the forces, by the same inference as that by an accelerometer.

A shot sees every force in another mixture, first the breech, then brake and recuperator; the travel tells them apart as
far as their double integrals differ. So the mass, an error of every gauge and its zeros, the friction, the release, the
camera's scale, its picture and its clock, and what the carriage's sensors may be off are unknowns of one inference,
each with what is known of it (`recoil_identification.travel_rows`).
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from recoil_identification import equation_of_motion as motion
from recoil_identification.calibration import Calibration, calibration_of
from recoil_identification.carriage_causes import carriage_causes
from recoil_identification.causes import Cause, causes_of
from recoil_identification.equation_of_motion import EquationOfMotion
from recoil_identification.gauge_agreement import gauge_agreement
from recoil_identification.inference.unknown import Prior
from recoil_identification.late_readings import late_readings
from recoil_identification.row_noise import RowNoise
from recoil_identification.sensor_priors import RELEASE, ZERO, certificates
from recoil_identification.tracked_recoil import TrackedRecoil
from recoil_identification.travel_rows import ForcedTravel
from recoil_processing.shot.regression import Regression, spaced_rows

OWN_UNKNOWNS = 4
"""Mass, place, release and clock: what the frames are fitted with besides what calibrations restrict."""


def camera_mass(tracked: TrackedRecoil) -> Calibration:
    """Estimate the mass of a recoil that a camera saw.

    Raises
    ------
    IdentificationError
        If too few frames saw the motion, or force and displacement have nothing in common.
    """
    forced, signals = tracked.forced, tracked.forced.signals
    recorded = replace(forced.recorded, forces_n=forced.inputs.forces_n)
    n, m0_kg = recorded.times_s.size, forced.mass_kg
    levels = tracked.found.marker_sigma_m, tracked.found.density
    travel = ForcedTravel.of(
        forced,
        tracked.track,
        levels,
        clock=tracked.clock.clock,
        u_shift_s=tracked.u_shift_s,
        u_rate=tracked.clock.u_drift,
    )
    causes = _causes(tracked, recorded)
    release = Prior.of(RELEASE, motion.RELEASE.name, recorded.u_release_n_s / m0_kg, recorded.release_n_s / m0_kg)
    common = certificates(forced.scales, release, tracked.camera.u_rel, accelerometer=False)
    late = late_readings(signals, recorded.interval_s, causes)
    gauges = gauge_agreement(signals, forced.rig, recorded.interval_s)
    rows, known = ((), ()) if late is None else ((late.rows,), (late.prior,))
    own = [
        Prior.of(ZERO, motion.ZERO.name, 0.0),  # nothing that has a zero was recorded
        *travel.priors,
        *(cause.prior for cause in causes),
        *known,
        *gauges.priors,
    ]
    block = EquationOfMotion(recorded, np.arange(n), m0_kg, np.ones(n), causes, motion.CAMERA)
    noise = RowNoise(
        np.full(n, math.sqrt(travel.density / recorded.step_s)),
        math.sqrt(tracked.found.inflation),
        float(max(travel.times_s.size - OWN_UNKNOWNS, 1)),
    )
    return calibration_of("camera", block, noise, common, own, travel, travel.correlation, (*rows, *gauges.rows))


def with_residual(calibration: Calibration, regression: Regression) -> Calibration:
    """State the residual of a filtered regression, so that estimates by other methods compare."""
    rows = spaced_rows(regression)
    acceleration, force = calibration.correct(regression)
    residual = acceleration[rows] - force[rows] / calibration.estimate.mass_kg
    deviation = math.sqrt(float(residual @ residual) / max(rows.size - 1, 1))
    return replace(calibration, estimate=replace(calibration.estimate, residual_m_s2=deviation))


def _causes(tracked: TrackedRecoil, recorded: Regression) -> tuple[Cause, ...]:
    """List what else may be wrong; what only the recoil's own accelerometer hangs on moves nothing."""
    forced = tracked.forced
    of_forces = causes_of(recorded, recorded, forced.signals, forced.shot, forced.rig)
    return (*(one for one in of_forces if np.any(one.forces_n)), *carriage_causes(forced))
