"""Delay of the frames of a bus between its interface and the host, from the stamps of both.

A shot is cut out of every source around the instant of its trigger. An interface, its driver or the machine may
deliver a frame late without anyone's having been late to read it: dated by its arrival, it would move the window of all
other sources. The interface's stamps go on evenly meanwhile, so that the difference of both clocks shows by how much.
An interface's clock that is set back runs backwards, which shows it; set back by less than a pause of the bus, it looks
like a delay until the usual difference is the new one, at most 2.5 s.
"""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

Instants = NDArray[np.int64]
Seconds = NDArray[np.float64]

LONGEST_S = 1.0
"""What seems held back for longer is no delay but another setting of the interface's clock."""
_BUCKET_NS = 250_000_000
_BUCKETS = 20
"""The least difference of each quarter of a second is kept for five; their median is that of no wrong stamp and of no
delay that lasts less than half of them."""
_FEWEST_BUCKETS = 4
"""Before as many are there, nothing is known."""


class HeldBack:
    """Follows by how much the frames of one bus are late."""

    def __init__(self) -> None:
        self._least_ns: deque[tuple[int, int]] = deque(maxlen=_BUCKETS)
        self._stamp_ns = 0

    def late_s(self, host_ns: Instants, device_ns: Instants) -> Seconds:
        """Return by how much frames were held back, at most `LONGEST_S`; 0 where it is not known.

        Parameters
        ----------
        host_ns : ndarray of int64, shape (n_frames,), n_frames at least 1
            When they were received, not running backwards.
        device_ns : ndarray of int64, shape (n_frames,)
            The stamps of the interface's own clock.

        Returns
        -------
        ndarray of float64, shape (n_frames,)
        """
        difference = host_ns - device_ns
        if np.any(np.diff(device_ns, prepend=self._stamp_ns) < 0):
            self._least_ns.clear()  # its clock was set back
        self._stamp_ns = int(device_ns[-1])
        late_ns = np.zeros(host_ns.size)
        if len(self._least_ns) >= _FEWEST_BUCKETS:
            usual_ns = sorted(least for _, least in self._least_ns)[(len(self._least_ns) - 1) // 2]
            late_ns = np.maximum(difference - usual_ns, 0.0)
            late_ns[late_ns > LONGEST_S * 1e9] = 0.0
        bucket, least = int(host_ns[-1]) // _BUCKET_NS, int(difference.min())
        if self._least_ns and self._least_ns[-1][0] == bucket:
            least = min(least, self._least_ns.pop()[1])
        self._least_ns.append((bucket, least))
        return late_ns / 1e9
