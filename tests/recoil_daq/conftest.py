"""One simulated shot of each bundled rig, in a shorter record, shared by all tests of this folder."""

import json
import shutil
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from typer import testing
from typer.testing import CliRunner, Result

from recoil_daq.cli import app
from recoil_rigs.twin import TwinShot, simulate_shot
from tests.builders.virtual_shots import SHORTER, with_twin

# Typer's runner puts all commands together anew for each line, which takes longer than many a line does
if (put_together := vars(testing).get("_get_command")) is not None:
    vars(testing)["_get_command"] = cache(put_together)


@pytest.fixture(scope="session")
def field_shot(tmp_path_factory: pytest.TempPathFactory) -> TwinShot:
    rig = with_twin("field-2013", **SHORTER)
    return simulate_shot(rig, tmp_path_factory.mktemp("field") / "0001", seed=1, shot="0001")


@pytest.fixture(scope="session")
def mixed_shot(tmp_path_factory: pytest.TempPathFactory) -> TwinShot:
    rig = with_twin("mixed", **SHORTER)
    return simulate_shot(rig, tmp_path_factory.mktemp("mixed") / "0001", seed=1, shot="0001")


@pytest.fixture
def files(field_shot: TwinShot, tmp_path: Path) -> dict[str, Path]:
    """Copies of the recorders' files that a test may damage, by kind."""
    copies = {}
    for file in field_shot.files:
        kind = "camera" if "camera" in file.name else "dewetron"
        copies[kind] = Path(shutil.copy(file, tmp_path / file.name))
    return copies


@pytest.fixture(scope="session")
def stored(field_shot: TwinShot, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The shot file of the field shot."""
    out = tmp_path_factory.mktemp("stored")
    result = CliRunner().invoke(
        app, ["ingest", "field-2013", *map(str, field_shot.files), "--shot", "0001", "--out", str(out)]
    )
    assert result.exit_code == 0, result.output
    return out / "0001.h5"


class Identified(NamedTuple):
    """What a command line printed, and the folder of reports that it made; not to be changed."""

    result: Result
    reports: Path

    @property
    def report(self) -> dict[str, Any]:
        """The contents of the shot's ``report.json``."""
        return json.loads((self.reports / "0001" / "report.json").read_text(encoding="utf-8"))


@pytest.fixture(scope="session")
def identified(stored: Path, tmp_path_factory: pytest.TempPathFactory) -> Identified:
    """The field shot's report by the default options."""
    out = tmp_path_factory.mktemp("identified")
    result = CliRunner().invoke(app, ["identify", str(stored), "--out", str(out)])
    assert result.exit_code == 0, result.output
    return Identified(result, out)


@pytest.fixture
def run() -> Callable[..., Result]:
    """Run a command line in this process."""

    def invoke(*words: object) -> Result:
        return CliRunner().invoke(app, [str(word) for word in words])

    return invoke
