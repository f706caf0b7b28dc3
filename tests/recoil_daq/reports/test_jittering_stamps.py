"""A logger whose stamps jitter loses nothing by it: the mass of its files is that of even ones."""

from __future__ import annotations

import datetime as dt
import shutil
from pathlib import Path

import numpy as np
import pytest

from recoil_daq.recording.ingest import ingest_files
from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.identified import Options
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.twin import simulate_shot
from tests.builders.virtual_shots import SHORTER, with_twin

SEEDS = {"field-2013": 3, "mixed": 4}


def with_jitter(path, late_steps):
    """Write a recorder's text anew, its times later by shares of a step."""
    head, *rows = path.read_text(encoding="utf-8").splitlines()
    times = np.array([float(row.partition(",")[0]) for row in rows])
    times = times + late_steps(times.size) * (times[1] - times[0])
    rows = [f"{t:.9f},{row.partition(',')[2]}" for t, row in zip(times, rows, strict=True)]
    path.write_text("\n".join([head, *rows, ""]), encoding="utf-8")


@pytest.mark.whole_way
@pytest.mark.parametrize("name", SEEDS)
def test_jitter_of_the_recorders_stamps_hardly_moves_the_mass(name, tmp_path):
    rig = with_twin(name, **SHORTER)
    rng = np.random.default_rng(1)
    written = {
        "even": lambda count: np.zeros(count),
        "random": lambda count: 0.008 * rng.standard_normal(count),
        "every second": lambda count: 0.008 * (np.arange(count) % 2),
    }
    estimates = {}
    fired = simulate_shot(rig, tmp_path / "fired", seed=SEEDS[name], shot="s1").files
    for kind, late_steps in written.items():
        (tmp_path / kind).mkdir()
        files = [Path(shutil.copy(file, tmp_path / kind)) for file in fired]
        recorder = next(file for file in files if file.name == "s1_dewetron.csv")
        with_jitter(recorder, late_steps)
        ingested = ingest_files(rig, files, shot="s1", out=tmp_path / f"{kind} shots", on=dt.date(2026, 6, 1))
        assert ingested.shot.usable
        found = identify_shot(FiredShot(ingested.shot, rig), Options())
        assert found.reasons == ()
        estimates[kind] = found.chosen.estimate
        base = ingested.shot.by_role("breech_pressure").time_base
        assert base.rate_hz == pytest.approx(SHORTER["sample_rate_hz"], rel=1e-6)
        assert (base.step_s is None) == (kind != "even")
        if kind != "even":
            (steps,) = (q for q in ingested.shot.quality if (q.channel, q.check) == ("p_breech", "time steps"))
            assert "the stamps jitter by" in steps.detail
            assert not any(repair.repair.kind == "drop-outs masked" for repair in found.route.signals.repairs)
    for kind in ("random", "every second"):
        moved = abs(estimates[kind].mass_kg - estimates["even"].mass_kg)
        assert moved < 0.2 * estimates["even"].u_kg
