"""Which configurations of a campaign are one mechanism with more or less added to it, and which have other parts."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

from recoil_identification.campaign.campaign_shot import CampaignShot

UNNAMED = "as built"
"""A configuration that nobody named."""


def mechanisms_of(shots: Sequence[CampaignShot], fired: Sequence[CampaignShot] = ()) -> dict[str, str]:
    """Return the mechanism of each configuration: the name of the first configuration that is the same mechanism.

    A name may stand for a mass that was weighed and added, or for parts of an unknown mass. Where no two configurations
    were fired with the same mass added, what was added tells them apart, and all are one mechanism. Where two were,
    their names can only mean other parts, and each configuration has a mass of its own.

    Parameters
    ----------
    shots
        Shots that count.
    fired
        All shots, those that are set aside among them: which configuration is the first hangs on no verdict.
    """
    count = {shot.configuration for shot in shots}
    added: dict[str, set[float]] = {one.configuration: set() for one in fired or shots if one.configuration in count}
    for shot in shots:
        added[shot.configuration].add(shot.added_mass_kg)
    if any(one & other for one, other in combinations(added.values(), 2)):
        return {name: name or UNNAMED for name in added}
    return dict.fromkeys(added, next(iter(added), "") or UNNAMED)
