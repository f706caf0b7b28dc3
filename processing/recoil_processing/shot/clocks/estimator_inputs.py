"""The inputs of every estimator of a mass: both sides as recorded, and their noise before the shot."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_processing.gaps import bridge
from recoil_processing.shot.clocks.autoregressive_noise import fit_noise
from recoil_processing.shot.regression import Regression
from recoil_processing.shot.signals import Signals
from recoil_rigs.shots.fired_shot import FiredShot

LEAST_NOISE_SAMPLES = 64
"""Samples by which a noise is estimated."""
BASELINE_ORDER = 4
"""Order of the pre-trigger baseline's autoregressive model: enough for a chain's filter."""


@dataclass(frozen=True)
class BaselineNoise:
    """Noise of the pre-trigger baseline, per sample: at low frequency, and behind the low-pass."""

    slow_acceleration: float = 0.0
    slow_force: float = 0.0
    filtered_acceleration: float = 0.0
    filtered_force: float = 0.0


@dataclass(frozen=True, eq=False)
class EstimatorInputs:
    """Both sides of one shot, and what every estimator takes of them."""

    filtered: Regression
    recorded: Regression
    signals: Signals
    fired: FiredShot

    @cached_property
    def forces_n(self) -> Array:
        """As recorded; lost samples bridged, which no estimator uses but to integrate; shape (n, n_gauges + 1)."""
        return np.column_stack([bridge(column, otherwise=0.0) for column in self.recorded.forces_n.T])

    @cached_property
    def force_n(self) -> Array:
        """F' as recorded, lost samples bridged, shape (n,)."""
        return np.asarray(self.forces_n.sum(axis=1))

    @cached_property
    def acceleration_m_s2(self) -> Array:
        """Acceleration a' as recorded, lost samples bridged, shape (n,)."""
        return bridge(self.recorded.acceleration_m_s2, otherwise=0.0)

    @cached_property
    def in_baseline(self) -> Flags:
        """Samples of the pre-trigger baseline, shape (n,)."""
        return self.signals.in_baseline

    @cached_property
    def held_force_n(self) -> Array:
        """Sum of the gauges' forces, their noise also where the part is held and F' is zero by construction."""
        force = np.zeros(self.recorded.times_s.size)
        for one in self.fired.rig.forces:
            force += bridge(self.signals.get(one.name), otherwise=0.0) * one.per_reading
        return force

    @cached_property
    def slow_force_n(self) -> float:
        """Noise of the force at low frequency, per sample; zero without a pre-trigger baseline."""
        if np.count_nonzero(self.in_baseline) < LEAST_NOISE_SAMPLES:
            return 0.0
        force = self.held_force_n[self.in_baseline]
        return math.sqrt(fit_noise([force - force.mean()], BASELINE_ORDER).slow_density)

    @cached_property
    def baseline_noise(self) -> BaselineNoise:
        """Noise of the pre-trigger baseline; without one it is zero, and nothing is claimed by it.

        What was differentiated has a noise that no low frequency shows; the rows tell it, as they do where a record
        begins in motion.
        """
        in_baseline = self.in_baseline
        differentiated = self.recorded.motion_role != "recoil_acceleration" and not self.recorded.recoils_once
        if np.count_nonzero(in_baseline) < LEAST_NOISE_SAMPLES or differentiated:
            return BaselineNoise()
        a, f = (side[in_baseline] - side[in_baseline].mean() for side in (self.acceleration_m_s2, self.held_force_n))
        slow_acceleration = math.sqrt(fit_noise([a], BASELINE_ORDER).slow_density)
        low_pass, rate_hz = self.filtered.low_pass, self.recorded.rate_hz
        behind = [side if low_pass is None else low_pass.apply(side, rate_hz) for side in (a, f)]
        return BaselineNoise(slow_acceleration, self.slow_force_n, float(behind[0].std()), float(behind[1].std()))

    @property
    def release_s(self) -> float:
        """First instant at which the part is free."""
        return float(self.recorded.times_s[int(np.argmax(self.recorded.released > 0))])
