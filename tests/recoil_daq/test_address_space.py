"""Too little memory is one line and exit code 3, and never a hang in a library."""

from __future__ import annotations

import errno
import json
import subprocess
import sys
from pathlib import Path

import pytest
import typer

from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.processes import shortage
from recoil_acquisition.processes.shortage import LEAST_BYTES, is_shortage
from recoil_acquisition.readers.recording import map_to_corrupt_file
from recoil_daq.terminal.session import FAULT, Session

SHORTAGES = (
    MemoryError("Unable to allocate 8 GiB"), OSError(errno.ENOMEM, "Cannot allocate memory"),
    BlockingIOError(errno.EAGAIN, "Resource temporarily unavailable"), RuntimeError("can't start new thread"),
    ImportError("failed to map segment from shared object", path="/lib/_fblas.so"),
)  # fmt: skip


@pytest.fixture
def limited(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shortage, "address_space_bytes", lambda: 2 * LEAST_BYTES)


@pytest.mark.whole_way
@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such limit")
@pytest.mark.parametrize("megabytes", [100, 200, 400])
@pytest.mark.parametrize(
    "command", [["identify", "a.h5"], ["show", "a.h5"], ["formats", "--json"], ["predict", "mixed"]]
)
def test_a_small_address_space_is_told_at_once(megabytes: int, command: list[str], tmp_path: Path) -> None:
    import resource

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_AS, (megabytes * 1_000_000,) * 2)

    done = subprocess.run(
        [sys.executable, "-m", "recoil_daq.cli", *command], cwd=tmp_path, capture_output=True, text=True, timeout=60,
        preexec_fn=limit, check=False,
    )  # fmt: skip
    assert done.returncode == 3
    (line,) = done.stderr.splitlines()
    assert f"found a limit of {megabytes} MB" in line
    if "--json" in command:
        assert json.loads(done.stdout)["error"] == "ShortageError"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.usefixtures("limited")
@pytest.mark.parametrize("error", SHORTAGES, ids=lambda error: type(error).__name__)
def test_a_shortage_within_a_command_is_one_line(error: Exception, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(typer.Exit) as ended, Session(as_json=False, debug=False):
        raise error
    assert ended.value.exit_code == FAULT
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"error: there is not enough memory; found {type(error).__name__}")
    assert "ulimit" in line


@pytest.mark.usefixtures("limited")
@pytest.mark.parametrize("error", SHORTAGES, ids=lambda error: type(error).__name__)
def test_a_shortage_is_no_damage_of_the_file_that_is_read(error: Exception) -> None:
    with pytest.raises(ReadError, match="not enough memory to read it") as caught, map_to_corrupt_file(Path("a"), "b"):
        raise error
    assert not isinstance(caught.value, CorruptFileError)


def test_other_faults_are_no_shortage(monkeypatch: pytest.MonkeyPatch) -> None:
    missing = ImportError("No module named 'x'")
    for error in (missing, RuntimeError("x"), OSError(errno.ENOENT, "no such file"), ValueError("x")):
        assert not is_shortage(error)
    monkeypatch.setattr(shortage, "address_space_bytes", lambda: None)
    assert not is_shortage(SHORTAGES[-1])
