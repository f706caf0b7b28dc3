"""The window of a live shot in what its sources delivered to it.

A capture holds all that may have arrived within the shot's window. What was read late may have, and where reading
stood still for longer than the pause between two shots, it holds the next shot too. When samples were taken is known
only when their frames are decoded and dated: what was taken outside the window is left out then, and stays in the
capture.
"""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable, Sequence

import numpy as np

from recoil_acquisition.clocks.timebase import WALL_CLOCK_NS, AbsoluteStart
from recoil_acquisition.readers.excerpt import span_of
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.shot.acquisition import AT_TRIGGER, Acquisition

AROUND_S = 0.5
"""Time about the window within which all is kept: a sample comes so late at most of a source that is read in time."""

_EPOCH = dt.datetime(1970, 1, 1, tzinfo=dt.UTC)


def within_the_window(recording: Recording, acquisition: Acquisition, names: Sequence[str]) -> Recording | None:
    """Leave out what a live source delivered of times far outside the shot's window.

    Parameters
    ----------
    recording
        Recording of a source of the shot's capture, without tracks.
    names
        Signals whose instants say how far it reaches.

    Returns
    -------
    Recording or None
        The recording itself where all of it is about the window, or nothing relates its clock to the host's; None where
        all of it is outside, of another shot maybe: then the source delivered nothing to this one.
    """
    clock = _clock(recording, acquisition)
    bases = [base for name in names if (base := recording.time_base(name)).count]
    if clock is None or not bases:
        return recording
    begins_s = -acquisition.pre_actual_s
    first_s, last_s = clock(begins_s - AROUND_S), clock(begins_s + acquisition.duration_s + AROUND_S)
    early_s, late_s = first_s - min(b.start_s for b in bases), max(b.end_s for b in bases) - last_s
    if early_s <= 0 and late_s <= 0:
        return recording
    if not any(stop > first for first, stop in (base.span(first_s, last_s) for base in bases)):
        # what is farther off than anything waited was not read late: the record is of another clock
        away_s = max(min(b.start_s for b in bases) - last_s, first_s - max(b.end_s for b in bases))
        waited_s = max((source.late_s for source in acquisition.sources), default=0.0)
        return None if away_s <= waited_s else recording
    apart = [f"{early_s:.3g} s before"] * (early_s > 0) + [f"{late_s:.3g} s behind"] * (late_s > 0)
    why = (
        f"samples from up to {' and '.join(apart)} the shot's window, which were read late, were left out: "
        "the capture holds them"
    )
    return span_of(recording, first_s, np.nextafter(last_s, np.inf), why)


def _clock(recording: Recording, acquisition: Acquisition) -> Callable[[float], float] | None:
    """Return what turns a time from the trigger on the host's clock into the recording's; None if nothing says it."""
    triggered = AbsoluteStart(acquisition.trigger_utc, "UTC", AT_TRIGGER).moment
    if triggered is None:
        return None
    fit = recording.metadata.get("clock_fit")
    if fit is not None and "host_zero_ns" in fit:
        zero_ns, offset_s, rate = fit["host_zero_ns"], fit["offset_s"], 1.0 + fit["drift"]
        trigger_ns = _since_1970_ns(triggered) if zero_ns > WALL_CLOCK_NS else acquisition.trigger_ns
        return lambda host_s: float(((trigger_ns - zero_ns) / 1e9 + host_s - offset_s) / rate)
    start = None if recording.absolute_start is None else recording.absolute_start.moment
    if start is None or start.tzinfo is None:
        return None
    zero_ns = _since_1970_ns(start)
    return lambda host_s: (_since_1970_ns(triggered) - zero_ns) / 1e9 + host_s


def _since_1970_ns(moment: dt.datetime) -> int:
    return (moment - _EPOCH) // dt.timedelta(microseconds=1) * 1000
