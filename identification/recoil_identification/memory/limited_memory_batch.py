"""Limited-memory least squares of a whole record, block by block: by products, and by rotations where needed."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from recoil_identification.memory.rotations import merge_factors, qr_of_runs, solve_qr
from recoil_identification.memory.samples import ScaledRecord
from recoil_identification.memory.window_policy import WindowPolicy, is_sound, judged
from recoil_identification.memory.windowed_estimates import QR_BIT, SILENT_BIT, WindowedEstimates, WindowStatus
from recoil_identification.memory.windows import FloatArray, Packing, Solution, gram_of_windows, solve_gram

UNSOUND_BIT = 0x40
"""Mark of a window for which sums of products are not accurate enough."""
GRAM_NUMBERS = 2**17
"""Sums of products at a time: the scratch stays in the processor's cache."""
SOLVED_NUMBERS = 2**15
"""Sums of products that are solved at a time, for the same reason."""
MODERATE_EXPONENT = 200
"""Of two, of a quotient of scales up to which one product takes an estimate to its unit with the bits of two."""
QR_SAMPLES = 4096
"""Windows at a time that are merged from two factors."""
QR_BYTES = 24 * 2**20
"""Scratch for the factors of the blocks that are rotated together; one block at least."""


class BatchEstimates:
    """The estimates of a record being filled in.

    Parameters
    ----------
    workers
        Threads that share the blocks. A block's results do not depend on which thread works them out, or when.
    out
        Results whose memory is used again.
    """

    def __init__(
        self, record: ScaledRecord, policy: WindowPolicy, workers: int, out: WindowedEstimates | None = None
    ) -> None:
        self.record, self.policy, self.workers = record, policy, workers
        n_samples, n_parameters = record.n_samples, policy.n_parameters
        self.packing = Packing(n_parameters, record.n_columns - n_parameters)
        n_outputs = self.packing.n_outputs
        self.parameters, self.standard_errors, self.residual_sum_of_squares, self.pivots, self.marks = (
            _memory(n_parameters, n_outputs, n_samples) if out is None else _memory_of(out)
        )
        self.counts = None if record.gaps is None else _counts(record.gaps, record.block)
        self.skipped = 0 if policy.partial else policy.window - 1
        with np.errstate(over="ignore"):  # a limit beyond float64 is one that no window reaches
            self.least_energy = np.ldexp(
                policy.min_excitation, -2 * (record.exponents[:n_parameters] + record.weight_exponent)
            )
        # a quotient of scales may lie beyond float64, its root never
        exponents = record.exponents[n_parameters:] - record.exponents[:n_parameters, np.newaxis]
        self.unit = np.ldexp(1.0, exponents // 2)
        self.other_unit = np.ldexp(1.0, exponents - exponents // 2)
        self.moderate = bool((np.abs(exponents) < MODERATE_EXPONENT).all())
        self.root_unit = np.ldexp(1.0, record.exponents[n_parameters:] + record.weight_exponent)

    def by_products(self) -> bool:
        """Fill every window by sums of products on plain arrays; return whether all are sound."""
        record = self.record
        at_once = max(1, GRAM_NUMBERS // (self.packing.n_entries * record.block))
        solved_at_once = max(4096, SOLVED_NUMBERS // self.packing.n_entries)

        def fill(first: int) -> int:
            stop = min(first + at_once, record.n_blocks)
            windows = slice(first * record.block, min(stop * record.block, record.n_samples))
            gram = gram_of_windows(record.rows(first - 1, stop), self.packing)
            n_unsound = 0
            for start in range(windows.start, windows.stop, solved_at_once):
                some = slice(start, min(start + solved_at_once, windows.stop))
                part = gram[:, some.start - windows.start : some.stop - windows.start]
                solution = solve_gram(np.ascontiguousarray(part), self.packing)
                n_unsound += self._fill(some, solution, is_sound(solution))
            return n_unsound

        return not sum(self._each(fill, range(0, record.n_blocks, at_once)))

    def by_rotations(self, wanted: NDArray[np.bool_]) -> None:
        """Fill the wanted windows by rotations."""
        blocks = np.unique(np.flatnonzero(wanted) // self.record.block)
        at_once = max(1, QR_BYTES // (2 * 8 * self.packing.n_entries * self.record.block * self.workers))

        def fill(start: int) -> int:
            return self._rotate(blocks[start : start + at_once], wanted)

        self._each(fill, range(0, blocks.size, at_once))

    @property
    def tried(self) -> NDArray[np.bool_]:
        """Windows that hold enough samples, shape (n_samples,)."""
        return np.equal(self._untried(slice(0, self.record.n_samples)), WindowStatus.IDENTIFIED)

    @property
    def unsound(self) -> NDArray[np.bool_]:
        """Windows for which sums of products are not accurate enough, shape (n_samples,)."""
        return np.asarray(np.not_equal(self.marks & np.uint8(UNSOUND_BIT), 0))

    def finished(self, one_output: bool) -> WindowedEstimates:
        """Return what has been filled in."""
        if one_output:
            parameters, standard_errors = self.parameters[:, 0].T, self.standard_errors[:, 0].T
        else:
            parameters, standard_errors = np.moveaxis(self.parameters, -1, 0), np.moveaxis(self.standard_errors, -1, 0)
        return WindowedEstimates(
            parameters=parameters,
            standard_errors=standard_errors,
            residual_sum_of_squares=self.residual_sum_of_squares[0] if one_output else self.residual_sum_of_squares.T,
            marks=self.marks,
            pivots=self.pivots,
            counts=self.counts,
            window=int(self.policy.window),
        )

    def forget_unsound(self) -> None:
        """Take the marks of unsound windows off: what the operator was asked for is what they are."""
        self.marks &= np.uint8(0xFF ^ UNSOUND_BIT)

    def _each(self, fill: Callable[[int], int], starts: Iterable[int]) -> list[int]:
        """Fill every part, by one thread or several."""

        def quietly(start: int) -> int:
            with np.errstate(under="ignore"):  # a product too small for float64 is as good as zero in every sum here
                return fill(start)

        if self.workers == 1:
            return [quietly(start) for start in starts]
        with ThreadPoolExecutor(self.workers) as pool:
            return list(pool.map(quietly, starts))

    def _rotate(self, blocks: NDArray[np.intp], wanted: NDArray[np.bool_]) -> int:
        """Fill the wanted windows that end in some blocks."""
        record, block, packing = self.record, self.record.block, self.packing
        factors = qr_of_runs(self._beginnings_and_endings(blocks), packing)
        n_entries, n_blocks = factors.shape[1], blocks.size
        positions_at_once = max(1, QR_SAMPLES // n_blocks)
        for position in range(0, block, positions_at_once):
            positions = np.arange(position, min(position + positions_at_once, block))
            windows = (blocks * block + positions[:, np.newaxis]).ravel()
            chosen = np.flatnonzero(wanted[np.minimum(windows, record.n_samples - 1)] & (windows < record.n_samples))
            beginning = factors[positions + 1, :, :n_blocks].swapaxes(0, 1).reshape(n_entries, -1).take(chosen, axis=1)
            ending = factors[block - 1 - positions, :, n_blocks:].swapaxes(0, 1).reshape(n_entries, -1)
            merge_factors(beginning, ending.take(chosen, axis=1), packing)
            self._fill(windows[chosen], solve_qr(beginning, packing), None)
        return 0

    def _beginnings_and_endings(self, blocks: NDArray[np.intp]) -> FloatArray:
        """Rows of the blocks, then of the blocks before them backwards, shape (n_columns, 2 * n_blocks, block)."""
        runs = np.split(blocks, np.flatnonzero(np.diff(blocks) > 1) + 1)
        rows = [self.record.rows(int(run[0]) - 1, int(run[-1]) + 1) for run in runs]
        return np.concatenate([run[:, 1:] for run in rows] + [run[:, :-1, ::-1] for run in rows], axis=1)

    def _untried(self, windows: slice | NDArray[np.intp]) -> NDArray[np.uint8]:
        """Status of windows that hold too few samples, and `WindowStatus.IDENTIFIED` of those that do not."""
        places = np.arange(windows.start, windows.stop) if isinstance(windows, slice) else windows
        few = self._count(windows) < self.policy.needed_count
        status = np.where(few, WindowStatus.TOO_FEW_SAMPLES, WindowStatus.IDENTIFIED).astype(np.uint8)
        status[places < self.skipped] = WindowStatus.WINDOW_NOT_FULL
        return status

    def _count(self, windows: slice | NDArray[np.intp]) -> NDArray[np.int64]:
        """Count the samples present in windows."""
        if self.counts is not None:
            return self.counts[windows]
        places = np.arange(windows.start, windows.stop) if isinstance(windows, slice) else windows
        return np.minimum(places + 1, self.policy.window)

    def _fill(self, windows: slice | NDArray[np.intp], solution: Solution, sound: NDArray[np.bool_] | None) -> int:
        """Judge a solution, put it back into the caller's units, and count what is not sound; None is by rotations."""
        whole = isinstance(windows, slice) and self.counts is None and windows.start >= self.policy.window - 1
        degrees: NDArray[np.int64] | int = (
            self.policy.window - self.policy.n_parameters
            if whole
            else np.maximum(self._count(windows) - self.policy.n_parameters, 1)
        )
        status, standard_errors = judged(solution, degrees, self.least_energy, self.policy.max_relative_error)
        marks = status
        if sound is None:
            marks = marks | np.uint8(QR_BIT)
        elif not sound.all():
            marks = marks | np.where(sound, np.uint8(0), np.uint8(UNSOUND_BIT))
        silent = solution.smallest_pivot == 0.0
        if silent.any():
            marks = marks | np.where(silent, np.uint8(SILENT_BIT), np.uint8(0))
        if not whole:
            untried = self._untried(windows)
            tried = np.equal(untried, WindowStatus.IDENTIFIED)
            marks = np.where(tried, marks, untried)
            status = np.where(tried, status, untried)
            solution.smallest_pivot[~tried] = np.nan
        self.marks[windows] = marks
        if self.pivots is not None:
            self.pivots[windows] = solution.smallest_pivot
        unit, other_unit = self.unit[..., np.newaxis], self.other_unit[..., np.newaxis]
        estimates, left = solution.parameters, solution.residual_sum_of_squares
        if self.record.scaled:
            if self.moderate:
                unit = unit * other_unit
            estimates *= unit
            standard_errors *= unit
            if not self.moderate:
                estimates *= other_unit
                standard_errors *= other_unit
            with np.errstate(over="ignore"):  # a sum of squares beyond float64 is infinite; the estimates are not
                left *= self.root_unit[:, np.newaxis]
                left *= self.root_unit[:, np.newaxis]
        blank = status != WindowStatus.IDENTIFIED
        if blank.any():
            for values in (estimates, standard_errors, left):
                values[..., blank] = np.nan
        self.parameters[..., windows] = estimates
        self.standard_errors[..., windows] = standard_errors
        self.residual_sum_of_squares[:, windows] = left
        return 0 if sound is None else int(np.count_nonzero(marks & np.uint8(UNSOUND_BIT)))


_Memory = tuple[FloatArray, FloatArray, FloatArray, FloatArray | None, NDArray[np.uint8]]


def _memory(n_parameters: int, n_outputs: int, n_samples: int) -> _Memory:
    """Allocate results, the samples of a number side by side."""
    shape = (n_parameters, n_outputs, n_samples)
    return (
        np.empty(shape),
        np.empty(shape),
        np.empty(shape[1:]),
        np.empty(n_samples) if n_parameters > 1 else None,
        np.empty(n_samples, dtype=np.uint8),
    )


def _memory_of(estimates: WindowedEstimates) -> _Memory:
    """Take the memory of earlier results."""
    parameters, errors, left = (
        estimates.parameters,
        estimates.standard_errors,
        estimates.residual_sum_of_squares,
    )
    if left.ndim == 1:
        return parameters.T[:, np.newaxis], errors.T[:, np.newaxis], left[np.newaxis], estimates.pivots, estimates.marks
    return np.moveaxis(parameters, 0, -1), np.moveaxis(errors, 0, -1), left.T, estimates.pivots, estimates.marks


def _counts(present: NDArray[np.bool_], block: int) -> NDArray[np.int64]:
    """Count the samples present in each window."""
    total = np.cumsum(present, dtype=np.int64)
    counts = total.copy()
    counts[block:] -= total[:-block]
    return counts
