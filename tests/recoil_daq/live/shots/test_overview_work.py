"""Overviews after a shot: written by the process that stays warm, and no fault of one costs more than its curves."""

from __future__ import annotations

import shutil
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from recoil_acquisition.shot.shot import InputFile
from recoil_daq.live.shot import LiveShot, ShotState
from recoil_daq.live.shots.overview_work import OverviewWork
from recoil_daq.warm_worker import WarmWorker
from tests.builders.range_session import Told

pytestmark = pytest.mark.real_time


@pytest.fixture
def worker() -> Iterator[WarmWorker]:
    made = WarmWorker()
    yield made
    made.close()


def finish(work: OverviewWork) -> None:
    ends_s = time.monotonic() + 60.0
    while work._asked and time.monotonic() < ends_s:
        work.look()
        time.sleep(0.02)
    assert not work._asked


def shot_of(file: Path, **changes: Any) -> LiveShot:
    return LiveShot(file.stem, state=ShotState.USABLE, document={"file": str(file)}, **changes)


def test_a_shot_has_its_overview_and_earlier_ones_get_theirs(worker: WarmWorker, stored: Path, tmp_path: Path) -> None:
    file, earlier = (Path(shutil.copy(stored, tmp_path / f"{name}.h5")) for name in ("0001", "0007"))
    (tmp_path / "0009.h5").write_bytes(b"no shot")
    told, before = Told(), shot_of(earlier)
    shot = shot_of(file)
    work = OverviewWork(worker, tmp_path, told, [before, shot])
    assert not work.pending, "nobody waits for what concerns earlier shots"
    work.begin(shot)
    assert work.pending
    finish(work)
    assert shot.overview == InputFile.of(file).sha256
    assert before.overview == InputFile.of(earlier).sha256
    assert [notice for notice in told.notices if "0009" in notice]
    for name in ("0001", earlier.stem):
        assert (tmp_path / "overviews" / name / "overview.js").is_file()


def test_a_shot_file_that_is_gone_costs_its_curves_alone(worker: WarmWorker, tmp_path: Path) -> None:
    told = Told()
    work = OverviewWork(worker, tmp_path, told)
    shot = shot_of(tmp_path / "0001.h5")
    work.begin(shot)
    finish(work)
    assert shot.overview == ""
    assert [notice for notice in told.notices if notice.startswith("the page has no curves of shot 0001: ")]
    work.begin(LiveShot("0002"))
    assert not work.pending, "it has no shot file"


@pytest.mark.parametrize("overview_first", [True, False])
def test_a_shot_of_before_has_its_overview_whichever_was_read_first(tmp_path: Path, *, overview_first: bool) -> None:
    work = SimpleNamespace(done=overview_first, result=lambda: ([], {"0001": "ab" * 32}))
    worker = SimpleNamespace(ask=lambda *_, **__: work, look=lambda: None)
    overviews = OverviewWork(worker, tmp_path, Told(), [])  # type: ignore[arg-type]
    shot = LiveShot("0001", document={"file": "0001.h5"})
    overviews.look()
    overviews.know([shot])
    work.done = True
    overviews.look()
    assert shot.overview == "ab" * 32
