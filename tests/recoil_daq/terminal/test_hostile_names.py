"""Names out of files that a terminal or a log would obey: they are shown as they are spelled, everywhere."""

from __future__ import annotations

import io
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import Result

from recoil_acquisition.shot.quality_check import QualityCheck
from recoil_acquisition.store import write_shot
from recoil_daq.live.screen.armed_screen import ArmedScreen
from recoil_daq.live.screen.plain_log import PlainLog
from recoil_daq.live.screen.screen_look import Look
from recoil_daq.live.screen.screen_picture import picture
from recoil_daq.live.shot import LiveShot, ShotState
from recoil_daq.terminal.console import VisibleConsole, output_console
from recoil_daq.terminal.ingest import print_verdict
from recoil_daq.terminal.tables import print_table
from tests.builders.live_status import BRAKE, IMU, state_of, status
from tests.builders.range_states import CAMPAIGN
from tests.builders.shots import make_shot

EVIL = "\x1b]0;x\x07\x1b[2J\u202egnp\r\n[red]USABLE[/red]\x9b1m"
SHOWN = r"\x1b]0;x\x07\x1b[2J\u202egnp\r\n[red]USABLE[/red]\x9b1m"


def is_harmless(text: str) -> bool:
    controls = {c for c in text if (ord(c) < 32 and c != "\n") or 0x7F <= ord(c) < 0xA0}
    return not controls and not set(text) & set("\u202e\u2066\u2069")


def evil_shot(folder: Path) -> Path:
    shot = make_shot()
    channels = {c.name: c for c in (replace(c, name=c.name + EVIL, signal=EVIL) for c in shot.channels.values())}
    inputs = tuple(replace(one, name=EVIL) for one in shot.inputs)
    checks = (*shot.quality, QualityCheck.named(EVIL, EVIL, "fail", EVIL))
    alignments = tuple(replace(one, method=EVIL) for one in shot.alignments)
    evil = replace(shot, rig_name=EVIL, channels=channels, inputs=inputs, quality=checks, alignments=alignments)
    write_shot(evil, folder / "0007.h5")
    return folder / "0007.h5"


@pytest.mark.parametrize("words", [("show",), ("export", "--format", "csv", "--out", "x")])
def test_a_shot_files_names_are_shown_as_they_are_spelled(
    run: Callable[..., Result], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...]
) -> None:
    monkeypatch.chdir(tmp_path)
    done = run(words[0], evil_shot(tmp_path), *words[1:])
    assert done.exit_code == 0, done.output
    assert is_harmless(done.output)
    assert f"rig {SHOWN}" in done.output


@pytest.mark.skipif(sys.platform == "win32", reason="no file can bear such a name there")
@pytest.mark.parametrize("debug", [(), ("--debug",)])
def test_a_files_name_in_an_error_is_shown_as_it_is_spelled(
    run: Callable[..., Result], tmp_path: Path, debug: tuple[str, ...]
) -> None:
    path = tmp_path / "a\x1b[31m.csv"
    path.write_text("nothing")
    done = run("show", path, *debug)
    assert done.exit_code == 3
    assert is_harmless(done.output)
    assert r"a\x1b[31m.csv" in done.output


def test_the_verdict_and_a_table_show_names_as_they_are_spelled(capsys: pytest.CaptureFixture[str]) -> None:
    row = {"name": EVIL, "clock": EVIL, "rate_hz": None, "samples": 1}
    check = {"channel": EVIL, "check": EVIL, "verdict": "fail", "detail": EVIL}
    document = {"shot": "1", "rig": EVIL, "file": EVIL, "usable": False, "reasons": [EVIL], "channels": [row]}
    print_verdict({**document, "quality": [check]})
    print_table(EVIL, (EVIL,), [(EVIL,), ("ok",)])
    output_console().print(EVIL)
    said = capsys.readouterr().out
    assert is_harmless(said)
    assert said.count(SHOWN) >= 5


def test_a_log_shows_names_as_they_are_spelled() -> None:
    stream = io.StringIO()
    with PlainLog(stream) as log:
        log.notice(f"left alone: {EVIL}")
        log.show(state_of(replace(status(), sources=(replace(IMU, name=EVIL, error=EVIL),))))
    assert is_harmless(stream.getvalue())
    assert len(stream.getvalue().splitlines()) == 2


def test_the_armed_screen_shows_names_as_they_are_spelled() -> None:
    file = io.StringIO()
    console = VisibleConsole(file=file, width=300, height=60, color_system=None)
    screen = ArmedScreen(console)
    screen.notice(EVIL)
    evil = replace(status(), sources=(replace(IMU, name=EVIL, error=EVIL),), channels=(replace(BRAKE, name=EVIL),))
    shots = [LiveShot("1", state=ShotState.FAILED, problem=EVIL), LiveShot("2", state=ShotState.WAITING, wanted={EVIL})]
    state = replace(
        state_of(evil, shots), rig=EVIL, alert=EVIL, cautions=(EVIL,), campaign={**CAMPAIGN, "changes": [EVIL]},
        added_mass=EVIL, asked=EVIL,
        notices=screen.noticed, watched=Path(EVIL),
    )  # fmt: skip
    for look in (screen.look, replace(screen.look, words=True), Look(60, 30)):
        for line in picture(state, look).lines:
            console.print(line)
    assert is_harmless(file.getvalue())
    assert SHOWN[:20] in file.getvalue()
