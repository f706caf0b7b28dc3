"""Whether one constant mass explains a shot, or a part of it let go.

``a = F'(1/m) + errors``: a mass that changes is a coefficient that changes. But so does a wrong sensor's: a
breech gauge that reads 1 % low makes the mass come out 1 % low as long as the breech force drives, and right while
the brake holds. What calibrations allow every sensor to be off is therefore a part of the model under test, with
its standard uncertainty as a prior; only what no such error explains counts against a constant mass.

Two tests are asked. The largest Wald statistic of one step, see `mass_step` beside this, is at its best against a
part that lets go at once; the cumulative sum of recursive residuals, see `recursive_residuals`, against
a mass that drifts. The sum of their squares tells whether the noise is the same throughout; a shot's is not, for
the stress waves die down, so the rows are weighted by a scatter that does so too.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.read_only import ReadOnlyArrays
from recoil_identification.constancy.mass_step import DRAWS, StepTest, step_test
from recoil_identification.constancy.recursive_residuals import (
    Cusum,
    cusum,
    cusum_of_squares,
    long_run_factor,
    recursive_residuals,
)
from recoil_identification.corrections import Corrections
from recoil_identification.mass import LEAST_ROWS
from recoil_processing.filters import filter_alike
from recoil_processing.shot.regression import Regression, spaced_rows
from recoil_processing.shot.sensor_scales import ScaleUncertainty

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

SMALLEST_RESIDUAL = 3e-4
"""Share of the acceleration's peak that rows are never taken to be better than."""
LARGEST_ROWS = 1200
"""More rows are thinned: the covariance of all of them is taken apart."""
DECAYS = (0.01, 0.02, 0.04, 0.08, 0.16)
"""Time constants in which the scatter's square may die down, shares of the rows' span."""


@dataclass(frozen=True, eq=False)
class MassConstancy(ReadOnlyArrays):
    """What a shot says of the constancy of its mass.

    Attributes
    ----------
    times_s : ndarray, shape (n,)
        Of the rows.
    sigma_m_s2 : ndarray, shape (n,)
        Standard deviation that each row's error was given, the correlation between rows included.
    drift
        Of the recursive residuals.
    scatter
        Of their squares: about the noise, not about the mass.
    mass_kg
        Before the step that fits best.
    change_kg, u_change_kg
        Size of that step, negative if something let go, and its standard uncertainty.
    """

    times_s: Array
    sigma_m_s2: Array
    step: StepTest
    drift: Cusum
    scatter: Cusum
    mass_kg: float
    change_kg: float
    u_change_kg: float

    @property
    def p_value(self) -> float:
        """Probability that a constant mass looks as variable to one of both tests, at most (Bonferroni)."""
        return min(1.0, 2 * min(self.step.p_value, self.drift.p_value))

    def constant(self, level: float = 0.05) -> bool:
        """Return whether nothing speaks against a constant mass at a level of significance."""
        return self.p_value > level

    def __str__(self) -> str:
        low, high = (1e3 * (t - self.times_s[0]) for t in self.step.interval_s)
        at = 1e3 * (self.step.instant_s - self.times_s[0])
        size = f"{self.change_kg:+.1f} kg (u {self.u_change_kg:.1f} kg)"
        if self.constant():
            return (
                f"One constant mass explains the shot (p = {self.p_value:.2g}); "
                f"the step that would fit best is {size} {at:.1f} ms after the first row."
            )
        if self.step.p_value <= self.drift.p_value:
            return (
                f"No constant mass explains the shot (p = {self.p_value:.2g}): a step of {size} "
                f"{at:.1f} ms after the first row (95 %: {low:.1f} to {high:.1f} ms) fits best."
            )
        return f"No constant mass explains the shot (p = {self.p_value:.2g}): it drifts; a step of {size} fits best."


