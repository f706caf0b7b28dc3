from __future__ import annotations

import numpy as np
import pytest

from recoil_processing.double_integral import DoubleIntegral
from recoil_processing.shot.clocks.camera_track import LEAST_FRAMES, CameraTrack
from tests.builders.recoil_scenario import RATE_HZ, record_recoil, true_recoil

TRUE = true_recoil()
ROUGH = DoubleIntegral.of(TRUE.acceleration_m_s2, float(TRUE.times_s[0]), 1 / RATE_HZ)


def tracked(x: np.ndarray, end_s: float = 1.0) -> CameraTrack:
    return CameraTrack.of(TRUE.frame_times_s, x, 0.0, end_s, ROUGH)


def test_frames_are_parted_at_the_release():
    track = tracked(TRUE.displacement_m + 0.3)
    assert track.rest_frames == np.count_nonzero(TRUE.frame_times_s < 0)
    assert track.rest_m == pytest.approx(0.3)
    assert track.times_s[0] == pytest.approx(0.0, abs=1e-9)


def test_lost_frames_are_left_out_and_wild_ones_set_aside():
    x = record_recoil(1).displacement_m.copy()
    x[1100:1110], x[1200] = np.nan, x[1200] + 0.05
    track = tracked(x)
    assert track.set_aside == 1
    assert not np.isin(TRUE.frame_times_s[[1105, 1200]], track.times_s).any()
    assert track.times_s.size + track.rest_frames == x.size - 11


def test_frames_after_the_end_are_not_taken():
    assert tracked(TRUE.displacement_m, end_s=0.03).times_s[-1] <= 0.03
    assert LEAST_FRAMES <= 0.03 * 5000


def test_whitened_noise_of_marker_and_walk_is_white_and_of_the_markers_variance():
    rng = np.random.default_rng(0)
    track = tracked(TRUE.displacement_m)
    sigma, density = 3e-4, 5.0
    energy, lagged = 0.0, 0.0
    for _ in range(200):
        fine = rng.normal(0.0, np.sqrt(density * RATE_HZ), TRUE.times_s.size) * (TRUE.times_s >= 0)
        walk = DoubleIntegral.of(fine, float(TRUE.times_s[0]), 1 / RATE_HZ).at(track.times_s)[0]
        noise = walk + rng.normal(0.0, sigma, walk.size)
        white = track.whiten(noise[:, None], density / sigma**2)[0][:, 0] / sigma
        energy += float(white @ white) / white.size
        lagged += float(white[1:] @ white[:-1]) / white.size
    assert energy / 200 == pytest.approx(1.0, abs=0.02)
    assert abs(lagged / 200) < 0.02
