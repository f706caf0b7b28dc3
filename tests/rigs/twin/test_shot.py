"""A whole simulated shot: its files as independent programs read them, its truth, its refusals."""

from __future__ import annotations

import binascii
import errno
import io
import json
import struct
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import can
import cantools
import numpy as np
import pandas as pd
import pytest

from recoil_acquisition.errors import RigError, StoreError
from recoil_acquisition.log.capture import read_capture
from recoil_rigs.rig import Rig, find_rig, load_rig, parse_rig
from recoil_rigs.twin import TwinShot, draw_scene, simulate_shot
from recoil_rigs.twin.files import CanFrame, can_log, dewesoft_text
from recoil_rigs.twin.settings import read_settings
from recoil_rigs.twin.sources import Scene
from tests.builders.naive_log import read_file


def variant(name: str, twin: str = "", **replaced: str) -> Rig:
    """A bundled rig with more keys in its table [twin], and texts replaced, underscores standing for themselves."""
    path = find_rig(name)
    text = path.read_text(encoding="utf-8")
    head, _, tail = text.partition("[twin]\n")
    lines = {line.partition("=")[0].strip(): line for line in f"{tail}\n{twin}".splitlines() if "=" in line}
    for old, new in replaced.items():
        assert old in head
        head = head.replace(old, new)
    return parse_rig("\n".join([f"{head}[twin]", *lines.values()]), path)


FAST = "sample_rate_hz = 20000.0\nduration_s = 0.3\npre_trigger_s = 0.05\n"


def times_of(shot: TwinShot, source: str, times: np.ndarray) -> np.ndarray:
    clock = shot.truth["clocks"][source]
    return (1 + clock["drift"]) * times + clock["offset_s"]


def file_of(shot: TwinShot, ending: str) -> Path:
    (path,) = [p for p in shot.files if p.name.endswith(ending)]
    return path


@pytest.fixture(scope="module")
def mixed(tmp_path_factory: pytest.TempPathFactory) -> TwinShot:
    return simulate_shot(variant("mixed", FAST), tmp_path_factory.mktemp("mixed"), seed=11, shot="0042")


@cache
def scene_of_mixed() -> Scene:
    return draw_scene(variant("mixed", FAST), 11, "0042")


@pytest.mark.parametrize("name", ["field-2013", "mixed"])
def test_the_bundled_rigs_load_and_can_be_simulated(name: str) -> None:
    rig = load_rig(name)
    assert rig.name == name
    assert read_settings(rig).sample_rate_hz == 50e3


@pytest.mark.exhaustive
def test_the_recorders_files_a_copy_of_the_rig_and_the_truth_are_there(mixed: TwinShot) -> None:
    names = {p.name for p in mixed.folder.iterdir()}
    assert names == {
        "0042_dewetron.csv", "0042_can.blf", "0042_imu.rdlog", "0042_camera.csv", "mixed.dbc", "rig.toml", "truth.json",
    }  # fmt: skip
    assert [p.name for p in mixed.files] == ["0042_dewetron.csv", "0042_can.blf", "0042_imu.rdlog", "0042_camera.csv"]
    copy = load_rig(mixed.rig_file)
    for path in mixed.files:
        (source,) = copy.matching(path.name)
        assert mixed.truth["sources"][source.name]["file"] == path.name
    assert json.loads(mixed.truth_file.read_text(encoding="utf-8")) == mixed.truth


@pytest.mark.whole_way
def test_a_breech_gauge_that_was_calibrated_at_rest_is_off_in_a_pulse_as_well(tmp_path: Path) -> None:
    serial = 'serial = "V301",'
    dynamic = variant("field-2013", FAST, **{serial: f'{serial} calibration = "dynamic",'})
    at_rest = variant("field-2013", FAST)
    gains = [
        simulate_shot(rig, tmp_path / str(k), seed=seed, shot="1", campaign_seed=5).truth["gains"]
        for k, (rig, seed) in enumerate(((at_rest, 11), (at_rest, 12), (dynamic, 11)))
    ]
    assert gains[0] == gains[1]  # the campaign's
    assert {name for name, gain in gains[0].items() if gain != gains[2][name]} == {"p_breech"}
    scene = draw_scene(at_rest, 1, "1", 1)
    drawn = [replace(scene, campaign_seed=seed).gain_in_pulses(at_rest.channel("p_breech")) for seed in range(400)]
    assert np.mean(drawn) == pytest.approx(1.0, abs=0.001)
    assert np.std(drawn) == pytest.approx(0.005, rel=0.15)
    assert {scene.gain_in_pulses(one) for one in at_rest.channels if one.role != "breech_pressure"} == {1.0}


