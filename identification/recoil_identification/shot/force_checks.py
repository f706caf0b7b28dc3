"""Checks of a shot's forces against what is known of them by another way, each with its number."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from recoil_acquisition.numerics.normal_distribution import CRITICAL_VALUE
from recoil_identification.calibration.calibration import Calibration
from recoil_identification.rows.known_forces import known_forces
from recoil_identification.rows.sensor_priors import part_of_scale
from recoil_processing.shot.sensor_scales import dynamic_scale, of_gauge
from recoil_processing.shot.signals import Signals
from recoil_rigs.shots.fired_shot import FiredShot


@dataclass(frozen=True)
class ForceCheck:
    """One comparison of a gauge with what is known beside its certificate.

    Attributes
    ----------
    about
        Name of what is compared: a declared impulse or load, or one of several gauges of a force.
    against
        Name of the gauge, or force, that it is compared with.
    off_percent, u_percent
        Difference of the gauge from it, or from the others, and its standard uncertainty without the gauge's own.
    normalised_residual
        Distance from all that the shot and the certificates say together, in its own standard deviations: standard
        normal if everything is right; 0 where nothing else says anything.
    limit
        Size of it beyond which one of both sides is wrong.
    """

    about: str
    against: str
    off_percent: float
    u_percent: float
    normalised_residual: float
    limit: float = CRITICAL_VALUE

    def to_json(self) -> dict[str, Any]:
        """Return it as the report has it."""
        return asdict(self)


def force_checks(calibration: Calibration, signals: Signals, fired: FiredShot) -> tuple[ForceCheck, ...]:
    """List the checks of a shot: what the rig file knows of forces, and each of several gauges beside the others."""
    block, residuals, inferred = calibration.block, calibration.normalised_residuals, calibration.inferred
    known = known_forces(signals, fired, block.regression, block.causes)
    checks = [
        ForceCheck(
            one.source,
            one.against,
            100.0 * (one.read / one.value - 1.0),
            100.0 * abs(one.u / one.value),
            residuals.get(one.source, 0.0),
        )
        for one in known.declared
    ]
    unknowns = [unknown.name for unknown in inferred.unknowns]
    for force, gauges in signals.gauges.items():
        for gauge in gauges:
            source, count = of_gauge(gauge.channel), len(gauges)
            others = ", ".join(one.channel for one in gauges if one is not gauge)
            of_pulses = [dynamic_scale(gauge.channel)] if fired.rig.channel(gauge.channel).u_dynamic_rel else []
            names = [part_of_scale(part).name for part in (source, *of_pulses)]
            if source in residuals and all(math.isfinite(inferred.u(name)) for name in names):
                places = [unknowns.index(name) for name in names]
                variance = float(inferred.covariance[np.ix_(places, places)].sum())
                off = 100.0 * count * math.fsum(map(inferred.value, names))
                u = 100.0 * count * math.sqrt(max(variance, 0.0))
                checks.append(ForceCheck(f"{others} of {force}", gauge.channel, off, u, residuals[source]))
    return tuple(checks)
