"""`show` of an instrument's file, and `formats`."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from recoil_acquisition.errors import ReadError
from recoil_acquisition.packages.extras import (
    CLUSTER,
    DCC,
    EXTRAS,
    MDF,
    NOTEBOOK,
    OPENDAQ,
    PDF,
    SERVE,
    SIGN,
    SIGN_KEYS,
    XARRAY,
    XLSX,
)
from recoil_acquisition.readers.table import BY_LAYOUT, READERS, TableReader
from recoil_daq.recording.file_summary import open_recording
from recoil_rigs.rig import load_rig
from recoil_rigs.twin import TwinShot
from tests.builders import mdf_logs
from tests.builders import vendor_files as build
from tests.builders.oxygen_dmd import Stored, oxygen_chunks
from tests.builders.serial_packets import witmotion_frame

CONTENTS = {
    "recorder.csv": build.dewesoft_text(build.motion_rows()),
    "camera.csv": build.tracks_text(skip=[7], lost=[11, 12]),
    "bus.asc": build.asc_log(build.can_entries()),
    "bus.blf": build.blf_log(build.can_entries()),
}


@pytest.fixture
def files(tmp_path: Path) -> dict[str, Path]:
    for name, content in CONTENTS.items():
        (tmp_path / name).write_bytes(content)
    return {name: tmp_path / name for name in CONTENTS}


def shown(run, *arguments) -> dict:
    result = run("show", *arguments, "--json")
    assert result.exit_code == 0, result.output
    return json.loads(result.stdout)


def test_formats_lists_every_reader_with_what_it_needs(run):
    document = json.loads(run("formats", "--json").stdout)
    readers = [*READERS, *BY_LAYOUT.values()]
    assert [row["format"] for row in document["formats"]] == [reader.name for reader in readers]
    assert all(row["suffixes"] for row in document["formats"])
    printed = run("formats").output
    assert all(reader.name in printed for reader in readers)


def test_every_extra_is_a_reader_s_or_a_command_s_and_pip_knows_it():
    needed = {reader.extra for reader in READERS if isinstance(reader, TableReader) and reader.extra is not None}
    assert set(EXTRAS.values()) == {*needed, MDF, CLUSTER, PDF, DCC, OPENDAQ, SERVE}, (
        "MDF 4 is written by its library, and read without it"
    )
    project = tomllib.loads((Path(__file__).resolve().parents[3] / "pyproject.toml").read_text("utf-8"))["project"]
    for name, extra in EXTRAS.items():
        assert [one.split(" ")[0] for one in project["optional-dependencies"][name]] == [extra.requirement]
    assert {SIGN.requirement, SIGN_KEYS.requirement} == {
        one.split(" ")[0] for one in project["optional-dependencies"]["sign"]
    }
    beside = {NOTEBOOK.requirement, XARRAY.requirement, XLSX.requirement}
    assert set(project["optional-dependencies"]["notebook"]) == beside, "what a notebook draws and writes"


def test_a_recorder_s_text_is_shown_with_units_rate_and_what_it_says_of_its_time(run, files):
    document = shown(run, files["recorder.csv"])
    assert document["kind"] == "dewetron"
    assert [(s["name"], s["unit"], s["spacing"]) for s in document["signals"]] == [
        ("AI 1/acc", "m/s2", "even"),
        ("AI 2/p", "MPa", "even"),
    ]
    assert document["absolute_start"] is None
    assert "time zero: the file does not say when it was" in run("show", files["recorder.csv"]).output


NO_DATA = {
    "bus.log": b"(1700000000.000000) can0 123#R\n(1700000000.100000) can0 20000004#0001000000000000\n" * 3,
    "bus.asc": build.asc_log([], extra=["   0.100000 1  ErrorFrame", "   0.200000 1  ErrorFrame"]),
    "bus.mf4": mdf_logs.bus_log([], errors=4),
    "bus.blf": build.blf_log([], extra=build.blf_object(65, 5, bytes(16)) * 3),
}


@pytest.mark.parametrize("name", NO_DATA)
def test_a_bus_log_without_data_frames_is_shown_with_what_is_in_it(run, tmp_path, name):
    path = tmp_path / name
    path.write_bytes(NO_DATA[name])
    document = shown(run, path)
    assert (document["kind"], document["signals"]) == ("can", [])
    assert document["left_out"]
    assert any("the log has no data frames: check the recorder's channel and filters" in n for n in document["notes"])
    printed = run("show", path).output
    assert all(key in printed for key in document["left_out"])


def test_a_camera_s_tracks_and_its_losses_are_told(run, files):
    document = shown(run, files["camera.csv"])
    assert document["tracks"] == ["Feature #1"]
    assert document["notes"]
    assert f"note: {document['notes'][0]}" in " ".join(run("show", files["camera.csv"]).output.split("\n"))


@pytest.mark.parametrize("name", ["bus.asc", "bus.blf"])
def test_a_bus_log_without_a_rig_lists_its_identifiers(run, files, name):
    document = shown(run, files[name])
    frames = document["metadata"]["unknown_identifiers"]
    assert document["signals"] == []
    assert sum(frames.values()) > 10
    printed = run("show", files[name]).output
    assert "no signals" in printed
    assert all(identifier in printed for identifier in frames)


def test_a_rig_explains_what_a_bus_log_or_a_capture_holds(run, mixed_shot: TwinShot):
    by_kind = {path.name.rsplit("_", 1)[1].split(".")[0]: path for path in mixed_shot.files}
    bus = shown(run, by_kind["can"], "--rig", "mixed")
    assert "RecoilNode.p_brake" in [s["name"] for s in bus["signals"]]
    assert {s["unit"] for s in bus["signals"]} >= {"MPa", "m/s2"}
    capture = shown(run, by_kind["imu"], "--rig", "mixed")
    assert "gyro_carriage" in [s["name"] for s in capture["signals"]]
    # a virtual sensor's capture holds no rig that would decode it, and says so
    alone = shown(run, by_kind["imu"])
    assert (alone["signals"], alone["kind"]) == ([], "serial")
    assert "no rig is named: its sources are not decoded; --rig RIG decodes them" in alone["notes"]
    assert [source["name"] for source in alone["metadata"]["sources"]] == ["imu"]
    # a rig without such a source declares nothing of the file
    assert shown(run, by_kind["can"], "--rig", "field-2013")["signals"] == []


def cut_recording() -> bytes:
    chunks = oxygen_chunks([Stored("AI 1/1", np.arange(24.0), "V")], blocks=((0, 10), (10, 10), (20, 4)))
    return b"".join(chunks)[:-60]


@pytest.mark.parametrize(
    ("name", "content", "reason"),
    [
        ("cut.dmd", cut_recording(), "it ends at byte"),
        ("cut.csv", CONTENTS["recorder.csv"][:-2], "the last row has no line end and may be cut: it was left out"),
    ],
)
def test_a_file_that_was_cut_off_is_shown_with_the_reason_and_exit_code_1(run, tmp_path, name, content, reason):
    (tmp_path / name).write_bytes(content)
    printed = run("show", tmp_path / name)
    assert printed.exit_code == 1
    assert "cut off: " in printed.output
    assert reason in " ".join(printed.output.split())
    document = run("show", tmp_path / name, "--json")
    assert document.exit_code == 1
    assert reason in json.loads(document.stdout)["incomplete"]
    assert json.loads(document.stdout)["signals"], "what is there is shown all the same"


@pytest.mark.parametrize("content", [b"", b"hello\n", b"\x89HDF\r\n\x1a\n" + bytes(64)])
def test_what_is_no_instrument_s_file_is_one_clear_line(run, tmp_path, content):
    (tmp_path / "file.bin").write_bytes(content)
    result = run("show", tmp_path / "file.bin")
    assert result.exit_code == 3
    assert "file.bin" in result.output
    assert "Traceback" not in result.output


@pytest.mark.parametrize(
    ("content", "signals", "notes"),
    [
        (
            b"".join(witmotion_frame(0x51, i, -i, 2 * i, 100) for i in range(60)),
            {"acceleration_x": ("m/s^2", 60, None)},
            ("60 good frames of witmotion, 100 % of the bytes", 'framing = { ready_made = "witmotion" }`'),
        ),
        (
            b"".join(b"\xaa\x55\x10" + np.random.default_rng(i).bytes(8) for i in range(300)),
            {},
            ("no framing that fits, but 300 times AA 55 10", "the `framing` that the device's manual tells"),
        ),
        (
            b"made by hand\nt;p\nms;bar\n" + b"".join(b"%d;%d,5\n" % (i, i) for i in range(40)),
            {"p": ("bar", 40, 1000.0)},
            ("nothing in it says what program wrote it", "a rig declares `layout = "),
        ),
        (
            b"made by hand\nn;p\n-;bar\n" + b"".join(b"%d;%d,5\n" % (i, i) for i in range(40)),
            {"p": ("bar", 40, None)},
            ("`rate_hz` is known from the device", "a rig declares `layout = "),
        ),
    ],
    ids=["ready-made framing", "marks alone", "table of text", "table without time"],
)
def test_what_no_reader_recognises_is_shown_as_it_seems_to_be(run, tmp_path, content, signals, notes):
    path = tmp_path / "port.raw"
    path.write_bytes(content)
    done = run("show", path, "--json")
    assert done.exit_code == 0, done.output
    document = json.loads(done.stdout)
    found = {one["name"]: (one["unit"], one["samples"], one["rate_hz"]) for one in document["signals"]}
    assert found.items() >= signals.items()
    assert bool(found) == bool(signals)
    text = "\n".join(document["notes"])
    assert all(note in text for note in notes)
    assert "declared rate" not in text, "nobody declared any"
    # what is not declared by a rig is shown, and not made a shot of
    refused = run("check", "mixed", path)
    assert refused.exit_code == 3
    assert "no reader recognises" in " ".join(refused.output.split())


def test_a_missing_file_and_a_folder_are_refused(run, tmp_path):
    for path in (tmp_path / "none.csv", tmp_path):
        assert run("show", path).exit_code == 3


# ---- CAN databases

KCD = """<?xml version="1.0" encoding="UTF-8"?>
<NetworkDefinition xmlns="http://kayak.2codeornot2code.org/1.0"><Bus name="b">
<Message id="0x123" name="Brake" length="2"><Signal name="p" offset="0" length="16"><Value unit="bar"/></Signal>
</Message></Bus></NetworkDefinition>
"""
DBC = """VERSION ""
BU_: N
BO_ 291 Node: 4 N
 SG_ p : 0|16@1- (0.5,0) [0|0] "kPa" N
 SG_ n : 16|8@1+ (1,0) [0|0] "" N
