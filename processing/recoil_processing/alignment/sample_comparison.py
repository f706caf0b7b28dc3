"""Comparison of one record with another one of the same instrument, sample by sample: a stream with its own file.

Both are laid on the instrument's beat, and on one another: by the number of their samples where both tell it, else by
the correlation of their steps, and then by how many samples are equal. What is left is counted, and named where it is a
scale, a shift or a hole. Samples that are equal are equal as the instrument stored them: whole counts exactly, floats
bit by bit, or to a tolerance that has a name.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_acquisition.numerics.read_only import ReadOnlyArrays

COUNTS, BITS, SINGLE, PRINTED = "whole counts", "bit by bit", "single precision", "printed digits"
"""Ways in which samples are equal, as a comparison names them."""
EXPECTED, CORRELATED, AS_OTHERS = "time", "correlation", "other channels"
"""Ways in which two records were laid on one another."""
SINGLE_REL = 2.0**-23
"""Share of a value to which single precision keeps it, twice over: once in the stream, once in the file."""
MOST_SPARSE = 8
"""Places on the beat for each sample, beyond which a record is no record on that beat."""
_LEAST_OVERLAP = 0.1
"""Share of the preview that must overlap the file."""
_CANDIDATES = 4
"""Offsets of the highest correlations whose samples are compared."""
_LEAST_RUN = 16
"""Samples of a part that is laid on the file by itself."""
_NO_CHANCE = 64
"""Samples in a row that are equal at one place, and change, as no other place has them."""
_SURE_SCALE = 5.0
"""Standard uncertainties by which a scale must be off 1."""
_LEAST_SCALE = 1e-6
_EXPLAINED = 0.5
"""Share of the differences that a scale must take away."""
_FIT = 0.9
"""Share of a part's samples that must be equal where it lies elsewhere."""
_LARGEST = float(np.finfo(np.float64).max)
_FINEST, _COARSEST, _FEW = 9, -3, 256
"""Decimals to which numbers may be printed, and how many numbers are looked at first."""


@dataclass(frozen=True, eq=False)
class Sampled(ReadOnlyArrays):
    """Samples of one channel by their numbers on the instrument's beat.

    Attributes
    ----------
    samples : ndarray of float64, shape (n_samples,)
        Values in the unit of the file; a lost one is NaN.
    numbers : ndarray of int64, shape (n_samples,)
        Number of each on the beat, strictly increasing.
    count_size
        Value of one whole count; 0 where the samples were no counts.
    """

    samples: Array
    numbers: NDArray[np.int64]
    count_size: float = 0.0

    @property
    def dense(self) -> Array:
        """Samples from the first number to the last one, NaN where there is none; empty without any."""
        if not self.samples.size:
            return np.empty(0)
        found = np.full(int(self.numbers[-1] - self.numbers[0]) + 1, np.nan)
        found[self.numbers - self.numbers[0]] = np.where(np.isfinite(self.samples), self.samples, np.nan)
        return found


@dataclass(frozen=True)
class SampleComparison:
    """Result of a comparison; numbers of samples are those of the file.

    Attributes
    ----------
    compared, equal
        Numbers of samples that both have, and of those that are equal.
    rule
        Way in which they are equal.
    tolerance
        Difference that counts as none, in the unit of the file; 0 bit by bit.
    missing_in_preview, missing_in_file
        Numbers of samples within both that the preview lacks and the file has, and the other way round.
    beyond
        Number of samples of the preview before the file's first one, or behind its last.
    lag
        Number of the file's sample that is the preview's sample 0; None where nothing tells it.
    aligned_by
        Way in which that was found.
    shift
        Samples by which the preview lies late against where it should be; None where nothing tells where.
    scale, offset
        Line ``preview = scale * file + offset`` that most of the differences lie on; 1 and 0 without one.
    largest
        Largest difference, in the unit of the file.
    first_difference, first_missing
        Number of the first sample that is different, and of the first one that the preview lacks; None without one.
    values
        Values of the first different sample in the preview and in the file.
    slip_at, slip
        Number of the sample before which the preview left so many out without a gap in its own numbers; None and 0
        where it did not.
    """

    compared: int = 0
    equal: int = 0
    rule: str = BITS
    tolerance: float = 0.0
    missing_in_preview: int = 0
    missing_in_file: int = 0
    beyond: int = 0
    lag: int | None = None
    aligned_by: str = CORRELATED
    shift: int | None = None
    scale: float = 1.0
    offset: float = 0.0
    largest: float = 0.0
    first_difference: int | None = None
    values: tuple[float, float] | None = None
    first_missing: int | None = None
    slip_at: int | None = None
    slip: int = 0

    @property
    def different(self) -> int:
        """Number of samples that both have and that are not equal."""
        return self.compared - self.equal

    @property
    def proven_equal(self) -> bool:
        """Whether every sample of the preview is the file's, at its place, and none is missing where both overlap."""
        missing = self.missing_in_preview or self.missing_in_file
        return bool(self.compared) and not (self.different or missing or self.shift)

    def to_json(self) -> dict[str, Any]:
        """Return it in JSON types."""
        said = asdict(self)
        return {**said, "values": None if self.values is None else list(self.values), "different": self.different,
                "proven_equal": self.proven_equal}  # fmt: skip


