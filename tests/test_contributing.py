"""The recipes of CONTRIBUTING.md do what they say."""

from __future__ import annotations

import re
import socket
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from recoil_acquisition.devices.device import EVENT, Block, event_of
from recoil_acquisition.devices.reader_thread import DeviceReader
from recoil_acquisition.errors import DeviceError
from recoil_identification.targets.target import Case
from recoil_processing.filters import filter_alike
from recoil_rigs.shots.fired_shot import FiredShot
from tests.builders.virtual_shots import virtual_shot

ROOT = Path(__file__).resolve().parents[1]
TEXT = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")


def recipe(name: str) -> dict[str, Any]:
    """Execute the block of a recipe as a module, and return its names."""
    found = re.search(rf"<!-- recipe: {name} -->\n```python\n(.*?)```", TEXT, re.DOTALL)
    assert found is not None
    names: dict[str, Any] = {"__name__": __name__}
    exec(compile(found[1], f"CONTRIBUTING.md, {name}", "exec"), names)  # noqa: S102 - our own page
    return names


def test_the_filter_is_one_filter_for_all_columns() -> None:
    average = recipe("filter")["MovingAverage"](3)
    rng = np.random.default_rng(1)
    acceleration = rng.standard_normal(500)
    table = filter_alike(average, {"acceleration": acceleration, "force": 782.0 * acceleration}, 1e4)
    assert np.allclose(table["force"], 782.0 * table["acceleration"], rtol=1e-12)
    frequency_hz = 800.0
    wave = np.cos(2 * np.pi * frequency_hz / 1e4 * np.arange(500))
    seen = average.apply(wave, 1e4)[100:400]
    assert np.allclose(seen, average.gain(frequency_hz, 1e4) * wave[100:400], atol=1e-12)


def test_the_device_hands_on_every_datagram_and_its_own_beginning_and_end() -> None:
    device = recipe("device")["UdpDevice"]("scale", 0)
    device.open()
    blocks: list[Block] = []
    sent = [bytes([n]) * (n + 1) for n in range(200)]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender, DeviceReader(device, blocks.append):
        for data in sent:
            sender.sendto(data, ("127.0.0.1", device.port))
    assert [block.payload for block in blocks if block.is_data] == sent
    assert [event_of(block).name for block in blocks if block.kind == EVENT] == ["opened", "closed"]
    assert device.counters.received == sum(map(len, sent))
    assert all(block.empty_ns <= block.host_ns for block in blocks if block.is_data)
    assert device.close() == ()


def test_a_port_of_the_device_that_is_taken_is_said_in_one_line() -> None:
    made = recipe("device")["UdpDevice"]
    first = made("scale", 0)
    first.open()
    with pytest.raises(DeviceError, match=f"source 'second': UDP port {first.port} cannot be opened"):
        made("second", first.port).open()
    first.close()


def test_the_target_finds_its_number() -> None:
    virtual = virtual_shot(seed=3)
    (peak,) = recipe("target")["find"](Case(FiredShot(virtual.shot, virtual.rig))).quantities
    gauge = virtual.shot.by_role("breech_pressure")
    assert gauge is not None
    assert peak.value == pytest.approx(1e-6 * float(np.nanmax(gauge.samples)))
    assert 100.0 < peak.value < 160.0


@pytest.mark.parametrize("link", sorted(set(re.findall(r"\]\(([^)#]+)\)", TEXT))))
def test_what_the_page_names_is_there(link: str) -> None:
    assert (ROOT / link).exists()
