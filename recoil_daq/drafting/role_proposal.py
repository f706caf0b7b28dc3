"""Roles of the signals of one shot: by their names, their units, and what they do in the shot.

A role is taken where name and shot agree. Where one of them alone speaks, it is a proposal that somebody must confirm;
where they contradict each other, a question. Files that show no shot of a mechanism get no role at all.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from recoil_daq.drafting.recorded_source import RecordedSignal
from recoil_daq.drafting.role_words import GUN_ROLES, LINE_ROLES, STRONG_WORD, quantity_by_name, score
from recoil_processing.swing import (
    DRIVE_S,
    ShotRole,
    Swing,
    is_a_gun_shot,
    is_a_line_shot,
    roles_of_gun,
    roles_of_line,
    same_gauge,
)
from recoil_rigs.mechanism.mechanism_parameters import MechanismModel
from recoil_rigs.tables.rig_tables import FORCE_SENSOR_ROLES

CLEAR_LEAD = 2.0
"""Factor by which the shot must speak for a signal where its name says nothing."""
CLEAR_MARGIN = 2
"""Points by which a name must speak for a role where the shot says nothing."""
LEAST_NAMED = 3
"""Signals with the name of a gun's role by which a shot with one pressure is a gun's."""
_LIKE_ONE = 0.99
"""Correlation of two gauges of one pressure."""
CLEAR_PUSH = 0.3
"""Share of a swing to one side from which on it is a push, not ringing."""
_GRAVITY_M_S2 = 2.0
"""Specific force at rest that shows which way an upright accelerometer is mounted, m/s2."""


@dataclass(frozen=True)
class RoleProposal:
    """A role that a signal may have.

    Attributes
    ----------
    role
        Role that the evidence speaks for; empty where it contradicts itself.
    certain
        Whether name and shot agree on it.
    reason
        Evidence, in words.
    """

    role: str
    certain: bool
    reason: str


@dataclass(frozen=True)
class ProposedRoles:
    """Roles of the signals of one shot.

    Attributes
    ----------
    model
        Model of what moves; None where the files show no shot.
    by_signal
        Proposals by the signals' keys.
    """

    model: MechanismModel | None
    by_signal: Mapping[str, RoleProposal]


def propose_roles(
    signals: Sequence[RecordedSignal], repeats: frozenset[str] = frozenset(), *, complete: bool = True
) -> ProposedRoles:
    """Propose roles for the signals of one shot.

    Parameters
    ----------
    signals
        Signals of all files, those of the reference clock first.
    repeats
        Keys of the signals that repeat another one: they bear no role.
    complete
        Whether all files of the shot are among them; where one is missing, the largest of what is left may be another,
        and a role needs a name.
    """
    own = [one for one in signals if one.quantity and one.swing is not None and one.key not in repeats]
    gauges = _gauges_of_one_pressure(own)
    swings = {one.key: (one.quantity, one.swing) for one in own if one.swing is not None and one.key not in gauges}
    roles: tuple[str, ...] = GUN_ROLES
    # of one pressure alone names must tell that it is a gun's
    named = sum(bool(_by_name(one, GUN_ROLES)[0]) for one in own if one.key in swings)
    if is_a_gun_shot(swings) or (named >= LEAST_NAMED and is_a_gun_shot(swings, least_pressures=1)):
        model, by_shot = MechanismModel.GUN, roles_of_gun(swings)
    elif is_a_line_shot(swings):
        model, by_shot, roles = MechanismModel.LINE, roles_of_line(swings), LINE_ROLES
    else:
        return ProposedRoles(None, {})
    proposals: dict[str, RoleProposal] = {}
    for one in own:
        if one.key in gauges:
            continue
        if complete:
            found = _proposal(one, by_shot.get(one.key), own, roles, by_shot)
        else:
            found = _proposal_of_some(one, by_shot.get(one.key), own, roles)
        if found is not None:
            proposals[one.key] = found
    for key, of in gauges.items():
        if of in proposals and proposals[of].role in FORCE_SENSOR_ROLES:
            proposals[key] = replace(proposals[of], reason=f"swings as {of} does: a gauge of the same pressure")
    for one in own:
        if one.key not in proposals and score(one.name, "trigger", one.quantity) > STRONG_WORD:
            proposals[one.key] = RoleProposal("trigger", True, "by its name; a voltage")
    return ProposedRoles(model, proposals)


def _gauges_of_one_pressure(signals: Sequence[RecordedSignal]) -> dict[str, str]:
    """Return the gauges that swing as another one of their source does, with that one."""
    found: dict[str, str] = {}
    pressures = [one for one in signals if one.quantity == "pressure" and one.swing is not None and one.swing.moves]
    for k, one in enumerate(pressures):
        for other in pressures[:k]:
            if other.key in found or other.source != one.source or not _same(one.swing, other.swing):
                continue
            a, b = one.samples(), other.samples()
            if a.size == b.size and np.corrcoef(np.nan_to_num(a), np.nan_to_num(b))[0, 1] > _LIKE_ONE:
                found[one.key] = other.key
                break
    return found


def _same(one: Swing | None, other: Swing | None) -> bool:
    return one is not None and other is not None and same_gauge(one, other)


def _proposal(
    signal: RecordedSignal,
    by_shot: ShotRole | None,
    signals: Sequence[RecordedSignal],
    roles: Sequence[str],
    all_by_shot: Mapping[str, ShotRole],
) -> RoleProposal | None:
    """Weigh a signal's name against what it does; None where neither speaks."""
    named, margin = _by_name(signal, roles)
    if by_shot is not None and named == by_shot.role:
        return RoleProposal(named, True, f"by its name, and {by_shot.reason}{_factor(by_shot)}")
    if by_shot is not None and named:
        return RoleProposal("", False, f"{named} by its name, {by_shot.role} by the shot: {by_shot.reason}")
    if by_shot is not None and by_shot.lead >= CLEAR_LEAD and _shares_name(signal, by_shot.role, roles):
        return RoleProposal(by_shot.role, True, f"its part by its name, and {by_shot.reason}{_factor(by_shot)}")
    if by_shot is not None:
        better = _better_named(by_shot.role, signals, roles)
        if better is not None:
            return RoleProposal("", False, f"{by_shot.reason}, but {better.name} has the name of a {by_shot.role}")
        offered = by_shot.role if by_shot.lead >= CLEAR_LEAD else ""
        what = "" if offered else f"{by_shot.role} or its neighbour's: "
        says = "the quantity alone" if quantity_by_name(signal.name) == signal.quantity else "nothing"
        return RoleProposal(offered, False, f"{what}{by_shot.reason}{_factor(by_shot)}; its name says {says}")
    taken = any(one.role == named for one in all_by_shot.values()) and named not in FORCE_SENSOR_ROLES
    moves = signal.swing is not None and signal.swing.moves
    if named and margin >= CLEAR_MARGIN and moves and not taken:
        return RoleProposal(named, False, "by its name alone")
    return None


