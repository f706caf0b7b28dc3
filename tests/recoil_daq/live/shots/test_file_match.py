"""A dropped file goes to the one shot that it fits, or to none."""

from __future__ import annotations

import datetime as dt
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from recoil_acquisition.errors import ReadError
from recoil_acquisition.files.shot_name import numbers_of
from recoil_acquisition.trigger import ShotWindow
from recoil_daq.live.shot import LiveShot, ShotState
from recoil_daq.live.shots.file_match import LATE_S, doubt_of_files, shots_of, source_of
from recoil_daq.live.shots.folder_watch import DroppedFile
from recoil_rigs.rig import load_rig, parse_rig


def shot(name: str, trigger_s: float, *, state: ShotState = ShotState.WAITING, **files: Path) -> LiveShot:
    window = ShotWindow(trigger_s - 0.1, trigger_s, trigger_s + 1.0, 0.1, {}, ())
    wanted = {"camera", "dewetron"}
    return LiveShot(name, window, state=state, wanted=wanted, files=dict(files))


def dropped(name: str, seen_s: float, written_s: float | None = None) -> DroppedFile:
    return DroppedFile(Path(name), seen_s, written_s)


def test_the_only_shot_that_waits_gets_it_without_a_number() -> None:
    one = shot("0001", 10.0)
    found = shots_of(dropped("test_fire_a.csv", 12.0), "camera", [one])
    assert (found.shots, found.by_number) == ((one,), False)


def test_a_file_from_before_the_trigger_belongs_to_no_shot() -> None:
    assert shots_of(dropped("a.csv", 9.0), "camera", [shot("0001", 10.0)]).shots == ()


def test_of_several_the_number_in_the_name_decides() -> None:
    shots = [shot("0001", 10.0), shot("0002", 20.0)]
    found = shots_of(dropped("cam_0001_final.csv", 30.0), "camera", shots)
    assert (found.shots, found.by_number) == ((shots[0],), True)
    assert shots_of(dropped("shot 2.csv", 30.0), "camera", shots).shots == (shots[1],)
    assert shots_of(dropped("2.csv", 30.0), "camera", shots).shots == (shots[1],)


@pytest.mark.parametrize(
    ("name", "numbers"),
    [
        ("0003", {3}), ("3", {3}), ("cam_0003", {3}), ("0003-cam", {3}), ("cam 3 b", {3}), ("cam_12_0003", {12, 3}),
        ("2026-01-22_camera", set()), ("20260122_camera", set()), ("camera_22.01.2026", set()),
        ("2026_01_22_10_15_03_cam", set()), ("2026-01-22T10-15-03_cam", set()), ("2026-01-22 10.15.03", set()),
        ("20260122-1015_cam", set()), ("20260122_101503_cam", set()), ("10-15-03_cam", set()), ("10_15_03_cam", set()),
        ("22-01-26_cam", set()), ("2026-01-22_0003_cam", {3}), ("20260122_0003", {3}), ("0003_20260122_101503", {3}),
        ("0003-2026-01-22", {3}), ("2026-01-22-1015", set()), ("cam_s12_v2_camera", set()), ("cam_v_2", set()),
        ("cam_v2_0003", {3}), ("rev 4 cam", set()), ("cam_1.2.3_x", set()), ("shot3", set()),
        ("12mm_lens_50fps", set()),
        ("cam (2)", set()), ("cam_³", set()), ("123456789", set()),
    ],
)  # fmt: skip
def test_a_number_counts_only_where_it_stands_alone_and_is_of_no_date_time_or_version(
    name: str, numbers: set[int]
) -> None:
    assert numbers_of(Path(f"{name}.csv")) == numbers


_FORMS = (
    "%Y-%m-%d", "%Y%m%d", "%Y_%m_%d", "%d.%m.%Y", "%Y-%m-%d_%H-%M-%S", "%Y%m%d_%H%M%S", "%Y%m%dT%H%M%S",
    "%Y-%m-%d %H.%M.%S", "%Y_%m_%d_%H_%M_%S",
)  # fmt: skip
_DAYS = st.dates(dt.date(1990, 1, 1), dt.date(2099, 12, 31))


