from __future__ import annotations

import datetime as dt
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from recoil_acquisition.shot.quality_check import QualityCheck
from recoil_acquisition.shot.shot import Shot
from recoil_daq.recording.ingest import ingest_files
from recoil_processing.shot.verdict.shot_quality import check_shot
from recoil_rigs.rig import Rig, load_rig
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.tables.calibration_day import CalibrationDay, DayOf
from recoil_rigs.twin import simulate_shot, with_settings
from tests.builders.bench_shots import ArrayRecording, bench_motion, bench_rig, bench_shot
from tests.builders.virtual_shots import virtual_shot, with_channels, without_channels

UNTOLD = "the ingest of 2026-03-11 (nothing states when the shot was fired)"
ON = CalibrationDay(dt.date(2026, 6, 1), DayOf.START)
RNG = np.random.default_rng(1)
NOISE = RNG.normal(size=bench_motion().times_s.size)


def noisy_shot(**samples: np.ndarray) -> Shot:
    motion = bench_motion()
    recorded = {
        "acc": motion.acceleration_m_s2 + 0.5 * NOISE,
        "p_breech": motion.breech_pa + 1e4 * NOISE,
        "p_brake": motion.brake_pa + 1e3 * NOISE,
        "p_recuperator": motion.recuperator_pa + 1e2 * NOISE,
    }
    return bench_shot(**recorded | samples)


def checks(shot: Shot, rig: Rig, *, on: CalibrationDay = ON, **recordings: ArrayRecording) -> tuple[QualityCheck, ...]:
    return check_shot(FiredShot(shot, rig), shot.alignments, recordings, on)


def one(found: tuple[QualityCheck, ...], channel: str, check: str) -> QualityCheck:
    (match,) = [c for c in found if (c.channel, c.check) == (channel, check)]
    return match


def test_a_sound_shot_has_no_failed_check():
    found = checks(noisy_shot(), bench_rig())
    assert {c.verdict for c in found} == {"ok"}
    expected = {
        "losses",
        "range",
        "held values",
        "baseline",
        "steady baseline",
        "filtered noise",
        "out of band",
    }
    expected |= {"hum", "aliasing", "spectral gap", "polarity", "force sign", "zero shift", "skew"}
    assert {c.check for c in found if c.channel == "acc"} == expected
    assert {c.check for c in found if c.channel == "shot"} == {"impulse", "braking"}


def test_the_virtual_rigs_shots_are_usable():
    for name in ("field-2013", "mixed"):
        shot = virtual_shot(name).shot
        assert shot.usable, shot.reasons
        assert one(shot.quality, "camera", "alignment").verdict == "ok"
        assert one(shot.quality, "acc_recoil", "zero shift").verdict == "ok"


@pytest.mark.whole_way
def test_what_may_move_at_any_time_is_held_neither_to_its_battery_nor_to_an_impulse(tmp_path: Path):
    rig = with_settings(load_rig("sled"), {"sample_rate_hz": 5000.0})
    files = simulate_shot(rig, tmp_path / "files", seed=7, shot="1").files
    shot = ingest_files(rig, files, shot="1", out=tmp_path, on=ON.on).shot
    assert one(shot.quality, "x_sled", "marker noise").verdict == "ok"
    of_one_recoil = {"battery", "rest to rest", "impulse", "braking", "velocity", "second sensor"}
    assert not {c.check for c in (*shot.quality, *checks(without_channels(shot, "acc_sled"), rig))} & of_one_recoil


def test_a_clipped_range_fails():
    rig = bench_rig(acc="range = [-500.0, 500.0]")
    clipped = np.clip(bench_motion().acceleration_m_s2 + 0.5 * NOISE, -500.0, 500.0)
    check = one(checks(noisy_shot(acc=clipped), rig), "acc", "range")
    assert check.verdict == "fail"
    assert "raise the range" in check.detail


def test_the_range_is_in_the_channels_unit():
    rig = bench_rig(pressure_unit="MPa", p_breech="range = [-25.0, 250.0]")
    assert "52 % of the range" in one(checks(noisy_shot(), rig), "p_breech", "range").detail


def test_a_source_without_a_file_fails_and_says_what_is_missing():
    virtual = virtual_shot("mixed")
    partial = without_channels(virtual.shot, "p_brake", "p_recuperator", "acc_recoil_can")
    check = one(checks(partial, virtual.rig), "can", "file")
    assert check.verdict == "fail"
    assert "no file of source can was given: p_brake, p_recuperator" in check.detail


def test_what_the_reader_noted_and_a_file_that_was_cut_off_are_passed_on():
    recording = ArrayRecording({}, notes=("3 rows lost",), incomplete="line 17 ends in the middle")
    found = checks(noisy_shot(), bench_rig(), recorder=recording)
    note, file = one(found, "recorder", "reader"), one(found, "recorder", "file")
    assert (note.verdict, note.detail) == ("ok", "3 rows lost")
    assert (file.verdict, file.detail) == ("warn", "was cut off: line 17 ends in the middle")


