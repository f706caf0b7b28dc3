"""How a shot's mass was found, whatever measured the motion: what every method hands on to the same result."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from recoil_acquisition.channel import Channel
from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_acquisition.remark import Note
from recoil_identification.calibration.calibration import Calibration
from recoil_identification.calibration.methods import Method
from recoil_identification.calibration.skew import RecorderSkew
from recoil_identification.calibration.zero_shift import ZeroShift
from recoil_identification.estimate.mass import MassEstimate
from recoil_identification.rows.tracked_recoil import TrackedRecoil
from recoil_identification.shot.filter_choice import FilterChoice
from recoil_processing.filters import LowPassFilter
from recoil_processing.motion.fusion import FusedMotion
from recoil_processing.shot.regression import Regression
from recoil_processing.shot.signals import Signals


@dataclass(frozen=True, eq=False)
class Route(ReadOnlyArrays):
    """Signals, the rows of the motion, and what was inferred of them.

    Attributes
    ----------
    method
        Method that gives the report's mass: the one asked for, else the default.
    signals
        Signals on one grid of the reference clock.
    camera
        Displacement on its own clock, without the delay of its chain; None where there is none.
    travel_m, velocity_m_s : ndarray, shape (n,)
        Motion of the recoiling part along the recoil.
    fused
        Motion by camera and accelerometers together, with its standard uncertainties; None where only one of them
        measured it.
    recorded, filtered, fitted
        Sides of the equation of motion as recorded, behind the low-pass, and behind that of the fit of the mass. Where
        the mass is the camera's no acceleration was recorded: it is zero as recorded, and by the camera behind the
        low-pass.
    filter_choice
        The low-pass, and why it was chosen.
    mass_low_pass
        Low-pass of the fit of the mass: the force's own band within the other.
    calibration
        Mass and sensors' errors found together.
    estimates
        Masses by method, the one of `method` among them.
    regressions
        Rows of each method, for its trace over time.
    notes
        Remarks on methods that gave no mass, and on the filter.
    zero_shift
        Shift of the recoil accelerometer's zero; None where the mass is the camera's.
    skew
        Delay between acceleration and force; None where the mass is the camera's.
    tracked
        The camera's track, where it is in the place of an accelerometer on the recoiling part; else None.
    """

    method: Method
    signals: Signals
    camera: Channel | None
    travel_m: Array
    velocity_m_s: Array
    fused: FusedMotion | None
    recorded: Regression
    filtered: Regression
    fitted: Regression
    filter_choice: FilterChoice
    mass_low_pass: LowPassFilter
    calibration: Calibration
    estimates: Mapping[str, MassEstimate]
    regressions: Mapping[str, Regression]
    notes: tuple[Note, ...] = ()
    zero_shift: ZeroShift | None = None
    skew: RecorderSkew | None = None
    tracked: TrackedRecoil | None = None
