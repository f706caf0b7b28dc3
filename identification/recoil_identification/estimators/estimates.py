"""Further estimates of a shot's mass beside the regression's own, each with a budget of the same rows.

``tls``         total least squares behind the low-pass, with the noises' ratio in the pre-trigger baseline
``ar-gls``      acceleration on force as recorded, with autoregressive errors
``weak``        averages over functions of finite reach, as recorded
``camera-gls``  the camera's displacement against the force's double integral
``joint``       force, accelerometer and camera

Random errors are those of each estimator; what it answers to a scale, a friction, a zero or a clock that is off, it
tells itself, to first order: these errors of the force are its perturbations.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.channel import Channel
from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.read_only import ReadOnlyArrays
from recoil_acquisition.shot import ClockAlignment, Shot
from recoil_identification.budget import BudgetRow
from recoil_identification.estimators.errors_in_variables import deming_mass
from recoil_identification.estimators.joint_recoil import Knowledge, Recoil
from recoil_identification.estimators.joint_smoother import joint_mass
from recoil_identification.estimators.prewhitening import prewhitened_mass
from recoil_identification.estimators.weak_form import HALF_WIDTH_S, WeakMass, weak_mass
from recoil_identification.mass import ACCELERATION, FRICTION, GAUGES, RANDOM, MassEstimate
from recoil_identification.sensor_priors import CAMERA_SCALE, RELEASE
from recoil_processing.gaps import bridge
from recoil_processing.shot.clocks.double_impulse import double_impulse_mass
from recoil_processing.shot.clocks.estimator_inputs import EstimatorInputs
from recoil_processing.shot.regression import Regression, spaced_rows
from recoil_processing.shot.sensor_scales import ScaleUncertainty
from recoil_processing.shot.signals import Signals
from recoil_rigs.rig import Rig

Array = NDArray[np.float64]

WIDTH = "width of the test functions"
"""Name of the budget row of what an analyst chooses."""
WIDTH_FACTORS = (0.7, 1.4)
"""Widths that a careful analyst might have chosen instead, as factors on the one chosen."""
LEAST_NOISE_M_S2 = 1e-12
"""Of an accelerometer, in the place of zero."""


@dataclass(frozen=True, eq=False)
class TrackedShot(ReadOnlyArrays):
    """What a camera adds.

    Attributes
    ----------
    camera
        Displacement on its own clock, without the delay of its chain.
    alignment
        Of that clock; not failed.
    other_m_s2 : ndarray, shape (n,)
        On the regression's grid: acceleration of the displacement less a' of equation (36).
    """

    camera: Channel
    alignment: ClockAlignment
    other_m_s2: Array


def further_estimates(
    filtered: Regression,
    recorded: Regression,
    signals: Signals,
    shot: Shot,
    rig: Rig,
    scales: ScaleUncertainty,
    further: Sequence[BudgetRow],
    tracked: TrackedShot | None = None,
) -> dict[str, MassEstimate]:
    """Estimate the mass by every further estimator that the shot's channels allow.

    Parameters
    ----------
    filtered, recorded
        Behind the low-pass and before it.
    signals
        Tell the noise of the pre-trigger baseline, and the uncertainty of the gauges' zeros.
    shot, rig
        Tell which force hangs on which clock, and the areas.
    further
        Contributions of clocks, zeros, repairs, skew and cut-off to the route by the accelerometer.

    Returns
    -------
    dict of str to MassEstimate
        An estimator that this shot does not allow, for lost samples or frames, is not in it.
    """
    inputs = EstimatorInputs(filtered, recorded, signals, shot, rig)
    prepared = _Estimators(inputs, scales, tuple(further))
    estimators: dict[str, Callable[[], MassEstimate]] = {
        "tls": prepared.tls,
        "ar-gls": prepared.ar_gls,
        "weak": prepared.weak,
    }
    if tracked is not None and tracked.alignment.status != "failed":
        estimators |= {"camera-gls": lambda: prepared.camera_gls(tracked), "joint": lambda: prepared.joint(tracked)}
    found: dict[str, MassEstimate] = {}
    for name, estimator in estimators.items():
        try:
            found[name] = estimator()
        except IdentificationError:
            # the reverse estimate of the same rows, and the camera's route, say why
            continue
    return found


@dataclass(frozen=True, eq=False)
class _Estimators:
    """The estimators of one shot, each with its budget."""

    inputs: EstimatorInputs
    scales: ScaleUncertainty
    further: tuple[BudgetRow, ...]

    def tls(self) -> MassEstimate:
        rows, f, quiet = spaced_rows(self.inputs.filtered), self.inputs.filtered, self.inputs.baseline_noise
        a, force = f.acceleration_m_s2[rows], f.force_n[rows]
        ratio = quiet.filtered_force / max(quiet.filtered_acceleration, LEAST_NOISE_M_S2)
        noise = math.hypot(quiet.filtered_acceleration, quiet.filtered_force / self.inputs.rig.mechanism.m3)
        found = deming_mass(a, force, ratio, quiet_sigma_m_s2=noise)
        # with little noise it is the derivative of acceleration on force
        answers = (
            found.mass_kg
            / (force @ force)
            * (np.column_stack([f.forces_n[rows, :3], f.friction_direction[rows]]).T @ force)
        )
        budget = [*self.by_force(answers), self.by_accelerometer(-found.mass_kg), *self.further]
        return self.stated("tls", found.mass_kg, found.u_kg, budget, found.rows)

    def ar_gls(self) -> MassEstimate:
        found = prewhitened_mass(
            self.inputs.acceleration_m_s2,
            self.inputs.force_n,
            used=self.inputs.used,
            force_sigma_n=self.inputs.baseline_noise.force,
            quiet_sigma_m_s2=self.inputs.baseline_noise.slow_acceleration,
            perturbations_n=self.inputs.perturbations.per_unit,
            most_order=self.inputs.most_order,
        )
        budget = [*self.by_force(found.sensitivities_kg), self.by_accelerometer(-found.mass_kg), *self.further]
        return self.stated("ar-gls", found.mass_kg, found.u_kg, budget, found.rows)

    def weak(self) -> MassEstimate:
        def averaged(factor: float) -> WeakMass:
            return weak_mass(
                self.inputs.recorded.times_s,
                self.inputs.acceleration_m_s2,
                self.inputs.force_n,
                half_width_s=factor * HALF_WIDTH_S,
                used=self.inputs.used,
                force_sigma_n=self.inputs.baseline_noise.slow_force,
                quiet_sigma_m_s2=self.inputs.baseline_noise.slow_acceleration,
                perturbations_n=self.inputs.perturbations.per_unit,
            )

        found = averaged(1.0)
        masses = [found.mass_kg, *(averaged(factor).mass_kg for factor in WIDTH_FACTORS)]
        choice = BudgetRow(WIDTH, 0.5 * (max(masses) - min(masses)) / math.sqrt(3.0), "B")
        budget = [
            *self.by_force(found.sensitivities_kg),
            self.by_accelerometer(-found.mass_kg),
            *self.further,
            choice,
        ]
        return self.stated("weak", found.mass_kg, found.u_kg, budget, found.rows)

    def camera_gls(self, tracked: TrackedShot) -> MassEstimate:
        r = self.inputs.recorded
        found = double_impulse_mass(
            tracked.alignment.to_reference(tracked.camera.time_base.times_s),
            tracked.camera.measured,
            float(r.times_s[0]),
            r.step_s,
            self.inputs.force_n,
            self.other(tracked),
            release_s=self.inputs.release_s,
            end_s=r.interval_s[1],
            rough_mass_kg=self.inputs.rough_kg,
            force_sigma_n=self.inputs.baseline_noise.slow_force,
            u_shift_s=tracked.alignment.u_offset_s,
            u_velocity_m_s=r.rms_release_n_s / self.inputs.rough_kg,
            perturbations_n=self.inputs.perturbations.table,
        )
        scale_kg = found.scale_sensitivity_kg
        scale = BudgetRow(CAMERA_SCALE, abs(scale_kg) * tracked.camera.u_rel, "B", scale_kg)
        by_force, sensitivities_kg = self.by_force(found.sensitivities_kg[:4]), found.sensitivities_kg[4:]
        budget = self.by_camera(tracked, by_force, sensitivities_kg, scale, found.u_shift_kg)
        budget.append(BudgetRow(RELEASE, found.u_zero_kg, "B"))
        return self.stated("camera-gls", found.mass_kg, found.u_kg, budget, found.frames)

    def joint(self, tracked: TrackedShot) -> MassEstimate:
        r = self.inputs.recorded
        recoil = Recoil(
            float(r.times_s[0]),
            r.step_s,
            self.inputs.force_n,
            self.inputs.acceleration_m_s2,
            self.other(tracked),
            self.inputs.used,
            tracked.alignment.to_reference(tracked.camera.time_base.times_s),
            tracked.camera.measured,
            self.inputs.release_s,
            r.interval_s[1],
        )
        known = Knowledge(
            self.inputs.baseline_noise.slow_force,
            self.inputs.baseline_noise.slow_acceleration,
            u_shift_s=tracked.alignment.u_offset_s,
            u_gain=self.scales.acceleration,
            u_scale=tracked.camera.u_rel,
        )
        perturbations = self.inputs.perturbations
        u = np.array([*self.scales.gauges, self.scales.friction_n, r.rms_release_n_s])
        found = joint_mass(
            recoil,
            known,
            # the force that is measured lacks what the battery stop pushes with
            force_errors_n=np.column_stack([perturbations.per_unit, -r.release_per_s]),
            u_force_errors=u,
            perturbations_n=perturbations.table[:, perturbations.per_unit.shape[1] :],
            most_order=self.inputs.most_order,
        )
        scale = BudgetRow(CAMERA_SCALE, found.u_scale_kg, "B")
        *by_sensors, by_release = found.force_sensitivities_kg / np.where(u > 0, u, 1.0)
        by_force = self.by_force(np.array(by_sensors))
        by_force.append(BudgetRow(RELEASE, abs(by_release) * u[-1], "B", by_release, "N s"))
        budget = self.by_camera(tracked, by_force, found.sensitivities_kg, scale, found.u_shift_kg)
        budget.append(BudgetRow(ACCELERATION, found.u_gain_kg, "B"))
        return self.stated("joint", found.mass_kg, found.u_kg, budget, found.frames + found.rows)

    def other(self, tracked: TrackedShot) -> Array:
        """Return what moves the displacement and is no force over mass, from the release on, shape (n,)."""
        return np.asarray(bridge(tracked.other_m_s2, otherwise=0.0) * (self.inputs.recorded.released > 0))

    def by_force(self, sensitivities_kg: Array) -> list[BudgetRow]:
        """Weigh the answers to the gauges' scales and the friction with their uncertainties."""
        *gauges, friction = (float(answer) for answer in sensitivities_kg)
        rows = [BudgetRow(n, abs(c) * u, "B", c) for n, c, u in zip(GAUGES, gauges, self.scales.gauges, strict=True)]
        return [*rows, BudgetRow(FRICTION, abs(friction) * self.scales.friction_n, "B", friction, "N")]

    def by_accelerometer(self, answer_kg: float) -> BudgetRow:
        """Weigh the answer to the accelerometer's scale with its uncertainty."""
        return BudgetRow(ACCELERATION, abs(answer_kg) * self.scales.acceleration, "B", answer_kg)

    def by_camera(
        self,
        tracked: TrackedShot,
        by_force: list[BudgetRow],
        sensitivities_kg: Array,
        scale: BudgetRow,
        u_shift_kg: float,
    ) -> list[BudgetRow]:
        """Weigh the answers of a route by the camera to zeros and clocks; a clock's larger direction counts."""
        perturbations = self.inputs.perturbations
        zeros = sensitivities_kg[: len(perturbations.zeros)]
        clocks: dict[str, float] = {}
        for (source, _), answer in zip(perturbations.clocks, sensitivities_kg[zeros.size :], strict=True):
            clocks[source] = max(clocks.get(source, 0.0), abs(float(answer)))
        own = f"alignment of clock {tracked.alignment.clock}"
        # forces on the camera's own clock would move with it; no recorder of pressures has one
        clocks[own] = math.hypot(clocks.get(own, 0.0), u_shift_kg)
        return [
            *by_force,
            scale,
            *(BudgetRow(source, u, "B") for source, u in clocks.items()),
            *(BudgetRow(n, abs(float(c)), "A") for (n, _), c in zip(perturbations.zeros, zeros, strict=True)),
        ]

    def stated(
        self, method: str, mass_kg: float, u_kg: float, systematic: Sequence[BudgetRow], rows: int
    ) -> MassEstimate:
        """Put an estimate together; its residual is that behind the low-pass, so that estimators compare."""
        at = spaced_rows(self.inputs.filtered)
        residual = self.inputs.filtered.acceleration_m_s2[at] - self.inputs.filtered.force_n[at] / mass_kg
        deviation = math.sqrt(float(residual @ residual) / max(at.size - 1, 1))
        return MassEstimate(method, mass_kg, (BudgetRow(RANDOM, u_kg, "A"), *systematic), rows, deviation)


def other_acceleration(travel_m_s2: Array, inertial_m_s2: Array) -> Array:
    """Return the travel's acceleration that is not a', as the gyros and the carriage's accelerometers tell it.

    Parameters
    ----------
    travel_m_s2, inertial_m_s2 : ndarray, shape (n,)
        Second derivative of the travel by the accelerometers, and a' that it was computed from; lost samples of the
        latter NaN, where the former stands on a bridge.

    Returns
    -------
    ndarray, shape (n,)
    """
    return np.asarray(travel_m_s2 - bridge(inertial_m_s2, otherwise=0.0))
