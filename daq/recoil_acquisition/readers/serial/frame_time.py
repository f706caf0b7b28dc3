"""Instants of the frames of a serial port: the device's clock, the host's, or a declared rate."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.clock_fit import ClockFit, fit_clock, whole_ns


def back_dated(
    host_ns: NDArray[np.int64], read_ends: NDArray[np.int64], frame_ends: NDArray[np.int64], byte_s: float
) -> NDArray[np.float64]:
    """Date frames back from the reads that delivered them.

    A read returns many frames at one instant. A frame ended on the line before the bytes behind it,
    each of which took its bits' time: ``t = t_read - bytes_behind * bits_per_byte / baudrate``.

    Parameters
    ----------
    host_ns : ndarray of int64, shape (n_reads,)
        Host time of each read.
    read_ends : ndarray of int64, shape (n_reads,)
        Byte of the stream behind each read.
    frame_ends : ndarray of int64, shape (n_frames,)
        Byte of the stream behind each frame.
    byte_s
        How long a byte takes on the line; 0 to leave the frames at their read.

    Returns
    -------
    ndarray of float64, shape (n_frames,)
        Seconds from the first read; NaN for a frame whose read has no host time.
    """
    reads = np.searchsorted(read_ends, frame_ends, side="left")
    known = reads < host_ns.size
    times_s = np.full(frame_ends.size, np.nan)
    at = reads[known]
    behind = read_ends[at] - frame_ends[known]
    times_s[known] = (host_ns[at] - host_ns[0]) / 1e9 - behind * byte_s
    return times_s


def without_steps(
    device_s: NDArray[np.float64],
    host_s: NDArray[np.float64],
    host_zero_ns: int,
    counts: NDArray[np.int64] | None,
) -> tuple[NDArray[np.float64], ClockFit | None]:
    """Compare the device's clock with the host's, and take its steps and wrong stamps out.

    Parameters
    ----------
    device_s : ndarray of float64, shape (n_frames,)
        Stamps of the device in the order of the frames.
    host_s : ndarray of float64, shape (n_frames,)
        The host's, as `back_dated` gives them; frames without either are not compared.
    host_zero_ns
        The host's clock at its time zero.
    counts : ndarray of int64, shape (n_frames,), or None
        The frames' packet counter, unwrapped.

    Returns
    -------
    instants : ndarray of float64, shape (n_frames,)
        s from the first frame, exactly the device's where nothing had to be taken out.
    fit : ClockFit or None
        None below two frames with both stamps.
    """
    compared = np.flatnonzero(np.isfinite(device_s) & np.isfinite(host_s))
    device_ns = whole_ns(device_s[compared])
    host_ns = host_zero_ns + whole_ns(host_s[compared])
    fit = fit_clock(device_ns, host_ns, counts=None if counts is None else counts[compared])
    if fit is None or not (fit.steps or fit.wrong_stamps):
        return device_s, fit
    shift_ns = np.zeros(device_s.size, dtype=np.int64)
    for step in fit.steps:
        # Frames that the host did not stamp are on the side of the last one that it did
        shift_ns[compared[step.index] :] -= whole_ns(np.float64(step.step_s))
    shift_ns[compared] = fit.device_instants_ns(device_ns, host_ns) - device_ns
    instants = device_s + shift_ns / 1e9
    return instants - instants[0], fit
