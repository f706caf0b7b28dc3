"""The mains' hum on a channel: lines fitted in the pre-trigger baseline, and taken off the whole record.

A notch at 50 Hz takes the recoil with it: its pulse lasts a fraction of a period. A hum goes on as it was before
the shot, so it is fitted there, where nothing else is, and continued. The further it is continued the less its
phase is known; what is taken off shrinks with that, so that on average it never adds more than it takes:

    E|A cos(x) - g A cos(x + d)|^2   is least for   g = exp(-u^2 / 2),   d normal with standard deviation u.

The frequency is known beforehand within what EN 50160 allows a public grid, 1 %; the fit refines it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_processing.arguments import require_alike, require_positive
from recoil_processing.repairs.hum_line import HumLine
from recoil_processing.repairs.mains_fit import NEIGHBOURS, Baseline
from recoil_processing.repairs.repair import Repair, RepairKind, changed

MAINS_HZ = (50.0, 60.0)
MOST_HARMONICS = 10
LEAST_PERIODS = 2.0
"""Periods of the mains that the pre-trigger baseline must hold."""
COARSE_RATE_HZ = 5000.0
"""Rate at which a hum is first looked for: ten times the tenth harmonic of 50 Hz."""
TOLD_APART = 10.0
"""Difference of the information criteria from which on one mains frequency is preferred to another: decisive."""


@dataclass(frozen=True, eq=False)
class Hum(ReadOnlyArrays):
    """The hum of one channel.

    Attributes
    ----------
    lines
        Lines by harmonic; none where none stands out or it is not identifiable.
    identifiable
        Whether the pre-trigger baseline is long enough to identify it, and its mains.
    origin_s
        t0 of the lines, from the first sample.
    samples : ndarray, shape (n_samples,)
        Samples without the lines.
    u : ndarray, shape (n_samples,)
        Root mean square of the hum that is left.
    quadrature : ndarray, shape (n_samples,)
        Error that is left by phases that are off by their standard uncertainty: the lines a quarter of a period later,
        as high as what is left of them.
    reason
        Sentence on what was found, or on why nothing is identifiable.
    repairs
        One, or none.
    """

    lines: tuple[HumLine, ...]
    identifiable: bool
    origin_s: float
    samples: Array
    u: Array
    quadrature: Array
    reason: str
    repairs: tuple[Repair, ...]

    @property
    def amplitude(self) -> float:
        """Return the amplitude of all lines together: the root of the sum of their squares."""
        return math.hypot(*(line.amplitude for line in self.lines))

    @property
    def frequency_hz(self) -> float:
        """Return the frequency of the mains; NaN where there is no line."""
        return self.lines[0].frequency_hz / self.lines[0].harmonic if self.lines else math.nan


def subtract_hum(
    samples: Array,
    rate_hz: float,
    in_baseline: Flags,
    *,
    mains_hz: Sequence[float] = MAINS_HZ,
    unit: str = "",
) -> Hum:
    """Find the mains' hum in the pre-trigger baseline, and take it off the whole record.

    Parameters
    ----------
    samples : ndarray, shape (n_samples,)
        Samples, evenly spaced; lost ones are NaN.
    rate_hz
        Samples per second.
    in_baseline : ndarray of bool, shape (n_samples,)
        Samples of the pre-trigger baseline.
    mains_hz
        Frequencies that the mains may have. Where the pre-trigger baseline does not identify which it is, nothing is
        taken off: name the country's.
    unit
        Unit of the samples, for the sentence.

    Raises
    ------
    ValueError
        If shapes do not fit, or a frequency is not positive.
    """
    require_alike(samples=samples, in_baseline=in_baseline)
    require_positive(rate_hz=rate_hz, mains_hz=min(mains_hz, default=0.0))
    at = np.flatnonzero(in_baseline & np.isfinite(samples))
    length_s = (at[-1] - at[0] + 1) / rate_hz if at.size else 0.0
    needed_s = LEAST_PERIODS / min(mains_hz)
    # a sample's breadth of tolerance: two periods may be cut one sample short
    if length_s < needed_s - 1.5 / rate_hz or at.size < 4 * NEIGHBOURS:
        return _nothing(
            samples,
            f"hum cannot be identified: the pre-trigger baseline of {1e3 * length_s:.3g} ms is shorter than "
            f"{LEAST_PERIODS:g} periods of {min(mains_hz):g} Hz; lengthen the pre-trigger to {1e3 * needed_s:.0f} ms",
            identifiable=False,
        )
    origin_s = 0.5 * (at[0] + at[-1]) / rate_hz
    # a level is fitted anyway; without it a constant is exactly nothing
    baseline = Baseline(at / rate_hz - origin_s, samples[at] - samples[at[0]], rate_hz, length_s)
    looked_at = mains_hz if not (glance := baseline.coarser(COARSE_RATE_HZ)) else [
        hz for hz in mains_hz if glance.fit(hz, MOST_HARMONICS)
    ]  # fmt: skip
    found = sorted((f for hz in looked_at if (f := baseline.fit(hz, MOST_HARMONICS))), key=lambda f: f.misfit)
    if not found:
        return _nothing(samples, "no hum stands out of the noise", identifiable=True)
    if len(found) > 1 and found[1].misfit - found[0].misfit < TOLD_APART:
        either = " or ".join(f"{f.nominal_hz:g}" for f in found[:2])
        reason = (
            f"there is a hum, but {1e3 * length_s:.3g} ms of pre-trigger baseline do not show whether of {either} Hz"
        )
        return _nothing(samples, f"{reason}; name the mains, or lengthen the pre-trigger", identifiable=False)
    lines = found[0].lines
    since = np.arange(samples.size) / rate_hz - origin_s
    taken = np.sum([line.taken_at(since) for line in lines], axis=0)
    u = np.sqrt(np.sum([line.u_left_at(since) ** 2 for line in lines], axis=0))
    quadrature = np.sum([line.quadrature_at(since) for line in lines], axis=0)
    result = samples - taken
    names = ", ".join(f"{line.frequency_hz:.4g} Hz {line.amplitude:.3g} {unit}".rstrip() for line in lines)
    left = float(u[-1]) / math.sqrt(0.5 * sum(line.amplitude**2 for line in lines))
    reason = (
        f"hum of {names}, fitted in {1e3 * length_s:.3g} ms of pre-trigger baseline, was taken off the whole record"
    )
    reason += f": {100 * left:.0f} % of it may be left at the end"
    figures = {"mains_hz": found[0].frequency_hz, "u_mains_hz": found[0].u_frequency_hz, "left_at_end": left}
    for line in lines:
        figures[f"amplitude_{line.harmonic}"] = line.amplitude
        figures[f"u_amplitude_{line.harmonic}"] = line.u_amplitude
        figures[f"excess_db_{line.harmonic}"] = line.excess_db
    repair = Repair(RepairKind.HUM_SUBTRACTED, changed(samples, result), reason, figures)
    return Hum(lines, True, origin_s, result, u, quadrature, reason, (repair,))


def _nothing(samples: Array, reason: str, *, identifiable: bool) -> Hum:
    return Hum((), identifiable, 0.0, samples.copy(), np.zeros(samples.size), np.zeros(samples.size), reason, ())
