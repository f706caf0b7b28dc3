"""Days as the README plans them: shots of the virtual rig, ingested with their log, and combined by `campaign`.

A day of eight shots takes 30 s of processor time with `mixed` and 25 s with `field-2013`; half of that with `SHORTER`.
"""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from recoil_acquisition.store.shot_log import SHOT_LOG
from recoil_daq.campaigns.campaign import campaign
from recoil_daq.campaigns.sources import CampaignReport
from recoil_daq.recording.ingest import ingest_files
from recoil_daq.recording.simulate import simulate
from recoil_identification.campaign.campaign_shot import CampaignShot
from recoil_rigs.rig import load_rig
from recoil_rigs.twin import CampaignPlan
from tests.builders.virtual_shots import SHORTER, with_twin

RIGS = ("mixed", "field-2013")
SHOTS = 8
PAIRED_CHARGES = (1.0, 1.0, 0.8, 0.8, 0.65, 0.65, 0.9, 0.9)
"""Each twice in a row: once bare, and once with what every second shot carries."""
CHARGES = (1.0, 0.8, 0.65, 0.9)
KINDS: Mapping[str, tuple[float | None, tuple[float, ...]]] = {
    "plain": (None, ()),
    "120 kg": (120.0, ()),
    "310 kg": (310.0, ()),
    "plain, four charges": (None, CHARGES),
    "120 kg, four charges": (120.0, PAIRED_CHARGES),
    "160 kg": (160.0, ()),
}
"""What every second shot carries, and the charges: four days of six with a weight, two of them plain."""
README_SEEDS = (3, 5, 11)
"""Of days of `mixed` with 120 kg: the README's own, and others that its pages name."""


@dataclass(frozen=True)
class Day:
    """A day that is planned.

    Attributes
    ----------
    campaign_seed
        Seed of its sensors and, as nothing else is asked for, of its noise: no two days have the same.
    """

    rig: str
    kind: str
    campaign_seed: int
    shots: int = SHOTS
    shorter: bool = False

    @property
    def plan(self) -> CampaignPlan:
        """What is fired."""
        added_kg, charges = KINDS[self.kind]
        return CampaignPlan(added_mass_kg=added_kg, charges=charges)


def days(count: int) -> list[Day]:
    """Plan so many days, of both rigs and all kinds in turn, the README's own seeds among them."""
    planned, own = [], list(README_SEEDS)
    for number in range(count):
        rig, kind = RIGS[number % 2], [*KINDS][number // 2 % len(KINDS)]
        readme = rig == RIGS[0] and kind == "120 kg" and own
        planned.append(Day(rig, kind, own.pop(0) if readme else 101 + number))
    return planned


@dataclass(frozen=True, eq=False)
class LivedDay:
    """A day that was lived.

    Attributes
    ----------
    answer
        Contents of ``campaign.json``.
    shots
        Each as the campaign took it.
    truths
        Of each shot, as the virtual rig tells.
    """

    day: Day
    answer: Mapping[str, Any]
    shots: tuple[CampaignShot, ...]
    truths: tuple[Mapping[str, Any], ...]

    @property
    def mass_kg(self) -> float:
        """True mass without what was added."""
        return float(self.truths[0]["m3"]) - float(self.truths[0]["added_mass_kg"])

    @property
    def judged(self) -> tuple[float, float, float]:
        """Mass, its u, and the truth."""
        return float(self.answer["mass"]["value"]), float(self.answer["mass"]["u"]), self.mass_kg


def live(day: Day, folder: Path) -> LivedDay:
    """Simulate a day's shots, ingest them, and combine them, in a folder that holds nothing yet."""
    rig = with_twin(day.rig, kind=False, **SHORTER) if day.shorter else load_rig(day.rig)
    fired = simulate(rig, folder / "range", shots=day.shots, campaign_seed=day.campaign_seed, plan=day.plan)
    out = folder / "shots"
    out.mkdir()
    shutil.copy(folder / "range" / SHOT_LOG, out / SHOT_LOG)
    for one in fired.shots:
        ingest_files(rig, one.files, shot=one.shot, out=out)
    # by one process: workers of its own would take longer to start
    done = campaign(out, reports=folder / "none", out=folder / "campaign", workers=1)
    reports = sorted((folder / "campaign" / "reports").glob("*/report.json"))
    shots = tuple(CampaignReport.read(path).shot() for path in reports)
    return LivedDay(day, done.document, shots, tuple(one.truth for one in fired.shots))
