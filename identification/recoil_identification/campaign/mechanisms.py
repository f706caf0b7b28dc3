"""Which configurations of a campaign are one mechanism with more or less added to it, and which have other parts."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

from recoil_identification.campaign.campaign_shot import CampaignShot

UNNAMED = "as built"
"""A configuration that nobody named."""


def mechanisms_of(shots: Sequence[CampaignShot]) -> dict[str, str]:
    """Return the mechanism of each configuration: the name of the first configuration that is the same mechanism.

    A name may stand for a mass that was weighed and added, or for parts of an unknown mass. Where no two configurations
    were fired with the same mass added, what was added tells them apart, and all are one mechanism. Where two were,
    their names can only mean other parts, and each configuration has a mass of its own.
    """
    added: dict[str, set[float]] = {}
    for shot in shots:
        added.setdefault(shot.configuration, set()).add(shot.added_mass_kg)
    if any(one & other for one, other in combinations(added.values(), 2)):
        return {name: name or UNNAMED for name in added}
    return dict.fromkeys(added, next(iter(added), "") or UNNAMED)
