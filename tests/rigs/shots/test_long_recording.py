from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from recoil_acquisition.errors import ReadError
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.readers.table import recognise
from recoil_rigs.rig import Rig
from recoil_rigs.shots.long_recording import cut_long_recordings
from recoil_rigs.twin import simulate_shot
from tests.builders.long_recordings import STEP_S, long_dmd, triggered_rig, write_long_text

AT_ROW, ROWS = 40_000, 90_000


@pytest.fixture(scope="module")
def rig() -> Rig:
    return triggered_rig()


@pytest.fixture(scope="module")
def shot(rig: Rig, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("shot")
    return next(f for f in simulate_shot(rig, folder, seed=2, shot="1").files if "dewetron" in f.name)


@pytest.fixture(scope="module")
def long_text(shot: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("long") / "long.csv"
    write_long_text(shot, path, (AT_ROW,), ROWS)
    return path


@pytest.fixture(autouse=True)
def _short_is_long(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every file of these tests counts as long: 17 million samples would take a minute to write."""
    monkeypatch.setattr("recoil_rigs.shots.long_recording.LONG_SAMPLES", 100_000)


def opened(path: Path) -> Recording:
    return recognise(path).open(path, Declarations("dewetron"))


def onset_row(recording: Recording) -> int:
    return int(np.argmax(recording.read("AI 6/p_breech") >= 10.0))


@pytest.mark.exhaustive
def test_the_shot_is_what_the_trigger_keeps_of_a_long_recording(rig: Rig, shot: Path, long_text: Path):
    whole = opened(long_text)
    cut = cut_long_recordings(rig, {"dewetron": whole})["dewetron"]
    assert "excerpt" in cut.metadata
    onset = AT_ROW + onset_row(opened(shot))
    first, stop = onset - 2500, onset + 22_500
    for header in cut.signals:
        assert header.sample_count == stop - first
        np.testing.assert_array_equal(cut.read(header.name), whole.read(header.name, first, stop))
        np.testing.assert_array_equal(cut.read(header.name, 10, -10), whole.read(header.name, first + 10, stop - 10))
    times_s = cut.time_base("AI 6/p_breech").times_s
    np.testing.assert_allclose(times_s, STEP_S * np.arange(first, stop), rtol=0, atol=1e-9)
    assert f"around its one trigger at {onset * STEP_S:.6f} s" in cut.notes[-1]
    assert cut.absolute_start == whole.absolute_start


def test_the_stored_integers_are_cut_as_the_samples_are(rig: Rig, shot: Path, tmp_path: Path):
    path = tmp_path / "long.dmd"
    path.write_bytes(b"".join(long_dmd(shot, (AT_ROW,), ROWS)))
    cut = cut_long_recordings(rig, {"dewetron": opened(path)})["dewetron"]
    for header in cut.signals:
        raw = cut.raw(header.name)
        assert raw is not None
        np.testing.assert_allclose(raw.gain * raw.counts + raw.offset, cut.read(header.name), rtol=1e-12)


def test_a_recording_of_some_seconds_is_left_whole(rig: Rig, long_text: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.undo()
    recording = opened(long_text)
    assert cut_long_recordings(rig, {"dewetron": recording})["dewetron"] is recording


def test_several_shots_are_named_and_one_is_chosen_by_its_time(rig: Rig, shot: Path, tmp_path: Path):
    path = tmp_path / "three.csv"
    write_long_text(shot, path, (10_000, 45_000, 80_000), 120_000)
    recording = opened(path)
    onset_s = STEP_S * (45_000 + onset_row(opened(shot)))
    with pytest.raises(ReadError, match=f"found 3 shots .* {onset_s:.6f}, .*--at SECONDS"):
        cut_long_recordings(rig, {"dewetron": recording})
    cut = cut_long_recordings(rig, {"dewetron": recording}, at_s=onset_s)["dewetron"]
    times_s = cut.time_base("AI 6/p_breech").times_s
    assert times_s[0] == pytest.approx(onset_s - 0.05, abs=1.01 * STEP_S)
    assert times_s[-1] == pytest.approx(onset_s + 0.45, abs=1.01 * STEP_S)


def test_further_triggers_let_the_post_time_start_anew_where_the_rig_says_so(rig: Rig, shot: Path, tmp_path: Path):
    path = tmp_path / "two.csv"
    write_long_text(shot, path, (10_000, 30_000), 60_000)
    assert rig.trigger is not None
    extended = replace(rig, trigger=replace(rig.trigger, extend=True))
    cut = cut_long_recordings(extended, {"dewetron": opened(path)})["dewetron"]
    assert cut.time_base("AI 6/p_breech").end_s == pytest.approx(
        STEP_S * (30_000 + onset_row(opened(shot))) + 0.45, abs=2 * STEP_S
    )


def test_a_recording_without_a_shot_is_refused(rig: Rig, shot: Path, tmp_path: Path):
    path = tmp_path / "rest.csv"
    write_long_text(shot, path, (), ROWS)
    with pytest.raises(ReadError, match="found no shot in this recording: p_breech never met it"):
        cut_long_recordings(rig, {"dewetron": opened(path)})


def test_a_rig_without_a_trigger_is_asked_for_one(rig: Rig, long_text: Path):
    with pytest.raises(ReadError, match=r"a table \[trigger\] in the rig file"):
        cut_long_recordings(replace(rig, trigger=None), {"dewetron": opened(long_text)})


@pytest.mark.parametrize("at_s", [-1.0, 1e9])
def test_a_time_outside_the_recording_is_refused_with_its_ends(rig: Rig, long_text: Path, at_s: float):
    with pytest.raises(ReadError, match=r"is not within this recording.*0 to 1.79998 s"):
        cut_long_recordings(rig, {"dewetron": opened(long_text)}, at_s=at_s)


def test_what_the_trigger_cannot_see_is_told_by_time(rig: Rig, long_text: Path):
    assert rig.trigger is not None
    manual = replace(rig, trigger=replace(rig.trigger, conditions=()))
    with pytest.raises(ReadError, match=r"trigger looks at no channel.*--at SECONDS"):
        cut_long_recordings(manual, {"dewetron": opened(long_text)})
    assert "excerpt" in cut_long_recordings(manual, {"dewetron": opened(long_text)}, at_s=1.0)["dewetron"].metadata


def test_a_second_long_recording_is_refused_because_its_clock_is_another(rig: Rig, long_text: Path):
    recordings = {"dewetron": opened(long_text), "camera": opened(long_text)}
    tracked = (c.model_copy(update={"name": f"{c.name}_2", "source": "camera"}) for c in rig.channels)
    both = replace(rig, channels=(*rig.channels, *tracked))
    with pytest.raises(ReadError, match="it is another clock"):
        cut_long_recordings(both, recordings)
