"""How the clock of a source is found on the reference clock, tried on the records themselves.

A source that repeats a signal of the reference clock is aligned by it; one that sees the same motion in another
quantity, by that. Both are tried, and named with what they came to; where neither holds, the way is asked for.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from recoil_acquisition.clocks.timebase import usual_step_s
from recoil_acquisition.quantities.quantity import UNITS, Unit
from recoil_daq.drafting.recorded_source import PIXELS, RecordedSignal
from recoil_processing.alignment.align import LEAST_CORRELATION as SAME_MOTION
from recoil_processing.alignment.motion_alignment import align_motion
from recoil_processing.alignment.redundant_alignment import align_redundant
from recoil_processing.noise import noise_sigma
from recoil_processing.shot.clocks.line_clocks import fit_to_forces

LEAST_CORRELATION = 0.9
"""Correlation from which on a signal repeats another, and a motion is the same."""
_SAME_SCALE = (0.7, 1.4)
"""Ratio of two sensors of one motion, whatever their scales are off."""
_LEFT = 0.5
"""Share of a signal that its repeat may leave unexplained."""
_UNIT_SHARE = 0.08
"""Share by which the ratio of a field without a unit may be off a unit's."""
_DRIFT = 5e-5
MOST_PAIRS = 40
"""Pairs of signals of one source that are compared at most."""
_REPEATED = ("acceleration", "pressure", "force", "angular_rate")
"""Quantities of signals that others repeat."""
_LEAST_OF_BAND = 1e-30


@dataclass(frozen=True, eq=False)
class Twin:
    """A signal of a source that repeats one of the reference clock.

    Attributes
    ----------
    gain
        Numbers of the signal, SI where its unit is known, per SI unit of the other.
    """

    signal: RecordedSignal
    of: RecordedSignal
    correlation: float
    gain: float

    @property
    def polarity(self) -> int:
        """1 where it swings as the other does, else -1."""
        return 1 if self.gain > 0 else -1

    @property
    def per_number(self) -> float:
        """Value of one of the signal's numbers by the scale of the other, SI."""
        return 1.0 / abs(self.gain)

    def unit(self) -> str:
        """Return the unit of a signal that states none, by the scale of the other; empty if none is near."""
        size = self.per_number
        fitting = {
            name: abs(unit.factor / size - 1.0)
            for name, unit in UNITS.items()
            if self.of.quantity in unit.quantities and _is_usual(name, unit)
        }
        best = min(fitting, key=lambda name: fitting[name], default="")
        return best if best and fitting[best] < _UNIT_SHARE else ""


_RARE = (
    "gn", "g_n", "g0", "hPa", "atm", "kgf/cm^2", "kgf/mm^2", "Torr", "mmHg", "inHg", "mmH2O", "cmH2O", "inH2O", "kgf",
    "ozf", "klbf",
)  # fmt: skip
"""Units that lie near a usual one, or that no device's numbers come in."""


def _is_usual(name: str, unit: Unit) -> bool:
    return unit.offset == 0.0 and name not in _RARE


@dataclass(frozen=True)
class ClockProposal:
    """A way in which a source's clock is found.

    Attributes
    ----------
    align
        Table ``align`` of the source, with the signals' keys in place of channels' names.
    signals
        Keys of the signals that it compares, that of the reference clock last.
    """

    align: Mapping[str, Any]
    signals: tuple[str, ...]
    reason: str


def find_twins(
    signals: Sequence[RecordedSignal], reference: Sequence[RecordedSignal], *, found_in_bytes: bool = False
) -> tuple[Twin, ...]:
    """Find the signals of a source that repeat one of the reference clock, the best first.

    Parameters
    ----------
    found_in_bytes
        Whether nothing is known of the source's signals but their places: any quantity is tried then.
    """
    found = []
    pairs = [(one, of) for one in signals for of in reference if _comparable(one, of, found_in_bytes)]
    pairs = sorted(pairs, key=_unlike)[:MOST_PAIRS]
    for one in signals:
        tried = [_twin(one, of, known=bool(one.quantity)) for own, of in pairs if own is one]
        best = max((twin for twin in tried if twin is not None), key=lambda twin: twin.correlation, default=None)
        if best is not None:
            found.append(best)
    return tuple(sorted(found, key=lambda twin: -twin.correlation))


def _unlike(pair: tuple[RecordedSignal, RecordedSignal]) -> float:
    """Return how far the peaks of two signals are from each other: those that are alike are tried first."""
    peaks = [abs(one.swing.peak) for one in pair if one.swing is not None]
    return abs(math.log(peaks[0] / peaks[1])) if len(peaks) == 2 and min(peaks) > 0 else math.inf


def _comparable(one: RecordedSignal, of: RecordedSignal, found_in_bytes: bool) -> bool:
    moving = one.swing is not None and one.swing.moves and of.swing is not None and of.swing.moves
    same = one.quantity == of.quantity if one.quantity else found_in_bytes
    return moving and same and of.quantity in _REPEATED


