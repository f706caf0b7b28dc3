"""The uncertainty that a campaign's mass will have, before the first shot is fired.

What a shot will tell of the mass and of what shots share does not hang on how its errors will fall: the triangle of a
nominal shot's summary is that of every shot like it. A campaign's uncertainty follows from as many of them, and from
what the certificates say, by the joint fit itself; with other certificates, from the same triangles.

A part of mass M that carries a known mass d more is driven by the same forces with ``s = M / (M + d)`` times the
acceleration, and every row's derivative by the logarithms of mass and scales, by the friction and by the impulse at
the release is s times as large, in the rows of the camera too. What the shot alone knows, its zero and its clocks,
is taken out by a projection that s does not turn, so that of the triangle R the heavier part's is ``R diag(s)``, with 1
in place of s for what does not hang on the motion: lengths that a camera's optics bend, and the share of the travel
that is the carriage's. The brake in fact answers to the velocity; a nominal shot of that mass says it better.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from recoil_identification.campaign.advice import Advised, weighed_to_kg, worked_out
from recoil_identification.campaign.campaign_shot import CampaignShot
from recoil_identification.campaign.changes import DRIFT, STEP, Candidate, candidates_of, least_gain
from recoil_identification.campaign.joint_fit import JointFit, by_the_weight, joint_fit_under
from recoil_identification.campaign.joint_rows import JointRows, Scatter
from recoil_identification.campaign.mechanisms import UNNAMED
from recoil_identification.campaign.suspects import averaged_u_rel
from recoil_identification.rows.camera_rows import OTHER
from recoil_identification.rows.causes import DISTORTIONS
from recoil_identification.shot.shared_identity import OF_SENSOR
from recoil_identification.shot.shot_summary import (
    UNREAD_FORCE,
    Parameter,
    ShotSummary,
    certified_influences,
)
from recoil_processing.shot.error_source import SourceKind
from recoil_rigs.rig import Rig
from recoil_rigs.shots.stated_uncertainty import (
    SCALED_ROLES,
    stated_uncertainties,
    with_dynamic_certificate,
    with_uncertainties,
)

SUPPOSED = Scatter(gain_rel=1.5e-4, friction_rel=0.015)
"""Scatter from shot to shot that eight shots leave possible where nothing scatters, the mean of what they say of it."""
OTHER_SCATTERS_REL = (5e-4, 1e-3)
"""Scatters by which good gauges and usual ones do not repeat, relative."""
OTHER_SHOTS = (4, 8, 16, 32)
ADDED_SHARES = (0.1, 0.2, 0.4)
"""Shares of the mass that may be added."""
GOOD_BREECH_REL = 1e-3
"""Relative uncertainty to which a breech gauge can be calibrated."""
OTHER_PARTS = "other parts"
"""A configuration that differs by an unknown mass."""
UNREAD = "unread_force"
"""Key, and symbol, of the force that no gauge reads."""
UNREAD_KEYS = ("u_unread_share", UNREAD)
"""Keys of the resistance that no gauge reads, which a rig can state as none."""
OF_NO_SHOT = ("u_carried_mass",)
"""Keys of what moves no shot's mass: it is in the comparison with the specification alone."""
SHAPES = {
    SourceKind.LINEARITY: "{} with a line that a calibration found straight: u_linearity_rel = 0",
    SourceKind.GAUGE_AHEAD: "{} that reads what drives the part: gauge_ahead with u_share = 0",
}
"""Changes by which a breech gauge is known to have no such shape."""
LEAST_SHOTS = 4
"""Number of shots of which half can differ from the other half."""


