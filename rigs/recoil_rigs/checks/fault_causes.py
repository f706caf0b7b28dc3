"""Faults of a rig file that only follow from others of it: one cause is one line."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from recoil_acquisition.errors import Fault, FaultCode, KeyPath, did_you_mean
from recoil_rigs.rig_file import RigFile

STRAY = 2
"""Number of unknown keys in one table, none near a known one, from which on the heading of another may be missing."""
_ARRAYS = ("source", "channel")


def causes(faults: Sequence[Fault], file: RigFile) -> list[Fault]:
    """Return the faults without those that only follow from others of them.

    A key that is missing since it stands there misspelt is the misspelt one; names are not looked up where those of
    some rows cannot be read; a name that is declared nowhere is one fault, wherever it stands; unknown keys in a row
    are a heading that is missing.
    """
    unknown = [fault for fault in faults if fault.known is not None]
    stray = _stray(unknown)
    headings = {key for key in _ARRAYS if any(len(one.parts) == 1 and key in one.meant for one in unknown)}
    unread = bool(stray) or bool(headings) or _unread_names(faults, file)
    found: list[Fault] = []
    for fault in faults:
        table = fault.parts[:-1]
        if fault in unknown and table in stray:
            if fault is stray[table][0]:
                found.append(_together(stray[table]))
        elif not (
            (fault.code is FaultCode.MISSING and _is_misspelt(fault, unknown, stray))
            or (unread and (fault.undeclared is not None or fault.parts[-1:] == ("align",)))
            or (headings and not table and fault not in unknown)
        ):
            found.append(fault)
    return _once(found)


def _stray(unknown: Sequence[Fault]) -> dict[KeyPath, list[Fault]]:
    """Return the faults of the tables with so many unknown keys that they are perhaps those of another table."""
    tables = [fault.parts[:-1] for fault in unknown if not fault.meant]
    return {
        table: [fault for fault in unknown if fault.parts[:-1] == table]
        for table in tables
        if tables.count(table) >= STRAY
    }


def _together(stray: Sequence[Fault]) -> Fault:
    """Say once of unknown keys in a row that they are none."""
    first, *others = stray
    names = ", ".join(str(one.parts[-1]) for one in others)
    known = next(did_you_mean(str(one.parts[-1]), one.known or ()) for one in stray if not one.meant)
    as_are = f"as {'is' if len(others) == 1 else 'are'} {names}"
    return replace(first, problem=f"unknown key, {as_are}; {known}; or the heading above them is missing")


def _is_misspelt(missing: Fault, unknown: Sequence[Fault], stray: Mapping[KeyPath, Sequence[Fault]]) -> bool:
    """Return whether what is missing, or the table that it is in, stands there under another name or heading."""
    if stray and (
        not missing.parts[:-1] or missing.parts[-1] in {one.parts[-1] for table in stray.values() for one in table}
    ):
        return True
    return any(
        missing.parts[: len(fault.parts) - 1] == fault.parts[:-1]
        and len(fault.parts) <= len(missing.parts)
        and missing.parts[len(fault.parts) - 1] in fault.meant
        for fault in unknown
    )


def _unread_names(faults: Sequence[Fault], file: RigFile) -> bool:
    """Return whether a source or a channel is declared whose name cannot be read."""
    named = [fault for fault in faults if fault.code is not FaultCode.DUPLICATE]
    if any(fault.parts[:1] == (array,) or fault.parts[1:] == ("name",) for fault in named for array in _ARRAYS):
        return True
    texts = [*(row.texts for row in file.sources.rows), *(row.texts for row in file.channels.rows)]
    return any(not one.get("name") for one in texts)


def _once(faults: Sequence[Fault]) -> list[Fault]:
    """Say once of each name that it is declared nowhere, and how often it stands there."""
    names = [fault.undeclared or "" for fault in faults]
    found = []
    for k, (name, fault) in enumerate(zip(names, faults, strict=True)):
        if name and name in names[:k]:
            continue
        more = names.count(name) - 1 if name else 0
        found.append(replace(fault, problem=f"{fault.problem} (this explains {more} more)") if more else fault)
    return found
