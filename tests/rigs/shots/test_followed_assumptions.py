"""What an assumption asks to be stated is stated, and is no assumption any more."""

from __future__ import annotations

import datetime as dt
import re
from typing import Any

import pytest

from recoil_rigs.rig import find_rig, parse_rig
from recoil_rigs.shots.assumptions import assumptions_of
from tests.builders.rig_variants import bare, bundled_tables, toml_of

VALUES: dict[str, Any] = {
    "u_bore_area": 1e-6, "u_brake_area": 1e-6, "u_recuperator_area": 1e-6, "u_friction": 150.0, "bore_friction": 0.01,
    "u_bore_friction": 0.003, "unread_share": 0.0, "u_unread_share": 0.01, "slide_friction": 10.0,
    "u_slide_friction": 5.0, "carried_mass": 0.0, "u_carried_mass": 0.0, "unread_force": 0.002, "muzzle_brake": 0.0,
    "u_muzzle_brake": 0.0, "tube_axial_hz": 60.0, "u_linearity_rel": 0.0,
    "gauge_ahead": {"chamber_length_m": 0.4, "projectile_mass_kg": 10.0, "u_share": 0.01},
    "u_zero_rel": 0.001, "delay_s": 0.0, "u_delay_s": 2e-5, "reference": "deadweight 7", "u_distortion_m": 1e-4,
    "calibrated": dt.date(2026, 1, 15), "calibration": "static",
}  # fmt: skip


@pytest.mark.parametrize("name", ["field-2013", "mixed"])
def test_what_is_asked_for_is_taken_and_asked_for_no_more(name: str) -> None:
    tables, path = bare(bundled_tables(name)), find_rig(name)
    channels = {one["name"]: one for one in tables["channel"]}
    followed = set()
    while True:
        asked = [
            (one, keys)
            for one in assumptions_of(parse_rig(toml_of(tables), path))
            if (keys := [key for key in re.findall(r"\w+", one["detail"]) if key in VALUES])
        ]
        if not asked:
            break
        one, keys = asked[0]
        holder = channels[one["quantity"]]["sensor"] if one["quantity"] in channels else tables["mechanism"]
        said = str(one)
        assert said not in followed, f"{said} is said again although it was followed"
        followed.add(said)
        holder |= {key: VALUES[key] for key in keys}
    assert len(followed) > 4
    # what is left is no key: a sensor that is not there
    assert {one["taken"] for one in assumptions_of(parse_rig(toml_of(tables), path))} <= {"not measured"}
