"""Standard streams that are full, closed or read no more: what is done is done, and the exit code tells."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

COMMAND = [sys.executable, "-c", "from recoil_daq.cli import main; main()"]
NO_FULL_DEVICE = not Path("/dev/full").exists()

pytestmark = pytest.mark.skipif(os.name == "nt", reason="a shell that closes streams is that of POSIX")


def ended(redirected: str, *words: object, folder: Path) -> subprocess.CompletedProcess[str]:
    """Run a command in a shell with its streams redirected."""
    line = f'"$@" {redirected}'
    return subprocess.run(
        ["/bin/sh", "-c", line, "sh", *COMMAND, *map(str, words)],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.whole_way
@pytest.mark.skipif(NO_FULL_DEVICE, reason="this system has no full device")
@pytest.mark.parametrize("words", [("formats",), ("formats", "--json"), ("--help",), ("log", "0001", "notes=a")])
def test_a_full_disk_behind_stdout_is_told_in_one_line(tmp_path: Path, words: tuple[str, ...]) -> None:
    (tmp_path / "shots").mkdir()
    (tmp_path / "shots" / "0001.h5").touch()
    done = ended("> /dev/full", *words, folder=tmp_path)
    assert done.returncode == 4
    assert done.stderr == "the output cannot be printed: No space left on device; the work goes on\n"
    assert (tmp_path / "shots" / "shotlog.csv").exists() == (words[0] == "log")


@pytest.mark.whole_way
def test_a_stdout_that_is_closed_is_told_and_no_file_takes_its_place(tmp_path: Path) -> None:
    (tmp_path / "0001.h5").touch()
    done = ended(">&-", "log", "0001", "notes=a", "--dir", tmp_path, folder=tmp_path)
    assert done.returncode == 4
    assert done.stderr == "the output cannot be printed: it is closed; what was asked for is done\n"
    assert (tmp_path / "shotlog.csv").read_text("utf-8").splitlines()[1:] == ["0001,,,,,,,,,a"]


@pytest.mark.whole_way
def test_a_pipe_that_its_reader_closed_is_no_fault() -> None:
    script = '{ "$@"; echo "code $?" >&2; } | head -1'
    done = subprocess.run(
        ["/bin/sh", "-c", script, "sh", *COMMAND, "formats"], capture_output=True, text=True, check=False
    )
    assert done.stderr == "code 0\n"
    assert len(done.stdout.splitlines()) == 1


@pytest.mark.whole_way
def test_an_error_keeps_its_exit_code(tmp_path: Path) -> None:
    assert ended(">&-", "show", "nothing.h5", folder=tmp_path).returncode == 3
    assert ended(">&-", "show", folder=tmp_path).returncode == 2
    assert ended(">&- 2>&-", "show", "nothing.h5", folder=tmp_path).returncode == 3


@pytest.mark.whole_way
@pytest.mark.parametrize("how", ["", "--json"])
def test_without_any_stream_a_report_is_written_all_the_same(stored: Path, tmp_path: Path, how: str) -> None:
    shutil.copy(stored, tmp_path / "0001.h5")
    done = ended("<&- >&- 2>&-", "identify", "0001.h5", "--out", "reports", *how.split(), folder=tmp_path)
    assert done.returncode == 4
    report = json.loads((tmp_path / "reports" / "0001" / "report.json").read_text("utf-8"))
    assert report["valid"]