def beat_numbers(times_s: Array, step_s: float) -> NDArray[np.int64] | None:
    """Return the numbers of instants on a beat, from 0; None where they lie on no such beat.

    Parameters
    ----------
    times_s : ndarray, shape (n_samples,)
        Instants, increasing.
    step_s
        Step of the beat.
    """
    if not times_s.size:
        return np.empty(0, dtype=np.int64)
    numbers: NDArray[np.int64] = np.rint((times_s - times_s[0]) / step_s).astype(np.int64)
    if np.any(np.diff(numbers) < 1) or numbers[-1] >= MOST_SPARSE * max(times_s.size, 1 << 16):
        return None
    return numbers


def printed_step(values: Array) -> float:
    """Return the decimal step to which all numbers of a text are rounded; 0 where there is none.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Numbers as they were read.
    """
    there = values[np.isfinite(values)]
    if not there.size:
        return 0.0
    for decimals in range(_COARSEST, _FINEST + 1):
        # a few tell that most steps are not it
        if all(np.array_equal(np.round(some, decimals), some) for some in (there[:_FEW], there)):
            return float(10.0**-decimals)
    return 0.0


def compare_records(
    channels: Mapping[str, tuple[Sampled, Sampled]],
    *,
    expected: int | None = None,
    within: int = 0,
    printed: Mapping[str, float] | None = None,
) -> dict[str, SampleComparison]:
    """Compare the channels of a preview with those of the file that replaces it.

    Parameters
    ----------
    channels
        Preview and file of each channel, on one beat.
    expected
        Number of the file's sample, from its first one, at which the preview's first one should lie; None if nothing
        tells it: then a shift is told against the other channels.
    within
        Samples by which that may be off.
    printed
        Step to which the file, or the preview, is printed, by channel; 0 or none where it is not.
    """
    found: dict[str, SampleComparison] = {}
    guess = expected
    for name, (preview, file) in channels.items():
        # numbers of any size stand in a damaged file: what overflows is equal to nothing, and on no line
        with np.errstate(all="ignore"):
            found[name] = _compared(preview, file, guess, (printed or {}).get(name, 0.0))
        if guess is None and found[name].lag is not None and found[name].equal:
            guess = found[name].lag
    lags: Counter[int] = Counter()
    for one in found.values():
        if one.lag is not None:
            lags[one.lag] += max(one.equal, 1)
    ought, by = expected, EXPECTED
    if ought is None and len(channels) > 1 and lags:
        ought, by = lags.most_common(1)[0][0], AS_OTHERS
    return {name: _placed(one, ought, by, within) for name, one in found.items()}


def _placed(one: SampleComparison, ought: int | None, by: str, within: int) -> SampleComparison:
    """Say by how much a preview lies elsewhere than it ought to."""
    if ought is None or one.lag is None:
        return replace(one, aligned_by=CORRELATED)
    shift = one.lag - ought
    if by == EXPECTED and abs(shift) <= within:
        shift = 0
    return replace(one, shift=shift, aligned_by=CORRELATED if shift else by)


def _compared(preview: Sampled, file: Sampled, guess: int | None, printed: float) -> SampleComparison:
    ours, whole = preview.dense, file.dense
    size = file.count_size or preview.count_size
    at_guess = None if guess is None else _Match.at(ours, whole, guess, size, printed)
    # what stands still is where the others are
    if at_guess is not None and (at_guess.whole or not _steps(ours).any()):
        return _told(ours, whole, at_guess.lag, size, printed, AS_OTHERS)
    lags = _likely_lags(ours, whole)
    if not lags:
        return SampleComparison(beyond=int(np.isfinite(ours).sum()))
    best = max((_Match.at(ours, whole, lag, size, printed) for lag in lags), key=lambda one: one.share)
    # equal in a long run, and nowhere else as a whole: something fell out there, or is wrong
    if at_guess is not None and at_guess.run >= _NO_CHANCE and not best.whole:
        return _told(ours, whole, at_guess.lag, size, printed, AS_OTHERS)
    # where nothing is equal anywhere, as behind another scale, the correlation alone tells
    return _told(ours, whole, best.lag if best.share > 0 else lags[0], size, printed, CORRELATED)


