"""What is exported comes back: by our own readers bit for bit, and by libraries of others, or as far as is told."""

import csv
import datetime as dt
import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from recoil_acquisition.channel import Channel
from recoil_acquisition.clocks.timebase import AbsoluteStart, TimeBase
from recoil_acquisition.errors import StoreError
from recoil_acquisition.exporters.content import Content, gather
from recoil_acquisition.exporters.publication import ExportedFile, write_export
from recoil_acquisition.exporters.table import EXPORTERS, exporter_of
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.table import recognise
from recoil_acquisition.shot.quality_check import Check, QualityCheck
from recoil_acquisition.shot.shot import Shot
from tests.builders.exported_files import odd_shots
from tests.builders.shots import make_shot

SHOT = make_shot()
ODD_NAMES = st.one_of(
    st.text(st.characters(exclude_categories=["Cs"]), max_size=12),
    st.sampled_from(["time_s", "Time (s)", 'a "b", c', "a/b", "..", "# x: 1", "ä [m]", "line\nbreak", "", " "]),
)
PLAIN_NAMES = st.text(st.characters(codec="latin-1", categories=["L", "N"]), min_size=1, max_size=8)


def export(shot: Shot, name: str, folder: Path, **options: bool) -> tuple[ExportedFile, ...]:
    return write_export(content_of(shot, **options), exporter_of(name), folder, "0007", overwrite=True)


def content_of(shot: Shot, **options: bool) -> Content:
    return gather(shot, {"program": "test"}, **options)


def same_bits(one: np.ndarray, other: np.ndarray) -> bool:
    """Compare numbers by their bits; any NaN is a lost sample."""
    lost = np.isnan(one)
    return bool(np.array_equal(lost, np.isnan(other)) and one[~lost].tobytes() == other[~lost].tobytes())


# Our own readers


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", ["csv", "parquet"])
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(shot=odd_shots(ODD_NAMES))
def test_any_shot_comes_back_exactly_through_our_own_reader(name, tmp_path, shot):
    files = export(shot, name, tmp_path)
    assert all(file.exact and not file.losses for file in files)
    assert sorted(c for file in files for c in file.channels) == sorted(shot.channels)
    for file in files:
        recording = recognise(file.path).open(file.path, Declarations(file.clocks[0]))
        assert not recording.incomplete
        assert [signal.name for signal in recording.signals] == list(file.channels)
        for signal in recording.signals:
            channel = shot.channels[signal.name]
            assert signal.unit == channel.unit
            assert signal.metadata["quantity"] == channel.quantity
            assert same_bits(recording.read(signal.name), channel.samples.astype(np.float64))
            assert recording.time_base(signal.name).is_identical(channel.time_base)


@pytest.mark.parametrize("name", ["csv", "parquet"])
def test_a_shot_of_all_kinds_of_clocks_comes_back_with_what_is_known(name, tmp_path):
    files = export(SHOT, name, tmp_path)
    assert [file.path.stem for file in files] == ["0007_dewetron", "0007_camera", "0007_can", "0007_can_2", "0007_imu"]
    recording = recognise(files[0].path).open(files[0].path, Declarations("dewetron"))
    assert recording.absolute_start == SHOT.channels["p_breech"].time_base.absolute_start
    (camera,) = recognise(files[1].path).open(files[1].path, Declarations("camera")).signals
    assert camera.metadata["role"] == "recoil_displacement"
    assert camera.metadata["u_rel"] == 0.002
    assert recording.metadata["shot"] == "0007"
    assert recording.metadata["usable"] is False
    assert recording.metadata["inputs"][1]["file"] == "Schuß 7.txt"


# Libraries of others


