"""What a user's locale changes: nothing but the signs that its encoding has not."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from recoil_rigs.rig import find_rig

NAME = "Prüfstand шасси µ"
ROOT = Path(__file__).resolve().parents[2]
COMMAND = "from recoil_daq.cli import main; main()"


def run(encoding: str, *words: object) -> subprocess.CompletedProcess[bytes]:
    path = os.pathsep.join(str(ROOT / part) for part in (".", "daq", "processing", "identification", "rigs"))
    env = {**os.environ, "PYTHONIOENCODING": encoding, "PYTHONPATH": path}
    return subprocess.run([sys.executable, "-c", COMMAND, *map(str, words)], capture_output=True, env=env, check=False)


@pytest.fixture
def rig(tmp_path: Path) -> Path:
    """A rig whose name no code page of Windows has whole."""
    bundled = find_rig("field-2013").read_text(encoding="utf-8")
    path = tmp_path / "стенд.toml"
    path.write_text(bundled.replace('name = "field-2013"', f'name = "{NAME}"'), encoding="utf-8")
    return path


@pytest.mark.whole_way
@pytest.mark.parametrize(
    ("encoding", "shown"),
    [
        ("utf-8", NAME),
        ("cp1252", r"Prüfstand \u0448\u0430\u0441\u0441\u0438 µ"),
        ("cp1251", r"Pr\xfcfstand шасси µ"),
        ("ascii", r"Pr\xfcfstand \u0448\u0430\u0441\u0441\u0438 \xb5"),
    ],
)
def test_what_an_encoding_has_no_sign_for_is_spelled(rig: Path, encoding: str, shown: str) -> None:
    done = run(encoding, "check", rig)
    assert done.returncode == 0, done.stderr
    assert done.stdout.decode(encoding).splitlines()[0] == f"Rig {shown}: no fault"


@pytest.mark.whole_way
def test_a_document_is_the_same_in_every_encoding(rig: Path) -> None:
    done = run("ascii", "check", rig, "--json")
    assert json.loads(done.stdout)["rig"] == NAME


@pytest.mark.indispensable("locale")
def test_an_error_is_one_line_in_every_encoding(tmp_path: Path) -> None:
    done = run("ascii", "show", tmp_path / "прицел.csv")
    assert done.returncode == 3
    assert done.stderr.count(b"\n") == 1
    assert b"no such file" in done.stderr
