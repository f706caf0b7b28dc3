"""Signals that a rig names, looked up in its CAN databases."""

from __future__ import annotations

from pathlib import Path

from recoil_acquisition.errors import Fault, FaultCode, KeyPath, ReadError, Row, nearest_first
from recoil_acquisition.readers.can.buses import AT
from recoil_acquisition.readers.can.messages import load_database
from recoil_rigs.rig import Rig, Source

MOST_NAMED = 3
"""Nearest names that a fault lists."""


def faults_of_can_signals(rig: Rig, source: Source) -> list[Fault]:
    """Name the signals of a source that its database does not have, or has in a faulty message.

    Parameters
    ----------
    source
        Source of the rig; without a database it has no such fault.
    """
    text = rig.databases.get(source.database or "")
    if text is None:
        return []
    try:
        database = load_database(text, Path(str(source.database)))
    except ReadError as error:
        return [Fault((Row("source", source.name), "database"), str(error), FaultCode.FILE)]
    known = database.signals
    wanted: dict[KeyPath, str] = {(Row("channel", c.name), "signal"): c.signal for c in rig.channels_of(source.name)}
    wanted |= {(Row("source", source.name), "counters", i): name for i, name in enumerate(source.counters or ())}
    faults = []
    for key, signal in wanted.items():
        own, _, _bus = signal.rpartition(AT) if signal not in known and source.device is None else (signal, "", "")
        if named := database.named(own):
            if source.device is not None and len(named) > 1:
                those = " or ".join(repr(one.name) for one in named)
                problem = f"{signal!r} is of several messages of {source.database}; write {those}"
                faults.append(Fault(key, problem, FaultCode.AMBIGUOUS))
            continue
        try:
            database.refuse_faulty(signal, Path(str(source.database)))
        except ReadError as error:
            faults.append(Fault(key, str(error), FaultCode.FILE))
            continue
        nearest = ", ".join(repr(name) for name in nearest_first(signal, tuple(known))[:MOST_NAMED]) or "none"
        problem = f"{source.database} has no signal {signal!r}; nearest: {nearest}"
        faults.append(Fault(key, problem, FaultCode.UNKNOWN))
    return faults


def shared_names(rig: Rig, source: Source) -> list[Fault]:
    """Name the signals of a source whose name several messages of its database have: a file may hold more than one."""
    text = rig.databases.get(source.database or "")
    if text is None or source.device is not None:
        return []
    signals = load_database(text, Path(str(source.database))).signals
    return [
        Fault(
            (Row("channel", spec.name), "signal"),
            f"{spec.signal!r} is of several messages of {source.database}: of a file in which more than one came it "
            f"is refused; write {' or '.join(repr(one.name) for one in signals[spec.signal])}",
            FaultCode.AMBIGUOUS,
        )
        for spec in rig.channels_of(source.name)
        if len(signals.get(spec.signal, ())) > 1
    ]
