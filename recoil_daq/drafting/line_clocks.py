"""Clocks that an electric line shows: one edge that two recorders saw, or a pulse for every frame of a camera."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from recoil_daq.drafting.clock_proposal import ClockProposal
from recoil_daq.drafting.recorded_source import RecordedSignal
from recoil_processing.alignment.pulse_train import MOST_RATE
from recoil_processing.alignment.trigger_alignment import rising_edges

_OF_LINES = ("voltage", "count", "")
"""Quantities of a line's record; a bus has its state without a unit."""
_FEWEST_PULSES = 16
"""Pulses from which on they are a camera's frames."""
_LEAST_EVEN = 0.9
"""Share of the intervals between pulses that are the usual one."""
_LEAST_FRAMES = 0.8
"""Share of the frames that the pulses must be enough for."""
_AT_SHOT_S = 0.5
"""Time before or after the blow in which a line that steps once steps for the shot."""
_SAME_BLOW_S = 0.1
"""Time by which the blow may differ on two clocks that the edge relates."""


def edges_of(signal: RecordedSignal) -> np.ndarray:
    """Return the instants at which a line rises, s; none of a signal that is of no line."""
    if signal.quantity not in _OF_LINES or signal.swing is None or not np.isfinite(signal.rate_hz):
        return np.empty(0)
    return rising_edges(signal.times_s(), signal.samples())


def blow_of(signals: Iterable[RecordedSignal]) -> float | None:
    """Return when most signals of a source begin to move, s; None if none is known to."""
    found = [
        float(one.times_s()[one.swing.onset])
        for one in signals
        if one.quantity not in _OF_LINES and one.swing is not None and one.swing.moves
    ]
    return float(np.median(found)) if found else None


def by_exposure(
    camera: Sequence[RecordedSignal], reference: Sequence[RecordedSignal], feels: RecordedSignal | None
) -> ClockProposal | None:
    """Align a camera by pulses that come at its frame rate.

    Parameters
    ----------
    feels
        Accelerometer of the recoiling part on the reference clock, which tells one pulse from the next; None if there
        is none.
    """
    rates = {round(one.rate_hz, 6): one.base.count for one in camera if np.isfinite(one.rate_hz)}
    for line in (one for one in reference if one.quantity in ("voltage", "count")):
        edges_s = edges_of(line)
        if edges_s.size < _FEWEST_PULSES:
            continue
        steps_s = np.diff(edges_s)
        middle_s = float(np.median(steps_s))
        # an edge is known to a sample of the recorder's
        even = np.abs(steps_s - middle_s) <= MOST_RATE * middle_s + 1.5 / line.rate_hz
        if even.mean() < _LEAST_EVEN:
            continue
        usual_s = float(steps_s[even].mean())
        for rate_hz, count in rates.items():
            if abs(usual_s * rate_hz - 1.0) <= MOST_RATE and edges_s.size >= _LEAST_FRAMES * count:
                align = {"method": "exposure", "channel": line.key}
                align |= {} if feels is None else {"against": feels.key}
                used = (line.key,) if feels is None else (line.key, feels.key)
                reason = f"{edges_s.size:,} pulses of {line.name} come at its frame rate, {1 / usual_s:.6g} Hz"
                return ClockProposal(align, used, reason)
    return None


def by_trigger(source: Sequence[RecordedSignal], reference: Sequence[RecordedSignal]) -> ClockProposal | None:
    """Align a source by the one edge of a line that both recorded, if the blow is then at one instant on both."""
    blow_s, own_blow_s = blow_of(reference), blow_of(source)
    if blow_s is None or own_blow_s is None:
        return None
    lines = [(one, found[0]) for one in reference if one.quantity == "voltage" and (found := edges_of(one)).size == 1]
    lines = [(one, edge_s) for one, edge_s in lines if abs(edge_s - blow_s) <= _AT_SHOT_S]
    own = [(one, found[0]) for one in source if (found := edges_of(one)).size == 1] if lines else []
    for line, edge_s in lines:
        for one, own_edge_s in own:
            off_s = (own_blow_s - own_edge_s) - (blow_s - edge_s)
            if abs(off_s) <= _SAME_BLOW_S:
                reason = f"{one.name} and {line.name} step once, and the blow follows at once on both: trigger"
                align = {"method": "trigger", "channel": one.key}
                return ClockProposal(align, (one.key, line.key), reason)
    return None
