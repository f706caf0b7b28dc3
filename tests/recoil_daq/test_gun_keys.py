"""Each key of a gun's rig that states an uncertainty changes a number of the shot, or `check` says that it does not."""

from __future__ import annotations

import copy
import datetime as dt
import tomllib
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from recoil_acquisition.errors import RecoilDaqError, RigError
from recoil_acquisition.shot.shot import Shot
from recoil_daq.recording.ingest import ingest_files
from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.identified import Options
from recoil_identification.targets import target_function
from recoil_identification.targets.target import Case
from recoil_rigs.rig import find_rig, parse_rig
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.tables.channel_table import Sensor
from recoil_rigs.tables.rig_tables import FixedAlignment, Source
from recoil_rigs.twin import simulate_shot
from tests.builders.rig_variants import bundled_tables, toml_of
from tests.builders.tracked_rigs import tracked_rig
from tests.builders.virtual_shots import SHORTER

Tables = dict[str, Any]
Numbers = tuple[float, ...]
TOLD_ELSEWHERE = {
    "u_carried_mass": "the specification that the mass is compared with",
    "acc_recoil_can.u_rel": "a certificate states it; docs/rig-keys.md: where the role enters the estimate",
    "acc_carriage_can.u_rel": "as of acc_recoil_can",
    "imu_acc_x.u_rel": "as of acc_recoil_can",
}
"""Keys that change no digit, and what they are for."""
OF_SENSORS = {
    "u_rel": 0.02, "u_delay_s": 1e-3, "u_zero_rel": 0.02, "u_linearity_rel": 0.01, "u_distortion_m": 1e-3,
    "u_gain": 0.02, "u_time_constant_s": 1.0,
}  # fmt: skip
"""Keys of a sensor, and what is tried where the rig leaves them out or states nothing."""
OF_MECHANISMS = {
    "u_slide_friction": 20.0, "u_bore_friction": 0.01, "u_unread_share": 0.03, "unread_force": 0.005,
    "u_muzzle_brake": 0.05, "u_carried_mass": 1.0,
}  # fmt: skip
"""The same of a mechanism, of values that are zero where a rig is silent."""


def tables_of(name: str) -> Tables:
    if name.startswith("tracked "):
        return tomllib.loads(tracked_rig(name.removeprefix("tracked "), unread_errors=False).text)
    return copy.deepcopy(bundled_tables(name))


def moved(tables: Tables) -> Iterator[tuple[str, Tables, Tables]]:
    """Yield a name of each key of an uncertainty, the tables before, and with it moved."""
    mechanism = tables["mechanism"]
    stated = {f"u_{key}": 0.01 * abs(value) or 1e-4 for key, value in mechanism.items() if not key.startswith("u_")}
    for key, size in (stated | OF_MECHANISMS).items():
        if not key.startswith("u_u") or key == "u_unread_share":
            yield key, tables, with_value(tables, ("mechanism", key), 2.0 * mechanism.get(key, 0.0) or size)
    for at, channel in enumerate(tables["channel"]):
        for key, size in OF_SENSORS.items():
            before = tables
            if key == "u_time_constant_s":
                before = with_value(tables, ("channel", at, "sensor", "time_constant_s"), 5.0)
            value = 2.0 * channel["sensor"].get(key, 0.0) or size
            yield f"{channel['name']}.{key}", before, with_value(before, ("channel", at, "sensor", key), value)
    for at, source in enumerate(tables["source"]):
        if source["kind"] == "camera":
            yield f"{source['name']}.u_frame_rate", tables, with_value(tables, ("source", at, "u_frame_rate"), 60.0)


def with_value(tables: Tables, place: tuple[str | int, ...], value: float) -> Tables:
    other = copy.deepcopy(tables)
    holder: Any = other
    for step in place[:-1]:
        holder = holder[step]
    holder[place[-1]] = value
    return other


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", ["mixed", "field-2013", "tracked mixed"])
def test_each_stated_uncertainty_of_a_gun_changes_something_or_is_said_to_change_nothing(
    name: str, tmp_path: Path
) -> None:
    tables, path = tables_of(name), find_rig(name.removeprefix("tracked "))
    tables["twin"] |= SHORTER
    files = simulate_shot(parse_rig(toml_of(tables), path), tmp_path / "files", seed=3, shot="1").files
    # what is virtual is no key of a stand
    tables = {key: table for key, table in tables.items() if key != "twin"}
    numbers = iter(range(1000))

    @cache
    def shot_of(rig_text: str) -> Shot:
        folder = tmp_path / f"{next(numbers)}"
        return ingest_files(parse_rig(rig_text, path), files, shot="1", out=folder, on=dt.date(2026, 6, 1)).shot

    @cache
    def mass_of(rig_text: str, ingested_by: str) -> Numbers:
        estimate = identify_shot(FiredShot(shot_of(ingested_by), parse_rig(rig_text, path)), Options()).chosen.estimate
        return estimate.mass_kg, estimate.u_kg

    @cache
    def stiffness_of(rig_text: str, ingested_by: str) -> Numbers:
        found = target_function("stiffness")(Case(FiredShot(shot_of(ingested_by), parse_rig(rig_text, path))))
        return tuple(number for one in found.quantities for number in (one.value, one.u))

    def changes(rig: str, other: str, of_mechanism: bool) -> bool:
        """Ask the cheap way first: the same shot, the carriage's supports, the files read anew."""

        def apart(ask: Callable[[str, str], Numbers], ingested_by: str) -> bool:
            return ask(rig, rig) != pytest.approx(ask(other, ingested_by), rel=1e-12, abs=0.0, nan_ok=True)

        try:
            return apart(mass_of, rig) or (of_mechanism and apart(stiffness_of, rig)) or apart(mass_of, other)
        except RecoilDaqError:  # a clock that is hardly known tells no mass
            return True

    untold = []
    for key, before, after in moved(tables):
        last = key.rpartition(".")[2]
        try:
            foreign = parse_rig(toml_of(after), path).foreign_keys
        except RigError:  # the file says that no such rig has it
            continue
        told = any(fault.parts[-1] == last for fault in foreign) or key in TOLD_ELSEWHERE
        if not told and not changes(toml_of(before), toml_of(after), "." not in key):
            untold.append(key)
    assert untold == []


def test_the_law_asks_for_every_key_of_an_uncertainty() -> None:
    of_standards = {"u_reference_rel"}  # a part of `u_rel`
    asked = {*OF_SENSORS, *of_standards}
    assert {key for key in Sensor.model_fields if key.startswith("u_")} <= asked
    assert {key for key in Source.model_fields if key.startswith("u_")} == {"u_frame_rate"}
    assert {key for key in FixedAlignment.model_fields if key.startswith("u_")} == {"u_offset_s", "u_drift"}