def test_mdf4_has_one_group_per_time_base_for_asammdf(tmp_path):
    from asammdf import MDF

    (file,) = export(SHOT, "mdf4", tmp_path)
    assert file.exact
    with MDF(file.path) as mdf:
        assert [group.channel_group.acq_name for group in mdf.groups] == ["dewetron", "camera", "can", "can_2", "imu"]
        for channel in SHOT.channels.values():
            signal = mdf.get(channel.name)
            assert signal.unit == channel.unit
            assert signal.samples.dtype == channel.samples.dtype
            assert same_bits(signal.samples, channel.samples)
            assert same_bits(signal.timestamps, channel.time_base.times_s)
            assert json.loads(signal.comment)["quantity"] == channel.quantity
        # the recorder states no zone: the header holds its local time as it stands
        assert mdf.header.start_time.replace(tzinfo=None) == dt.datetime(2026, 3, 1, 10, 15, 0, 250000)
    assert any("zone" in loss for loss in file.losses)


def with_start(start: AbsoluteStart | None) -> Shot:
    base = TimeBase.uniform("dewetron", -0.01, 5e-5, 20, start)
    return replace(SHOT, channels={"a": Channel("a", "force", np.arange(20.0), base)}, alignments=())


def test_mdf4_has_the_start_with_its_zone_where_it_is_known(tmp_path):
    from asammdf import MDF

    (file,) = export(with_start(AbsoluteStart("2026-03-01T10:15:00.250", "+02:00", "header")), "mdf4", tmp_path)
    assert not file.losses
    with MDF(file.path) as mdf:
        expected = dt.datetime(2026, 3, 1, 10, 15, 0, 250000, dt.timezone(dt.timedelta(hours=2)))
        assert mdf.header.start_time == expected
        assert mdf.header.start_time.utcoffset() == dt.timedelta(hours=2)


@pytest.mark.parametrize("start", [None, AbsoluteStart("first of March", "unknown", "note")])
def test_mdf4_tells_that_a_start_is_unknown_and_never_takes_today(tmp_path, start):
    from asammdf import MDF

    (file,) = export(with_start(start), "mdf4", tmp_path)
    assert "1970" in " ".join(file.losses)
    with MDF(file.path) as mdf:
        assert mdf.header.start_time.year == 1970


def test_mat_has_dewesofts_names_and_a_table_that_maps_them_back(tmp_path):
    from scipy.io import loadmat

    base = TimeBase.uniform("dewetron", 0.0, 1e-3, 5)
    names = ("a", "AI 1", "AI/1", "AI_1", "time_AI_1", "x" * 80, "x" * 81)
    shot = replace(SHOT, channels={n: Channel(n, "force", np.arange(5.0) + k, base) for k, n in enumerate(names)})
    (file,) = export(shot, "mat", tmp_path)
    held = loadmat(file.path)
    assert held["Data1_AI_1"].shape == (5, 1)
    np.testing.assert_array_equal(held["Data1_time_AI_1"].ravel(), base.times_s)
    rows = {row[2][0]: (row[0][0], row[1][0], row[3][0]) for row in held["recoil_daq_names"]}
    assert list(rows) == list(shot.channels)
    for name, (variable, time, unit) in rows.items():
        assert unit == "N"
        assert len(time) <= 63
        np.testing.assert_array_equal(held[variable].ravel(), shot.channels[name].samples)
        np.testing.assert_array_equal(held[time].ravel(), base.times_s)
    assert len({v for row in rows.values() for v in row[:2]}) == 2 * len(rows)
    told = {loss.partition(":")[0] for loss in file.losses}
    assert told == set(names) - {"a"}


def test_mat_keeps_every_number_of_every_clock(tmp_path):
    from scipy.io import loadmat

    (file,) = export(SHOT, "mat", tmp_path)
    assert file.exact
    held = loadmat(file.path)
    for channel in SHOT.channels.values():
        assert held[f"Data1_{channel.name}"].dtype == channel.samples.dtype
        assert same_bits(held[f"Data1_{channel.name}"].ravel(), channel.samples)
        assert same_bits(held[f"Data1_time_{channel.name}"].ravel(), channel.time_base.times_s)
    said = json.loads(held["recoil_daq"][0])
    assert [group["clock"] for group in said] == ["dewetron", "camera", "can", "can", "imu"]


