"""Generalized least squares of a camera track: rows made independent by a walk's Kalman filter, and priors.

The first unknown is 1/m, the second the position at rest; each further one may be restricted by its standard
uncertainty. Noise levels are those that make the positions likeliest.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.read_only import ReadOnlyArrays
from recoil_processing.shot.clocks.camera_track import CameraTrack

Array = NDArray[np.float64]

START = 1
"""Column of the position at rest."""
LIKELIER = 0.5
"""By which the log-likelihood must rise for a larger density."""
LEAST_MARKER_M = 1e-9
"""Noise of a marker; no camera is better."""
SIGMA_STEPS = 3
"""Steps of the marker's noise towards what its residuals call for; each one's error is a fraction of the one before."""


@dataclass(frozen=True, eq=False)
class ImpulseFit(ReadOnlyArrays):
    """Solution for one pair of noise levels, the unknowns scaled as the table's columns.

    Attributes
    ----------
    solution : ndarray, shape (n_unknowns,)
    covariance : ndarray, shape (n_unknowns, n_unknowns)
    u_by_rows
        Standard uncertainty of the first unknown by the positions' errors alone.
    residuals : ndarray, shape (n_rows,)
        Over the marker's noise.
    sigma, density
        Marker's noise, m, and the walk's density, (m/s^2)^2/Hz.
    log_likelihood
        Up to a constant.
    """

    solution: Array
    covariance: Array
    u_by_rows: float
    residuals: Array
    sigma: float
    density: float
    log_likelihood: float

    @classmethod
    def of(cls, track: CameraTrack, table: Array, priors: Array, sigma: float, density: float) -> ImpulseFit:
        """Solve for one pair of noise levels.

        Parameters
        ----------
        table : ndarray, shape (n, n_unknowns + 1)
            Columns of the unknowns, and the positions as the last.
        priors : ndarray, shape (n_unknowns,)
            Standard uncertainties, in the columns' scale; infinite where nothing was known.
        """
        rows, log_determinant = track.whiten(table, density / sigma**2)
        rows /= sigma
        rest = np.zeros((1, table.shape[1]))
        if track.rest_frames:
            weight = math.sqrt(track.rest_frames) / sigma
            # the column of ones was scaled with the others
            rest[0, START] = weight * float(table[0, START])
            rest[0, -1] = weight * track.rest_m
        known = np.zeros((priors.size, table.shape[1]))
        known[:, :-1] = np.diag(np.where(np.isfinite(priors), 1.0 / np.where(priors > 0, priors, 1.0), 0.0))
        full = np.vstack([rows, rest, known])
        design, target = full[:, :-1], full[:, -1]
        # what is known far better than the camera track shows must not hide the rest from the pseudo-inverse
        size = np.sqrt((design**2).sum(axis=0))
        inverse = np.linalg.pinv(design / size) / size[:, np.newaxis]
        solution = inverse @ target
        residuals = (target - design @ solution)[: rows.shape[0]]
        u_by_rows = float(np.linalg.norm(inverse[0, : rows.shape[0] + 1]))
        misfit = float(residuals @ residuals) + log_determinant + 2.0 * rows.shape[0] * math.log(sigma)
        return cls(solution, inverse @ inverse.T, u_by_rows, residuals, sigma, density, -0.5 * misfit)

    @classmethod
    def likeliest(
        cls,
        track: CameraTrack,
        table: Array,
        priors: Array,
        sigma: float,
        densities: Sequence[float],
        least_sigma: float = LEAST_MARKER_M,
    ) -> ImpulseFit:
        """Find the marker's noise for each density of the walk, and the density that makes the positions likeliest.

        Parameters
        ----------
        track, table, priors
            As of `of`.
        sigma
            A first guess of the marker's noise.
        densities
            Rising.
        least_sigma
            What the marker's noise is never taken to be better than.

        Raises
        ------
        ValueError
            If there is no density.
        """
        best: ImpulseFit | None = None
        for density in densities:
            tried = cls.of(track, table, priors, sigma, density)
            for _ in range(SIGMA_STEPS):
                freedom = max(tried.residuals.size - tried.solution.size, 1)
                own = tried.sigma * math.sqrt(float(tried.residuals @ tried.residuals) / freedom)
                tried = cls.of(track, table, priors, max(own, least_sigma), density)
            if best is not None and tried.log_likelihood <= best.log_likelihood + LIKELIER:
                break
            best, sigma = tried, tried.sigma
        if best is None:
            raise ValueError("there must be a density to try")
        return best