@pytest.mark.exhaustive
def test_shots_of_one_campaign_share_their_sensors_and_nothing_else(tmp_path):
    rig = variant("mixed", FAST)
    one, other, alone = (
        simulate_shot(rig, tmp_path / str(k), seed=seed, shot="0042", campaign_seed=campaign).truth
        for k, (seed, campaign) in enumerate(((11, 5), (12, 5), (11, None)))
    )
    assert one["gains"] == other["gains"] != alone["gains"]
    assert one["friction"] == other["friction"] != alone["friction"]
    assert one["clocks"] == alone["clocks"] != other["clocks"]
    assert one["offsets"] == alone["offsets"] != other["offsets"]
    assert (one["campaign_seed"], "campaign_seed" in alone) == (5, False)
    with pytest.raises(ValueError, match="campaign_seed must not be negative"):
        simulate_shot(rig, tmp_path / "none", seed=1, shot="1", campaign_seed=-1)


@pytest.mark.exhaustive
def test_the_same_seed_gives_the_same_bytes_and_another_seed_does_not(mixed: TwinShot, tmp_path: Path) -> None:
    again = simulate_shot(variant("mixed", FAST), tmp_path / "again", seed=11, shot="0042")
    other = simulate_shot(variant("mixed", FAST), tmp_path / "other", seed=12, shot="0042")
    for path in mixed.folder.iterdir():
        assert (again.folder / path.name).read_bytes() == path.read_bytes()
    for path in mixed.files:
        assert (other.folder / path.name).read_bytes() != path.read_bytes()


def test_one_channel_less_leaves_the_others_as_they_are(mixed: TwinShot, tmp_path: Path) -> None:
    path = find_rig("mixed")
    text = variant("mixed", FAST).text
    start = text.index('[[channel]]\nname = "acc_carriage_y"')
    less = parse_rig(text[:start] + text[text.index("[[channel]]", start + 5) :], path)
    shot = simulate_shot(less, tmp_path / "less", seed=11, shot="0042")
    a, b = pd.read_csv(file_of(mixed, "dewetron.csv")), pd.read_csv(file_of(shot, "dewetron.csv"))
    assert len(b.columns) == len(a.columns) - 1
    pd.testing.assert_frame_equal(a[b.columns], b)
    assert file_of(shot, "imu.rdlog").read_bytes() == file_of(mixed, "imu.rdlog").read_bytes()


def test_the_recorders_text_has_the_export_header_and_uniform_times(mixed: TwinShot) -> None:
    head = file_of(mixed, "dewetron.csv").read_bytes().split(b"\r\n", 2)
    assert head[0] == (
        b"Time (s),AI 1/acc_recoil (m/s2),AI 2/acc_carriage_x (m/s2),AI 3/acc_carriage_y (m/s2),AI 4/p_breech (MPa)"
    )
    assert head[1].startswith(b"0.000000,")
    table = pd.read_csv(file_of(mixed, "dewetron.csv"))
    np.testing.assert_allclose(table["Time (s)"], np.arange(6000) / 20e3, atol=1e-9)
    peak = table["AI 4/p_breech (MPa)"].max() * 1e6 * 0.00883 / mixed.truth["gains"]["p_breech"]
    assert peak == pytest.approx(mixed.truth["peak_breech_force_n"], rel=0.02)