def test_uff58_is_read_by_pyuff_with_six_digits_of_an_even_time_and_all_of_an_uneven_one(tmp_path):
    import pyuff

    (file,) = export(SHOT, "uff58", tmp_path)
    assert sorted(file.channels) == sorted(SHOT.channels)
    assert file.left_out == ()
    sets = pyuff.UFF(str(file.path)).read_sets()
    assert [one["id1"].strip() for one in sets] == list(file.channels)
    for one in sets:
        channel = SHOT.channels[one["id1"].strip()]
        assert one["binary"] == 1
        assert one["ordinate_axis_units_lab"].strip() == channel.unit
        assert same_bits(one["data"], channel.samples.astype(np.float64))
        if channel.time_base.step_s is None:
            assert one["abscissa_spacing"] == 0
            assert same_bits(one["x"], channel.time_base.times_s)
            continue
        np.testing.assert_allclose(one["x"], channel.time_base.times_s, atol=4e-8)
        exact = dict(word.split("=") for word in one["id4"].split())
        assert float(exact["start_s"]) == channel.time_base.start_s
        assert float(exact["step_s"]) == channel.time_base.step_s
    # 5e-5 s has one digit, 1/3000 s has no end
    (imu,) = (loss for loss in file.losses if "time is off" in loss)
    assert imu.startswith("acc_imu: time is off by up to 3e-08 s")


def test_uneven_channels_of_uff58_come_back_through_our_own_reader(tmp_path):
    shot = replace(SHOT, channels={"x_recoil": SHOT.channels["x_recoil"]})
    (file,) = export(shot, "uff58", tmp_path)
    assert file.exact
    recording = recognise(file.path).open(file.path, Declarations("camera"))
    assert same_bits(recording.read("x_recoil"), SHOT.channels["x_recoil"].samples.astype(np.float64))
    assert same_bits(recording.time_base("x_recoil").times_s, SHOT.channels["x_recoil"].time_base.times_s)


def test_tdms_is_read_by_nptdms_with_exact_spacing_in_its_properties(tmp_path):
    from nptdms import TdmsFile

    (file,) = export(SHOT, "tdms", tmp_path)
    assert file.exact
    held = TdmsFile.read(file.path)
    assert [group.name for group in held.groups()] == ["dewetron", "camera", "can", "can_2", "imu"]
    for group in held.groups():
        stamps = [c for c in group.channels() if c.name == "time_s"]
        for channel in (c for c in group.channels() if c.name != "time_s"):
            original = SHOT.channels[channel.name]
            assert channel.properties["unit_string"] == original.unit
            assert channel.dtype == original.samples.dtype
            assert same_bits(channel[:], original.samples)
            if original.time_base.step_s is None:
                assert same_bits(stamps[0][:], original.time_base.times_s)
                assert "wf_increment" not in channel.properties
            else:
                assert channel.properties["wf_increment"] == original.time_base.step_s
                assert channel.properties["wf_start_offset"] == original.time_base.start_s
                # the library's own instants are interpolated: the last place differs
                np.testing.assert_allclose(channel.time_track(), original.time_base.times_s, rtol=0, atol=1e-17)
    assert held["imu"]["acc_imu"].properties["wf_start_time"] == np.datetime64("2026-03-01T08:15:00")
    assert "wf_start_time" not in held["dewetron"]["p_breech"].properties
    assert [loss.partition(":")[0] for loss in file.losses] == ["dewetron"]


