"""A shot of which a sensor lost all, or all but a sample or two: a report that is not valid, or one clear error."""

from __future__ import annotations

import datetime as dt
import json
import tempfile
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.shot.shot import InputFile, Shot
from recoil_daq.campaigns.sources import CampaignReport
from recoil_daq.recording.ingest import ingest_files
from recoil_daq.reports.identify import reported
from recoil_daq.reports.stored_shot import StoredShot
from recoil_daq.reports.targets import find_target, target_reported
from recoil_identification.campaign.combination import combine
from recoil_identification.report.content.chosen_units import ChosenUnits
from recoil_identification.report.document.report_files import write_document
from recoil_identification.report.figure.figures import report_figures
from recoil_identification.report.page.html import render_page, render_target_page
from recoil_identification.report.paper.paper import report_pdf
from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.identified import Options
from recoil_identification.targets import TARGETS
from recoil_identification.targets.target import Case
from recoil_processing.shot.verdict.shot_quality import check_shot
from recoil_rigs.rig import Rig, load_rig
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.tables.calibration_day import CalibrationDay, DayOf
from recoil_rigs.twin import simulate_shot, with_settings
from tests.builders.virtual_shots import virtual_shot, with_channels

DAY = dt.date(2026, 6, 1)
FILE = InputFile("0001.h5", "0" * 64, 1, "shot file", "HDF5")
NEEDED = ("p_breech", "p_brake", "p_recuperator", "acc_recoil")
"""Channels of the bundled rig that its equation of motion needs a record of."""


@cache
def sled() -> tuple[Shot, Rig]:
    rig = with_settings(load_rig("sled"), {"sample_rate_hz": 5000.0})
    with tempfile.TemporaryDirectory() as folder:
        simulated = simulate_shot(rig, Path(folder) / "files", seed=1, shot="s1")
        return ingest_files(rig, simulated.files, shot="s1", out=Path(folder) / "shots", on=DAY).shot, rig


def lost(shot: Shot, rig: Rig, name: str, present: int) -> StoredShot:
    """Let a channel lose all samples but some in the middle, and judge the shot as ingest would have."""
    whole = np.asarray(shot.channels[name].samples, dtype=np.float64)
    samples, middle = np.full(whole.size, np.nan), whole.size // 2
    samples[middle : middle + present] = whole[middle : middle + present]
    spoilt = with_channels(shot, **{name: samples})
    quality = check_shot(FiredShot(spoilt, rig), spoilt.alignments, {}, CalibrationDay(DAY, DayOf.START))
    return StoredShot(replace(spoilt, quality=quality), rig, None, None, ())


def gun(name: str, present: int) -> StoredShot:
    virtual = virtual_shot("mixed", seed=3)
    return lost(virtual.shot, virtual.rig, name, present)


def is_clear(error: IdentificationError, name: str) -> bool:
    role = {**virtual_shot("mixed", seed=3).shot.channels, **sled()[0].channels}[name].role
    return name in str(error) or role in str(error) or role.replace("_force", "") in str(error)


def all_written(fired: StoredShot, paper: bool = False) -> dict:
    """Return the report of a shot whose page, and paper copy, were drawn too."""
    found = identify_shot(fired, Options())
    document, _ = reported(fired, found, FILE)
    drawn = ChosenUnits.of(document).figures(report_figures(found))
    assert render_page(document, drawn)
    assert not paper or report_pdf(document, drawn)
    return document


# one shot is identified and drawn in each: a second of processor time
@pytest.mark.whole_way
@pytest.mark.parametrize(
    ("name", "present"),
    [
        ("acc_recoil", 0), ("acc_carriage_x", 0), ("acc_carriage_y", 1), ("gyro_tipping", 0),
    ],
)  # fmt: skip
def test_a_mass_without_a_sensor_that_lost_all_is_reported_and_not_valid(name: str, present: int) -> None:
    document = all_written(gun(name, present), paper=name == "acc_carriage_x")
    assert not document["valid"]
    # by the camera alone the accelerometer is not missed, but what it checks is
    assert any((name if name != "acc_recoil" else "accelerometer") in reason for reason in document["reasons"])