def _twin(one: RecordedSignal, of: RecordedSignal, *, known: bool) -> Twin | None:
    """Compare two signals by the fit that the alignment makes; None if one does not repeat the other."""
    reference, step_s = of.samples(), _step_s(of)
    if step_s is None or not np.all(np.isfinite(reference)):
        return None
    try:
        fit = align_redundant(
            one.times_s(), one.samples(), float(of.base.start_s), step_s, reference, drift_allowance=_DRIFT
        )
    except ValueError:
        return None
    if isinstance(fit, str) or fit.correlation < LEAST_CORRELATION or fit.residual_share > _LEFT:
        # a sensor that is mounted the other way round correlates as well
        turned = _turned(one, of, step_s)
        if turned is None:
            return None
        correlation, gain = turned
    else:
        correlation, gain = fit.correlation, fit.gain
    if known and not _SAME_SCALE[0] <= abs(gain) <= _SAME_SCALE[1]:
        return None
    return Twin(one, of, correlation, gain)


def _turned(one: RecordedSignal, of: RecordedSignal, step_s: float) -> tuple[float, float] | None:
    try:
        fit = align_redundant(
            one.times_s(), -one.samples(), float(of.base.start_s), step_s, of.samples(), drift_allowance=_DRIFT
        )
    except ValueError:
        return None
    if isinstance(fit, str) or fit.correlation < LEAST_CORRELATION or fit.residual_share > _LEFT:
        return None
    return fit.correlation, -fit.gain


def _step_s(signal: RecordedSignal) -> float | None:
    """Return the step of an even record; None of one with gaps."""
    base = signal.base
    if base.step_s is not None:
        return float(base.step_s)
    steps = np.diff(signal.times_s())
    usual = usual_step_s(signal.times_s()) if steps.size else math.nan
    return usual if math.isfinite(usual) and np.all(np.abs(steps - usual) < 0.5 * usual) else None


def by_twin(twin: Twin) -> ClockProposal:
    """Align a source by a signal that repeats one of the reference clock."""
    reason = f"{twin.signal.name} repeats {twin.of.name}, correlation {twin.correlation:.3f}"
    align = {"method": "redundant", "channel": twin.signal.key, "against": twin.of.key}
    return ClockProposal(align, (twin.signal.key, twin.of.key), reason)


def by_motion(travel: RecordedSignal, acceleration: RecordedSignal) -> ClockProposal | None:
    """Align a source by the travel that an acceleration of the reference clock is of; None if it is of another one."""
    samples, step_s = acceleration.samples(), _step_s(acceleration)
    if step_s is None or not np.all(np.isfinite(samples)) or travel.unit.casefold() in PIXELS:
        return None
    for sign in _signs(travel, acceleration):
        try:
            fit = align_motion(
                travel.times_s(), sign * travel.samples(), float(acceleration.base.start_s), step_s, samples,
                acceleration_sigma_m_s2=max(noise_sigma(samples[: max(samples.size // 20, 8)]), _LEAST_OF_BAND),
                drift_allowance=_DRIFT,
            )  # fmt: skip
        except ValueError:
            continue
        if not isinstance(fit, str) and fit.correlation >= LEAST_CORRELATION:
            reason = f"{travel.name} is the motion that {acceleration.name} feels, correlation {fit.correlation:.3f}"
            align = {"method": "motion", "against": acceleration.key}
            return ClockProposal(align, (travel.key, acceleration.key), reason)
    return None


def by_forces(
    motions: Sequence[RecordedSignal], forces: Sequence[tuple[RecordedSignal, float]]
) -> ClockProposal | None:
    """Align a source by a motion that the forces of the reference clock drive; None if they drive another one.

    Parameters
    ----------
    motions
        Signals of the source, the one that tells most first.
    forces
        Signals of one record of the reference clock, each with its sign, that which stands for all first.
    """
    step_s = _step_s(forces[0][0]) if forces else None
    alike = [(one, sign) for one, sign in forces if one.base.same_instants(forces[0][0].base)]
    net = np.sum([sign * one.samples() for one, sign in alike], axis=0)
    if step_s is None or not np.all(np.isfinite(net)):
        return None
    for motion in motions:
        if motion.unit.casefold() in PIXELS:
            continue
        try:
            fit = fit_to_forces(
                motion.times_s(), motion.samples(), motion.quantity, float(forces[0][0].base.start_s), step_s, net,
                drift_allowance=_DRIFT,
            )  # fmt: skip
        except ValueError:
            continue
        if not isinstance(fit, str) and fit.correlation >= SAME_MOTION and fit.gain > 0:
            against = forces[0][0]
            reason = f"{motion.name} is the motion that {against.name} drives, correlation {fit.correlation:.3f}"
            align = {"method": "motion", "against": against.key}
            return ClockProposal(align, (motion.key, against.key), reason)
    return None


def _signs(travel: RecordedSignal, acceleration: RecordedSignal) -> list[float]:
    """Return the signs by which both swing to the same side, the likelier one first."""
    if travel.swing is None or acceleration.swing is None:
        return [1.0, -1.0]
    alike = np.sign(travel.swing.peak) == np.sign(acceleration.swing.peak)
    return [1.0, -1.0] if alike else [-1.0, 1.0]