@dataclass(frozen=True, eq=False)
class NominalShot:
    """A shot as it will be.

    Attributes
    ----------
    mass_kg
        Mass without what is added.
    added_mass_kg
        Weighed.
    summary
        Summary of the shot; nothing is off.
    charge
        Factor of the usual one's peak breech pressure.
    """

    mass_kg: float
    added_mass_kg: float
    summary: ShotSummary
    charge: float = 1.0

    @classmethod
    def of(cls, mass_kg: float, added_mass_kg: float, summary: ShotSummary, charge: float = 1.0) -> NominalShot:
        """Keep of a shot's summary what it tells, and nothing of how its errors fell."""
        reference = np.zeros(len(summary.parameters))
        reference[0] = math.log(mass_kg + added_mass_kg)
        nothing = np.zeros_like(summary.seen)
        return cls(mass_kg, added_mass_kg, replace(summary, reference=reference, seen=nothing, against=()), charge)

    def known_by(self, rig: Rig) -> NominalShot:
        """Take what a rig's certificates say of what its shots share."""
        certified = certified_influences(rig)
        stated = self.summary.geometry.get(UNREAD, 0.0)
        # the shapes of the force that no gauge reads are counted in what the shot's own rig states of it
        force = rig.mechanism.unread_force / stated if stated else 1.0

        def of(one: Parameter) -> Parameter:
            if one.name.startswith(f"{UNREAD_FORCE} "):
                return replace(one, influences=tuple((name, force) for name, _ in one.influences))
            return replace(one, influences=certified.get(one.name, one.influences))

        return replace(self, summary=replace(self.summary, parameters=tuple(map(of, self.summary.parameters))))

    def knowing(self, kind: SourceKind) -> NominalShot:
        """Return the shot of a rig that states a shape which it may else be asked for, and is asked for it no more."""
        kept = (
            replace(one, suspected=None) if one.suspected and one.suspected.source.kind is kind else one
            for one in self.summary.parameters
        )
        return replace(self, summary=replace(self.summary, parameters=tuple(kept)))

    def carrying(self, added_mass_kg: float) -> NominalShot:
        """Return the shot with another mass added, driven by the same forces."""
        s = (self.mass_kg + self.added_mass_kg) / (self.mass_kg + added_mass_kg)
        unmoved = (*DISTORTIONS, OTHER.name)
        turned = np.array([1.0 if one.name in unmoved else s for one in self.summary.parameters])
        summary = replace(self.summary, triangle=self.summary.triangle * turned)
        return NominalShot.of(self.mass_kg, added_mass_kg, summary, self.charge)


@dataclass(frozen=True)
class Plan:
    """A campaign that is to be fired.

    Attributes
    ----------
    added_mass_kg, u_added_mass_kg
        Mass, and its standard uncertainty, that every second shot carries in addition, from the second on; 0 for
        nothing.
    scatter
        Scatter by which gains and friction do not repeat.
    charges
        One shot after the other, and from the first again.
    """

    shots: int
    added_mass_kg: float = 0.0
    u_added_mass_kg: float = 0.0
    scatter: Scatter = SUPPOSED
    charges: tuple[float, ...] = (1.0,)


@dataclass(frozen=True)
class WhatIf:
    """Relative standard uncertainties of a shot's and of the campaign's mass after one change."""

    change: str
    u_rel_shot: float
    u_rel_campaign: float


@dataclass(frozen=True)
class Found:
    """The smallest changes among the shots that half of such campaigns find.

    Attributes
    ----------
    mass_step_kg
        Step of the mass from one half of the shots to the other; None if there are too few.
    drifts
        Label of a sensor, and the share by which its gain drifts from the first shot to the last.
    u_difference_kg
        Standard uncertainty of the difference of two mechanisms that half of the shots are of, each, nothing added to
        either; None likewise.
    """

    mass_step_kg: float | None
    drifts: tuple[tuple[str, float], ...]
    u_difference_kg: float | None