def test_the_semicolon_style_holds_the_same_numbers() -> None:
    columns = {"AI 1/a (m/s2)": np.array([1.5, -2.25e-5]), "AI 2/b ()": np.array([0.0, 1e9])}
    times = np.array([0.0, 2e-5])
    comma = pd.read_csv(io.BytesIO(dewesoft_text(times, columns, "comma")))
    raw = dewesoft_text(times, columns, "semicolon")
    assert raw.startswith(b"\xef\xbb\xbfTime (s);AI 1/a (m/s2);AI 2/b ()\r\n0,000000;1,5;0\r\n")
    pd.testing.assert_frame_equal(comma, pd.read_csv(io.BytesIO(raw), sep=";", decimal=",", encoding="utf-8-sig"))


def test_the_tracks_have_lost_missing_and_repeated_frames_where_the_truth_says(mixed: TwinShot) -> None:
    table = pd.read_csv(file_of(mixed, "camera.csv"))
    hidden = mixed.truth["sources"]["camera"]
    assert list(table.columns) == [
        "Frame", "Time (s)", "Feature #1 - X (mm)", "Feature #1 - Y (mm)", "Feature #2 - X (mm)", "Feature #2 - Y (mm)",
    ]  # fmt: skip
    frames = table["Frame"].to_numpy()
    assert sorted(set(range(frames[-1] + 1)) - set(frames)) == hidden["missing_frames"]
    assert len(hidden["missing_frames"]) == 2
    lost = (table.iloc[:, 2:] == -1).all(axis=1)
    assert frames[lost].tolist() == hidden["lost_frames"] == mixed.truth["lost_frames"]
    by_frame = table.set_index("Frame")
    for frame in hidden["repeated_frames"]:
        if frame - 1 in by_frame.index and frame - 1 not in hidden["lost_frames"]:
            np.testing.assert_array_equal(by_frame.iloc[:, 1:].loc[frame], by_frame.iloc[:, 1:].loc[frame - 1])
    np.testing.assert_allclose(table["Time (s)"], frames / 6000.0, atol=5.1e-7)
    assert b",-1,-1,-1,-1\r\n" in file_of(mixed, "camera.csv").read_bytes()


def test_a_dropped_frame_leaves_no_gap_in_the_numbers_and_makes_what_follows_early(tmp_path: Path) -> None:
    rig = variant("mixed", FAST + "camera_dropped = 1\ncamera_missing = 0")
    shot = simulate_shot(rig, tmp_path / "dropped", seed=11, shot="0042")
    (dropped,) = shot.truth["sources"]["camera"]["dropped_frames"]
    table = pd.read_csv(file_of(shot, "camera.csv"))
    frames = table["Frame"].to_numpy()
    assert frames.tolist() == list(range(frames.size))
    motion = scene_of_mixed().motion
    seen = ~np.isin(frames + (frames >= dropped), shot.truth["lost_frames"])
    at = times_of(shot, "camera", (frames + (frames >= dropped)) / 6000.0)
    true = np.interp(at, motion.times_s, motion.q[:, 4]) * shot.truth["gains"]["x_camera"]
    error = (table["Feature #1 - X (mm)"].to_numpy() * 1e-3 - true)[seen]
    assert np.median(np.abs(error)) < 5e-5
    assert np.count_nonzero(np.abs(error) > 4e-4) <= 1  # but for the repeated picture


@pytest.mark.parametrize(("stamp", "share"), [("start", 0.5), ("middle", 0.0), ("end", -0.5)])
def test_a_frames_picture_is_that_of_the_middle_of_its_exposure(mixed: TwinShot, tmp_path: Path, stamp, share) -> None:
    declared = f'frame_rate = 6000.0\nexposure_s = 1e-4\nexposure_stamp = "{stamp}"'
    rig = variant("mixed", FAST, **{"frame_rate = 6000.0": declared})
    shot = simulate_shot(rig, tmp_path / stamp, seed=11, shot="0042")
    sharp, blurred = (pd.read_csv(file_of(s, "camera.csv")) for s in (mixed, shot))
    x = "Feature #1 - X (mm)"
    seen = (sharp[x] != -1).to_numpy()
    motion = scene_of_mixed().motion
    at = times_of(mixed, "camera", sharp["Frame"].to_numpy() / 6000.0)
    speed = np.interp(at, motion.times_s, motion.qd[:, 4]) * 1e3
    moved = (blurred[x] - sharp[x]).to_numpy()
    late = float((moved * speed)[seen].sum() / (speed**2)[seen].sum())
    assert late == pytest.approx(share * 1e-4, abs=2e-6)


