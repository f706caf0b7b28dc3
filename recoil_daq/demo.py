"""The whole way once: simulate, ingest, identify, compare with the truth."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from daq.errors import StoreError
from recoil_daq.identify import Reported, identify_file
from recoil_daq.ingest import Ingested, ingest_files
from rigs.rig import load_rig
from rigs.twin import TwinShot, simulate_shot

DEMO_RIG = "mixed"
DEMO_SHOT = "0001"
Progress = Callable[[str], None]


@dataclass(frozen=True)
class Demonstration:
    """What the demonstration made.

    Attributes
    ----------
    simulated : TwinShot
    ingested : Ingested
    report : Reported
    """

    simulated: TwinShot
    ingested: Ingested
    report: Reported


def run_demo(
    out: Path, *, seed: int = 1, overwrite: bool = False, progress: Progress = lambda _: None
) -> Demonstration:
    """Simulate a shot on the rig ``mixed``, ingest its four files and identify its mass.

    Parameters
    ----------
    out : Path
        Gets ``simulated``, ``shots`` and ``reports``.
    seed : int
    overwrite : bool
        Replace the files of an earlier demonstration.
    progress : callable
        Told the name of each step.

    Raises
    ------
    StoreError
        If the folder holds an earlier demonstration.
    """
    folder = out / "simulated" / DEMO_SHOT
    if folder.exists():
        if not overwrite:
            raise StoreError(
                "an earlier demonstration is here", path=folder, remedy="give another --out, or --overwrite"
            )
        for file in folder.iterdir():
            file.unlink()
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
