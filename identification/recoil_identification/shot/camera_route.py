"""The mass by the camera: the kinematic route of the model, which checks the route by the accelerometer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from recoil_acquisition.channel import Channel
from recoil_acquisition.shot.shot import ClockAlignment
from recoil_identification.calibration.uncertainty import contributions
from recoil_identification.estimate.mass import ACCELERATION, MassEstimate, reverse_mass
from recoil_identification.rows.causes import causes_of
from recoil_identification.rows.sensor_priors import CAMERA_SCALE
from recoil_processing.filters import LowPassFilter
from recoil_processing.shot.error_source import ErrorSource, SourceKind
from recoil_processing.shot.kinematics import AngularMotion, kinematic_acceleration
from recoil_processing.shot.regression import Regression
from recoil_processing.shot.sensor_scales import ScaleUncertainty
from recoil_processing.shot.signals import Signals
from recoil_rigs.rig import Rig
from recoil_rigs.shots.fired_shot import FiredShot

LARGEST_CUTOFF_HZ = 100.0
"""Frame noise of 0.05 mm at 6000 frames/s is 25 m/s^2 of acceleration below 300 Hz, 1.6 m/s^2 below 100 Hz."""


def mass_by_camera(
    regression: Regression,
    recorded: Regression,
    signals: Signals,
    fired: FiredShot,
    camera: Channel,
    scales: ScaleUncertainty,
) -> MassEstimate:
    """Estimate the mass as `reverse_mass` does, with a' from the camera's displacement.

    Parameters
    ----------
    regression
        Regression of `regression_by_camera`.
    recorded
        Regression that gives the forces, before any filter.
    camera
        Displacement on its own clock.

    Raises
    ------
    IdentificationError
        If too few rows are left, or force and acceleration have nothing in common.
    """
    estimate = reverse_mass(regression, replace(scales, acceleration=camera.u_rel))
    budget = [replace(row, source=CAMERA_SCALE) if row.source == ACCELERATION else row for row in estimate.budget]
    causes = causes_of(regression, recorded, signals, fired, "recoil_displacement")
    own = ErrorSource(SourceKind.ALIGNMENT, camera.time_base.clock)
    budget += contributions(regression, [one for one in causes if np.any(one.forces_n) or one.source == own])
    return replace(estimate, method="kinematic", budget=tuple(budget))


def regression_by_camera(
    recorded: Regression,
    signals: Signals,
    motion: AngularMotion,
    rig: Rig,
    camera: Channel,
    alignment: ClockAlignment,
    low_pass: LowPassFilter,
    *,
    longest_gap_s: float = 0.0,
) -> Regression:
    """Put a' from the camera's displacement beside the forces, both behind one low-pass.

    Parameters
    ----------
    recorded
        Regression that gives the forces.
    signals, motion, rig
        Signals, motion and rig of the route by the accelerometer.
    camera
        Displacement on its own clock, without the delay of its chain.
    alignment
        Alignment of the camera's clock.
    low_pass
        A displacement that is differentiated twice needs a low cut-off, `LARGEST_CUTOFF_HZ` at the most: a higher one
        is lowered to it.
    longest_gap_s
        Longest gap of lost frames, s, that are bridged in any case.

    Raises
    ------
    IdentificationError
        If too few frames are left.
    """
    slow = low_pass.at(min(low_pass.cutoff_hz, LARGEST_CUTOFF_HZ))
    acceleration, made_of = kinematic_acceleration(
        signals, rig, motion, camera, alignment, slow, longest_gap_s=longest_gap_s
    )
    return recorded.filtered(slow).with_acceleration(acceleration, made_of)