@dataclass(frozen=True, eq=False)
class _Match:
    """Samples that are equal where the preview lies at one place; those that repeat the one before tell nothing.

    Attributes
    ----------
    share
        Share of the telling samples that are equal.
    run
        Longest run of telling samples that are.
    whole
        Whether all are, and there are some.
    begins, ends
        Number of the preview's first sample of that run, and the one behind its last.
    """

    lag: int
    share: float
    run: int
    whole: bool
    begins: int
    ends: int

    @classmethod
    def at(cls, ours: Array, whole: Array, lag: int, size: float, printed: float) -> _Match:
        a, b, first = _overlap(ours, whole, lag)
        telling = np.isfinite(a) & np.isfinite(b)
        telling[1:] &= np.diff(b) != 0.0
        places = np.flatnonzero(telling)
        same = _within(a[places], b[places], size, printed)
        if places.size < _LEAST_RUN:
            return cls(lag, 0.0, 0, False, 0, 0)
        ends = np.flatnonzero(np.diff(np.concatenate(([False], same, [False])).astype(np.int8)))
        longest = int(np.argmax(ends[1::2] - ends[::2])) if ends.size else 0
        low, high = (int(ends[2 * longest]), int(ends[2 * longest + 1])) if ends.size else (0, 0)
        begins, stop = (int(places[low]), int(places[high - 1]) + 1) if ends.size else (0, 0)
        before = first - lag
        return cls(lag, float(same.mean()), high - low, bool(same.all()), begins + before, stop + before)


def _told(ours: Array, whole: Array, lag: int, size: float, printed: float, by: str) -> SampleComparison:
    """Say what the samples at one place are beside each other."""
    a, b, first = _overlap(ours, whole, lag)
    both = np.isfinite(a) & np.isfinite(b)
    missing = np.flatnonzero(np.isnan(a) & np.isfinite(b))
    rule, tolerance, same = _rule(a[both], b[both], size, printed)
    places = np.flatnonzero(both)
    apart = places[~same]
    found = SampleComparison(
        compared=int(both.sum()), equal=int(same.sum()), rule=rule, tolerance=tolerance,
        missing_in_preview=int(missing.size),
        missing_in_file=int((np.isfinite(a) & ~both).sum()), beyond=int(np.isfinite(ours).sum() - np.isfinite(a).sum()),
        lag=lag, aligned_by=by,
        largest=min(float(np.abs(a[apart] - b[apart]).max(initial=0.0)), _LARGEST),
        first_difference=int(apart[0]) + first if apart.size else None,
        values=(float(a[apart[0]]), float(b[apart[0]])) if apart.size else None,
        first_missing=int(missing[0]) + first if missing.size else None,
    )  # fmt: skip
    if not apart.size:
        return found
    scale, offset = _line(a[both], b[both], ~same)
    if (scale, offset) != (1.0, 0.0):
        return replace(found, scale=scale, offset=offset)
    return _slipped(found, ours, whole, size, printed)


def _slipped(found: SampleComparison, ours: Array, whole: Array, size: float, printed: float) -> SampleComparison:
    """Say from which sample on a preview lies elsewhere, if it does: samples are missing, and their numbers are not."""
    lag = found.lag or 0
    here = _Match.at(ours, whole, lag, size, printed)
    for part, begins in ((ours[here.ends :], here.ends), (ours[: here.begins], 0)):
        if here.run < _LEAST_RUN or part.size < _LEAST_RUN:
            continue
        for other in _likely_lags(part, whole):
            if other - begins != lag and _Match.at(part, whole, other, size, printed).share >= _FIT:
                slip, at = other - begins - lag, here.ends if begins else here.begins
                return replace(found, slip_at=at + lag, slip=slip if begins else -slip)
    return found


def _overlap(ours: Array, whole: Array, lag: int) -> tuple[Array, Array, int]:
    """Return the parts of both that lie on one another, and the number of the file's first sample of them."""
    first, stop = max(lag, 0), min(lag + ours.size, whole.size)
    if stop <= first:
        return np.empty(0), np.empty(0), first
    return ours[first - lag : stop - lag], whole[first:stop], first


