"""Overviews of shots: what is drawn of a channel is what was recorded, and a file that was changed has a new one."""

from __future__ import annotations

import base64
import json
import re
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from recoil_acquisition.shot.shot import InputFile
from recoil_acquisition.store import read_shot
from recoil_daq.recording import overview
from recoil_daq.recording.overview import _pieces, refresh_overviews, write_filtered, write_overview
from recoil_identification.report.document.report_files import read_curves


def numbers(text: str) -> np.ndarray:
    return np.frombuffer(base64.b64decode(text), "<f4")


def script(path: Path) -> Any:
    """Return the document that a script file assigns."""
    found = re.fullmatch(
        r"\(window\.\w+ \?\?= Object\.create\(null\)\)\[(\".*?\")\] = (.*);\n", path.read_text("ascii")
    )
    assert found is not None
    return json.loads(found[2])


@pytest.fixture
def folder(stored: Path, tmp_path: Path) -> Path:
    shutil.copy(stored, tmp_path / "0001.h5")
    return tmp_path


def test_every_channel_is_there_with_its_extremes_and_the_digest_of_its_file(folder: Path) -> None:
    file = folder / "0001.h5"
    shot = read_shot(file)
    digest = write_overview(shot, file)
    told = script(folder / "overviews/0001/overview.js")
    assert told["sha256"] == digest == InputFile.of(file).sha256
    assert [one["name"] for one in told["channels"]] == list(shot.channels)
    for one in told["channels"]:
        samples, pieces = shot[one["name"]].samples, one["pieces"]
        low, high = numbers(pieces["low"]), numbers(pieces["high"] or pieces["low"])
        assert np.nanmin(low) == pytest.approx(np.nanmin(samples), rel=1e-6)
        assert np.nanmax(high) == pytest.approx(np.nanmax(samples), rel=1e-6)
        assert one["samples"] == len(samples)
        if one["fine"]:
            fine = script(folder / "overviews/0001" / one["fine"])
            assert fine["sha256"] == digest
            np.testing.assert_allclose(numbers(fine["pieces"]["low"]), samples, rtol=1e-6)
    onset_s = told["zero_s"]
    gauge = shot.by_role("breech_pressure")
    assert gauge is not None
    assert abs(onset_s - gauge.time_base.times_s[np.nanargmax(gauge.samples)]) < 0.02
    index = (folder / "overviews/index.js").read_text("ascii")
    assert json.loads(index.removeprefix("window.shots = ").rstrip(";\n")) == [
        {"shot": "0001", "sha256": digest, "filtered": False}
    ]


@pytest.mark.parametrize("count", [1, 2, 63, 64, 65, 1000, 12345])
def test_each_piece_holds_the_lowest_and_the_highest_of_its_samples(count: int) -> None:
    random = np.random.default_rng(count)
    times_s = 5.0 + np.cumsum(random.uniform(0.5, 1.5, count)) * 1e-3
    samples = random.normal(size=count)
    samples[random.random(count) < 0.1] = np.nan
    pieces = _pieces(times_s, samples, 32)
    low, high = numbers(pieces["low"]), numbers(pieces["high"] or pieces["low"])
    if count <= 64:
        np.testing.assert_array_equal(low, samples.astype("<f4"))
        even = pieces["step_s"] * np.arange(count)
        times = even if pieces["times"] is None else numbers(pieces["times"])
        np.testing.assert_allclose(times, times_s - times_s[0], atol=1e-6)
        return
    edges_s = pieces["first_s"] + pieces["step_s"] * (np.arange(33) - 0.5)
    edges_s[-1] = np.inf
    for k in range(32):
        inside = samples[(times_s >= edges_s[k] - 1e-12) & (times_s < edges_s[k + 1] - 1e-12)]
        inside = inside[np.isfinite(inside)]
        if inside.size == 0:
            assert np.isnan(low[k])
        else:
            assert (low[k], high[k]) == (np.float32(inside.min()), np.float32(inside.max()))


def test_even_samples_need_no_times_and_lost_pieces_stay_lost() -> None:
    times_s, samples = np.arange(10_000) * 2e-5, np.ones(10_000)
    samples[4000:6000] = np.nan
    pieces = _pieces(times_s, samples, 100)
    assert pieces["times"] is None
    low = numbers(pieces["low"])
    assert np.isnan(low[41:59]).all()
    assert (low[:39] == 1.0).all()


