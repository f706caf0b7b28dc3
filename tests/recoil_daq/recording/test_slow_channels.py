"""A channel that is slower than its table: show, init, check and ingest say the same rate of it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from recoil_rigs.twin import TwinShot

SLOWER = 5
P_BREECH = 4
SAID = f"1 of {SLOWER} rows holds a sample, from row 1 on: that is its rate, no loss"


def with_slow_gauge(shot: TwinShot, folder: Path) -> list[Path]:
    """Leave the breech pressure's cells empty in four of five rows."""
    table = next(file for file in shot.files if file.name.endswith("_dewetron.csv"))
    head, *rows = table.read_text("utf-8").rstrip("\n").split("\n")
    slow = [
        row if k % SLOWER == 0 else ",".join(cell if i != P_BREECH else "" for i, cell in enumerate(row.split(",")))
        for k, row in enumerate(rows)
    ]
    (folder / table.name).write_text("\n".join([head, *slow, ""]), encoding="utf-8")
    return [folder / table.name, *(file for file in shot.files if file != table)]


@pytest.mark.whole_way
def test_a_slow_channel_has_one_rate_in_all_commands(run, mixed_shot: TwinShot, tmp_path: Path) -> None:
    table, *others = with_slow_gauge(mixed_shot, tmp_path)
    shown = json.loads(run("show", table, "--json").stdout)
    (signal,) = [one for one in shown["signals"] if one["name"] == "AI 4/p_breech"]
    assert (signal["samples"], signal["rate_hz"]) == (1750, 5000.0)
    assert any(SAID in note for note in shown["notes"])
    checked = json.loads(run("check", mixed_shot.rig_file, table, *others, "--json").stdout)
    (row,) = [c for file in checked["files"] for c in file["channels"] if c["name"] == "p_breech"]
    assert (row["samples"], row["rate_hz"]) == (1750, 5000.0)
    assert any(SAID in note for note in checked["notes"])
    drafted = json.loads(run("init", table, *others, "--out", tmp_path / "rig.toml", "--json").stdout)
    assert any(SAID in note for note in drafted["notes"])
    ingested = json.loads(run("ingest", mixed_shot.rig_file, table, *others, "--out", tmp_path, "--json").stdout)
    (channel,) = [one for one in ingested["channels"] if one["name"] == "p_breech"]
    assert (channel["samples"], channel["rate_hz"]) == (1750, 5000.0)
