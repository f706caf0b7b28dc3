"""Filter a record that is too long for the memory, block by block, as if it were filtered as a whole.

A recursion is carried forward from block to block exactly. Backward it needs what comes later: it is started
an overlap behind the end of what is given out, from where any error of its start dies away. A filter that is
no recursion is applied to each block with an overlap on both sides.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from recoil_processing.filters.padding import after, before
from recoil_processing.filters.two_pass import STANDARD_MEAN, TwoPass, TwoPassFilter, sweep
from recoil_processing.filters.zero_phase_filter import (
    ZeroPhaseFilter,
    check_finite,
    check_rate,
    check_shape,
    not_finite,
)

Array = NDArray[np.float64]

TOLERANCE = 1e-9
"""Of the largest magnitude of the record: eight digits more than any sensor has."""
_FALSE_ENDS = 5.0
"""Peak of a false continuation and of the truth that it stands for, over the record's peak."""
_OVERLAPS_AT_ONCE = 4


@runtime_checkable
class LocalFilter(ZeroPhaseFilter, Protocol):
    """A zero-phase filter whose results depend on near samples alone, to any tolerance."""

    def memory_samples(self, rate_hz: float, tolerance: float) -> int:
        """Return how far a sample has an influence above a tolerance.

        Parameters
        ----------
        rate_hz : float
        tolerance : float
            Sum of the magnitudes of the weights beyond, on either side.

        Returns
        -------
        int
            For a filter of finite length, all of it.

        Raises
        ------
        ValueError
            If there is no such distance.
        """
        ...


def filter_in_blocks(
    zero_phase: ZeroPhaseFilter, blocks: Iterable[Array], rate_hz: float, *, tolerance: float = TOLERANCE
) -> Iterator[Array]:
    """Filter a record that comes in blocks.

    Parameters
    ----------
    zero_phase : ZeroPhaseFilter
        One of `recoil_processing.filters`.
    blocks : iterable of ndarray, shape (n_samples,) or (n_samples, n_channels)
        In the order of time, without gaps between them, of any lengths, finite.
    rate_hz : float
        Samples per second.
    tolerance : float
        Largest difference from the record filtered as a whole, over the record's largest magnitude. The overlap
        follows from it: see `overlap_samples`.

    Returns
    -------
    iterator of ndarray
        Together as long as the blocks together; their own lengths are others. Each comes as soon as it is
        known. The memory needed is a few times that of the largest block, the padding and the overlap together.

    Raises
    ------
    TypeError
        If the filter is neither a recursion nor local.
    ValueError
        At once if the rate is too low for the filter or the tolerance is not between 0 and 1; on the way if a
        block is not finite or of another shape than those before, or the record is too short for the filter.
    """
    overlap = overlap_samples(zero_phase, rate_hz, tolerance)
    if isinstance(zero_phase, TwoPassFilter):
        return _recursed(zero_phase.two_pass(rate_hz), blocks, overlap)
    return _windowed(zero_phase, blocks, rate_hz, overlap)


def overlap_samples(zero_phase: ZeroPhaseFilter, rate_hz: float, tolerance: float = TOLERANCE) -> int:
    """Return how many samples later than a block `filter_in_blocks` looks at before it gives the block out.

    Parameters
    ----------
    zero_phase : ZeroPhaseFilter
    rate_hz : float
    tolerance : float

    Returns
    -------
    int
        At least 1: for a `LowPass` of half-order 4 about 9 periods of the cut-off at a tolerance of 1e-9.

    Raises
    ------
    TypeError, ValueError
        As in `filter_in_blocks`, at once.
    """
    check_rate(rate_hz)
    if not (math.isfinite(tolerance) and 0 < tolerance < 1):
        raise ValueError(f"tolerance must be between 0 and 1, not {tolerance}")
    if isinstance(zero_phase, TwoPassFilter):
        return zero_phase.two_pass(rate_hz).warm_up_samples(tolerance)
    if isinstance(zero_phase, LocalFilter):
        return max(1, zero_phase.memory_samples(rate_hz, tolerance / _FALSE_ENDS))
    raise TypeError(f"a {type(zero_phase).__name__} cannot work in blocks: it does not tell how far it remembers")


def _recursed(design: TwoPass, blocks: Iterable[Array], overlap: int) -> Iterator[Array]:
    needed = max(design.padding_samples + 1, STANDARD_MEAN)
    inner = replace(design, start="steady")
    gathered = _gathered(blocks, max(needed, overlap))
    first = next(gathered, None)
    if first is None:
        return
    if first.shape[0] < needed:
        yield design.run(first)
        return
    check_finite(first[:needed])
    head = before(first, design.padding_samples, design.padding)
    outputs, state = design.begin(np.concatenate([head[:STANDARD_MEAN], first[:STANDARD_MEAN]]))
    sweep(design.sections, state, head[outputs.shape[0] :])

    def forward(block: Array) -> Array:
        filtered = sweep(design.sections, state, block)
        # a missing or infinite sample stays in the state of a recursion for ever
        if not np.all(np.isfinite(state)):
            raise not_finite()
        return filtered

    recent, held = first[-needed:].copy(), forward(first)
    del first, head
    for block in gathered:
        recent = np.concatenate([recent, block[-needed:]])[-needed:]
        held = np.concatenate([held, forward(block)])
        if held.shape[0] > overlap:
            yield inner.finish(held, held[:0])[:-overlap]
            held = held[-overlap:].copy()
    yield design.finish(held, forward(after(recent, design.padding_samples, design.padding)))


def _windowed(zero_phase: ZeroPhaseFilter, blocks: Iterable[Array], rate_hz: float, overlap: int) -> Iterator[Array]:
    kept: Array | None = None
    given = 0
    for block in _gathered(blocks, _OVERLAPS_AT_ONCE * overlap):
        check_finite(block)
        kept = block if kept is None else np.concatenate([kept, block])
        sure = kept.shape[0] - overlap
        if sure > given:
            yield zero_phase.apply(kept, rate_hz)[given:sure]
            begin = max(0, sure - overlap)
            kept, given = kept[begin:].copy(), sure - begin
    if kept is not None:
        yield zero_phase.apply(kept, rate_hz)[given:]


def _gathered(blocks: Iterable[Array], least: int) -> Iterator[Array]:
    """Join blocks until they have a least number of samples; the last may have fewer. Empty ones are left out."""
    waiting: list[Array] = []
    shape: tuple[int, ...] | None = None
    for block in blocks:
        values = np.asarray(block, dtype=np.float64)
        check_shape(values)
        if shape is None:
            shape = values.shape[1:]
        if values.shape[1:] != shape:
            raise ValueError(f"a block has samples of shape {values.shape[1:]}, those before have {shape}")
        if values.shape[0] == 0:
            continue
        waiting.append(values.copy())
        if sum(part.shape[0] for part in waiting) >= least:
            yield np.concatenate(waiting) if len(waiting) > 1 else waiting[0]
            waiting = []
    if waiting:
        yield np.concatenate(waiting)