def test_parquet_is_read_by_pandas_with_names_and_types(tmp_path):
    import pandas as pd
    import pyarrow.parquet as pq

    files = export(SHOT, "parquet", tmp_path)
    frame = pd.read_parquet(files[-1].path)
    assert list(frame.columns) == ["time_s", "acc_imu"]
    assert frame["acc_imu"].dtype == np.float32
    assert same_bits(frame["time_s"].to_numpy(), SHOT.channels["acc_imu"].time_base.times_s)
    schema = pq.read_schema(files[-1].path)
    assert schema.field("acc_imu").metadata[b"unit"] == b"m/s^2"
    assert json.loads(schema.metadata[b"recoil-daq"])["clock"] == "imu"


def test_dewesoft_like_text_is_read_by_the_reader_of_dewesofts_text(tmp_path):
    files = export(SHOT, "dewesoft-text", tmp_path)
    assert not files[0].exact
    lines = files[0].path.read_bytes().decode().split("\r\n")
    assert lines[0] == "Time (s),dewetron/p_breech (Pa),dewetron/acc_recoil (m/s^2)"
    reader = recognise(files[0].path)
    assert reader.name == "Dewesoft text export"
    recording = reader.open(files[0].path, Declarations("dewetron"))
    for signal in recording.signals:
        channel = SHOT.channels[signal.name.removeprefix("dewetron/")]
        assert signal.unit == channel.unit
        np.testing.assert_allclose(recording.read(signal.name), channel.samples, rtol=5e-15, atol=0)
        assert recording.time_base(signal.name).step_s == channel.time_base.step_s
    camera = recognise(files[1].path).open(files[1].path, Declarations("camera"))
    np.testing.assert_array_equal(np.isnan(camera.read("camera/x_recoil")), SHOT.channels["x_recoil"].lost)


def test_dewesoft_like_text_says_by_how_much_it_is_off(tmp_path):
    samples = np.array([0.1, 1 / 3, np.inf, 12345678901234567.0])
    shot = replace(SHOT, channels={"a": Channel("a", "force", samples, TimeBase.uniform("dewetron", 0.0, 0.5, 4))})
    (file,) = export(shot, "dewesoft-text", tmp_path)
    assert file.losses[0] == "a: 1 infinite samples are empty cells, as lost ones are"
    # 12345678901234567 reads ...600: 33 of 1.2e16, and float64 has it as ...568
    assert file.losses[1] == "a: 15 digits change 2 of 4 numbers, by 2.6e-15 of them at most"
    assert not any(loss.startswith("time:") for loss in file.losses)


