"""The tables of a rig file's draft, made of what recorded files tell."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any

from recoil_acquisition.quantity import SI_UNITS, UNITS, find_unit
from recoil_acquisition.shot_name import numbers_of
from recoil_daq.drafting.clock_proposal import ClockProposal, Twin
from recoil_daq.drafting.other_rig import OtherRig
from recoil_daq.drafting.recorded_source import PIXELS, RecordedSignal, RecordedSource
from recoil_daq.drafting.rig_draft import Entry, Question, RigDraft, Table
from recoil_daq.drafting.role_proposal import ProposedRoles, RoleProposal, polarity_of
from recoil_daq.drafting.role_words import GUN_ROLES, LINE_ROLES, own_part
from recoil_rigs.certificate_table import Certificate, certificate_for
from recoil_rigs.mechanism_parameters import MEANINGS, Mechanism, MechanismModel
from recoil_rigs.plausible import OF_LINE_SYMBOL, OF_SYMBOL
from recoil_rigs.rig import SCHEMA
from recoil_rigs.rig_tables import CARRIAGE_ACCELERATIONS, FORCE_ROLES, ROLES, SHOT_PLACE

MOST_UNKNOWN = 12
"""Signals without a unit that are asked for; more of them stand behind comment signs."""
TRIGGER_SHARE, REARM_SHARE = 0.2, 0.1
"""Shares of the peak at which a shot begins, and below which the trigger is armed again."""
_PLACED = ("recoil_acceleration", *CARRIAGE_ACCELERATIONS)
"""Roles of sensors whose place on their body counts."""
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


@dataclass(frozen=True, eq=False)
class Evidence:
    """All that files, certificates and another rig tell.

    Attributes
    ----------
    name
        Name of the rig.
    reference
        Name of the source whose clock the others are mapped to.
    clocks
        Ways in which the other sources' clocks are found, by their names.
    twins
        Signals that repeat one of the reference clock, by their keys.
    supposed
        Keys of signals of unknown quantity that are supposed to be angular rates, and why.
    """

    name: str
    sources: Sequence[RecordedSource]
    reference: str
    roles: ProposedRoles
    clocks: Mapping[str, ClockProposal]
    twins: Mapping[str, Twin]
    supposed: Mapping[str, str] = field(default_factory=dict)
    certificates: tuple[Certificate, ...] = ()
    other: OtherRig | None = None

    @property
    def signals(self) -> list[RecordedSignal]:
        """Signals of all sources."""
        return [one for source in self.sources for one in source.signals]

    @property
    def as_other(self) -> str:
        """Reason for what is taken over from the other rig; empty if there is none."""
        return "" if self.other is None else f"as in {self.other.path.name}"


def draft_tables(evidence: Evidence) -> RigDraft:
    """Return the draft of the rig file."""
    channels = _Channels(evidence)
    tables = [_head(evidence), _mechanism(evidence)]
    tables += [_source(evidence, source, channels.names) for source in evidence.sources]
    tables += channels.tables()
    tables += _trigger(evidence, channels)
    return RigDraft(tuple(tables))


def _head(evidence: Evidence) -> Table:
    other = evidence.other
    comments = [
        "Drafted by `recoil-daq init` from recorded files. A text that begins with TODO is a value that only a person",
        "knows: write the value in its place. `recoil-daq check` says what is open. A table behind # is not used.",
    ]
    name = other.tables.get("name", evidence.name) if other is not None else evidence.name
    entries = (
        Entry("schema", SCHEMA), Entry("name", name),
        Entry("reference_clock", evidence.reference, "the source whose clock all others are mapped to"),
    )  # fmt: skip
    return Table("", entries, tuple(comments))


def _mechanism(evidence: Evidence) -> Table:
    """Ask for all that the model needs; what another rig states is taken over."""
    model = evidence.roles.model or MechanismModel.GUN
    stated = {} if evidence.other is None else dict(evidence.other.table("mechanism"))
    if "model" in stated and evidence.roles.model is None:
        model = MechanismModel.LINE if stated["model"] == MechanismModel.LINE else MechanismModel.GUN
    entries = []
    if model is MechanismModel.LINE:
        entries.append(Entry("model", "line", "one body on a line: a force moves it, and no pressure is read"))
    roles = {one.role for one in evidence.roles.by_signal.values()}
    asked = [*Mechanism.required(model, roles)]
    asked.insert(asked.index("friction") + 1, "u_friction")
    for symbol in asked:
        if symbol in stated:
            entries.append(Entry(symbol, stated.pop(symbol), evidence.as_other))
        else:
            entries.append(Entry(symbol, _question_of(symbol, model)))
    having = Mechanism.symbols_of(model, roles)
    for key, value in stated.items():
        if key.removeprefix("u_") in having:
            entries.append(Entry(key, value, evidence.as_other))
    comments = [
        "SI units, angles in rad. `u_<name>` beside a value is its standard uncertainty; without it, it is exact.",
    ]
    if evidence.roles.model is None and model is MechanismModel.GUN:
        comments.append('One body on a line is `model = "line"`: it needs m3, phi20, friction, and none of the others.')
    return Table("[mechanism]", tuple(entries), tuple(comments))


def _question_of(symbol: str, model: MechanismModel) -> Question:
    of = symbol.removeprefix("u_")
    meaning = MEANINGS[of] if symbol == of else f"standard uncertainty of {of}, {MEANINGS[of].rpartition(', ')[2]}"
    bounds = (OF_LINE_SYMBOL if model is MechanismModel.LINE and of in OF_LINE_SYMBOL else OF_SYMBOL).get(of)
    usual = (
        "" if bounds is None or symbol != of else f"; most lie between {bounds.usual[0]:.3g} and {bounds.usual[1]:.3g}"
    )
    return Question(f"{meaning}; from: {_FOUND_IN.get(symbol, 'drawing')}{usual}")


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
    known = {entry.key for entry in entries}
    entries += [
        Entry(key, value, evidence.as_other) for key, value in other.items() if key not in {*known, "align", "framing"}
    ]
    tables = tuple(_framing(source.framing)) if source.framing else ()
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
        meaning = (
            '{ method = "motion", against = ".." }, "redundant", "trigger", "exposure" or "fixed": no signal of the '
            "file repeats one of the reference clock, or shows its motion; docs/rig-file.md"
        )
        yield Entry("align", Question(meaning))


def _framing(framing: Mapping[str, Any]) -> Iterator[Table]:
    """Yield the framing as tables, each field in a line of its own."""
    fields = framing.get("fields")
    plain = [Entry(key, value) for key, value in framing.items() if key != "fields"]
    # the fields stand last, a line each
    yield Table("[source.framing]", (*plain, *([Entry("fields", fields)] if fields is not None else [])))


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
        number = str(min(shared))
        found = re.search(rf"(?<![0-9])0*{number}(?![0-9])", stem)
        if found is not None:
            before, behind = stem[: found.start()], stem[found.end() :]
            return f"{_dateless(before)}{SHOT_PLACE}{_dateless(behind)}{suffix}"
    same = [one for one in files if one.suffix.casefold() == suffix.casefold()]
    return f"*{suffix}" if suffix and len(same) == 1 else _dateless(path.name)


def _dateless(text: str) -> str:
    """Return a part of a name with a star in place of long numbers, which dates and times are."""
    return re.sub(r"\d{4,}([-_.:]?\d{2,})*", "*", re.sub(r"[\[\]?*]", "?", text))


class _Channels:
    """Channels of the draft: what their signals are, and which are left out."""

    def __init__(self, evidence: Evidence) -> None:
        self._evidence = evidence
        self.used = {one.key for one in evidence.signals if self._is_used(one)}
        self._ask_unknown()
        self.names = _channel_names(evidence, self.used)

    def _is_used(self, signal: RecordedSignal) -> bool:
        evidence = self._evidence
        of_clocks = any(signal.key in one.signals for one in evidence.clocks.values())
        known = bool(self._other(signal)) or self.certificate(signal) is not None
        return of_clocks or known or signal.key in evidence.roles.by_signal or signal.key in evidence.supposed

    def _ask_unknown(self) -> None:
        """Take in the signals that move of files that state no unit, where they are few: a role may be among them."""
        unknown = [
            one
            for one in self._evidence.signals
            if one.source in self._without_units() and one.key not in self.used and one.swing is not None
            and one.swing.moves
        ]  # fmt: skip
        if self._evidence.roles.model is None and len(unknown) <= MOST_UNKNOWN:
            self.used |= {one.key for one in unknown}

    def _without_units(self) -> set[str]:
        """Return the sources whose files state no unit at all: those of bytes and buses have none for other reasons."""
        return {
            one.name
            for one in self._evidence.sources
            if one.kind in ("dewetron", "camera") and not any(signal.unit for signal in one.signals)
        }

    def _other(self, signal: RecordedSignal) -> Mapping[str, Any]:
        other = self._evidence.other
        return {} if other is None else other.channel_of(signal.source, signal.name)

    def certificate(self, signal: RecordedSignal) -> Certificate | None:
        """Return the certificate of a signal's sensor; None if none is known."""
        serial = str(self._other(signal).get("sensor", {}).get("serial", ""))
        quantity = str(self._other(signal).get("quantity", "")) or self.quantity_by_unit(signal)
        found = certificate_for(self._evidence.certificates, serial=serial, signal=signal.name, quantity=quantity)
        return found or (
            certificate_for(self._evidence.certificates, serial=serial, signal=signal.name) if not quantity else None
        )

    @staticmethod
    def quantity_by_unit(signal: RecordedSignal) -> str:
        """Return the quantity of a signal's numbers where they are what is measured; empty of volts and the like."""
        return "" if signal.quantity in ("voltage", "charge", "current", "voltage_ratio") else signal.quantity

    def tables(self) -> Iterator[Table]:
        """Yield the channels that are used, then all other signals of the files behind comment signs."""
        for signal in self._evidence.signals:
            if signal.key in self.used:
                yield self._channel(signal)
        for source in self._evidence.sources:
            left = [one for one in source.signals if one.key not in self.used]
            if left:
                yield Table("", (), (f"Other signals of {source.file.name}, to be taken in without their #:",))
            for signal in left:
                yield self._left_out(signal)

    def _left_out(self, signal: RecordedSignal) -> Table:
        entries = [
            Entry("name", self.names[signal.key]), Entry("source", signal.source), Entry("signal", signal.name),
            Entry("quantity", signal.quantity or "..", "" if signal.quantity else "as measured"),
        ]  # fmt: skip
        if signal.unit:
            known = find_unit(signal.unit) is not None or signal.unit.casefold() in PIXELS
            entries.append(Entry("unit", signal.unit, "" if known else "no unit that is known"))
        return Table("[[channel]]", tuple(entries), left_out=True)

    def _channel(self, signal: RecordedSignal) -> Table:
        other, certificate = self._other(signal), self.certificate(signal)
        entries = [Entry("name", self.names[signal.key]), Entry("source", signal.source), Entry("signal", signal.name)]
        entries += self._measured(signal, other, certificate)
        entries += self._role(signal, other)
        return Table("[[channel]]", tuple(entries), tables=tuple(self._sensor(signal, entries, other, certificate)))

    def _measured(
        self, signal: RecordedSignal, other: Mapping[str, Any], certificate: Certificate | None
    ) -> Iterator[Entry]:
        """Yield quantity and unit."""
        evidence, twin = self._evidence, self._evidence.twins.get(signal.key)
        by_certificate = "" if certificate is None else certificate.quantity
        as_other = evidence.as_other
        if by_certificate and not self.quantity_by_unit(signal):
            yield Entry("quantity", by_certificate, "by its certificate")
        elif signal.quantity:
            yield Entry("quantity", signal.quantity)
        elif "quantity" in other:
            yield Entry("quantity", other["quantity"], as_other)
        elif twin is not None:
            yield Entry("quantity", twin.of.quantity, f"repeats {twin.of.name}")
        elif signal.key in evidence.supposed:
            yield Entry("quantity", Question(f"{evidence.supposed[signal.key]}", "angular_rate"))
        else:
            quantities = ", ".join(SI_UNITS)
            yield Entry("quantity", Question(f"quantity that it measures: one of {quantities}"))
        if signal.unit:
            yield Entry("unit", signal.unit)
        elif "unit" in other:
            yield Entry("unit", other["unit"], as_other)
        elif twin is not None and (unit := twin.unit()):
            yield Entry("unit", unit, f"by its scale beside {twin.of.name}, {abs(twin.gain):.4g}")
        elif signal.key in evidence.supposed:
            yield Entry("unit", Question("unit of its numbers, from the device's manual: rad/s, deg/s"))
        else:
            yield Entry("unit", Question("unit of the file's numbers, which states none: as set in the recorder"))

    def _role(self, signal: RecordedSignal, other: Mapping[str, Any]) -> Iterator[Entry]:
        """Yield role and polarity, with their reasons."""
        evidence = self._evidence
        proposal = evidence.roles.by_signal.get(signal.key)
        model = evidence.roles.model or MechanismModel.GUN
        role = str(other.get("role", ""))
        if role:
            yield Entry("role", role, evidence.as_other)
        elif proposal is not None and proposal.certain:
            role = proposal.role
            yield Entry("role", role, proposal.reason)
        elif proposal is not None:
            yield Entry("role", _role_question(proposal, self._quantity(signal), model))
            role = proposal.role
        elif not signal.quantity and signal.key not in evidence.twins and evidence.roles.model is None:
            roles = ", ".join(dict.fromkeys((*GUN_ROLES, *FORCE_ROLES, *LINE_ROLES)))
            yield Entry("role", Question(f"one of {roles}; delete the line if it has none"))
        if "polarity" in other:
            yield Entry("polarity", other["polarity"], evidence.as_other)
        elif role in ROLES and role != "trigger" and signal.swing is not None:
            found = polarity_of(role, signal.swing, model)
            if found is None or found[0] == 0:
                yield Entry("polarity", Question("1, or -1 if the sensor is mounted the other way round"))
            else:
                yield Entry("polarity", found[0], found[1])
        elif (twin := evidence.twins.get(signal.key)) is not None:
            yield Entry("polarity", twin.polarity * self._polarity_of_reference(twin), f"as {twin.of.name}")

    def _quantity(self, signal: RecordedSignal) -> str:
        """Return what a signal measures, or is supposed to."""
        return "angular_rate" if signal.key in self._evidence.supposed else signal.quantity

    def _polarity_of_reference(self, twin: Twin) -> int:
        """Return the polarity that the draft gives to what a twin repeats."""
        given = next((one.value for one in self._role(twin.of, self._other(twin.of)) if one.key == "polarity"), 1)
        return given if isinstance(given, int) else 1

    def _sensor(
        self,
        signal: RecordedSignal,
        entries: Sequence[Entry],
        other: Mapping[str, Any],
        certificate: Certificate | None,
    ) -> Iterator[Table]:
        """Yield the table of the sensor: its certificate, or what is to be taken from it."""
        role = next((one.value for one in entries if one.key == "role"), "")
        stated = next((one.value for one in entries if one.key == "unit"), None)
        unit = stated if isinstance(stated, str) else None
        enters = role != "trigger" and (bool(role) or signal.key in self._evidence.supposed)
        stated_sensor = other.get("sensor")
        sensor: dict[str, Any] = dict(stated_sensor) if isinstance(stated_sensor, dict) else {}
        reasons = dict.fromkeys(
            sensor, "" if self._evidence.other is None else f"as in {self._evidence.other.path.name}"
        )
        if certificate is not None:
            found = certificate.sensor(unit)
            sensor |= found
            reasons |= dict.fromkeys(found, "")
        rows = [Entry(key, value, reasons.get(key, "")) for key, value in sensor.items()]
        if enters:
            rows += [
                Entry(key, question) for key, question in _asked_of_sensor(signal, role, unit) if key not in sensor
            ]
        if rows:
            yield Table("[channel.sensor]", tuple(rows), () if certificate is None else (_row_of(certificate),))