@pytest.mark.parametrize(
    ("names", "count"),
    [(("0007_daq.csv", "0008_cam.csv"), 1), (("0007_daq.csv", "0007_cam.csv"), 0), (("0007_daq.csv", "cam2.csv"), 0)],
)
def test_files_with_the_numbers_of_two_shots_are_a_warning(names, count):
    virtual = virtual_shot()
    recordings = {s: ArrayRecording({}, path=Path(n)) for s, n in zip(("dewetron", "camera"), names, strict=True)}
    found = [c for c in checks(virtual.shot, virtual.rig, **recordings) if c.check == "file names"]
    assert [c.verdict for c in found] == ["warn"] * count


@pytest.mark.parametrize(
    ("day", "of", "said"),
    [
        ("2026-03-01", DayOf.START, []),
        ("2025-03-01", DayOf.START, []),
        ("2026-03-11", DayOf.START, ["calibration was due 2026-03-01, 10 days before the shot of 2026-03-11"]),
        ("2026-03-11", DayOf.INGEST, [f"calibration was due 2026-03-01, 10 days before {UNTOLD}"]),
        ("2025-02-27", DayOf.GIVEN, ["calibrated 2025-03-01, 2 days after the shot of 2025-02-27"]),
    ],
)  # fmt: skip
def test_a_calibration_that_does_not_cover_the_day_warns(day, of, said):
    rig = bench_rig(p_brake="calibrated = 2025-03-01, due = 2026-03-01")
    found = checks(noisy_shot(), rig, on=CalibrationDay(dt.date.fromisoformat(day), of))
    told = [c for c in found if c.check == "calibration"]
    assert [(c.channel, c.verdict, c.detail) for c in told] == [("p_brake", "warn", one) for one in said]


@pytest.mark.parametrize("name", ["acc", "p_breech", "p_brake", "p_recuperator"])
@pytest.mark.parametrize("ranged", ["", "range = [-3e8, 3e8]"])
def test_a_channel_that_never_changes_fails_whether_or_not_its_range_is_known(name, ranged):
    rig = bench_rig(**{name: ranged} if ranged else {})
    shot = noisy_shot(**{name: np.full(NOISE.size, 1.5e6)})
    check = one(checks(shot, rig), name, "constant")
    assert check.verdict == "fail"
    assert "always 1.5e+06" in check.detail


def test_a_constant_channel_that_nothing_is_made_of_is_a_warning():
    table = '[[channel]]\nname = "oil"\nsource = "recorder"\nsignal = "oil"\nquantity = "temperature"\n'
    shot = noisy_shot()
    oil = replace(
        shot.channels["p_brake"], name="oil", quantity="temperature", role="", samples=np.full(NOISE.size, 290.0)
    )
    shot = replace(shot, channels={**shot.channels, "oil": oil})
    assert one(checks(shot, bench_rig(tables=table)), "oil", "constant").verdict == "warn"


def test_a_constant_channel_that_a_clock_is_aligned_by_fails():
    virtual = virtual_shot("mixed")
    size = virtual.shot.channels["imu_acc_x"].samples.size
    found = checks(with_channels(virtual.shot, imu_acc_x=np.zeros(size)), virtual.rig)
    assert one(found, "imu_acc_x", "constant").verdict == "fail"


def test_a_code_of_a_sensor_is_named_and_the_level_of_a_trigger_pulse_is_none():
    coded = noisy_shot().channels["p_brake"].samples.copy()
    coded[40:60] = -9999e6
    assert one(checks(noisy_shot(p_brake=coded), bench_rig()), "p_brake", "code").verdict == "fail"
    table = '[[channel]]\nname = "sync"\nsource = "recorder"\nsignal = "sync"\nquantity = "{}"\n'
    shot = noisy_shot()
    samples = np.where(np.arange(NOISE.size) % 300 < 40, 5.0, 0.01 * NOISE)
    for quantity, expected in (("voltage", []), ("temperature", ["warn"])):
        sync = replace(shot.channels["p_brake"], name="sync", quantity=quantity, role="", samples=samples)
        found = checks(
            replace(shot, channels={**shot.channels, "sync": sync}), bench_rig(tables=table.format(quantity))
        )
        assert [c.verdict for c in found if (c.channel, c.check) == ("sync", "code")] == expected


@pytest.mark.parametrize("left", [0, 5])
def test_a_channel_without_samples_fails(left):
    lost = np.full(NOISE.size, np.nan)
    lost[:left] = NOISE[:left]
    found = checks(noisy_shot(p_brake=lost), bench_rig())
    assert one(found, "p_brake", "losses").verdict == "fail"
    assert len([c for c in found if c.channel == "p_brake"]) == 1


