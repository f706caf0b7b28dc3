"""The whole way: simulate, ingest, identify, compare with the truth; one shot, a range day, a campaign."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from recoil_acquisition.errors import IdentificationError, StoreError
from recoil_acquisition.store import shot_summary
from recoil_acquisition.store.shot_log import SHOT_LOG
from recoil_daq.campaigns.campaign import Combined, campaign
from recoil_daq.live.acquisition import run_live
from recoil_daq.live.display import Display
from recoil_daq.live.shot import LiveOptions, LiveOutcome, LiveShot
from recoil_daq.recording.ingest import Ingested, ingest_files
from recoil_daq.recording.ingest_folder import ingest_folder
from recoil_daq.recording.simulate import simulate
from recoil_daq.reports.identify import Reported, identify_file
from recoil_daq.terminal.result import Progress
from recoil_identification.report.document.document import true_mass_kg
from recoil_rigs.rig import Rig, load_rig, parse_rig
from recoil_rigs.twin import CampaignPlan, TwinShot, simulate_shot
from recoil_rigs.twin.range_day import RangeDay

DEMO_RIG = "mixed"
DEMO_SHOT = "0001"
LIVE_DEMO_SHOTS = 3
LIVE_DEMO_SILENCE_S = 5.0
"""Silence before each of them, s: time for the mass of the one before."""
CAMPAIGN_DEMO_SHOTS = 8
CAMPAIGN_DEMO: dict[str, Any] = {
    "added_mass_kg": 310.0,
    "charges": (1.0, 1.0, 0.8, 0.8, 0.65, 0.65, 0.9, 0.9),
    "friction_scatter": 0.03,
}
SIMULATED = r"\d{4}_(camera\.csv|can\.blf|dewetron\.csv|imu\.rdlog)|mixed\.dbc|rig\.toml|truth\.json"
LOG_FILES = r"\.?shotlog\.csv(\.[\w.]+)?"
"""Pattern of the shot log's name, and of the files that those who change it put beside it."""
CAMPAIGN_DEMO_FILES = (
    rf"simulated/({LOG_FILES}|\d{{4}}/({SIMULATED}))",
    rf"shots/({LOG_FILES}|\d{{4}}\.h5)",
    r"answer/(campaign\.(csv|html|json)|cutoff\.json)",
    r"answer/reports/\d{4}/(curves\.csv|mass\.csv|report\.(html|json))",
    r"answer/(reports/)?plotly\.min\.js",
)
LIVE_DEMO_FILES = (
    rf"\d{{4}}\.h5|rig\.toml|mixed\.dbc|live\.(json|js|html)|zoom\.html|pages/\w+\.(js|css)|{LOG_FILES}",
    r"overviews/(index\.js|\d{4}/(overview|filtered|\d{3})\.js)",
    r"captures/\d{4}\.rdlog",
    r"incoming/\d{4}_(camera|dewetron)\.csv",
    r"sessions/\w+\.\w+\.json",
    r"(campaign/)?reports/(\d{4}/(curves\.csv|mass\.csv|report\.(html|json))|plotly\.min\.js)",
    r"campaign/(campaign\.(csv|html|json)|cutoff\.json|plotly\.min\.js)|day\.(html|json)",
)
"""Patterns of the files that the demonstrations write into folders that --overwrite removes."""


@dataclass(frozen=True)
class Demonstration:
    """Files of the demonstration: what the virtual rig wrote, the shot file, the report."""

    simulated: TwinShot
    ingested: Ingested
    report: Reported

    def to_json(self) -> dict[str, Any]:
        """Return the document of ``demo --json``."""
        return {
            "schema": "recoil-daq/demo/1",
            "usable": self.ingested.shot.usable,
            "state": self.ingested.shot.state.value,
            "shot_file": str(self.ingested.path),
            "truth": dict(self.simulated.truth),
            "folder": str(self.report.folder),
            "report": self.report.document,
        }

    def show(self, *, whole: bool = False) -> None:
        """Print the verdict on the shot and the mass beside the truth; the whole of it with all checks and methods."""
        from recoil_daq.terminal.ingest import print_state
        from recoil_daq.terminal.report import print_truth

        if whole:
            self.ingested.show()
        else:
            print_state(self.ingested.to_json())
        self.report.show(whole=whole)
        print_truth(self.report.to_json())


