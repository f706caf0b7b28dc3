"""The methods that solve for mass and sensors together: which rows each compares, and what it knows beforehand.

Both are one inference (`recoil_identification.inference`), and differ in what measured the motion.

=================================  ==================================  ==============================================
rows                               ``calibrated``                      ``camera``
=================================  ==================================  ==============================================
the equation of motion             of the accelerometer, filtered      integrated twice, of the frames
the camera's frames                of the accelerometer, integrated    are what the equation is compared with
the breech gauge, bore empty       means of 5 ms                       the same
several gauges of one pressure     their differences                   the same
=================================  ==================================  ==============================================

Known beforehand are the certificates of gauges, friction, accelerometer and camera, how the stop lets go, and the sizes
of what else may be wrong: zeros that were measured or that move, clocks, repairs, the picture, the carriage's sensors.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from recoil_identification import equation_of_motion as motion
from recoil_identification.calibration import Beside, Calibration, calibration_of
from recoil_identification.camera_rows import CameraRows, camera_rows
from recoil_identification.carriage_causes import carriage_causes
from recoil_identification.causes import Cause, absent_rate_causes, causes_of
from recoil_identification.equation_of_motion import EquationOfMotion
from recoil_identification.gauge_agreement import gauge_agreement
from recoil_identification.inference.unknown import Prior
from recoil_identification.late_readings import late_readings
from recoil_identification.row_noise import RowNoise
from recoil_identification.sensor_priors import RELEASE, ZERO, certificates
from recoil_identification.tracked_recoil import TrackedRecoil
from recoil_identification.travel_rows import ForcedTravel
from recoil_identification.zero_shift import ZeroShift, calibrated_with_zero_shift
from recoil_processing.filters import LowPass
from recoil_processing.shot.camera_motion import RecordedMotion
from recoil_processing.shot.clocks.estimator_inputs import EstimatorInputs
from recoil_processing.shot.regression import Regression, spaced_rows
from recoil_processing.shot.sensor_scales import scale_uncertainty
from recoil_processing.shot.signals import Signals

Array = NDArray[np.float64]

OWN_UNKNOWNS = 4
"""Mass, place, release and clock: what the frames are fitted with besides what calibrations restrict."""


def calibrated(
    inputs: EstimatorInputs, low_pass: LowPass, inertial_m_s2: Array, track: RecordedMotion | None
) -> tuple[Regression, Regression, Calibration, ZeroShift]:
    """Estimate the mass by the accelerometer on the recoiling part, with the camera's frames beside it.

    Parameters
    ----------
    inputs
        Of the shot as recorded.
    low_pass
        Of the rows.
    inertial_m_s2 : ndarray, shape (n,)
        a' by the accelerometer; lost samples NaN.
    track
        The frames, if a camera is aligned.

    Returns
    -------
    recorded, filtered : Regression
        With the columns of the zero's shift, if there is one.
    calibration : Calibration
    shift : ZeroShift

    Raises
    ------
    IdentificationError
        As of `recoil_identification.calibration.calibrated_mass`.
    """
    signals, shot, rig = inputs.signals, inputs.shot, inputs.rig

    def beside(narrow: Regression, recorded: Regression) -> Beside:
        causes = (*causes_of(narrow, recorded, signals, shot, rig), *absent_rate_causes(narrow, signals, rig))
        frames = None if track is None else camera_rows(track, narrow, recorded, inertial_m_s2, causes, signals, rig)
        return _with_gauges(inputs, narrow, causes, frames)

    u_zero_m_s2 = signals.offsets["recoil_acceleration"].u
    scales, baseline = scale_uncertainty(rig), inputs.baseline_noise
    return calibrated_with_zero_shift(inputs.recorded, low_pass, scales, u_zero_m_s2, baseline, beside)


def by_camera(tracked: TrackedRecoil) -> Calibration:
    """Estimate the mass by a camera's track and the forces.

    Raises
    ------
    IdentificationError
        If too few frames saw the motion, or force and displacement have nothing in common.
    """
    forced, found, clock = tracked.forced, tracked.found, tracked.clock
    recorded = replace(forced.recorded, forces_n=forced.inputs.forces_n)
    n, m0_kg = recorded.times_s.size, forced.mass_kg
    levels = found.marker_sigma_m, found.density
    travel = ForcedTravel.of(
        forced, tracked.track, levels, clock=clock.clock, u_shift_s=tracked.u_shift_s, u_rate=clock.u_drift
    )
    of_forces = causes_of(recorded, recorded, forced.signals, forced.shot, forced.rig)
    # what only an accelerometer on the recoiling part hangs on moves nothing here
    causes = (*(one for one in of_forces if np.any(one.forces_n)), *carriage_causes(forced))
    beside = _with_gauges(forced.inputs, recorded, causes)
    release = Prior.of(RELEASE, motion.RELEASE.name, recorded.u_release_n_s / m0_kg, recorded.release_n_s / m0_kg)
    common = certificates(forced.scales, release, tracked.camera.u_rel, accelerometer=False)
    no_zero = Prior.of(ZERO, motion.ZERO.name, 0.0)  # nothing that has one was recorded
    own = [no_zero, *travel.priors, *(cause.prior for cause in causes), *beside.priors]
    block = EquationOfMotion(recorded, np.arange(n), m0_kg, np.ones(n), causes, motion.CAMERA)
    noise = RowNoise(
        np.full(n, math.sqrt(travel.density / recorded.step_s)),
        math.sqrt(found.inflation),
        float(max(travel.times_s.size - OWN_UNKNOWNS, 1)),
    )
    further, unknowns = beside.rows, beside.unknowns
    return calibration_of("camera", block, noise, common, own, travel, travel.correlation, further, unknowns)


def with_residual(calibration: Calibration, regression: Regression) -> Calibration:
    """State the residual of a filtered regression, so that estimates by other methods compare."""
    rows = spaced_rows(regression)
    acceleration, force = calibration.correct(regression)
    residual = acceleration[rows] - force[rows] / calibration.estimate.mass_kg
    deviation = math.sqrt(float(residual @ residual) / max(rows.size - 1, 1))
    return replace(calibration, estimate=replace(calibration.estimate, residual_m_s2=deviation))


def _with_gauges(
    inputs: EstimatorInputs, regression: Regression, causes: Sequence[Cause], frames: CameraRows | None = None
) -> Beside:
    """Put the gauges' own rows beside those of the motion."""
    signals: Signals = inputs.signals
    late = late_readings(signals, regression.interval_s, causes)
    gauges = gauge_agreement(signals, inputs.rig, regression.interval_s)
    rows, priors = ((), ()) if late is None else ((late.rows,), (late.prior,))
    return Beside(tuple(causes), frames, (*rows, *gauges.rows), (*priors, *gauges.priors), gauges.unknowns)
