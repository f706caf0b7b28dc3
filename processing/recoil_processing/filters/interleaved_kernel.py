"""A compiled recursion over rows of interleaved channels: all sections in one pass, channels side by side.

A recursion cannot be vectorised along time. Across channels it can: a row of sixteen channels fills the
vector registers of the processor, and every section is applied to it while it is there. The pass backward
follows a block behind the pass forward, while that block is in the cache, so that the table is read once and
written once: it is started far enough behind the block's end for its start to have died away. Needs numba,
the extra ``fast``.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from importlib.util import find_spec

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.errors import RecoilDaqError
from recoil_processing.filters.padding import after, before
from recoil_processing.filters.two_pass import STANDARD_MEAN, TwoPass, too_short
from recoil_processing.filters.zero_phase_filter import check_finite, not_finite

Array = NDArray[np.float64]

Recursion = Callable[[Array, Array, Array, Array, int, int], None]
Kernel = Callable[[Array, Array, Array, Array, bool], None]

LANES = 16
"""Channels that are filtered together; a group of fewer is filled up with zeros."""
BLOCK_ROWS = 4096
"""Rows between which the pass backward follows the pass forward: half a megabyte."""
OVERLAP = 20
"""Rows of a block over the rows that its pass backward is started later, at least: 5 % more work, and still in the
cache."""
TOLERANCE = 1e-13
"""What is left there of that start, over the largest magnitude of the record."""
_TINY = np.array([[1.0, 0.0, 0.0, 1.0, 0.0, 0.0]])
_compiled: dict[int, Kernel] = {}


def _recursion(n_sections: int) -> Recursion:
    """Write the recursion for a number of sections that the compiler knows, so that it can lay them side by side."""

    def sweep(sections: Array, state: Array, source: Array, target: Array, first: int, step: int) -> None:
        # source and target must not overlap: the compiler tests for it at each row, and is slow where they do
        count = source.shape[0]
        z = np.empty((2 * n_sections, LANES))
        for s in range(n_sections):
            for c in range(LANES):
                z[2 * s, c] = state[s, 0, c]
                z[2 * s + 1, c] = state[s, 1, c]
        # written twice: of a loop that is known to go forward the compiler tests once for overlaps, not at each row
        if step > 0:
            for i in range(count):
                for c in range(LANES):
                    v = source[i, c]
                    for s in range(n_sections):
                        y = sections[s, 0] * v + z[2 * s, c]
                        z[2 * s, c] = sections[s, 1] * v - sections[s, 4] * y + z[2 * s + 1, c]
                        z[2 * s + 1, c] = sections[s, 2] * v - sections[s, 5] * y
                        v = y
                    target[i, c] = v
        else:
            for k in range(count):
                i = first + step * k
                for c in range(LANES):
                    v = source[i, c]
                    for s in range(n_sections):
                        y = sections[s, 0] * v + z[2 * s, c]
                        z[2 * s, c] = sections[s, 1] * v - sections[s, 4] * y + z[2 * s + 1, c]
                        z[2 * s + 1, c] = sections[s, 2] * v - sections[s, 5] * y
                        v = y
                    target[i, c] = v
        for s in range(n_sections):
            for c in range(LANES):
                state[s, 0, c] = z[2 * s, c]
                state[s, 1, c] = z[2 * s + 1, c]

    return sweep


@cache
def kernel_at_hand() -> bool:
    """Tell whether numba is installed."""
    return find_spec("numba") is not None


def load_kernel(n_sections: int) -> Kernel:
    """Compile the kernel for a number of sections, or load it from where an earlier process kept it.

    Parameters
    ----------
    n_sections : int

    Returns
    -------
    callable
        Of sections, state, source, target and direction, as `recoil_processing.filters.two_pass.sweep`; all of `LANES`
        channels.

    Raises
    ------
    RecoilDaqError
        If numba is not installed.
    """
    if n_sections not in _compiled:
        try:
            from numba import njit
        except ImportError as error:
            raise RecoilDaqError(
                "the compiled filter kernel needs numba",
                remedy="install it by `pip install 'recoil-daq[fast]'`, or take the engine 'scipy'",
            ) from error
        tiny = (np.repeat(_TINY, n_sections, axis=0), np.zeros((n_sections, 2, LANES)))
        tiny_rows = (np.zeros((1, LANES)), np.zeros((1, LANES)))
        # "contract": a product and a sum may be rounded once instead of twice; nothing else is let loose
        try:
            compiled = njit(cache=True, nogil=True, fastmath={"contract"})(_recursion(n_sections))
            compiled(*tiny, *tiny_rows, 0, 1)
        except (RuntimeError, OSError):
            # there is no folder where compiled code could be kept: it is compiled for this process alone
            compiled = njit(nogil=True, fastmath={"contract"})(_recursion(n_sections))
            compiled(*tiny, *tiny_rows, 0, 1)

        def kernel(sections: Array, state: Array, source: Array, target: Array, backward: bool) -> None:
            first, step = (source.shape[0] - 1, -1) if backward else (0, 1)
            compiled(sections, state, source, target, first, step)

        _compiled[n_sections] = kernel
    return _compiled[n_sections]


def run_interleaved(design: TwoPass, samples: Array, out: Array | None = None) -> Array:
    """Filter a table of interleaved channels by the compiled kernel.

    Parameters
    ----------
    design : TwoPass
    samples : ndarray, shape (n_samples, n_channels)
        Quickest in C order, and of 16 channels.
    out : ndarray of float64, same shape, optional
        Where the results go; the samples themselves are allowed.

    Returns
    -------
    ndarray of float64, same shape
        That of scipy to 1e-12 of the largest magnitude. Beside it, memory is needed for padding and blocks alone
        where the samples are float64 in C order.

    Raises
    ------
    RecoilDaqError
        If numba is not installed.
    ValueError
        As in `TwoPass.run`.
    """
    kernel = load_kernel(design.sections.shape[0])
    source = np.ascontiguousarray(samples, dtype=np.float64)
    # another layout would be compiled anew
    direct = out is not None and out.flags.c_contiguous and out.dtype == np.float64
    target = out if out is not None and direct else np.empty(source.shape)
    if source.size:
        if source.shape[0] < design.least_samples:
            raise too_short(source.shape[0])
        for first in range(0, source.shape[1], LANES):
            _run_group(kernel, design, source, target, slice(first, min(first + LANES, source.shape[1])))
    if out is None or direct:
        return target
    out[...] = target
    return out


def _run_group(kernel: Kernel, design: TwoPass, source: Array, target: Array, group: slice) -> None:
    """Filter at most `LANES` channels of a table."""
    count, sections = source.shape[0], design.sections
    length = min(design.padding_samples, count - 1)
    check_finite(source[: length + 1, group])
    check_finite(source[-length - 1 :, group])
    head = _in_lanes(before(source[:, group], length, design.padding))
    tail = _in_lanes(after(source[:, group], length, design.padding))
    outputs, state = design.begin(np.concatenate([head[:STANDARD_MEAN], _in_lanes(source[:STANDARD_MEAN, group])]))
    overlap = design.warm_up_samples(TOLERANCE)
    block = min(max(BLOCK_ROWS, OVERLAP * overlap), count)
    held = np.empty((overlap + block, LANES))
    unused = np.empty((max(length, overlap), LANES))
    whole = source.shape[1] == LANES

    def give(first: int, rows: Array, backward_state: Array) -> None:
        if whole:
            kernel(sections, backward_state, rows, target[first : first + rows.shape[0]], True)
        else:
            filtered = np.empty(rows.shape)
            kernel(sections, backward_state, rows, filtered, True)
            target[first : first + rows.shape[0], group] = filtered[:, : group.stop - group.start]

    begun = head[outputs.shape[0] :]
    kernel(sections, state, begun, unused[: begun.shape[0]], False)
    kept = 0
    for first in range(0, count, block):
        rows = source[first : first + block]
        # read-only samples, too, would be compiled anew
        rows = rows if whole and rows.flags.writeable else _in_lanes(rows[:, group])
        kernel(sections, state, rows, held[kept : kept + rows.shape[0]], False)
        # a missing or infinite sample stays in the state of a recursion for ever
        if not np.all(np.isfinite(state)):
            raise not_finite()
        kept += rows.shape[0]
        if first + block < count:
            later = design.steady_state(held[kept - 1])
            kernel(sections, later, held[kept - overlap : kept], unused[:overlap], True)
            give(first + rows.shape[0] - kept, held[: kept - overlap], later)
            held[:overlap] = held[kept - overlap : kept].copy()
            kept = overlap
    padded = np.empty(tail.shape)
    kernel(sections, state, tail, padded, False)
    outputs, last = design.begin_backward(held[:kept], padded)
    ended = padded[: length - outputs.shape[0]]
    kernel(sections, last, ended, unused[: ended.shape[0]], True)
    give(count - kept, held[:kept], last)


def _in_lanes(rows: Array) -> Array:
    """Return rows of at most `LANES` channels beside channels of zeros, a new array."""
    filled = np.zeros((rows.shape[0], LANES))
    filled[:, : rows.shape[1]] = rows
    return filled
