"""Several gauges of one pressure: what their differences say of each.

The force is that of their mean; the scale of the mean is off by the mean of what each is off. Differences of the
gauges, in combinations that have nothing in common with the mean, tell the rest: with the readings p_j, their mean p,
and coefficients c_j that add up to nothing,

    sum_j c_j p_j = p sum_j c_j g_j + z + sum_k q_k h_k - t dp/dt + noise

g_j are the gauges' relative errors, z and q_k what is left of their zeros before the shot and as the shot moves them,
and t their delays against one another. The errors that are proportional to the pressure, which no scale explains, are
taken as for the motion.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_identification.calibration.calibration import Calibration
from recoil_identification.inference.block import LinearBlock
from recoil_identification.inference.unknown import Prior, Unknown
from recoil_identification.rows.causes import U_SKEW_S
from recoil_identification.rows.row_noise import PROPORTIONAL
from recoil_processing.noise import welch_satterthwaite
from recoil_processing.shot.error_source import ErrorSource, SourceKind
from recoil_processing.shot.gauge_zero import MOVES_S, moving_zero_pa, zero_moves
from recoil_processing.shot.sensor_scales import dynamic_scale, of_gauge
from recoil_processing.shot.signals import Signals
from recoil_rigs.rig import Rig

MEAN_S = 1e-3
"""Over which differences are averaged: their noise is white."""
LEAST_NOISE_PA = 1e-3
"""Noise of a gauge, Pa, that records without any error are given."""
LIMIT = 2.81
"""Normalised residual beyond which one of several gauges is set aside: by chance one of 200 is, and nothing is lost
then but some certainty."""
ALIKE = 0.3
"""Difference of two normalised residuals below which it is not told which of two gauges is off."""


@dataclass(frozen=True)
class GaugeAgreement:
    """Rows of the differences, and the unknowns that only these have, with what is known of them."""

    rows: tuple[LinearBlock, ...]
    unknowns: tuple[Unknown, ...]
    priors: tuple[Prior, ...]


def gauge_agreement(signals: Signals, rig: Rig, interval_s: tuple[float, float]) -> GaugeAgreement:
    """Compare the gauges of each pressure that several of them measured, from the onset to the end of travel."""
    rows: list[LinearBlock] = []
    found: list[Unknown] = []
    priors: list[Prior] = []
    times = signals.times_s
    inside = (times >= interval_s[0]) & (times <= interval_s[1])
    moves = zero_moves(times, interval_s[0])
    for role, gauges in signals.gauges.items():
        mean = signals.series[role]
        used = inside & np.isfinite(mean)
        places = np.unique(np.floor((times[used] - interval_s[0]) / MEAN_S), return_inverse=True)[1]
        each = np.bincount(places)
        for number, weights in enumerate(_contrasts(len(gauges))):

            def of_all(parts: Iterable[float], weights: Array = weights) -> float:
                return math.hypot(*(c * part for c, part in zip(weights, parts, strict=True)))

            def of_difference(what: str, role: str = role, number: int = number) -> ErrorSource:
                detail = f"{what}, difference {number + 1}"
                return ErrorSource(SourceKind.GAUGE_DIFFERENCE, role, detail)

            u_moves_pa = of_all(moving_zero_pa(rig.channel(one.channel), one.samples) for one in gauges)
            zero = Unknown(of_difference("zero"), "Pa")
            freedom = welch_satterthwaite(
                (abs(c) * one.offset.u, one.offset.degrees_of_freedom) for c, one in zip(weights, gauges, strict=True)
            )
            own = [
                (zero, of_all(one.offset.u for one in gauges), np.ones_like(times)),
                *(
                    (Unknown(of_difference(f"zero that moves in {1e3 * tau:g} ms"), "Pa"), u_moves_pa, move)
                    for tau, move in zip(MOVES_S, moves.T, strict=True)
                ),
                (Unknown(of_difference("delay"), "s"), U_SKEW_S, -np.gradient(mean, signals.step_s)),
            ]
            own = [(unknown, u, shape) for unknown, u, shape in own if math.isfinite(u)]
            difference = np.sum([c * one.samples for c, one in zip(weights, gauges, strict=True)], axis=0)
            noise = max(of_all(one.offset.noise for one in gauges), LEAST_NOISE_PA)
            scales = [(f"ln {of_gauge(one.channel)}", c) for c, one in zip(weights, gauges, strict=True)]
            scales += [
                (f"ln {dynamic_scale(one.channel)}", c)
                for c, one in zip(weights, gauges, strict=True)
                if rig.channel(one.channel).u_dynamic_rel
            ]
            values = np.column_stack([
                *(len(gauges) * c * mean for _, c in scales), *(shape for *_, shape in own), difference, mean
            ])[used]  # fmt: skip
            means = np.column_stack([np.bincount(places, column) for column in values.T]) / each[:, np.newaxis]
            sigma = np.hypot(noise / np.sqrt(each), PROPORTIONAL * means[:, -1])
            means = means / sigma[:, np.newaxis]
            unknowns = (*(name for name, _ in scales), *(unknown.name for unknown, *_ in own))
            rows.append(LinearBlock(unknowns, means[:, :-2], means[:, -2], 1.0))
            found += [unknown for unknown, *_ in own]
            priors += [
                Prior.of(unknown.name, unknown.name, u, degrees_of_freedom=freedom if unknown is zero else math.inf)
                for unknown, u, _ in own
            ]
    return GaugeAgreement(tuple(rows), tuple(found), tuple(priors))


def gauge_set_aside(calibration: Calibration, signals: Signals) -> tuple[str, str] | None:
    """Return the channel of the gauge that contradicts the others of its pressure and the shot, and why; None if none.

    Where several do, the one that is the least likely.
    """
    residuals: Mapping[ErrorSource, float] = calibration.normalised_residuals
    every = (one for gauges in signals.gauges.values() for one in gauges)
    # one that is taken for exact is not doubted
    own = {one.channel: residuals.get(of_gauge(one.channel), 0.0) for one in every}
    if not own:
        return None
    worst = max(own, key=lambda channel: abs(own[channel]))
    role = next(role for role, gauges in signals.gauges.items() if worst in [one.channel for one in gauges])
    beside = [one.channel for one in signals.gauges[role] if one.channel != worst]
    w = abs(own[worst])
    if w <= LIMIT or any(w - abs(own[channel]) < ALIKE for channel in beside):
        return None
    source = of_gauge(worst)
    off = len(signals.gauges[role]) * calibration.inferred.value(f"ln {source}")
    redundancy = (calibration.pulls[source] / residuals[source]) ** 2
    said = (
        f"it reads {100 * abs(off) / redundancy:.2g} % too {'high' if off > 0 else 'low'} beside "
        f"{', '.join(beside)} and the rest of the shot ({w:.1f} standard deviations, limit {LIMIT:g})"
    )
    return worst, said


def _contrasts(count: int) -> Array:
    """Return combinations that have nothing in common with the mean nor with one another, shape (count - 1, count)."""
    rows = np.zeros((count - 1, count))
    for number in range(1, count):
        rows[number - 1, :number] = 1.0
        rows[number - 1, number] = -number
    return np.asarray(rows / np.linalg.norm(rows, axis=1, keepdims=True))
