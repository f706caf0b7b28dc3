"""The record of a live acquisition goes into the shot with the files that it is of."""

from __future__ import annotations

import datetime as dt
import hashlib
from pathlib import Path
from typing import Any

import pytest

from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.log.capture import read_capture
from recoil_acquisition.readers.captured import sources_of
from recoil_acquisition.shot.acquisition import AcquiredSource, Acquisition
from recoil_acquisition.store import read_shot, shot_summary
from recoil_daq.recording.ingest import Ingested, ingest_files
from recoil_rigs.rig import load_rig
from recoil_rigs.twin import TwinShot, simulate_shot
from tests.builders import rdlog_bytes
from tests.builders.live_logs import declared
from tests.builders.shots import acquired_source, make_acquisition
from tests.builders.virtual_shots import SHORTER, with_twin

ON = dt.date(2026, 6, 1)


def record(mixed_shot: TwinShot, folder: Path, name: str = "0001.rdlog", **changes: Any) -> tuple[Path, Acquisition]:
    """Return the sensor's capture with the record of an acquisition in it."""
    acquisition = make_acquisition(**{"shot": "live-3", "rig": "mixed", "sources": sources()} | changes)
    path = folder / name
    path.write_bytes(declared(imu_of(mixed_shot).read_bytes(), acquisition.to_json()))
    return path, acquisition


def imu_of(mixed_shot: TwinShot) -> Path:
    return next(path for path in mixed_shot.files if path.suffix == ".rdlog")


def host_times_s(path: Path) -> list[float]:
    (imu,) = sources_of(read_capture(path))
    return [record.host_ns / 1e9 for record in imu.records]


def sources(**changes: Any) -> tuple[AcquiredSource, ...]:
    return (
        acquired_source("can", "can", "0001_can.blf", **changes),
        acquired_source("imu", "serial", "0001.rdlog"),
    )


def ingest(files: list[Path], out: Path, **options: Any) -> Ingested:
    return ingest_files(load_rig("mixed"), files, out=out, on=ON, **options)


def live(mixed_shot: TwinShot, capture: Path) -> list[Path]:
    """Put the capture in the place of the sensor's own file."""
    return [capture if path == imu_of(mixed_shot) else path for path in mixed_shot.files]


@pytest.mark.whole_way
def test_the_acquisition_goes_into_the_shot_and_names_it(mixed_shot: TwinShot, tmp_path: Path) -> None:
    path, acquisition = record(mixed_shot, tmp_path)
    ingested = ingest(live(mixed_shot, path), tmp_path / "shots")
    assert ingested.path.name == "live-3.h5"
    shot = read_shot(ingested.path)
    assert shot.acquisition == acquisition
    assert (shot.started, shot.started_source) == (acquisition.trigger_utc, "host clock at the trigger")
    assert shot.usable, shot.reasons
    (imu,) = (one for one in shot.inputs if one.source == "imu")
    assert (imu.name, imu.reader, imu.size) == ("0001.rdlog", "recoil-daq capture", path.stat().st_size)
    assert imu.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    assert sorted(i.source for i in shot.inputs) == ["camera", "can", "dewetron", "imu"]


@pytest.mark.whole_way
def test_the_fits_of_the_clocks_go_into_the_shot_and_its_verdict(tmp_path: Path) -> None:
    # clocks so far apart that a fit which finds nothing is seen
    rig = with_twin("mixed", **SHORTER, clock_drift=1e-3)
    fired = simulate_shot(rig, tmp_path / "simulated", seed=1, shot="0001")
    shot = read_shot(ingest(list(fired.files), tmp_path).path)
    assert shot.acquisition is None
    assert list(shot.clock_fits) == ["imu"]
    truth, fitted = fired.truth["sources"]["imu"], shot.clock_fits["imu"]
    drift = (1 + truth["clock"]["drift"]) / (1 + truth["host_clock"]["drift"]) - 1
    assert abs(fitted["drift"] - drift) < 5 * fitted["u_drift"] < 0.5 * abs(drift)
    assert not [c for c in shot.quality if c.check == "file names"]
    (fit,) = [c for c in shot.quality if c.check == "clock fit"]
    assert (fit.channel, fit.verdict) == ("imu", "ok")
    assert shot_summary(tmp_path / "0001.h5")["clock_fits"]["imu"] == dict(shot.clock_fits["imu"])


