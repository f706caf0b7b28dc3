"""What can go wrong on a day, planted in the summaries of shots that were fired without it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

from recoil_identification.campaign.campaign import Campaign
from recoil_identification.campaign.campaign_shot import CampaignShot
from recoil_identification.campaign.signal_kind import SignalKind
from recoil_identification.shot.shot_summary import STEPS_AT, ln_mass_step

LEFT_AT = min(STEPS_AT, key=lambda share: abs(share - 0.5))
"""Share of the travel's time at which a part of the mass is lost within each shot."""


def moved(shot: CampaignShot, parameter: str, by: float) -> CampaignShot:
    """Let a parameter of a shot's summary be off by an amount, as if its record had it."""
    assert shot.summary is not None
    place = [one.name for one in shot.summary.parameters].index(parameter)
    reference = shot.summary.reference.copy()
    reference[place] += by
    return replace(shot, summary=replace(shot.summary, reference=reference))


def heavier(shot: CampaignShot, by_kg: float) -> CampaignShot:
    """Let the recoiling mass of a shot be so much more."""
    by = math.log1p(by_kg / shot.mass_kg)
    return replace(moved(shot, "ln mass", by), mass_kg=shot.mass_kg * math.exp(by))


def changing(shot: CampaignShot, by_kg: float) -> CampaignShot:
    """Let the mass change so much in the middle of a shot."""
    assert shot.summary is not None
    place = [one.name for one in shot.summary.parameters].index(ln_mass_step(LEFT_AT))
    size = math.log1p(by_kg / shot.mass_kg)
    seen = shot.summary.seen + size * shot.summary.triangle[:, place]
    return replace(shot, summary=replace(shot.summary, seen=seen))


Planted = Callable[[Sequence[CampaignShot]], list[CampaignShot]]
Told = Callable[[Campaign], bool]


def _names(kind: SignalKind, part: str = "", shots: str = "") -> Told:
    """Return what says whether a change of a kind is named, of what has a part in its name, of a shot."""
    return lambda found: any(
        one.kind == kind and part in one.influence and (not shots or one.shots[0] == shots) for one in found.changes
    )


CHANGES: dict[str, tuple[Planted, Told]] = {
    "mass step of 4 kg from shot 5 on": (
        lambda shots: [heavier(one, 4.0) if k >= 4 else one for k, one in enumerate(shots)],
        _names(SignalKind.STEP, shots="0005"),
    ),
    "breech gauge of shot 5 off by 1 %": (
        lambda shots: [moved(one, "ln breech_pressure", 0.01) if k == 4 else one for k, one in enumerate(shots)],
        _names(SignalKind.OUTLIER, "breech", "0005"),
    ),
    "breech gauge drifts by 1 %": (
        lambda shots: [moved(one, "ln breech_pressure", 0.01 * k / (len(shots) - 1)) for k, one in enumerate(shots)],
        _names(SignalKind.DRIFT, "breech"),
    ),
    "added mass 5 kg more than stated": (
        lambda shots: [heavier(one, 5.0) if one.added_mass_kg else one for one in shots],
        _names(SignalKind.ADDED),
    ),
    "12 kg let go within every shot": (
        lambda shots: [changing(one, -12.0) for one in shots],
        lambda found: found.constancy is not None and not found.constancy.constant,
    ),
}
"""By what is planted: how, and how it is rightly told."""