@given(_DAYS, st.times(), st.sampled_from(_FORMS), st.integers(1, 1899))
def test_no_date_and_no_time_is_ever_a_number_and_hides_none(
    day: dt.date, moment: dt.time, form: str, number: int
) -> None:
    text = dt.datetime.combine(day, moment).strftime(form)
    assert numbers_of(Path(f"cam_{text}.csv")) == set()
    assert numbers_of(Path(f"{number:04d}_cam_{text}.csv")) == {number}


def test_the_rig_may_declare_where_the_number_stands() -> None:
    rig = load_rig("mixed")
    text = rig.text.replace('match = "*_dewetron.csv"', 'match = "run_*_s{shot}_*.csv"')
    declared = parse_rig(text, rig.path, rig.databases)
    pattern = declared.source("dewetron").pattern
    assert numbers_of(Path("run_0007_S12_v2.csv"), pattern) == {12}
    assert [s.name for s in declared.matching("RUN_0007_s12_x.csv")] == ["dewetron"]
    assert declared.matching("run_0007_sx_x.csv") == ()


def test_a_place_that_is_declared_twice_is_refused() -> None:
    rig = load_rig("mixed")
    text = rig.text.replace('match = "*_dewetron.csv"', 'match = "{shot}_{shot}.csv"')
    with pytest.raises(Exception, match="more than once"):
        parse_rig(text, rig.path, rig.databases)


def test_a_number_that_no_shot_bears_speaks_against_every_shot() -> None:
    found = shots_of(dropped("0003_camera.csv", 30.0), "camera", [shot("0001", 10.0), shot("0002", 20.0)])
    assert found.shots == ()
    assert found.why_none == "the number 3 in its name is of no shot that was fired"
    assert shots_of(dropped("0003_camera.csv", 30.0), "camera", [shot("0002", 20.0)]).shots == ()


def test_of_several_without_a_number_none_is_guessed() -> None:
    shots = [shot("0001", 10.0), shot("0002", 20.0)]
    assert shots_of(dropped("camera.csv", 30.0), "camera", shots).shots == tuple(shots)
    assert shots_of(dropped("2026-01-02_camera.csv", 30.0), "camera", shots).shots == tuple(shots)


def test_a_name_with_the_numbers_of_two_shots_is_a_question() -> None:
    shots = [shot("0001", 10.0), shot("0002", 20.0), shot("0003", 25.0)]
    assert shots_of(dropped("cam_1_3.csv", 30.0), "camera", shots).shots == (shots[0], shots[2])


def test_time_tells_where_the_name_does_not() -> None:
    shots = [shot("0001", 10.0), shot("0002", 20.0)]
    assert shots_of(dropped("camera.csv", 15.0), "camera", shots).shots == (shots[0],)
    shots[0].files["camera"] = Path("x")
    assert shots_of(dropped("camera.csv", 30.0), "camera", shots).shots == (shots[1],)


def test_a_file_that_was_written_before_a_shot_is_not_its_file() -> None:
    shots = [shot("0001", 10.0), shot("0002", 20.0)]
    assert shots_of(dropped("camera.csv", 30.0, 16.0), "camera", shots).shots == (shots[0],)
    assert shots_of(dropped("camera.csv", 30.0, 18.5), "camera", shots).shots == tuple(shots)  # clocks are apart
    assert shots_of(dropped("camera.csv", 30.0, 25.0), "camera", shots).shots == tuple(shots)
    found = shots_of(dropped("camera.csv", 30.0, 5.0), "camera", shots)
    assert (found.shots, found.why_none) == ((), "it was last written before shot 0001 was fired")


@pytest.mark.parametrize("state", [ShotState.INCOMPLETE, ShotState.NOT_USABLE, ShotState.FAILED])
def test_the_last_shots_file_that_comes_late_is_not_taken_for_the_next_shot(state: ShotState) -> None:
    last, this = shot("0001", 10.0, state=state), shot("0002", 20.0)
    assert shots_of(dropped("camera.csv", 30.0), "camera", [last, this]).shots == (last, this)
    found = shots_of(dropped("camera.csv", 30.0, 16.0), "camera", [last, this])
    if state is ShotState.FAILED:
        assert (found.shots, found.why_none) == ((), "no shot waits for a file of camera")
    else:
        assert found.shots == (last,)


