"""Assumptions of every result on a rig, because its rig file or the shot log does not say otherwise."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from types import MappingProxyType
from typing import Any

from recoil_acquisition.measured import Worded, beside, joined, measured, with_figures, worded
from recoil_acquisition.quantities.quantity import STANDARD_ATMOSPHERE_PA
from recoil_acquisition.remark import Note, NoteCode
from recoil_rigs.mechanism.mechanism_parameters import Mechanism
from recoil_rigs.rig import Rig
from recoil_rigs.tables.channel_table import (
    STATIC_U_DYNAMIC_REL,
    USUAL_U_DISTORTION_M,
    USUAL_U_LINE_S,
    USUAL_U_ZERO_REL,
)
from recoil_rigs.tables.force_input import AREAS
from recoil_rigs.tables.rig_tables import FORCE_SENSOR_ROLES

NOTHING_OF_CHAIN = "nothing that the breech chain does is taken until stated"
"""Assumption on muzzle brake, tube and breech gauge: they are taken for sound."""
NO_COMMON_STANDARD = "no calibration standard in common (1 % of one would be 1 % of the mass)"
"""Assumption on gauges that name none: all forces too large by a share are those of a mass too large by it."""

ABSOLUTE_PRESSURE = worded(
    "absolute pressure less the standard atmosphere, ", measured(1e-5 * STANDARD_ATMOSPHERE_PA, "bar", "g")
)
"""Assumption on a gauge whose unit counts from a vacuum."""


@dataclass(frozen=True)
class Assumption:
    """One value that is taken as it stands.

    Attributes
    ----------
    quantity
        Symbol of the mechanism, role, name of a channel, or the added mass.
    taken
        Value that is assumed of it.
    detail
        Sentence on what the rig file or the shot log lacks, and what follows from it.
    """

    quantity: str
    taken: str
    detail: str


def assumptions_of(rig: Rig, absolute: Collection[str] = ()) -> list[dict[str, Any]]:
    """List the assumptions of a rig in JSON types, for verdicts and reports; with ``figures`` of what is taken.

    Parameters
    ----------
    absolute
        Names of channels whose files state a unit of absolute pressure.
    """
    return [asdict(one) | beside(one.taken) for one in _assumptions(rig, absolute)]


def assumption_notes(rig: Rig, absolute: Collection[str] = ()) -> list[Note]:
    """Say each assumption of a rig in a note of its own, about what is assumed of; as `assumptions_of`."""
    return [
        Note(NoteCode.ASSUMPTION, one.quantity, joined(": ", (one.quantity, one.taken, one.detail)))
        for one in _assumptions(rig, absolute)
    ]


def assumption_lines(assumptions: Sequence[Mapping[str, Any]]) -> list[Worded]:
    """Say each kind of assumption in one line that names all it holds for."""
    kinds = {one["taken"]: with_figures(one["taken"], one) for one in assumptions}
    return [
        worded(kind, ": ", ", ".join(one["quantity"] for one in assumptions if one["taken"] == kind))
        for kind in kinds.values()
    ]


_FORCES: Mapping[str, tuple[str, float, str]] = MappingProxyType(
    {
        "bore_friction": ("% of the breech force", 100.0, "what the projectile's friction takes off"),
        "muzzle_brake": ("% of the breech force", 100.0, "what a muzzle brake takes off once the projectile is out"),
        "unread_share": (
            "% of the resistance",
            100.0,
            "what else resists or pushes, read by no gauge",
        ),
        "slide_friction": ("N s/m", 1.0, "viscous friction of slides and seals"),
        "carried_mass": ("kg", 1.0, "oil and rods that move along, which the specification lacks"),
    }
)
"""Symbol -> unit in which it is said, its factor on the value, and what it is."""


def _forces_that_nobody_reads(m: Mechanism, symbols: Sequence[str]) -> Iterator[Assumption]:
    """Say what is taken of the forces that no gauge reads: a usual value, or a stated one as exact."""
    for symbol, (unit, factor, what) in ((one, row) for one, row in _FORCES.items() if one in symbols):
        value, u = factor * getattr(m, symbol), factor * m.u.get(symbol, 0.0)
        if {symbol, f"u_{symbol}"} <= m.unstated:
            if u or symbol == "carried_mass":
                taken = f"{value:g} +- {u:g} {unit}" if u else f"none is taken, 0 {unit}"
                yield Assumption(symbol, taken, f"[mechanism] does not state {what}: write {symbol} and u_{symbol}")
        elif symbol in m.unstated:
            if value:
                detail = f"[mechanism] has u_{symbol} and no {symbol}"
                yield Assumption(symbol, f"{value:g} {unit} is taken", detail)
        elif symbol not in m.u:
            detail = f"[mechanism] has no u_{symbol}: {value:g} {unit} is taken"
            yield Assumption(symbol, "taken as exact", detail)
    if "unread_force" in m.unstated:
        detail = "[mechanism] does not state what else acts, of whatever shape: write unread_force, 0 if nothing does"
        yield Assumption("unread_force", f"0 +- {100 * m.unread_force:g} % of the peak resistance", detail)


def _unstated_breech_chain(rig: Rig) -> Iterator[Assumption]:
    """Say what of the breech chain is taken to be sound because nobody states it; a shot is asked for it."""
    m, follows = rig.mechanism, "where a shot shows it, it is not valid and names it"
    if not rig.with_role("breech_pressure"):
        return
    if {"muzzle_brake", "u_muzzle_brake"} <= m.unstated:
        detail = f"[mechanism] states no muzzle brake: write muzzle_brake and u_muzzle_brake; {follows}"
        yield Assumption("muzzle_brake", NOTHING_OF_CHAIN, detail)
    if not m.tube_axial_hz:
        detail = f"[mechanism] does not state the first mode of the tube along its axis: write tube_axial_hz; {follows}"
        yield Assumption("tube_axial_hz", NOTHING_OF_CHAIN, detail)
    for channel in rig.with_role("breech_pressure"):
        lacks = [f"`{key}`" for key in ("u_linearity_rel", "gauge_ahead") if getattr(channel.sensor, key) is None]
        if lacks:
            detail = (
                f"its sensor has no {' and no '.join(lacks)}: it reads in the breech face and along a line; {follows}"
            )
            yield Assumption(channel.name, NOTHING_OF_CHAIN, detail)


def _assumptions(rig: Rig, absolute: Collection[str]) -> Iterator[Assumption]:
    m = rig.mechanism
    if rig.added_mass_kg and rig.u_added_mass_kg is None:
        detail = f"the shot log has no u_added_mass_kg: {rig.added_mass_kg:g} kg are taken as added"
        yield Assumption("added mass", "taken as exact", detail)
    roles = {channel.role for channel in rig.channels}
    symbols = m.symbols_of(roles)
    for symbol in (one for one in AREAS if one in symbols):
        if symbol not in m.u:
            yield Assumption(symbol, "taken as exact", f"[mechanism] has no u_{symbol}")
    if "friction" not in m.u:
        yield Assumption(
            "friction",
            "taken as exact",
            worded("[mechanism] has no u_friction: ", measured(m.friction, "N", "g"), " is taken"),
        )
    yield from _forces_that_nobody_reads(m, symbols)
    for role in m.carriage_roles:
        if role not in roles:
            detail = "no channel has this role: its term in the equation of motion is taken at rest"
            yield Assumption(role, "not measured", detail)
    yield from _unstated_breech_chain(rig)
    for channel in rig.channels:
        if channel.u_dynamic_rel and channel.sensor.calibration is None:
            detail = (
                'its sensor has no `calibration`: its certificate is taken as "static", at rest, and tells that much '
                'less of a pulse; write "dynamic" if it was found in pulses, or weigh a mass and add it to every '
                "second shot, which tells the gauge's scale"
            )
            yield Assumption(channel.name, f"scale in a pulse known to {100 * STATIC_U_DYNAMIC_REL:g} % only", detail)
    for channel in rig.channels:
        if channel.role in FORCE_SENSOR_ROLES and channel.sensor.u_zero_rel is None:
            detail = "its sensor has no `u_zero_rel`: its zero may move in a shot by as much as a good gauge's does"
            yield Assumption(channel.name, f"zero that may move by {100 * USUAL_U_ZERO_REL:g} % of the range", detail)
        if channel.u_line_s:
            detail = "its sensor has neither `delay_s` nor `u_delay_s`: an orifice or a line may stand before it"
            yield Assumption(channel.name, f"delay of 0 +- {1e3 * USUAL_U_LINE_S:g} ms", detail)
        elif "delay_s" in channel.sensor.model_fields_set and channel.sensor.u_delay_s is None:
            detail = f"its sensor has no `u_delay_s`: {1e3 * channel.sensor.delay_s:g} ms are taken"
            yield Assumption(channel.name, "delay taken as exact", detail)
    of_forces = [one for one in rig.channels if one.role in FORCE_SENSOR_ROLES]
    gauges = [one for one in of_forces if one.sensor.u_scale_rel]
    for channel in (one for one in gauges if len(gauges) > 1 and not one.sensor.reference):
        detail = "its sensor names no `reference`: what a standard behind several gauges is off, no shot can show"
        yield Assumption(channel.name, NO_COMMON_STANDARD, detail)
    for channel in rig.channels:
        own = channel.own_unit
        if channel.name in absolute or (own is not None and own.is_absolute_pressure):
            detail = "forces come from the pressure above the air's: on a mountain state the difference as `offset`"
            yield Assumption(channel.name, ABSOLUTE_PRESSURE, detail)
    camera = rig.by_role("recoil_displacement")
    if camera is not None and camera.sensor.u_distortion_m is None:
        detail = "its sensor has no `u_distortion_m`: its optics may bend the travel by as much as good ones do"
        yield Assumption(
            camera.name, worded("distortion of at most ", measured(1e3 * USUAL_U_DISTORTION_M, "mm", "g")), detail
        )
    for channel in rig.channels:
        if channel.enters_estimate and channel.sensor.calibrated is None:
            detail = "its sensor has no `calibrated`: nothing says when its u_rel was found"
            yield Assumption(channel.name, "no calibration date", detail)
