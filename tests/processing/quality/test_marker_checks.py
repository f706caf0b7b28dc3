import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.tracks.proanalyst_text import ProAnalystTextReader
from recoil_processing.quality.frame_checks import check_duplicated_pictures, check_frame_rate, duplicated_pictures
from recoil_processing.quality.marker_checks import (
    check_distance,
    check_jumps,
    check_marker_noise,
    check_peak_locking,
    check_residual,
    find_jumps,
    marker_noise,
)
from recoil_processing.quality.track_quality import (
    check_battery,
    check_held_ends,
    check_lost_frames,
    check_repeated_frames,
    held_ends,
    rest_begin,
)
from tests.builders.motions import record_motion
from tests.builders.shared_data import shared_file

TIMES_S = np.arange(1500) / 2000


def track(seed: int = 1) -> np.ndarray:
    return record_motion(seed).displacement_m


def still(seed: int = 2) -> np.ndarray:
    return 0.2 + 5e-5 * np.random.default_rng(seed).normal(size=TIMES_S.size)


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 2**32 - 1), st.floats(0.0, 0.05))
def test_a_sound_track_has_no_jump_no_blur_and_no_held_end(seed, lost):
    positions = record_motion(seed, lost_share=lost).displacement_m
    assert check_jumps(TIMES_S, positions, unit="m")[0] == "ok"
    assert check_marker_noise(TIMES_S, positions, unit="m")[0] == "ok"
    assert check_held_ends(positions)[0] == "ok"


@settings(deadline=None, max_examples=25)
@given(st.integers(100, 1400), st.floats(0.015, 0.1), st.booleans())
def test_a_jump_is_found_at_its_frame_whether_the_mark_comes_back_or_not(at, size, back):
    positions = track()
    positions[at : at + 1 if back else None] += size
    assert np.flatnonzero(find_jumps(TIMES_S, positions)).tolist() == [at]


def test_a_jump_is_told_with_its_size_and_speed():
    positions = track()
    positions[900] += 0.0236
    verdict, detail = check_jumps(TIMES_S, positions, unit="m")
    assert verdict == "warn"
    assert "1 jumps of the mark at 0.4500 s" in detail
    assert "track it again with a smaller search window" in detail


def test_noise_that_rises_in_one_part_is_blur_and_none_at_all_is_smoothing():
    positions = track()
    positions[600:800] += 4e-4 * np.random.default_rng(1).normal(size=200)
    verdict, detail = check_marker_noise(TIMES_S, positions, unit="m")
    assert verdict == "warn"
    assert "from 0.3" in detail
    assert "shorten the exposure" in detail
    assert check_marker_noise(TIMES_S, np.round(TIMES_S * 4) / 4, unit="m")[0] == "warn"
    assert check_marker_noise(TIMES_S[:3], track()[:3], unit="m")[0] == "ok"


def test_held_ends_tell_no_noise():
    positions = track()
    positions[:800] = positions[0]
    assert marker_noise(positions) == pytest.approx(5e-5, rel=0.15)


def test_marks_on_one_body_keep_their_distance_until_one_slips():
    first = np.column_stack([track(1), still(3)])
    second = first + np.column_stack([still(4), still(5)])
    assert check_distance(first, second, unit="m")[0] == "ok"
    second[700:, 0] += 3e-4
    verdict, detail = check_distance(first, second, unit="m")
    assert verdict == "warn"
    assert "one of the two marks slips" in detail
    assert check_distance(first[:5], second[:5], unit="m")[0] == "ok"


@pytest.mark.parametrize("locked", [False, True])
def test_positions_that_prefer_whole_pixels_are_found_in_motion(locked):
    pixels = track() / 0.5e-3
    if locked:
        pixels = pixels - 0.1 * np.sin(2 * np.pi * pixels)
    verdict, detail = check_peak_locking(pixels)
    assert verdict == ("warn" if locked else "ok")
    assert ("use its sub-pixel method" in detail) == locked


def test_a_still_mark_tells_no_peak_locking():
    assert check_peak_locking(still() / 0.5e-3)[0] == "ok"


@pytest.mark.parametrize(
    ("off", "innovation", "verdict", "words"),
    [(1, 1.0, "ok", "1 of 1001"), (40, 1.0, "warn", "track it again"), (0, 2.6, "warn", "a dropped frame")],
)
def test_the_residual_to_the_fused_motion_is_judged(off, innovation, verdict, words):
    found, detail = check_residual(1000, off, innovation, (0.5, 1.6))
    assert found == verdict
    assert words in detail


