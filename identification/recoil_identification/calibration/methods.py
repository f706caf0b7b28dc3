"""The methods that solve for mass and sensors together: which rows each compares, and what it knows beforehand.

Both are one inference (`recoil_identification.inference`), and differ in what measured the motion.

=================================  ==================================  ==============================================
rows                               ``calibrated``                      ``camera``
=================================  ==================================  ==============================================
the equation of motion             of the accelerometer, filtered      integrated twice, of the frames
the camera's frames                of the accelerometer, integrated    are what the equation is compared with
the breech gauge, bore empty       means of 5 ms                       the same
several gauges of one pressure     their differences                   the same
what the rig knows of forces       its impulse, its load               the same
=================================  ==================================  ==============================================

Known beforehand are the certificates of gauges, friction, accelerometer and camera, how the stop lets go, and the sizes
of what else may be wrong: zeros that were measured or that move, clocks, repairs, the picture, the carriage's sensors.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_identification.calibration.calibration import Calibration
from recoil_identification.calibration.gauge_agreement import gauge_agreement
from recoil_identification.calibration.noise_in_motion import noise_in_motion, travel_with_noise
from recoil_identification.calibration.solution import all_unknowns, calibration_of
from recoil_identification.calibration.zero_shift import ZeroShift, can_be_told, shift_columns, with_zero_shift
from recoil_identification.estimate.mass import reverse_mass
from recoil_identification.inference.block import JointBlock, LinearBlock
from recoil_identification.inference.unknown import Prior, Unknown
from recoil_identification.rows import equation_of_motion as motion
from recoil_identification.rows.breech_chain import chain_causes
from recoil_identification.rows.camera_rows import CameraRows, camera_rows
from recoil_identification.rows.causes import Cause, carriage_causes, carriage_part_causes, causes_of
from recoil_identification.rows.equation_of_motion import EquationOfMotion
from recoil_identification.rows.known_forces import known_forces
from recoil_identification.rows.late_readings import late_readings
from recoil_identification.rows.recorded_causes import recorded_causes
from recoil_identification.rows.row_noise import RowNoise, correlation_of, row_noise
from recoil_identification.rows.sensor_priors import RELEASE, ZERO, certificates, parts_of_scales
from recoil_identification.rows.tracked_recoil import TrackedRecoil
from recoil_identification.rows.travel_rows import ForcedTravel, TravelRows
from recoil_identification.rows.unread_resistance import unread_causes
from recoil_processing.filters import LowPassFilter
from recoil_processing.shot.camera_motion import RecordedMotion
from recoil_processing.shot.clocks.estimator_inputs import BaselineNoise, EstimatorInputs
from recoil_processing.shot.gauge_zero import unrested_zero
from recoil_processing.shot.regression import Regression, spaced_rows
from recoil_processing.shot.sensor_scales import ScaleUncertainty, scale_uncertainty
from recoil_processing.shot.signals import Signals

Method = Literal["calibrated", "reverse", "forward", "paper", "camera", "tls"]
"""Name of a method that gives a mass."""
METHODS: tuple[Method, ...] = ("calibrated", "reverse", "forward", "paper")
"""Methods computed for every shot with forces and an accelerometer on the recoiling part. The default is then
``calibrated``, because the scales of the sensors are less certain than the shot is random; a camera that was aligned
adds its own."""
CAMERA_METHODS: tuple[Method, ...] = ("camera",)
"""Methods computed for a shot with forces and a camera, but no such accelerometer: the default then. They may be asked
for where there is one: nothing of the accelerometer is used then but, if the rig says so, for the camera's clock."""
FURTHER: tuple[Method, ...] = ("tls",)
"""Methods computed when asked for, see `recoil_identification.estimators.total_least_squares`."""
AS_RECORDED = ("paper", "ar-gls", "weak")
"""Methods whose mass is of the signals as recorded, behind no low-pass; the last two are those of older reports."""

MOST_ROWS = 2000
"""Rows of the motion beyond which each second, third ... counts: their correlation is a matrix."""
MAY_BE_A_SHIFT = 0.01
"""Share of the acceleration that is left in a coloured way, from which on that may be a zero that shifted."""
LOUDER = 10.0
"""Noise of the motion over that of the rest from which on it may be one, too: a kick at the onset is over at once."""
OWN_UNKNOWNS = 4
"""Mass, place, release and clock: what the frames are fitted with besides what calibrations restrict."""