def run_demo(
    out: Path, *, seed: int = 1, overwrite: bool = False, progress: Progress = lambda _: None
) -> Demonstration:
    """Simulate a shot on the rig ``mixed``, ingest its four files and identify its mass.

    Parameters
    ----------
    out
        Folder that gets ``simulated``, ``shots`` and ``reports``.
    overwrite
        Whether the files of an earlier demonstration are replaced.
    progress
        Function called with the name of each step.

    Raises
    ------
    StoreError
        If the folder holds an earlier demonstration, or what is of none beside it.
    """
    folder = out / "simulated" / DEMO_SHOT
    _make_room(folder, "demonstration", (SIMULATED,), overwrite=overwrite)
    progress("simulate")
    rig = load_rig(DEMO_RIG)
    simulated = simulate_shot(rig, folder, seed=seed, shot=DEMO_SHOT)
    ingested = ingest_files(
        rig, simulated.files, shot=DEMO_SHOT, out=out / "shots", overwrite=overwrite, progress=progress
    )
    report = identify_file(
        ingested.path, out=out / "reports", truth=simulated.truth, overwrite=overwrite, progress=progress
    )
    return Demonstration(simulated, ingested, report)


@dataclass(frozen=True)
class CampaignDemonstration:
    """Files of a demonstrated campaign; `true_kg` is the mass without what was added."""

    combined: Combined
    true_kg: float

    def to_json(self) -> dict[str, Any]:
        """Return the document of ``demo --campaign --json``."""
        error_percent = 100 * (self.combined.mass_kg / self.true_kg - 1)
        return {
            "schema": "recoil-daq/demo/1",
            "campaign": self.combined.document,
            "folder": str(self.combined.folder),
            "truth": {"mass_kg": self.true_kg, "error_percent": error_percent},
        }

    def show(self) -> None:
        """Print the campaign beside the truth."""
        from recoil_daq.terminal.campaign import print_campaign_demo

        print_campaign_demo(self.to_json())


def run_campaign_demo(
    out: Path, *, seed: int = 1, overwrite: bool = False, progress: Progress = lambda _: None
) -> CampaignDemonstration:
    """Fire eight shots of one set of sensors, every second one with a mass added, and combine them.

    Parameters
    ----------
    out
        Folder that gets ``campaign`` with the simulated files, the shot files and the answer.
    overwrite
        Whether an earlier campaign there is removed.

    Raises
    ------
    StoreError
        If the folder holds an earlier campaign, or what is of no demonstration.
    """
    folder = out / "campaign"
    _make_room(folder, "campaign", CAMPAIGN_DEMO_FILES, overwrite=overwrite)
    rig, plan = load_rig(DEMO_RIG), CampaignPlan(**CAMPAIGN_DEMO)
    fired = simulate(
        rig, folder / "simulated", shots=CAMPAIGN_DEMO_SHOTS, campaign_seed=seed, plan=plan,
        progress=lambda step: progress(f"simulate, {step}"),
    )  # fmt: skip
    (folder / "shots").mkdir(parents=True)
    shutil.copy(folder / "simulated" / SHOT_LOG, folder / "shots" / SHOT_LOG)
    ingest_folder(rig, folder / "simulated", out=folder / "shots", progress=lambda step: progress(f"ingest, {step}"))
    combined = campaign(folder / "shots", reports=folder / "reports", out=folder / "answer", progress=progress)
    first = fired.shots[0].truth
    return CampaignDemonstration(combined, true_mass_kg(first) - float(first["added_mass_kg"]))


@dataclass(frozen=True)
class LiveDemonstration:
    """Files of a demonstrated range day.

    Attributes
    ----------
    reports
        Reports, one per shot that has a mass.
    played
        Signals that the virtual devices truly sent; see `recoil_rigs.twin.player.TwinPlayer.truth`.
    """

    outcome: LiveOutcome
    reports: tuple[Reported, ...]
    played: dict[str, Any]

    @property
    def valid(self) -> bool:
        """Whether every shot is usable, and every mass valid."""
        identified = len(self.reports) == len(self.outcome.shots)
        return self.outcome.usable and identified and all(report.document["valid"] for report in self.reports)

    def to_json(self) -> dict[str, Any]:
        """Return the document of ``demo --live --json``."""
        return {
            "schema": "recoil-daq/live-demo/1",
            "session": self.outcome.to_json(),
            "played": self.played,
            "reports": [{"folder": str(r.folder), **r.document} for r in self.reports],
        }

    def show(self) -> None:
        """Print the session, and each shot's mass beside the truth."""
        from recoil_daq.live.tables import print_live_demo

        print_live_demo(self.to_json())


