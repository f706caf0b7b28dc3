"""What runs a two-pass filter over a table of channels: scipy, on one thread or several, or a compiled kernel.

All of them run the same recursion from the same start over the same padding. The choice is one of time
and memory alone, and is made by the table alone: its size, its layout, its number of channels.
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from recoil_processing.filters.interleaved_kernel import kernel_at_hand, run_interleaved
from recoil_processing.filters.two_pass import TwoPass, TwoPassFilter
from recoil_processing.filters.zero_phase_filter import check_finite, check_rate, check_shape

Array = NDArray[np.float64]
Engine = Literal["automatic", "scipy", "kernel"]

THREADS_FROM = 1 << 18
"""Values of a table from which threads are worth their start: 4 ms of scipy."""
KERNEL_FROM = 1 << 27
"""Values from which the kernel is worth its loading, half a second, and once for all its compilation, two seconds."""
KERNEL_CHANNELS = 4
"""Channels below which the kernel's vectors are too empty to be worth it."""
_ROWS_AT_ONCE = 1 << 16


def filter_channels(
    two_pass_filter: TwoPassFilter,
    samples: Array,
    rate_hz: float,
    *,
    engine: Engine = "automatic",
    threads: int | None = None,
    out: Array | None = None,
) -> Array:
    """Filter a table of channels by an engine of one's choice.

    The filter's own ``apply`` chooses; this is for long tables, whose owner knows the machine.

    Parameters
    ----------
    two_pass_filter : TwoPassFilter
        `LowPass` or `ChannelFrequencyClass`.
    samples : ndarray of float64, shape (n_samples,) or (n_samples, n_channels)
        Finite. The kernel reads rows of channels (C order); scipy is quickest on channels that lie each in
        one piece (Fortran order, or the transpose of an array of rows).
    rate_hz : float
    engine : {"automatic", "scipy", "kernel"}
        The kernel needs the extra ``fast``.
    threads : int, optional
        For scipy, one channel at a time on each: by default one for each processor that this process may use.
    out : ndarray of float64, same shape, optional
        Where the results go; the samples themselves are allowed. A table that is there already is quicker than
        one whose memory the system has to clear first. Beside it, memory for a few channels on each thread is
        needed.

    Returns
    -------
    ndarray of float64, same shape
        `out` if it was given.

    Raises
    ------
    RecoilDaqError
        If the kernel is asked for and the extra ``fast`` is not installed.
    TypeError
        If the filter is no recursion, or `out` is not float64.
    ValueError
        If there are fewer than one thread, the engine is unknown, `out` has another shape, or as in the filter's
        ``apply``. The samples are then as they were.
    """
    check_rate(rate_hz)
    check_shape(samples)
    if engine not in ("automatic", "scipy", "kernel"):
        raise ValueError(f"engine must be automatic, scipy or kernel, not {engine!r}")
    if threads is not None and threads < 1:
        raise ValueError(f"threads must be at least 1, not {threads}")
    if not isinstance(two_pass_filter, TwoPassFilter):
        raise TypeError(f"a {type(two_pass_filter).__name__} is no recursion: call its apply")
    design = two_pass_filter.two_pass(rate_hz)
    if out is not None and out.dtype != np.float64:
        raise TypeError(f"out must be float64, not {out.dtype}")
    if out is not None and out.shape != samples.shape:
        raise ValueError(f"out must have the shape of the samples, {samples.shape}, not {out.shape}")
    if out is not None and np.may_share_memory(out, samples):
        # what is refused must be as it was
        for first in range(0, samples.shape[0], _ROWS_AT_ONCE):
            check_finite(samples[first : first + _ROWS_AT_ONCE])
    return filter_rows(design, samples, engine=engine, threads=threads, out=out)


def filter_rows(
    design: TwoPass,
    samples: Array,
    *,
    engine: Engine = "automatic",
    threads: int | None = None,
    out: Array | None = None,
) -> Array:
    """Filter a record along its first axis by a recursion that is designed already.

    Parameters
    ----------
    design : TwoPass
    samples : ndarray, shape (n_samples,) or (n_samples, n_channels)
    engine, threads
        See `filter_channels`.
    out : ndarray of float64, same shape, optional
        Where the results go; the samples themselves are allowed.

    Returns
    -------
    ndarray of float64, same shape
        `out` if it was given.

    Raises
    ------
    RecoilDaqError, ValueError
        As in `filter_channels`; `out` is then of no use.
    """
    if engine == "kernel" or (engine == "automatic" and _kernel_pays(samples)):
        table = samples if samples.ndim == 2 else samples[:, np.newaxis]
        target = None if out is None else out.reshape(table.shape)
        result = run_interleaved(design, table, target)
        return result.reshape(samples.shape) if out is None else out
    if samples.ndim == 1:
        result = design.run(samples)
        if out is None:
            return result
        out[...] = result
        return out
    target = np.empty(samples.shape, order="F" if samples.flags.f_contiguous else "C") if out is None else out

    def filter_one(channel: int) -> None:
        target[:, channel] = design.run(np.ascontiguousarray(samples[:, channel]))

    count = samples.shape[1]
    wanted = threads if threads is not None else usable_processors() if samples.size >= THREADS_FROM else 1
    if min(wanted, count) <= 1:
        for channel in range(count):
            filter_one(channel)
    else:
        with ThreadPoolExecutor(min(wanted, count)) as pool:
            for done in [pool.submit(filter_one, channel) for channel in range(count)]:
                done.result()
    return target


def usable_processors() -> int:
    """Return how many processors this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _kernel_pays(samples: Array) -> bool:
    # by its size alone: a result must not depend, not even in its last digit, on what the process did before
    if samples.ndim != 2 or samples.shape[1] < KERNEL_CHANNELS or not samples.flags.c_contiguous:
        return False
    return samples.size >= KERNEL_FROM and kernel_at_hand()
