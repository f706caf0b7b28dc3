"""The recipes of CONTRIBUTING.md do what they say."""

from __future__ import annotations

import re
import socket
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from recoil_acquisition import conformance
from recoil_acquisition.devices.device import EVENT, Block, event_of
from recoil_acquisition.devices.reader_thread import DeviceReader
from recoil_acquisition.errors import DeviceError
from recoil_acquisition.readers import table
from recoil_acquisition.readers.reader import Declarations, Reader
from recoil_processing.filters import filter_alike

ROOT = Path(__file__).resolve().parents[1]
TEXT = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")


def block(mark: str, name: str) -> str:
    """Return the block below a mark of the page."""
    found = re.search(rf"<!-- {mark}: {name} -->\n```\w+\n(.*?)```", TEXT, re.DOTALL)
    assert found is not None
    return found[1]


def recipe(name: str) -> dict[str, Any]:
    """Execute the block of a recipe as a module, and return its names."""
    names: dict[str, Any] = {"__name__": __name__}
    exec(compile(block("recipe", name), f"CONTRIBUTING.md, {name}", "exec"), names)  # noqa: S102 - our own page
    return names


def vbox(rows: int = 24) -> bytes:
    """Write a file as a VBOX does, at 20 rows a second."""
    head = ["File created on 26/11/2026 at 10:00:00", "", "[column names]", "sats time velocity height", "", "[data]"]
    times = (f"0930{30 + 0.05 * i:05.2f}" for i in range(rows))
    lines = [f"007 {time} {40 + 0.5 * i:07.3f} +{12 + 0.01 * i:.2f}" for i, time in enumerate(times)]
    return "".join(line + "\r\n" for line in (*head, *lines)).encode()


@pytest.fixture
def vbox_reader(monkeypatch: pytest.MonkeyPatch) -> Reader:
    """The row of the recipe, with the recipe for the module that it names."""
    made = SimpleNamespace(**recipe("reader"))
    monkeypatch.setitem(sys.modules, "recoil_acquisition.readers.text.vbox", made)
    row: Reader = eval(block("row", "reader"), vars(table))  # noqa: S307 - our own page
    monkeypatch.setattr(table, "READERS", (*table.READERS, row))
    return row


CUT = conformance.a_cut_file_is_refused_or_shorter_with_a_note
RULES = [pytest.param(one, marks=pytest.mark.exhaustive) if one is CUT else one for one in conformance.RULES]


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.__name__)
def test_the_reader_keeps(rule: Callable[[conformance.Case, Path], None], vbox_reader: Reader, tmp_path: Path) -> None:
    magnitudes = {"velocity": (40.0, 70.0), "height": (12.0, 13.0)}
    declared = Declarations("recorder")
    rule(conformance.Case("vbox", vbox_reader, vbox(), declared, magnitudes, lambda cut: cut.endswith(b"\n")), tmp_path)


def test_the_reader_is_the_one_that_knows_its_file_and_dates_its_rows(vbox_reader: Reader, tmp_path: Path) -> None:
    (tmp_path / "a.vbo").write_bytes(vbox())
    assert table.recognise(tmp_path / "a.vbo") is vbox_reader
    assert recipe("reader")["VboxReader"].name == vbox_reader.name
    recording = vbox_reader.open(tmp_path / "a.vbo", Declarations("recorder"))
    assert [(one.name, one.unit) for one in recording.signals if one.unit] == [("velocity", "km/h"), ("height", "m")]
    base = recording.time_base("velocity")
    assert (base.count, base.rate_hz) == (24, pytest.approx(20.0))
    assert recording.read("velocity")[:2] == pytest.approx([40.0, 40.5])


def test_the_filter_is_one_filter_for_all_columns() -> None:
    gaussian = recipe("filter")["Gaussian"](300.0)
    rng = np.random.default_rng(1)
    acceleration = rng.standard_normal(500)
    table = filter_alike(gaussian, {"acceleration": acceleration, "force": 782.0 * acceleration}, 1e4)
    assert np.allclose(table["force"], 782.0 * table["acceleration"], rtol=1e-12)
    frequency_hz = 400.0
    wave = np.cos(2 * np.pi * frequency_hz / 1e4 * np.arange(500))
    seen = gaussian.apply(wave, 1e4)[100:400]
    assert np.allclose(seen, gaussian.gain(frequency_hz, 1e4) * wave[100:400], atol=1e-9)
    step = gaussian.apply(np.repeat([0.0, 1.0], 250), 1e4)
    reach = gaussian.reach_samples(1e4)
    assert step[249 - reach] < 0.01 < step[250 - reach + 3]


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


@pytest.mark.parametrize("link", sorted(set(re.findall(r"\]\(([^)#]+)\)", TEXT))))
def test_what_the_page_names_is_there(link: str) -> None:
    assert (ROOT / link).exists()
