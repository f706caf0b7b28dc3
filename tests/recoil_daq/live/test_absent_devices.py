"""A device that cannot be opened: the range is armed without one that may stay away, and with no other."""

from __future__ import annotations

from pathlib import Path

import pytest

from recoil_acquisition.errors import DeviceError
from recoil_daq.live.device_check import check_devices
from recoil_daq.live.range import opened
from recoil_rigs.rig import Rig, load_rig, parse_rig
from recoil_rigs.shots.live_sources import live_sources


@pytest.fixture
def rig(tmp_path: Path) -> Rig:
    """Return a rig of a bus that is there and a port that is not."""
    mixed = load_rig("mixed")
    text = mixed.text.replace('device = { virtual = "virtual" }', 'device = { interface = "virtual", channel = "q" }')
    text = text.replace('device = { virtual = "pty" }', f'device = {{ port = "{tmp_path}/none", baudrate = 9600 }}')
    (tmp_path / "rig.toml").write_text(text, encoding="utf-8")
    (tmp_path / "mixed.dbc").write_text(mixed.databases["mixed.dbc"], encoding="utf-8")
    return parse_rig(text, tmp_path / "rig.toml", dict(mixed.databases))


def test_a_port_that_may_stay_away_keeps_no_range_from_being_armed(rig: Rig) -> None:
    told: list[str] = []
    with opened(live_sources(rig), {"imu"}, told.append) as devices:
        assert list(devices) == ["can"]
    (text,) = told
    assert text.startswith("armed without imu, which may stay away: ")
    with pytest.raises(DeviceError, match="source 'imu'"), opened(live_sources(rig)):
        pass


@pytest.mark.real_time
def test_a_check_of_the_devices_warns_of_a_port_that_may_stay_away(rig: Rig) -> None:
    head = '[[source]]\nname = "imu"\n'
    for required, verdict in (("", "fail"), ("required = false\n", "warn")):
        text = rig.text.replace(head, f"{head}{required}")
        heard = check_devices(parse_rig(text, rig.path, dict(rig.databases)), listen_s=0.1)
        assert [one.verdict for one in heard if one.source == "imu"] == [verdict]
