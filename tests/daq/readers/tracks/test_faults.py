from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.tracks.faults import HELD_FRAMES, find_jumps, find_track_faults, held_ends
from recoil_acquisition.readers.tracks.marker import find_marker
from recoil_acquisition.readers.tracks.proanalyst_text import ProAnalystTextReader
from tests.builders.shared_data import shared_file

COUNT = 400
FRAMES = np.arange(COUNT, dtype=np.int64)


def motion(seed: int = 0, noise: float = 0.05) -> np.ndarray:
    """A stroke of 100 mm and back within 0.2 s at 2000 frames/s, with noise, on two axes."""
    t = np.arange(COUNT) / COUNT
    x = 100 * np.sin(np.pi * np.clip((t - 0.1) / 0.8, 0, 1)) ** 2
    return np.stack([x, 0.01 * x], axis=1) + noise * np.random.default_rng(seed).standard_normal((COUNT, 2))


def notes(**features: np.ndarray) -> str:
    return " | ".join(find_track_faults(features, FRAMES).notes)


def test_numbers_that_are_no_positions_end_in_no_overflow() -> None:
    track = motion(1)
    track[50, 0], track[51, 0] = 1e308, -1e308
    with np.errstate(over="raise"):
        assert not find_jumps(FRAMES, track)[50]


def test_a_sound_track_has_no_faults() -> None:
    assert notes(a=motion(1), b=motion(2)) == ""


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10**6), at=st.integers(5, COUNT - 6), size=st.floats(12, 60), back=st.booleans())
def test_a_jump_is_found_at_its_frame_whether_the_mark_comes_back_or_not(
    seed: int, at: int, size: float, back: bool
) -> None:
    positions = motion(seed)
    positions[at : at + 1 if back else None, 0] += size
    assert np.flatnonzero(find_jumps(FRAMES, positions)).tolist() == [at]


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10**6), lost=st.lists(st.integers(0, COUNT - 1), max_size=60, unique=True))
def test_lost_frames_are_no_jump_and_no_repeat(seed: int, lost: list[int]) -> None:
    positions = motion(seed)
    positions[lost] = np.nan
    assert find_track_faults({"a": positions}, FRAMES).notes == ()


def test_frames_that_are_not_in_the_file_are_no_jump() -> None:
    kept = np.delete(FRAMES, np.arange(150, 158))
    assert not find_jumps(kept, motion()[kept]).any()


def test_a_repeat_of_every_feature_is_a_picture_and_of_one_a_stuck_feature() -> None:
    a, b = motion(1), motion(2)
    a[100], b[100] = a[99], b[99]
    b[200:203] = b[199]
    faults = find_track_faults({"a": a, "b": b}, FRAMES)
    assert faults.repeated_frames == (100,)
    assert faults.notes == (
        "repeated pictures (all features exactly as before): 1, frames 100",
        "b: stuck (exactly as before while others move): 3, frames 200, 201, 202",
    )


def test_a_lost_feature_tells_nothing_of_a_repeated_picture() -> None:
    a, b = motion(1), motion(2)
    a[100] = a[99]
    b[99:101] = np.nan
    assert find_track_faults({"a": a, "b": b}, FRAMES).repeated_frames == (100,)
    assert find_track_faults({"b": np.full((COUNT, 2), np.nan)}, FRAMES).repeated_frames == ()


def test_held_ends_are_told_with_their_frames_and_shorter_ones_are_not() -> None:
    a, b = motion(1), motion(2)
    a[:30], a[-20:] = a[30], a[-21]
    assert held_ends(a) == (31, 21)
    text = notes(a=a, b=b)
    assert "a: the first 31 and the last 21 positions are held at one value (to frame 30, from frame 379)" in text
    assert "stuck" not in text
    b[: HELD_FRAMES - 1] = b[HELD_FRAMES - 1]
    assert "held" not in notes(b=b)


def test_a_mark_that_never_moves_has_no_ends() -> None:
    assert held_ends(np.ones((20, 2))) == (0, 0)


def test_the_synthetic_track_has_its_repeat_and_its_spike() -> None:
    path = shared_file("tracks/SYNTHETIC_proanalyst_like_2000fps.csv")
    text = " | ".join(ProAnalystTextReader().open(path, Declarations("camera")).notes)
    assert "repeated pictures (all features exactly as before): 1, frames 1403" in text
    assert "Feature #1: jumps, faster than the motion ever is: 1, frames 655" in text
    assert "Feature #1: lost in 16 of 1899 frames" in text
    assert "held" not in text


@pytest.mark.parametrize(
    ("name", "before", "after", "repeats", "inside"),
    [("008_129_DB", 365, 424, 787, 0), ("100_AJ_DB", 232, 704, 935, 1)],
)
def test_published_tracks_have_their_held_ends_their_repeats_and_a_jump_put_in(
    name: str, before: int, after: int, repeats: int, inside: int, tmp_path
) -> None:
    path = shared_file(f"tracks/proanalyst_paws_jones2020_{name}.csv")
    declared = Declarations("camera", frame_rate_hz=2000.0)
    recording = ProAnalystTextReader().open(path, declared)
    text = " | ".join(recording.notes)
    assert f"feature1: the first {before} and the last {after} positions are held" in text
    assert f"exactly as before): {repeats}, frames" in text
    outside = text.split("outside the held ends: ")[1]
    assert outside.startswith("none" if inside == 0 else f"{inside}, frames")
    assert "jumps" not in text
    lines = path.read_text().splitlines()
    at = before + 20
    for i in range(at, len(lines) - 1):
        x, y = lines[i + 1].split(",")
        lines[i + 1] = f"{float(x) + 23.6:.9f},{y}"
    jumped = tmp_path / "jumped.csv"
    jumped.write_text("\n".join(lines) + "\n")
    notes_of = ProAnalystTextReader().open(jumped, declared).notes
    assert f"feature1: jumps, faster than the motion ever is: 1, frames {at}" in notes_of


