"""Combination of many shots of a rig: their joint fit, what it sets aside, and what speaks against its mass."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.numerics.normal_distribution import CRITICAL_VALUE
from recoil_acquisition.remark import Note, NoteCode, Reason, ReasonCode
from recoil_identification.calibration.suspicion import AS_WELL, LITTLE, UNSTATED
from recoil_identification.campaign.agreement import agreement_of, weighed
from recoil_identification.campaign.campaign import (
    Campaign,
    Estimated,
    Learnt,
    Mechanism,
    UnreadForce,
    Used,
    known_to,
    specifications,
)
from recoil_identification.campaign.campaign_shot import CampaignShot, doubted_signs, in_order
from recoil_identification.campaign.changes import (
    ADDED,
    OFF,
    STEP,
    Change,
    joint_fit_with_changes,
    normalised_residuals,
)
from recoil_identification.campaign.charted import charted_peaks, charted_residuals, charted_sensors
from recoil_identification.campaign.constancy import changing_alone, shared_constancy
from recoil_identification.campaign.gauge_scales import gauge_scales
from recoil_identification.campaign.influence import Influence
from recoil_identification.campaign.joint_fit import JointFit, by_the_weight, joint_fit
from recoil_identification.campaign.joint_rows import JointRows
from recoil_identification.campaign.mechanisms import mechanisms_of
from recoil_identification.campaign.peaks import apart_percent, peaks_of_shots
from recoil_identification.campaign.suspects import SharedSuspicion, shared_suspicion
from recoil_identification.campaign.suspicion import CERTIFIED, WRITTEN, Suspicion
from recoil_identification.estimate.budget import BudgetRow
from recoil_identification.estimate.rounding import in_kg
from recoil_identification.rows.unread_resistance import SHARE
from recoil_identification.shot.shot_summary import LN_MASS
from recoil_processing.shot.error_source import SourceKind
from recoil_processing.shot.regression import PRESSURE_ROLES
from recoil_processing.shot.sensor_scales import BORE_FRICTION

LEAST_SHOTS = 2
CERTIFICATES = (SourceKind.SENSOR_SCALE, SourceKind.SENSOR_DYNAMIC, SourceKind.STANDARD)
LEAST_MOVED_U = 0.5
"""By how much of its u what is contradicted has to move the mass to speak against it: of an interval that lies half a u
beside its mass 92 % hold the truth, of one that lies on it 95 %."""


def combine(shots: Sequence[CampaignShot]) -> Campaign:
    """Estimate the mass of a campaign's mechanism from all its shots.

    Parameters
    ----------
    shots
        Shots in any order, of one rig, their rows filtered alike.

    Raises
    ------
    IdentificationError
        If there are fewer than two shots that can be used, two of one name, or shots of several rigs, geometries or
        cut-offs.
    """
    ordered = in_order(shots)
    aside = {shot.name: shot.set_aside for shot in ordered if shot.set_aside}
    used = _usable(ordered, aside)
    rows = JointRows.of(used, mechanisms_of(used, ordered))
    base, first = _beside_what_nobody_stated(rows)
    fit, changes = joint_fit_with_changes(base, first)
    # what a shot alone calls a mass that changes may be a force that all share; what is not left in the joint fit is
    while alone := _changing_alone(fit):
        aside |= alone
        used = _usable(ordered, aside)
        rows = JointRows.of(used, mechanisms_of(used, ordered))
        base, first = _beside_what_nobody_stated(rows)
        fit, changes = joint_fit_with_changes(base, first)
    agreement = agreement_of(fit)
    if (lighter := weighed(fit.rows, agreement)) is not fit.rows:
        base = replace(lighter, columns=base.columns)
        fit, changes = joint_fit_with_changes(base)
    constancy, added = shared_constancy(fit), _added(fit)
    with_all, fit = fit, by_the_weight(fit, joint_fit)
    plain = fit
    if base.columns:
        plain = joint_fit(fit.rows.with_columns([one for one in fit.rows.columns if one not in base.columns]))
    suspicion = shared_suspicion(plain)
    rows = fit.rows
    common = tuple(
        Learnt(
            one,
            with_all.value(one.identity) * one.u,
            with_all.u(one.identity) * one.u,
            with_all.likeliest.estimate.normalised_residual(one.identity),
            fit.moves_kg(rows.mechanisms[0], one.identity),
        )
        for one in rows.influences
        if not one.is_shape
    )
    gauges, in_campaign = gauge_scales(fit), _used(ordered, fit, aside)
    residuals = {one.shot.name: one.normalised_residual for one in in_campaign if one.normalised_residual is not None}
    mechanisms = _mechanisms(plain, suspicion)
    idle = without_consequence(common, mechanisms[0].mass)
    reasons = [
        *doubted_signs(used),
        *_reasons_of(changes, rows),
        *(() if constancy is None else constancy.reasons),
        *contradictions([one for one in common if one not in idle], added),
        *agreement.reasons,
    ]
    told = [] if suspicion is None or not base.columns else [suspicion]
    by_much = [
        one for one in told if one.spread_rel * plain.mass_kg(rows.mechanisms[0])[0] > LITTLE * mechanisms[0].mass.u_kg
    ]
    reasons = [*(Reason(ReasonCode.BREECH_CHAIN, one.source, str(one).rstrip(".")) for one in by_much), *reasons]
    peaks = peaks_of_shots(used)
    return Campaign(
        rig=ordered[0].rig,
        shots=in_campaign,
        mechanisms=mechanisms,
        common=common,
        gauges=gauges,
        unread_force=_unread_force(fit),
        constancy=constancy,
        agreement=agreement,
        gain_scatter=fit.scatter("gain_rel"),
        friction_scatter=fit.scatter("friction_rel"),
        changes=changes,
        charts=(
            *charted_residuals(list(residuals), list(residuals.values())),
            *charted_peaks(apart_percent(peaks, [shot.name for shot in used])),
            *charted_sensors((shot.name, shot.baseline) for shot in ordered),
        ),
        peaks=peaks,
        cutoff_hz=used[0].cutoff_hz,
        reasons=tuple(reasons),
        notes=(
            *_notes(used, rows),
            *(Note(NoteCode.NEAR_LIMIT, one.source, f"{one}; its interval holds that") for one in told if not by_much),
            *([] if fit is with_all else [_note_on_weight(with_all, fit)]),
            *(_note_on_idle(one, mechanisms[0].mass) for one in idle),
            *(one.note() for one in gauges if one.is_told),
            *agreement.notes,
            *_notes_on_specification(mechanisms[0], in_campaign),
        ),
        fit=fit,
        plain=plain,
        suspicion=suspicion,
    )


def refuse_too_few(shots: int, found: str) -> None:
    """Raise an IdentificationError if so many shots are none that can be combined; `found` says what they are."""
    if shots < LEAST_SHOTS:
        raise IdentificationError(
            "a campaign needs at least two shots that can be used",
            expected=f"{LEAST_SHOTS} or more",
            found=found,
            remedy="add shots, or take the single shot's report",
        )


def _changing_alone(fit: JointFit) -> dict[str, str]:
    """Return the shot in which the mass changes most surely otherwise than in the others, and what is said of it.

    It must be told by its own report, too: a campaign looks at many.
    """
    told = {shot.name for shot in fit.rows.shots if shot.changes}
    found = {name: factor for name, factor in changing_alone(fit).items() if name in told} if told else {}
    if not found:
        return {}
    name = max(found, key=lambda one: found[one])
    said = f"its mass changes within the shot, or what its gauges read (ln of the Bayes factor {found[name]:+.1f})"
    return {name: f"{said}, otherwise than in the others: see its report"}


def _usable(ordered: Sequence[CampaignShot], aside: Mapping[str, str]) -> list[CampaignShot]:
    """Return the shots that are not set aside.

    Raises
    ------
    IdentificationError
        As of `combine`.
    """
    used = [shot for shot in ordered if shot.name not in aside]
    names = [shot.name for shot in ordered]
    for shot in ordered:
        if names.count(shot.name) > 1:
            raise IdentificationError(
                "two reports of one shot", found=f"shot {shot.name} twice", remedy="leave one of them out"
            )
    if len({shot.rig for shot in ordered}) > 1:
        rigs = {shot.rig: shot.name for shot in reversed(ordered)}
        raise IdentificationError(
            "a campaign is of one rig",
            expected="shots of one rig",
            found=", ".join(f"{rig} (shot {name} first)" for rig, name in sorted(rigs.items())),
            remedy="combine the shots of each rig by themselves",
        )
    told = "; ".join(f"{name}: {why}" for name, why in aside.items())
    refuse_too_few(len(used), f"{len(used)} of {len(ordered)}" + (f" ({told})" if told else ""))
    first = used[0]
    # by symbol the first shot that states it: what a shot does not state is not compared
    stated: dict[str, CampaignShot] = {}
    for shot in used:
        for key in shot.geometry:
            stated.setdefault(key, shot)
        if different := [key for key, value in shot.geometry.items() if stated[key].geometry[key] != value]:
            raise IdentificationError(
                "a campaign is of one geometry",
                expected=f"that of shot {stated[different[0]].name}",
                found=f"shot {shot.name} with "
                + ", ".join(f"{key} {stated[key].geometry[key]} and {shot.geometry[key]}" for key in different),
                remedy="identify all shots with one rig file (identify --rig), or combine them by themselves",
            )
        if shot.cutoff_hz != first.cutoff_hz:
            raise IdentificationError(
                "the shots of a campaign are filtered alike",
                expected=f"the cut-off of shot {first.name}, {first.cutoff_hz} Hz",
                found=f"{shot.cutoff_hz} Hz of shot {shot.name}",
                remedy="identify all shots with one --cutoff-hz",
            )
    return used


def _unread_force(fit: JointFit) -> UnreadForce | None:
    shapes = [one.identity for one in fit.rows.influences if one.is_shape]
    stated = [shot.geometry["unread_force"] for shot in fit.rows.shots if "unread_force" in shot.geometry]
    if not shapes or not stated:
        return None
    sizes = fit.forces
    return UnreadForce(
        shapes[0].rpartition(" ")[0], stated[0], tuple(stated[0] * size for size in sizes), tuple(sizes.values())
    )


def _used(ordered: Sequence[CampaignShot], fit: JointFit, aside: Mapping[str, str]) -> tuple[Used, ...]:
    white, at = fit.rows.whitened(fit.likeliest.scatter), fit.rows.parameters.index(LN_MASS)
    values = fit.likeliest.values
    masses_kg = np.exp(fit.rows.modelled(values)[0][:, at])
    column = white.triangle[:, :, at]
    information = np.einsum("nk,nk->n", column, column)
    own_u_kg = masses_kg / np.sqrt(information)
    own_kg = masses_kg * (1.0 + np.einsum("nk,nk->n", column, white.by_shot(values)[0]) / information)
    columns = (own_kg, own_u_kg, masses_kg, normalised_residuals(fit))
    found = {
        shot.name: Used(shot, None, *numbers)
        for shot, *numbers in zip(fit.rows.shots, *(one.tolist() for one in columns), strict=True)
    }
    return tuple(found.get(shot.name) or Used(shot, aside[shot.name]) for shot in ordered)


def _mechanisms(fit: JointFit, suspicion: SharedSuspicion | None) -> tuple[Mechanism, ...]:
    """Return the mass of each mechanism, the mean over what nobody stated."""
    rows = fit.rows
    return tuple(
        Mechanism(
            name,
            tuple(shot.name for shot, of in zip(rows.shots, rows.mechanism.tolist(), strict=True) if of == number),
            _averaged(fit, name, None if suspicion is None else suspicion.moved(number)),
            None if number == 0 else Estimated(*fit.difference_kg(name, rows.mechanisms[0])),
        )
        for number, name in enumerate(rows.mechanisms)
    )


def _averaged(fit: JointFit, mechanism: str, moved: tuple[float, float] | None) -> Estimated:
    budget = fit.budget(mechanism)
    mass_kg, u_kg = fit.mass_kg(mechanism)
    mean_rel, variance_rel = (0.0, 0.0) if moved is None else moved
    unstated = BudgetRow(UNSTATED, mass_kg * math.sqrt(variance_rel), "B", scope="rig")
    freedom = known_to([*budget, unstated])
    return Estimated(mass_kg * (1.0 + mean_rel), math.hypot(u_kg, unstated.u_kg), freedom)


def _beside_what_nobody_stated(rows: JointRows) -> tuple[JointRows, JointFit]:
    """Give the rows an unknown for the shape that no rig states and the shots show, if they do, and fit them.

    Sensors that contradict the others, and what changed among the shots, are then what is left beside it. Where a mass
    that changes in every shot alike explains them far better, that is said.
    """
    fit = joint_fit(rows)
    suspicion, constancy = shared_suspicion(fit), shared_constancy(fit)
    if suspicion is None or not suspicion.suspected:
        return rows, fit
    if constancy is not None and constancy.ln_bayes_factor > suspicion.ln_bayes_factor + AS_WELL:
        return rows, fit
    beside = rows.with_columns([suspicion.column(len(rows.shots))])
    return beside, joint_fit(beside)


ONE_MASS = (
    "one mass does not describe all shots; if a part was exchanged, state it in the shot log's column configuration"
)
REMEDIES = {
    STEP: (ReasonCode.MASS_STEP, ONE_MASS),
    ADDED: (ReasonCode.ADDED_MASS, "check the shot log"),
    OFF: (
        ReasonCode.CALIBRATION,
        "check its certificate, its gain, and whether a force that no gauge reads goes with it",
    ),
}
"""Kinds of change that speak against the mass, with the codes of their reasons and what to do."""


def _reasons_of(changes: Sequence[Change], rows: JointRows) -> list[Reason]:
    """Say why no one mass describes shots among which it changed, or of which the shot log is wrong."""
    found = []
    for change in sorted((one for one in changes if one.kind in REMEDIES), key=lambda one: one.kind is not STEP):
        code, remedy = REMEDIES[change.kind]
        # a weight that is written wrong looks the same
        weighed = f", and what {', '.join(rows.weighed)} really weigh" if change.kind is OFF and rows.weighed else ""
        found.append(Reason(code, change.influence, f"{change}: {remedy}{weighed}"))
    return found


def without_consequence(common: Sequence[Learnt], mass: Estimated) -> list[Learnt]:
    """List what was known beforehand that the shots contradict, but that the mass does not hang on.

    A shape that no column has, a force's or a clock's, looks like an error of whatever moves the rows a little like it,
    however little that is. A certificate that is contradicted is no such thing, whatever it moves, nor is what drives
    and what looks like less of it.

    Parameters
    ----------
    common
        Influences that the shots share.
    mass
        The mass; if what is contradicted were forgotten together, it would stay within `LEAST_MOVED_U` of its u.
    """
    beyond = [
        one
        for one in common
        if abs(one.judged_residual) > CRITICAL_VALUE
        and not (_drives(one.influence) or one.influence.source.kind in CERTIFICATES)
    ]
    moved_kg = math.fsum(abs(one.moves_kg) for one in beyond)
    return beyond if moved_kg <= LEAST_MOVED_U * mass.u_kg else []


def _note_on_idle(one: Learnt, mass: Estimated) -> Note:
    text = (
        f"{one.influence.source} contradicts the other sensors: it is off by {_off(one, ())} if they are right "
        f"(normalised residual {abs(one.judged_residual):.1f}, limit {CRITICAL_VALUE:g}). The mass does not hang "
        f"on it: without what is known of it it is {mass.mass_kg + one.moves_kg:.1f} kg"
    )
    return Note(NoteCode.NEAR_LIMIT, one.influence.source, text)


def contradictions(common: Sequence[Learnt], added: Sequence[Learnt] = ()) -> list[Reason]:
    """Name what was known beforehand that the shots together contradict.

    More of the driving force and less of the resistance are nearly one, to many shots as to one, and so is another
    weight: of these that is named first which agrees least, a weight only if by what was stated of each none of the
    others is likelier.

    Parameters
    ----------
    common
        Influences that the shots share.
    added
        Masses that were added, whose uncertainty is not zero.
    """
    driving = [*(one for one in common if _drives(one.influence)), *added]
    beyond = [one for one in (*common, *added) if abs(one.judged_residual) > CRITICAL_VALUE]
    beyond.sort(key=lambda one: -abs(one.judged_residual))
    named = [one for one in beyond if one in driving]
    residual = abs(named[0].judged_residual) if named else 0.0
    if any(one in added for one in named):
        first = max(driving, key=lambda one: _suspicion(one).log_odds)
        if first not in added:
            others = [one for one in driving if one not in added]
            first = max(others, key=lambda one: (round(abs(one.judged_residual), 1), one.influence.is_sensor))
        named = [first, *(one for one in named if one is not first)]
    if named:
        beyond = [named[0], *(one for one in beyond if one not in named)]
    found = []
    for one in beyond:
        others = [other for other in driving if other is not one] if one in driving else []
        contradicted = "the sensors" if one in added else "the other sensors"
        never = one.influence.source.is_late_alone and one.value < 0
        early = ", early, which no line and no orifice makes it" if never else ""
        told = f"{one.influence.source} contradicts {contradicted}: it is off by {_off(one, added)} if they are right"
        w = residual if one in driving else abs(one.judged_residual)
        told += f"{early} (normalised residual {w:.1f}, limit {CRITICAL_VALUE:g})"
        told += "".join(
            f", or {other.influence.source} is, by {_off(other, added, 'its own')}"
            for other in others
            if other not in added or other in named
        )
        told += "" if one in added else f"; without what is known of it the mass changes by {one.moves_kg:+.1f} kg"
        code = ReasonCode.ADDED_MASS if one in added else ReasonCode.SENSOR
        found.append(Reason(code, one.influence.source, told))
    return found


def _off(one: Learnt, added: Sequence[Learnt], of: str = "its standard uncertainties") -> str:
    """Say by how much something is off as if nothing had been stated of it: a weight in kg."""
    if one in added:
        return f"{_suspicion(one).size:+.1f} kg, where {one.influence.u:g} kg is stated"
    scale, unit = (100.0, "%") if one.influence.unit == "1" else (1.0, one.influence.unit)
    return f"{one.alone:+.1f} of {of} ({scale * one.alone * one.influence.u:+.2g} {unit})"


def _suspicion(one: Learnt) -> Suspicion:
    freedom = WRITTEN if one.influence.source.kind is SourceKind.ADDED_MASS else CERTIFIED
    return Suspicion.of_prior(one.value, one.u, one.influence.u, one.normalised_residual, freedom)


def _added(fit: JointFit) -> list[Learnt]:
    """Return what the shots tell of each mass that was added and is not exactly known."""
    return [
        Learnt(
            Influence(source, source, u_kg, "kg"),
            fit.value(source) * u_kg,
            fit.u(source) * u_kg,
            fit.likeliest.estimate.normalised_residual(source),
        )
        for source, (_, u_kg) in zip(fit.rows.added, fit.rows.weights, strict=True)
        if u_kg > 0
    ]


def _drives(influence: Influence) -> bool:
    """Return whether an influence is of the driving force, or of resistance that looks like less of it."""
    source = influence.source
    of_breech = source.kind in CERTIFICATES and source.of == PRESSURE_ROLES[0]
    return of_breech or source in (SHARE, BORE_FRICTION)


def _notes(used: Sequence[CampaignShot], rows: JointRows) -> list[Note]:
    notes = []
    if all(shot.added_mass_kg > 0 for shot in used):
        text = "every shot carries an added mass: the mass is what is left of it, nothing was fired without"
        notes.append(Note(NoteCode.ADDED_MASS, None, text))
    if len(rows.mechanisms) > 1:
        text = (
            f"the configurations {', '.join(rows.mechanisms)} were fired with the same mass added, so that their names "
            "can only mean other parts: each has a mass of its own, and the campaign's mass is that of the first"
        )
        notes.append(Note(NoteCode.CONFIGURATION, None, text))
    notes += [
        Note(
            NoteCode.ADDED_MASS,
            None,
            f"the added mass of {mass_kg:g} kg is taken as exact: the shot log has no u_added_mass_kg",
        )
        for mass_kg, u in rows.weights
        if u == 0
    ]
    return notes


def _note_on_weight(with_all: JointFit, fit: JointFit) -> Note:
    """Say that the mass is by the weight, and what it would be otherwise."""
    name = fit.rows.mechanisms[0]
    (mass_kg, u_kg), forgotten = with_all.mass_kg(name), fit.rows.forgotten
    gauges = ", ".join(one.source for one in fit.rows.influences if one.identity in forgotten)
    text = (
        f"the mass is by the weight of {', '.join(fit.rows.weighed)}: what was stated of {gauges} is not used; with it "
        f"the mass is {in_kg(mass_kg, u_kg)}"
    )
    return Note(NoteCode.ADDED_MASS, None, text)


def _notes_on_specification(mechanism: Mechanism, shots: Sequence[Used]) -> list[Note]:
    stated = specifications(mechanism, shots)
    several = sorted({one.mass_kg for one in stated})
    if not stated:
        text = "the shots' reports do not all state the specification: the mass is compared with none"
        return [Note(NoteCode.SPECIFICATION, None, text)]
    if len(several) == 1:
        return []
    masses = ", ".join(f"{kg:g} kg" for kg in several)
    text = f"the shots' rigs state several specification masses, {masses}: the mass is compared with none"
    return [Note(NoteCode.SPECIFICATION, None, text)]