@pytest.mark.parametrize("name", ["acc", "p_breech"])
def test_a_wrong_polarity_fails_with_the_remedy(name):
    shot = noisy_shot()
    turned = with_channels(shot, **{name: -np.asarray(shot.channels[name].samples)})
    found = checks(turned, bench_rig())
    failed = [c for c in found if c.verdict == "fail"]
    # a breech pressure against its polarity shows no shot, which is what the onset says
    wanted = ("acc", "polarity") if name == "acc" else ("shot", "onset")
    (check,) = (c for c in failed if (c.channel, c.check) == wanted)
    assert "`polarity" in check.detail


def test_a_record_without_a_shot_fails():
    check = one(checks(noisy_shot(p_breech=1e4 * NOISE), bench_rig()), "shot", "onset")
    assert check.verdict == "fail"
    assert "shows no shot" in check.detail


def test_an_offset_out_of_proportion_fails_and_that_of_a_piezo_chain_is_no_offset():
    motion = bench_motion()
    high = motion.acceleration_m_s2 + 300.0 + 0.5 * NOISE
    assert one(checks(noisy_shot(acc=high), bench_rig()), "acc", "baseline").verdict == "fail"
    assert one(checks(noisy_shot(acc=high), bench_rig(acc="time_constant_s = 1.0")), "acc", "baseline").verdict == "ok"


@pytest.mark.exhaustive
def test_a_failed_and_an_ambiguous_alignment_are_reported_with_their_reasons():
    virtual = virtual_shot()
    (good,) = virtual.shot.alignments
    for status, verdict in (("failed", "fail"), ("ambiguous", "warn")):
        bad = replace(good, status=status, reasons=("two candidates",))
        found = check_shot(FiredShot(virtual.shot, virtual.rig), [bad], {}, ON)
        check = one(found, "camera", "alignment")
        assert check.verdict == verdict
        assert "two candidates" in check.detail
    # nothing is said about polarity, velocity or zero by a clock that failed; the forces tell the zero then
    failed = check_shot(FiredShot(virtual.shot, virtual.rig), [replace(good, status="failed", reasons=("x",))], {}, ON)
    assert "against the forces" in one(failed, "acc_recoil", "zero shift").detail
    assert not {c.check for c in failed if c.channel == "x_camera"} & {"polarity", "velocity", "residual"}


@pytest.mark.exhaustive
def test_a_zero_that_moved_during_the_shot_is_seen_against_the_camera():
    virtual = virtual_shot()
    (good,) = virtual.shot.alignments
    c0, c1, _ = good.details["integration_constants"]
    peak = float(np.nanmax(np.abs(virtual.shot.channels["acc_recoil"].samples)))
    for share, verdict in ((0.0, "ok"), (-0.02, "warn"), (-0.1, "fail")):
        moved = replace(good, details={**good.details, "integration_constants": [c0, c1, share * peak]})
        check = one(check_shot(FiredShot(virtual.shot, virtual.rig), [moved], {}, ON), "acc_recoil", "zero shift")
        assert check.verdict == verdict
    assert "zero moved by +" in check.detail


@pytest.mark.exhaustive
@pytest.mark.parametrize("size_pa", [400e3, -400e3])
def test_a_breech_gauge_whose_zero_moved_takes_no_momentum_from_the_brake(size_pa):
    """Once the bore is empty the gauge reads its zero alone: a shot is not sent back for it."""
    virtual = virtual_shot("mixed", u_zero_rel=0.001)
    breech, brake = virtual.shot.channels["p_breech"], virtual.shot.channels["p_brake"]
    since = np.maximum(breech.time_base.times_s - virtual.truth["t_fire"], 0.0)
    moved = replace(breech, samples=breech.samples - size_pa * np.expm1(-since / 0.01))
    shot = replace(virtual.shot, channels={**virtual.shot.channels, "p_breech": moved})
    found = checks(shot, virtual.rig)
    assert one(found, "shot", "braking").verdict == "ok"
    assert one(found, "shot", "impulse").verdict == "ok"
    high = replace(shot, channels={**shot.channels, "p_brake": replace(brake, samples=1.15 * brake.samples)})
    assert one(checks(high, virtual.rig), "shot", "braking").verdict == "warn"


def test_a_unit_of_a_file_that_is_none_warns_that_the_rigs_counts():
    virtual = virtual_shot()
    spec = next(one for one in virtual.rig.channels if one.source == "dewetron")
    own = spec.model_copy(update={"unit": "MPa"})
    rig = replace(virtual.rig, channels=tuple(own if c is spec else c for c in virtual.rig.channels))
    for stated, warns in (("furlong", True), ("MPa", False), ("", False)):
        recorder = ArrayRecording({spec.signal: np.ones(3)}, {spec.signal: stated}, path=Path("0001.csv"))
        of_shot = checks(virtual.shot, rig, dewetron=recorder)
        found = [c for c in of_shot if (c.channel, c.check) == (spec.name, "reader")]
        assert [c.verdict for c in found] == ["warn"] * warns
        assert all("'furlong', which is no known unit: the rig's 'MPa' counts" in c.detail for c in found)