BO_ 2566844672 Empty: 8 N
"""


@pytest.mark.parametrize(
    ("name", "content", "signals"),
    [
        ("bus.dbc", DBC, [("Node.p", "kPa"), ("Node.n", "")]),
        ("BUS.DBC", DBC.replace("kPa", "m/s\xb2"), [("Node.p", "m/s²"), ("Node.n", "")]),
        ("bus.kcd", KCD, [("Brake.p", "bar")]),
    ],
)
def test_a_database_is_shown_with_its_messages_and_signals(run, tmp_path, name, content, signals):
    (tmp_path / name).write_text(content, encoding="cp1252")
    document = shown(run, tmp_path / name)
    assert document["schema"] == "recoil-daq/database/1"
    assert [(s["name"], s["unit"]) for m in document["messages"] for s in m["signals"]] == signals
    assert document["messages"][0]["identifier"] == "0x123"
    printed = run("show", tmp_path / name).output
    assert all(one in printed for one, _ in signals)
    assert f'database = "{name}"' in printed
    if "dbc" in name.lower():
        assert document["messages"][1] == {"name": "Empty", "identifier": "0x18FEF100", "bytes": 8, "signals": []}
        assert "Empty (no signals)" in printed


@pytest.mark.parametrize("content", ["", "Time,p\n0,1\n", "VERSION"])
def test_what_is_no_database_is_refused_by_its_name(run, tmp_path, content):
    (tmp_path / "x.dbc").write_text(content, encoding="utf-8")
    result = run("show", tmp_path / "x.dbc")
    assert result.exit_code == 3
    assert "x.dbc: " in result.stderr
    assert "CAN database" in result.stderr
    assert result.stderr.count("\n") == 1


def test_a_bus_log_without_a_rig_says_how_its_signals_get_names(run, files):
    printed = run("show", files["bus.blf"]).output
    assert f"their signals have names by a database: `recoil-daq show {files['bus.blf']} <file>.dbc`" in printed
    assert 'kind = "can", match = "*.blf" and database = "<file>.dbc"' in printed


@pytest.mark.parametrize("turned", [False, True], ids=["log first", "database first"])
def test_a_bus_log_is_shown_with_the_signals_of_a_database(run, files, turned):
    database = files["bus.blf"].with_name("bus.dbc")
    database.write_text(build.DBC, encoding="utf-8")
    order = (database, files["bus.blf"]) if turned else (files["bus.blf"], database)
    document = shown(run, *order)
    units = {s["name"]: s["unit"] for s in document["signals"]}
    assert units.items() >= {("ACC.ax", "m/s^2"), ("ACC.p", "bar")}
    assert document["database"] == str(database)
    assert "ACC.ax" in run("show", *order).output


def test_a_database_that_knows_no_frame_of_a_log_is_said_to(run, files):
    database = files["bus.blf"].with_name("other.dbc")
    database.write_text(DBC, encoding="utf-8")
    printed = run("show", files["bus.blf"], database).output
    assert "other.dbc knows none of them: it is another bus's database, or another bus's log" in printed


@pytest.mark.parametrize(
    ("second", "said"),
    [
        ("bus.blf", "one file is shown at a time"),
        ("bus.dbc", "this is no CAN log; expected frames that bus.dbc explains, found Dewesoft text"),
    ],
)
def test_two_files_of_which_none_explains_the_other_are_refused(run, files, second, said):
    if second == "bus.dbc":
        files["recorder.csv"].with_name("bus.dbc").write_text(DBC, encoding="utf-8")
    result = run("show", files["recorder.csv"], files["recorder.csv"].with_name(second))
    assert result.exit_code == 3
    assert said in result.stderr


def test_a_database_and_a_rig_are_not_given_both(run, files):
    assert run("show", files["bus.blf"], files["bus.blf"].with_name("x.dbc"), "--rig", "mixed").exit_code == 2


def test_a_file_of_which_nothing_is_a_signal_lists_what_it_holds(run, tmp_path):
    parts = np.array([1, "a"], object)
    savemat(tmp_path / "shot.mat", {"S": {"parts": parts}, "cube": np.ones((9, 3, 2)), "matrix": np.ones((9, 3))})
    document = shown(run, tmp_path / "shot.mat")
    assert document["signals"] == []
    assert document["left_out"]["cube"].startswith("an array of shape 9x3x2")
    assert document["left_out"]["S.parts"].startswith("a cell")
    assert document["left_out"]["matrix.column_1"] == "none of its columns is a time, which rises"
    printed = " ".join(run("show", tmp_path / "shot.mat").output.split())
    assert "What the file holds, and why it is no signal" in printed
    assert "save its parts as vectors of their own" in printed
    savemat(tmp_path / "timeless.mat", {"acc": np.ones(9), "p": np.ones(7)})
    document = shown(run, tmp_path / "timeless.mat")
    assert document["left_out"] == dict.fromkeys(("acc", "p"), "no time vector has its length")
    assert document["notes"] == [
        "no time in this file: add a vector `time` (s) as long as the channels, or a scalar `Sample_rate` (Hz)"
    ]


def test_a_camera_s_file_without_time_is_shown_by_its_frames(run, tmp_path):
    path = tmp_path / "points.csv"
    rows = "".join(f"{i},{2 * i}\n" for i in range(30))
    path.write_text("pt1_cam1_X,pt1_cam1_Y\n" + rows, encoding="utf-8")
    document = shown(run, path)
    assert [(s["name"], s["samples"], s["rate_hz"], s["spacing"]) for s in document["signals"]] == [
        ("pt1_cam1_X", 30, None, "frames"),
        ("pt1_cam1_Y", 30, None, "frames"),
    ]
    assert document["tracks"] == ["pt1_cam1"]
    assert document["metadata"]["frame_rate_hz"] is None
    assert document["notes"][0] == "the file has no time: its source in a rig states `frame_rate`, in Hz"
    assert "frames" in run("show", path).output


def test_a_capture_is_opened_by_the_rig_of_its_source(mixed_shot: TwinShot) -> None:
    capture = next(one for one in mixed_shot.files if one.suffix == ".rdlog")
    recording = open_recording(capture, load_rig(mixed_shot.rig_file))
    assert {"gyro_carriage", "acc_x"} <= {one.name for one in recording.signals}
    with pytest.raises(ReadError, match="expected source = one of 'imu'"):
        open_recording(capture, load_rig(mixed_shot.rig_file), source="can")
    with pytest.raises(ReadError, match="which source of this capture"):
        open_recording(capture, load_rig("field-2013"))