# ---- what rests and has no noise


def encoder(step_mm: float, *, before: int = 120, after: int = 90, phase: float = 0.0) -> np.ndarray:
    """Rest, a stroke of 100 mm and back, rest: as an encoder of a resolution reads it."""
    t = np.arange(COUNT, dtype=float)
    x = 100 * np.sin(np.pi * np.clip((t - before) / (COUNT - before - after), 0, 1)) ** 2
    return np.round((x + phase) / step_mm)[:, np.newaxis] * step_mm


@pytest.mark.parametrize("step_mm", [0.001, 0.01, 0.1, 0.5])
@pytest.mark.parametrize("phase", [0.0, 0.237])
def test_an_encoder_at_rest_has_no_fault(step_mm: float, phase: float) -> None:
    for positions in (encoder(step_mm, phase=phase), np.hstack([encoder(step_mm), np.zeros((COUNT, 1))])):
        faults = find_track_faults({"a": positions}, FRAMES)
        assert faults.notes == ()
        assert faults.repeated_frames == ()
    both = {"a": encoder(step_mm, phase=phase), "b": encoder(step_mm, phase=0.5 * phase)}
    assert find_track_faults(both, FRAMES).notes == ()


def test_an_encoder_that_starts_at_once_has_no_fault() -> None:
    t = np.clip(np.arange(COUNT) - 100.0, 0, None)
    x = np.round(5 * t**2 * np.exp(-t / 30), 2)[:, np.newaxis]
    assert find_track_faults({"a": x}, FRAMES).notes == ()


def test_a_mark_without_noise_that_is_stuck_or_leaves_the_picture_is_told_all_the_same() -> None:
    stuck = encoder(0.01)
    stuck[170:174] = stuck[169]
    text = notes(a=stuck, b=motion(1))
    assert "a: stuck (exactly as before while others move): 4, frames 170, 171, 172, 173" in text
    left = encoder(0.01)
    left[180:] = left[180]
    assert "a: the last 220 positions are held at one value" in notes(a=left)
    late = encoder(0.01)
    late[:170] = late[170]
    assert "a: the first 171 positions are held at one value" in notes(a=late)


def test_repeated_pictures_of_marks_without_noise_are_told() -> None:
    a, b = encoder(0.01), encoder(0.01, phase=3.0)
    for positions in (a, b):
        positions[170] = positions[169]
    assert find_track_faults({"a": a, "b": b}, FRAMES).repeated_frames == (170,)


def test_a_mark_with_noise_that_is_held_is_told_though_another_has_none() -> None:
    a = motion(1)
    a[:30] = a[30]
    assert "a: the first 31 positions are held" in notes(a=a, b=encoder(0.01))


# ---- markers of lost frames


@pytest.mark.exhaustive
@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    marker=st.sampled_from([(-0.995, -0.995), (-40.0, -40.0), (-999.0, -999.0), (1e4, 0.0), (9999.0, 9999.0)]),
    lost=st.lists(st.integers(0, COUNT - 1), min_size=3, max_size=60, unique=True),
    block=st.integers(1, 30),
    clean=st.booleans(),
)
def test_a_marker_of_lost_frames_is_named_with_its_value_and_count(
    seed: int, marker: tuple[float, float], lost: list[int], block: int, clean: bool
) -> None:
    positions = 300 + (np.hstack([encoder(0.01), encoder(0.01)]) if clean else motion(seed))
    at = np.zeros(COUNT, dtype=bool)
    for first in lost[: 90 // block + 1]:
        at[first : first + block] = True
    positions[at] = marker
    found = find_marker(positions, FRAMES)
    assert found is not None
    assert found.values == marker
    assert found.frames == int(at.sum())
    assert f"declare `lost = [{marker[0]:.9g}" in notes(a=positions)


@pytest.mark.exhaustive
@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 10**6), step=st.sampled_from([1e-6, 0.01, 0.5]), jump=st.integers(0, COUNT - 1))
def test_a_sound_track_has_no_marker(seed: int, step: float, jump: int) -> None:
    for positions in (motion(seed), encoder(step), np.round(motion(seed) / step) * step):
        assert find_marker(positions, FRAMES) is None
        positions[jump] += 60
        assert find_marker(positions, FRAMES) is None


def test_a_marker_of_one_dimension_is_named_in_the_notes_of_its_file(tmp_path) -> None:
    x = motion(3)[:, 0] + 250
    lost = np.arange(20, 380, 9)
    cells = [f"{value:.3f}" for value in x]
    for i in lost:
        cells[i] = "-0.995"
    path = tmp_path / "a.csv"
    path.write_text("Frame,tip - X (mm)\n" + "".join(f"{i},{cell}\n" for i, cell in enumerate(cells)))
    recording = ProAnalystTextReader().open(path, Declarations("camera", frame_rate_hz=2000.0))
    assert (
        f"tip: lost frames seem to have a marker: the value -0.995 stands in {lost.size} frames, far off the path: "
        "declare `lost = [-0.995]` in `[source.layout]`"
    ) in recording.notes