@dataclass(frozen=True)
class Beside:
    """Causes, frames, rows of the gauges and priors beside the rows of a shot's motion.

    Attributes
    ----------
    causes
        Further errors that the shot may have, on the regression's grid.
    camera
        Rows of its frames.
    rows, priors
        Rows and priors of the breech gauge once the bore is empty, of several gauges' differences, and of what the rig
        file knows of forces.
    unknowns
        Unknowns that only the gauges' differences and what is declared have.
    zero_freedom
        Degrees of freedom with which the zero is known of what measured the motion; infinite where no samples of a rest
        told it.
    """

    causes: tuple[Cause, ...] = ()
    camera: CameraRows | None = None
    rows: tuple[LinearBlock, ...] = ()
    priors: tuple[Prior, ...] = ()
    unknowns: tuple[Unknown, ...] = ()
    zero_freedom: float = math.inf


def calibrated(
    inputs: EstimatorInputs, low_pass: LowPassFilter, inertial_m_s2: Array, track: RecordedMotion | None
) -> tuple[Regression, Regression, Calibration, ZeroShift]:
    """Estimate the mass by the accelerometer on the recoiling part, with the camera's frames beside it.

    Parameters
    ----------
    inputs
        Inputs of the shot as recorded.
    low_pass
        Low-pass of the rows.
    inertial_m_s2 : ndarray, shape (n,)
        a' by the accelerometer; lost samples NaN.
    track
        The frames, if a camera is aligned.

    Returns
    -------
    recorded, filtered : Regression
        Regressions before and behind the filter, with the columns of the zero's shift, if there is one.
    calibration : Calibration
    shift : ZeroShift

    Raises
    ------
    IdentificationError
        As of `calibrated_mass`.
    """
    signals, rig = inputs.signals, inputs.fired.rig
    role = inputs.recorded.motion_role
    u_zero_m_s2, scales = _u_zero_m_s2(inputs), scale_uncertainty(rig, role)
    shiftable = inputs.recorded
    if role == "recoil_acceleration" and not _begins_in_motion(inputs):  # else there is no zero that could shift
        shiftable = replace(shiftable, shifts=shift_columns(shiftable))
    full = shiftable.filtered(low_pass)
    causes = (
        *causes_of(full, shiftable, signals, inputs.fired, role),
        *carriage_part_causes(full, signals, inputs.fired),
        *unread_causes(full, shiftable, rig.mechanism, shiftable.acceleration_m_s2),
        *chain_causes(full, shiftable, signals, rig),
    )
    frames = None if track is None else camera_rows(track, full, shiftable, inertial_m_s2, causes, signals, rig)
    beside = replace(_with_gauges(inputs, full, causes, frames), zero_freedom=_zero_freedom(inputs))
    return calibrated_with_zero_shift(shiftable, full, scales, u_zero_m_s2, inputs.baseline_noise, beside)


def calibrated_with_zero_shift(
    recorded: Regression,
    filtered: Regression,
    scales: ScaleUncertainty,
    u_zero_m_s2: float,
    baseline: BaselineNoise | None = None,
    beside: Beside = Beside(),
) -> tuple[Regression, Regression, Calibration, ZeroShift]:
    """Estimate the mass, with a shift of the accelerometer's zero where the shot demands one.

    Parameters
    ----------
    recorded, filtered
        Regressions before and behind the filter, with all shapes that a shift may have.
    scales, u_zero_m_s2
        Arguments of `calibrated_mass`.
    baseline
        Noise of the pre-trigger baseline; that of the rows themselves counts without it.
    beside
        Rows and priors beside the motion's, the frames with all shapes as well.

    Returns
    -------
    recorded, filtered, calibration, shift
        Results as `calibrated` returns them.
    """
    plain, frames = replace(filtered, shifts=None), beside.camera
    mass_kg = reverse_mass(plain, scales).mass_kg
    told = can_be_told(filtered, u_zero_m_s2)
    # with every shape released: what a shift leaves unexplained must not excuse it
    rest = row_noise(filtered if told else plain, mass_kg, baseline)

    def estimated(shape: Sequence[int], noise: RowNoise | None = None) -> Calibration:
        regression = plain if filtered.shifts is None or not shape else _with_shape(filtered, shape)
        seen = replace(beside, camera=None if frames is None else frames.with_shifts(shape))
        noise = noise or _Setting.of(regression, seen, scales, u_zero_m_s2).noise(rest)
        return calibrated_mass(regression, scales, u_zero_m_s2, noise=noise, beside=seen)

    calibration = judged = estimated(())
    if told and _may_be_a_shift(calibration):
        # noise of the motion may be a shift that nothing else explained yet
        judged = estimated((), _Setting.of(filtered, beside, scales, u_zero_m_s2).noise(rest))
    chosen, _, shift = with_zero_shift(judged, filtered, frames)
    if chosen:
        calibration = estimated(chosen)
        shift = shift.as_found(chosen, calibration)
    shifts = None if not chosen or recorded.shifts is None else recorded.shifts[:, chosen]
    return replace(recorded, shifts=shifts), calibration.block.regression, calibration, shift