def _row_of(certificate: Certificate) -> str:
    return f"certificate: row {certificate.line} of the table, u_rel = U / k"


def _asked_of_sensor(signal: RecordedSignal, role: Any, unit: str | None) -> Iterator[tuple[str, Question]]:
    yield "serial", Question("serial number, on the sensor and its certificate")
    yield "u_rel", Question("U / k of the sensitivity as a share: certificate, 1 % with k = 2 is 0.005; 0.001 to 0.03")
    if signal.quantity != "displacement":
        shown = f", {unit}" if unit else ""
        yield (
            "range",
            Question(f"[lowest, highest] of sensor and recorder{shown}: certificate, recorder's set-up"),
        )
    if signal.quantity == "voltage":
        yield "sensitivity", Question('sensitivity as on the certificate, such as "40 mV/MPa"')
    offered = role.proposal if isinstance(role, Question) else role
    if offered in _PLACED:
        body = "the recoiling part's centre of mass" if offered == _PLACED[0] else "the trunnion A"
        yield "position", Question(f"[along, across] from {body}, in the body's axes, m: drawing, ruler")


def _role_question(proposal: RoleProposal, quantity: str, model: MechanismModel) -> Question:
    roles = LINE_ROLES if model is MechanismModel.LINE else GUN_ROLES
    fitting = [role for role in roles if ROLES[role] == quantity]
    offered = proposal.role or None
    rest = f"one of {', '.join(fitting)}" if fitting else "a role"
    return Question(f"{proposal.reason}; {rest}; delete the line if it has none", offered)


