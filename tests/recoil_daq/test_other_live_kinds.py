"""A kind of live source of another package: declared in a rig, recorded, cut and read with no line changed here."""

from __future__ import annotations

import importlib.metadata
import re
import socket
import time
import tomllib
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from importlib.metadata import EntryPoint, EntryPoints
from pathlib import Path

import pytest

from recoil_acquisition.capture.live_session import LiveSession
from recoil_acquisition.capture.live_source import LiveSource, open_source
from recoil_acquisition.capture.session_record import LiveRecord, RecordedSource
from recoil_acquisition.capture.status import SourceStatus
from recoil_acquisition.clocks.host_clock import anchor
from recoil_acquisition.devices.device import Device
from recoil_acquisition.devices.tick_clock import TICK_ANCHORS
from recoil_acquisition.errors import DeviceError, ReadError, RigError
from recoil_acquisition.log.folder import open_log
from recoil_acquisition.log.record import Kind
from recoil_acquisition.packages import others
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.table import recognise
from recoil_acquisition.trigger import Edge, ShotWindow, Trigger
from recoil_daq.live import device_check
from recoil_daq.live.device_check import ChannelHeard, check_devices
from recoil_daq.recording.ingest import match_sources
from recoil_rigs.rig import Rig, load_rig, parse_rig
from recoil_rigs.shots.live_sources import live_sources, told_by
from tests.builders import vendor_files
from tests.other_package import recoil_lines
from tests.other_package.recoil_lines import LinesDevice

GROUP = "recoil_daq.live_kinds"
DECLARED = """
[[source]]
name = "wind"
kind = "recorder"
device = { lines = 0, rate_hz = 1000, units = { v = "km/h", t = "K" } }
align = { method = "fixed", offset_s = 0.0 }

[[channel]]
name = "wind"
source = "wind"
signal = "v"
quantity = "velocity"
unit = "km/h"
"""
TRIGGER = Trigger((Edge("wind", 10.0, rearm=8.0),), "any", pre_s=0.2, post_s=0.3)


def with_wind() -> Rig:
    mixed = load_rig("mixed")
    return parse_rig(mixed.text + DECLARED, mixed.path, mixed.databases)


@contextmanager
def announced() -> Iterator[None]:
    """Have the example package installed."""
    project = Path(__file__).resolve().parents[1] / "other_package" / "pyproject.toml"
    entries = tomllib.loads(project.read_text("utf-8"))["project"]["entry-points"][GROUP]
    points = [EntryPoint(name, f"tests.other_package.{value}", GROUP) for name, value in entries.items()]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            importlib.metadata, "entry_points", lambda group: EntryPoints(p for p in points if p.group == group)
        )
        others.offered.cache_clear()
        others.announced.cache_clear()
        yield
    others.offered.cache_clear()
    others.announced.cache_clear()


@pytest.fixture
def lines() -> Iterator[None]:
    with announced():
        yield


def live_wind(rig: Rig, devices: Mapping[str, Device] | None = None) -> LiveSource:
    """The source as it is declared, or as its open device tells it."""
    told = None if devices is None else told_by(live_sources(rig), devices)
    return next(source for source in live_sources(rig, None, told) if source.name == "wind")


@dataclass(frozen=True)
class Day:
    """What was recorded of an instrument that sent 5 m/s for a while and then 20 m/s."""

    window: ShotWindow
    status: SourceStatus
    captured: Path
    journal: Path


@pytest.fixture(scope="module")
def day(tmp_path_factory: pytest.TempPathFactory) -> Day:
    folder = tmp_path_factory.mktemp("lines")
    with announced():
        rig = with_wind()
        device = open_source(live_wind(rig))
        wind = live_wind(rig, {"wind": device})
        assert isinstance(device, LinesDevice)
        sources = (RecordedSource.of(wind.name, wind.kind, wind.device),)
        record = LiveRecord("mixed", rig.text, "rig.toml", {}, anchor(), sources)
        session = LiveSession(record, [wind], {"wind": device}, TRIGGER, folder / "journal", reserve_bytes=0)
        session.start()
        session.arm()
        window = None
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as instrument:
            began_s = time.monotonic()
            for i in range(1000):
                tick = round(1000 * (time.monotonic() - began_s))
                text = f"v={18.0 if i < 100 else 72.0}@{tick}\nt=2{i}@{tick}\n".encode()
                for part in (text[:5], text[5:]):  # a line may come in two pieces
                    instrument.sendto(part, ("127.0.0.1", device.port))
                window = session.next_window(0.01)
                if window is not None:
                    break
        assert window is not None
        status = session.status.sources[0]
        captured = session.cut("0001", window, folder / "0001.rdlog")
        session.release(window)
        session.close(complete=False)
    return Day(window, status, captured.path, folder / "journal")


def test_a_key_of_a_package_that_is_not_installed_chooses_no_kind() -> None:
    with pytest.raises(RigError, match=r"`device` has `lines`, .*, of which none chooses a kind: there is `oxygen`"):
        with_wind()


@pytest.mark.usefixtures("lines")
@pytest.mark.parametrize(
    ("member", "raised", "says"),
    [
        (
            "__init__",
            KeyError("unit"),
            "the live kind 'lines' of another package does not work; found KeyError: 'unit'",
        ),
        ("read", DeviceError("the server closed the connection"), "its device has stopped: the server closed"),
        ("read", KeyError("boom"), "its device has stopped: KeyError: 'boom'"),
    ],
)
def test_a_device_of_another_package_that_does_not_work_fails_the_check(monkeypatch, member, raised, says) -> None:
    def fails(*_: object) -> None:
        raise raised

    monkeypatch.setattr(LinesDevice, member, fails)
    monkeypatch.setattr(device_check, "SETTLE_S", 0.0)
    found = [one for one in checked_wind() if one.channel == ""]
    assert [one.verdict for one in found] == ["fail"]
    assert says in found[0].finding