def test_duplicated_pictures_are_told_from_a_feature_that_is_stuck():
    marks = [np.column_stack([track(1), still(3)]), np.column_stack([still(4), still(5)])]
    numbers = np.arange(1500)
    assert check_duplicated_pictures(numbers, marks)[0] == "ok"
    for mark in marks:
        mark[160] = mark[159]
    assert np.flatnonzero(duplicated_pictures(marks)).tolist() == [160]
    verdict, detail = check_duplicated_pictures(numbers, marks)
    assert verdict == "warn"
    assert (
        "1 of 1500 pictures repeat the one before (every feature does), 1 of them in the motion: frames 160" in detail
    )
    assert check_repeated_frames(marks[0][:, 0], duplicated_pictures(marks))[0] == "ok"
    marks[0][150:158] = marks[0][149]
    assert np.flatnonzero(duplicated_pictures(marks)).tolist() == [160]
    verdict, detail = check_repeated_frames(marks[0][:, 0], duplicated_pictures(marks))
    assert verdict == "warn"
    assert "8 repeated positions during the motion" in detail
    assert "the feature is stuck;" in detail


def test_a_few_duplicated_pictures_at_rest_are_mentioned_and_many_are_a_warning():
    marks = [np.column_stack([track(1), still(3)]), np.column_stack([still(4), still(5)])]
    for mark in marks:
        mark[40] = mark[39]
    verdict, detail = check_duplicated_pictures(np.arange(1500), marks)
    assert verdict == "ok"
    assert "frames 40" in detail
    for mark in marks:
        mark[10:80:2] = mark[9:79:2]
    assert check_duplicated_pictures(np.arange(1500), marks)[0] == "warn"
    for mark in marks:
        mark[1:1499:2] = mark[0:1498:2]
    assert check_duplicated_pictures(np.arange(1500), marks)[0] == "fail"


def test_one_feature_alone_tells_no_duplicated_picture():
    assert not duplicated_pictures([np.column_stack([np.zeros(50), np.zeros(50)])]).any()
    assert duplicated_pictures([]).size == 0


@pytest.mark.parametrize(
    ("file_hz", "declared_hz", "verdict", "words"),
    [
        (2000.0, 2000.0, "ok", "agree"),
        (2000.0, None, "ok", "agree"),
        (2000.0, 2015.0, "warn", "correct `frame_rate`"),
        (30.0, 2000.0, "fail", "one of them is the playback rate"),
        (2000.0, 1000.0, "fail", "one of them is the playback rate"),
    ],
)
def test_the_frame_rate_is_compared_with_the_declared_one(file_hz, declared_hz, verdict, words):
    numbers = np.delete(np.arange(1000), [30, 31, 700])
    found, detail = check_frame_rate(numbers / file_hz, numbers, declared_hz)
    assert found == verdict
    assert words in detail


def test_times_that_part_from_their_frame_numbers_are_a_warning():
    numbers = np.arange(1000)
    times = numbers / 2000
    times[600:] += 1 / 2000
    for given_numbers in (numbers,):
        verdict, detail = check_frame_rate(times, given_numbers, 2000.0)
        assert verdict == "warn"
        assert "export one clip with its own frame numbers" in detail
    times[600:] += 0.5 / 2000
    assert check_frame_rate(times, None, 2000.0)[0] == "warn"
    assert check_frame_rate(times[:2], None, 2000.0)[0] == "ok"


def test_a_printed_time_of_few_digits_agrees_with_its_numbers():
    numbers = np.arange(3000)
    assert check_frame_rate(np.round(numbers / 6000, 4) + 1e-12 * numbers, numbers, 6000.0)[0] == "ok"


@pytest.mark.parametrize("apart_m", [0.0, 3e-4, 5e-3])
def test_a_mark_that_does_not_return_to_battery_is_seen_if_it_rests(apart_m):
    times = np.arange(2000) / 2000
    noise = 5e-5 * np.random.default_rng(1).normal(size=2000)
    positions = 0.6 * np.exp(-(((times - 0.4) / 0.08) ** 2)) + apart_m * (times > 0.4) + noise
    verdict, detail = check_battery(times, positions, 5e-5)
    assert verdict == ("warn" if apart_m > 1e-3 else "ok")
    assert f"{1e3 * apart_m:+.1f}" in detail
    begin = rest_begin(times, positions, 5e-5)
    assert 0.6 < times[begin] < 0.75
    assert check_battery(times[:900], positions[:900], 5e-5)[1].startswith("the track ends in motion")
    assert rest_begin(times[:900], positions[:900], 5e-5) is None


