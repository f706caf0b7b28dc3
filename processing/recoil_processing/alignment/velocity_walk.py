"""A random walk of the velocity, seen through noisy positions: what an accelerometer's white noise integrates to.

State ``[w, w']`` from zero at the first instant. Over a step h the walk's covariance grows by
``density * [[h^3/3, h^2/2], [h^2/2, h]]`` (Bar-Shalom, Li, Kirubarajan 2001, Estimation with
Applications to Tracking and Navigation, section 6.2.2, continuous white noise acceleration); a
position with white noise then corrects it (Kalman 1960, J. Basic Eng. 82(1)). Gains and variances depend on
the instants and on the two noise levels alone, so that one pass serves any number of series.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_processing.arguments import require_increasing, require_positive


@dataclass(frozen=True, eq=False)
class WalkFilter(ReadOnlyArrays):
    """Gains and variances of the Kalman filter of a walk, at given instants.

    Attributes
    ----------
    steps_s : ndarray, shape (n,)
        Time since the instant before; 0 for the first.
    gains : ndarray, shape (n, 2)
        Gains of position and velocity, per metre of innovation.
    variances : ndarray, shape (n,)
        Variances of the innovations, m^2.
    """

    steps_s: Array
    gains: Array
    variances: Array

    @classmethod
    def design(cls, times_s: Array, marker_variance: float, density: float) -> WalkFilter:
        """Find gains and variances.

        Parameters
        ----------
        times_s : ndarray, shape (n,)
            Times, strictly increasing, at least one.
        marker_variance
            Variance of the positions' white noise, m^2.
        density
            Density of the acceleration that drives the walk, (m/s^2)^2/Hz, two-sided.

        Raises
        ------
        ValueError
            If there are no instants, they do not increase, or a noise level is not positive and finite.
        """
        if times_s.size == 0:
            raise ValueError("there are no instants")
        require_increasing(times_s=times_s)
        require_positive(marker_variance=marker_variance, density=density)
        steps = np.diff(times_s, prepend=times_s[0])
        return cls(steps, *_gains_and_variances(steps.tobytes(), marker_variance, density))

    @property
    def log_determinant(self) -> float:
        """Sum of the logarithms of the innovations' variances."""
        return float(np.log(self.variances).sum())

    def whiten(self, columns: Array) -> Array:
        """Turn columns whose errors are marker noise plus a walk into independent rows of unit variance.

        Parameters
        ----------
        columns : ndarray, shape (n, n_columns)

        Returns
        -------
        ndarray, shape (n, n_columns)
            Normalised innovations of every column.
        """
        from scipy.linalg.lapack import dtbtrs

        h, (g0, g1) = self.steps_s[1:], self.gains[:-1].T
        # column by column, as it is solved: LAPACK would copy it otherwise
        driven = np.zeros((2 * self.steps_s.size, columns.shape[1]), order="F")
        driven[2::2] = (g0 + h * g1)[:, None] * columns[:-1]
        driven[3::2] = g1[:, None] * columns[:-1]
        states, _ = dtbtrs(self._recursion(), driven, uplo="L", diag="U", overwrite_b=True)
        return np.asarray((columns - states[0::2]) / np.sqrt(self.variances)[:, None])

    def whiten_transposed(self, rows: Array) -> Array:
        """Apply the transpose of `whiten`: its product with a column is that of the rows with the whitened column.

        Parameters
        ----------
        rows : ndarray, shape (n, n_columns)

        Returns
        -------
        ndarray, shape (n, n_columns)
        """
        from scipy.linalg.lapack import dtbtrs

        h, (g0, g1) = self.steps_s[1:], self.gains[:-1].T
        normalised = rows / np.sqrt(self.variances)[:, None]
        seen = np.zeros((2 * self.steps_s.size, rows.shape[1]), order="F")
        seen[0::2] = normalised
        back, _ = dtbtrs(self._recursion(), seen, uplo="L", trans="T", diag="U", overwrite_b=True)
        normalised[:-1] -= (g0 + h * g1)[:, None] * back[2::2] + g1[:, None] * back[3::2]
        return np.asarray(normalised)

    def tail_energies(self, column: Array) -> Array:
        """Squared length of a whitened column of which only the part from each instant on is there.

        The sum of squared innovations from an instant on is a quadratic form of the state there,
        ``s' P s + 2 b' s + c``, found backwards as the cost of a linear-quadratic problem is; the state
        before a tail is zero, so c is what is asked for.

        Parameters
        ----------
        column : ndarray, shape (n,)

        Returns
        -------
        ndarray, shape (n,)
            Energy, at i, of the column with zeros before i.
        """
        from scipy.linalg.lapack import dtbtrs

        forms, drives = self._tail_forms, self._drives
        weights = 1.0 / self.variances
        u = np.column_stack(
            [
                forms[:, 0] * drives[:, 0] + forms[:, 1] * drives[:, 1],
                forms[:, 1] * drives[:, 0] + forms[:, 2] * drives[:, 1],
            ]
        )
        h, (g0, g1) = self.steps_s[1:], self.gains[:-1].T
        from_state = np.zeros((self.steps_s.size, 2))
        v = column[:-1, None] * u[:-1]
        from_state[:-1, 0] = (1.0 - g0 - h * g1) * v[:, 0] - g1 * v[:, 1]
        from_state[:-1, 1] = h * v[:, 0] + v[:, 1]
        from_state[:, 0] -= weights * column
        states, _ = dtbtrs(self._recursion(), from_state.reshape(-1, 1), uplo="L", trans="T", diag="U")
        behind = np.zeros((self.steps_s.size, 2))
        behind[:-1] = states.reshape(-1, 2)[1:]
        added = column * (column * (weights + (drives * u).sum(axis=1)) + 2.0 * (behind * drives).sum(axis=1))
        return np.asarray(np.cumsum(added[::-1])[::-1])

    @property
    def _drives(self) -> Array:
        """Contributions of a column of one to the state behind each instant, shape (n, 2): ``[g0 + h g1, g1]``."""
        after = np.append(self.steps_s[1:], 0.0)
        return np.column_stack([self.gains[:, 0] + after * self.gains[:, 1], self.gains[:, 1]])

    @cached_property
    def _tail_forms(self) -> Array:
        """Quadratic form of the state behind each instant in the energy from there on, shape (n, 3)."""
        after = np.append(self.steps_s[1:], 0.0)
        weights = 1.0 / self.variances
        forms, p00, p01, p11 = [], 0.0, 0.0, 0.0
        for h, g0, g1, weight in np.column_stack([after, self.gains, weights])[::-1].tolist():
            forms.append((p00, p01, p11))
            keep = 1.0 - g0 - h * g1
            w0, w1 = p00 * keep - p01 * g1, p01 * keep - p11 * g1
            p11 += h * (2.0 * p01 + h * p00)
            p01 = h * w0 + w1
            p00 = keep * w0 - g1 * w1 + weight
        return np.array(forms)[::-1]

    def _recursion(self) -> Array:
        """Lower band of the recursion of the predicted states ``w_0 w'_0 w_1 w'_1 ...``, each from the pair before."""
        h, (g0, g1) = self.steps_s[1:], self.gains[:-1].T
        band = np.zeros((4, 2 * self.steps_s.size))
        band[0] = 1.0
        band[2, 0:-2:2] = -(1.0 - g0 - h * g1)
        band[1, 1:-2:2] = -h
        band[3, 0:-2:2] = g1
        band[2, 1:-2:2] = -1.0
        return band


@lru_cache(maxsize=32)
def _gains_and_variances(steps: bytes, marker_variance: float, density: float) -> tuple[Array, Array]:
    """Run the filter's covariance through the steps; kept, as fits that begin alike ask for the same again."""
    steps_s = np.frombuffer(steps)
    predicted = []
    p00 = p01 = p11 = 0.0
    # what the walk adds over each step; the loop does only what needs the step before
    added = (density * steps_s**3 / 3, density * steps_s**2 / 2, density * steps_s)
    for h, a00, a01, a11 in zip(steps_s.tolist(), *(a.tolist() for a in added), strict=True):
        p00 += h * (2 * p01 + h * p11) + a00
        p01 += h * p11 + a01
        p11 += a11
        predicted.append((p00, p01, p11))
        s = p00 + marker_variance
        # marker_variance / s is 1 - p00 / s without the cancellation where the walk outgrows the marker's noise
        left = marker_variance / s
        p11 -= p01 / s * p01
        p00 *= left
        p01 *= left
    before = np.array(predicted)
    variances = before[:, 0] + marker_variance
    return before[:, :2] / variances[:, None], variances
