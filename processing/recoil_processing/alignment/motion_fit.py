"""Result of aligning a camera with an accelerometer by their motion."""

from __future__ import annotations

import math
from dataclasses import dataclass

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_processing.alignment.frame_fault import FrameFault


@dataclass(frozen=True, eq=False)
class MotionFit(ReadOnlyArrays):
    """The outcome of aligning a displacement with an acceleration.

    Attributes
    ----------
    offset_s, drift
        ``t_ref = (1 + drift) t_cam + offset_s``.
    u_offset_s
        Standard uncertainty of the mapped time in the middle of the motion.
    gain, u_gain
        Camera scale over accelerometer scale, and its standard uncertainty.
    u_bias_m_s2
        Standard uncertainty of c2, and but for the gain of `bias_m_s2`.
    gain_bias_correlation
        Correlation of the estimates of gain and c2.
    integration_constants
        c0 in m, c1 in m/s, c2 in m/s^2, on the *camera's* time counted from `origin_s`.
    origin_s
        Camera time that c0 to c2 count from.
    marker_sigma_m
        Noise of the marker, from its third differences.
    acceleration_density
        Noise density of the accelerometer that explains the record, (m/s^2)^2/Hz, two-sided.
    innovation_statistic
        Mean squared normalised residual; 1 if model and noise levels fit.
    coarse_offset_s
        Offset by the velocity correlation.
    correlation
        Peak of that correlation, 1 at the most.
    second_peak
        Highest correlation outside that peak.
    at_search_edge
        Whether that peak lies at the first or the last lag possible.
    candidates_s, log_likelihood : ndarray, shape (n_candidates,)
        Offsets around the best one, and their log-likelihood less its maximum.
    free_drift, u_free_drift
        Drift that the record would choose without its prior, and its standard uncertainty: far off, the frame rate is
        wrong.
    frames, frames_set_aside
        Numbers of frames that were used, and that were not because they contradict their neighbours.
    converged
        Whether the last step towards the offset was negligible.
    drift_allowance
        Standard uncertainty of the drift before the record was seen.
    velocity_offset_s, u_velocity_offset_s
        Offset by velocities alone, the drift being the same, and the standard uncertainty of the mapped time in the
        middle of the motion by them; NaN and infinity where they show nothing.
    frame_faults
        Places from which on the file's times are wrong by a frame period, or its positions by a jump; the other
        figures are those of the file as it is.
    best_log_likelihood
        Log-likelihood at the fit, up to a constant of the record.
    shifted_zero_m_s2
        Shift of the accelerometer's zero at the shot; None where the record is explained without it.
    corrected
        The fit to the times that `recoil_processing.alignment.frame_fault.correct_times` gives, and without the jump.
    """

    offset_s: float
    drift: float
    u_offset_s: float
    u_drift: float
    gain: float
    u_gain: float
    u_bias_m_s2: float
    gain_bias_correlation: float
    integration_constants: tuple[float, float, float]
    origin_s: float
    marker_sigma_m: float
    acceleration_density: float
    innovation_statistic: float
    coarse_offset_s: float
    correlation: float
    second_peak: float
    at_search_edge: bool
    candidates_s: Array
    log_likelihood: Array
    free_drift: float
    u_free_drift: float
    frames: int
    frames_set_aside: int
    converged: bool
    drift_allowance: float = 5e-5
    velocity_offset_s: float = math.nan
    u_velocity_offset_s: float = math.inf
    best_log_likelihood: float = math.nan
    shifted_zero_m_s2: float | None = None
    frame_faults: tuple[FrameFault, ...] = ()
    corrected: MotionFit | None = None

    @property
    def bias_m_s2(self) -> float:
        """Reading of the accelerometer at rest, if the camera's travel is right: ``-c2 / gain``."""
        return -self.integration_constants[2] / self.gain

    @property
    def drift_earned(self) -> bool:
        """Whether the record knows the drift better than the clocks' quality does.

        If not, the prior holds it near zero within its allowance, which `u_drift` and `u_offset_s` contain.
        """
        return self.u_free_drift < self.drift_allowance

    @property
    def drift_departure(self) -> float:
        """Standard uncertainties between the drift that the record would choose and the one expected, zero.

        Its square is the likelihood ratio of a drift that is free and one that the allowance holds, twice.
        """
        return abs(self.free_drift) / math.hypot(self.u_free_drift, self.drift_allowance)
