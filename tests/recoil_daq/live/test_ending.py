"""However a session is ended, every shot that has its files gets its shot file; and nothing is said to be kept that is
not."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from recoil_acquisition.errors import RigError, StoreError
from recoil_daq.live.acquisition import run_live
from recoil_daq.live.output_folder import OutputFolder
from recoil_daq.live.shot import LiveOptions
from recoil_rigs.rig import load_rig
from tests.builders.range_session import PlayedConversion, Range, Told


class Gate:
    """Opens after so many looks, or when told."""

    def __init__(self, looks: int) -> None:
        self.left = looks

    def __call__(self) -> bool:
        self.left -= 1
        return self.left < 0


def with_files(range_: Range) -> None:
    """Have every shot find the files of the recorder and the camera there."""
    captured = range_.live._work._captured

    def also(shot: object, cut: object) -> None:
        for source in ("camera", "dewetron"):
            path = range_.out / f"{shot.name}_{source}.csv"  # type: ignore[attr-defined]
            path.write_text("x")
            shot.files[source] = path  # type: ignore[attr-defined]
        captured(shot, cut)  # type: ignore[arg-type]

    range_.live._work._captured = also  # type: ignore[method-assign]


def raised(number: int) -> Callable[[], None]:
    return lambda: signal.raise_signal(number)


ENDINGS = {
    "q": None,
    "ctrl-c": signal.SIGINT,
    "terminate": signal.SIGTERM,
    "hang up": getattr(signal, "SIGHUP", signal.SIGTERM),
}


@pytest.fixture(autouse=True)
def heard() -> Iterator[None]:
    """Have SIGHUP end a process again, whatever the tests were started with: under nohup a session outlives it."""
    number = getattr(signal, "SIGHUP", signal.SIGTERM)
    before = signal.signal(number, signal.SIG_DFL)
    yield
    signal.signal(number, before)


@pytest.mark.parametrize("ending", ENDINGS)
def test_every_way_to_end_completes_every_shot_that_has_its_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ending: str
) -> None:
    number = ENDINGS[ending]
    display = Told(keys={"0003 captured": "qy"} if number is None else {}, has_keys=number is None)
    if number is not None:
        display.then["0003 captured"] = raised(number)
    one = Range(monkeypatch, load_rig("mixed"), tmp_path, display)
    with_files(one)
    PlayedConversion.may_end = staticmethod(lambda: one.session.stopped)  # the first is still converting when it ends
    one.session.fired(1.0, 2.0, 3.0)
    outcome = one.run()
    assert [(shot.name, shot.state) for shot in outcome.shots] == [(f"000{n}", "usable") for n in (1, 2, 3)]
    assert [name for name, _, _ in PlayedConversion.started] == ["0001", "0002", "0003"]
    assert one.session.complete is True
    assert outcome.interrupted == one.log["interrupted"] == (number is not None)
    assert not display.told("given up")


def test_a_shot_that_is_being_recorded_is_recorded_to_its_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    display = Told(keys={"hello": "qy"}, has_keys=True)
    one = Range(monkeypatch, load_rig("mixed"), tmp_path, display)
    with_files(one)
    one.session.opened(1.0, Gate(3))
    outcome = one.run(lambda: display.notice("hello"))
    assert [shot.state for shot in outcome.shots] == ["usable"]
    assert one.session.armed is False


def test_a_second_signal_without_keys_gives_up_at_once_and_keeps_the_journal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    display = Told()
    display.then = {"0002 captured": raised(signal.SIGTERM), "ending:": raised(signal.SIGINT)}
    one = Range(monkeypatch, load_rig("mixed"), tmp_path, display)
    with_files(one)
    PlayedConversion.may_end = staticmethod(lambda: False)
    one.session.fired(1.0, 2.0)
    outcome = one.run()
    assert [shot.state for shot in outcome.shots] == ["incomplete", "incomplete"]
    assert [shot.problem for shot in outcome.shots] == ["given up before it was converted"] * 2
    assert outcome.journal == one.session.journal_folder
    assert one.session.complete is False
    assert PlayedConversion.ended == ["0001"]
    told = display.told("shot 0002: given up before it was converted; its capture is kept: ")
    assert told
    assert f"{tmp_path}/captures/0002.rdlog {tmp_path}/0002_camera.csv {tmp_path}/0002_dewetron.csv --out" in told[0]


@pytest.mark.parametrize(("answer", "states"), [("y", "incomplete"), ("n", "usable")])
def test_a_second_ctrl_c_at_a_terminal_asks_before_it_gives_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, answer: str, states: str
) -> None:
    display = Told(keys={"give up the shots": answer}, has_keys=True)
    display.then = {"0002 captured": raised(signal.SIGINT), "ending:": raised(signal.SIGINT)}
    one = Range(monkeypatch, load_rig("mixed"), tmp_path, display)
    with_files(one)
    PlayedConversion.may_end = staticmethod(lambda: bool(display.told("completing them")))
    one.session.fired(1.0, 2.0)
    outcome = one.run()
    assert len(display.told("give up the shots that are not complete (0001, 0002)? y: give up; n: complete them")) == 1
    assert [shot.state for shot in outcome.shots] == [states, states]


@pytest.mark.parametrize("again", ["q", "ctrl-c"])
def test_after_q_a_second_q_or_the_first_ctrl_c_asks_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, again: str
) -> None:
    display = Told(keys={"0001 captured": "qy", "give up the shots": "y"}, has_keys=True)
    display.then["ending:"] = raised(signal.SIGINT) if again == "ctrl-c" else lambda: display._pressed.append("q")
    one = Range(monkeypatch, load_rig("mixed"), tmp_path, display)
    with_files(one)
    PlayedConversion.may_end = staticmethod(lambda: False)
    one.session.fired(1.0)
    assert [shot.state for shot in one.run().shots] == ["incomplete"]


def test_a_shot_whose_files_are_still_being_written_when_it_ends_waits_for_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    display = Told(keys={"0001 captured": "qy"}, has_keys=True)
    one = Range(monkeypatch, load_rig("mixed"), tmp_path, display, watch=tmp_path / "in")

    def drop() -> None:
        for name in ("0001_dewetron.csv", "0001_camera.csv"):
            (tmp_path / "in" / name).write_text("x")

    display.then["ending:"] = drop
    monkeypatch.setattr("recoil_daq.live.shots.dropped_files.source_of", lambda _rig, f: f.path.stem.partition("_")[2])
    one.session.fired(one.clock.monotonic() - 1.0)
    outcome = one.run()
    assert [shot.state for shot in outcome.shots] == ["usable"]


def test_a_shot_without_its_files_is_given_up_aloud_with_the_way_to_finish_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    display = Told(keys={"0001 captured": "qy"}, has_keys=True)
    one = Range(monkeypatch, load_rig("mixed"), tmp_path, display, watch=tmp_path / "in")
    one.session.fired(1.0)
    outcome = one.run()
    assert [(s.state, s.problem) for s in outcome.shots] == [("incomplete", "no file of camera, dewetron")]
    assert display.told(f"{tmp_path}/captures/0001.rdlog FILES --out {tmp_path}`")
    assert outcome.journal is not None


def test_a_second_session_on_a_folder_is_refused_and_a_dead_ones_lock_is_not_kept(tmp_path: Path) -> None:
    (tmp_path / "journal").mkdir()
    (tmp_path / "journal" / "writer.lock").touch()  # of a process that died
    with OutputFolder(tmp_path):
        with pytest.raises(StoreError, match="another live session writes to this folder; end that one first"):
            OutputFolder(tmp_path)
        with pytest.raises(StoreError, match="another live session"):
            run_live(load_rig("mixed"), LiveOptions(tmp_path), Told())
    with OutputFolder(tmp_path):
        pass
    assert not list((tmp_path / "journal").iterdir())


@pytest.mark.real_time
def test_the_command_refuses_a_second_session_in_one_line_with_exit_code_3(tmp_path: Path) -> None:
    with OutputFolder(tmp_path):
        words = ["ingest", "mixed", "--live", "--no-screen", "--out", str(tmp_path)]
        command = [sys.executable, "-m", "recoil_daq.cli", *words]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 3
    assert done.stdout == ""
    assert len(done.stderr.splitlines()) == 1
    assert "another live session writes to this folder" in done.stderr


def test_a_rig_that_is_at_fault_leaves_no_folder_behind(tmp_path: Path) -> None:
    with pytest.raises(RigError, match="trigger: is missing"):
        run_live(replace(load_rig("mixed"), trigger=None), LiveOptions(tmp_path / "out"), Told())
    assert not (tmp_path / "out").exists()


def test_a_folder_that_is_deleted_while_armed_ends_it_and_nothing_is_said_to_be_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    display = Told()
    one = Range(monkeypatch, load_rig("mixed"), out, display)
    with_files(one)
    PlayedConversion.may_end = staticmethod(lambda: len(one.live._shots) == 1 or bool(display.told("DISARMED")))
    monkeypatch.setattr(display, "verdict", lambda _: one.session.fired(2.0))
    display.then["0002 captured"] = lambda: shutil.rmtree(out)
    one.session.fired(1.0)
    began_s = time.monotonic()
    outcome = one.run()
    assert time.monotonic() - began_s < 5.0
    assert isinstance(outcome.error, StoreError)
    assert "was deleted while armed: shot files, captures and the journal in it are NOT kept" in str(outcome.error)
    assert display.told("DISARMED: ")
    assert display.alerts == ["", "OUTPUT FOLDER GONE"]
    assert [shot.state for shot in outcome.shots] == ["failed", "incomplete"]
    assert not [text for text in display.notices if "kept" in text and "NOT kept" not in text]
    assert outcome.journal is None
    assert not out.exists()


@pytest.mark.skipif(not Path("/proc/self/fd").is_dir(), reason="the system does not tell where a folder went")
def test_a_folder_that_is_moved_while_armed_is_named_at_its_new_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out, away = tmp_path / "out", tmp_path / "away"
    display = Told()
    one = Range(monkeypatch, load_rig("mixed"), out, display)
    display.then["hello"] = lambda: out.rename(away)
    outcome = one.run(lambda: display.notice("hello"))
    assert f"was moved to {away} while armed" in str(outcome.error)
    assert f"`recoil-daq recover {away}`, and arm again" in str(outcome.error)
    assert not out.exists()
    (log,) = (away / "sessions").glob("*.json")
    assert "was moved" in json.loads(log.read_text())["error"]


def test_at_a_terminal_the_screen_stays_until_somebody_has_seen_that_the_folder_is_gone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    display = Told(keys={"DISARMED": " "}, has_keys=True)
    one = Range(monkeypatch, load_rig("mixed"), out, display)
    display.then["hello"] = lambda: shutil.rmtree(out)
    pressed = iter(["", "", "", "q"])
    monkeypatch.setattr(display, "key", lambda **_: next(pressed) if one.session.stopped else "")
    one.run(lambda: display.notice("hello"))
    assert next(pressed, None) is None
    assert display.alerts[-1] == "OUTPUT FOLDER GONE"


def test_a_device_that_is_lost_stands_in_the_header_and_in_the_log_with_what_is_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    display = Told()
    one = Range(monkeypatch, load_rig("mixed"), tmp_path, display)
    shown: list[str] = []

    def show(state: object) -> None:
        shown.append(state.alert)  # type: ignore[attr-defined]
        if len(shown) == 1:
            one.session.happened("imu", 10.25, "lost")
        elif len(shown) == 3:
            one.session.happened("imu", 13.25, "reopened")
        elif len(shown) == 5:
            raised(signal.SIGTERM)()

    monkeypatch.setattr(display, "show", show)
    one.run()
    lost = "imu LOST: it is opened as soon as it is back"
    assert shown[:3] == ["", lost, lost]
    assert shown[-1] == ""
    assert display.told("imu LOST at 01:46:50.250Z: /dev/ttyUSB0")
    assert display.told("imu is back at 01:46:53.250Z: 3.00 s are missing, about 102000 bytes at its rate before")
