"""Two nodes of one kind on two buses of one log: each source of a rig takes its own bus, or is asked which."""

from __future__ import annotations

import json
from pathlib import Path

import can
import numpy as np
import pytest
from typer.testing import CliRunner

from recoil_acquisition.errors import ReadError, RigError
from recoil_acquisition.readers.excerpt import excerpt
from recoil_daq import ingest_files, open_recording
from recoil_daq.cli import app
from recoil_daq.live.shots.file_match import sources_of_file
from recoil_daq.recording.check import check_rig
from recoil_daq.recording.file_summary import summarise_file
from recoil_daq.recording.ingest_folder import ingest_folder
from recoil_rigs.rig import Rig, find_rig, parse_rig
from recoil_rigs.twin import TwinShot, simulate_shot
from tests.builders.virtual_shots import SHORTER

_SECOND_BUS = """
[[source]]
name = "second"
kind = "can"
match = "*_can.*"
database = "mixed.dbc"
BUS
align = { method = "redundant", channel = "acc_second", against = "acc_recoil" }

[[channel]]
name = "acc_second"
source = "second"
signal = "RecoilNode.acc_recoil"
quantity = "acceleration"
unit = "m/s2"
sensor = { model = "another node", u_rel = 0.02, range = [-5000.0, 5000.0], position = [-0.30, 0.06] }

[twin]
"""


def rig_with_two_buses(first: str = "bus = 1", second: str = "bus = 2") -> Rig:
    path = find_rig("mixed")
    text = path.read_text(encoding="utf-8")
    text = text.replace('database = "mixed.dbc" ', f'database = "mixed.dbc"\n{first}\n#')
    head, _, tail = text.partition("[twin]\n")
    lines = {line.partition("=")[0].strip(): line for line in tail.splitlines() if "=" in line}
    lines |= {key: f"{key} = {value}" for key, value in SHORTER.items()}
    return parse_rig("\n".join([head + _SECOND_BUS.replace("BUS", second), *lines.values(), ""]), path)


@pytest.fixture(scope="module")
def two_bus_shot(tmp_path_factory: pytest.TempPathFactory) -> TwinShot:
    return simulate_shot(rig_with_two_buses(), tmp_path_factory.mktemp("two buses") / "0001", seed=1, shot="0001")


@pytest.mark.indispensable("ingest")
def test_two_sources_of_a_rig_share_the_log_of_two_buses(two_bus_shot: TwinShot, tmp_path: Path) -> None:
    rig = rig_with_two_buses()
    logs = [file for file in two_bus_shot.files if "_can." in file.name]
    assert len(logs) == 1
    checked = check_rig(two_bus_shot.folder / "rig.toml", two_bus_shot.files)
    assert {row["source"]: row["file"] for row in checked.files}["second"] == logs[0].name
    done = ingest_files(rig, two_bus_shot.files, out=tmp_path)
    assert done.shot.usable, done.shot.reasons
    one, other = done.shot.channels["acc_recoil_can"], done.shot.channels["acc_second"]
    offsets_s = [two_bus_shot.truth["clocks"][clock]["offset_s"] for clock in ("can", "second")]
    found_s = {a.clock: a.offset_s for a in done.shot.alignments}
    assert abs(offsets_s[0] - offsets_s[1]) > 1e-3
    for clock, offset_s in zip(("can", "second"), offsets_s, strict=True):
        assert found_s[clock] == pytest.approx(offset_s, abs=5e-4)
    assert not np.array_equal(one.samples[:100], other.samples[:100])
    assert [i.sha256 for i in done.shot.inputs if i.source in ("can", "second")] == 2 * [
        next(i.sha256 for i in done.shot.inputs if i.name == logs[0].name)
    ]


def test_a_second_node_on_another_bus_is_asked_for_and_never_mixed_in(two_bus_shot: TwinShot, tmp_path: Path) -> None:
    rig = rig_with_two_buses("", "bus = 2")
    with pytest.raises(ReadError, match=r"fits several sources: can, second.*`bus`"):
        ingest_files(rig, two_bus_shot.files, out=tmp_path)
    alone = parse_rig(
        (two_bus_shot.folder / "rig.toml").read_text().replace("bus = 1\n", "").replace("bus = 2\n", ""),
        find_rig("mixed"),
    )
    text = alone.text.partition('[[source]]\nname = "second"')[0] + "\n[twin]\n" + alone.text.partition("[twin]\n")[2]
    with pytest.raises(ReadError, match=r"came on the buses 1, 2; found .*@1.*@2.*set `bus = 1`") as caught:
        ingest_files(parse_rig(text, find_rig("mixed")), two_bus_shot.files, out=tmp_path)
    assert "RecoilNode" in caught.value.problem
    assert not list(tmp_path.iterdir())
    path = tmp_path / "rig.toml"
    path.write_text(text)
    (tmp_path / "mixed.dbc").write_text(rig.databases["mixed.dbc"])
    with pytest.raises(RigError, match="came on the buses 1, 2"):
        check_rig(path, two_bus_shot.files)


@pytest.mark.whole_way
def test_a_signal_may_name_its_bus_itself(two_bus_shot: TwinShot, tmp_path: Path) -> None:
    text = rig_with_two_buses().text
    text = text.partition('[[source]]\nname = "second"')[0] + "\n[twin]\n" + text.partition("[twin]\n")[2]
    text = (
        text.replace("bus = 1\n", "")
        .replace('signal = "RecoilNode.', 'signal = "RecoilNode.')
        .replace('signal = "RecoilNode.p_brake"', 'signal = "RecoilNode.p_brake@1"')
    )
    for name in ("p_recuperator", "acc_recoil"):
        text = text.replace(f'"RecoilNode.{name}"', f'"RecoilNode.{name}@1"')
    named = ingest_files(parse_rig(text.replace('device = { virtual = "virtual" }', ""), find_rig("mixed")),
                         two_bus_shot.files, out=tmp_path)  # fmt: skip
    by_key = ingest_files(rig_with_two_buses(), two_bus_shot.files, out=tmp_path / "2")
    for name in ("p_brake", "p_recuperator", "acc_recoil_can"):
        assert np.array_equal(named.shot.channels[name].samples, by_key.shot.channels[name].samples)


