"""Gauges whose range begins at 0, as certificates have it, are as good as with room below it."""

from __future__ import annotations

import datetime as dt

import pytest

from recoil_daq.recording.ingest import ingest_files
from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.identified import Options
from recoil_rigs.rig import parse_rig
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.twin import simulate_shot
from tests.builders.virtual_shots import SHORTER, with_twin

RANGES = {"[-25.0, 250.0]": "[0, 250]", "[-1.6, 16.0]": "[0, 16]", "[-0.6, 6.0]": "[0, 6]"}


@pytest.mark.whole_way
@pytest.mark.parametrize(("name", "seed"), [("field-2013", 3), ("mixed", 4)])
def test_a_range_from_zero_changes_neither_verdict_nor_mass(name, seed, tmp_path):
    rig = with_twin(name, **SHORTER)
    text = rig.text
    for wide, one_sided in RANGES.items():
        assert f"range = {wide}" in text
        text = text.replace(f"range = {wide}", f"range = {one_sided}")
    files = simulate_shot(rig, tmp_path / "files", seed=seed, shot="s1").files
    found = []
    for one in (rig, parse_rig(text, rig.path, rig.databases)):
        out = tmp_path / f"shots {len(found)}"
        shot = ingest_files(one, files, shot="s1", out=out, on=dt.date(2026, 6, 1)).shot
        assert shot.usable
        identification = identify_shot(FiredShot(shot, one), Options())
        assert identification.reasons == ()
        estimate = identification.chosen.estimate
        found.append((estimate.mass_kg, estimate.u_kg, [(q.channel, q.check, q.verdict) for q in shot.quality]))
        (ranged,) = (q.detail for q in shot.quality if (q.channel, q.check) == ("p_breech", "range"))
    assert found[0] == found[1]
    assert ranged.startswith("peak uses 5")
    assert ranged.endswith("% of the range [0, 250] MPa")
