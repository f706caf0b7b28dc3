"""The record of a live acquisition goes into the shot with the files that it is of."""

from __future__ import annotations

import datetime as dt
import hashlib
import json
from pathlib import Path
from typing import Any

import pytest

from recoil_acquisition.acquisition import AcquiredSource, Acquisition, write_acquisition
from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.store import read_shot, shot_summary
from recoil_daq.ingest import Ingested, ingest_files
from recoil_rigs.rig import load_rig
from recoil_rigs.twin import TwinShot
from tests.builders.shots import acquired_source, make_acquisition

ON = dt.date(2026, 6, 1)


def record(folder: Path, name: str = "a.json", **changes: Any) -> tuple[Path, Acquisition]:
    path = folder / name
    acquisition = make_acquisition(**{"shot": "live-3", "rig": "mixed", "sources": sources()} | changes)
    write_acquisition(acquisition, path)
    return path, acquisition


def sources(**changes: Any) -> tuple[AcquiredSource, ...]:
    return (
        acquired_source("can", "can", "0001_can.blf", **changes),
        acquired_source("imu", "serial", "0001_imu.bin"),
    )


def ingest(files: list[Path], out: Path, **options: Any) -> Ingested:
    return ingest_files(load_rig("mixed"), files, out=out, on=ON, **options)


def live(mixed_shot: TwinShot, acquisition: Path) -> list[Path]:
    """Put the record between the files: its place says nothing."""
    return [mixed_shot.files[0], acquisition, *mixed_shot.files[1:]]


def test_the_acquisition_goes_into_the_shot_and_names_it(mixed_shot: TwinShot, tmp_path: Path) -> None:
    path, acquisition = record(tmp_path)
    ingested = ingest(live(mixed_shot, path), tmp_path / "shots")
    assert ingested.path.name == "live-3.h5"
    shot = read_shot(ingested.path)
    assert shot.acquisition == acquisition
    assert (shot.started, shot.started_source) == (acquisition.trigger_utc, "host clock at the trigger")
    assert shot.usable, shot.reasons
    last = shot.inputs[-1]
    assert (last.name, last.source, last.reader, last.size) == ("a.json", "", "acquisition", path.stat().st_size)
    assert last.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    assert [i.source for i in shot.inputs[:-1]] == ["dewetron", "can", "imu", "camera"]


def test_the_fits_of_the_clocks_go_into_the_shot_and_its_verdict(mixed_shot: TwinShot, tmp_path: Path) -> None:
    shot = read_shot(ingest(list(mixed_shot.files), tmp_path).path)
    assert shot.acquisition is None
    assert list(shot.clock_fits) == ["imu"]
    truth, fitted = mixed_shot.truth["sources"]["imu"], shot.clock_fits["imu"]
    drift = (1 + truth["clock"]["drift"]) / (1 + truth["host_clock"]["drift"]) - 1
    assert abs(fitted["drift"] - drift) < 5 * fitted["u_drift"] < 1e-4
    assert not [c for c in shot.quality if c.check == "file names"]
    (fit,) = [c for c in shot.quality if c.check == "clock fit"]
    assert (fit.channel, fit.verdict) == ("imu", "ok")
    assert shot_summary(tmp_path / "0001_dewetron.h5")["clock_fits"]["imu"] == dict(shot.clock_fits["imu"])


def test_a_given_name_goes_before_that_of_the_acquisition(mixed_shot: TwinShot, tmp_path: Path) -> None:
    path, _ = record(tmp_path)
    assert ingest(live(mixed_shot, path), tmp_path, shot="mine").path.name == "mine.h5"


def test_what_the_acquisition_lost_is_part_of_the_verdict(mixed_shot: TwinShot, tmp_path: Path) -> None:
    path, _ = record(tmp_path, lost_records=2, recovered=True, sources=sources(error_frames=5))
    shot = ingest(live(mixed_shot, path), tmp_path).shot
    assert not shot.usable
    assert [c.verdict for c in shot.quality if c.check == "error frames"] == ["warn"]
    assert any("2 records of the journal" in reason for reason in shot.reasons)


def test_two_acquisitions_are_refused(mixed_shot: TwinShot, tmp_path: Path) -> None:
    one, _ = record(tmp_path)
    other, _ = record(tmp_path, "b.json")
    with pytest.raises(ReadError, match=r"more than one record of an acquisition.*found a\.json, b\.json"):
        ingest([*mixed_shot.files, one, other], tmp_path / "shots")
    assert not (tmp_path / "shots").exists()


def test_an_acquisition_of_another_rig_is_refused(mixed_shot: TwinShot, tmp_path: Path) -> None:
    path, _ = record(tmp_path, rig="field-2013")
    with pytest.raises(ReadError, match=r"another rig; expected 'mixed', found 'field-2013'") as caught:
        ingest(live(mixed_shot, path), tmp_path / "shots")
    assert caught.value.path == path
    assert not (tmp_path / "shots").exists()


def test_a_damaged_acquisition_is_refused_with_what_to_do(mixed_shot: TwinShot, tmp_path: Path) -> None:
    path, acquisition = record(tmp_path)
    document = json.loads(path.read_text())
    document["pre_s"] = "long"
    path.write_text(json.dumps(document))
    with pytest.raises(CorruptFileError, match="pre_s must be of type float"):
        ingest(live(mixed_shot, path), tmp_path / "shots")
    assert acquisition.pre_s == 0.5