def _may_be_a_shift(calibration: Calibration) -> bool:
    """Return whether what was found as noise of the motion may be a zero that shifted."""
    noise, rows = calibration.noise, calibration.block.rows
    louder = float(np.max(noise.sizes_m_s2)) > LOUDER * float(np.median(noise.rest_m_s2[rows]))
    return louder or noise.unexplained_share > MAY_BE_A_SHIFT


def _with_shape(filtered: Regression, shape: Sequence[int]) -> Regression:
    """Keep some of the shapes in which the zero may have shifted."""
    return replace(filtered, shifts=None if filtered.shifts is None else filtered.shifts[:, list(shape)])


def calibrated_mass(
    regression: Regression,
    scales: ScaleUncertainty,
    u_bias_m_s2: float,
    *,
    noise: RowNoise | None = None,
    beside: Beside = Beside(),
) -> Calibration:
    """Estimate the mass by rows of the accelerometer and by what is known beside them.

    Parameters
    ----------
    regression
        Filtered.
    u_bias_m_s2
        Standard uncertainty of the accelerometer's zero from the pre-trigger baseline; infinite if there was none.
    noise
        Noise on the regression's grid; that of the rows themselves if left out.

    Raises
    ------
    IdentificationError
        If the interval has too few rows, or force and acceleration have nothing in common.
    """
    setting = _Setting.of(regression, beside, scales, u_bias_m_s2)
    noise = setting.noise(row_noise(regression, setting.block.m0_kg)) if noise is None else noise
    rows = setting.block.rows
    block = replace(setting.block, sigma_m_s2=noise.sigma_m_s2[rows])
    correlation = correlation_of(regression, rows, noise, beside.camera)
    return calibration_of(
        "calibrated",
        block,
        noise,
        setting.common,
        setting.own,
        beside.camera,
        correlation,
        beside.rows,
        setting.unknowns,
    )


