"""A whole campaign of the virtual rig, simulated and ingested: shot files, shot log, truths.

A shot of `field-2013` takes 0.6 s of processor time to simulate and 0.3 s to ingest, one of `mixed` 0.7 and 0.4 s.
"""

from __future__ import annotations

import datetime as dt
import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from recoil_acquisition.store.shot_log import SHOT_LOG
from recoil_daq.campaigns.campaign import campaign
from recoil_daq.recording.ingest import ingest_files
from recoil_daq.recording.simulate import simulate
from recoil_rigs.rig import Rig
from recoil_rigs.twin import CampaignPlan
from tests.builders.shared_motions import once_in_this_run
from tests.builders.virtual_shots import SHORTER, with_twin

CHARGES = (1.0, 1.0, 0.8, 0.8, 0.65, 0.65, 0.9, 0.9)
"""Each twice in a row: once bare, and once with what every second shot carries."""
RING = CampaignPlan(added_mass_kg=120.0)
RING_SHOTS = 4


@dataclass(frozen=True, eq=False)
class FiredCampaign:
    """An ingested campaign.

    Attributes
    ----------
    shots
        Folder of the shot files and of the shot log.
    files
        The shot files, in the order of firing.
    truths
        Of each shot, likewise.
    """

    rig: Rig
    shots: Path
    files: tuple[Path, ...]
    log: Path
    truths: tuple[Mapping[str, Any], ...]


def fire_campaign(
    folder: Path,
    plan: CampaignPlan | None = None,
    *,
    name: str = "field-2013",
    shots: int = 8,
    campaign_seed: int = 1,
    seed: int | None = None,
    **settings: float | bool,
) -> FiredCampaign:
    """Simulate and ingest the shots of a bundled rig, in shorter records than the rig's own.

    Parameters
    ----------
    folder
        Gets ``simulated`` and ``shots``.
    seed
        Of the first shot; as of `simulate` if left out.
    **settings
        Of the virtual rig.
    """
    rig = with_twin(name, **SHORTER | settings)
    fired = simulate(rig, folder / "simulated", seed=seed, shots=shots, campaign_seed=campaign_seed, plan=plan)
    out = folder / "shots"
    out.mkdir(parents=True)
    log = Path(shutil.copy(folder / "simulated" / SHOT_LOG, out / SHOT_LOG))
    files = tuple(
        ingest_files(rig, one.files, shot=one.shot, out=out, on=dt.date(2026, 6, 1)).path for one in fired.shots
    )
    return FiredCampaign(rig, out, files, log, tuple(one.truth for one in fired.shots))


@dataclass(frozen=True, eq=False)
class AnsweredCampaign:
    """A campaign and the folder of its answer, with the reports that were made for it; not to be changed."""

    fired: FiredCampaign
    answer: Path


@cache
def ring_campaign() -> AnsweredCampaign:
    """Return four shots, every second of which carries a ring, and their answer; made once in a test run."""
    return once_in_this_run("ring-campaign", _ring_campaign)


def _ring_campaign(folder: Path) -> AnsweredCampaign:
    fired = fire_campaign(folder, RING, shots=RING_SHOTS, campaign_seed=5)
    # by one process: workers of its own would take longer to start
    done = campaign(fired.shots, reports=folder / "none", out=folder / "campaign", workers=1)
    return AnsweredCampaign(fired, done.folder)
