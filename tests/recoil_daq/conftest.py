"""One simulated shot of each bundled rig, in a shorter record, shared by all tests of this folder and all workers."""

import json
import shutil
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from typer import testing
from typer.testing import CliRunner, Result

from recoil_daq.cli import app
from recoil_rigs.twin import TwinShot, simulate_shot
from tests.builders.processor_time import apart
from tests.builders.shared_motions import once_in_this_run
from tests.builders.virtual_shots import SHORTER, with_twin

# Typer's runner puts all commands together anew for each line, which takes longer than many a line does
if (put_together := vars(testing).get("_get_command")) is not None:
    vars(testing)["_get_command"] = cache(put_together)


@pytest.fixture(autouse=True)
def _logs_settle_soon(monkeypatch: pytest.MonkeyPatch) -> None:
    """Take a shot log that a test has just written for settled: how long it is waited for has tests of its own."""
    monkeypatch.setattr("recoil_acquisition.store.shared_file.QUIET_S", 0.02)
    monkeypatch.setattr("recoil_acquisition.store.shared_file.COARSE_S", 0.02)


@pytest.fixture(scope="session")
def field_shot() -> TwinShot:
    return once_in_this_run("field-shot", partial(_simulated, "field-2013"))


@pytest.fixture(scope="session")
def mixed_shot() -> TwinShot:
    return once_in_this_run("mixed-shot", partial(_simulated, "mixed"))


def _simulated(name: str, folder: Path) -> TwinShot:
    return simulate_shot(with_twin(name, **SHORTER), folder / "0001", seed=1, shot="0001")


@pytest.fixture
def files(field_shot: TwinShot, tmp_path: Path) -> dict[str, Path]:
    """Copies of the recorders' files that a test may damage, by kind."""
    copies = {}
    for file in field_shot.files:
        kind = "camera" if "camera" in file.name else "dewetron"
        copies[kind] = Path(shutil.copy(file, tmp_path / file.name))
    return copies


@pytest.fixture(scope="session")
def stored(field_shot: TwinShot) -> Path:
    """The shot file of the field shot."""

    def ingested(out: Path) -> Path:
        words = ["ingest", "field-2013", *map(str, field_shot.files), "--shot", "0001", "--out", str(out)]
        result = CliRunner().invoke(app, words)
        assert result.exit_code == 0, result.output
        return out / "0001.h5"

    return once_in_this_run("stored", ingested)


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
    """The field shot's report by the default options; each worker makes it once, for whoever asks."""
    out = tmp_path_factory.mktemp("identified")
    with apart():
        result = CliRunner().invoke(app, ["identify", str(stored), "--out", str(out), "--verbose"])
    assert result.exit_code == 0, result.output
    return Identified(result, out)


@pytest.fixture
def run() -> Callable[..., Result]:
    """Run a command line in this process."""

    def invoke(*words: object) -> Result:
        return CliRunner().invoke(app, [str(word) for word in words])

    return invoke