def _proposal_of_some(
    signal: RecordedSignal, by_shot: ShotRole | None, signals: Sequence[RecordedSignal], roles: Sequence[str]
) -> RoleProposal | None:
    """Weigh a signal where a file of the shot is missing: what it does beside the others tells nothing alone."""
    named, _ = _by_name(signal, roles)
    if by_shot is None or named == by_shot.role:
        return _proposal(signal, by_shot, signals, roles, {})
    if named:
        return RoleProposal(named, False, "by its name alone: not all files of the shot are here")
    return RoleProposal("", False, "its name says nothing, and not all files of the shot are here")


def _by_name(signal: RecordedSignal, roles: Sequence[str]) -> tuple[str, int]:
    """Return the role that a name speaks for most, and by how much; empty if it names no part."""
    points = sorted(((score(signal.name, role, signal.quantity), role) for role in roles), reverse=True)
    best, role = points[0]
    margin = best - (points[1][0] if len(points) > 1 else 0)
    return (role, margin) if best > STRONG_WORD and margin > 0 else ("", 0)


def _shares_name(signal: RecordedSignal, role: str, roles: Sequence[str]) -> bool:
    """Whether a name speaks for a role as much as for another one of the same part, and for none more."""
    points = [score(signal.name, one, signal.quantity) for one in roles]
    return max(points) == score(signal.name, role, signal.quantity) > STRONG_WORD


def _better_named(role: str, signals: Sequence[RecordedSignal], roles: Sequence[str]) -> RecordedSignal | None:
    """Return the signal that moves and whose name is that of a role; None if there is none."""
    moving = (one for one in signals if one.swing is not None and one.swing.moves)
    return next((one for one in moving if _by_name(one, roles)[0] == role), None)


def _factor(found: ShotRole) -> str:
    return f", by a factor of {found.lead:.3g}" if math.isfinite(found.lead) and found.lead < 1e3 else ""


@dataclass(frozen=True)
class ProposedPolarity:
    """A polarity that a sensor may have.

    Attributes
    ----------
    value
        1 or -1; None where the shot does not tell.
    certain
        Whether the mechanics leave no other way; else it is to be confirmed.
    reason
        Evidence, in words; or why there is none.
    """

    value: int | None
    certain: bool
    reason: str


def polarity_of(role: str, swing: Swing, model: MechanismModel, d_m: float | None = None) -> ProposedPolarity:
    """Return the polarity that a sensor has by what the blow does to its body.

    Parameters
    ----------
    d_m
        Symbol d of the mechanism, m, of whose sign the breech force turns the tipping part; None if it is not known.
    """
    peak, to_one_side = int(np.sign(swing.peak)), abs(swing.push) >= CLEAR_PUSH
    side = int(np.sign(swing.push))
    share = f"net {abs(100 * swing.push):.0f} % of its swing in the first {1e3 * DRIVE_S:.0f} ms"
    if role.endswith("_pressure"):
        return ProposedPolarity(peak, True, "a pressure rises")
    if role == "resisting_force":
        return ProposedPolarity(peak, True, "its largest swing resists")
    if model is MechanismModel.LINE:
        return ProposedPolarity(swing.first or 1, True, "its first swing counts as along the drive")
    if role in ("recoil_displacement", "recoil_velocity"):
        return ProposedPolarity(peak, True, "its largest swing is rearward")
    if role == "carriage_acceleration_y":
        if abs(swing.base) > _GRAVITY_M_S2:
            return ProposedPolarity(int(np.sign(swing.base)), True, "it feels gravity upward at rest")
        return ProposedPolarity(None, False, f"it feels {swing.base:.2g} m/s2 at rest, not gravity")
    if not to_one_side:
        return ProposedPolarity(None, False, f"the shot does not tell: {share} is to one side")
    if role == "recoil_acceleration":
        return ProposedPolarity(side, True, f"the blow is rearward: {share}")
    if role == "carriage_acceleration_x":
        return ProposedPolarity(-side, True, f"the carriage is pushed rearward: {share}")
    if role == "carriage_rate":
        # the recoil force passes above the ground on which the carriage stands, so its front rises
        return ProposedPolarity(side, True, f"the carriage's front rises: {share}")
    if role == "tipping_rate":
        if d_m:
            rises = side if d_m > 0 else -side
            return ProposedPolarity(rises, True, f"the breech force turns it, d = {d_m:g} m: {share}")
        reason = f"if the muzzle rises first, as it does where d is above 0: {share}"
        return ProposedPolarity(side, False, reason)
    return ProposedPolarity(None, False, "the shot does not tell")
