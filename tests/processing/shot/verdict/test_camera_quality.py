from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from recoil_acquisition.channel import Channel
from recoil_acquisition.clocks.timebase import TimeBase
from recoil_acquisition.shot.shot import ClockAlignment
from recoil_acquisition.track import Track
from recoil_processing.shot.verdict.camera_quality import check_frames, check_fusion, check_track, rest_after
from recoil_rigs.rig import ChannelSpec, Source
from tests.builders.bench_shots import ArrayRecording

TIMES_S = np.arange(2000) / 2000
BASE = TimeBase.stamped("camera", TIMES_S)
SOURCE = Source(name="camera", kind="camera", frame_rate=2000.0)
SPEC = ChannelSpec(name="x", source="camera", signal="Feature #1 - X", quantity="displacement", unit="mm")
ALIGNED = ClockAlignment("camera", 0.5, 1e-6, 0.0, 0.0, "ok", "motion")


@dataclass(frozen=True, eq=False)
class CameraTrack(ArrayRecording):
    """A recording that holds tracks."""

    held: tuple[Track, ...] = ()

    def tracks(self) -> tuple[Track, ...]:
        return self.held


def path(seed: int, travel_mm: float) -> np.ndarray:
    noise = 0.05 * np.random.default_rng(seed).normal(size=(2000, 2))
    return noise + np.column_stack([travel_mm * np.exp(-(((TIMES_S - 0.4) / 0.08) ** 2)), np.zeros(2000)])


def track(*positions: np.ndarray) -> CameraTrack:
    names = [f"Feature #{i + 1}" for i in range(len(positions))]
    tracks = [Track(name, ("X", "Y"), p, np.arange(2000), "mm", BASE) for name, p in zip(names, positions, strict=True)]
    return CameraTrack({}, held=tuple(tracks))


def channel(samples_m: np.ndarray, role: str = "recoil_displacement") -> Channel:
    return Channel("x", "displacement", samples_m, BASE, "Feature #1 - X", role)


def verdicts(found) -> dict[str, str]:
    return {check: verdict for check, (verdict, _) in found}


def test_a_sound_track_is_ok():
    found = {c.check: c for c in check_frames(SOURCE, track(path(1, 600.0), path(2, 0.0)))}
    assert {name: c.verdict for name, c in found.items()} == {"frame rate": "ok", "pictures": "ok"}
    assert all(c.channel == "camera" for c in found.values())


def test_a_marker_of_lost_frames_is_the_cause_that_is_named():
    marked = path(1, 600.0)
    marked[300:1200:7] = -0.995
    found = {c.check: c for c in check_frames(SOURCE, track(marked))}
    assert found["lost frames"].verdict == "fail"
    assert "-0.995 stand in 129 frames" in found["lost frames"].detail
    assert "declare `lost = [-0.995]`" in found["lost frames"].detail


def test_a_recording_without_tracks_says_nothing_of_a_track():
    assert list(check_frames(SOURCE, ArrayRecording({}))) == []


def test_a_wrong_frame_rate_and_duplicated_pictures_are_found_in_the_track():
    moving, still = path(1, 600.0), path(2, 0.0)
    for p in (moving, still):
        p[760] = p[759]
    played_back = SOURCE.model_copy(update={"frame_rate": 30.0})
    found = {c.check: c for c in check_frames(played_back, track(moving, still))}
    assert found["frame rate"].verdict == "fail"
    assert found["pictures"].verdict == "warn"
    assert "frames 760" in found["pictures"].detail


def test_marks_that_move_alike_sit_on_one_body_and_must_keep_their_distance():
    first = path(1, 600.0)
    second = first + np.array([50.0, 20.0]) + 0.05 * np.random.default_rng(3).normal(size=(2000, 2))
    (distance,) = [c for c in check_frames(SOURCE, track(first, second)) if c.check == "distance"]
    assert distance.verdict == "ok"
    assert distance.detail.startswith("Feature #1 and Feature #2: ")
    second[1000:, 0] += 0.5
    (distance,) = [c for c in check_frames(SOURCE, track(first, second)) if c.check == "distance"]
    assert distance.verdict == "warn"


def test_a_track_in_pixels_is_checked_for_peak_locking_and_one_in_millimetres_is_not():
    samples = 1e-3 * path(1, 600.0)[:, 0]
    assert "peak locking" not in verdicts(check_track(channel(samples), SPEC, SOURCE, None))
    in_pixels = SOURCE.model_copy(update={"scale_mm_per_px": 0.5})
    spec = SPEC.model_copy(update={"unit": "px"})
    locked = samples - 5e-5 * np.sin(2 * np.pi * samples / 5e-4)
    assert verdicts(check_track(channel(samples), spec, in_pixels, None))["peak locking"] == "ok"
    assert verdicts(check_track(channel(locked), spec, in_pixels, None))["peak locking"] == "warn"


def test_a_picture_that_repeats_is_not_told_again_of_its_mark():
    moving, still = path(1, 600.0), path(2, 0.0)
    for p in (moving, still):
        p[760] = p[759]
    sound = channel(1e-3 * moving[:, 0])
    assert verdicts(check_track(sound, SPEC, SOURCE, track(moving, still)))["repeated frames"] == "ok"
    assert verdicts(check_track(sound, SPEC, SOURCE, None))["repeated frames"] == "warn"


def test_the_residual_is_that_of_an_alignment_by_motion():
    samples = 1e-3 * path(1, 600.0)[:, 0]
    details = {"frames": 1900, "frames_set_aside": 60, "innovation_statistic": 1.0}
    aligned = replace(ALIGNED, details=details)
    assert verdicts(check_fusion(channel(samples), aligned)) == {"residual": "warn"}
    for other in (None, ALIGNED, replace(aligned, status="failed")):
        assert list(check_fusion(channel(samples), other)) == []
    assert list(check_fusion(channel(samples, role=""), aligned)) == []


def test_rest_after_the_shot_is_on_the_reference_clock():
    samples = 1e-3 * path(1, 600.0)[:, 0]
    assert 0.5 + 0.6 < rest_after(channel(samples), ALIGNED) < 0.5 + 0.75
    assert rest_after(channel(samples), None) is None
    assert rest_after(channel(samples), replace(ALIGNED, status="failed")) is None
    assert rest_after(channel(np.where(TIMES_S < 0.4, samples, np.nan)), ALIGNED) is None
