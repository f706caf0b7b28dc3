"""All that the files of a shot tell together: their clocks, their roles, and which of their signals are the same."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from recoil_acquisition.quantities.quantity import SI_UNITS, UNITS, find_unit
from recoil_daq.drafting.clock_proposal import ClockProposal, Twin, by_forces, by_motion, by_twin, find_twins
from recoil_daq.drafting.line_clocks import by_exposure, by_trigger
from recoil_daq.drafting.other_rig import OtherRig
from recoil_daq.drafting.recorded_source import RecordedSignal, RecordedSource, with_swing
from recoil_daq.drafting.role_proposal import ProposedRoles, RoleProposal, propose_roles
from recoil_daq.drafting.role_words import quantity_by_name, role_by_name
from recoil_rigs.checks.rig_alignments import DRIVEN
from recoil_rigs.mechanism.mechanism_parameters import MechanismModel
from recoil_rigs.tables.certificate_table import Certificate, certificate_for
from recoil_rigs.tables.rig_tables import FORCE_ROLES, ROLES
from recoil_rigs.tables.sensitivity import OUTPUTS, Sensitivity, output_from_text, sensitivity_from_text

USUAL_NAME = "rig.toml"
"""Usual name of a rig file, which is then named after its folder."""


@dataclass(frozen=True)
class Supposition:
    """Supposed quantity and unit of a signal of which the file does not tell; somebody confirms them.

    Attributes
    ----------
    quantity
        Quantity that it is supposed to measure.
    unit
        Unit that its numbers are supposed to have; empty where nothing speaks for one.
    reason
        Evidence, in words.
    factor, offset
        Line to SI by that unit, and by the sensitivity behind it.
    """

    quantity: str
    unit: str
    reason: str
    factor: float = 1.0
    offset: float = 0.0


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
        Supposed quantities and units of signals of which the files do not tell, by their keys.
    complete
        Whether all files that were given could be read.
    """

    name: str
    sources: Sequence[RecordedSource]
    reference: str
    roles: ProposedRoles
    clocks: Mapping[str, ClockProposal]
    twins: Mapping[str, Twin]
    supposed: Mapping[str, Supposition] = field(default_factory=dict)
    certificates: tuple[Certificate, ...] = ()
    other: OtherRig | None = None
    complete: bool = True

    @property
    def signals(self) -> list[RecordedSignal]:
        """Signals of all sources."""
        return [one for source in self.sources for one in source.signals]

    @property
    def model(self) -> MechanismModel:
        """Model of what moves; where the files show no shot, a line if all is known of them and no pressure is."""
        if self.roles.model is not None:
            return self.roles.model
        known = all(source.signals for source in self.sources) and self.complete
        pressures = any(self.quantity_of(one) == "pressure" for one in self.signals)
        return MechanismModel.LINE if known and not pressures else MechanismModel.GUN

    def quantity_of(self, signal: RecordedSignal) -> str:
        """Return what a signal measures, or is supposed to; empty if nothing tells."""
        supposed = self.supposed.get(signal.key)
        return signal.quantity if supposed is None else supposed.quantity

    @property
    def as_other(self) -> str:
        """Reason for what is taken over from the other rig; empty if there is none."""
        return "" if self.other is None else self.other.reason


def evidence_of(
    path: Path,
    sources: Sequence[RecordedSource],
    certificates: tuple[Certificate, ...],
    other: OtherRig | None,
    *,
    complete: bool = True,
) -> Evidence:
    """Compare sources with each other, with certificates and with another rig.

    Parameters
    ----------
    path
        Path of the rig file, by which the rig is named.
    complete
        Whether all files that were given could be read.
    """
    measured = [_measured(source, certificates, other) for source in sources]
    reference = _reference(measured, other)
    measured.sort(key=lambda one: one.name != reference)
    return _evidence(path, measured, reference, certificates, other, complete=complete)


def _reference(sources: Sequence[RecordedSource], other: OtherRig | None) -> str:
    """Return the source whose clock is the reference: the other rig's, else the recorder with the highest rate."""
    names = [one.name for one in sources]
    stated = None if other is None else other.tables.get("reference_clock")
    if stated in names:
        return str(stated)

    def rank(source: RecordedSource) -> tuple[bool, float]:
        rates = [one.rate_hz for one in source.signals if math.isfinite(one.rate_hz)]
        return source.kind == "dewetron", max(rates, default=0.0)

    return max(sources, key=rank).name


def _measured(source: RecordedSource, certificates: tuple[Certificate, ...], other: OtherRig | None) -> RecordedSource:
    """Take quantity and scale of signals whose file does not tell from the other rig and from certificates."""
    return replace(source, signals=tuple(_in_si(one, certificates, other) for one in source.signals))


