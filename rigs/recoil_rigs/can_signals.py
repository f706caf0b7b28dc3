"""Signals that a rig names, looked up in its CAN databases."""

from __future__ import annotations

from pathlib import Path

from recoil_acquisition.errors import Fault, ReadError, nearest_first
from recoil_acquisition.readers.can.messages import load_database
from recoil_rigs.rig import Rig, Source

MOST_NAMED = 3
"""Nearest names that a fault lists."""


def faults_of_can_signals(rig: Rig, source: Source) -> list[Fault]:
    """Name the signals of a source that its database does not have, or has in a faulty message.

    Parameters
    ----------
    source
        Of the rig; without a database it has no such fault.
    """
    text = rig.databases.get(source.database or "")
    if text is None:
        return []
    try:
        database = load_database(text, Path(str(source.database)))
    except ReadError as error:
        return [Fault(f"source '{source.name}'.database", str(error))]
    known = [f"{message.name}.{signal.name}" for message in database.messages for signal in message.signals]
    wanted = {f"channel '{c.name}'.signal": c.signal for c in rig.channels_of(source.name)}
    wanted |= {f"source '{source.name}'.counters[{i}]": name for i, name in enumerate(source.counters or ())}
    faults = []
    for key, signal in wanted.items():
        if signal in known:
            continue
        try:
            database.refuse_faulty(signal, Path(str(source.database)))
        except ReadError as error:
            faults.append(Fault(key, str(error)))
            continue
        nearest = ", ".join(repr(name) for name in nearest_first(signal, known)[:MOST_NAMED]) or "none"
        faults.append(Fault(key, f"{source.database} has no signal {signal!r}; nearest: {nearest}"))
    return faults
