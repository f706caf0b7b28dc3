"""Onset of the shot: the first instant of force."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.numerics.arrays import Array
from recoil_processing.gaps import first_of_run
from recoil_processing.noise import noise_sigma
from recoil_processing.shot.thinned import thinned_beside

LEAST_LEVEL_SAMPLES = 8
"""Number of samples below which there is no level of the pre-trigger baseline."""
ONSET_SIGMA = 6.0
"""Noise multiples that count as force."""
ONSET_SHARE = 0.02
"""Share of the peak that counts as force."""
ONSET_SAMPLES = 3
"""Samples in a row that must; fewer are a spark of the ignition, not force."""
LEAST_PEAK_SIGMA = 20.0
"""A shot's peak over its noise, at the least."""


def find_onset(times_s: Array, series: Mapping[str, Array]) -> float:
    """Find the first instant of force: breech pressure if it was measured, acceleration otherwise.

    Samples that are faster than a shot needs are thinned first: counts of samples, and noise, mean the same then
    whatever the recorder's rate is.

    Where the signal first exceeds `ONSET_SHARE` of its peak and `ONSET_SIGMA` of its noise for
    `ONSET_SAMPLES` in a row, traced back to the last sample that lay within three times its noise. Level
    and noise are those of the record's first fiftieth.

    Parameters
    ----------
    times_s : ndarray, shape (n,)
        Times on a uniform grid.
    series : mapping of str to ndarray, shape (n,)
        Series by role; lost samples are NaN.

    Raises
    ------
    IdentificationError
        If the signal has no samples, or never leaves its noise.
    """
    role = "breech_pressure" if "breech_pressure" in series else "recoil_acceleration"
    times_s, recorded = thinned_beside(times_s, series[role])
    present = np.flatnonzero(np.isfinite(recorded))
    if present.size < LEAST_LEVEL_SAMPLES:
        raise IdentificationError(
            f"{role} has {present.size} samples on the reference clock",
            expected="a record of the shot",
            remedy="check that its file is of this shot, and how its clock was aligned",
        )
    samples = recorded[present]
    first = samples[: max(64, samples.size // 50)]
    signal = samples - np.median(first[: max(LEAST_LEVEL_SAMPLES, samples.size // 50)])
    sigma = noise_sigma(first)
    sigma = max(sigma, 1e-12) if math.isfinite(sigma) else 1e-12
    peak = float(np.max(signal))
    force = signal > max(ONSET_SHARE * peak, ONSET_SIGMA * sigma)
    begins = first_of_run(force, ONSET_SAMPLES)
    if peak < LEAST_PEAK_SIGMA * sigma or begins is None:
        turned = float(np.max(-signal))
        found, remedy = "", "check that the file is of this shot and the sensor was connected, or record faster"
        # an acceleration swings to both sides, a pressure does not
        if role == "breech_pressure" and turned > max(peak, LEAST_PEAK_SIGMA * sigma):
            found = f", and upside down {turned / sigma:.4g} times"
            remedy = "the `polarity` of its channel in the rig is the other one: change it, or turn the sensor"
        raise IdentificationError(
            f"{role} shows no shot: its peak is {peak / sigma:.4g} times its noise{found}",
            expected=f"at least {LEAST_PEAK_SIGMA:g} times, over {ONSET_SAMPLES} samples",
            remedy=remedy,
        )
    at_rest = np.flatnonzero(signal[: begins + 1] < 3 * sigma)
    return float(times_s[present[at_rest[-1] if at_rest.size else 0]])