def _in_si(signal: RecordedSignal, certificates: tuple[Certificate, ...], other: OtherRig | None) -> RecordedSignal:
    row = {} if other is None else other.channel_of(signal.source, signal.name)
    sensor = {} if other is None else other.sensor_of(signal.source, signal.name)
    unit = find_unit(signal.unit or str(row.get("unit", "")))
    certificate = certificate_of(signal, certificates, other)
    quantity = str(row.get("quantity", "")) or ("" if certificate is None else certificate.quantity)
    gain = _gain(sensor) if signal.counts else 1.0
    if unit is None or quantity not in SI_UNITS or gain is None:
        return signal
    if quantity in unit.quantities:
        measured = replace(signal, quantity=quantity, factor=unit.factor * gain, offset=unit.offset)
    else:
        stated = _sensitivity(certificate, sensor)
        if stated is None or not stated[0].turned_into(unit) or quantity not in stated[0].per.quantities:
            return signal
        factor = unit.factor * stated[0].per_recorded(unit, stated[1])
        measured = replace(signal, quantity=quantity, factor=factor, offset=-stated[2])
    same = (measured.quantity, measured.factor, measured.offset) == (signal.quantity, signal.factor, signal.offset)
    return signal if same else with_swing(measured)


def _gain(sensor: Mapping[str, Any]) -> float | None:
    """Return the gain that another rig states of a sensor; None where it states none."""
    gain = sensor.get("gain")
    return float(gain) if isinstance(gain, int | float) and gain > 0 else None


def certificate_of(
    signal: RecordedSignal, certificates: tuple[Certificate, ...], other: OtherRig | None
) -> Certificate | None:
    """Return the certificate of a signal's sensor: by the serial number in another rig, or by the signal's name."""
    row = {} if other is None else other.channel_of(signal.source, signal.name)
    serial = "" if other is None else str(other.sensor_of(signal.source, signal.name).get("serial", ""))
    by_unit = "" if signal.quantity in OUTPUTS else signal.quantity
    quantity = str(row.get("quantity", "")) or by_unit
    return certificate_for(certificates, serial=serial, signal=signal.name, quantity=quantity)


def _sensitivity(certificate: Certificate | None, sensor: Mapping[str, Any]) -> tuple[Sensitivity, float, float] | None:
    """Return the sensitivity that a certificate or the other rig states, the amplifier, and what its bias means, SI."""
    stated = dict(sensor)
    if certificate is not None:
        stated |= certificate.sensor(None)
    try:
        sensitivity, amplifier = sensitivity_from_text(stated["sensitivity"]), float(stated.get("amplifier", 1.0))
        bias, unit = output_from_text(stated.get("zero", "0 V"))
        return sensitivity, amplifier, unit.to_si(bias) * sensitivity.per_recorded(unit, amplifier)
    except (KeyError, TypeError, ValueError):
        return None


def _evidence(
    path: Path,
    sources: Sequence[RecordedSource],
    reference: str,
    certificates: tuple[Certificate, ...],
    other: OtherRig | None,
    *,
    complete: bool,
) -> Evidence:
    """Compare the sources, and look what each signal does."""
    of_reference = next(one for one in sources if one.name == reference)
    others = [one for one in sources if one.name != reference]
    twins: dict[str, Twin] = {}
    supposed = _without_units(sources, certificates, other)
    found: dict[str, tuple[Twin, ...]] = {}
    for source in others:
        tried = source.signals if source.dated else ()
        found[source.name] = find_twins(tried, of_reference.signals, found_in_bytes=source.found_in_bytes)
        twins |= {twin.signal.key: twin for twin in found[source.name]}
        supposed |= _angular_rates(source, found[source.name])
    signals = [*of_reference.signals, *(one for source in others for one in source.signals)]
    as_measured = [_supposed(one, supposed) for one in signals]
    roles = propose_roles(as_measured, frozenset(twins), complete=complete)
    roles = _doubted(roles, supposed)
    clocks = {}
    for source in others:
        proposal = _clock(source, found[source.name], as_measured, roles, reference)
        if proposal is not None:
            clocks[source.name] = proposal
    roles = _with_lines(roles, clocks)
    name = path.resolve().parent.name if path.stem == Path(USUAL_NAME).stem else path.stem
    return Evidence(name or "rig", sources, reference, roles, clocks, twins, supposed, certificates, other, complete)


def _without_units(
    sources: Sequence[RecordedSource], certificates: tuple[Certificate, ...], other: OtherRig | None
) -> dict[str, Supposition]:
    """Suppose what the signals are of files that state no unit at all: by their certificates, else by their names."""
    found: dict[str, Supposition] = {}
    for source in sources:
        if source.found_in_bytes or any(one.unit for one in source.signals):
            continue
        named: dict[str, RecordedSignal] = {}
        for one in source.signals:
            row = {} if other is None else other.channel_of(one.source, one.name)
            moves = one.swing is not None and one.swing.moves
            if one.quantity or row.get("unit") or not moves:
                continue
            supposition = _by_certificate(certificate_of(one, certificates, other))
            if supposition is not None:
                found[one.key] = supposition
            elif (role := role_by_name(one.name)) and named.setdefault(role, one) is one:
                reason = f"its name is that of a {role}"
                found[one.key] = Supposition(ROLES[role], "", reason)
            elif quantity := quantity_by_name(one.name):
                found[one.key] = Supposition(quantity, "", f"its name tells {quantity}")
        farthest = _farthest(source) if source.kind == "camera" else None
        if farthest is not None and not any(one.key in found for one in source.signals):
            found[farthest.key] = Supposition("displacement", "", "goes farthest of the camera's tracks")
    return found


