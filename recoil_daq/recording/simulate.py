"""The virtual rig's shots, one folder each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from recoil_acquisition.errors import StoreError
from recoil_acquisition.numerics.linear_algebra import on_one_thread
from recoil_acquisition.store.shot_log import SHOT_LOG, ShotLog
from recoil_acquisition.store.shot_log_row import ShotLogRow
from recoil_daq.terminal.result import Printed, Progress
from recoil_rigs.rig import Rig
from recoil_rigs.twin import CampaignPlan, PlannedShot, TwinShot, simulate_shot, with_settings


@dataclass(frozen=True, repr=False)
class Simulated(Printed):
    """Shots that the virtual rig fired.

    Attributes
    ----------
    log
        Shot log of a campaign; None of single shots.
    """

    shots: tuple[TwinShot, ...]
    log: Path | None = None

    def to_json(self) -> dict[str, Any]:
        """Return the document of ``simulate --json``."""
        return {
            "schema": "recoil-daq/simulate/1",
            "shots": [
                {"folder": str(s.folder), "files": [str(f) for f in s.files], "truth": dict(s.truth)}
                for s in self.shots
            ],
            **({} if self.log is None else {"shot_log": str(self.log)}),
        }

    def show(self) -> None:
        """Print where each shot's files are, and its true mass."""
        from recoil_daq.terminal.file import print_simulated

        print_simulated(self.to_json())

    def __repr__(self) -> str:
        return f"Simulated({len(self.shots)} shots -> {self.shots[0].folder.parent})"


MOST_SHOTS = 9999
"""Largest number of shots of a campaign: shots of two campaigns then never share a seed."""


def first_seed(campaign_seed: int | None) -> int:
    """Return the seed of the first shot where none is given: 1, or one that no shot of another campaign has."""
    return 1 if campaign_seed is None else (MOST_SHOTS + 1) * campaign_seed + 1


@on_one_thread
def simulate(
    rig: Rig,
    out: str | Path = "simulated",
    *,
    seed: int | None = None,
    shots: int = 1,
    campaign_seed: int | None = None,
    plan: CampaignPlan | None = None,
    settings: Mapping[str, Any] | None = None,
    progress: Progress = lambda _: None,
) -> Simulated:
    """Fire the virtual rig.

    Parameters
    ----------
    out
        Folder that gets a folder ``0001``, ``0002``, ... per shot, and the shot log of a campaign.
    seed
        Seed of the first shot; that of `first_seed` if left out, so that the noise of a campaign is its own, too. Shot
        k is that of seed ``seed + k - 1``, as its truth tells, so that one shot can be fired again alone.
    shots
        Number of shots, at least 1.
    campaign_seed
        Seed of the errors of the sensors that the shots then share; without it every shot has sensors of its own.
    plan
        Plan of the campaign: charges, an added mass, drifts and more. It needs a `campaign_seed`.
    settings
        Other settings than those of the rig's ``[twin]``, by key, such as ``{"unread.packing_share": 0.02}``. The rig
        file beside the shots does not tell them, ``truth.json`` does.
    progress
        Function called with the name of each step.

    Raises
    ------
    ValueError
        If no shot is asked for, or the plan does not go with the number of shots or has no campaign.
    StoreError
        If a file exists already or cannot be written.
    RigError
        If the rig lacks what a simulation needs, or what is planned, or a setting is none.
    """
    if shots < 1:
        raise ValueError(f"shots must be at least 1, not {shots}")
    if settings:
        rig = with_settings(rig, settings)
    seed = first_seed(campaign_seed) if seed is None else seed
    planned: Sequence[PlannedShot | None] = [None] * shots
    if plan is not None:
        if campaign_seed is None:
            raise ValueError("a plan needs a campaign_seed, by which the shots share their sensors")
        planned = plan.draw(rig, shots, seed=seed, campaign_seed=campaign_seed)
    log_path = Path(out) / SHOT_LOG
    if campaign_seed is not None and log_path.exists():
        raise StoreError.exists(log_path, "choose another folder or remove it first")
    log = None if campaign_seed is None else ShotLog.read(log_path)
    done = []
    for k, one in enumerate(planned):
        name = f"{k + 1:04d}"
        progress(f"shot {k + 1} of {shots}")
        done.append(
            simulate_shot(rig, Path(out) / name, seed=seed + k, shot=name, campaign_seed=campaign_seed, planned=one)
        )
        if log is not None:
            log = log.with_row(_row(name, one)).write()
    return Simulated(tuple(done), None if log is None else log.path)


def _row(name: str, planned: PlannedShot | None) -> ShotLogRow:
    """Return a shot's row of the log: what those who fire it know."""
    if planned is None:
        return ShotLogRow(name)
    return ShotLogRow(
        name,
        configuration=planned.configuration,
        added_mass_kg=planned.added_mass_kg,
        u_added_mass_kg=planned.u_added_mass_kg,
        u_added_mass_stated=planned.added_mass_kg > 0,
        charge=f"{planned.charge:.10g}" if planned.plan.charges else "",
    )