def _within(a: Array, b: Array, size: float, printed: float) -> Flags:
    """Return which samples are equal by the loosest rule that may be."""
    if size:
        return np.asarray(np.rint((a - b) / size) == 0.0)
    # half of the last digit, and what writing it in binary leaves of it
    loosest = np.maximum(SINGLE_REL * np.maximum(np.abs(a), np.abs(b)), 0.5 * printed * (1.0 + 1e-6))
    return np.asarray((a == b) | (np.abs(a - b) <= loosest))


def _rule(a: Array, b: Array, size: float, printed: float) -> tuple[str, float, Flags]:
    """Return the strictest rule by which as many samples are equal as by the loosest one."""
    loose = _within(a, b, size, printed)
    if size:
        return COUNTS, 0.0, loose
    bits = np.asarray(a == b)
    if bits.sum() == loose.sum() > 0:
        return BITS, 0.0, bits
    largest = np.maximum(np.abs(a), np.abs(b))
    single = bits | (np.abs(a - b) <= SINGLE_REL * largest)
    if single.sum() == loose.sum():
        return SINGLE, float(SINGLE_REL * largest.max(initial=0.0)), single
    return PRINTED, 0.5 * printed, loose


def _steps(dense: Array) -> Array:
    """Return the steps between neighbouring samples; 0 where one of both is missing."""
    return np.nan_to_num(np.diff(dense), nan=0.0, posinf=0.0, neginf=0.0)


def _likely_lags(ours: Array, whole: Array) -> list[int]:
    """Return the offsets at which the steps of both correlate best, the best first."""
    mine, theirs = _steps(ours), _steps(whole)
    if not mine.any() or not theirs.any():
        return []
    mine, theirs = mine / np.abs(mine).max(), theirs / np.abs(theirs).max()
    n = fft.next_fast_len(mine.size + theirs.size, real=True)
    product = fft.irfft(fft.rfft(theirs, n) * np.conj(fft.rfft(mine, n)), n)
    lags = np.arange(-mine.size + 1, theirs.size)
    energy_of = [np.concatenate(([0.0], np.cumsum(one**2))) for one in (mine, theirs)]
    low, high = np.maximum(lags, 0), np.minimum(lags + mine.size, theirs.size)
    energies = [
        energy_of[0][high - lags] - energy_of[0][low - lags],
        energy_of[1][high] - energy_of[1][low],
    ]
    floor = 1e-12 * float(energy_of[0][-1] * energy_of[1][-1])
    score = np.abs(product[lags]) / np.sqrt(np.maximum(energies[0] * energies[1], floor))
    score[high - low < max(_LEAST_OVERLAP * mine.size, 1)] = -np.inf
    most = min(_CANDIDATES, score.size)
    best = np.argpartition(score, score.size - most)[-most:]
    return [int(lags[i]) for i in best[np.argsort(-score[best])] if score[i] > 0]


def _line(a: Array, b: Array, apart: Flags) -> tuple[float, float]:
    """Return the line of the preview on the file where most of the differences lie on one; 1 and 0 otherwise."""
    if a.size < _LEAST_RUN or not np.ptp(b):
        return 1.0, 0.0
    good = np.ones(a.size, dtype=np.bool_)
    scale, offset, u_scale, u_offset = 1.0, 0.0, math.inf, math.inf
    for _ in range(3):
        x, y = b[good], a[good]
        if x.size < _LEAST_RUN or not np.ptp(x):
            return 1.0, 0.0
        since = x - x.mean()
        spread = float(since @ since)
        if not spread:
            return 1.0, 0.0
        scale = float(since @ y) / spread
        offset = float(y.mean() - scale * x.mean())
        left = a - scale * b - offset
        sigma = 1.4826 * float(np.median(np.abs(left[good])))
        u_scale = sigma / math.sqrt(spread)
        u_offset = math.hypot(sigma / math.sqrt(x.size), u_scale * float(x.mean()))
        good = np.asarray(np.abs(left) <= max(4.0 * sigma, 1e-12 * float(np.abs(a).max())))
    if not math.isfinite(scale) or not math.isfinite(offset):
        return 1.0, 0.0
    off_scale = abs(scale - 1.0) > max(_SURE_SCALE * u_scale, _LEAST_SCALE)
    reach = float(np.abs(b).max())
    off_zero = abs(offset) > max(_SURE_SCALE * u_offset, _LEAST_SCALE * reach)
    before, after = (float(np.median(np.abs(one[apart]))) for one in (a - b, a - scale * b - offset))
    if not (off_scale or off_zero) or after > _EXPLAINED * before:
        return 1.0, 0.0
    return scale if off_scale else 1.0, offset if off_zero else 0.0
