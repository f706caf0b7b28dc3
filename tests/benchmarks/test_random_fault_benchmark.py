"""Plain faults that a person makes, drawn at random: refused, not valid, or within the interval, and none far outside.

`RECOIL_DAQ_RANDOM_FAULTS` sets how many are drawn (145 by default). Two processes share them.
"""

from __future__ import annotations

import datetime as dt
import os
import shutil
import tempfile
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from multiprocessing import get_context
from pathlib import Path

from recoil_acquisition.errors import RecoilDaqError
from recoil_daq.recording.ingest import ingest_files
from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.identified import Options
from recoil_rigs.rig import load_rig
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.twin import simulate_shot
from tests.builders.random_faults import RIG, RandomFault

COUNT = int(os.environ.get("RECOIL_DAQ_RANDOM_FAULTS", "145"))
RIGS = ("mixed", "field-2013")
SEED, ANOTHER = 3, 4
"""A shot whose own error is less than one standard uncertainty, and one whose files are taken for its own."""
HOLDS, BEYOND = 2.0, 3.0
"""Standard uncertainties within which a valid mass is right, and beyond which none may lie."""


@cache
def sound(name: str, seed: int) -> tuple[Path, float]:
    """Return the folder of a shot's files and its rig, and its true mass."""
    rig, folder = load_rig(name), Path(tempfile.mkdtemp(prefix="sound-"))
    shot = simulate_shot(rig, folder, seed=seed, shot="0001")
    (folder / RIG).write_text(rig.text, "utf-8")
    for database, text in rig.databases.items():
        (folder / database).write_text(text, "utf-8")
    return folder, float(shot.truth["m3"])


def outcome(number: int) -> tuple[str, str, str]:
    """Make one fault, and say what becomes of the shot."""
    rig = RIGS[number % 2]
    folder, truth_kg = sound(rig, SEED)
    with tempfile.TemporaryDirectory() as scratch:
        at = shutil.copytree(folder, Path(scratch) / "shot")
        fault = f"{rig}: {RandomFault(number).put_into(at, sound(rig, ANOTHER)[0])}"
        try:
            files = [str(path) for path in sorted(at.glob("0001_*"))]
            bad = load_rig(at / RIG)
            done = ingest_files(bad, files, shot="0001", out=Path(scratch) / "out", on=dt.date(2026, 6, 1))
            found = identify_shot(FiredShot(done.shot, bad), Options())
        except RecoilDaqError as error:
            return fault, "refused", str(error)
    estimate = found.chosen.estimate
    off = (estimate.mass_kg - truth_kg) / estimate.u_kg
    figures = f"{estimate.mass_kg:.1f} kg, u {estimate.u_kg:.1f} kg, {off:+.2f} u"
    if not found.valid:
        return fault, "not valid", f"{figures}: {found.reasons[0]}"
    said = "; ".join(check.check for check in done.shot.quality if check.verdict != "ok")
    verdict = "holds" if abs(off) <= HOLDS else "beyond" if abs(off) <= BEYOND else "WRONG"
    return fault, verdict, f"{figures}: {said}"


def test_no_plain_fault_is_beyond_three_uncertainties_and_valid(benchmark, capsys):
    os.environ["OPENBLAS_NUM_THREADS"] = "1"

    def run() -> list[tuple[str, str, str]]:
        with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
            return list(pool.map(outcome, range(COUNT)))

    outcomes = benchmark.pedantic(run, rounds=1, warmup_rounds=0)
    with capsys.disabled():
        print(f"\n{COUNT} random faults: {dict(Counter(o[1] for o in outcomes))}")
        for fault, verdict, detail in sorted(outcomes, key=lambda o: o[1]):
            print(f"{verdict:10} {fault:110} {detail[:160]}")
    wrong = [one for one in outcomes if one[1] == "WRONG"]
    assert not wrong, wrong
