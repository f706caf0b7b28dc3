"""Channels of a rig file's draft: what each signal is, of which sensor, and which signals are left out."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from recoil_acquisition.quantities.quantity import SI_UNITS, UNITS, find_unit
from recoil_daq.drafting.answer import a_number, a_sensitivity, a_sign, a_unit, as_text, one_of, two_numbers
from recoil_daq.drafting.clock_proposal import Twin
from recoil_daq.drafting.evidence import Evidence, certificate_of
from recoil_daq.drafting.recorded_source import PIXELS, RecordedSignal
from recoil_daq.drafting.rig_draft import Entry, Question, Table
from recoil_daq.drafting.role_proposal import RoleProposal, polarity_of
from recoil_daq.drafting.role_words import GUN_ROLES, LINE_ROLES, own_part
from recoil_rigs.checks.plausible import SCALE, U_REL
from recoil_rigs.mechanism.mechanism_parameters import MECHANISM, MechanismModel
from recoil_rigs.mechanism.mechanism_table import stated_values
from recoil_rigs.tables.certificate_table import Certificate
from recoil_rigs.tables.rig_tables import CARRIAGE_ACCELERATIONS, FORCE_ROLES, ROLES

MOST_UNKNOWN = 12
"""Signals without a unit that are asked for; more of them stand behind comment signs."""
_PLACED = ("recoil_acceleration", *CARRIAGE_ACCELERATIONS)
"""Roles of sensors whose place on their body counts."""
_OF_UNCERTAINTY = ("u_rel", "U_rel", "k", "nu")
"""Keys of a sensor that say together how well its scale is known."""


class DraftedChannels:
    """Channels of the draft: what their signals are, and which are left out."""

    def __init__(self, evidence: Evidence) -> None:
        self._evidence = evidence
        self.used = {one.key for one in evidence.signals if self._is_used(one)}
        self._asked: set[str] = set()
        self._ask_unknown()
        if not self.used:
            self._ask_any()
        self.names = _channel_names(evidence, self.used)

    def _is_used(self, signal: RecordedSignal) -> bool:
        evidence = self._evidence
        of_clocks = any(signal.key in one.signals for one in evidence.clocks.values())
        known = bool(self._other(signal)) or self.certificate(signal) is not None
        return of_clocks or known or signal.key in evidence.roles.by_signal or signal.key in evidence.supposed

    def _ask_unknown(self) -> None:
        """Take in the signals that move of files that state no unit, where they are few: a role may be among them."""
        sources = self._without_units()
        unknown = [
            one
            for one in self._evidence.signals
            if one.source in sources and one.key not in self.used and one.swing is not None and one.swing.moves
        ]
        if self._evidence.roles.model is None and len(unknown) <= MOST_UNKNOWN:
            self.used |= {one.key for one in unknown}

    def _ask_any(self) -> None:
        """Take in what may bear a role, of files that show no shot: a rig without a channel is none."""
        known = [one for one in self._evidence.signals if one.quantity]
        of_roles = [one for one in known if one.quantity in ROLES.values()]
        moving = [one for one in of_roles if one.swing is not None and one.swing.moves]
        self._asked = {one.key for one in moving[:MOST_UNKNOWN]}
        taken = moving[:MOST_UNKNOWN] or of_roles[:1] or known[:1] or self._evidence.signals[:1]
        self.used = {one.key for one in taken}

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
        return certificate_of(signal, self._evidence.certificates, self._evidence.other)

    def tables(self) -> Iterator[Table]:
        """Yield the channels that are used, then all other signals of the files behind comment signs."""
        if not self._evidence.signals:
            yield self._unlisted()
        for signal in self._evidence.signals:
            if signal.key in self.used:
                yield self._channel(signal)
        for source in self._evidence.sources:
            left = [one for one in source.signals if one.key not in self.used]
            if left:
                yield Table("", (), (f"Other signals of {source.file.name}, to be taken in without their #:",))
            for signal in left:
                yield self._left_out(signal)

    def _unlisted(self) -> Table:
        """Ask for a channel of a file whose signals are not known before somebody says what explains them."""
        source = self._evidence.sources[0]
        listed = f"signal of {source.file.name}: run `recoil-daq init` again once what explains its bytes is stated"
        entries = (
            Entry("name", "first"), Entry("source", source.name), Entry("signal", Question(listed, read=as_text)),
            Entry("quantity", Question("quantity that it measures", read=one_of(list(SI_UNITS)))),
        )  # fmt: skip
        return Table("[[channel]]", entries)

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
        return Table("[[channel]]", tuple(entries), tables=tuple(self._sensor(signal, entries, certificate)))

    def _measured(
        self, signal: RecordedSignal, other: Mapping[str, Any], certificate: Certificate | None
    ) -> Iterator[Entry]:
        """Yield quantity and unit."""
        evidence, twin = self._evidence, self._evidence.twins.get(signal.key)
        by_certificate = "" if certificate is None else certificate.quantity
        as_other = evidence.as_other
        unit = find_unit(signal.unit)
        if signal.quantity:
            by_unit = unit is None or signal.quantity in unit.quantities
            yield Entry("quantity", signal.quantity, "" if by_unit else "by its certificate")
        elif by_certificate:
            yield Entry("quantity", by_certificate, "by its certificate")
        elif "quantity" in other:
            yield Entry("quantity", other["quantity"], as_other)
        elif twin is not None:
            yield Entry("quantity", twin.of.quantity, f"repeats {twin.of.name}")
        elif signal.key in evidence.supposed:
            likely = evidence.supposed[signal.key]
            yield Entry("quantity", Question(likely.reason, likely.quantity, one_of(list(SI_UNITS))))
        else:
            quantities = ", ".join(SI_UNITS)
            meaning = f"quantity that it measures: one of {quantities}"
            yield Entry("quantity", Question(meaning, read=one_of(list(SI_UNITS)), opens=True))
        if signal.unit:
            yield Entry("unit", signal.unit)
        elif "unit" in other:
            yield Entry("unit", other["unit"], as_other)
        elif signal.counts and (certified := "" if certificate is None else certificate.cells.get("unit", "")):
            yield Entry("unit", certified, "of its numbers times `gain`, as certified")
        elif twin is not None and signal.counts:
            yield Entry("unit", SI_UNITS[twin.of.quantity], "of its numbers times `gain`")
        elif twin is not None and (scale := twin.unit()):
            yield Entry("unit", scale, f"by its scale beside {twin.of.name}, {abs(twin.gain):.4g}")
        elif (supposed := evidence.supposed.get(signal.key)) is not None and supposed.unit:
            meaning = f"unit of the file's numbers, which states none: as set in the recorder; {supposed.reason}"
            yield Entry("unit", Question(meaning, supposed.unit, a_unit(PIXELS)))
        elif supposed is not None:
            usual = ", ".join(name for name, one in UNITS.items() if supposed.quantity in one.quantities)
            of = "its numbers times `gain`" if signal.counts else "its numbers"
            meaning = f"unit of {of}, from the device's manual: one of {usual}"
            yield Entry("unit", Question(meaning, read=a_unit(PIXELS)))
        elif signal.counts:
            meaning = "unit of its numbers times `gain`, from the device's manual"
            yield Entry("unit", Question(meaning, read=a_unit(PIXELS)))
        else:
            meaning = "unit of the file's numbers, which states none: as set in the recorder"
            yield Entry("unit", Question(meaning, read=a_unit(PIXELS), opens=True))

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
            yield Entry("role", _role_question(proposal, self._evidence.quantity_of(signal), model))
            role = proposal.role
        elif self._is_asked_for_its_role(signal):
            roles = dict.fromkeys((*GUN_ROLES, *FORCE_ROLES, *LINE_ROLES))
            fitting = [one for one in roles if signal.quantity in ("", ROLES[one])]
            meaning = f"one of {', '.join(fitting)}; delete the line if it has none"
            yield Entry("role", Question(meaning, read=one_of(fitting, or_none=True)))
        if "polarity" in other:
            yield Entry("polarity", other["polarity"], evidence.as_other)
        elif role in ROLES and role != "trigger" and signal.swing is not None:
            found = polarity_of(role, signal.swing, model, self._d_m())
            if found.value and found.certain:
                yield Entry("polarity", found.value, found.reason)
            else:
                meaning = f"{found.reason}; 1, or -1 if the sensor is mounted the other way round"
                yield Entry("polarity", Question(meaning, found.value or None, a_sign))
        elif (twin := evidence.twins.get(signal.key)) is not None:
            yield Entry("polarity", twin.polarity * self._polarity_of_reference(twin), f"as {twin.of.name}")

    def _is_asked_for_its_role(self, signal: RecordedSignal) -> bool:
        """Whether nothing speaks for a role of a signal, and somebody is asked all the same, or was and is to be."""
        other = self._evidence.other
        if other is not None and other.asks(signal.source, signal.name, "role"):
            return True
        return self._evidence.roles.model is None and (signal.key in self._asked or self._says_nothing(signal))

    def _says_nothing(self, signal: RecordedSignal) -> bool:
        """Whether a file tells nothing of a signal."""
        return not signal.quantity and signal.key not in self._evidence.twins

    def _d_m(self) -> float | None:
        """Return the symbol d that another rig states; None if none does."""
        other = self._evidence.other
        stated = None if other is None else stated_values(other.table(MECHANISM), []).get("d")
        return float(stated) if isinstance(stated, int | float) else None

    def _polarity_of_reference(self, twin: Twin) -> int:
        """Return the polarity that the draft gives to what a twin repeats."""
        given = next((one.value for one in self._role(twin.of, self._other(twin.of)) if one.key == "polarity"), 1)
        return given if isinstance(given, int) else 1

    def _sensor(
        self,
        signal: RecordedSignal,
        entries: Sequence[Entry],
        certificate: Certificate | None,
    ) -> Iterator[Table]:
        """Yield the table of the sensor: its certificate, or what is to be taken from it."""
        role = next((one.value for one in entries if one.key == "role"), "")
        stated = next((one.value for one in entries if one.key == "unit"), None)
        unit = stated if isinstance(stated, str) else None
        enters = role != "trigger" and (bool(role) or signal.key in self._evidence.supposed)
        other = self._evidence.other
        sensor = {} if other is None else dict(other.sensor_of(signal.source, signal.name))
        reasons = dict.fromkeys(sensor, self._evidence.as_other)
        if certificate is not None:
            found = certificate.sensor(unit)
            if "U_rel" in found:  # another certificate, all of it
                sensor = {key: value for key, value in sensor.items() if key not in _OF_UNCERTAINTY}
            sensor |= found
            reasons |= dict.fromkeys(found, "")
            if unit is None and "range" in found:
                reasons["range"] = f"in {certificate.cells['unit']}, as certified: another `unit` needs it turned"
        rows = [Entry(key, value, reasons.get(key, "")) for key, value in sensor.items()]
        if enters:
            asked = dict(_asked_of_sensor(self._evidence.quantity_of(signal), role, unit))
            if self._evidence.roles.model is MechanismModel.LINE:
                asked.pop("position", None)  # a body that does not turn feels the same everywhere
            if other is not None:
                asked = {
                    key: one
                    for key, one in asked.items()
                    if key == "u_rel" or not other.leaves_out(signal.source, signal.name, key)
                }
            answered = {*sensor, *(("u_rel",) if "U_rel" in sensor else ())}
            rows += [Entry(key, one) for key, one in asked.items() if key not in answered]
        if signal.counts and not signal.unit and "gain" not in sensor:
            rows += self._gain(signal, unit)
        if rows:
            yield Table("[channel.sensor]", tuple(rows), () if certificate is None else (_row_of(certificate),))

    def _gain(self, signal: RecordedSignal, unit: str | None) -> Iterator[Entry]:
        """Yield the scale of whole numbers that were found in bytes: by what they repeat, else it is asked for."""
        twin = self._evidence.twins.get(signal.key)
        known = None if unit is None else find_unit(unit)
        if twin is not None and known is not None and not signal.quantity:
            yield Entry("gain", float(f"{twin.per_number / known.factor:.4g}"), f"by its scale beside {twin.of.name}")
        else:
            meaning = "value of one count, in the channel's unit: device's manual, 1 / 32768 is 3.05e-05"
            yield Entry("gain", Question(meaning, read=a_number(unit or "", SCALE)))


def _row_of(certificate: Certificate) -> str:
    return f"certificate: {certificate.place}"


def _asked_of_sensor(quantity: str, role: Any, unit: str | None) -> Iterator[tuple[str, Question]]:
    offered = role.proposal if isinstance(role, Question) else role
    yield "serial", Question("serial number, on the sensor and its certificate", read=as_text)
    meaning = "U / k of the sensitivity as a share: certificate, 1 % with k = 2 is 0.005; 0.001 to 0.03"
    yield "u_rel", Question(meaning, read=a_number("", U_REL))
    if offered == "breech_pressure":
        meaning = "how its certificate was found: static, at rest, or dynamic, in pulses like the shot's"
        yield "calibration", Question(meaning, "static", one_of(("static", "dynamic")))
    if quantity != "displacement":
        shown = f", {unit}" if unit else ""
        meaning = f"[lowest, highest] of sensor and recorder{shown}: certificate, recorder's set-up"
        yield "range", Question(meaning, read=two_numbers(unit, rising=True))
    if quantity == "voltage":
        yield "sensitivity", Question('sensitivity as on the certificate, such as "40 mV/MPa"', read=a_sensitivity)
    if offered in _PLACED:
        body = "the recoiling part's centre of mass" if offered == _PLACED[0] else "the trunnion A"
        meaning = f"[along, across] from {body}, in the body's axes, m: drawing, ruler"
        yield "position", Question(meaning, read=two_numbers("m"))


def _role_question(proposal: RoleProposal, quantity: str, model: MechanismModel) -> Question:
    roles = LINE_ROLES if model is MechanismModel.LINE else GUN_ROLES
    fitting = [role for role in roles if ROLES[role] == quantity]
    offered = proposal.role or None
    rest = f"one of {', '.join(fitting)}" if fitting else "a role"
    return Question(
        f"{proposal.reason}; {rest}; delete the line if it has none",
        offered,
        one_of(fitting or list(ROLES), or_none=True),
    )


def _channel_names(evidence: Evidence, used: set[str]) -> dict[str, str]:
    """Return a name for each signal: its own part without signs, with its source's where it would be there twice."""
    names: dict[str, str] = {}
    signals = sorted(evidence.signals, key=lambda one: (one.source != evidence.reference, one.key not in used))
    for signal in signals:
        other = {} if evidence.other is None else evidence.other.channel_of(signal.source, signal.name)
        plain = re.sub(r"\W+", "_", own_part(signal.name)).strip("_") or "signal"
        if plain[0].isdigit() or re.match(r"[fi]\d\d_at_", plain):
            plain = f"{signal.source}_{plain}"
        wanted = str(other.get("name") or plain)
        free, number = wanted, 1
        while free in names.values():
            number += 1
            free = f"{wanted}_{signal.source}" if number == 2 else f"{wanted}_{signal.source}_{number}"
        names[signal.key] = free
    return names
