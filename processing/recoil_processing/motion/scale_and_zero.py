"""Scale and zero of an accelerometer as a camera that saw the same motion identifies them.

With the clocks aligned, the camera's positions are linear in what is not known:

    z_i = k [D(t_i) + V(t_i) tau - b t_i^2/2 - sum_j s_j S_j(t_i)] + c0 + c1 t_i + w_i + n_i,

with D and V the double and single integral of what the accelerometer reads, tau what is left of the clocks'
offset, b its zero's error throughout, S_j the double integral of a shape in which the zero may have shifted, n
the marker's white noise and w the walk that the accelerometer's noise integrates to, which is whitened
as when the clocks are aligned (`recoil_processing.alignment.motion_alignment`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_processing.alignment.velocity_walk import WalkFilter
from recoil_processing.arguments import require_alike, require_positive
from recoil_processing.double_integral import DoubleIntegral
from recoil_processing.outliers import contradicting

LEAST_FRAMES = 50
"""Number of frames below which scale, zero and shifts are not identifiable."""
LEAST_INDEPENDENCE = 1e-9
"""Smallest sine of the angle between a column and the others."""
_ZERO = 4
"""Column of the zero's error; those of the shifts follow."""


@dataclass(frozen=True, eq=False)
class ScaleAndZero(ReadOnlyArrays):
    """Scale and zero of an accelerometer by the camera.

    Attributes
    ----------
    gain
        k, camera's scale over the accelerometer's.
    bias_m_s2
        b, in the accelerometer's scale.
    shifts_m_s2 : ndarray, shape (n_shifts,)
        s_j.
    covariance : ndarray, shape (2 + n_shifts, 2 + n_shifts)
        Covariance of gain, bias and shifts; never less than the residuals call for.
    density
        Density of the accelerometer's noise that the positions were whitened with, (m/s^2)^2/Hz, two-sided.
    misfit
        Sum of the squared whitened residuals and the logarithm of the noise's determinant: twice the negative
        log-likelihood up to a constant.
    innovation_statistic
        Mean squared whitened residual; 1 if model and noise levels fit.
    """

    gain: float
    bias_m_s2: float
    shifts_m_s2: Array
    covariance: Array
    density: float
    misfit: float
    innovation_statistic: float


@dataclass(frozen=True, eq=False)
class CameraMotion(ReadOnlyArrays):
    """A motion that a camera saw and an accelerometer felt, on one clock.

    Attributes
    ----------
    times_s, positions_m : ndarray, shape (n_frames,)
        Frames with a position, on the accelerometer's clock, within its record.
    integral
        Integral of what the accelerometer reads.
    marker_variance
        Variance of the camera's white noise, m^2.
    u_offset_s
        Standard uncertainty of the clocks' offset.
    u_bias_m_s2
        Standard uncertainty of the accelerometer's zero from the pre-trigger baseline; infinite if
        there was none.
    """

    times_s: Array
    positions_m: Array
    integral: DoubleIntegral
    marker_variance: float
    u_offset_s: float
    u_bias_m_s2: float

    def whitened(self, shapes: Array, density: float) -> WhitenedTrack | None:
        """Whiten positions and columns once for all choices among some shapes.

        Parameters
        ----------
        shapes : ndarray, shape (n_samples, n_shapes)
            Shapes in which the zero may have shifted, at the accelerometer's samples.
        density
            Density of the accelerometer's noise, (m/s^2)^2/Hz, two-sided.

        Returns
        -------
        WhitenedTrack or None
            Whitened track; None where too few frames are there.
        """
        t = self.times_s
        if t.size < LEAST_FRAMES:
            return None
        walk = WalkFilter.design(t, self.marker_variance, density)
        travel, velocity = self.integral.at(t)
        start_s, step_s = self.integral.start_s, self.integral.step_s
        since = t - start_s
        shifted = [DoubleIntegral.of(shape, start_s, step_s).at(t)[0] for shape in shapes.T]
        columns = [travel, velocity, np.ones_like(t), since, -0.5 * since**2, *(-s for s in shifted), self.positions_m]
        rows = walk.whiten(np.column_stack(columns))
        # the triangle holds all that least squares on any of the columns needs
        triangle = np.asarray(np.linalg.qr(rows, mode="r"))
        return WhitenedTrack(triangle, t.size, walk.log_determinant, density, self.u_offset_s, self.u_bias_m_s2)

    def solve(self, shapes: Array, density: float) -> ScaleAndZero | None:
        """Find scale, zero and shifts of all shapes; parameters as of `whitened`.

        Returns
        -------
        ScaleAndZero or None
            Scale, zero and shifts; None where too few frames are there or the columns are not independent.
        """
        track = self.whitened(shapes, density)
        return None if track is None else track.solve(range(shapes.shape[1]))

    def likeliest(self, shapes: Array, chosen: Sequence[int], densities: Sequence[float]) -> WhitenedTrack | None:
        """Whiten with the density that makes the positions likeliest if the zero shifted in the chosen shapes.

        Parameters
        ----------
        shapes : ndarray, shape (n_samples, n_shapes)
        densities
            Densities, rising; the search ends where the likelihood falls.
        """
        best: tuple[float, WhitenedTrack] | None = None
        for density in densities:
            track = self.whitened(shapes, density)
            found = None if track is None else track.solve(chosen)
            if track is None or found is None:
                continue
            if best is not None and found.misfit >= best[0]:
                break
            best = found.misfit, track
        return None if best is None else best[1]