@pytest.mark.whole_way
def test_a_source_of_which_all_was_taken_before_the_window_has_nothing_of_the_shot(
    mixed_shot: TwinShot, tmp_path: Path
) -> None:
    behind_s = host_times_s(imu_of(mixed_shot))[-1] + 1.2
    path, _ = record(mixed_shot, tmp_path, trigger_ns=round(1e9 * behind_s), sources=sources(late=True, late_s=1.5))
    shot = ingest(live(mixed_shot, path), tmp_path).shot
    assert not shot.usable
    assert "imu" not in {channel.time_base.clock for channel in shot.channels.values()}
    (reason,) = (one for one in shot.reasons if one.startswith("imu: "))
    assert "all that source imu delivered was taken outside the shot's window" in reason


@pytest.mark.whole_way
def test_a_given_name_goes_before_that_of_the_acquisition(mixed_shot: TwinShot, tmp_path: Path) -> None:
    path, _ = record(mixed_shot, tmp_path)
    assert ingest(live(mixed_shot, path), tmp_path, shot="mine").path.name == "mine.h5"


@pytest.mark.whole_way
def test_what_the_acquisition_lost_is_part_of_the_verdict(mixed_shot: TwinShot, tmp_path: Path) -> None:
    path, _ = record(mixed_shot, tmp_path, lost_records=2, recovered=True, sources=sources(error_frames=5))
    shot = ingest(live(mixed_shot, path), tmp_path).shot
    assert not shot.usable
    assert [c.verdict for c in shot.quality if c.check == "error frames"] == ["warn"]
    assert any("2 records of the journal" in reason for reason in shot.reasons)


def test_two_acquisitions_are_refused(mixed_shot: TwinShot, tmp_path: Path) -> None:
    one, _ = record(mixed_shot, tmp_path)
    other, _ = record(mixed_shot, tmp_path, "0002.rdlog")
    with pytest.raises(ReadError, match="source 'imu' already has"):
        ingest([*live(mixed_shot, one), other], tmp_path / "shots")
    assert not (tmp_path / "shots").exists()


def test_an_acquisition_of_another_rig_is_refused(mixed_shot: TwinShot, tmp_path: Path) -> None:
    path, _ = record(mixed_shot, tmp_path, rig="field-2013")
    with pytest.raises(ReadError, match=r"another rig; expected 'mixed', found 'field-2013'") as caught:
        ingest(live(mixed_shot, path), tmp_path / "shots")
    assert caught.value.path == path
    assert not (tmp_path / "shots").exists()


def test_a_damaged_acquisition_is_refused_with_what_to_do(mixed_shot: TwinShot, tmp_path: Path) -> None:
    path, acquisition = record(mixed_shot, tmp_path)
    document = acquisition.to_json() | {"pre_s": "long"}
    path.write_bytes(declared(imu_of(mixed_shot).read_bytes(), document))
    with pytest.raises(CorruptFileError, match="pre_s must be a finite number"):
        ingest(live(mixed_shot, path), tmp_path / "shots")


def test_a_capture_of_no_source_of_the_rig_is_refused(mixed_shot: TwinShot, tmp_path: Path) -> None:
    path = tmp_path / "other.rdlog"
    session = {"sources": [{"name": "other", "kind": "serial"}]}
    path.write_bytes(rdlog_bytes.rdlog(session, [(0, rdlog_bytes.SERIAL, 1, b"x")]))
    with pytest.raises(ReadError, match=r"holds no source of rig 'mixed'.*found other \(serial\)"):
        ingest([*mixed_shot.files, path], tmp_path / "shots")
