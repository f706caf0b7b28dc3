"""The tables of a rig file, each validated once: what checks and the rig itself are made of."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from recoil_acquisition.errors import Fault, FaultCode, KeyPath, RigError, Row
from recoil_acquisition.files.bounded_toml import parse_toml
from recoil_acquisition.quantities.declaration import DeclaredRows, declared, declared_rows, unknown_keys
from recoil_acquisition.quantities.quantity import SI_UNITS
from recoil_acquisition.trigger.detector import Trigger
from recoil_acquisition.trigger.table import declared_trigger
from recoil_rigs.mechanism.mechanism_parameters import MECHANISM, Mechanism
from recoil_rigs.mechanism.mechanism_table import declared_mechanism
from recoil_rigs.tables.channel_table import ChannelSpec
from recoil_rigs.tables.issue import NOTHING_STATED, REPORT, Issue
from recoil_rigs.tables.knowledge import KNOWLEDGE, NOTHING_KNOWN, Knowledge
from recoil_rigs.tables.open_values import OpenValue, without_open_values
from recoil_rigs.tables.rig_tables import Source

SCHEMA = "recoil-daq/rig/1"

HEAD = {"name": "a name for the rig", "reference_clock": "the name of the source whose clock the others are mapped to"}
"""Key at the top of the file -> what its text is."""
TWIN, TRIGGER = "twin", "trigger"
_TOP_LEVEL_KEYS = ("schema", *HEAD, MECHANISM, "source", "channel", KNOWLEDGE, REPORT, TRIGGER, TWIN)


@dataclass(frozen=True)
class RigFile:
    """Statements of a rig file, table by table.

    Attributes
    ----------
    texts
        Texts at the top of the file, by their keys.
    model
        Model of the mechanism; None if the file names none that there is.
    mechanism, trigger
        None where it has a fault, or there is none.
    sources, channels
        Rows in the order of the file; none where the array has a fault.
    knowledge, report
        Nothing where it has a fault.
    faults
        Faults that each table has by itself.
    open
        Values that nobody has stated yet.
    stated
        Number of values that only a person knows and that the file states.
    """

    texts: Mapping[str, str]
    model: type[Mechanism] | None
    mechanism: Mechanism | None
    sources: DeclaredRows[Source]
    channels: DeclaredRows[ChannelSpec]
    trigger: Trigger | None
    knowledge: Knowledge
    report: Issue
    twin: Mapping[str, Any]
    faults: tuple[Fault, ...]
    open: tuple[OpenValue, ...]
    stated: int

    @property
    def places_of_open_values(self) -> set[KeyPath]:
        """Keys of which it is no fault of their own that nothing stands there."""
        places = {one.parts for one in self.open}
        # a source says of itself what it needs
        places |= {one.parts[:1] for one in self.open if one.parts[1:] in (("database",), ("framing",))}
        # rows that a rate dates need no column of times
        places |= {(*one.parts[:-1], "time_column") for one in self.open if one.parts[1:] == ("layout", "rate_hz")}
        unscaled = {one.parts[0] for one in self.open if one.parts[1:] == ("scale_mm_per_px",)}
        named = {one.name for one in unscaled if isinstance(one, Row)}
        channels = self.channels.sound
        return places | {(*where, "unit") for where, one in channels if one.unit == "px" and one.source in named}


def read_tables(text: str, path: Path) -> RigFile:
    """Read the tables of a rig file, without those values that are still open.

    Raises
    ------
    RigError
        If it is no TOML.
    """
    try:
        stated = without_open_values(parse_toml(text))
    except ValueError as error:
        raise RigError(path, [Fault(("TOML",), str(error), FaultCode.SYNTAX)]) from error
    tables = stated.tables
    faults, of_rows = unknown_keys(tables, _TOP_LEVEL_KEYS, ()), list[Fault]()
    if tables.get("schema") != SCHEMA:
        problem = f"must be {SCHEMA!r}, found {tables.get('schema')!r}"
        faults.append(Fault(("schema",), problem, FaultCode.VALUE if "schema" in tables else FaultCode.MISSING))
    texts = {key: value for key, value in tables.items() if isinstance(value, str)}
    for key, meaning in HEAD.items():
        if not texts.get(key):
            problem = "must be a text" if key in tables else f"is missing: {meaning}"
            faults.append(Fault((key,), problem, FaultCode.TYPE if key in tables else FaultCode.MISSING))
    twin = tables.get(TWIN, {})
    if not isinstance(twin, dict):
        faults.append(Fault((TWIN,), "must be a table", FaultCode.TYPE))
    sources = declared_rows(tables, "source", Source, of_rows)
    channels = declared_rows(tables, "channel", ChannelSpec, of_rows)
    knowledge = declared(Knowledge, tables.get(KNOWLEDGE, {}), (KNOWLEDGE,), of_rows)
    report = declared(Issue, tables.get(REPORT, {}), (REPORT,), of_rows)
    roles = {row.texts["role"] for row in channels.rows if row.texts.get("role")}
    model, mechanism = declared_mechanism(tables.get(MECHANISM), roles, faults)
    quantities = {row.texts["name"]: row.texts.get("quantity", "") for row in channels.rows if "name" in row.texts}
    known = {name: quantity if quantity in SI_UNITS else "" for name, quantity in quantities.items()}
    trigger = declared_trigger(tables[TRIGGER], known, of_rows) if TRIGGER in tables else None
    return RigFile(
        texts=texts,
        model=model,
        mechanism=mechanism,
        sources=sources,
        channels=channels,
        trigger=trigger,
        knowledge=knowledge or NOTHING_KNOWN,
        report=report or NOTHING_STATED,
        twin=twin,
        faults=(*faults, *of_rows),
        open=stated.open,
        stated=stated.stated,
    )
