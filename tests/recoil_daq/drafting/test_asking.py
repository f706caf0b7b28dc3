"""Questions of `init` at a terminal: nonsense is asked again, and nothing that was answered is lost."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest
import typer

from recoil_acquisition.errors import KeyPath
from recoil_daq.drafting.answer import Answer
from recoil_daq.drafting.asking import ask
from recoil_daq.drafting.rig_draft import OpenEntry
from recoil_daq.terminal.session import Session


def typing(monkeypatch: pytest.MonkeyPatch, *texts: str) -> None:
    """Let somebody type these texts, and then press Ctrl-C."""
    left: Iterator[str] = iter(texts)

    def prompt(*_: object, default: str = "", **__: object) -> str:
        text = next(left, None)
        if text is None:
            raise typer.Abort
        return text or default

    monkeypatch.setattr(typer, "prompt", prompt)


@pytest.fixture
def files(tmp_path: Path) -> list[Path]:
    rows = "".join(f"{n / 1000:.3f},{0.5 * n if 40 < n < 60 else 0.1}\n" for n in range(200))
    file = tmp_path / "a.csv"
    file.write_text(f"Time (s),Force (N)\n{rows}")
    return [file]


def drafted(files: list[Path]) -> tuple[OpenEntry, ...]:
    from recoil_daq.drafting.init import draft_rig

    return draft_rig(files).draft.questions()


def test_nonsense_is_asked_again_with_the_limits_and_enter_leaves_a_value_open(
    monkeypatch: pytest.MonkeyPatch, files: list[Path], capsys: pytest.CaptureFixture[str]
) -> None:
    typing(monkeypatch, "10430000", "10,430", "", "99", "0,21", ".")
    answers: dict[KeyPath, Answer] = {}
    ask(drafted(files), answers)
    said = capsys.readouterr().err
    assert {key[-1]: answer.value for key, answer in answers.items()} == {"phi20": 0.21}
    assert "'10430000' must lie between 1e-06 and 1e+07 kg, found 1.043e+07; once more" in said
    assert "'10,430' may be thousands or decimals, 10430 or 10.43" in said
    assert "'99' must lie between -1.57 and 1.57 rad" in said
    assert "taken as 0.21 rad" in said


def test_ctrl_c_writes_the_draft_with_the_answers_so_far_and_says_where(
    run, monkeypatch: pytest.MonkeyPatch, files: list[Path], tmp_path: Path
) -> None:
    typing(monkeypatch, "782 kg", "0,86 deg")
    monkeypatch.setattr(Session, "asks", True)
    rig = tmp_path / "rig.toml"
    result = run("init", *files, "--out", rig)
    assert result.exit_code == 130
    stated = tomllib.loads(rig.read_text(encoding="utf-8"))["mechanism"]
    assert (stated["m3"], stated["phi20"]) == (782.0, 0.0150098315671512)
    assert stated["friction"].startswith("TODO")
    last = result.stdout.splitlines()[-1]
    assert f"{rig} has the 2 answers so far" in last.replace("\n", "")
    assert list(tmp_path.glob("*.partial*")) == []
