"""Every command on the bundled rigs without each optional key, channel and source in turn: never a traceback.

`RECOIL_DAQ_TARGETS=0` leaves out the other methods and the targets beside the mass, which take most of the time.
"""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest

from recoil_acquisition.errors import RigError
from recoil_rigs.rig import find_rig, parse_rig
from recoil_rigs.twin import simulate_shot
from tests.builders.rig_variants import bundled_tables, toml_of, variants
from tests.builders.virtual_shots import SHORTER, with_twin
from tests.builders.whole_way import whole_way

TARGETS = os.environ.get("RECOIL_DAQ_TARGETS", "1") != "0"


@pytest.mark.parametrize("name", ["field-2013", "mixed"])
def test_no_key_that_may_lack_stops_a_command(name: str, tmp_path: Path) -> None:
    rig = with_twin(name, **SHORTER)
    files = [
        simulate_shot(rig, tmp_path / f"{k}", seed=k, shot=f"000{k}", campaign_seed=3).files for k in (1, 2)
    ]  # fmt: skip
    faults, taken, refused = [], [], []
    for what, tables in variants(bundled_tables(name)):
        folder = tmp_path / "way"
        folder.mkdir()
        shutil.copy(find_rig("mixed").with_suffix(".dbc"), folder)
        (folder / "rig.toml").write_text(toml_of(tables), encoding="utf-8")
        try:
            parse_rig(toml_of(tables), folder / "rig.toml")
        except RigError:
            refused.append(what)
        else:
            sources = [source["match"].strip("*.csv") for source in tables["source"] if "match" in source]
            given = [[one for one in shot if any(part in one.name for part in sources)] for shot in files]
            whole = len(sources) == len(tables["source"])
            done = list(whole_way(folder / "rig.toml", given if whole else files, folder, all_targets=TARGETS))
            faults += [f"without {what}: {' '.join(one.words)}: {one.fault}" for one in done if one.fault]
            taken.append(what)
            codes = " ".join(str(one.exit_code) for one in done)
            print(f"{name} without {what}: {codes}", flush=True)
        shutil.rmtree(folder)
    print(f"{name}: {len(taken)} variants taken, {len(refused)} refused by the rig file's check")
    assert faults == []
    assert len(taken) > len(refused) / 2