@pytest.mark.usefixtures("lines")
def test_signals_of_another_package_that_do_not_work_fail_the_check(monkeypatch) -> None:
    def fails(*_: object) -> None:
        raise ValueError("invalid literal for int() with base 10: 't_ms'")

    monkeypatch.setattr(recoil_lines.LinesSignals, "__init__", fails)
    monkeypatch.setattr(device_check, "SETTLE_S", 0.0)
    (found,) = checked_wind()
    assert found.verdict == "fail"
    assert "found ValueError: invalid literal" in found.finding


def checked_wind() -> list[ChannelHeard]:
    """What `check --devices` says of the example package's source alone."""
    mixed = load_rig("mixed")
    text = re.sub(r"device = \{ virtual[^}]*\}", "", mixed.text).replace('channel = "p_brake"  ', 'channel = "wind"  ')
    return list(check_devices(parse_rig(text + DECLARED, mixed.path, mixed.databases), listen_s=0.1))


@pytest.mark.usefixtures("lines")
def test_a_device_of_another_key_than_the_packages_is_refused() -> None:
    mixed = load_rig("mixed")
    with pytest.raises(
        RigError, match=r"has `linnes`, .*, of which none chooses a kind: there is .*`lines`, as { lines"
    ):
        parse_rig(mixed.text + DECLARED.replace("lines = 0,", "linnes = 0,"), mixed.path, mixed.databases)


@pytest.mark.real_time
@pytest.mark.usefixtures("lines")
def test_its_channel_triggers_and_its_records_are_the_shot(day: Day) -> None:
    window = day.window
    assert [(d.channel, d.outcome) for d in window.decisions] == [("wind", "trigger")]
    assert window.decisions[0].value == pytest.approx(20.0)
    assert (day.status.kind, day.status.counted) == ("dewetron", "bytes")
    assert {record.kind for record in open_log(day.journal).records(0)} - {Kind.IDLE} == {Kind.STREAM, Kind.EVENT}
    recording = recognise(day.captured).open(day.captured, Declarations("wind"))
    values, ticks_s = recording.read("v"), recording.time_base("v").times_s
    before = int((values == 18.0).sum())
    assert (values[:before] == 18.0).all()
    assert (values[before:] == 72.0).all()
    assert ticks_s[before] - ticks_s[0] == pytest.approx(0.2, abs=0.06)
    assert match_sources(with_wind(), [(day.captured, recognise(day.captured))]) == {"wind": day.captured}
    anchors = recording.metadata["clock_fit"][TICK_ANCHORS]
    assert all(ticks_s[0] <= one["tick"] / 1000.0 <= ticks_s[-1] for one in anchors)
    assert anchors


@pytest.mark.usefixtures("lines")
def test_what_an_open_device_tells_meets_what_the_rig_declares() -> None:
    declared = live_wind(with_wind()).channels[0]
    assert (declared.factor, declared.unit) == (pytest.approx(1 / 3.6), "m/s")
    mixed = load_rig("mixed")
    silent = DECLARED.replace('unit = "km/h"\n', "")
    without_unit = parse_rig(mixed.text + silent, mixed.path, mixed.databases)
    assert live_wind(without_unit).channels[0].factor == 1.0
    with closing(open_source(live_wind(without_unit))) as device:
        assert live_wind(without_unit, {"wind": device}).channels[0].factor == pytest.approx(1 / 3.6)
    other = silent.replace('v = "km/h", t', 'w = "m/s", v = "K", t') + silent.partition("\n\n")[2].replace(
        'name = "wind"', 'name = "gust"', 1
    ).replace('signal = "v"', 'signal = "ww"')
    contradicting = parse_rig(mixed.text + other, mixed.path, mixed.databases)
    with closing(open_source(live_wind(contradicting))) as device, pytest.raises(RigError) as refused:
        live_wind(contradicting, {"wind": device})
    text = str(refused.value)
    assert "the device has no 'ww'; nearest: w" in text
    assert "no unit of velocity" in text


@pytest.mark.real_time
def test_the_instruments_own_file_takes_the_place_of_the_preview(day: Day, monkeypatch: pytest.MonkeyPatch) -> None:
    own = day.captured.with_name("0001_wind.csv")
    own.write_bytes(vendor_files.dewesoft_text(vendor_files.motion_rows()))
    files = [(path, recognise(path)) for path in (own, day.captured)]
    with announced():
        mixed = load_rig("mixed")
        text = with_wind().text.replace('name = "wind"\nkind', 'name = "wind"\nmatch = "*wind*"\nkind')
        rig = parse_rig(text, mixed.path, mixed.databases)
        with pytest.raises(ReadError, match=r"source 'wind' already has 0001_wind\.csv"):
            match_sources(rig, files)
        monkeypatch.setattr(recoil_lines, "KIND", replace(recoil_lines.KIND, is_preview=True))
        others.offered.cache_clear()
        others.announced.cache_clear()
        assert match_sources(rig, files) == {"wind": own}


@pytest.mark.real_time
def test_a_capture_of_a_kind_that_is_not_installed_names_it(day: Day) -> None:
    with pytest.raises(ReadError, match=r"a dewetron source that was read live by `lines`.*install the package"):
        recognise(day.captured).open(day.captured, Declarations("wind"))
