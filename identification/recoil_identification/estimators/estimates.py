"""Further estimates of a shot's mass beside the regression's own, each with a budget of the same rows.

``tls``     total least squares behind the low-pass, with the noises' ratio in the pre-trigger baseline
``ar-gls``  acceleration on force as recorded, with autoregressive errors
``weak``    averages over functions of finite reach, as recorded

Random errors are those of each estimator; what it answers to a scale, a friction, a zero or a clock that is off, it
tells itself, to first order: these errors of the force are its perturbations.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.errors import IdentificationError
from recoil_identification.estimate.budget import CHOICE_FACTORS, BudgetRow
from recoil_identification.estimate.mass import RANDOM, MassEstimate, rows_of_sensors
from recoil_identification.estimators.errors_in_variables import deming_mass
from recoil_identification.estimators.prewhitening import prewhitened_mass
from recoil_identification.estimators.weak_form import HALF_WIDTH_S, WeakMass, weak_mass
from recoil_processing.shot.clocks.estimator_inputs import EstimatorInputs
from recoil_processing.shot.error_source import ErrorSource, SourceKind
from recoil_processing.shot.regression import Regression, spaced_rows
from recoil_processing.shot.sensor_scales import ScaleUncertainty
from recoil_processing.shot.signals import Signals
from recoil_rigs.shots.fired_shot import FiredShot

Array = NDArray[np.float64]

WIDTH = ErrorSource(SourceKind.CHOICE, detail="width of the test functions")
"""Name of the budget row of what an analyst chooses."""
LEAST_HALF = 2.0
"""Samples of half the width of a test function."""
LEAST_NOISE_M_S2 = 1e-12
"""Noise of an accelerometer, m/s^2, in the place of zero."""


def further_estimates(
    filtered: Regression,
    recorded: Regression,
    signals: Signals,
    fired: FiredShot,
    scales: ScaleUncertainty,
    further: Sequence[BudgetRow],
    *,
    leave_out: Callable[[str, str], None] = lambda _method, _why: None,
) -> dict[str, MassEstimate]:
    """Estimate the mass by every further estimator that the shot's channels allow.

    Parameters
    ----------
    filtered, recorded
        Regressions behind the low-pass and before it.
    signals
        Signals, which tell the noise of the pre-trigger baseline, and the uncertainty of the gauges' zeros.
    fired
        Shot and rig: which force hangs on which clock, and the areas.
    further
        Contributions of clocks, zeros, repairs, skew and cut-off to the route by the accelerometer.

    leave_out
        Function that is given the name of an estimator that this shot does not allow, and why: for its rate, its length
        or lost samples.

    Returns
    -------
    dict of str to MassEstimate
        Estimates by the estimators that are not left out.
    """
    inputs = EstimatorInputs(filtered, recorded, signals, fired)
    prepared = _Estimators(inputs, scales, tuple(further))
    estimators: dict[str, Callable[[], MassEstimate]] = {
        "tls": prepared.tls,
        "ar-gls": prepared.ar_gls,
        "weak": prepared.weak,
    }
    found: dict[str, MassEstimate] = {}
    for name, estimator in estimators.items():
        try:
            found[name] = estimator()
        except (IdentificationError, ValueError) as error:
            # the arrays are this shot's: what they do not allow is no fault of who asked for a comparison
            leave_out(name, str(error))
    return found


@dataclass(frozen=True, eq=False)
class _Estimators:
    """The estimators of one shot, each with its budget."""

    inputs: EstimatorInputs
    scales: ScaleUncertainty
    further: tuple[BudgetRow, ...]

    def tls(self) -> MassEstimate:
        rows, f, baseline = spaced_rows(self.inputs.filtered), self.inputs.filtered, self.inputs.baseline_noise
        a, force = f.acceleration_m_s2[rows], f.force_n[rows]
        ratio = baseline.filtered_force / max(baseline.filtered_acceleration, LEAST_NOISE_M_S2)
        noise = math.hypot(baseline.filtered_acceleration, baseline.filtered_force / self.inputs.fired.rig.mechanism.m3)
        found = deming_mass(a, force, ratio, baseline_sigma_m_s2=noise)
        # with little noise it is the derivative of acceleration on force
        answers = (
            found.mass_kg
            / (force @ force)
            * (np.column_stack([f.forces_n[rows, :-1], f.friction_direction[rows]]).T @ force)
        )
        budget = [*rows_of_sensors(found.mass_kg, answers, self.scales), *self.further]
        return self.stated("tls", found.mass_kg, found.u_kg, budget, found.rows)

    def ar_gls(self) -> MassEstimate:
        found = prewhitened_mass(
            self.inputs.acceleration_m_s2,
            self.inputs.force_n,
            used=self.inputs.used,
            force_sigma_n=self.inputs.baseline_noise.force,
            baseline_sigma_m_s2=self.inputs.baseline_noise.slow_acceleration,
            perturbations_n=self.inputs.perturbations.per_unit,
            most_order=self.inputs.most_order,
        )
        budget = [*rows_of_sensors(found.mass_kg, found.sensitivities_kg, self.scales), *self.further]
        return self.stated("ar-gls", found.mass_kg, found.u_kg, budget, found.rows)

    def weak(self) -> MassEstimate:
        step_s, narrowest_s = self.inputs.recorded.step_s, min(1.0, *CHOICE_FACTORS) * HALF_WIDTH_S
        if not narrowest_s > LEAST_HALF * step_s:
            raise IdentificationError(
                f"averages over {2e3 * narrowest_s:g} ms need more than {LEAST_HALF / narrowest_s:.4g} samples/s",
                found=f"{1.0 / step_s:.4g} samples/s",
            )

        def averaged(factor: float) -> WeakMass:
            return weak_mass(
                self.inputs.recorded.times_s,
                self.inputs.acceleration_m_s2,
                self.inputs.force_n,
                half_width_s=factor * HALF_WIDTH_S,
                used=self.inputs.used,
                force_sigma_n=self.inputs.baseline_noise.slow_force,
                baseline_sigma_m_s2=self.inputs.baseline_noise.slow_acceleration,
                perturbations_n=self.inputs.perturbations.per_unit,
            )

        found = averaged(1.0)
        masses = [found.mass_kg, *(averaged(factor).mass_kg for factor in CHOICE_FACTORS)]
        choice = BudgetRow(WIDTH, 0.5 * (max(masses) - min(masses)) / math.sqrt(3.0), "B", distribution="rectangular")
        budget = [*rows_of_sensors(found.mass_kg, found.sensitivities_kg, self.scales), *self.further, choice]
        return self.stated("weak", found.mass_kg, found.u_kg, budget, found.rows)

    def stated(
        self, method: str, mass_kg: float, u_kg: float, systematic: Sequence[BudgetRow], rows: int
    ) -> MassEstimate:
        """Put an estimate together; its residual is that behind the low-pass, so that estimators compare."""
        at = spaced_rows(self.inputs.filtered)
        residual = self.inputs.filtered.acceleration_m_s2[at] - self.inputs.filtered.force_n[at] / mass_kg
        deviation = math.sqrt(float(residual @ residual) / max(at.size - 1, 1))
        return MassEstimate(method, mass_kg, (BudgetRow(RANDOM, u_kg, "A"), *systematic), rows, deviation)