def test_a_channel_that_is_sampled_late_repeats_the_others_motion_later() -> None:
    scene = scene_of_mixed()
    late = draw_scene(variant("mixed", FAST + "skew_s = { acc_recoil = 1e-3 }\nnoise = 0.0"), 11, "0042")
    still = draw_scene(variant("mixed", FAST + "noise = 0.0"), 11, "0042")
    spec = scene.rig.channel("acc_recoil")
    at = np.arange(0.04, 0.2, 5e-5)
    np.testing.assert_allclose(late.samples(spec, at), still.samples(spec, at - 1e-3), atol=1e-9)


def test_hum_is_a_line_at_the_mains_frequency_and_nothing_else() -> None:
    quiet = draw_scene(variant("mixed", FAST + "noise = 0.0\nbits = 0"), 11, "0042")
    humming = draw_scene(variant("mixed", FAST + "noise = 0.0\nbits = 0\nhum = 0.001"), 11, "0042")
    spec = quiet.rig.channel("acc_recoil")
    at = np.arange(0.0, 0.3, 5e-5)
    hum = humming.samples(spec, at) - quiet.samples(spec, at)
    spectrum = np.abs(np.fft.rfft(hum)) * 2 / hum.size
    frequency = np.fft.rfftfreq(hum.size, 5e-5)
    assert frequency[np.argmax(spectrum)] == pytest.approx(50.0)
    assert spectrum.max() == pytest.approx(0.001 * 5000.0, rel=0.02)
    assert np.sort(spectrum)[-2] < 0.01 * spectrum.max()


def test_the_tracks_follow_the_true_travel_on_the_true_clock(mixed: TwinShot) -> None:
    motion = scene_of_mixed().motion
    table = pd.read_csv(file_of(mixed, "camera.csv"))
    hidden = mixed.truth["sources"]["camera"]
    good = ~table["Frame"].isin(hidden["lost_frames"] + hidden["repeated_frames"]).to_numpy()
    at = times_of(mixed, "camera", table["Frame"].to_numpy()[good] / 6000.0)
    true = np.interp(at, motion.times_s, motion.q[:, 4]) * mixed.truth["gains"]["x_camera"]
    error = table["Feature #1 - X (mm)"].to_numpy()[good] * 1e-3 - true
    assert np.std(error) == pytest.approx(5e-5, rel=0.1)
    assert np.abs(error).max() < 3e-4
    late = np.interp(at + 2e-4, motion.times_s, motion.q[:, 4])
    assert np.std(table["Feature #1 - X (mm)"].to_numpy()[good] * 1e-3 - late) > 2e-4
    assert (mixed.truth["cam_offset"], mixed.truth["cam_drift"]) == tuple(mixed.truth["clocks"]["camera"].values())


def can_messages(path: Path) -> list[can.Message]:
    with can.LogReader(path) as reader:
        return list(reader)


def test_the_can_log_decodes_to_the_true_pressure_on_the_true_clock(mixed: TwinShot) -> None:
    database = cantools.database.load_file(mixed.folder / "mixed.dbc")
    messages = can_messages(file_of(mixed, "can.blf"))
    first = messages[0].timestamp
    assert sum(m.is_error_frame for m in messages) == 1
    assert len({m.arbitration_id for m in messages if not m.is_error_frame}) == 4
    own = [m for m in messages if m.arbitration_id == 288]
    decoded = pd.DataFrame([database.decode_message(288, m.data) for m in own])
    assert set(np.diff(decoded["counter"]) % 256) == {1}
    latency = mixed.truth["clocks"]["can"]["latency_s"]
    stamps = np.array([m.timestamp - first for m in own])
    wait = np.diff(stamps) - 0.0005
    assert np.abs(wait).max() < 2.1e-4
    assert np.abs(wait).max() > 2e-5
    motion = scene_of_mixed().motion
    delay = 0.00042
    at = times_of(mixed, "can", stamps - latency) - delay
    for name, true in (("p_brake", motion.brake_pressure_pa), ("p_recuperator", motion.recuperator_pressure_pa)):
        expected = np.interp(at, motion.times_s, true) * 1e-6 * mixed.truth["gains"][name]
        error = decoded[name].astype(float) - expected - mixed.truth["offsets"][name]
        assert np.std(error) < 0.06
        assert abs(np.mean(error)) < 0.01


