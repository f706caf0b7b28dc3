"""Instants of the frames of a serial port: the device's clock, the host's, or a declared rate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class HostFit:
    """How the host's clock relates to the device's: ``host = (1 + drift) * device + offset_s``.

    Attributes
    ----------
    offset_s : float
        Host time of device time zero, counted from the host's first read.
    drift : float
    typical_delay_s, largest_delay_s : float
        Median and maximum of how much later than the line the reads came.
    """

    offset_s: float
    drift: float
    typical_delay_s: float
    largest_delay_s: float


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
    byte_s : float
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


def fit_host(device_s: NDArray[np.float64], host_s: NDArray[np.float64]) -> HostFit | None:
    """Fit the line below all host times: a read is late, never early.

    Of all lines that no point lies below, the one with the least sum of distances is an edge of the
    lower convex hull, the one over the mean of the device times.

    Parameters
    ----------
    device_s, host_s : ndarray of float64, shape (n_frames,)

    Returns
    -------
    HostFit or None
        None below two different device times.
    """
    usable = np.isfinite(device_s) & np.isfinite(host_s)
    x, y = device_s[usable], host_s[usable]
    order = np.lexsort((y, x))
    x, y = x[order], y[order]
    first = np.r_[True, np.diff(x) > 0] if x.size else np.zeros(0, dtype=bool)
    x, y = x[first], y[first]
    if x.size < 2:
        return None
    hull: list[int] = []
    for i in range(x.size):
        while len(hull) > 1:
            a, b = hull[-2], hull[-1]
            if (y[b] - y[a]) * (x[i] - x[a]) >= (y[i] - y[a]) * (x[b] - x[a]):
                hull.pop()
            else:
                break
        hull.append(i)
    middle = device_s[usable].mean()
    edge = int(np.clip(np.searchsorted(x[hull], middle), 1, len(hull) - 1))
    a, b = hull[edge - 1], hull[edge]
    slope = float((y[b] - y[a]) / (x[b] - x[a]))
    offset_s = float(y[a] - slope * x[a])
    delays = host_s[usable] - slope * device_s[usable] - offset_s
    return HostFit(offset_s, slope - 1.0, float(np.median(delays)), float(delays.max()))


def increasing(times_s: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Tell which instants are later than all before them; NaN never is. Shape (n,)."""
    seen = np.where(np.isnan(times_s), -np.inf, times_s)
    newest = np.maximum.accumulate(np.r_[-np.inf, seen])[:-1]
    return seen > newest