def test_a_shot_that_never_got_its_file_does_not_stand_in_the_way_of_all_later_ones() -> None:
    last, this = shot("0001", 10.0, state=ShotState.INCOMPLETE), shot("0002", 20.0 + LATE_S)
    assert shots_of(dropped("camera.csv", 30.0 + LATE_S), "camera", [last, this]).shots == (this,)
    between = shot("0002", 15.0, camera=Path("x"))
    after = shot("0003", 20.0)
    assert shots_of(dropped("camera.csv", 30.0), "camera", [last, between, after]).shots == (after,)


def test_a_second_file_for_the_same_shot_is_refused_by_its_name() -> None:
    shots = [shot("0001", 10.0, camera=Path("x"))]
    with pytest.raises(ReadError, match="belongs to shot 0001, which has a file of camera"):
        shots_of(dropped("0001_again.csv", 30.0), "camera", shots)


def test_a_file_named_for_a_shot_that_has_one_never_goes_to_another() -> None:
    shots = [shot("0001", 10.0, camera=Path("x")), shot("0002", 20.0)]
    with pytest.raises(ReadError, match="belongs to shot 0001"):
        shots_of(dropped("0001_again.csv", 30.0), "camera", shots)


def test_a_file_that_is_of_no_source_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "notes.txt"
    file.write_text("wind from the west")
    with pytest.raises(ReadError):
        source_of(load_rig("mixed"), DroppedFile(file, 0.0))


def test_a_file_with_the_number_of_a_shot_whose_trigger_was_read_late_is_its() -> None:
    """A host that falls behind dates the trigger by when it read it; the recorder's file is there by then."""
    late = shot("0001", 10.0)
    assert late.window is not None
    late.window = replace(late.window, start_s=5.5)
    seen = {"seen_s": 7.0, "written_s": 6.5}
    assert shots_of(dropped("0001_cam.csv", **seen), "camera", [late]).shots == (late,)
    assert shots_of(dropped("cam.csv", **seen), "camera", [late]).shots == ()
    assert shots_of(dropped("0001_cam.csv", 5.0), "camera", [late]).shots == ()


def test_a_number_that_the_time_of_writing_contradicts_is_refused() -> None:
    with pytest.raises(ReadError, match="last written before that was fired"):
        shots_of(dropped("cam_0001.csv", 12.0, written_s=2.0), "camera", [shot("0001", 10.0)])


@pytest.mark.parametrize(
    ("samples", "told"), [(600, ""), (690, ""), (400, "a.csv was matched by time alone, and is 0.4")]
)
def test_a_file_of_another_length_than_its_instruments_others_is_doubted(samples: int, told: str) -> None:
    shots = [shot("0001", 10.0), shot("0002", 20.0, camera=Path("a.csv"))]
    for one, count in zip(shots, (600, samples), strict=True):
        channel = {"clock": "camera", "samples": count, "rate_hz": 1000.0}
        one.document = {"quality": [], "channels": [channel, {"clock": "x", "samples": 0, "rate_hz": None}]}
    assert doubt_of_files(shots[1], shots) == ""
    shots[1].by_time.add("camera")
    assert doubt_of_files(shots[1], shots).startswith(told)
    assert bool(doubt_of_files(shots[1], shots)) == bool(told)


def test_a_preview_is_as_long_as_the_shot_and_doubts_no_longer_file() -> None:
    shots = [shot("0001", 10.0), shot("0002", 20.0, dewetron=Path("b.dmd"))]
    for one, samples in zip(shots, (1000, 60_000), strict=True):
        one.captured, one.previewed = Path(f"{one.name}.rdlog"), frozenset({"dewetron"})
        one.document = {"quality": [], "channels": [{"clock": "dewetron", "samples": samples, "rate_hz": 1000.0}]}
    shots[1].by_time.add("dewetron")
    shots[0].files["dewetron"] = shots[0].captured or Path()
    assert doubt_of_files(shots[1], shots) == ""
    shots[0].files["dewetron"] = Path("a.dmd")
    assert "is 60.000 s long, 1.000 s that of shot 0001" in doubt_of_files(shots[1], shots)
