"""Camera and accelerometer together: travel, velocity and acceleration at the recorder's rate.

The camera saw z_i at frame times t_i; the accelerometer's double integral D has the motion's detail, but a
wrong zero, and what its noise integrates to. With the clocks aligned (`recoil_processing.alignment.motion_alignment`),

    z_i = k D(t_i) + c0 + c1 t_i + c2 t_i^2 / 2 + w(t_i) + n_i,        x(t) = z(t) - n.

Here k is the camera's scale over the accelerometer's, c0 to c2 are the integration constants and the
accelerometer's zero, w is the walk and n the marker's white noise. Walk and constants are estimated
jointly from all frames: the walk's smoother (`motion.walk_smoother`) whitens every column of the model,
the constants follow by least squares, and the smoothed columns make up the walk. The result is that of one
Kalman filter with Rauch-Tung-Striebel smoother whose state holds the constants too, as Smyth and Wu (2007,
Mech. Syst. Signal Process. 21(2)) use it, and it is exact at every instant between the frames.

What is not known of the clocks is held fixed while this is done, and its effect is added to the variance: by
the law of total variance, the sensitivity of the result to the clocks' offset times its uncertainty,
squared. In travel that is nearly velocity times uncertainty; in velocity it is much less than acceleration
times uncertainty, because the velocity's changes come from the accelerometer, on the recorder's own clock.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_processing.alignment.motion_solver import LIKELIER
from recoil_processing.arguments import (
    require_alike,
    require_finite,
    require_increasing,
    require_not_negative,
    require_positive,
)
from recoil_processing.double_integral import DoubleIntegral
from recoil_processing.motion.fusion_least_squares import solve_fusion
from recoil_processing.outliers import contradicting
from recoil_processing.repairs.bridged_gaps import bridge_errors

LEAST_FRAMES = 10
"""Number of frames below which the constants and a noise level are not identifiable."""


@dataclass(frozen=True, eq=False)
class FusedMotion(ReadOnlyArrays):
    """Travel and velocity on the recorder's clock, at its samples, in the camera's scale.

    Attributes
    ----------
    times_s : ndarray, shape (n,)
    position_m, velocity_m_s : ndarray, shape (n,)
    u_position_m, u_velocity_m_s : ndarray, shape (n,)
        Standard uncertainties: of the noises, the gain, the zero, the clocks and bridged samples. The camera's own
        scale is not in them: it is a factor to both.
    gain, u_gain
        k, camera's scale over the accelerometer's.
    bias_m_s2, u_bias_m_s2
        c2: what is added to the scaled acceleration.
    innovation_statistic
        Mean squared normalised innovation; 1 if model and noise levels fit.
    shift_s, u_shift_s
        Rest of the clocks' offset by the motion, to be added to the frames' times, and its standard uncertainty by the
        noises alone. It is not used: beyond a few uncertainties of both, the clocks are wrong.
    residual_m : ndarray, shape (n_frames,)
        Difference of camera and result, at the frames that were used.
    frames_set_aside
        Frames that contradict their neighbours.
    acceleration_density
        Noise density of the accelerometer that was found likeliest, (m/s^2)^2/Hz, two-sided.
    log_likelihood
        Log-likelihood of the positions, up to a constant.
    """

    times_s: Array
    position_m: Array
    velocity_m_s: Array
    u_position_m: Array
    u_velocity_m_s: Array
    gain: float
    u_gain: float
    bias_m_s2: float
    u_bias_m_s2: float
    innovation_statistic: float
    shift_s: float
    u_shift_s: float
    residual_m: Array
    frames_set_aside: int
    acceleration_density: float
    log_likelihood: float

    @property
    def rms_residual_m(self) -> float:
        """Root mean square of what the frames that were used are off the result."""
        return math.sqrt(float(np.mean(self.residual_m**2)))

    def shift_statistic(self, u_offset_s: float) -> float:
        """Return how many standard uncertainties the motion contradicts an offset known to `u_offset_s`."""
        return abs(self.shift_s) / math.hypot(self.u_shift_s, u_offset_s)


def fuse(
    frame_times_s: Array,
    displacement_m: Array,
    start_s: float,
    step_s: float,
    acceleration_m_s2: Array,
    *,
    marker_sigma_m: float,
    acceleration_density: float | Sequence[float],
    u_offset_s: float = 0.0,
    u_drift: float = 0.0,
    bridged: Flags | None = None,
) -> FusedMotion | str:
    """Fuse a camera's displacement with an accelerometer's record of the same motion.

    Parameters
    ----------
    frame_times_s : ndarray, shape (n_frames,)
        Times mapped to the recorder's clock, strictly increasing.
    displacement_m : ndarray, shape (n_frames,)
        Displacement; lost frames are NaN: they are left out, not filled. Single frames that contradict their neighbours
        are left out too.
    start_s, step_s
        Time base of the acceleration.
    acceleration_m_s2 : ndarray, shape (n,)
        Second derivative of the displacement, positive alike; lost samples bridged.
    marker_sigma_m
        White noise of the displacement.
    acceleration_density
        Density of the accelerometer's noise, (m/s^2)^2/Hz, two-sided; of several, rising, the likeliest is taken.
    u_offset_s
        Standard uncertainty of the mapped times in the middle of the motion.
    u_drift
        Standard uncertainty of the clocks' rate ratio.
    bridged : ndarray of bool, shape (n,), optional
        Samples of the acceleration that are bridges across lost ones. The motion there is taken to be as
        uncertain as bridges of the same length are wrong nearby, and is marked.

    Returns
    -------
    FusedMotion or str
        A sentence where the frames do not identify the constants.

    Raises
    ------
    ValueError
        If shapes do not fit, frames do not increase, the acceleration is not finite, a noise level is not positive
        or an uncertainty is negative.
    """
    lost = np.zeros(acceleration_m_s2.shape, dtype=bool) if bridged is None else bridged
    densities = [acceleration_density] if isinstance(acceleration_density, float | int) else [*acceleration_density]
    require_alike(frame_times_s=frame_times_s, displacement_m=displacement_m)
    require_alike(acceleration_m_s2=acceleration_m_s2, bridged=lost)
    require_increasing(frame_times_s=frame_times_s)
    require_finite(acceleration_m_s2=acceleration_m_s2)
    if acceleration_m_s2.size < 2 or not densities:
        raise ValueError("there must be two samples of the acceleration, and a noise density to try")
    require_positive(step_s=step_s, marker_sigma_m=marker_sigma_m)
    require_positive(acceleration_density=min(densities), largest_density=max(densities))
    require_not_negative(u_offset_s=u_offset_s, u_drift=u_drift)
    integral = DoubleIntegral.of(acceleration_m_s2, start_s, step_s)
    inside = np.isfinite(displacement_m) & integral.covers(frame_times_s)
    t, z = frame_times_s[inside], displacement_m[inside]
    odd = _contradicting(t, z, integral.at(t)[0], marker_sigma_m)
    t, z = t[~odd], z[~odd]
    if t.size < LEAST_FRAMES:
        return f"only {t.size} frames with a position fall into the recorder's record; {LEAST_FRAMES} are needed"
    gaps = bridge_errors(acceleration_m_s2, lost, step_s)
    density = densities[0]
    found = solve_fusion(t, z, integral, gaps, marker_sigma_m**2, density)
    if found is None:
        return "the motion that both records show cannot be distinguished from an error of zero or velocity"
    for candidate in densities[1:]:
        tried = solve_fusion(t, z, integral, gaps, marker_sigma_m**2, candidate)
        if tried is None or tried.log_likelihood <= found.log_likelihood + LIKELIER:
            break
        found, density = tried, candidate
    times: Array = np.asarray(start_s + step_s * np.arange(acceleration_m_s2.size), dtype=np.float64)
    u_clock = np.array([u_offset_s, u_drift])
    x, v, var_x, var_v = found.state(times, integral.travel, integral.velocity, u_clock)
    gain, bias = float(found.constants[0]), float(found.constants[3])
    u_constants = np.sqrt(found.inflation * (found.factor**2).sum(axis=1))
    return FusedMotion(
        times_s=times,
        position_m=x,
        velocity_m_s=v,
        u_position_m=np.sqrt(var_x),
        u_velocity_m_s=np.sqrt(var_v),
        gain=gain,
        u_gain=float(u_constants[0]),
        bias_m_s2=bias,
        u_bias_m_s2=float(u_constants[3]),
        innovation_statistic=found.statistic,
        shift_s=found.shift_s,
        u_shift_s=found.u_shift_s,
        residual_m=found.residual(z, t, integral.at(t)[0]),
        frames_set_aside=int(odd.sum()),
        acceleration_density=density,
        log_likelihood=found.log_likelihood,
    )


def _contradicting(times_s: Array, positions_m: Array, travel: Array, sigma: float) -> Flags:
    """Find the frames that contradict their neighbours, given the accelerometer's travel, shape (n_frames,).

    What is left of a rough fit of gain and constants changes slowly; it does not matter between neighbours.
    """
    if times_s.size < LEAST_FRAMES:
        return np.zeros(times_s.shape, dtype=bool)
    since = times_s - times_s.mean()
    shapes = np.column_stack([travel, np.ones_like(since), since, 0.5 * since**2])
    scale = np.maximum(np.abs(shapes).max(axis=0), np.finfo(np.float64).tiny)
    residual = positions_m - shapes / scale @ np.linalg.lstsq(shapes / scale, positions_m, rcond=None)[0]
    return contradicting(times_s, positions_m, residual, sigma)