def test_an_asc_log_holds_the_same_frames_as_a_blf_log_and_no_time_of_day() -> None:
    frames = [
        CanFrame(0.0, 0x18FEF100, True, b"\x01\x02"),
        CanFrame(0.0125, 288, False, bytes(8)),
        CanFrame(0.02, 0, False, None),
    ]
    asc = can_log(frames, "asc")
    assert asc == can_log(list(reversed(frames)), "asc")
    assert asc.count(b"Mon Mar 02 08:00:00.000 2026") == 2
    read = list(can.ASCReader(io.StringIO(asc.decode())))
    assert [(round(m.timestamp, 6), m.arbitration_id, bytes(m.data)) for m in read[:2]] == [
        (0.0, 0x18FEF100, b"\x01\x02"),
        (0.0125, 288, bytes(8)),
    ]
    assert read[2].is_error_frame
    blf = list(can.BLFReader(io.BytesIO(can_log(frames, "blf"))))
    assert [round(m.timestamp - blf[0].timestamp, 6) for m in blf] == [0.0, 0.0125, 0.02]
    with pytest.raises(ValueError, match="stamp 0"):
        can_log(frames[1:], "blf")


def capture_records(path: Path) -> list[tuple[int, bytes]]:
    session, *reads = read_file(path)
    assert json.loads(json.loads(session.payload)["text"]) == {"sources": [{"name": "imu", "kind": "serial"}]}
    assert [(one.source, one.kind, one.source_number) for one in reads] == [(0, 2, i) for i in range(len(reads))]
    assert [one.position for one in reads] == [sum(len(one.payload) for one in reads[:i]) for i in range(len(reads))]
    return [(one.host_ns, one.payload) for one in reads]


def sound_frames(stream: bytes) -> list[tuple[Any, ...]]:
    found, place = [], 0
    while (place := stream.find(b"\xaa\x55", place)) >= 0 and place + 34 <= len(stream):
        frame = stream[place : place + 34]
        if binascii.crc_hqx(frame[2:32], 0xFFFF) == struct.unpack("<H", frame[32:])[0]:
            found.append(struct.unpack("<HIfffffI", frame[2:32]))
            place += 34
        else:
            place += 1
    return found


def test_the_capture_holds_all_frames_but_the_damaged_ones_and_follows_the_true_rates(mixed: TwinShot) -> None:
    records = capture_records(file_of(mixed, "imu.rdlog"))
    host = np.array([r[0] for r in records])
    assert host[0] == 0
    assert (np.diff(host) > 0).all()
    frames = sound_frames(b"".join(r[1] for r in records))
    hidden = mixed.truth["sources"]["imu"]
    counter = np.array([f[0] for f in frames])
    order = (counter - counter[0]) % 65536
    assert sorted(set(range(order[-1] + 1)) - set(order)) == hidden["damaged_frames"]
    assert len(hidden["damaged_frames"]) == 2
    ticks = (np.array([f[1] for f in frames]) - hidden["ticks_at_zero"]) % 2**32
    np.testing.assert_array_equal(ticks, order * 1000)
    at = times_of(mixed, "imu", ticks * 1e-6)
    motion = scene_of_mixed().motion
    rate = np.interp(at - 0.00135, motion.times_s, motion.qd[:, 2] + motion.qd[:, 3])
    seen = np.array([f[3] for f in frames])
    error = seen - rate * mixed.truth["gains"]["gyro_tipping"] - mixed.truth["offsets"]["gyro_tipping"]
    assert np.std(error) < 0.008