def predicted_fit(nominal: Sequence[NominalShot], plan: Plan, *, halves: bool = False) -> JointFit:
    """Fit the shots of a plan as if nothing in them were off.

    Parameters
    ----------
    nominal
        Nominal shots, at least one; a shot of the plan is like the one whose charge, and then whose added mass, is
        nearest to its own.
    halves
        Whether the second half of the shots has other parts.
    """
    shots, used = [], dict[tuple[float, float], NominalShot]()
    for number in range(plan.shots):
        added_kg, charge = plan.added_mass_kg if number % 2 else 0.0, plan.charges[number % len(plan.charges)]
        if (charge, added_kg) not in used:
            used[charge, added_kg] = _nearest(nominal, charge, added_kg)
        one = used[charge, added_kg]
        shots.append(
            CampaignShot(
                name=f"{number + 1:04d}",
                rig="",
                started=None,
                mass_kg=one.mass_kg + added_kg,
                u_kg=0.0,
                summary=one.summary,
                configuration=OTHER_PARTS if halves and number >= plan.shots // 2 else UNNAMED,
                added_mass_kg=added_kg,
                u_added_mass_kg=plan.u_added_mass_kg if added_kg else 0.0,
            )
        )
    rows = JointRows.of(shots, {name: name for name in (UNNAMED, OTHER_PARTS)})

    def fit(of: JointRows) -> JointFit:
        return joint_fit_under(of, plan.scatter).before_any_shot

    return by_the_weight(fit(rows), fit)


def alone(plan: Plan) -> Plan:
    """Return the plan of one shot of a plan, with nothing added."""
    return replace(plan, shots=1, added_mass_kg=0.0)


def predicted_u_rel(nominal: Sequence[NominalShot], plan: Plan) -> float:
    """Return the relative standard uncertainty of the mass without what is added."""
    return averaged_u_rel(predicted_fit(nominal, plan))


