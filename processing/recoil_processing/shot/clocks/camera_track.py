"""A camera's positions of a recoil: parted at the release, without the frames that contradict their neighbours."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_processing.alignment.velocity_walk import WalkFilter
from recoil_processing.arguments import require_alike, require_increasing
from recoil_processing.double_integral import DoubleIntegral
from recoil_processing.noise import noise_sigma
from recoil_processing.outliers import contradicting

LEAST_FRAMES = 30
"""Frames of the motion: fewer hardly identify a mass beside two noise levels."""


@dataclass(frozen=True, eq=False)
class CameraTrack(ReadOnlyArrays):
    """A camera's positions, parted at the release.

    Attributes
    ----------
    times_s, positions_m : ndarray, shape (n,)
        Frames of the motion that have a position and agree with their neighbours, on the force's clock.
    rest_m
        Mean of the frames before the release; NaN without any.
    set_aside
        Frames that contradict their neighbours.
    """

    times_s: Array
    positions_m: Array
    release_s: float
    rest_m: float
    rest_frames: int
    set_aside: int

    @classmethod
    def of(
        cls, frame_times_s: Array, displacement_m: Array, release_s: float, end_s: float, rough: DoubleIntegral
    ) -> CameraTrack:
        """Take the frames up to the end of the interval.

        Parameters
        ----------
        frame_times_s, displacement_m : ndarray, shape (n_frames,)
            Times, strictly increasing, and displacement; lost frames are NaN.
        rough
            Rough acceleration of the motion, to see which frames contradict their neighbours.

        Raises
        ------
        ValueError
            If shapes do not fit or frames do not increase.
        IdentificationError
            If too few frames saw the motion.
        """
        require_alike(frame_times_s=frame_times_s, displacement_m=displacement_m)
        require_increasing(frame_times_s=frame_times_s)
        seen = np.isfinite(displacement_m) & rough.covers(frame_times_s) & (frame_times_s <= end_s)
        t, x = frame_times_s[seen], displacement_m[seen]
        if np.count_nonzero(t >= release_s) < LEAST_FRAMES:
            raise IdentificationError(
                f"only {np.count_nonzero(t >= release_s)} frames saw the recoil",
                expected=f"at least {LEAST_FRAMES} with a position, on a clock that could be aligned",
                remedy="check the track and the camera's alignment",
            )
        sigma = noise_sigma(x)
        set_aside = 0
        if sigma > 0:
            odd = contradicting(t, x, x - rough.at(t)[0], sigma)
            t, x, set_aside = t[~odd], x[~odd], int(np.count_nonzero(odd))
        moving = t >= release_s
        rest = x[~moving]
        mean = float(rest.mean()) if rest.size else math.nan
        return cls(t[moving], x[moving], release_s, mean, int(rest.size), set_aside)

    def whiten(self, columns: Array, density_ratio: float) -> tuple[Array, float]:
        """Make rows independent, of variance 1 in units of the marker's.

        Parameters
        ----------
        columns : ndarray, shape (n, n_columns)
        density_ratio
            Density of the walk over the marker's variance, 1/s^3.

        Returns
        -------
        rows : ndarray, shape (n, n_columns)
        log_determinant : float
            Logarithm of the determinant of the noise's covariance, in units of the marker's variance.
        """
        walk = WalkFilter.design(self.times_s, 1.0, density_ratio)
        return walk.whiten(columns), walk.log_determinant