@dataclass(frozen=True, eq=False)
class WhitenedTrack(ReadOnlyArrays):
    """Positions and columns of a camera's motion in rows of independent errors, as the triangle of their factorisation.

    Attributes
    ----------
    triangle : ndarray, shape (n_columns, n_columns)
        Triangle of the columns travel, velocity, 1, t, -t^2/2, shapes and positions.
    log_determinant
        Logarithm of the determinant of the noise's covariance.
    density, u_offset_s, u_bias_m_s2
        Figures of the same names in `CameraMotion`.
    """

    triangle: Array
    frames: int
    log_determinant: float
    density: float
    u_offset_s: float
    u_bias_m_s2: float

    def solve(self, chosen: Sequence[int]) -> ScaleAndZero | None:
        """Find scale, zero and the shifts of some of the shapes; None where the columns are not independent.

        Parameters
        ----------
        chosen
            Numbers of the shapes.
        """
        columns = [0, *range(1, _ZERO), _ZERO, *(_ZERO + 1 + j for j in chosen)]
        design, target = self.triangle[:, columns], self.triangle[:, -1]
        gain = float(np.linalg.lstsq(design, target, rcond=None)[0][0])
        # the offset and the zero before the motion are known already, each as well as it is
        prior = np.zeros((2, len(columns)))
        prior[0, 1] = 1.0 / max(abs(gain) * self.u_offset_s, 1e-12)
        prior[1, _ZERO] = 1.0 / max(abs(gain) * self.u_bias_m_s2, 1e-12)
        full, values = np.vstack([design, prior]), np.append(target, [0.0, 0.0])
        scale = np.sqrt((full**2).sum(axis=0))
        if not np.all(scale > 0):
            return None
        q, r = np.linalg.qr(full / scale)
        if not np.abs(np.diag(r)).min() > LEAST_INDEPENDENCE:
            return None
        inverse = np.linalg.inv(r)
        solution = inverse @ (q.T @ values) / scale
        residual = values - full @ solution
        statistic = float(residual[:-2] @ residual[:-2]) / self.frames
        wanted = [0, *range(_ZERO, len(columns))]
        covariance = (inverse @ inverse.T / np.outer(scale, scale))[np.ix_(wanted, wanted)] * max(1.0, statistic)
        gain, products = float(solution[0]), solution[_ZERO:]
        # the columns' coefficients are gain times zero: derivatives of zero = product / gain
        change = np.diag(np.append(1.0, np.full(products.size, 1.0 / gain)))
        change[1:, 0] = -products / gain**2
        zeros = products / gain
        return ScaleAndZero(
            gain=gain,
            bias_m_s2=float(zeros[0]),
            shifts_m_s2=np.asarray(zeros[1:]),
            covariance=change @ covariance @ change.T,
            density=self.density,
            misfit=float(residual @ residual) + self.log_determinant,
            innovation_statistic=statistic,
        )


def camera_motion(
    frame_times_s: Array,
    positions_m: Array,
    integral: DoubleIntegral,
    *,
    gain: float,
    marker_sigma_m: float,
    u_offset_s: float,
    u_bias_m_s2: float,
) -> CameraMotion:
    """Take the frames that have a position, lie within the accelerometer's record and agree with their neighbours.

    Parameters
    ----------
    frame_times_s, positions_m : ndarray, shape (n,)
        Times on the accelerometer's clock, strictly increasing, and positions; lost frames are NaN.
    gain
        Camera's scale over the accelerometer's, roughly.
    u_offset_s, u_bias_m_s2
        Figures of the same names in `CameraMotion`.

    Raises
    ------
    ValueError
        If shapes do not fit, or the marker's noise is not positive.
    """
    require_alike(frame_times_s=frame_times_s, positions_m=positions_m)
    require_positive(marker_sigma_m=marker_sigma_m)
    seen = np.isfinite(positions_m) & integral.covers(frame_times_s)
    t, z = frame_times_s[seen], positions_m[seen]
    odd = contradicting(t, z, z - gain * integral.at(t)[0], marker_sigma_m)
    return CameraMotion(t[~odd], z[~odd], integral, marker_sigma_m**2, u_offset_s, u_bias_m_s2)
