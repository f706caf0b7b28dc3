"""The tables of a rig file's draft, made of what recorded files tell."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

from recoil_acquisition.files.shot_name import numbers_of
from recoil_acquisition.quantities.declaration import DeclaredTable
from recoil_acquisition.quantities.quantity import find_unit
from recoil_daq.drafting.answer import a_number, a_symbol, a_table, one_of, or_none
from recoil_daq.drafting.drafted_channels import DraftedChannels
from recoil_daq.drafting.evidence import Evidence
from recoil_daq.drafting.recorded_source import RecordedSignal, RecordedSource
from recoil_daq.drafting.rig_draft import Entry, Question, RigDraft, Table
from recoil_rigs.mechanism.gun import Gun
from recoil_rigs.mechanism.mechanism_parameters import MEANINGS, MechanismModel
from recoil_rigs.mechanism.mechanism_table import model_of
from recoil_rigs.mechanism.mechanisms import MECHANISMS
from recoil_rigs.rig import SCHEMA
from recoil_rigs.tables.knowledge import KNOWLEDGE, WEIGHT
from recoil_rigs.tables.rig_tables import SHOT_PLACE, Alignment

TRIGGER_SHARE, REARM_SHARE = 0.2, 0.1
"""Shares of the peak at which a shot begins, and below which the trigger is armed again."""
_FOUND_IN: Mapping[str, str] = MappingProxyType(
    {
        "m3": "drawing, or a weighing",
        "friction": "a slow pull of the recoiling part by a load cell, or its maker",
        "u_friction": "how the pulls scatter",
        "phi10": "inclinometer on the carriage before the shot",
        "phi20": "inclinometer on the bore before the shot",
        "bore_area": "drawing: pi d^2 / 4 of the bore",
        "brake_area": "drawing: piston less rod",
        "recuperator_area": "drawing: piston less rod",
    }
)
"""Symbol -> where it is found; of all others on the drawing."""


class _Aligned(DeclaredTable):
    """A source, of which its alignment alone is looked at."""

    align: Alignment


def draft_tables(evidence: Evidence, left_out: Sequence[tuple[str, str]] = ()) -> RigDraft:
    """Return the draft of the rig file.

    Parameters
    ----------
    left_out
        Names of the files that could not be read, and why each could not.
    """
    channels = DraftedChannels(evidence)
    tables = [_head(evidence, complete=not left_out), _mechanism(evidence), *_knowledge(evidence)]
    tables += [_source(evidence, source, channels.names) for source in evidence.sources]
    tables += [_without(name, why) for name, why in left_out]
    tables += channels.tables()
    tables += _trigger(evidence, channels)
    return RigDraft(tuple(tables))


def _without(name: str, why: str) -> Table:
    """Return a comment on a file whose source is still to be written."""
    return Table("", (), (f"TODO source of {name}, which is left out: {why}",))


def _head(evidence: Evidence, *, complete: bool) -> Table:
    other = evidence.other
    comments = [
        "Drafted by `recoil-daq init` from recorded files. A text that begins with TODO is a value that only a person",
        "knows: write the value in its place. `recoil-daq check` says what is open. A table behind # is not used.",
    ]
    name = other.tables.get("name", evidence.name) if other is not None else evidence.name
    meaning = "the source whose clock all others are mapped to"
    reference = Entry("reference_clock", evidence.reference, meaning)
    if not complete and other is None and not any(source.kind == "dewetron" for source in evidence.sources):
        # a file that is left out may be the recorder, whose clock it then is
        names = [source.name for source in evidence.sources]
        asked = Question(f"{meaning}; a file is left out, which may be it", evidence.reference, one_of(names))
        reference = Entry("reference_clock", asked)
    entries = (Entry("schema", SCHEMA), Entry("name", name), reference)
    return Table("", entries, tuple(comments))


def _mechanism(evidence: Evidence) -> Table:
    """Ask for all that the model needs; what another rig states is taken over."""
    model = evidence.model
    stated = {} if evidence.other is None else dict(evidence.other.table("mechanism"))
    if stated and evidence.roles.model is None:
        model = (model_of(stated) or Gun).model
    entries = []
    if model is MechanismModel.LINE:
        entries.append(Entry("model", "line", "one body on a line: a force moves it, and no pressure is read"))
    roles = {one.role for one in evidence.roles.by_signal.values()}
    asked = [*MECHANISMS[model].required(roles)]
    # what a finished rig takes as exact is not asked for again
    if evidence.other is None or not evidence.other.takes_as_exact("friction"):
        asked.insert(asked.index("friction") + 1, "u_friction")
    for symbol in asked:
        if symbol in stated:
            entries.append(Entry(symbol, stated.pop(symbol), evidence.as_other))
        else:
            entries.append(Entry(symbol, _question_of(symbol, model)))
    having = MECHANISMS[model].symbols_of(roles)
    for key, value in stated.items():
        if key.removeprefix("u_") in having:
            entries.append(Entry(key, value, evidence.as_other))
    comments = [
        "SI units, angles in rad. `u_<name>` beside a value is its standard uncertainty; without it, it is exact.",
    ]
    if evidence.roles.model is None and model is MechanismModel.GUN:
        comments.append('One body on a line is `model = "line"`: it needs m3, phi20, friction, and none of the others.')
    elif evidence.roles.model is None:
        comments.append("No file has a pressure, so it may be one body on a line; a gun has no key `model`.")
    return Table("[mechanism]", tuple(entries), tuple(comments))


def _knowledge(evidence: Evidence) -> Iterator[Table]:
    """Take over what another rig knows beside certificates, and ask for the mass that is weighed and added."""
    other = evidence.other
    stated = {} if other is None else dict(other.table(KNOWLEDGE))
    # what a finished rig leaves out is not asked for again
    is_asked = evidence.model is not MechanismModel.LINE and (other is None or not other.written)
    for key, question in _asked_of_weight().items():
        if key not in stated and (is_asked or (other is not None and other.asks_to_know(key))):
            stated[key] = question
    if stated:
        yield from _taken_over(KNOWLEDGE, stated)


def _asked_of_weight() -> dict[str, Question]:
    """Ask for the mass and its uncertainty; both may be left out."""
    of_mass = (
        "mass to add to every second shot, kg, a tenth to a half of m3: a scale; it tells how the breech gauge reads; "
        "delete both lines if there is none"
    )
    of_u = f"standard uncertainty of {WEIGHT[0]}, kg: the scale's certificate; most lie between 0.01 and 0.5"
    return {
        WEIGHT[0]: Question(of_mass, read=or_none(a_number("kg", positive=True))),
        WEIGHT[1]: Question(of_u, read=or_none(a_number("kg"))),
    }


def _question_of(symbol: str, model: MechanismModel) -> Question:
    of = symbol.removeprefix("u_")
    meaning = MEANINGS[of] if symbol == of else f"standard uncertainty of {of}, {MEANINGS[of].rpartition(', ')[2]}"
    bounds = MECHANISMS[model].bounds.get(of)
    usual = (
        "" if bounds is None or symbol != of else f"; most lie between {bounds.usual[0]:.3g} and {bounds.usual[1]:.3g}"
    )
    return Question(f"{meaning}; from: {_FOUND_IN.get(symbol, 'drawing')}{usual}", read=a_symbol(symbol, model))


def _source(evidence: Evidence, source: RecordedSource, names: Mapping[str, str]) -> Table:
    other = {} if evidence.other is None else evidence.other.source_of(source.file.name, source.kind)
    kind = "recorder" if source.kind == "dewetron" else source.kind
    files = [one.file for one in evidence.sources]
    entries = [
        Entry("name", source.name), Entry("kind", kind),
        Entry("match", other.get("match") or file_pattern(source.file, files), f"as {source.file.name}"),
        *source.entries,
    ]  # fmt: skip
    entries += _alignment(evidence, source, other, names)
    known = {*(entry.key for entry in entries), *source.tables, "align"}
    entries += [Entry(key, value, evidence.as_other) for key, value in other.items() if key not in known]
    tables = tuple(_source_table(key, table) for key, table in source.tables.items())
    return Table("[[source]]", tuple(entries), (f"{source.file.name}: {source.format_name}",), tables)


def _alignment(
    evidence: Evidence, source: RecordedSource, other: Mapping[str, Any], names: Mapping[str, str]
) -> Iterator[Entry]:
    """Yield how a source's clock is found."""
    if source.name == evidence.reference:
        return
    proposal, stated = evidence.clocks.get(source.name), other.get("align")
    compared = [stated.get("channel"), stated.get("against")] if isinstance(stated, dict) else []
    if isinstance(stated, dict) and {one for one in compared if one is not None} <= set(names.values()):
        yield Entry("align", stated, evidence.as_other)
    elif proposal is not None:
        align = {key: names.get(value, value) for key, value in proposal.align.items()}
        yield Entry("align", align, proposal.reason)
    else:
        first = _first_of(source)
        why = (
            f"found by `init` with --from once `{first}` is answered"
            if first
            else "no signal of the file repeats one of the reference clock, or shows its motion"
        )
        meaning = (
            '{ method = "motion", against = ".." }, "redundant", "trigger", "exposure", "absolute" or "fixed": '
            f"{why}; docs/rig-file.md"
        )
        yield Entry("align", Question(meaning, read=a_table("align", _Aligned)))


