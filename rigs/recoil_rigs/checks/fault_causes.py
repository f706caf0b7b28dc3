"""Faults of a rig file that only follow from others of it: one cause is one line."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

from recoil_acquisition.declaration import UNKNOWN_KEY
from recoil_acquisition.errors import Fault, FaultCode, KeyPath
from recoil_rigs.rig_file import RigFile

STRAY = 2
"""Number of unknown keys in one table, none near a known one, from which on the heading of another may be missing."""
_NOWHERE = re.compile(r"'[^']*'(?= is (?:not declared|no source|no channel))|(?<=no channel )'[^']*'")
"""Name of a source or a channel in the sentence that it is declared nowhere."""
_ARRAYS = ("source", "channel")


def causes(faults: Sequence[Fault], file: RigFile) -> list[Fault]:
    """Return the faults without those that only follow from others of them.

    A key that is missing since it stands there misspelt is the misspelt one; names are not looked up where those of
    some rows cannot be read; a name that is declared nowhere is one fault, wherever it stands; unknown keys in a row
    are a heading that is missing.
    """
    unknown = [fault for fault in faults if fault.problem.startswith(UNKNOWN_KEY)]
    stray = _stray(unknown)
    headings = {key for key in _ARRAYS if any(len(one.parts) == 1 and _means(one, key) for one in unknown)}
    unread = bool(stray) or bool(headings) or _unread_names(faults, file)
    found: list[Fault] = []
    for fault in faults:
        table = fault.parts[:-1]
        if fault in unknown and table in stray:
            if fault is stray[table][0]:
                found.append(_together(stray[table]))
        elif not (
            (fault.code is FaultCode.MISSING and _is_misspelt(fault, unknown, stray))
            or (unread and (_refers(fault) or fault.parts[-1:] == ("align",)))
            or (headings and not table and fault not in unknown)
        ):
            found.append(fault)
    return _once(found)


def _stray(unknown: Sequence[Fault]) -> dict[KeyPath, list[Fault]]:
    """Return the faults of the tables with so many unknown keys that they are perhaps those of another table."""
    tables = [fault.parts[:-1] for fault in unknown if "did you mean" not in fault.problem]
    return {
        table: [fault for fault in unknown if fault.parts[:-1] == table]
        for table in tables
        if tables.count(table) >= STRAY
    }


def _together(stray: Sequence[Fault]) -> Fault:
    """Say once of unknown keys in a row that they are none."""
    first, *others = stray
    names = ", ".join(str(one.parts[-1]) for one in others)
    known = next(one.problem.partition("; ")[2] for one in stray if "did you mean" not in one.problem)
    as_are = f"as {'is' if len(others) == 1 else 'are'} {names}"
    return replace(first, problem=f"{UNKNOWN_KEY}, {as_are}; {known}; or the heading above them is missing")


def _is_misspelt(missing: Fault, unknown: Sequence[Fault], stray: Mapping[KeyPath, Sequence[Fault]]) -> bool:
    """Return whether what is missing, or the table that it is in, stands there under another name or heading."""
    if stray and (
        not missing.parts[:-1] or missing.parts[-1] in {one.parts[-1] for table in stray.values() for one in table}
    ):
        return True
    return any(
        missing.parts[: len(fault.parts) - 1] == fault.parts[:-1]
        and len(fault.parts) <= len(missing.parts)
        and _means(fault, str(missing.parts[len(fault.parts) - 1]))
        for fault in unknown
    )


def _means(unknown: Fault, key: str) -> bool:
    """Return whether an unknown key is said to be perhaps another."""
    meant = unknown.problem.partition("did you mean")[2]
    return bool(re.search(rf"(?:^ ?|, |`){re.escape(key)}(?:`| \()", meant))


def _unread_names(faults: Sequence[Fault], file: RigFile) -> bool:
    """Return whether a source or a channel is declared whose name cannot be read."""
    named = [fault for fault in faults if fault.code is not FaultCode.DUPLICATE]
    if any(fault.parts[:1] == (array,) or fault.parts[1:] == ("name",) for fault in named for array in _ARRAYS):
        return True
    texts = [*(row.texts for row in file.sources.rows), *(row.texts for row in file.channels.rows)]
    return any(not one.get("name") for one in texts)


def _refers(fault: Fault) -> bool:
    """Return whether a fault is that of a name which is declared nowhere."""
    return fault.code is FaultCode.UNKNOWN and _NOWHERE.search(fault.problem) is not None


def _once(faults: Sequence[Fault]) -> list[Fault]:
    """Say once of each name that it is declared nowhere, and how often it stands there."""
    names = [match[0] if _refers(fault) and (match := _NOWHERE.search(fault.problem)) else "" for fault in faults]
    found = []
    for k, (name, fault) in enumerate(zip(names, faults, strict=True)):
        if name and name in names[:k]:
            continue
        more = names.count(name) - 1 if name else 0
        found.append(replace(fault, problem=f"{fault.problem} (this explains {more} more)") if more else fault)
    return found
