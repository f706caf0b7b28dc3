"""Notes on a device's clock that was compared with the host's."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.clocks.clock_breaks import jumps_by_count
from recoil_acquisition.clocks.clock_fit import SMALLEST_STEP_S, ClockFit
from recoil_acquisition.remark import Note, NoteCode, Remark


def notes_of_clock(fit: ClockFit, whose: str) -> list[Remark]:
    """Say which steps of a clock were taken out, and how many of its stamps were wrong.

    Parameters
    ----------
    whose
        Name of the clock's owner: ``interface``, ``device``.

    Returns
    -------
    list of Remark
    """
    texts = [
        f"the {whose}'s clock stepped by {step.step_s:+.6f} s (u {step.u_step_s:.1g} s)"
        f" at {(step.host_ns - fit.host_zero_ns) / 1e9:.3f} s: taken out"
        for step in fit.steps
    ]
    if fit.wrong_stamps:
        texts.append(
            f"{len(fit.wrong_stamps)} stamps of the {whose} do not fit its clock: those frames are dated by the host"
        )
    return [Note(NoteCode.TIME, None, text) for text in texts]


def notes_of_jumps(device_s: NDArray[np.float64], counts: NDArray[np.int64]) -> list[Remark]:
    """Say where a clock that only the packet counter can be compared with does not go with it.

    Parameters
    ----------
    device_s : ndarray of float64, shape (n_frames,)
    counts : ndarray of int64, shape (n_frames,)
        Packet counter, unwrapped.
    """
    jumps = jumps_by_count(device_s, counts, SMALLEST_STEP_S)
    if not jumps.size:
        return []
    before_s, at_s = device_s[jumps[0] - 1], device_s[jumps[0]]
    where = f"first by {at_s - before_s:+.6f} s at {before_s:.3f} s"
    doubt = "without the host's times a step of the clock cannot be distinguished from a pause of the device"
    text = f"the device's clock jumps at {jumps.size} places as the packet counter does not, {where}: {doubt}"
    return [Note(NoteCode.TIME, None, text)]