@pytest.mark.whole_way
@pytest.mark.parametrize(("name", "present"), [("gyro_carriage", 2), ("x_camera", 1)])
def test_a_mass_that_does_without_a_sensor_that_lost_all_is_valid_and_says_without_which(
    name: str, present: int
) -> None:
    document = all_written(gun(name, present))
    assert document["valid"]
    source = {"gyro_carriage": "gyro_carriage", "x_camera": "camera"}[name]
    assert any(one["code"] == "set aside" and source in one["text"] for one in document["findings"])


@pytest.mark.whole_way
@pytest.mark.parametrize("present", [0, 1, 2])
@pytest.mark.parametrize("name", NEEDED)
def test_a_side_of_the_equation_that_lost_all_is_named_and_gives_no_mass(name: str, present: int) -> None:
    if (name, present) == ("acc_recoil", 0):
        pytest.skip("then the camera gives the mass")
    with pytest.raises(IdentificationError) as refused:
        identify_shot(gun(name, present), Options())
    assert is_clear(refused.value, name)


@pytest.mark.whole_way
@pytest.mark.parametrize(
    ("name", "present"),
    [("f_push", 0), ("f_push", 1), ("f_brake", 2), ("acc_sled", 0), ("acc_sled", 1), ("v_sled", 0)],
)
def test_a_line_that_lost_a_sensor_is_reported_not_valid_or_refused_by_its_name(name: str, present: int) -> None:
    shot, rig = sled()
    fired = lost(shot, rig, name, present)
    if name.startswith("f_"):
        with pytest.raises(IdentificationError) as refused:
            identify_shot(fired, Options())
        assert is_clear(refused.value, name)
    else:
        assert not all_written(fired)["valid"]


@pytest.mark.whole_way
def test_a_line_does_without_a_travel_that_lost_all() -> None:
    document = all_written(lost(*sled(), "x_sled", 2))
    assert document["valid"]
    assert any(one["code"] == "set aside" for one in document["findings"])


@cache
def case(name: str) -> Case:
    return Case(gun(name, 1))


# the longest of the targets, breech-force, has its own test of failed checks
@pytest.mark.whole_way
@pytest.mark.parametrize("target", [target for target in TARGETS if target != "breech-force"])
@pytest.mark.parametrize("name", ["acc_recoil", "acc_carriage_x", "gyro_tipping", "p_brake"])
def test_no_target_of_a_lost_sensor_is_valid(target: str, name: str) -> None:
    fired = case(name).fired
    assert isinstance(fired, StoredShot)
    if name in NEEDED or target not in ("resistance", "arx"):
        with pytest.raises(IdentificationError) as refused:
            find_target(target, fired, case(name))
        assert is_clear(refused.value, name)
        return
    found = find_target(target, fired, case(name))
    document, _ = target_reported(fired, found, FILE, Options())
    assert render_target_page(document, ChosenUnits.of(document).figures(found.figures))
    assert not document["valid"]
    assert any(name in reason for reason in document["reasons"])


@pytest.mark.whole_way
def test_a_campaign_sets_such_shots_aside_or_says_that_too_few_are_left(tmp_path: Path) -> None:
    shots = []
    for name in ("gyro_tipping", "acc_carriage_x"):
        fired = case(name).fired
        assert isinstance(fired, StoredShot)
        document, _ = reported(fired, case(name).identified, FILE)
        folder = tmp_path / name
        folder.mkdir()
        shots.append(CampaignReport.read(write_document(folder, {**document, "shot": name})).shot())
        assert json.dumps(document, allow_nan=False)
    with pytest.raises(IdentificationError, match="two shots that can be used"):
        combine(shots)