def test_the_host_stamps_bytes_after_they_were_sampled(mixed: TwinShot) -> None:
    records = capture_records(file_of(mixed, "imu.rdlog"))
    hidden = mixed.truth["sources"]["imu"]
    host = hidden["host_clock"]
    late = []
    for host_ns, data in records[1:]:
        if len(data) == 34 and data[:2] == b"\xaa\x55":
            ticks = (struct.unpack_from("<I", data, 4)[0] - hidden["ticks_at_zero"]) % 2**32
            sampled = float(times_of(mixed, "imu", np.array([ticks * 1e-6]))[0])
            late.append((1 + host["drift"]) * host_ns * 1e-9 + host["offset_s"] - sampled)
    assert len(late) > 100
    assert min(late) > 34 * 10 / 921600 - 1e-6
    assert np.mean(late) == pytest.approx(host["latency_s"], abs=1e-4)


def test_the_capture_is_one_that_the_program_reads(mixed: TwinShot) -> None:
    capture = read_capture(file_of(mixed, "imu.rdlog"))
    assert (capture.losses, capture.damages, capture.unfinished_bytes) == ((), (), 0)
    records = capture_records(file_of(mixed, "imu.rdlog"))
    assert [(one.host_ns, one.payload) for one in capture.of(0)] == records


@pytest.mark.exhaustive
def test_the_truth_states_mass_events_and_errors(mixed: TwinShot, tmp_path: Path) -> None:
    truth = mixed.truth
    assert (truth["m3"], truth["seed"], truth["shot"], truth["t_fire"]) == (782.0, 11, "0042", 0.05)
    assert truth["t_end"] == pytest.approx(scene_of_mixed().motion.t_end_s)
    assert set(truth["gains"]) == {c.name for c in load_rig("mixed").channels}
    assert set(truth["clocks"]) == {"can", "imu", "camera"}
    for clock in truth["clocks"].values():
        assert abs(clock["offset_s"]) <= 0.033
        assert abs(clock["drift"]) <= 6e-5
    assert truth["friction"] != 1500.0
    plain = variant("field-2013", FAST + "gain_errors = false\nfriction_error = false\nm3_true = 800.0\n")
    shot = simulate_shot(plain, tmp_path / "plain", seed=1, shot="1")
    assert (shot.truth["m3"], shot.truth["friction"]) == (800.0, 1500.0)
    assert set(shot.truth["gains"].values()) == {1.0}


def test_an_existing_file_is_never_overwritten(tmp_path: Path) -> None:
    (tmp_path / "0042_imu.rdlog").write_bytes(b"mine")
    with pytest.raises(StoreError, match=r"0042_imu\.rdlog: exists already"):
        simulate_shot(variant("mixed", FAST), tmp_path, seed=11, shot="0042")
    assert [p.name for p in tmp_path.iterdir()] == ["0042_imu.rdlog"]
    assert (tmp_path / "0042_imu.rdlog").read_bytes() == b"mine"


