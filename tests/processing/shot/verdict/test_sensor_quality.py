"""A sensor that may be another channel's, and a file that may be another shot's, are asked about."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

from recoil_acquisition.shot.quality_check import Check, QualityCheck
from recoil_processing.shot.verdict.sensor_quality import check_sensors
from recoil_rigs.rig import parse_rig
from recoil_rigs.shots.fired_shot import FiredShot
from tests.builders.virtual_shots import VirtualShot, virtual_shot


def asked(virtual: VirtualShot, text: str) -> dict[str, list[str]]:
    """Return what is asked of the channels of a shot on a rig of another text."""
    rig = parse_rig(text, virtual.rig.path, virtual.rig.databases)
    found: dict[str, list[str]] = {}
    for check in check_sensors(FiredShot(virtual.shot, rig), virtual.shot.alignments):
        assert (check.check, check.verdict) == (Check.SENSOR, "warn")
        found.setdefault(check.channel, []).append(check.detail)
    return found


def exchanged(text: str, one: str, other: str) -> str:
    """Exchange two lines, or parts of them."""
    assert one in text
    assert other in text
    return text.replace(one, "@@").replace(other, one).replace("@@", other)


@pytest.mark.whole_way
@pytest.mark.parametrize("name", ["field-2013", "mixed"])
def test_nothing_is_asked_of_sound_rigs(name: str) -> None:
    virtual = virtual_shot(name)
    assert asked(virtual, virtual.rig.text) == {}


@pytest.mark.parametrize(("gauge", "channel"), [("V301", "p_breech"), ("V302", "p_brake"), ("V303", "p_recuperator")])
def test_exchanged_tables_of_a_gauge_and_an_accelerometer_are_asked_about(gauge: str, channel: str) -> None:
    virtual = virtual_shot("mixed")
    lines = [re.search(rf'sensor = {{[^\n]*"{serial}"[^\n]*', virtual.rig.text)[0] for serial in ("V101", gauge)]
    found = asked(virtual, exchanged(virtual.rig.text, *lines))
    assert set(found) == {"acc_recoil", channel}
    assert any("`position` says nothing of a sensor of pressure" in text for text in found[channel])


def test_a_gauges_serial_and_range_on_an_accelerometer_are_asked_about() -> None:
    virtual = virtual_shot("mixed")
    text = exchanged(virtual.rig.text, 'serial = "V101"', 'serial = "V302"')
    text = text.replace("range = [-1.6, 16.0]", "range = [-5000.0, 5000.0]")
    stated = '"V302", calibrated = 2026-01-15, due = 2099-12-31, u_rel = 0.005, range = '
    text = text.replace(f"{stated}[-5000.0, 5000.0]", f"{stated}[-1.6, 16.0]")
    found = asked(virtual, text)
    assert set(found) == {"acc_recoil", "p_brake"}
    assert "are the `sensor` tables of p_brake and acc_recoil exchanged?" in found["p_brake"][0]


def test_exchanged_tables_of_two_gauges_are_asked_about_and_no_other_that_would_fit() -> None:
    virtual = virtual_shot("mixed")
    lines = [re.search(rf'sensor = {{[^\n]*"{serial}"[^\n]*', virtual.rig.text)[0] for serial in ("V301", "V302")]
    found = asked(virtual, exchanged(virtual.rig.text, *lines))
    assert {name: len(said) for name, said in found.items()} == {"p_breech": 1, "p_brake": 1}


def test_exchanged_ranges_of_two_gauges_are_asked_about() -> None:
    virtual = virtual_shot("mixed")
    assert set(asked(virtual, exchanged(virtual.rig.text, "[-1.6, 16.0]", "[-0.6, 6.0]"))) == {
        "p_brake",
        "p_recuperator",
    }


def test_a_peak_beyond_a_range_that_two_channels_have_is_no_exchange() -> None:
    virtual = virtual_shot("mixed")
    assert asked(virtual, virtual.rig.text.replace("[-1.6, 16.0]", "[-0.6, 6.0]")) == {}


def test_a_gyro_of_a_generous_range_is_not_taken_for_an_accelerometer() -> None:
    virtual = virtual_shot("mixed")
    generous = re.sub(r'("V501"[^\n]*range = )\[-1.0, 1.0\]', r"\1[-35.0, 35.0]", virtual.rig.text)
    assert generous != virtual.rig.text
    assert asked(virtual, generous) == {}


def test_a_channel_that_repeats_another_by_too_little_is_asked_about() -> None:
    virtual = virtual_shot("mixed")
    fired = FiredShot(virtual.shot, virtual.rig)

    def said(gain: float) -> list[QualityCheck]:
        imu = virtual.shot.alignment("imu")
        return list(check_sensors(fired, [replace(imu, details={**(imu.details or {}), "gain": gain, "u_gain": 0.01})]))

    assert said(0.96) == []
    (check,) = said(0.92)
    assert (check.channel, check.check, check.verdict) == ("imu_acc_x", Check.SECOND_SENSOR, "warn")
    assert "is the file of imu that of another shot" in check.detail