def _farthest(source: RecordedSource) -> RecordedSignal | None:
    """Return the track of a camera that moves most; None if none does."""
    moving = [(abs(one.swing.peak), one) for one in source.signals if one.swing is not None and one.swing.moves]
    return max(moving, key=lambda one: one[0], default=(0.0, None))[1]


def _by_certificate(certificate: Certificate | None) -> Supposition | None:
    """Suppose that a signal is in the volts of its sensor's sensitivity, or else in its certificate's unit."""
    if certificate is None or not certificate.quantity:
        return None
    quantity = certificate.quantity
    reason = (
        f"row {certificate.line} of the table of certificates"
        if certificate.line
        else f"certificate {certificate.file}"
    )
    stated = _sensitivity(certificate, {})
    if stated is not None and quantity in stated[0].per.quantities:
        name = "V" if stated[0].needs_amplifier else stated[0].output_name
        factor = UNITS[name].factor * stated[0].per_recorded(UNITS[name], stated[1])
        return Supposition(quantity, name, reason, factor, -stated[2])
    name = str(certificate.cells.get("unit") or SI_UNITS[quantity])
    unit = find_unit(name)
    return None if unit is None else Supposition(quantity, name, reason, unit.factor, unit.offset)


def _angular_rates(source: RecordedSource, twins: Sequence[Twin]) -> dict[str, Supposition]:
    """Return the fields of an inertial sensor that are likely to be angular rates, and why."""
    repeating = {twin.signal.key: twin for twin in twins}
    of = next((twin for twin in twins if twin.of.quantity == "acceleration"), None)
    if not source.found_in_bytes or of is None:
        return {}
    reason = f"{of.signal.name} of the same device repeats an acceleration, so this may be a rate; device's manual"
    return {
        one.key: Supposition("angular_rate", "", reason)
        for one in source.signals
        if one.key not in repeating and not one.unit and one.swing is not None and one.swing.moves
    }


def _supposed(signal: RecordedSignal, supposed: Mapping[str, Supposition]) -> RecordedSignal:
    one = supposed.get(signal.key)
    if one is None:
        return signal
    measured = replace(signal, quantity=one.quantity, factor=one.factor, offset=one.offset)
    return measured if (one.factor, one.offset) == (1.0, 0.0) else with_swing(measured)


def _doubted(roles: ProposedRoles, supposed: Mapping[str, Supposition]) -> ProposedRoles:
    """Ask for the roles of signals whose quantity is supposed."""
    by_signal = {key: replace(one, certain=False) if key in supposed else one for key, one in roles.by_signal.items()}
    return ProposedRoles(roles.model, by_signal)


def _clock(
    source: RecordedSource,
    twins: Sequence[Twin],
    signals: Sequence[RecordedSignal],
    roles: ProposedRoles,
    reference: str,
) -> ClockProposal | None:
    """Find the way in which a source's clock is found, the surest first; None if none holds."""
    if not source.dated:
        return by_twin(twins[0]) if twins else None
    by_role = {one.role: key for key, one in roles.by_signal.items() if one.role}
    feels = next((one for one in signals if one.key == by_role.get("recoil_acceleration")), None)
    of_reference = [one for one in signals if one.source == reference]
    if source.kind == "camera":
        motion = feels if feels is not None and feels.source == reference else None
        exposed = by_exposure(source.signals, of_reference, motion)
        if exposed is not None:
            return exposed
    if twins:
        return by_twin(twins[0])
    own = [one for one in signals if one.source == source.name]
    travels = [one for one in own if one.key in roles.by_signal and one.quantity == "displacement"]
    if travels and feels is not None and feels.source != source.name:
        found = by_motion(travels[0], feels)
        if found is not None:
            return found
    role_of = {key: one.role for key, one in roles.by_signal.items()}
    motions = [one for role in DRIVEN[FORCE_ROLES[0]] for one in own if role_of.get(one.key) == role]
    signs = zip(FORCE_ROLES, (1.0, -1.0), strict=True)
    forces = [(one, sign) for role, sign in signs for one in of_reference if role_of.get(one.key) == role]
    if motions and forces:
        found = by_forces(motions, forces)
        if found is not None:
            return found
    return by_trigger(own, of_reference)


def _with_lines(roles: ProposedRoles, clocks: Mapping[str, ClockProposal]) -> ProposedRoles:
    """Give the role trigger to the line by whose edge a clock is found, and take it from one of many pulses."""
    by_signal = dict(roles.by_signal)
    for proposal in clocks.values():
        if proposal.align["method"] == "exposure":
            by_signal.pop(str(proposal.align["channel"]), None)
        elif proposal.align["method"] == "trigger":
            by_signal[proposal.signals[-1]] = RoleProposal("trigger", True, proposal.reason)
    return ProposedRoles(roles.model, by_signal)
