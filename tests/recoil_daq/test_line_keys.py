"""Each key of a line's rig that states an uncertainty changes the mass or its u, or `check` says that it does not."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from recoil_acquisition.errors import IdentificationError
from recoil_rigs.rig import parse_rig
from recoil_rigs.twin import simulate_shot
from tests.builders.line_shots import identified
from tests.builders.rig_variants import bundled_tables, toml_of

Tables = dict[str, Any]
TOLD_ELSEWHERE = {
    "u_carried_mass": "the specification that the mass is compared with",
    "v_sled.u_rel": "only where friction points hangs on a speed beside an accelerometer: docs/line-rigs.md",
    "x_sled.u_rel": "nothing hangs on a travel beside both: docs/line-rigs.md",
    "acc_sled.u_zero_rel": "a record that begins in motion: here the rest tells the zero",
    "x_sled.u_distortion_m": "the clock of a travel that nothing else hangs on",
}
"""Keys that change no digit of either, and what they are for."""
ADDED = {"u_delay_s": 1e-3, "u_zero_rel": 0.02}
"""Keys that are tried where the rig leaves them out."""


def tables_of(rig: str) -> Tables:
    if rig == "sled":
        return dict(bundled_tables("sled"))
    import tomllib

    page = (Path(__file__).parents[2] / "docs" / "line-rigs.md").read_text(encoding="utf-8")
    return tomllib.loads(page.partition(f"<!-- {rig} -->\n```toml\n")[2].partition("```")[0])


def moved(tables: Tables) -> Iterator[tuple[str, Tables]]:
    """Yield a name of each key of an uncertainty, and the tables with it moved."""
    for key in tables["mechanism"]:
        if key.startswith("u_"):
            other = copy.deepcopy(tables)
            other["mechanism"][key] = 2.0 * other["mechanism"][key] or 1e-3
            yield key, other
    for number, channel in enumerate(tables["channel"]):
        stated = [key for key in channel["sensor"] if key.startswith("u_") and key != "u_reference_rel"]
        for key in dict.fromkeys([*stated, *ADDED]):
            other = copy.deepcopy(tables)
            sensor = other["channel"][number]["sensor"]
            sensor[key] = 2.0 * sensor.get(key, 0.0) or ADDED.get(key, 1e-3)
            yield f"{channel['name']}.{key}", other


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", ["sled", "cell and camera", "cell and servo"])
def test_each_stated_uncertainty_changes_something_or_is_said_to_change_nothing(name: str, tmp_path: Path) -> None:
    tables = tables_of(name)
    if name == "sled":
        tables["twin"] = {**tables["twin"], "sample_rate_hz": 2000.0}
    twin = parse_rig(toml_of(tables), Path("rig.toml"))
    files = simulate_shot(twin, tmp_path / "files", seed=1, shot="1").files
    # what is virtual is no key of a stand
    tables = {key: table for key, table in tables.items() if key != "twin"}

    def answer(stated: Tables, folder: str) -> tuple[float, float]:
        try:
            estimate = identified(
                parse_rig(toml_of(stated), Path("rig.toml")), files, tmp_path / folder
            ).chosen.estimate
        except IdentificationError:  # a clock that is hardly known tells no mass
            return 0.0, 0.0
        return estimate.mass_kg, estimate.u_kg

    before, idle = answer(tables, "before"), []
    for number, (key, other) in enumerate(moved(tables)):
        if answer(other, f"{number}") == pytest.approx(before, rel=1e-12):
            idle.append((key, parse_rig(toml_of(other), Path("rig.toml"))))
    untold = []
    for key, rig in idle:
        last = key.rpartition(".")[2]
        told = any(f"{last}: changes no mass" in str(fault) for fault in rig.foreign_keys)
        if not told and key not in TOLD_ELSEWHERE:
            untold.append(key)
    assert untold == []
