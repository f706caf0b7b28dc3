"""The buses of a CAN log: what an identifier stands for, it stands for on its own bus alone.

Two nodes of one kind on two buses send under one identifier. Formats number the buses (ASC, BLF, TRC, MDF) or name them
(candump); a rig says which one a source is by the number, or by the name where the log has names.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.errors import ReadError
from recoil_acquisition.readers.can.frames import CanLog
from recoil_acquisition.readers.text.cells import whole_number

BusName = int | str

AT = "@"
"""Sign between a signal's name and its bus, where messages of one identifier came on several buses."""

_NUMBER_AT_END = re.compile(r"[0-9]{1,9}$")


def bus_number(bus: BusName) -> int | None:
    """Return the number of a bus, which a name such as ``can0`` has at its end; None if it has none."""
    if isinstance(bus, int):
        return bus
    found = _NUMBER_AT_END.search(bus.strip())
    return None if found is None else int(found[0])


def bus_label(log: CanLog, channel: int) -> str:
    """Return what a log calls a bus: its name, or its number."""
    return log.bus_names.get(channel, str(channel))


def bus_counts(log: CanLog) -> dict[str, int]:
    """Count the data frames of a log by their buses; empty if its format does not store them."""
    if not log.stores_buses:
        return {}
    channels, counts = np.unique(log.frames.channel, return_counts=True)
    return {bus_label(log, int(c)): int(n) for c, n in zip(channels, counts, strict=True)}


def frames_of_bus(log: CanLog, bus: BusName, path: Path) -> CanLog:
    """Return a log with the frames of one bus alone.

    Parameters
    ----------
    bus
        Name of the bus, or its number; the number of a bus with a name is that at the end of the name.
    path
        File, for messages.

    Raises
    ------
    ReadError
        If the log does not store buses, or has no such bus, or a number fits several.
    """
    if not log.stores_buses:
        raise ReadError(
            "this format does not store on which bus a frame came",
            path=path,
            expected=f"a log with the bus {bus!r}",
            remedy="leave `bus` of this source out, or record as candump, ASC, BLF, TRC or MDF",
        )
    counts = bus_counts(log)
    found = [int(channel) for channel in np.unique(log.frames.channel) if _is_meant(log, int(channel), bus)]
    if len(found) == 1:
        chosen = log.frames.channel == found[0]
        return log if bool(chosen.all()) else replace(log, frames=log.frames.chosen(chosen))
    shown = ", ".join(f"{label} ({count} frames)" for label, count in counts.items())
    problem = f"the log has no bus {bus!r}"
    if found:
        problem = f"bus {bus!r} may be any of {', '.join(bus_label(log, one) for one in found)}"
    elif bus_number(bus) is None or not isinstance(bus, int):
        problem += ", whose buses have names" if log.bus_names else ", whose buses have numbers"
    raise ReadError(problem, path=path, found=shown, remedy="correct `bus` of this source in the rig file")


def _is_meant(log: CanLog, channel: int, bus: BusName) -> bool:
    label = bus_label(log, channel)
    number = whole_number(bus.strip()) if isinstance(bus, str) else bus
    if number is None:
        return label == str(bus).strip() and channel in log.bus_names
    return bus_number(label) == number


def by_bus(log: CanLog, chosen: NDArray[np.intp]) -> dict[str, NDArray[np.intp]]:
    """Sort some frames of a log by their buses.

    Returns
    -------
    dict of str to ndarray of int
        Places of the frames; keys are the names or numbers by which the log calls the buses.
    """
    channel = np.take(log.frames.channel, chosen)
    if (channel == channel[0]).all():
        return {bus_label(log, int(channel[0])): chosen}
    return {bus_label(log, int(one)): chosen[channel == one] for one in np.unique(channel)}