def sensor_columns(
    forces_n: Array,
    friction_direction: Array,
    released: Array,
    mass_kg: float,
    scales: ScaleUncertainty,
    u_zero_m_s2: float,
    rates_n_s: Array | None = None,
    u_delays_s: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Array:
    """Return what one standard uncertainty of each sensor's error adds to the acceleration, shape (n, n_known).

    Gauges, friction, the accelerometer's zero, and delays of the gauges; a scale of the accelerometer is none of
    them, because it is one with the mass. What is known exactly, or not at all, has no column.

    Parameters
    ----------
    forces_n : ndarray, shape (n, 4)
        In the order of `recoil_identification.regression.FORCES`.
    friction_direction, released : ndarray, shape (n,)
        As in `recoil_identification.regression.Regression`.
    u_zero_m_s2
        Infinite for a zero that is not known.
    rates_n_s : ndarray, shape (n, 3), optional
        Derivatives of the gauges' forces.
    u_delays_s
        Standard uncertainty of each gauge's delay against the accelerometer.
    """
    columns = [forces_n[:, j] / mass_kg * u for j, u in enumerate(scales.gauges)]
    columns.append(friction_direction / mass_kg * scales.friction_n)
    if math.isfinite(u_zero_m_s2):
        columns.append(released * u_zero_m_s2)
    if rates_n_s is not None:
        columns += [rates_n_s[:, j] / mass_kg * u for j, u in enumerate(u_delays_s)]
    kept = [column for column in columns if np.any(column)]
    return np.column_stack(kept) if kept else np.zeros((friction_direction.size, 0))


def mass_constancy(
    times_s: Array,
    acceleration_m_s2: Array,
    force_n: Array,
    mass_kg: float,
    known: Array,
    free: Array | None = None,
    *,
    noise_m_s2: float | None = None,
    transition: Callable[[Array], Array] | None = None,
) -> MassConstancy:
    """Test whether one mass explains rows of force and acceleration.

    Parameters
    ----------
    times_s, acceleration_m_s2, force_n : ndarray, shape (n,)
        Rows with errors about independent of one another, in order of time, none missing.
    mass_kg
        A first estimate.
    known : ndarray, shape (n, n_known)
        What one standard uncertainty of each calibrated error adds to the acceleration, see `sensor_columns`.
    free : ndarray, shape (n, n_free), optional
        Shapes of errors that nothing restricts.
    noise_m_s2
        Of every row; found from the residuals around it, their correlation included, if left out.
    transition
        Of time from a step, s: how far it is done, what a filter makes of it in between.

    Raises
    ------
    IdentificationError
        If there are too few rows, or the sensors' errors explain every step.
    ValueError
        If the mass is not positive or something is not finite.
    """
    columns = np.zeros((times_s.size, 0)) if free is None else free
    if not (mass_kg > 0 and all(np.isfinite(x).all() for x in (times_s, acceleration_m_s2, force_n, known, columns))):
        raise ValueError("the mass must be positive and every row finite")
    least = LEAST_ROWS + columns.shape[1] + 1
    if times_s.size < least:
        raise IdentificationError(
            f"only {times_s.size} rows to test the constancy of the mass with",
            expected=f"at least {least}",
            remedy="check for lost samples, or raise the cut-off",
        )
    rigid = force_n / mass_kg

    def tested(sigma: Array, draws: int = DRAWS) -> StepTest:
        return step_test(times_s, acceleration_m_s2, rigid, known, columns, sigma, transition=transition, draws=draws)

    try:
        if noise_m_s2 is not None:
            sigma = np.full(times_s.size, noise_m_s2)
        else:
            # the scatter of what a step leaves: a step must not hide in the noise that it makes itself
            lost = 3 + columns.shape[1] + known.shape[1]
            sigma = np.full(times_s.size, max(float(np.std(acceleration_m_s2 - rigid)), 1e-9))
            for _ in range(3):
                sigma = _scatter(tested(sigma, 1).residual * sigma, times_s, lost)
            sigma *= long_run_factor(tested(sigma, 1).residual)
            sigma = np.maximum(sigma, SMALLEST_RESIDUAL * float(np.max(np.abs(acceleration_m_s2))))
        step = tested(sigma)
    except ValueError as error:
        raise IdentificationError(
            f"the constancy of the mass cannot be tested: {error}", remedy="check the sensors' uncertainties"
        ) from error
    regressors = np.column_stack([rigid, columns, known])
    prior = np.concatenate([np.full(1 + columns.shape[1], math.inf), np.ones(known.shape[1])])
    residuals = recursive_residuals(acceleration_m_s2, regressors, prior, sigma)
    before = mass_kg / step.slope
    return MassConstancy(
        times_s=times_s,
        sigma_m_s2=sigma,
        step=step,
        drift=cusum(residuals),
        scatter=cusum_of_squares(residuals),
        mass_kg=before,
        change_kg=before * (1 / (1 + step.change) - 1),
        u_change_kg=before * step.u_change / (1 + step.change) ** 2,
    )


def constancy_of(
    regression: Regression,
    calibration: Corrections,
    scales: ScaleUncertainty,
    u_zero_m_s2: float,
    u_delays_s: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> MassConstancy:
    """Test whether one mass explains the identification interval of a filtered regression.

    Parameters
    ----------
    regression
        Filtered; shapes of a shifted zero are free.
    calibration
        Gives the first estimate of the mass.
    u_zero_m_s2
        Standard uncertainty of the accelerometer's zero from the silence before the shot.
    u_delays_s
        Standard uncertainties of the delays of breech, brake and recuperator force against the acceleration,
        those of their clocks among them.

    Raises
    ------
    IdentificationError
        As of `mass_constancy`.
    """
    rows = spaced_rows(regression)
    rows = rows[:: max(1, math.ceil(rows.size / LARGEST_ROWS))]
    mass = calibration.estimate.mass_kg
    rates = np.gradient(regression.forces_n[:, :3], regression.step_s, axis=0)
    known = sensor_columns(
        regression.forces_n,
        regression.friction_direction,
        regression.released,
        mass,
        scales,
        u_zero_m_s2,
        rates,
        u_delays_s,
    )[rows]
    known = np.column_stack([known, regression.release_per_s[rows] * (regression.u_release_n_s / mass)])
    free = np.zeros((rows.size, 0)) if regression.shifts is None else regression.shifts[rows]
    if not math.isfinite(u_zero_m_s2):
        free = np.column_stack([free, regression.released[rows]])
    return mass_constancy(
        regression.times_s[rows],
        regression.acceleration_m_s2[rows],
        regression.force_n[rows],
        mass,
        known,
        free,
        transition=_transition(regression),
    )


def _transition(regression: Regression) -> Callable[[Array], Array] | None:
    """Return what the regression's filter makes of a step; None for recorded signals."""
    if regression.low_pass is None:
        return None
    reach = math.ceil(8 * regression.rate_hz / regression.low_pass.cutoff_hz)
    since = regression.step_s * np.arange(-reach, reach + 1)
    # half way up at the instant itself
    table = filter_alike(regression.low_pass, {"step": 0.5 * (1 + np.sign(since))}, regression.rate_hz)
    risen = table["step"]
    return lambda at_s: np.interp(at_s, since, risen, left=0.0, right=1.0)


def _scatter(residual: Array, times_s: Array, lost: int) -> Array:
    """Return the standard deviation of each row's error: an even one, and one that dies down from the first row.

    The likeliest of normal errors whose variance is ``c (1 + A exp(-t / tau))``: three numbers only, for an error
    bar that followed every row would be small where the row happens to fit.

    Parameters
    ----------
    residual, times_s : ndarray, shape (n,)
    lost
        Degrees of freedom that the residual has lost to what was fitted.
    """
    squares = residual**2
    since = (times_s - times_s[0]) / max(float(times_s[-1] - times_s[0]), 1e-300)
    best, found = math.inf, np.ones(residual.size)
    for tau in DECAYS:
        for size in (0.0, *np.geomspace(0.3, 1e4, 40)):
            shape = 1 + size * np.exp(-since / tau)
            level = max(float(np.mean(squares / shape)), 1e-18)
            misfit = residual.size * math.log(level) + float(np.log(shape).sum())
            if misfit < best:
                best, found = misfit, level * shape
    return np.sqrt(found * residual.size / max(residual.size - lost, 1))