def test_show_lists_the_buses_of_a_log(two_bus_shot: TwinShot) -> None:
    log = next(file for file in two_bus_shot.files if "_can." in file.name)
    document = summarise_file(log, rig_with_two_buses())
    names = [row["name"] for row in document["signals"]]
    assert {"can: RecoilNode.p_brake", "second: RecoilNode.p_brake"} <= set(names)
    buses = document["metadata"]["buses"]
    assert list(buses) == ["1", "2"]
    assert buses["1"] > 100
    json.dumps(document)
    first = open_recording(log, rig_with_two_buses(), source="second")
    assert first.read("RecoilNode.p_brake").size == first.header("RecoilNode.p_brake@2").sample_count
    with pytest.raises(ReadError, match=r"several sources of the rig share this file.*'can', 'second'"):
        open_recording(log, rig_with_two_buses())


def test_a_bus_that_the_log_does_not_have_is_named(two_bus_shot: TwinShot, tmp_path: Path) -> None:
    with pytest.raises(
        ReadError, match=r"the log has no bus 3; found 1 \(\d+ frames\), 2 \(\d+ frames\); correct `bus`"
    ):
        ingest_files(rig_with_two_buses(second="bus = 3"), two_bus_shot.files, out=tmp_path)


@pytest.mark.parametrize(
    ("bus", "what"), [("bus = -1", "bus"), ('bus = ""', "bus"), ("bus = true", "bus"), ("bus = 1.5", "bus")]
)
def test_a_bus_is_a_number_or_a_name(bus: str, what: str) -> None:
    with pytest.raises(RigError, match=what) as caught:
        rig_with_two_buses(second=bus)
    assert all((fault.subject, fault.parts[-1]) == ("second", "bus") for fault in caught.value.faults)


def test_only_a_can_source_has_a_bus() -> None:
    path = find_rig("mixed")
    text = path.read_text(encoding="utf-8").replace("frame_rate = ", "bus = 1\nframe_rate = ")
    with pytest.raises(RigError, match="a camera source has no `bus`, only a can source has"):
        parse_rig(text, path)


@pytest.mark.parametrize("channel", ["[0, 1]", '"0,1"', '""'])
def test_a_device_that_delivers_several_buses_is_asked_which(channel: str) -> None:
    path = find_rig("mixed")
    table = f'device = {{ interface = "vector", channel = {channel} }}'
    text = path.read_text(encoding="utf-8").replace('device = { virtual = "virtual" }', table)
    with pytest.raises(RigError, match="the device delivers several buses; say which one"):
        parse_rig(text, path)
    sound = parse_rig(text.replace(table, f"{table}\nbus = 1"), path)
    assert sound.declarations(sound.source("can")).captured_bus == 1
    one = parse_rig(text.replace(table, 'device = { interface = "vector", channel = 0 }\nbus = 1'), path)
    assert one.declarations(one.source("can")).captured_bus is None


@pytest.mark.whole_way
def test_a_folder_of_shots_gives_a_shared_log_to_both_sources(two_bus_shot: TwinShot, tmp_path: Path) -> None:
    done = ingest_folder(rig_with_two_buses(), two_bus_shot.folder.parent, out=tmp_path, workers=1)
    (shot,) = done.shots
    assert (shot.state, shot.shot) == ("usable", "0001")


def test_a_dropped_log_is_that_of_all_sources_that_share_it() -> None:
    rig = rig_with_two_buses()
    assert sources_of_file(rig, "can", Path("0001_can.blf")) == ("can", "second")
    assert sources_of_file(rig, "camera", Path("0001_camera.csv")) == ("camera",)


def test_show_names_the_buses_where_no_rig_chooses_one(two_bus_shot: TwinShot) -> None:
    log = next(file for file in two_bus_shot.files if "_can." in file.name)
    output = " ".join(CliRunner().invoke(app, ["show", str(log)]).output.split())
    assert "buses: 1 (" in output
    assert "`bus` of a source in the rig file takes one" in output


@pytest.mark.whole_way
def test_ingest_warns_of_what_a_reader_left_out(two_bus_shot: TwinShot, tmp_path: Path) -> None:
    log = next(file for file in two_bus_shot.files if "_can." in file.name)
    with can.LogReader(log) as reader:
        messages = list(reader)
    spoilt = tmp_path / "0001_can.asc"
    with can.Logger(spoilt) as writer:
        for message in messages:
            writer(message)
    lines = spoilt.read_text().splitlines()
    at = next(i for i, line in enumerate(lines) if i > len(lines) // 2 and " d 8 " in line)
    lines[at] = lines[at].replace(" d 8 ", " d 4 ")
    spoilt.write_text("\n".join(lines) + "\n")
    files = [file for file in two_bus_shot.files if file != log]
    done = ingest_files(rig_with_two_buses(), [*files, spoilt], out=tmp_path)
    warned = {(c.channel, c.verdict) for c in done.shot.quality if "1 entries are damaged" in c.detail}
    assert warned == {("can", "warn"), ("second", "warn")}
    part = excerpt(open_recording(log, rig_with_two_buses(), source="can"), 0.05, 0.1, "a part")
    assert part.read("RecoilNode.p_brake@1").size == part.read("RecoilNode.p_brake").size > 0
