"""Commands that are run in a folder whose files bear the names of modules: none of these files is run."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.builders.foreign_modules import hostile_folder, modules_run
from tests.builders.live_rigs import LiveProcess, write_live_rig
from tests.builders.own_commands import own_commands
from tests.builders.port_player import PortPlayer
from tests.builders.virtual_shots import SHORTER, with_twin

PROGRAM = Path(sys.executable).with_name("recoil-daq")


@pytest.fixture
def hostile(tmp_path: Path) -> Path:
    return hostile_folder(tmp_path / "user")


def _command(*words: object) -> list[str]:
    program = [str(PROGRAM)] if PROGRAM.exists() else [sys.executable, "-P", "-m", "recoil_daq.cli"]
    return [*program, *map(str, words)]


def _run(folder: Path, *words: object, code: int = 0) -> None:
    done = subprocess.run(
        _command(*words), cwd=folder, capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL
    )
    assert done.returncode == code, (words, done.stdout, done.stderr)
    assert not modules_run(folder)


def test_the_files_are_run_by_a_python_that_looks_there(hostile: Path) -> None:
    subprocess.run([sys.executable, "-c", "import numpy, daq"], cwd=hostile, check=True, env=_plain_environment())
    assert modules_run(hostile) >= {"numpy", "daq"}


def _plain_environment() -> dict[str, str]:
    return {name: value for name, value in os.environ.items() if name != "PYTHONSAFEPATH"}


@pytest.mark.whole_way
def test_no_command_on_files_runs_a_module_of_the_users_folder(hostile: Path) -> None:
    # a short record: whose modules are run does not depend on its length
    rig = hostile / "rig.toml"
    rig.write_text(with_twin("field-2013", **SHORTER).text, encoding="utf-8")
    _run(hostile, "check", rig)
    (hostile / "demo" / "simulated" / "0001").mkdir(parents=True)
    files = [f"simulated/0001/0001_{what}.csv" for what in ("camera", "dewetron")]
    done = own_commands(
        ("formats",),
        ("simulate", rig, "--out", "simulated"),
        ("ingest", rig, *files, "--shot", "0001"),
        ("show", files[0]),
        ("show", "shots/0001.h5"),
        ("identify", "shots"),
        ("export", "shots/0001.h5", "--format", "csv"),
        ("recover", "shots"),
        ("demo", "--out", "demo"),  # it does what those before it do: here it is refused
        cwd=hostile,
    )
    assert [one.code for one in done] == [0] * (len(done) - 1) + [3], [one.out for one in done]
    assert not modules_run(hostile)
    # what one command imported the next does not look for: it must not have begun to look in the folder either
    looked = {Path(hostile, place).resolve() for one in done for place in one.path}
    assert hostile.resolve() not in looked


@pytest.mark.whole_way
def test_a_users_script_beside_files_of_the_folders_names_works(tmp_path: Path) -> None:
    for name in ("daq", "processing", "identification", "rigs"):
        (tmp_path / f"{name}.py").write_text(f"raise ImportError('the user has a {name}.py of their own')\n")
    script = "from recoil_daq import load_rig\nprint(load_rig('field-2013').name)\n"
    (tmp_path / "mine.py").write_text(script, encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "mine.py"], cwd=tmp_path, capture_output=True, text=True, check=False, env=_plain_environment()
    )
    assert (done.returncode, done.stdout) == (0, "field-2013\n"), done.stderr


@pytest.mark.real_time
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="plays to pseudo-terminals")
def test_no_live_command_runs_a_module_of_the_users_folder(hostile: Path) -> None:
    port = PortPlayer("port")
    rig = write_live_rig(hostile, [port.path])
    try:
        with LiveProcess(rig, hostile / "shots", hostile / "log.txt", cwd=hostile, warms=True) as process:
            journal = process.journal()
            with port:
                process.recording(journal)
                time.sleep(0.3)
                port.fire()
                process.wait_for("capture", (hostile / "shots" / "captures" / "0001.rdlog").is_file)
            assert process.end(signal.SIGINT) == 130, process.said
    finally:
        port.stop()
    assert not modules_run(hostile)