# Every format


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", EXPORTERS)
@settings(max_examples=12, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(shot=odd_shots(PLAIN_NAMES, least=1))
def test_any_shot_is_exported_as_told_or_refused_in_one_line(name, tmp_path, shot):
    files = export(shot, name, tmp_path)
    kept = [channel for file in files for channel in (*file.channels, *file.left_out)]
    assert sorted(kept) == sorted(shot.channels)
    if name in ("mdf4", "mat", "tdms", "parquet", "csv"):
        assert all(file.exact for file in files)
    assert not [p for p in tmp_path.iterdir() if p.name.startswith(".")]


def test_instants_are_mapped_to_the_reference_clock_when_asked(tmp_path):
    names = [name for name in SHOT.channels if name != "acc_imu"]
    content = gather(SHOT, {}, names, aligned=True)
    files = write_export(content, exporter_of("csv"), tmp_path, "0007")
    camera = recognise(files[1].path).open(files[1].path, Declarations("camera"))
    times_s = camera.time_base("x_recoil").times_s
    assert same_bits(times_s, SHOT.alignment("camera").to_reference(SHOT.channels["x_recoil"].time_base.times_s))
    assert any("mapped from the clock 'camera' to 'dewetron'" in note for note in camera.notes)
    assert any("clock camera was mapped to dewetron" in note and "ambiguous" in note for note in content.notes)
    assert camera.absolute_start == SHOT.channels["p_breech"].time_base.absolute_start


def test_a_clock_that_was_not_aligned_is_not_mapped():
    with pytest.raises(StoreError, match="'imu' was not aligned: no common motion"):
        gather(SHOT, {}, aligned=True)
    with pytest.raises(StoreError, match="does not say how the clock 'can' maps"):
        gather(replace(SHOT, alignments=()), {}, ["rate_tipping"], aligned=True)


def test_even_spacing_stays_even_when_it_is_mapped():
    base = TimeBase.uniform("imu", 0.0, 1e-3, 100)
    alignment = replace(SHOT.alignments[0], clock="imu", drift=2e-5, offset_s=0.5)
    shot = replace(SHOT, channels={"a": Channel("a", "force", np.zeros(100), base)}, alignments=(alignment,))
    (group,) = gather(shot, {}, aligned=True).groups
    assert group.time_base.step_s == 1e-3 * (1 + 2e-5)
    np.testing.assert_allclose(group.time_base.times_s, alignment.to_reference(base.times_s), rtol=0, atol=1e-15)


def test_an_export_says_of_which_sources_it_has_a_preview_alone():
    live = QualityCheck("dewetron", Check.PREVIEW, "warn", "what was read live is a preview")
    content = gather(replace(SHOT, quality=(*SHOT.quality, live)), {}, ["p_breech"])
    assert content.document["previews"] == ["dewetron"]
    assert any("read live of dewetron is a preview" in note for note in content.notes)
    assert gather(SHOT, {}, ["p_breech"]).document["previews"] == []


def test_what_the_rig_says_of_a_sensor_goes_with_the_channel():
    rig = '[[channel]]\nname = "p_breech"\nsensor = { model = "6215", due = 2027-03-01, range = [0.0, 6e8] }\n'
    content = gather(replace(SHOT, rig_text=rig), {}, ["p_breech"])
    assert content.channel_document(SHOT.channels["p_breech"])["sensor"] == {
        "model": "6215", "due": "2027-03-01", "range": [0.0, 6e8],
    }  # fmt: skip


def test_raw_counts_are_told_to_stay_behind():
    assert "raw counts stay in the shot file" in gather(SHOT, {}, ["p_breech"]).notes[0]
    assert not any("raw counts" in note for note in gather(SHOT, {}, ["x_recoil"]).notes)


FORMULAS = ["=1+1", "+1", "-1", "@SUM(A1)", "a,=cmd|' /C calc'!A0", "a;+1", "a,-1", "a,@x", "\t=1", "\r=1", '",=1,"']


@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_no_cell_of_our_csv_is_a_formula_and_the_names_come_back(tmp_path: Path, separator: str) -> None:
    base = TimeBase.uniform("c", 0.0, 0.5, 3)
    values = np.array([-1.0, 0.0, 2.0])
    shot = Shot("7", "r", "", "c", {n: Channel(n, "force", values, base, signal=n) for n in FORMULAS})
    (file,) = export(shot, "csv", tmp_path)
    lines = file.path.read_text(encoding="utf-8").splitlines()
    for line in lines:
        for row in csv.reader([line], delimiter=separator):
            for cell in row:
                assert not cell.startswith(tuple("=+-@\t\r")) or re.fullmatch(r"-\d.*", cell), line
    recording = recognise(file.path).open(file.path, Declarations("c"))
    assert [signal.name for signal in recording.signals] == FORMULAS


def test_no_control_character_of_a_name_is_in_our_csv(tmp_path: Path) -> None:
    name = "a\x1b[31m\x9b\u202eb"
    shot = Shot("7", "r", "", "c", {name: Channel(name, "force", np.ones(2), TimeBase.uniform("c", 0.0, 0.5, 2))})
    (file,) = export(shot, "csv", tmp_path)
    assert not re.search("[\x00-\x09\x0b-\x1f\x7f-\x9f\u202a-\u202e]", file.path.read_text(encoding="utf-8"))
    recording = recognise(file.path).open(file.path, Declarations("c"))
    assert [signal.name for signal in recording.signals] == [name]
