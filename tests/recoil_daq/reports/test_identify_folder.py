"""Several shots of one rig: one cut-off for all of them, and a word on whether they repeat."""

from __future__ import annotations

import json
import shutil
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import pytest

from recoil_acquisition.errors import IdentificationError, StoreError
from recoil_acquisition.store import read_shot, write_shot
from recoil_daq.reports.identify_folder import identify_folder, identify_shots, repeatability, shared_options
from recoil_daq.reports.output import Output
from recoil_identification.shot.identified import Options
from tests.builders.campaigns import ring_campaign
from tests.builders.other_firings import fired_again


@pytest.fixture(scope="module")
def shots(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Two bare shots of one rig."""
    folder = tmp_path_factory.mktemp("campaign")
    return [Path(shutil.copy(ring_campaign().fired.files[at], folder)) for at in (0, 2)]


def test_shots_of_one_rig_are_given_one_cutoff(shots: list[Path]) -> None:
    named: list[str] = []
    shared = shared_options(shots, Options(compare=True), progress=named.append)
    assert [one.split(", ")[:2] for one in named] == [[f"{k} of 2 done", path.name] for k, path in enumerate(shots)]
    choices = [shared[path].campaign for path in shots]
    assert choices[0] is not None
    assert choices[0].cutoff_hz is not None
    assert all(choice is choices[0] for choice in choices)
    assert all(options.compare for options in shared.values())


def test_one_shot_or_a_cutoff_that_is_asked_for_share_nothing(shots: list[Path]) -> None:
    assert shared_options(shots[:1], Options()) == {shots[0]: Options()}
    assert shared_options(shots, Options(cutoff_hz=500.0)) == dict.fromkeys(shots, Options(cutoff_hz=500.0))


@pytest.mark.whole_way
def test_identify_takes_one_cutoff_for_all_shots_and_says_whether_they_repeat(run, shots: list[Path], tmp_path) -> None:
    third = tmp_path / "0005.h5"
    write_shot(replace(read_shot(shots[1]), name="0005"), third)
    result = run("identify", *shots, third, "--out", tmp_path, "--overwrite", "--json")
    document = json.loads(result.stdout)
    filters = [report["filter"] for report in document["reports"]]
    assert len({f["cutoff_hz"] for f in filters}) == 1
    assert {f["basis"] for f in filters} == {"campaign"}
    (repeats,) = document["repeatability"]
    assert repeats["rig"] == "field-2013"
    assert repeats["verdict"] == "ok"
    assert "over 3 shots" in repeats["detail"]


def test_a_shot_whose_peak_is_off_is_named() -> None:
    documents = [
        {"rig": "r", "shot": name, "peak_acceleration": {"recorded_m_s2": raw, "filtered_m_s2": peak}}
        for name, raw, peak in (
            ("1", 2500.0, 1000.0),
            ("2", 2900.0, 1010.0),
            ("3", 2700.0, 990.0),
            ("4", 2800.0, 1300.0),
        )
    ]
    verdict, detail = repeatability(documents)["r"]
    assert verdict == "warn"
    assert "shot 4" in detail
    assert repeatability(documents[:1]) == {}


@pytest.mark.whole_way
def test_reports_are_the_same_bytes_whoever_makes_them(shots: list[Path], tmp_path: Path) -> None:
    folder = shots[0].parent
    one = identify_folder(folder, out=tmp_path / "1", workers=1)
    two = identify_folder(folder, out=tmp_path / "2", workers=2)
    assert [report.shot for report in two] == [path.stem for path in shots]
    assert [report.document for report in two] == [report.document for report in one]
    for report in one:
        for file in ("report.json", "report.html", "mass.csv"):
            assert (report.folder / file).read_bytes() == (tmp_path / "2" / report.shot / file).read_bytes()
    assert two[0].folder == tmp_path / "2" / shots[0].stem
    # another executor may do work again: what is there already is refused before the first of it
    with ThreadPoolExecutor(1) as threads, pytest.raises(StoreError, match="exists already"):
        identify_folder(folder, out=tmp_path / "2", executor=threads)


@pytest.mark.whole_way
def test_two_files_of_one_shot_are_not_one_report(shots: list[Path], tmp_path: Path) -> None:
    again = tmp_path / "again.h5"
    again.write_bytes(shots[0].read_bytes())
    options = dict.fromkeys((shots[0], again), Options())
    with pytest.raises(StoreError, match=r"again\.h5: this file and .*0001\.h5 are both of a shot"):
        list(identify_shots(options, Output(tmp_path / "out", overwrite=True)))


def fired(name: str, peak: float, *, valid: bool = True, rig: str = "r", **row: object) -> dict[str, object]:
    peaks = {"recorded_m_s2": 2.5 * peak, "filtered_m_s2": peak}
    return {"rig": rig, "shot": name, "valid": valid, "shot_log": row, "peak_acceleration": peaks}


def test_shots_are_compared_with_those_of_their_own_mass_and_charge() -> None:
    heavy = [fired(name, peak, added_mass_kg=120.0) for name, peak in (("2", 870.0), ("4", 872.0), ("6", 869.0))]
    bare = [fired(name, peak, added_mass_kg=None) for name, peak in (("1", 1000.0), ("3", 1004.0), ("5", 997.0))]
    small = [fired(name, peak, charge="B") for name, peak in (("7", 700.0), ("8", 702.0))]
    long = [fired("9", 500.0, configuration="long rod")]
    found = repeatability([*heavy, *bare, *small, *long])
    assert set(found) == {"r, 120 kg added", "r, nothing added", "r, nothing added, charge B"}
    assert {verdict for verdict, _ in found.values()} == {"ok"}
    together = repeatability([{**one, "shot_log": None} for one in (*heavy, *bare)])
    assert together["r"][0] == "warn"


def test_shots_that_are_not_valid_or_excluded_are_not_compared() -> None:
    sound = [fired(name, peak) for name, peak in (("1", 1000.0), ("2", 1004.0), ("3", 997.0))]
    off = [fired("4", 1500.0, valid=False), fired("5", 400.0, exclude="misfire")]
    verdict, detail = repeatability([*sound, *off])["r"]
    assert verdict == "ok"
    assert "over 3 shots" in detail


@pytest.fixture(scope="module")
def with_one_too_short(shots: list[Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of two shots, and between them one whose record ends before the pulse."""
    folder = tmp_path_factory.mktemp("short")
    for path in shots:
        shutil.copy(path, folder)
    shot = read_shot(shots[0])
    channels = {}
    for name, channel in shot.channels.items():
        count = int(channel.time_base.count * 0.05)
        channels[name] = replace(
            channel, samples=channel.samples[:count], time_base=channel.time_base.part(0, count), raw=None
        )
    write_shot(fired_again(replace(shot, channels=channels), "0002"), folder / "0002.h5")
    return folder


@pytest.mark.whole_way
def test_a_shot_without_a_mass_does_not_keep_the_others_from_theirs(run, with_one_too_short: Path, tmp_path) -> None:
    result = run("identify", with_one_too_short, "--out", tmp_path, "--json")
    assert result.exit_code == 3
    document = json.loads(result.stdout)
    assert [report["shot"] for report in document["reports"]] == ["0001", "0003"]
    (failed,) = document["failed"]
    assert failed["file"].endswith("0002.h5")
    assert failed["error"].startswith(failed["file"])
    assert result.stderr.splitlines() == [f"error: {failed['error']}"]
    with pytest.raises(IdentificationError, match=r"0002\.h5: "):
        identify_folder(with_one_too_short, out=tmp_path, overwrite=True)
    assert {folder.name for folder in tmp_path.iterdir() if folder.is_dir()} == {"0001", "0003"}
