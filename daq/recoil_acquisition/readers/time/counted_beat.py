"""The even beat of frames that are counted by their sender, where the host's stamps come in bursts."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.clock_fit import fit_clock, whole_ns
from recoil_acquisition.readers.time.bursts import Bursts


def counted_beat(
    numbers: NDArray[np.int64], times_s: NDArray[np.float64], bursts: Bursts
) -> NDArray[np.float64] | None:
    """Return when counted frames were sent: at even intervals, on the line along the lower edge of their stamps.

    Parameters
    ----------
    numbers : ndarray of int64, shape (n_frames,)
        The sender's count of its frames, unwrapped.
    times_s : ndarray of float64, shape (n_frames,)
        Stamps of the host, increasing, s.
    bursts
        Bursts in which the stamps come.

    Returns
    -------
    ndarray of float64, shape (n_frames,), or None
        Instants of the frames, s; None where the numbers do not count frames that are sent evenly: half of the stamps
        are later than a burst explains. Single ones may be, since a host stands still now and then.
    """
    if not (np.diff(numbers) > 0).all():
        return None
    # of frames half a record apart most were stamped as late as each other, whatever stalls there were
    half = numbers.size // 2
    period_s = float(np.median((times_s[half:] - times_s[:-half]) / (numbers[half:] - numbers[:-half])))
    beat_ns = whole_ns(period_s * (numbers - numbers[0]))
    fit = fit_clock(beat_ns, whole_ns(times_s - times_s[0]))
    if fit is None or fit.steps or fit.wrong_stamps or fit.typical_delay_s > bursts.within_s + bursts.pause_s:
        return None
    found_s = times_s[0] + fit.offset_s + (1.0 + fit.drift) * (beat_ns / 1e9)
    return found_s if bool((np.diff(found_s) > 0).all()) else None