def test_a_disk_that_fills_up_leaves_no_part_of_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = Path.write_bytes

    def full_before_the_camera(path: Path, content: bytes) -> int:
        if "camera" in path.name:
            whole(path, content[: len(content) // 2])
            raise OSError(errno.ENOSPC, "No space left on device")
        return whole(path, content)

    monkeypatch.setattr(Path, "write_bytes", full_before_the_camera)
    with pytest.raises(StoreError, match="cannot be written: No space left on device; choose another folder"):
        simulate_shot(variant("field-2013", FAST), tmp_path / "shot", seed=1, shot="1")
    assert not list((tmp_path / "shot").iterdir())


@pytest.mark.exhaustive
def test_a_folder_that_cannot_be_made_is_reported(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(StoreError, match="cannot be written"):
        simulate_shot(variant("field-2013", FAST), tmp_path / "file" / "shot", seed=1, shot="1")


@pytest.mark.parametrize(
    ("twin", "key"),
    [
        ("ringin = 1.0", "twin.ringin: unknown key; did you mean `ringing`"),
        ("noise = -1.0", "twin.noise: "),
        ("serial_rate_hz = 0.0", "twin.serial_rate_hz: "),
        ("pre_trigger_s = 2.0", "twin.pre_trigger_s: must be shorter"),
        ("clock_offset_s = 0.3", "twin.clock_offset_s: must be shorter"),
        ("camera_lost = 1000\ncamera_missing = 1000\ncamera_repeated = 1000", "twin.camera_lost: 3000 faulty"),
        ("duration_s = 0.2", "twin.duration_s: the recoil does not end"),
        ("recuperator_volume_m3 = 0.005", "twin.recuperator_volume_m3: must exceed"),
        ("recuperator_pressure_pa = 1000.0", "twin.recuperator_pressure_pa: does not hold"),
        ('measures = { nobody = "breech_pressure" }', "twin.measures.nobody: no such channel"),
        ('measures = { acc_recoil = "brech_pressure" }', "did you mean `breech_pressure`"),
        ('measures = { acc_recoil = "breech_pressure" }', "breech_pressure is no acceleration"),
        ("skew_s = { acc_recol = 1e-4 }", "twin.skew_s.acc_recol: no such channel; did you mean `acc_recoil`?"),
    ],
)
def test_faults_of_the_twin_table_are_reported_with_their_keys(tmp_path: Path, twin: str, key: str) -> None:
    with pytest.raises(RigError) as caught:
        simulate_shot(variant("field-2013", FAST + twin), tmp_path / "x", seed=1, shot="1")
    assert key in str(caught.value)
    assert not (tmp_path / "x").exists()


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    ("old", "new", "key"),
    [
        ('signal = "RecoilNode.p_brake"', 'signal = "RecoilNod.p_brake"', "no message 'RecoilNod'"),
        ('signal = "RecoilNode.p_brake"', 'signal = "RecoilNode.p_brak"', "did you mean 'p_brake'"),
        ('signal = "gyro_tipping"', 'signal = "gyro_tiping"', "did you mean 'gyro_tipping'"),
        ('signal = "Feature #1 - X"', 'signal = "Feature 1"', "should end in ' - X'"),
        ("m1 = 1450.0", "", "mechanism.m1: is missing"),
        ("modulo = 4294967296", "", "source 'imu'.framing: a virtual sensor speaks"),
        ("frame_rate = 6000.0", "", "source 'camera'.frame_rate: is missing"),
        ('match = "*_camera.csv"', 'match = "*.csv"', "would also match"),
    ],
)
def test_a_rig_that_cannot_be_simulated_says_why(tmp_path: Path, old: str, new: str, key: str) -> None:
    with pytest.raises(RigError) as caught:
        simulate_shot(variant("mixed", FAST, **{old: new}), tmp_path / "x", seed=1, shot="1")
    assert key in str(caught.value)
    assert not (tmp_path / "x").exists()


def test_a_channel_without_a_role_needs_to_say_what_it_measures(tmp_path: Path) -> None:
    with pytest.raises(RigError, match=r"twin\.measures\.p_brake"):
        simulate_shot(variant("mixed", FAST, **{'role = "brake_pressure"\n': ""}), tmp_path / "x", seed=1, shot="1")
    told = variant("mixed", FAST + 'measures = { p_brake = "brake_pressure" }', **{'role = "brake_pressure"\n': ""})
    assert simulate_shot(told, tmp_path / "y", seed=1, shot="1").truth["gains"]["p_brake"] != 1.0


@pytest.mark.parametrize("shot", ["", "a/b", "..", "."])
def test_a_name_that_is_no_file_name_is_refused(tmp_path: Path, shot: str) -> None:
    with pytest.raises(ValueError, match="shot"):
        simulate_shot(load_rig("mixed"), tmp_path, seed=1, shot=shot)


def test_a_negative_seed_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="seed"):
        simulate_shot(load_rig("mixed"), tmp_path, seed=-1, shot="1")


def test_file_names_follow_the_match_patterns(tmp_path: Path) -> None:
    rig = variant(
        "field-2013",
        FAST,
        **{'match = "*_dewetron.csv"': 'match = "*daq*.csv"', 'match = "*_camera.csv"': 'match = "track*"'},
    )
    shot = simulate_shot(rig, tmp_path / "x", seed=1, shot="7")
    assert [p.name for p in shot.files] == ["7_daq.csv", "track_7.csv"]
    assert [len(rig.matching(p.name)) for p in shot.files] == [1, 1]
