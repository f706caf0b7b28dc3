"""Drop-outs: samples that are no measurement, found and masked, never filled.

A sample is none where the instrument says so (NaN), where the converter was stuck at a code longer than noise
holds one, and where its stamp is not to be believed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.clocks.timebase import rounded_step_s, usual_step_s
from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_acquisition.numerics.normal_distribution import MAD_TO_SIGMA
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_processing.arguments import require_alike, require_increasing
from recoil_processing.gaps import runs_of
from recoil_processing.repairs.repair import Repair, RepairKind

CHANCE = 1e-6
"""Runs of equal values that noise may make in a record."""
LEAST_RUN = 3
"""Equal values in a row that can be a hold."""
BLOCKS = 20
"""Parts of a record, of which the quietest shows how often noise repeats a value."""
LEAST_STEPS = 4.0
"""Steps of the resolution that noise must change a value by, in the median, for repeats to mean a drop-out."""
MOST_AT_REST = 32
"""Changes at the begin of a record, where it is quiet, that show whether there is noise."""
STEP_SHARE = 0.01
"""Share of the period by which a time step may be off a whole number of periods, whatever the jitter."""
STAMP_CHANCE = 1e-3
"""Steps that jitter may put beyond the tolerance, in a record."""
LEAST_FAULTS = 4
"""Number of the largest deviations of steps that are not taken for jitter; in a long record a fiftieth."""


@dataclass(frozen=True, eq=False)
class DropOuts(ReadOnlyArrays):
    """Samples that are no measurement.

    Attributes
    ----------
    lost, held, mistimed : ndarray of bool, shape (n_samples,)
        Flags of samples that are NaN or infinite; of repeats of a stuck converter, without the first sample of each
        run, which was measured; and of samples whose stamp is off.
    absent
        Samples that the stamps say were never recorded: steps of several periods.
    """

    lost: Flags
    held: Flags
    mistimed: Flags
    absent: int

    @property
    def flags(self) -> Flags:
        """Any of them, shape (n_samples,)."""
        return self.lost | self.held | self.mistimed

    def mask(self, samples: Array) -> tuple[Array, tuple[Repair, ...]]:
        """Mask them.

        Parameters
        ----------
        samples : ndarray, shape (n_samples,)

        Returns
        -------
        samples : ndarray, shape (n_samples,)
            Samples; NaN where one is no measurement.
        repairs : tuple of Repair
            One, or none where there is no drop-out.
        """
        flags = self.flags
        masked = np.where(flags, np.nan, samples)
        if not flags.any():
            return masked, ()
        runs = runs_of(flags)
        longest = max(stop - start for start, stop in runs)
        counts = {
            "lost": int(np.count_nonzero(self.lost)),
            "held": int(np.count_nonzero(self.held)),
            "mistimed": int(np.count_nonzero(self.mistimed)),
        }
        causes = {"lost": "not recorded", "held": "held by a stuck converter", "mistimed": "with a stamp that is off"}
        parts = ", ".join(f"{counts[name]} {cause}" for name, cause in causes.items() if counts[name])
        share = f"{np.count_nonzero(flags)} of {flags.size} samples"
        sentence = f"{share} are left out ({parts}), the longest gap {longest} samples"
        figures = {name: float(count) for name, count in counts.items()}
        figures |= {"absent": float(self.absent), "gaps": float(len(runs)), "longest_gap": float(longest)}
        return masked, (Repair(RepairKind.DROP_OUTS_MASKED, flags, sentence, figures),)


def find_drop_outs(samples: Array, times_s: Array | None = None, *, spared: Flags | None = None) -> DropOuts:
    """Find what is no measurement.

    Parameters
    ----------
    samples : ndarray, shape (n_samples,)
        Samples as recorded; lost ones are NaN.
    times_s : ndarray, shape (n_samples,), optional
        Stamps of a source whose instants should be even. Leave them out where a bus makes messages late.
    spared : ndarray of bool, shape (n_samples,), optional
        Samples whose equal values are no hold: what is clipped, see `recoil_processing.repairs.clipping.find_clipped`.

    Raises
    ------
    ValueError
        If shapes do not fit, or stamps do not increase.
    """
    clipped = np.zeros(samples.shape, dtype=bool) if spared is None else spared
    require_alike(samples=samples, spared=clipped)
    # what is infinite was beyond the converter: clipping judges it where a range says so
    lost = np.isnan(samples) | (np.isinf(samples) & ~clipped)
    held = _held(samples, lost | clipped)
    mistimed, absent = (np.zeros(samples.size, dtype=bool), 0) if times_s is None else _mistimed(times_s, samples)
    return DropOuts(lost, held, mistimed, absent)


def _held(samples: Array, apart: Flags) -> Flags:
    """Flag repeats in runs that are longer than noise makes them; none where the resolution hides the noise.

    Normal noise whose differences have the standard deviation s repeats a value of resolution q with the
    probability ``q / (s sqrt(2 pi))``.
    """
    held = np.zeros(samples.size, dtype=bool)
    with np.errstate(invalid="ignore"):
        changes = np.where(apart[1:] | apart[:-1], np.nan, np.diff(samples))
    present = changes[np.isfinite(changes)]
    moving = np.abs(present[present != 0])
    if present.size < LEAST_RUN * BLOCKS or moving.size == 0:
        return held
    at_rest = present[: min(present.size // BLOCKS, MOST_AT_REST)]
    if np.count_nonzero(at_rest == 0) > 0.5 * at_rest.size:
        # a record that begins without noise has none, or too little for its resolution
        return held
    q = float(moving.min())
    # only what changes: where every other value is a repeat the median of all changes would be zero
    quietest = min(float(np.median(np.abs(b[b != 0]))) for b in np.array_split(present, BLOCKS) if np.any(b))
    if quietest < LEAST_STEPS * q:
        return held
    chance = q / (MAD_TO_SIGMA * quietest * math.sqrt(2 * math.pi))
    least = max(LEAST_RUN, 1 + math.ceil(math.log(CHANCE / present.size) / math.log(chance)))
    for start, stop in runs_of(np.asarray(changes == 0)):
        if stop - start + 1 >= least:
            # the first of the equal samples was measured
            held[start + 1 : stop + 1] = True
    return held


def _mistimed(times_s: Array, samples: Array) -> tuple[Flags, int]:
    """Flag samples whose stamp is off, and count those that are absent."""
    require_alike(stamps=times_s, samples=samples)
    steps = judge_steps(times_s)
    flags = np.zeros(samples.size, dtype=bool)
    # a stamp between two steps that are off is the one at fault; beside a lone one either may be
    before, behind = np.concatenate([[False], steps.off]), np.concatenate([steps.off, [False]])
    if flags.size:
        flags |= before[: flags.size] & behind[: flags.size]
        alone = steps.off & ~flags[:-1] & ~flags[1:]
        flags[:-1] |= alone
        flags[1:] |= alone
    return flags, steps.absent


@dataclass(frozen=True, eq=False)
class Steps(ReadOnlyArrays):
    """Time steps of stamps that should be even, against whole numbers of periods.

    Attributes
    ----------
    off : ndarray of bool, shape (n - 1,)
        Flags of steps that are none, by more than the jitter of all stamps explains.
    absent
        Samples that the steps say were never recorded.
    period_s
        Period of the stamps; NaN below `LEAST_RUN` of them.
    jitter_s
        Standard deviation of a stamp, as the steps show it.
    """

    off: Flags
    absent: int
    period_s: float
    jitter_s: float


def judge_steps(times_s: Array) -> Steps:
    """Compare the steps between stamps with whole numbers of periods.

    Stamps of software, or with few digits, lie about an even beat by more than a converter's: such jitter is no fault
    of any one of them. A step is off where it is beyond what Laplace's distribution, with the mean deviation of the
    rest, gives one step of a thousand records.

    Parameters
    ----------
    times_s : ndarray, shape (n,)

    Raises
    ------
    ValueError
        If stamps do not increase.
    """
    require_increasing(stamps=times_s)
    steps = np.diff(times_s)
    if times_s.size < LEAST_RUN:
        return Steps(np.zeros(steps.size, dtype=bool), 0, math.nan, 0.0)
    rounded_s = rounded_step_s(times_s)
    if rounded_s is not None:
        return Steps(np.zeros(steps.size, dtype=bool), 0, rounded_s, float(np.ptp(steps)) / math.sqrt(12.0))
    period_s = usual_step_s(times_s)
    ratio = steps / period_s
    whole = np.round(ratio)
    beyond = ratio - whole
    size = max(_mean_of_most(np.abs(beyond)), _mean_of_most(_off_the_beat(np.append(0.0, np.cumsum(beyond)))))
    tolerance = max(STEP_SHARE, size * math.log(steps.size / STAMP_CHANCE))
    off = np.abs(beyond) > tolerance
    return Steps(off, max(int(np.sum(whole[~off] - 1)), 0), period_s, period_s * _deviation(beyond[~off]))


def _mean_of_most(sizes: Array) -> float:
    """Return the mean but for the largest ones, which may be faults."""
    kept = np.sort(sizes)[: sizes.size - max(LEAST_FAULTS, sizes.size // 50)]
    return float(kept.mean()) if kept.size else 0.0


def _off_the_beat(beyond: Array) -> Array:
    """Return by what share of a step stamps are off the beat of their stretch of the record, at whichever place."""
    off = []
    for stretch in np.array_split(beyond, BLOCKS):
        phase = np.exp(2j * np.pi * stretch)
        off.append(np.abs(np.angle(phase * np.conj(phase.mean()))) / (2 * np.pi) if stretch.size else stretch)
    return np.concatenate(off)


def _deviation(beyond: Array) -> float:
    """Return the standard deviation of stamps whose steps have such deviations."""
    return float(np.std(beyond)) / math.sqrt(2.0) if beyond.size else 0.0