@dataclass(frozen=True)
class _Setting:
    """The rows of a shot's motion before their noise is known, and all that is known beside them."""

    block: EquationOfMotion
    beside: Beside
    common: tuple[Prior, ...]
    own: tuple[Prior, ...]
    unknowns: tuple[Unknown, ...]

    @classmethod
    def of(cls, regression: Regression, beside: Beside, scales: ScaleUncertainty, u_bias_m_s2: float) -> _Setting:
        causes, camera = beside.causes, beside.camera
        first = reverse_mass(regression, scales)
        rows = spaced_rows(regression)
        # rows by the thousand, behind a cut-off that was asked for, tell no more of one number
        rows = rows[:: -(-rows.size // MOST_ROWS)]
        common = certificates(scales, _release(regression, first.mass_kg), None if camera is None else camera.u_rel)
        own = []
        if math.isfinite(u_bias_m_s2):
            own.append(Prior.of(ZERO, motion.ZERO.name, u_bias_m_s2, degrees_of_freedom=beside.zero_freedom))
        own += [] if camera is None else camera.priors
        own += [*(cause.prior for cause in causes), *beside.priors]
        scale = motion.scale_of(regression.motion_role)
        block = EquationOfMotion(regression, rows, first.mass_kg, np.ones(rows.size), causes, scale)
        return cls(block, beside, tuple(common), tuple(own), (*beside.unknowns, *parts_of_scales(scales)))

    def noise(self, rest: RowNoise) -> RowNoise:
        """Find what the motion adds to the noise at rest; nothing where the signals have passed no filter."""
        if self.block.regression.low_pass is None:
            return rest
        camera, priors = self.beside.camera, (*self.common, *self.own)
        joined = JointBlock((self.block,) if camera is None else (self.block, camera))
        unknowns = all_unknowns(self.block, joined, priors, self.unknowns)
        return noise_in_motion(self.block, rest, camera, self.beside.rows, priors, unknowns)


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
    levels = found.marker_sigma_m, found.density / found.inflation
    drift, u_rate = tracked.rate
    travel = ForcedTravel.of(
        forced, tracked.track, levels, clock=clock.clock, u_shift_s=tracked.u_shift_s, u_rate=u_rate, drift=drift
    )
    of_forces = recorded_causes(recorded, forced.signals, forced.fired, forced.acceleration_m_s2)
    # what only an accelerometer on the recoiling part hangs on moves nothing here
    causes = (
        *carriage_causes(forced),
        *(one for one in of_forces if np.any(one.forces_n) or one.beside_n is not None),
    )
    beside = _with_gauges(forced.inputs, recorded, causes)
    common = certificates(forced.scales, _release(recorded, m0_kg), tracked.camera.u_rel, accelerometer=False)
    no_zero = Prior.of(ZERO, motion.ZERO.name, 0.0)  # nothing that has one was recorded
    own = [no_zero, *travel.priors, *(cause.prior for cause in causes), *beside.priors]
    block = EquationOfMotion(recorded, np.arange(n), m0_kg, np.ones(n), causes, motion.CAMERA)
    noise = RowNoise(
        np.full(n, math.sqrt(travel.density / recorded.step_s)),
        math.sqrt(found.inflation),
        float(max(travel.times_s.size - OWN_UNKNOWNS, 1)),
    )
    unknowns = (*beside.unknowns, *parts_of_scales(forced.scales))
    listed = all_unknowns(block, JointBlock((TravelRows(block, travel),)), [*common, *own], unknowns)
    travel, noise = travel_with_noise(block, travel, noise, beside.rows, [*common, *own], listed)
    return calibration_of("camera", block, noise, common, own, travel, travel.correlation, beside.rows, unknowns)


def with_residual(calibration: Calibration, regression: Regression) -> Calibration:
    """State the residual of a filtered regression, so that estimates by other methods compare."""
    rows = spaced_rows(regression)
    acceleration, force = calibration.correct(regression)
    residual = acceleration[rows] - force[rows] / calibration.estimate.mass_kg
    deviation = math.sqrt(float(residual @ residual) / max(rows.size - 1, 1))
    return replace(calibration, estimate=replace(calibration.estimate, residual_m_s2=deviation))


def _begins_in_motion(inputs: EstimatorInputs) -> bool:
    """Return whether a body on a line moves when its record begins."""
    u_zero = inputs.signals.offsets["recoil_acceleration"].u
    return inputs.recorded.begins_in_motion(rested=math.isfinite(u_zero))


def _u_zero_m_s2(inputs: EstimatorInputs) -> float:
    """Return how well the zero is known of what measured the motion: what is differentiated has none.

    Of an accelerometer that was not seen at rest the rig says it, or a share of its range is taken.
    """
    role = inputs.recorded.motion_role
    if role != "recoil_acceleration":
        return 0.0
    if not _begins_in_motion(inputs):
        return inputs.signals.offsets[role].u
    spec = inputs.fired.rig.with_role(role)[0]
    return unrested_zero(spec, inputs.signals.series[role])


def _zero_freedom(inputs: EstimatorInputs) -> float:
    """Return the degrees of freedom of it; infinite of what is differentiated, or was not seen at rest."""
    role = inputs.recorded.motion_role
    if role != "recoil_acceleration" or _begins_in_motion(inputs):
        return math.inf
    return inputs.signals.offsets[role].degrees_of_freedom


def _release(regression: Regression, mass_kg: float) -> Prior:
    """State the velocity that the stop's release may give the part."""
    value, u = regression.release_n_s / mass_kg, regression.u_release_n_s / mass_kg
    return Prior.of(RELEASE, motion.RELEASE.name, u, value)


def _with_gauges(
    inputs: EstimatorInputs, regression: Regression, causes: Sequence[Cause], frames: CameraRows | None = None
) -> Beside:
    """Put the gauges' own rows beside those of the motion."""
    signals: Signals = inputs.signals
    late = late_readings(signals, regression.interval_s, causes)
    gauges = gauge_agreement(signals, inputs.fired.rig, regression.interval_s)
    known = known_forces(signals, inputs.fired, regression, causes)
    rows, priors = ((), ()) if late is None else ((late.rows,), (late.prior,))
    return Beside(
        tuple(causes),
        frames,
        (*rows, *gauges.rows, *known.rows),
        (*priors, *gauges.priors, *known.priors),
        (*gauges.unknowns, *known.unknowns),
    )