def found_by(nominal: Sequence[NominalShot], plan: Plan) -> Found:
    """Say which changes among its shots a campaign would find.

    A column of size c, of standard uncertainty u, raises the log likelihood by a number whose median is c^2 / 2 u^2
    (`recoil_identification.campaign.changes`), where gains repeat as the plan says.
    """
    if plan.shots < LEAST_SHOTS:
        return Found(None, (), None)
    fit = predicted_fit(nominal, plan)
    candidates = candidates_of(fit)
    least = math.sqrt(2.0 * least_gain(len(candidates)))

    def smallest(one: Candidate) -> float:
        with_it = joint_fit_under(fit.rows.with_columns([one.column]), plan.scatter).before_any_shot
        return least * with_it.u(one.column.name)

    middle = fit.rows.shots[plan.shots // 2].name
    steps = [smallest(one) for one in candidates if one.kind == STEP and one.shots[0] == middle]
    drifts = sorted((smallest(one), one.influence) for one in candidates if one.kind == DRIFT)
    apart = predicted_fit(nominal, replace(plan, added_mass_kg=0.0), halves=True)
    return Found(
        mass_step_kg=steps[0] * fit.rows.reference_kg if steps else None,
        drifts=tuple((label, size) for size, label in drifts),
        u_difference_kg=apart.difference_kg(OTHER_PARTS, UNNAMED)[1],
    )


def what_ifs(nominal: Sequence[NominalShot], rig: Rig, plan: Plan) -> Advised[WhatIf]:
    """List what could be done instead, what helps the campaign most first.

    Parameters
    ----------
    nominal
        Nominal shots, at least one, whose influences are those of `rig`.
    """
    changed: dict[str, Callable[[], tuple[Sequence[NominalShot], Plan]]] = {}

    def by(change: str, other: Callable[[], Rig]) -> None:
        changed[change] = lambda: ([one.known_by(other()) for one in nominal], plan)

    def known(change: str, key: str, u: float) -> None:
        by(change, lambda: with_uncertainties(rig, {key: u}))

    def planned(change: str, other: Plan) -> None:
        changed[change] = lambda: (nominal, other)

    channels = {f"{one.name}.u_rel": one for one in rig.channels if one.role in SCALED_ROLES}
    for key, u in stated_uncertainties(rig).items():
        channel = channels.get(key)
        if not u or key in OF_NO_SHOT or (channel is not None and not _is_in(channel.role, nominal)):
            continue
        if channel is None:
            known(f"{key.removeprefix('u_')} known twice as well: {key} {0.5 * u:.3g}", key, 0.5 * u)
            if key in UNREAD_KEYS:
                known(f"{key.removeprefix('u_')} known to be none: {key} 0", key, 0.0)
            continue
        at_rest = " at rest" if channel.u_dynamic_rel else ""
        known(f"{channel.name} calibrated twice as well{at_rest}: {50 * u:.3g} %", key, 0.5 * u)
        if channel.role == "breech_pressure" and u > GOOD_BREECH_REL:
            known(f"{channel.name} calibrated to {100 * GOOD_BREECH_REL:g} %{at_rest}", key, GOOD_BREECH_REL)
        if channel.u_dynamic_rel:
            change = f'{channel.name} with a certificate as good of pulses like the shot\'s: calibration = "dynamic"'
            by(change, partial(with_dynamic_certificate, rig, channel.name))
    asked = {one.suspected.source.kind for shot in nominal for one in shot.summary.parameters if one.suspected}
    breech = next((one.name for one in rig.channels if one.role == "breech_pressure"), "")
    for kind in asked.intersection(SHAPES):
        changed[SHAPES[kind].format(breech)] = partial(lambda of: ([one.knowing(of) for one in nominal], plan), kind)
    for added_kg, u_added_kg in _weights(rig, nominal[0].mass_kg) if plan.shots > 1 else ():
        if added_kg != plan.added_mass_kg:
            change = (
                f"{added_kg:g} kg ({100 * added_kg / nominal[0].mass_kg:.0f} % of the mass), weighed to {u_added_kg:g} "
                "kg, added to every second shot"
            )
            planned(change, replace(plan, added_mass_kg=added_kg, u_added_mass_kg=u_added_kg))
    if plan.added_mass_kg:
        planned("nothing added to any shot", replace(plan, added_mass_kg=0.0))
    for shots in OTHER_SHOTS:
        if shots != plan.shots:
            planned(f"{shots} shots", replace(plan, shots=shots))
    for rel in OTHER_SCATTERS_REL:
        if rel > plan.scatter.gain_rel:
            scatter = replace(plan.scatter, gain_rel=rel)
            planned(f"gains that repeat to {100 * rel:g} % only", replace(plan, scatter=scatter))

    def what_if(change: str) -> WhatIf:
        shots, other = changed[change]()
        return WhatIf(change, predicted_u_rel(shots, alone(other)), predicted_u_rel(shots, other))

    tried = worked_out({change: partial(what_if, change) for change in changed})
    return Advised(tuple(sorted(tried.lines, key=lambda one: one.u_rel_campaign)), tried.notes)


def _weights(rig: Rig, mass_kg: float) -> list[tuple[float, float]]:
    """Return the masses that may be added, with their standard uncertainties: that at hand, or some that could be."""
    known = rig.knowledge
    if known.weighed_mass_kg is not None and known.u_weighed_mass_kg is not None:
        return [(known.weighed_mass_kg, known.u_weighed_mass_kg)]
    shares = (float(f"{share * mass_kg:.2g}") for share in ADDED_SHARES)
    return [(added_kg, weighed_to_kg(added_kg)) for added_kg in shares]


def _is_in(role: str, nominal: Sequence[NominalShot]) -> bool:
    """Return whether a sensor of a role tells something in the shots."""
    named = (name for one in nominal for parameter in one.summary.parameters for name, _ in parameter.influences)
    return any(name.startswith(f"{OF_SENSOR}{role}:") for name in named)


def _nearest(nominal: Sequence[NominalShot], charge: float, added_mass_kg: float) -> NominalShot:
    """Return a shot with a mass added, by the nominal one that is nearest to it."""
    nearest = min(nominal, key=lambda one: (abs(one.charge - charge), abs(one.added_mass_kg - added_mass_kg)))
    return nearest if nearest.added_mass_kg == added_mass_kg else nearest.carrying(added_mass_kg)
