"""How a shot's mass was found, whatever measured the motion: what every method hands on to the same result."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.channel import Channel
from recoil_acquisition.read_only import ReadOnlyArrays
from recoil_acquisition.remark import Note
from recoil_identification.calibration.calibration import Calibration
from recoil_identification.calibration.skew import RecorderSkew
from recoil_identification.calibration.zero_shift import ZeroShift
from recoil_identification.estimate.mass import MassEstimate
from recoil_identification.rows.tracked_recoil import TrackedRecoil
from recoil_identification.shot.filter_choice import FilterChoice
from recoil_identification.shot.identified import Method
from recoil_processing.filters import LowPass
from recoil_processing.motion.fusion import FusedMotion
from recoil_processing.shot.regression import Regression
from recoil_processing.shot.signals import Signals

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Route(ReadOnlyArrays):
    """Signals, the rows of the motion, and what was inferred of them.

    Attributes are those of `recoil_identification.shot.identified.Identification`, and

    Attributes
    ----------
    estimates
        Masses by method, the asked one among them.
    regressions
        Rows of each, for its trace over time.
    notes
        On methods that gave none, and on the filter.
    tracked
        The camera's track, where it is in the place of an accelerometer on the recoiling part; zero shift and skew are
        None then.
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
    mass_low_pass: LowPass
    calibration: Calibration
    estimates: Mapping[str, MassEstimate]
    regressions: Mapping[str, Regression]
    notes: tuple[Note, ...] = ()
    zero_shift: ZeroShift | None = None
    skew: RecorderSkew | None = None
    tracked: TrackedRecoil | None = None