def _first_of(source: RecordedSource) -> str:
    """Return the key of a source whose answer lets its file tell more; empty if there is none."""
    stated = [(entry.key, entry.value) for entry in source.entries]
    stated += [item for table in source.tables.values() for item in table.items()]
    return next((key for key, one in stated if isinstance(one, Question) and one.opens), "")


def _source_table(key: str, table: Mapping[str, Any]) -> Table:
    """Return a framing or a layout as a table, the fields of a frame last, a line each."""
    entries = [Entry(name, value) for name, value in table.items() if name != "fields"]
    entries += [Entry("fields", table["fields"])] if "fields" in table else []
    return Table(f"[source.{key}]", tuple(entries))


def file_pattern(path: Path, files: Sequence[Path]) -> str:
    """Return the pattern of a source's files by the name of one: the shot's number is a place in it.

    Parameters
    ----------
    files
        Files of all sources: the number that all their names share is the shot's.
    """
    shared = frozenset.intersection(*(numbers_of(one) for one in files)) if len(files) > 1 else numbers_of(path)
    stem, suffix = path.stem, path.suffix
    if len(shared) == 1:
        # of a bus's number and the shot's, which may be the same one, the longer spelling is the shot's
        alone = [one for one in re.finditer(r"[^_\s-]+", stem) if one[0].isdecimal() and int(one[0]) in shared]
        found = max(alone, key=lambda one: len(one[0]), default=None)
        if found is not None:
            before, behind = stem[: found.start()], stem[found.end() :]
            return f"{_dateless(before)}{SHOT_PLACE}{_dateless(behind)}{suffix}"
    same = [one for one in files if one.suffix.casefold() == suffix.casefold()]
    return f"*{suffix}" if suffix and len(same) == 1 else _dateless(path.name)


