"""One method's mass with its trace over time and its RPE."""

from __future__ import annotations

import math
from typing import Literal

from recoil_identification.calibration.calibration import Calibration
from recoil_identification.calibration.trace import LARGEST_RELATIVE_U, mass_trace, reached
from recoil_identification.estimate.mass import RANDOM, MassEstimate
from recoil_identification.estimate.rpe import relative_percentage_error, rpe_interval
from recoil_identification.shot.identified import Result
from recoil_processing.shot.regression import Regression
from recoil_rigs.rig import Rig

CORRECTED = ("calibrated", "camera")
"""Methods whose trace is by both sides of the equation of motion with the sensors' errors taken off."""
OWN_TRACE = (*CORRECTED, "reverse", "forward", "paper", "kinematic")
"""Methods that a sliding window can follow; the trace beside the others is that of ``reverse``, none of theirs."""


def method_result(
    estimate: MassEstimate, regression: Regression, calibration: Calibration, window_s: float, rig: Rig
) -> Result:
    """Trace a mass over time, and compare it with the specification.

    Parameters
    ----------
    regression
        Rows of the estimate.
    calibration
        Calibration for the methods of `CORRECTED`.
    window_s
        Memory of the trace.
    """
    systematic = common = math.hypot(*(r.u_kg for r in estimate.budget if r.source != RANDOM)) / estimate.mass_kg
    left = None
    if estimate.method in CORRECTED:
        acceleration, force = calibration.correct(regression)
        # what the sensors' errors do differs from window to window
        left = calibration.errors_left(regression, reached(regression, window_s))
        sensors = {row.source for row in calibration.estimate.budget}
        common = math.hypot(0.0, *(r.u_kg for r in estimate.budget if r.source not in sensors)) / estimate.mass_kg
    else:
        acceleration, force = regression.acceleration_m_s2, regression.force_n
    direction: Literal["reverse", "forward"] = "forward" if estimate.method in ("forward", "paper") else "reverse"
    guard = math.inf if estimate.method == "paper" else LARGEST_RELATIVE_U
    trace = mass_trace(
        regression,
        acceleration,
        force,
        window_s,
        direction=direction,
        systematic_rel=common,
        errors_m_s2=left,
        largest_relative_u=guard,
    )
    if estimate.method not in OWN_TRACE:
        return Result(estimate, trace, math.nan, (math.nan, math.nan))
    specification = rig.specification
    return Result(
        estimate,
        trace,
        relative_percentage_error(trace.mass_kg, specification.mass_kg),
        rpe_interval(trace.mass_kg, specification.mass_kg, systematic, specification.u_kg),
    )