def live_demo_rig(folder: Path) -> Rig:
    """Write the rig of the demonstrated range day, whose recorder streams what its file will hold, and return it."""
    whole = load_rig(DEMO_RIG)
    files = 'match = "*_dewetron.csv"'
    streaming = whole.text.replace(files, f'device = {{ virtual = "oxygen" }}\n{files}')
    folder.mkdir(parents=True)
    for name, text in {"rig.toml": streaming, **whole.databases}.items():
        (folder / name).write_text(text, encoding="utf-8", newline="")
    return parse_rig(streaming, folder / "rig.toml", whole.databases)


def run_live_demo(out: Path, display: Display, *, seed: int = 1, overwrite: bool = False) -> LiveDemonstration:
    """Run a range day of three shots with virtual devices, each identified before the next is fired.

    Parameters
    ----------
    out
        Folder that gets ``live`` with the rig, shot files, captures, dropped files and ``reports``.
    overwrite
        Whether an earlier range day there is removed.

    Raises
    ------
    StoreError
        If the folder holds an earlier range day, or what is of no demonstration.
    DeviceError
        If this computer has no pseudo-terminals.
    """
    folder = out / "live"
    _make_room(folder, "range day", LIVE_DEMO_FILES, overwrite=overwrite)
    days: list[RangeDay] = []
    options = LiveOptions(out=folder, shots=LIVE_DEMO_SHOTS, identify=True)
    outcome = run_live(
        live_demo_rig(folder),
        options,
        display,
        play={"seed": seed, "silence_before_s": LIVE_DEMO_SILENCE_S},
        watch_day=days.append,
    )
    reports = []
    for shot in outcome.shots:
        if shot.document is None:
            continue
        truth = next(s.truth for s in days[0].shots if s.folder.name == shot.name)
        try:
            reports.append(_reported(shot, folder / "reports", truth, display))
        except IdentificationError as error:
            # a day that went wrong for one shot has its other masses all the same
            display.notice(f"shot {shot.name} has no mass: {error}")
    return LiveDemonstration(outcome, tuple(reports), days[0].player.truth())


def _reported(shot: LiveShot, reports: Path, truth: Mapping[str, Any], display: Display) -> Reported:
    """Return the report that a shot got while the range was armed, beside the truth; identify it where it got none."""
    if shot.mass is None:
        display.notice(f"identify shot {shot.name}")
        path = Path((shot.document or {})["file"])
        return identify_file(path, out=reports, truth=truth, overwrite=True)
    folder = Path(shot.mass["report"])
    document = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    true_kg = true_mass_kg(truth)
    beside = {"mass_kg": true_kg, "error_percent": 100 * (document["mass"]["value"] / true_kg - 1)}
    return Reported({**document, "truth": beside}, folder)


def _make_room(folder: Path, what: str, files: Sequence[str], *, overwrite: bool) -> None:
    """Remove what an earlier demonstration wrote, where that is asked for.

    Parameters
    ----------
    files
        Patterns of the paths of its files in the folder.

    Raises
    ------
    StoreError
        If it is not asked for, or anything else is in the folder, of which nothing is removed then.
    """
    if not folder.exists():
        return
    if not overwrite:
        raise StoreError(f"an earlier {what} is here", path=folder, remedy="give another --out, or --overwrite")
    found = [path for path in folder.rglob("*") if path.is_symlink() or not path.is_dir()]
    own = re.compile("|".join(files))
    for path in found:
        known = own.fullmatch(path.relative_to(folder).as_posix()) is not None
        if not known or (path.suffix == ".h5" and shot_summary(path)["rig"] != load_rig(DEMO_RIG).name):
            raise StoreError(
                "this is of no demonstration, and is not removed with an earlier one",
                path=path,
                remedy="give another --out, or move it elsewhere",
            )
    shutil.rmtree(folder)