def _dateless(text: str) -> str:
    """Return a part of a name with a star in place of long numbers, which dates and times are."""
    return re.sub(r"\d{4,}([-_.:]?\d{2,})*", "*", re.sub(r"[\[\]?*]", "?", text))


def _trigger(evidence: Evidence, channels: DraftedChannels) -> Iterator[Table]:
    """Yield the trigger: that of the other rig, or the level of the drive, behind comment signs."""
    if evidence.other is not None:
        for key in ("trigger", "report"):
            if table := evidence.other.table(key):
                yield from _taken_over(key, table)
        if evidence.other.table("trigger"):
            return
    for role in ("breech_pressure", "driving_force", "recoil_acceleration"):
        found = next((one for one in evidence.signals if _has_role(evidence, one, role)), None)
        unit = None if found is None or not found.unit else find_unit(found.unit)
        if found is None or found.swing is None or unit is None or found.quantity not in unit.quantities:
            continue
        size = abs(found.swing.peak)
        level, rearm = (unit.from_si(found.swing.base + share * size) for share in (TRIGGER_SHARE, REARM_SHARE))
        condition = (
            Entry("channel", channels.names[found.key], f"rises by {size / unit.factor:.4g} {found.unit}"),
            Entry("kind", "edge"),
            Entry("level", f"{level:.3g} {found.unit}", "20 % of the peak"),
            Entry("rearm", f"{rearm:.3g} {found.unit}", "10 % of it"),
            Entry("slope", "rising"),
        )
        comments = ("When a live shot begins, or where in a long recording the shot is:",)
        whole = Table("[trigger]", (Entry("pre_s", 0.3), Entry("post_s", 0.7)), comments, left_out=True)
        yield whole
        yield Table("[[trigger.any]]", condition, left_out=True)
        return


def _has_role(evidence: Evidence, signal: RecordedSignal, role: str) -> bool:
    found = evidence.roles.by_signal.get(signal.key)
    return found is not None and found.certain and found.role == role


def _taken_over(key: str, table: Mapping[str, Any]) -> Iterator[Table]:
    """Yield a table of another rig as it stands there."""
    plain = tuple(Entry(name, value) for name, value in table.items() if not _is_tables(value))
    if plain or not table:
        yield Table(f"[{key}]", plain)
    for name, value in table.items():
        if isinstance(value, dict):
            yield from _taken_over(f"{key}.{name}", value)
        elif _is_tables(value):
            for row in value:
                yield Table(f"[[{key}.{name}]]", tuple(Entry(one, text) for one, text in row.items()))


def _is_tables(value: Any) -> bool:
    return isinstance(value, dict) or (isinstance(value, list) and any(isinstance(one, dict) for one in value))
