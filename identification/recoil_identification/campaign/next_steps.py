"""Measures that would lower the uncertainty of a campaign's mass: more shots, an added mass, a better sensor.

Each is tried on the campaign's own shots: what they tell does not hang on how their errors fell, so that the
uncertainty with as many more like them, or with another certificate, is that of the joint fit with these
(`recoil_identification.campaign.prediction` does the same before the first shot).
"""

from __future__ import annotations

from collections.abc import Sequence, Set
from dataclasses import dataclass, replace
from functools import partial

from recoil_identification.campaign.advice import Advised, weighed_to_kg, worked_out
from recoil_identification.campaign.campaign_shot import CampaignShot
from recoil_identification.campaign.joint_fit import JointFit, by_the_weight, joint_fit_under
from recoil_identification.campaign.joint_rows import JointRows, Scatter
from recoil_identification.campaign.prediction import ADDED_SHARES, NominalShot
from recoil_identification.campaign.suspects import averaged_u_rel
from recoil_identification.rows.unread_resistance import FORCE

MOST_STEPS = 6
LEAST_GAIN = 0.03
"""Share of the uncertainty below which a step is not worth its name."""


@dataclass(frozen=True)
class NextStep:
    """One thing to do, and the standard uncertainty of the mass with it."""

    change: str
    u_kg: float


def next_steps(fit: JointFit) -> Advised[NextStep]:
    """List what would lower the uncertainty of the first mechanism's mass, what helps most first.

    What changed among the shots is left aside. A mass that the shots carry already is the same weight in those to come,
    another one is taken to be weighed as well as usual.
    """
    shots, mass_kg = fit.rows.shots, fit.mass_kg(fit.rows.mechanisms[0])[0]
    scatter, of = Scatter(fit.scatter("gain_rel")[0], fit.scatter("friction_rel")[0]), fit.rows.mechanism_of

    def fit_of(rows: JointRows) -> JointFit:
        return joint_fit_under(rows, scatter)

    def u_kg(of_shots: Sequence[CampaignShot]) -> float:
        return mass_kg * averaged_u_rel(by_the_weight(fit_of(JointRows.of(of_shots, of)), fit_of))

    def more(added_kg: float, u_added_kg: float) -> list[CampaignShot]:
        return [*shots, *_more(last, len(shots), added_kg, u_added_kg)]

    def known(source: str) -> list[CampaignShot]:
        return [_knowing(shot, {name for name, of_it in sources.items() if of_it == source}) for shot in shots]

    last = next((shot for shot in reversed(shots) if shot.added_mass_kg == 0), shots[-1])
    weighed = dict(reversed(fit.rows.weights))
    changed = {f"{len(shots)} more shots": partial(more, 0.0, 0.0)}
    for share in ADDED_SHARES:
        added_kg = float(f"{share * mass_kg:.2g}")
        u_added_kg = weighed.get(added_kg, weighed_to_kg(added_kg))
        change = (
            f"{len(shots)} more shots with {added_kg:g} kg ({100 * share:.0f} % of the mass) weighed and added, "
            f"u {u_added_kg:g} kg"
        )
        changed[change] = partial(more, added_kg, u_added_kg)
    # the shapes of a force are one
    sources = {one.identity: FORCE if one.is_shape else one.source for one in fit.rows.influences}
    for source in dict.fromkeys(sources.values()):
        changed[f"{source} known twice as well"] = partial(known, source)

    def step(change: str) -> NextStep:
        return NextStep(change, u_kg(changed[change]()))

    as_is = worked_out({"nothing": lambda: NextStep("nothing", u_kg(shots))})
    if not as_is.lines:
        return as_is
    tried = worked_out({change: partial(step, change) for change in changed})
    worth = [one for one in tried.lines if one.u_kg < (1.0 - LEAST_GAIN) * as_is.lines[0].u_kg]
    return Advised(tuple(sorted(worth, key=lambda one: one.u_kg)[:MOST_STEPS]), tried.notes)


def _more(like: CampaignShot, count: int, added_kg: float, u_added_kg: float) -> list[CampaignShot]:
    """Return further shots like one, with a mass added."""
    if like.summary is None:
        raise ValueError(f"shot {like.name} has no summary")
    bare_kg = like.mass_kg - like.added_mass_kg
    nominal = NominalShot.of(bare_kg, like.added_mass_kg, like.summary).carrying(added_kg)
    further = replace(
        like, mass_kg=bare_kg + added_kg, added_mass_kg=added_kg, u_added_mass_kg=u_added_kg, summary=nominal.summary
    )
    return [replace(further, name=f"next {number}") for number in range(count)]


def _knowing(shot: CampaignShot, identities: Set[str]) -> CampaignShot:
    """Return a shot of which some influences are known twice as well."""
    if shot.summary is None:
        raise ValueError(f"shot {shot.name} has no summary")
    parameters = tuple(
        replace(one, influences=tuple((name, 0.5 * u if name in identities else u) for name, u in one.influences))
        for one in shot.summary.parameters
    )
    return replace(shot, summary=replace(shot.summary, parameters=parameters))
