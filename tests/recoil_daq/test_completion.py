"""Rigs and shots are completed in a shell, as typer asks for it."""

from __future__ import annotations

from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from recoil_daq.cli import app
from recoil_daq.commands.completion import complete_rig, complete_shot
from tests.builders.all_commands import all_commands


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    for name in ("mine.toml", "notes.txt", "stands/left.toml", "shots/0001.h5", "shots/0002.h5", "range/0101.h5"):
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_text("", encoding="utf-8")
    return tmp_path


@pytest.mark.parametrize(
    ("begun", "found"),
    [
        ("mi", ["mixed", "mine.toml"]),
        ("f", ["field-2013"]),
        ("st", ["stands/"]),
        ("stands/", ["stands/left.toml"]),
        ("none/", []),
        ("no", []),
    ],
)
@pytest.mark.usefixtures("folder")
def test_bundled_rigs_and_rig_files_are_offered(begun: str, found: list[str]) -> None:
    assert complete_rig(begun) == found


def test_a_path_from_the_root_is_completed(folder: Path) -> None:
    assert complete_rig(f"{folder}/mi") == [f"{folder}/mine.toml"]


@pytest.mark.parametrize(
    ("params", "begun", "found"),
    [
        ({}, "", ["0001", "0002", "range/", "shots/", "stands/"]),
        ({}, "0002", ["0002"]),
        ({"folder": Path("range")}, "01", ["0101"]),
        ({"folder": Path("nowhere")}, "0", []),
    ],
)
@pytest.mark.usefixtures("folder")
def test_shots_of_the_folder_are_offered(params: dict[str, Path], begun: str, found: list[str]) -> None:
    context = typer.Context(all_commands()["log"])
    context.params.update(params)
    assert complete_shot(context, begun) == found


@pytest.mark.parametrize(
    ("line", "offered"), [("recoil-daq check mi", "mixed"), ("recoil-daq log 00", "0002"), ("recoil-daq log 0", "0001")]
)
@pytest.mark.usefixtures("folder")
def test_a_shell_is_given_them(line: str, offered: str) -> None:
    asked = {"_RECOIL_DAQ_COMPLETE": "complete_bash", "COMP_WORDS": line, "COMP_CWORD": "2"}
    shown = CliRunner().invoke(app, [], env=asked, prog_name="recoil-daq")
    assert offered in shown.stdout.split()
