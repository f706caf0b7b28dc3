"""Files that are dropped while a range is armed: whose they are, whether they are whole, and what is asked."""

from __future__ import annotations

import hashlib
import shutil
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from recoil_acquisition import live_kind
from recoil_acquisition.errors import ReadError, StoreError
from recoil_acquisition.store import read_shot
from recoil_daq.live import acquisition
from recoil_daq.live.added_mass import AddedMass
from recoil_daq.live.range_state import RangeState
from recoil_daq.live.shot import LiveOptions, LiveShot, ShotState
from recoil_daq.recording.ingest import ingest_files
from recoil_rigs.rig import load_rig, parse_rig
from recoil_rigs.twin import TwinShot
from tests.builders.left_journals import RIG as LEFT_RIG
from tests.builders.left_journals import leave_journal
from tests.builders.range_session import PlayedConversion, Range, Told
from tests.builders.virtual_shots import settling_soon

FILES = ("0001_dewetron.csv", "0001_camera.csv")
RangeOf = Callable[..., Range]


@pytest.fixture
def range_of(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> RangeOf:
    """Make a range that watches ``in``, where a file's source is the end of its name, and where files settle soon."""

    def make(display: Told, settle_s: float = 0.1, **options: Any) -> Range:
        monkeypatch.setattr(
            "recoil_daq.live.shots.dropped_files.source_of", lambda _, f: f.path.stem.rpartition("_")[2]
        )
        monkeypatch.setattr("recoil_daq.live.shots.folder_watch.LOOK_EVERY_S", 0.02)
        rig = settling_soon(options.pop("rig", None) or load_rig("mixed"), settle_s)
        return Range(monkeypatch, rig, tmp_path, display, watch=tmp_path / "in", **options)

    return make


def drop(folder: Path, *names: str, text: str = "x") -> Callable[[], None]:
    def now() -> None:
        for name in names:
            (folder / name).write_text(text)

    return now


@pytest.fixture
def previewed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let what is read of a port be the preview of a file that its instrument writes."""
    kinds = tuple(replace(kind, is_preview=kind.key == "port") for kind in live_kind._OWN)
    monkeypatch.setattr(live_kind, "_OWN", kinds)


def answer(name: str, **preview: str) -> dict[str, Any]:
    found = {"check": "preview compared", "verdict": "warn"}
    return {"shot": name, "quality": [{"channel": name, "detail": told, **found} for name, told in preview.items()]}


@pytest.mark.usefixtures("previewed")
def test_an_instruments_own_file_replaces_its_preview_after_the_verdict_too(tmp_path: Path, range_of: RangeOf) -> None:
    display = Told()
    one = range_of(display)
    display.then["0001 captured"] = drop(tmp_path / "in", *FILES)
    PlayedConversion.answer = answer("0001")

    def arrives() -> None:
        assert one.live._shots[0].previews == {"imu"}
        PlayedConversion.answer = answer("0001", p="it is 1.01 times the file")
        drop(tmp_path / "in", "0001_imu.bin")()

    display.then["verdict"] = arrives
    display.quits = lambda: len(PlayedConversion.started) == 2 and one.live._shots[0].settled
    one.session.fired(one.clock.monotonic() - 1.0)
    outcome = one.run()
    assert [s.state for s in outcome.shots] == ["usable"]
    (_, first, _), (_, second, why) = PlayedConversion.started
    assert first == sorted(["0001.rdlog", *FILES])
    assert second == sorted(["0001.rdlog", "0001_imu.bin", *FILES])
    assert why == "0001_imu.bin replaces the preview"
    assert display.told("shot 0001: p: it is 1.01 times the file")
    assert display.told("files of imu replace what was read live when they come into")


@pytest.mark.usefixtures("previewed")
def test_nothing_waits_for_the_file_behind_a_preview(tmp_path: Path, range_of: RangeOf) -> None:
    display = Told()
    one = range_of(display, shots=1)
    display.then["0001 captured"] = drop(tmp_path / "in", *FILES)
    one.session.fired(one.clock.monotonic() - 1.0)
    outcome = one.run()
    assert [(s.state, s.previews) for s in outcome.shots] == [("usable", {"imu"})]
    assert len(PlayedConversion.started) == 1


@pytest.mark.parametrize(("late", "before"), [(FILES[0], "incomplete"), (FILES[1], "usable")])
def test_a_shot_that_waited_in_vain_is_done_again_when_its_file_comes(
    tmp_path: Path, range_of: RangeOf, late: str, before: str
) -> None:
    display = Told()
    one = range_of(display, files_within_s=0.5)
    (there,) = set(FILES) - {late}
    seen: list[str] = []
    display.then["0001 captured"] = drop(tmp_path / "in", there)

    def once_settled() -> bool:
        if one.live._shots[0].settled and not seen:
            seen.append(one.live._shots[0].state)
            drop(tmp_path / "in", late)()
        return bool(display.told(f"{late} is of shot")) and one.live._shots[0].settled

    one.session.fired(one.clock.monotonic() - 1.0)
    display.quits = lambda: bool(one.live._shots) and once_settled()
    outcome = one.run()
    assert [(s.state, s.problem, s.missing) for s in outcome.shots] == [("usable", "", ())]
    assert seen == [before]
    why = "" if before == "incomplete" else f"{late} came late"
    assert PlayedConversion.started[-1] == ("0001", sorted(["0001.rdlog", *FILES]), why)


def test_a_file_that_comes_while_its_shot_is_converted_without_it_is_not_left_out(
    tmp_path: Path, range_of: RangeOf
) -> None:
    display = Told()
    one = range_of(display, files_within_s=0.5)
    display.then["0001 captured"] = drop(tmp_path / "in", FILES[0])

    def comes_first() -> bool:
        if not (tmp_path / "in" / FILES[1]).exists():
            drop(tmp_path / "in", FILES[1])()
        return bool(display.told(f"{FILES[1]} is of shot 0001"))

    PlayedConversion.may_end = staticmethod(comes_first)
    display.quits = lambda: len(PlayedConversion.started) == 2 and one.live._shots[0].settled
    one.session.fired(one.clock.monotonic() - 1.0)
    outcome = one.run()
    assert [s.state for s in outcome.shots] == ["usable"]
    assert [(files, why) for _, files, why in PlayedConversion.started] == [
        (sorted(["0001.rdlog", FILES[0]]), ""), (sorted(["0001.rdlog", *FILES]), f"{FILES[1]} came late"),
    ]  # fmt: skip


def test_a_file_that_grew_makes_its_shot_not_whole_until_it_is_made_anew(tmp_path: Path, range_of: RangeOf) -> None:
    display = Told()
    one = range_of(display)
    display.then["0001 captured"] = drop(tmp_path / "in", *FILES)
    display.then["verdict"] = drop(tmp_path / "in", FILES[0], text="x and more")
    display.quits = lambda: len(PlayedConversion.started) == 2 and one.live._shots[0].settled
    one.session.fired(one.clock.monotonic() - 1.0)
    outcome = one.run()
    assert display.told("shot 0001 is NOT WHOLE: 0001_dewetron.csv grew after it was taken; its shot file is made anew")
    assert ("not whole",) in display.states
    assert [why for _, _, why in PlayedConversion.started] == ["", "0001_dewetron.csv grew after it was taken"]
    assert [(s.state, s.problem) for s in outcome.shots] == [("usable", "")]


def test_a_file_that_grows_while_it_is_converted_makes_the_shot_not_whole_at_once(
    tmp_path: Path, range_of: RangeOf
) -> None:
    display = Told()
    one = range_of(display)
    display.then["0001 captured"] = drop(tmp_path / "in", *FILES)

    def grow_first() -> bool:
        if not display.told("NOT WHOLE"):
            drop(tmp_path / "in", FILES[1], text="x and more")()
        return bool(display.told("NOT WHOLE"))

    PlayedConversion.may_end = staticmethod(grow_first)
    display.quits = lambda: len(PlayedConversion.started) == 2 and one.live._shots[0].settled
    one.session.fired(one.clock.monotonic() - 1.0)
    outcome = one.run()
    assert len(PlayedConversion.started) == 2
    assert [s.state for s in outcome.shots] == ["usable"]


def test_a_shot_whose_file_never_settles_stays_not_whole_in_the_log(tmp_path: Path, range_of: RangeOf) -> None:
    display = Told()
    one = range_of(display)
    display.then["0001 captured"] = drop(tmp_path / "in", *FILES)
    text = ["x"]

    pressed = display.key

    def grows(
        **_: bool,
    ) -> str:  # keys are asked for before each look at the folder: however late that is, the file has grown
        if display.verdicts:
            text.append("x")
            drop(tmp_path / "in", FILES[0], text="".join(text))()
        return pressed()

    def waits_shortly() -> None:
        one.live._options = one.live._work._options = replace(one.live._options, files_within_s=0.5)

    display.key = grows  # type: ignore[method-assign]
    display.then["NOT WHOLE"] = waits_shortly
    display.quits = lambda: bool(display.told("NOT WHOLE"))
    one.session.fired(one.clock.monotonic() - 1.0)
    outcome = one.run()
    assert [(s.state, s.problem) for s in outcome.shots] == [("not whole", "0001_dewetron.csv grew after it was taken")]
    assert not outcome.usable
    assert one.log["shots"][0]["state"] == "not whole"


@pytest.mark.parametrize("file_end", ["missing", "unclear"])
def test_a_file_that_is_cut_off_is_waited_for(tmp_path: Path, range_of: RangeOf, file_end: str) -> None:
    display = Told()
    one = range_of(display)
    display.then["0001 captured"] = drop(tmp_path / "in", *FILES)
    cut = tmp_path / "in" / FILES[0]
    PlayedConversion.answer = {
        "error": "CorruptFileError",
        "message": f"{cut}: was cut off",
        "path": str(cut),
        "file_end": file_end,
    }
    display.then["waits for the rest"] = drop(tmp_path / "in", FILES[0], text="x and the rest")
    display.quits = lambda: len(PlayedConversion.started) == 2 and one.live._shots[0].settled
    one.session.fired(one.clock.monotonic() - 1.0)
    outcome = one.run()
    assert display.told(f"shot 0001 waits for the rest of {FILES[0]}: {cut}: was cut off")
    assert [s.state for s in outcome.shots] == ["usable"]
    assert [why for _, _, why in PlayedConversion.started] == ["", ""]


def test_a_file_that_stays_cut_off_fails_its_shot_when_it_has_waited_long_enough(
    tmp_path: Path, range_of: RangeOf
) -> None:
    display = Told()
    one = range_of(display, files_within_s=1.0, shots=1)
    display.then["0001 captured"] = drop(tmp_path / "in", *FILES)
    cut = tmp_path / "in" / FILES[0]
    PlayedConversion.answer = {
        "error": "CorruptFileError",
        "message": f"{cut}: was cut off",
        "path": str(cut),
        "file_end": "missing",
    }
    one.session.fired(one.clock.monotonic() - 1.0)
    outcome = one.run()
    assert [(s.state, s.problem) for s in outcome.shots] == [("failed", f"{cut}: was cut off")]


@pytest.mark.parametrize("file_end", ["there", None])
def test_a_file_that_more_of_it_would_not_mend_is_not_waited_for(
    tmp_path: Path, range_of: RangeOf, file_end: str | None
) -> None:
    display = Told()
    one = range_of(display, shots=1)
    display.then["0001 captured"] = drop(tmp_path / "in", *FILES)
    path = tmp_path / "in" / FILES[0]
    said = f"{path}: was cut off"  # words decide nothing
    PlayedConversion.answer = {"error": "ReadError", "message": said, "path": str(path), "file_end": file_end}
    one.session.fired(one.clock.monotonic() - 1.0)
    outcome = one.run()
    assert [(s.state, s.problem) for s in outcome.shots] == [("failed", said)]
    assert not display.told("waits for the rest")


@pytest.mark.parametrize(("has_keys", "press"), [(True, "press 1 or 2, "), (False, "")])
def test_a_file_that_fits_two_shots_is_a_question_and_no_guess(
    tmp_path: Path, range_of: RangeOf, has_keys: bool, press: str
) -> None:
    display = Told(keys={"whose is": "2"} if has_keys else {}, has_keys=has_keys)
    one = range_of(display)
    (tmp_path / "in").mkdir(exist_ok=True)
    display.then["0002 captured"] = drop(tmp_path / "in", "a_camera.csv")
    if not has_keys:  # renamed, as the question says
        display.then["whose is"] = lambda: (tmp_path / "in" / "a_camera.csv").rename(
            tmp_path / "in" / "a_0002_camera.csv"
        )  # type: ignore[assignment]
    display.quits = lambda: bool(display.told("is of shot"))
    now_s = one.clock.monotonic()
    one.session.fired(now_s - 3.0, now_s - 1.5)
    outcome = one.run()
    (asked,) = display.told("whose is a_camera.csv? A file of camera for shot 0001 or 0002: ")
    assert f"0002: {press}rename it to a_camera_0002.csv or so, or ingest by hand, such as `recoil-daq ingest" in asked
    assert "camera" not in outcome.shots[0].files
    assert outcome.shots[1].files["camera"].name.startswith("a_")


def test_nothing_is_matched_while_a_shot_is_recorded_whose_file_it_may_be(tmp_path: Path, range_of: RangeOf) -> None:
    display = Told()
    one = range_of(display)
    now_s = one.clock.monotonic()
    ends_s = now_s + 0.7
    display.then["0001 captured"] = lambda: (
        one.session.opened(now_s - 0.5, lambda: one.clock.monotonic() > ends_s),
        drop(tmp_path / "in", "a_camera.csv")(),
    )  # type: ignore[assignment,return-value]
    display.quits = lambda: bool(display.told("whose is"))
    one.session.fired(now_s - 2.0)
    one.run()
    assert display.told("whose is a_camera.csv? A file of camera for shot 0001 or 0002")
    assert not display.told("is of shot")


def test_a_file_whose_number_no_shot_bears_is_left_alone_aloud(
    tmp_path: Path, range_of: RangeOf, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("recoil_daq.live.shots.dropped_files._UNMATCHED_S", 0.2)
    display = Told()
    one = range_of(display)
    display.then["0001 captured"] = drop(tmp_path / "in", "0003_camera.csv")
    display.quits = lambda: bool(display.told("left alone"))
    one.session.fired(one.clock.monotonic() - 1.0)
    outcome = one.run()
    assert display.told(
        "0003_camera.csv: the number 3 in its name is of no shot that was fired; write the shot's number"
    )
    assert outcome.shots[0].missing == ("camera", "dewetron")


@pytest.mark.parametrize(("made", "anew"), [(True, " --overwrite"), (False, "")], ids=["made", "waiting"])
def test_a_file_of_a_shot_that_a_session_before_recorded_is_told_how_it_comes_into_it(
    tmp_path: Path, range_of: RangeOf, monkeypatch: pytest.MonkeyPatch, made: bool, anew: str
) -> None:
    monkeypatch.setattr("recoil_daq.live.shots.dropped_files._UNMATCHED_S", 0.2)
    display = Told()
    one = range_of(display)
    capture = tmp_path / "captures" / "0003.rdlog"
    capture.parent.mkdir(parents=True, exist_ok=True)
    capture.write_bytes(b"")
    if made:
        (tmp_path / "0003.h5").write_bytes(b"")
    display.then["0001 captured"] = drop(tmp_path / "in", "0003_imu.bin")
    display.quits = lambda: bool(display.told("left alone"))
    one.session.fired(one.clock.monotonic() - 1.0)
    one.run()
    (told,) = display.told("left alone")
    assert "shot 0003 is of a session before" in told
    assert f"{capture} {tmp_path / 'in' / '0003_imu.bin'} --out {tmp_path}{anew}` with its other files" in told


def test_a_file_of_a_source_that_a_shot_has_live_is_of_no_session_before(
    tmp_path: Path, range_of: RangeOf, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("recoil_daq.live.shots.dropped_files._UNMATCHED_S", 0.2)
    display = Told()
    one = range_of(display)
    capture = tmp_path / "captures" / "0001.rdlog"
    display.then["0001 captured"] = lambda: (
        capture.parent.mkdir(parents=True, exist_ok=True),
        capture.write_bytes(b""),
        drop(tmp_path / "in", "0001_imu.bin")(),
    )  # type: ignore[assignment,return-value]
    display.quits = lambda: bool(display.told("left alone"))
    one.session.fired(one.clock.monotonic() - 1.0)
    one.run()
    assert not display.told("of a session before")


def test_a_shot_whose_motion_does_not_fit_is_told_to_be_perhaps_of_files_of_two_shots(
    tmp_path: Path, range_of: RangeOf
) -> None:
    display = Told()
    one = range_of(display, shots=1)
    display.then["0001 captured"] = drop(tmp_path / "in", "a_camera.csv", "0001_dewetron.csv")
    failed = {"check": "alignment", "channel": "camera", "verdict": "fail", "detail": ""}
    PlayedConversion.answer = {"usable": False, "quality": [failed]}
    one.session.fired(one.clock.monotonic() - 1.0)
    outcome = one.run()
    problem = (
        "perhaps the file of another shot: a_camera.csv was matched by time alone, and the motion does not fit "
        "(alignment)"
    )
    assert [(s.state, s.problem) for s in outcome.shots] == [("not usable", problem)]
    assert display.told("a_camera.csv is of shot 0001, source camera, by time alone")


@pytest.mark.real_time
def test_a_shot_file_that_is_made_anew_says_why_and_which_file_it_replaced(
    mixed_shot: TwinShot, tmp_path: Path
) -> None:
    rig = load_rig("mixed")
    files = [Path(shutil.copy(f, tmp_path / f.name)) for f in mixed_shot.files]
    first = ingest_files(rig, files, shot="0001", out=tmp_path)
    before = hashlib.sha256(first.path.read_bytes()).hexdigest()
    assert "replace shot file" not in [step.what for step in first.shot.history]
    ingest_files(rig, files, shot="0001", out=tmp_path, replaces="camera.csv grew after it was taken")
    step = read_shot(first.path).history[0]
    assert (step.what, step.parameters) == (
        "replace shot file",
        {"why": "camera.csv grew after it was taken", "sha256_before": before},
    )
    assert not list(tmp_path.glob(".*.partial"))


def test_a_file_that_is_taken_away_again_is_waited_for_anew(tmp_path: Path, range_of: RangeOf) -> None:
    """The recorder's file was taken, grows, and is taken away: the shot waits for it as before, and says so."""
    display = Told()
    one = range_of(display)
    display.then["0001 captured"] = drop(tmp_path / "in", FILES[0])
    display.then["0001_dewetron.csv is of shot 0001"] = drop(tmp_path / "in", FILES[0], text="x and more")
    display.then["grew after it was taken"] = (tmp_path / "in" / FILES[0]).unlink
    display.then["is gone again"] = drop(tmp_path / "in", *FILES)
    display.quits = lambda: bool(one.live._shots) and one.live._shots[0].settled
    one.session.fired(one.clock.monotonic() - 1.0)
    outcome = one.run()
    assert display.told("0001_dewetron.csv is gone again: shot 0001 waits for camera, dewetron")
    assert [s.state for s in outcome.shots] == ["usable"]
    assert [files for _, files, _ in PlayedConversion.started] == [sorted(["0001.rdlog", *FILES])]


def test_a_file_that_goes_on_growing_fails_its_shot_in_time_and_is_converted_when_it_ends(
    tmp_path: Path, range_of: RangeOf
) -> None:
    display = Told()
    one = range_of(display, files_within_s=2.0)
    display.then["0001 captured"] = drop(tmp_path / "in", FILES[0])
    text, pressed = ["x"], display.key

    def grows(**_: bool) -> str:
        if display.told("is of shot 0001") and not display.told("still grows"):
            text.append("x")
            drop(tmp_path / "in", FILES[0], text="".join(text))()
        return pressed()

    display.key = grows  # type: ignore[method-assign]
    display.then["still grows"] = drop(tmp_path / "in", FILES[1])
    display.quits = lambda: bool(one.live._shots) and one.live._shots[0].state == "usable"
    one.session.fired(one.clock.monotonic() - 1.0)
    outcome = one.run()
    assert display.told("still grows: it is converted when that ends")
    assert [s.state for s in outcome.shots] == ["usable"]


def test_whatever_a_reader_meets_in_a_file_ends_no_session(
    tmp_path: Path, range_of: RangeOf, monkeypatch: pytest.MonkeyPatch
) -> None:
    display = Told()
    one = range_of(display, shots=1)

    def source_of(_rig: object, file: Any) -> str:
        if "odd" in file.path.name:
            raise ZeroDivisionError("of a reader of another package")
        source: str = file.path.stem.rpartition("_")[2]
        return source

    monkeypatch.setattr("recoil_daq.live.shots.dropped_files.source_of", source_of)
    display.then["0001 captured"] = drop(tmp_path / "in", "odd.bin", *FILES)
    one.session.fired(one.clock.monotonic() - 1.0)
    outcome = one.run()
    assert [s.state for s in outcome.shots] == ["usable"]
    assert display.told("odd.bin: cannot be recognised: ZeroDivisionError: of a reader of another package")


def test_a_watched_folder_that_goes_away_stands_in_the_alert_until_it_is_back(
    tmp_path: Path, range_of: RangeOf
) -> None:
    display = Told()
    one = range_of(display, shots=1)
    away = tmp_path / "away"
    display.then["0001 captured"] = lambda: (tmp_path / "in").rename(away) and None

    def comes_back() -> None:
        away.rename(tmp_path / "in")

    display.then["CANNOT BE READ"] = comes_back
    display.then["can be read again"] = drop(tmp_path / "in", *FILES)
    one.session.fired(one.clock.monotonic() - 1.0)
    outcome = one.run()
    assert [s.state for s in outcome.shots] == ["usable"]
    assert display.told(f"the watched folder {tmp_path}/in CANNOT BE READ: No such file or directory; files that come")
    assert any("CANNOT BE READ" in alert for alert in display.alerts)
    assert "CANNOT BE READ" not in display.alerts[-1]


def left_shot(tmp_path: Path, name: str = "0001") -> LiveShot:
    """Return a shot whose capture a session left that crashed; its recorder and its camera wrote files."""
    path = tmp_path / "captures" / f"{name}.rdlog"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(b"imu")
    return LiveShot(name, state=ShotState.WAITING, captured=path, files={"imu": path}, wanted={"dewetron", "camera"})


def test_a_shot_of_a_crashed_session_is_finished_with_the_files_that_bear_its_number(
    tmp_path: Path, range_of: RangeOf
) -> None:
    display = Told()
    (tmp_path / "in").mkdir()
    drop(tmp_path / "in", FILES[0])()  # came while nobody watched
    one = range_of(display, shots=1, left=[left_shot(tmp_path)])
    assert display.told("shot 0001, recovered, waits for files of camera, dewetron with its number")
    display.then["0002 captured"] = drop(tmp_path / "in", FILES[1], "0002_camera.csv", "0002_dewetron.csv")
    one.session.fired(one.clock.monotonic() - 1.0)
    outcome = one.run()
    assert [(s.name, s.state) for s in outcome.shots] == [("0001", "usable"), ("0002", "usable")]
    assert sorted(PlayedConversion.started) == [
        ("0001", sorted(["0001.rdlog", *FILES]), ""),
        ("0002", ["0002.rdlog", "0002_camera.csv", "0002_dewetron.csv"], ""),
    ]
    assert one.session.complete


def test_no_file_without_a_number_goes_to_a_shot_of_a_crashed_session(tmp_path: Path, range_of: RangeOf) -> None:
    display = Told()
    one = range_of(display, shots=1, left=[left_shot(tmp_path)], files_within_s=0.5)
    display.then["0002 captured"] = drop(tmp_path / "in", "a_dewetron.csv", "a_camera.csv")
    one.session.fired(one.clock.monotonic() - 1.0)
    outcome = one.run()
    assert [(s.name, s.state) for s in outcome.shots] == [("0001", "incomplete"), ("0002", "usable")]
    assert outcome.usable
    assert one.session.complete
    assert display.told("finish it with `recoil-daq ingest ")


@pytest.mark.parametrize("edited", [False, True])
def test_a_shot_of_a_crashed_session_is_taken_up_as_the_rig_alone_that_it_was_fired_as(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, *, edited: bool
) -> None:
    monkeypatch.setattr(acquisition, "is_virtual_rig", lambda _: False)
    leave_journal(tmp_path, triggers_s=(12.0,))
    text = LEFT_RIG.text.replace("u_rel = 0.005", "u_rel = 0.006") if edited else LEFT_RIG.text
    assert edited == (text != LEFT_RIG.text)
    rig, display = parse_rig(text, LEFT_RIG.path, LEFT_RIG.databases), Told()
    left, recovered = acquisition._recover(rig, LiveOptions(out=tmp_path, watch=tmp_path / "in"), display)
    assert [shot.name for shot in left] == ([] if edited else ["0001"])
    assert recovered == ["shot 0001"]
    said = "still waiting for files: 0001; this rig is not the one as which they were fired, so that they are finished"
    assert bool(display.told(said)) == edited


def test_the_rig_that_was_armed_is_the_one_that_shots_are_converted_with(tmp_path: Path, range_of: RangeOf) -> None:
    rig = settling_soon(load_rig("mixed"), 0.1)
    (tmp_path / "rig.toml").write_text(rig.text, encoding="utf-8")
    display = Told()
    one = range_of(display, shots=2, rig=replace(rig, path=tmp_path / "rig.toml"))
    edited = rig.text.replace("polarity = 1", "polarity = -1")
    display.then["0001 captured"] = lambda: (tmp_path / "rig.toml").write_text(edited, encoding="utf-8") and None
    names = [f"{n:04d}_{s}.csv" for n in (1, 2) for s in ("camera", "dewetron")]
    display.then["0002 captured"] = drop(tmp_path / "in", *names)
    one.session.fired(one.clock.monotonic() - 2.0, one.clock.monotonic() - 1.0)
    one.run()
    assert len(display.told("rig.toml was changed since it was armed: shots are converted as it was then; ")) == 1
    assert {armed.text for armed in PlayedConversion.rigs} == {rig.text}


@pytest.mark.real_time
def test_a_shot_that_cannot_be_cut_on_a_full_disk_is_cut_when_there_is_room(
    tmp_path: Path, range_of: RangeOf, monkeypatch: pytest.MonkeyPatch
) -> None:
    display = Told()
    one = range_of(display)
    cut, full = one.session.cut, [True, True]

    def refuse(name: str, window: Any, path: Path) -> Any:
        if full:
            full.pop()
            raise StoreError("cannot be written: No space left on device", path=path, remedy="make room")
        return cut(name, window, path)

    monkeypatch.setattr(one.session, "cut", refuse)
    show, judged = display.show, set[tuple[str, bool]]()

    def noted(state: RangeState) -> None:
        judged.update((shot.state, shot.age_s is not None) for shot in state.shots)
        show(state)

    monkeypatch.setattr(display, "show", noted)
    display.then["No space left"] = drop(tmp_path / "in", *FILES)  # which are its own all the same
    display.quits = lambda: bool(one.live._shots) and one.live._shots[0].state == "usable"
    one.session.fired(one.clock.monotonic() - 1.0)
    outcome = one.run()
    assert len(display.told("No space left on device; make room; it is tried again every 10 s; the journal keeps")) == 1
    assert [(s.state, s.problem) for s in outcome.shots] == [("usable", "")]
    assert ("failed",) in display.states
    assert ("failed", True) in judged
    assert PlayedConversion.started == [("0001", sorted(["0001.rdlog", *FILES]), "")]


def test_a_session_of_so_many_shots_ends_though_one_stays_not_whole(tmp_path: Path, range_of: RangeOf) -> None:
    display = Told()
    display.until_s -= 40.0
    one = range_of(display, shots=1)
    display.then["0001 captured"] = drop(tmp_path / "in", *FILES)
    started, shown = PlayedConversion.started, display.show
    PlayedConversion.may_end = staticmethod(
        lambda: bool(display.told("grew after")) if len(started) == 1 else PlayedConversion.answer is not None
    )

    def show(state: Any) -> None:
        shown(state)
        if len(started) == 1 and not display.told("grew after"):
            drop(tmp_path / "in", FILES[0], text="x and more")()
        if len(started) == 2:
            PlayedConversion.answer = {"message": "a file of another recorder"}

    display.show = show  # type: ignore[method-assign]
    one.session.fired(one.clock.monotonic() - 1.0)
    outcome = one.run()
    assert [(s.state, s.problem) for s in outcome.shots] == [
        ("not whole", "its shot file is the one from before: a file of another recorder")
    ]


def test_a_shot_log_that_others_hold_keeps_no_shot_from_being_cut(
    tmp_path: Path, range_of: RangeOf, monkeypatch: pytest.MonkeyPatch
) -> None:
    display = Told()
    one = range_of(display, shots=1, added_mass=AddedMass(12.5, 0.05))
    given_back = threading.Event()

    def note(_mass: AddedMass, _out: Path, shot: str) -> str:
        held = not given_back.wait(20.0)
        return f"the added mass of shot {shot} is {'not ' if held else ''}in the shot log"

    monkeypatch.setattr(AddedMass, "note", note)

    def captured() -> None:
        drop(tmp_path / "in", *FILES)()
        assert PlayedConversion.started == []
        given_back.set()

    display.then["0001 captured"] = captured
    one.session.fired(one.clock.monotonic() - 1.0)
    outcome = one.run()
    assert [s.state for s in outcome.shots] == ["usable"]
    assert display.told("the added mass of shot 0001 is in the shot log")


def test_a_folder_full_of_foreign_files_holds_up_neither_keys_nor_screen(
    tmp_path: Path, range_of: RangeOf, monkeypatch: pytest.MonkeyPatch
) -> None:
    display = Told()
    one = range_of(display, shots=1)

    def slowly(_rig: object, file: Any) -> str:
        one.clock.sleep(0.04)
        if "foreign" in file.path.name:
            raise ReadError("no reader recognises this file's content", path=file.path)
        source: str = file.path.stem.rpartition("_")[2]
        return source

    monkeypatch.setattr("recoil_daq.live.shots.dropped_files.source_of", slowly)
    left_alone, shown = [0], display.show

    def show(state: Any) -> None:
        shown(state)
        left_alone.append(len(display.told("left alone")))

    display.show = show  # type: ignore[method-assign]
    display.then["0001 captured"] = drop(tmp_path / "in", *(f"!foreign{i:02d}.txt" for i in range(30)), *FILES)
    one.session.fired(one.clock.monotonic() - 1.0)
    outcome = one.run()
    assert [s.state for s in outcome.shots] == ["usable"]
    assert left_alone[-1] == 30
    assert max(b - a for a, b in pairwise(left_alone)) <= 3


def waited_s(one: Range) -> float:
    return one.clock.monotonic() - time.monotonic()


def waited_on(one: Range) -> Callable[[], None]:
    """Return what presses c and y: the shot waits for its camera alone then."""
    return lambda: one.display._pressed.extend("cy")


def test_a_shot_goes_on_without_a_camera_that_did_not_fire_and_takes_a_file_that_comes_all_the_same(
    range_of: RangeOf, tmp_path: Path
) -> None:
    display = Told(has_keys=True)
    one = range_of(display, shots=1, files_within_s=1e6)
    display.then["0001 captured"] = drop(tmp_path / "in", "0001_dewetron.csv")
    display.then["0001_dewetron.csv is of shot"] = waited_on(one)
    outcome = one.run(lambda: one.session.fired(1.0))
    assert display.told("shot 0001 goes on without camera; a file that comes is taken")
    assert [shot.state for shot in outcome.shots] == [ShotState.USABLE]
    assert PlayedConversion.without == [("camera",)]
    assert waited_s(one) < 100.0
    assert outcome.shots[0].takes("camera")


def test_nothing_goes_on_without_the_reference_clock(range_of: RangeOf, tmp_path: Path) -> None:
    display = Told(has_keys=True)
    one = range_of(display, shots=1, files_within_s=5.0)
    display.then["0001 captured"] = drop(tmp_path / "in", "0001_camera.csv")
    display.then["0001_camera.csv is of shot"] = waited_on(one)
    outcome = one.run(lambda: one.session.fired(1.0))
    assert not display.told("goes on without")
    assert [shot.state for shot in outcome.shots] == [ShotState.INCOMPLETE]


def test_a_shot_does_not_wait_for_a_source_that_may_stay_away(range_of: RangeOf, tmp_path: Path) -> None:
    mixed = load_rig("mixed")
    head = '[[source]]\nname = "camera"\n'
    rig = parse_rig(mixed.text.replace(head, f"{head}required = false\n"), mixed.path, dict(mixed.databases))
    display = Told()
    one = range_of(display, rig=rig, shots=1, files_within_s=1e6)
    display.then["0001 captured"] = drop(tmp_path / "in", "0001_dewetron.csv")
    outcome = one.run(lambda: one.session.fired(1.0))
    assert display.told("waiting for files of dewetron")
    assert [shot.state for shot in outcome.shots] == [ShotState.USABLE]
    # the rig says so itself
    assert PlayedConversion.without == [()]
    assert waited_s(one) < 100.0


def test_a_session_without_a_source_waits_for_no_file_of_it(range_of: RangeOf, tmp_path: Path) -> None:
    display = Told()
    one = range_of(display, shots=1, files_within_s=500.0, without=("camera",))
    display.then["0001 captured"] = drop(tmp_path / "in", "0001_dewetron.csv")
    outcome = one.run(lambda: one.session.fired(1.0))
    assert [shot.state for shot in outcome.shots] == [ShotState.USABLE]
    assert PlayedConversion.without == [("camera",)]
    assert not outcome.shots[0].takes("camera")
    with pytest.raises(ReadError, match="the trigger looks at p_brake"):
        range_of(display, without=("can",))
