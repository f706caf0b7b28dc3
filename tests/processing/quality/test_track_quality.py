import numpy as np
import pytest

from recoil_processing.quality.frame_checks import duplicated_pictures
from recoil_processing.quality.track_quality import check_held_ends, check_lost_frames, check_repeated_frames
from tests.builders.motions import record_motion

TIMES_S = np.arange(1500) / 2000


def track(seed: int = 1) -> np.ndarray:
    return record_motion(seed).displacement_m


def test_a_whole_track_is_ok():
    assert check_lost_frames(TIMES_S, track()) == ("ok", "0 of 1500 frames lost (0.0 %), longest gap 0.0 ms")


def test_frames_without_a_position_and_frames_that_are_not_in_the_file_are_lost_alike():
    positions = track()
    keep = np.ones(1500, dtype=bool)
    keep[[700, 701]] = False
    positions[[300, 302]] = np.nan
    verdict, detail = check_lost_frames(TIMES_S[keep], positions[keep])
    assert verdict == "ok"
    assert "4 of 1500 frames lost (0.3 %), longest gap 1.0 ms" in detail


@pytest.mark.parametrize(
    ("lost", "verdict"), [(slice(None, None, 20), "warn"), (slice(None, None, 3), "fail"), (slice(700, 745), "warn")]
)
def test_many_lost_frames_or_a_long_gap_are_judged_with_advice(lost, verdict):
    positions = track()
    positions[lost] = np.nan
    found, detail = check_lost_frames(TIMES_S, positions)
    assert found == verdict
    assert "limit" in detail
    assert "track the marker again or improve the light" in detail


@pytest.mark.parametrize("count", [0, 1, 2, 5])
def test_fewer_than_two_positions_fail(count):
    positions = np.full(count, np.nan)
    positions[:1] = 1.0
    verdict, detail = check_lost_frames(TIMES_S[:count], positions)
    assert verdict == "fail"
    assert f"{min(count, 1)} of {count} frames have a position" in detail


def test_noise_never_repeats():
    assert check_repeated_frames(track()) == ("ok", "0 repeated positions during the motion")


def test_a_duplicated_picture_in_the_motion_is_a_warning():
    positions = track()
    positions[160] = positions[159]
    verdict, detail = check_repeated_frames(positions)
    assert verdict == "warn"
    assert "1 repeated positions during the motion" in detail
    assert "the feature is stuck or pictures are duplicated; look at those frames" in detail


def test_a_feature_that_is_stuck_fails():
    positions = track()
    positions[110:330] = positions[110]
    verdict, detail = check_repeated_frames(positions)
    assert verdict == "fail"
    assert "219 repeated positions during the motion" in detail
    assert "the feature is stuck or pictures are duplicated; track it again" in detail


def test_every_other_picture_duplicated_fails():
    positions = track()
    positions[1::2] = positions[::2]
    assert check_repeated_frames(positions)[0] == "fail"


def test_a_track_that_is_held_before_and_after_the_motion_is_meant_so():
    positions = track()
    positions[:90] = positions[89]
    positions[1300:] = positions[1300]
    assert check_repeated_frames(positions)[0] == "ok"


def test_lost_frames_are_no_repeats():
    positions = track()
    positions[100:400:7] = np.nan
    assert check_repeated_frames(positions)[0] == "ok"


@pytest.mark.parametrize("positions", [np.empty(0), np.full(50, np.nan), np.array([1.0, 2.0])])
def test_too_few_positions_fail(positions):
    verdict, detail = check_repeated_frames(positions)
    assert verdict == "fail"
    assert "positions only: track the marker again" in detail


def test_a_track_that_never_moves_repeats_nothing_in_motion():
    assert check_repeated_frames(np.zeros(100))[0] == "ok"


def encoder(step_m: float) -> np.ndarray:
    """Positions of a recoil of 0.6 m as an encoder of a resolution reads them, at rest before and after."""
    travel = 0.6 * np.exp(-(((TIMES_S - 0.35) / 0.06) ** 2))
    travel[(TIMES_S < 0.15) | (TIMES_S > 0.6)] = 0.0
    return np.round(travel / step_m) * step_m


@pytest.mark.parametrize("step_m", [1e-5, 1e-4, 1e-3])
def test_an_encoder_at_rest_is_no_held_end_and_no_repeat(step_m):
    verdict, detail = check_held_ends(encoder(step_m))
    assert verdict == "ok"
    assert "it rests without noise" in detail
    assert check_repeated_frames(encoder(step_m))[0] == "ok"
    both = [encoder(step_m)[:, np.newaxis], encoder(2 * step_m)[:, np.newaxis]]
    assert not duplicated_pictures(both).any()


def test_an_encoder_that_is_stuck_in_the_motion_or_ends_in_it_is_told():
    positions = encoder(1e-5)
    positions[660:664] = positions[659]
    assert check_repeated_frames(positions)[0] == "warn"
    positions = encoder(1e-5)
    positions[650:] = positions[650]
    assert check_held_ends(positions)[0] == "warn"