def test_an_overview_is_made_where_it_is_missing_or_of_another_file(folder: Path, monkeypatch) -> None:
    assert refresh_overviews(folder) == []
    first = (folder / "overviews/0001/overview.js").read_bytes()
    made: list[str] = []
    monkeypatch.setattr(overview, "write_overview", lambda shot, file: made.append(f"{shot.name} {file.name}"))
    refresh_overviews(folder)
    assert made == []
    (folder / "0001.h5").touch()
    refresh_overviews(folder)
    assert made == [], "its bytes are the same"
    head = first.replace(b'"sha256":"', b'"sha256":"0', 1)[: len(first)]
    (folder / "overviews/0001/overview.js").write_bytes(re.sub(rb'"sha256":"0(.{63}).', rb'"sha256":"0\1', head))
    refresh_overviews(folder)
    assert made == ["0001 0001.h5"]


def test_a_damaged_shot_file_costs_its_own_curves_and_is_named(folder: Path) -> None:
    (folder / "0002.h5").write_bytes(b"no shot")
    (folder / ".0003.0123abcd.partial.h5").write_bytes(b"is being written")
    (problem,) = refresh_overviews(folder)
    assert problem.startswith("no curves of 0002.h5: ")
    assert (folder / "overviews/0001/overview.js").is_file()


def test_what_is_left_of_a_shot_that_is_gone_goes_and_nothing_else(folder: Path) -> None:
    refresh_overviews(folder)
    shutil.copytree(folder / "overviews/0001", folder / "overviews/0009")
    (folder / "overviews/mine").mkdir()
    (folder / "overviews/mine/notes.txt").write_text("keep", encoding="utf-8")
    refresh_overviews(folder)
    assert sorted(path.name for path in (folder / "overviews").iterdir()) == ["0001", "index.js", "mine"]


def test_a_shot_that_comes_meanwhile_keeps_its_overview(folder: Path, monkeypatch) -> None:
    write = overview.write_overview

    def meanwhile(shot, file: Path) -> str:
        write(shot, Path(shutil.copy(file, folder / "0002.h5")))  # by the session's own process
        return write(shot, file)

    monkeypatch.setattr(overview, "write_overview", meanwhile)
    refresh_overviews(folder)
    assert (folder / "overviews/0002/overview.js").is_file()
    assert '"0002"' in (folder / "overviews/index.js").read_text("ascii")


def test_the_curves_of_a_report_stand_beside_the_overview(folder: Path, identified: Any) -> None:
    found = read_curves(identified.reports / "0001")
    assert found is not None
    write_filtered(folder, "0001", identified.report["interval_s"][0], found.times_s, found.values)
    refresh_overviews(folder)
    told = script(folder / "overviews/0001/filtered.js")
    assert told["zero_s"] == identified.report["interval_s"][0]
    curves = {name: numbers(text) for name, text in told["curves"].items()}
    peak = identified.report["peaks"]["breech_pressure_pa"]
    assert np.nanmax(curves["breech_pressure_pa"]) == pytest.approx(peak, rel=0.1)
    assert curves["time_s"][0] < 0 < curves["time_s"][-1]
    assert '"filtered": true' in (folder / "overviews/index.js").read_text("ascii")


def test_a_clock_that_is_not_aligned_is_said_not_to_be(folder: Path) -> None:
    shot = read_shot(folder / "0001.h5")
    write_overview(replace(shot, alignments=()), folder / "0001.h5")
    told = script(folder / "overviews/0001/overview.js")
    other = [one for one in told["channels"] if shot[one["name"]].time_base.clock != shot.reference_clock]
    assert other
    assert not any(one["aligned"] for one in other)


@pytest.mark.parametrize("units", [[], ["bar"]])
def test_it_says_in_which_units_the_rig_wants_to_be_read(folder: Path, units: list[str]) -> None:
    shot, file = read_shot(folder / "0001.h5"), folder / "0001.h5"
    assert "[report]" not in shot.rig_text
    write_overview(replace(shot, rig_text=f"{shot.rig_text}\n[report]\nunits = {json.dumps(units)}\n"), file)
    told = script(folder / "overviews/0001/overview.js")
    assert [(one["unit"], one["si_per_unit"]) for one in told["units"]] == [(unit, 1e5) for unit in units]
    write_overview(replace(shot, rig_text="no rig"), file)
    assert script(folder / "overviews/0001/overview.js")["units"] == []