def _channel_names(evidence: Evidence, used: set[str]) -> dict[str, str]:
    """Return a name for each signal: its own part without signs, with its source's where it would be there twice."""
    names: dict[str, str] = {}
    signals = sorted(evidence.signals, key=lambda one: (one.source != evidence.reference, one.key not in used))
    for signal in signals:
        other = {} if evidence.other is None else evidence.other.channel_of(signal.source, signal.name)
        plain = re.sub(r"\W+", "_", own_part(signal.name)).strip("_") or "signal"
        if plain[0].isdigit() or plain.startswith("f32_at_"):
            plain = f"{signal.source}_{plain}"
        wanted = str(other.get("name") or plain)
        free, number = wanted, 1
        while free in names.values():
            number += 1
            free = f"{wanted}_{signal.source}" if number == 2 else f"{wanted}_{signal.source}_{number}"
        names[signal.key] = free
    return names


def _trigger(evidence: Evidence, channels: _Channels) -> Iterator[Table]:
    """Yield the trigger: that of the other rig, or the level of the drive, behind comment signs."""
    if evidence.other is not None:
        for key in ("trigger", "knowledge", "report", "twin"):
            if key == "twin" or not (table := evidence.other.table(key)):
                continue
            yield from _taken_over(key, table)
        if evidence.other.table("trigger"):
            return
    for role in ("breech_pressure", "driving_force", "recoil_acceleration"):
        found = next((one for one in evidence.signals if _has_role(evidence, one, role)), None)
        if found is None or found.swing is None or not found.unit or (unit := UNITS.get(found.unit)) is None:
            continue
        level, rearm = (share * abs(found.swing.peak) / unit.factor for share in (TRIGGER_SHARE, REARM_SHARE))
        base = found.swing.base / unit.factor
        condition = (
            Entry("channel", channels.names[found.key], f"peak {abs(found.swing.peak) / unit.factor:.4g} {found.unit}"),
            Entry("kind", "edge"),
            Entry("level", f"{base + level:.3g} {found.unit}", "20 % of the peak"),
            Entry("rearm", f"{base + rearm:.3g} {found.unit}", "10 % of it"),
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