def test_a_turning_point_is_no_rest():
    times = np.arange(1200) / 2000
    positions = 0.6 - 15.0 * np.maximum(0.55 - times, 0.0) ** 2 - 5.0 * np.maximum(times - 0.55, 0.0) ** 2
    positions = np.maximum(positions, 0.0) + 5e-5 * np.random.default_rng(1).normal(size=1200)
    assert "ends in motion" in check_battery(times, positions, 5e-5)[1]


def test_a_mark_that_leaves_the_picture_is_told_from_padding():
    positions = track()
    far = int(np.argmax(positions))
    positions[far:] = positions[far]
    assert "the mark left the picture" in check_held_ends(positions)[1]
    padded = track()
    padded[:60] = padded[0]
    assert "the first 60 positions are held at one value" in check_held_ends(padded)[1]
    assert check_held_ends(np.full(50, 1.0))[0] == "ok"


def test_the_generated_tracks_faults_are_found_where_they_are():
    path = shared_file("tracks/SYNTHETIC_proanalyst_like_2000fps.csv")
    recording = ProAnalystTextReader().open(path, Declarations(clock="camera", frame_rate_hz=2000.0))
    moving, fixed = recording.tracks()
    times, numbers = moving.time_base.times_s, moving.frame_numbers
    x = 1e-3 * moving.positions[:, 0]
    assert check_lost_frames(times, x)[1].startswith("17 of 1900 frames lost")  # 16 without position, 901 not recorded
    assert numbers[find_jumps(times, x)].tolist() == [655]
    assert numbers[duplicated_pictures([moving.positions, fixed.positions])].tolist() == [1403]
    assert check_frame_rate(times, numbers, 2000.0)[0] == "ok"
    assert check_frame_rate(times, numbers, 30.0)[0] == "fail"
    assert marker_noise(x) == pytest.approx(5e-5, rel=0.1)
    assert check_jumps(times, 1e-3 * fixed.positions[:, 0], unit="m")[0] == "ok"
    assert check_held_ends(x)[0] == "ok"
    assert check_battery(times, x, marker_noise(x))[0] == "ok"


@pytest.mark.parametrize(
    ("name", "before", "after", "repeats"), [("008_129_DB", 365, 424, 0), ("100_AJ_DB", 232, 704, 1)]
)
def test_real_tracks_are_padded_at_both_ends(name, before, after, repeats):
    path = shared_file(f"tracks/proanalyst_paws_jones2020_{name}.csv")
    table = np.genfromtxt(path, delimiter=",", names=True)
    times = np.arange(table.size) / 2000
    y, x = table["y"], table["x"]
    verdict, detail = check_held_ends(y)
    assert verdict == "warn"
    assert f"the first {before} and the last {after} positions are held at one value" in detail
    assert np.count_nonzero(np.diff(x[before:-after]) == 0) == repeats
    assert check_repeated_frames(x)[0] == "ok"
    assert check_jumps(times, x, unit="mm")[0] == "ok"
    assert 0.005 < marker_noise(y) < 0.15
    jumped = x.copy()
    jumped[before + 20 :] += 23.6
    assert np.flatnonzero(find_jumps(times, jumped)).tolist() == [before + 20]


@pytest.mark.parametrize("step_m", [1e-3, 1e-4, 2.5e-7])
def test_an_encoder_stands_still_at_rest_and_is_not_blamed_for_it(step_m):
    positions = np.round(record_motion(1, marker_sigma_m=0.0).displacement_m / step_m) * step_m
    assert check_held_ends(positions)[0] == "ok"
    assert "it rests without noise" in check_held_ends(positions)[1]
    assert not held_ends(positions).any()
    assert check_marker_noise(TIMES_S, positions, unit="m")[0] == "ok"
    assert check_repeated_frames(positions)[0] == "ok"
    features = [np.column_stack([positions, np.zeros_like(positions)]), np.zeros((positions.size, 2))]
    assert check_duplicated_pictures(np.arange(positions.size), features)[0] == "ok"


def test_a_camera_that_fills_its_ends_is_no_encoder_whatever_its_print():
    for positions in (track(), np.round(track() / 1e-5) * 1e-5):
        positions[:60] = positions[0]
        assert check_held_ends(positions)[0] == "warn"
