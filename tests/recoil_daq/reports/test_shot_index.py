"""The index of shots: a row a shot or report, each leading to its page, whatever else stands in the folders."""

from __future__ import annotations

import csv
import json
import os
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import openpyxl
import pytest
from typer.testing import Result

from recoil_acquisition.errors import ReadError, StoreError
from recoil_acquisition.packages.extras import Extra
from recoil_daq.reports import shot_index
from recoil_daq.reports.shot_index import index_shots
from recoil_identification.report.document import spreadsheet
from recoil_identification.report.document.report_files import json_bytes, sealed
from recoil_identification.report.results.shot_index import INDEX
from tests.builders.page_elements import PageElements
from tests.recoil_daq.conftest import Identified

Run = Callable[..., Result]


@pytest.fixture
def day(stored: Path, identified: Identified, tmp_path: Path) -> Path:
    """A folder with one shot file, its log and its report."""
    (tmp_path / "shots").mkdir()
    shutil.copy(stored, tmp_path / "shots" / "0001.h5")
    shutil.copytree(identified.reports / "0001", tmp_path / "reports" / "0001")
    return tmp_path


def like(day: Path, name: str, **changes: Any) -> Path:
    """Write a report like that of the shot, sealed."""
    document = json.loads((day / "reports" / "0001" / "report.json").read_text("utf-8"))
    folder = day / "reports" / name
    folder.mkdir()
    (folder / "report.html").write_text("<title>a page</title>", encoding="utf-8")
    (folder / "report.json").write_bytes(json_bytes(sealed({**document, "shot": name, **changes})))
    return folder / "report.json"


def rows_of(folder: Path) -> list[dict[str, str]]:
    with (folder / "index.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


@pytest.mark.whole_way
def test_an_index_has_the_digits_of_the_report_and_leads_to_its_page(day: Path, identified: Identified) -> None:
    done = index_shots([day], out=day / "index", xlsx=True)
    (row,) = rows_of(done.folder)
    report = identified.report
    assert float(row["mass_kg"]) == report["mass"]["value"]
    assert float(row["u_kg"]) == report["mass"]["u"]
    assert [float(row["U95_low_kg"]), float(row["U95_high_kg"])] == report["mass"]["U95"]
    assert float(row["E_n"]) == report["E_n"]
    assert float(row["recoil_travel_m"]) == report["peaks"]["recoil_travel_m"]
    assert row["valid"] == "true"
    assert int(row["warnings"]) == sum(one["verdict"] == "warn" for one in report["quality"])
    assert row["file"] == str(day / "shots" / "0001.h5")
    assert (done.folder / row["report"]).resolve() == (day / "reports" / "0001" / "report.html").resolve()
    page = done.page.read_text("utf-8")
    assert f'href="./{row["report"]}"' in page
    assert "<script src" not in page
    sheet = openpyxl.load_workbook(done.folder / "index.xlsx")["shots"]
    told = dict(zip(*sheet.iter_rows(values_only=True), strict=True))
    assert told["mass_kg"] == report["mass"]["value"]
    assert done.shots["mass_kg"].tolist() == [report["mass"]["value"]]


@pytest.mark.whole_way
def test_a_shot_without_a_report_has_the_verdict_of_its_file(day: Path) -> None:
    shutil.rmtree(day / "reports")
    (row,) = index_shots([day / "shots"], out=day / "index").document["shots"]
    assert (row["state"], row["valid"], row["report"], row["mass_kg"]) == ("usable", None, None, None)


@pytest.mark.whole_way
def test_reports_that_lie_beside_the_shots_are_found_and_those_of_other_shots_are_not(day: Path) -> None:
    like(
        day,
        "0009",
        provenance={
            **json.loads((day / "reports" / "0001" / "report.json").read_text("utf-8"))["provenance"],
            "inputs": [{"file": "0009.h5", "sha256": "9" * 64}],
        },
    )
    (row,) = index_shots([day / "shots"], out=day / "index").document["shots"]
    assert row["valid"] is True
    assert (day / "index" / row["report"]).resolve() == (day / "reports" / "0001" / "report.html").resolve()


@pytest.mark.whole_way
def test_peaks_are_in_the_units_that_all_reports_chose(day: Path) -> None:
    first = json.loads((day / "reports" / "0001" / "report.json").read_text("utf-8"))
    issued = {**(first.get("issued") or {}), "units": ["bar"]}
    in_bar = [like(day, name, issued=issued) for name in ("0002", "0003")]
    page = index_shots(in_bar, out=day / "index").page
    assert "/&nbsp;bar" in page.read_text("utf-8")
    page = index_shots([*in_bar, day / "reports" / "0001" / "report.json"], out=day / "all").page
    assert "/&nbsp;bar" not in page.read_text("utf-8")


@pytest.mark.whole_way
def test_what_the_log_says_now_goes_before_what_it_said(run: Run, day: Path) -> None:
    run("log", day / "shots" / "0001.h5", "configuration=ring", "charge=2", "added_mass_kg=120", "exclude=misfire")
    (row,) = index_shots([day], out=day / "index").document["shots"]
    assert (row["configuration"], row["charge"], row["added_mass_kg"]) == ("ring", "2", 120.0)
    assert row["exclude"] == "misfire"
    assert "another added mass" in row["reason"]


def test_a_report_that_was_changed_or_is_of_another_shot_file_is_told(day: Path) -> None:
    path = day / "reports" / "0001" / "report.json"
    document = json.loads(path.read_text("utf-8"))
    path.write_bytes(json_bytes({**document, "E_n": 0.0}))
    (row,) = index_shots([day], out=day / "index").document["shots"]
    assert row["valid"] is False
    assert "changed after it was written" in row["reason"]
    provenance = document["provenance"]
    provenance["inputs"][0]["sha256"] = "0" * 64
    path.write_bytes(json_bytes(sealed({**document, "provenance": provenance})))
    reported, stored = index_shots([day], out=day / "index", overwrite=True).document["shots"]
    assert "another shot file" in reported["reason"]
    assert stored["valid"] is None


@pytest.mark.parametrize(
    "changes",
    [
        {"mass": {"value": "heavy", "u": 1.0, "U95": [1.0, 2.0], "specification": 1.0}},
        {"mass": []}, {"quality": [3]}, {"peaks": {"impulse_n_s": "much"}}, {"rpe_percent": 3}, {"shot_log": "x"},
        {"mass": {"value": 1.7e308, "u": 1e308, "U95": [-1e308, 1e308], "specification": 1.0}},
    ],
)  # fmt: skip
def test_a_hostile_report_is_told_in_one_line_and_the_rest_is_listed(
    run: Run, day: Path, changes: dict[str, Any]
) -> None:
    hostile = like(day, "0002", **changes)
    done = run("index", day, "--out", day / "index")
    assert done.exit_code in (0, 3)
    assert [row["shot"] for row in rows_of(day / "index")][:1] == ["0001"]
    if done.exit_code == 3:
        (line,) = done.stderr.splitlines()
        assert line.startswith("error: ")
        assert str(hostile) in line
        assert len(rows_of(day / "index")) == 1


@pytest.mark.parametrize("content", [b"", b"{", b"[" * 100_000, b'{"schema": "recoil-daq/report/1"}', b"\xff"])
def test_what_is_no_report_is_told_and_the_rest_is_listed(run: Run, day: Path, content: bytes) -> None:
    (day / "reports" / "0002").mkdir()
    (day / "reports" / "0002" / "report.json").write_bytes(content)
    (day / "shots" / "0003.h5").write_bytes(b"nothing")
    done = run("index", day, "--out", day / "index", "--json")
    assert done.exit_code == 3
    document = json.loads(done.stdout)
    assert [row["shot"] for row in document["shots"]] == ["0001"]
    assert {Path(one["file"]).name for one in document["failed"]} == {"report.json", "0003.h5"}
    assert len(done.stderr.splitlines()) == 2


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes with a name on this system")
def test_a_pipe_does_not_hold_it_up(run: Run, day: Path) -> None:
    os.mkfifo(day / "shots" / "0002.h5")
    assert run("index", day, "--out", day / "index").exit_code == 3


def test_texts_of_a_report_are_neither_formulas_nor_elements(day: Path) -> None:
    text = '=HYPERLINK("http://x")<script>alert(1)</script>'
    like(day, "0002", rig=text, valid=False, reasons=[text])
    done = index_shots([day], out=day / "index", xlsx=True)
    row = rows_of(done.folder)[-1]
    assert row["rig"] == row["reason"] == f"'{text}"
    sheet = openpyxl.load_workbook(done.folder / "index.xlsx")["shots"]
    assert all(cell.data_type != "f" for line in sheet.iter_rows() for cell in line)
    page = done.page.read_text("utf-8")
    assert "<script>alert" not in page
    assert text in PageElements(page).text


def test_shots_stand_in_the_order_of_firing_or_of_their_numbers(day: Path) -> None:
    like(day, "10", started=None)
    like(day, "9", started=None)
    rows = index_shots([day / "reports"], out=day / "index").document["shots"]
    assert [row["shot"] for row in rows] == ["0001", "9", "10"]
    like(day, "8", started="1999-01-01T00:00:00")
    like(day, "7", started="2001-01-01T00:00:00")
    for name in ("0001", "9", "10"):
        shutil.rmtree(day / "reports" / name)
    rows = index_shots([day / "reports"], out=day / "index", overwrite=True).document["shots"]
    assert [row["shot"] for row in rows] == ["8", "7"]


def test_nothing_is_overwritten_unasked_and_no_shot_is_an_error(
    day: Path, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    index_shots([day], out=day / "index", xlsx=True)
    with pytest.raises(StoreError, match="exists already"):
        index_shots([day], out=day / "index")
    index_shots([day], out=day / "index", overwrite=True)
    assert not (day / "index" / "index.xlsx").exists()  # it would tell of the index before
    empty = tmp_path_factory.mktemp("empty")
    monkeypatch.chdir(empty)
    with pytest.raises(ReadError, match="neither shot files nor reports"):
        index_shots([empty])
    with pytest.raises(ReadError, match="no folder shots or reports"):
        index_shots()
    assert list(empty.iterdir()) == []


def test_without_places_the_usual_folders_are_listed(day: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(day)
    (row,) = index_shots().document["shots"]
    assert (row["report"], row["file"]) == ("../reports/0001/report.html", str(Path("shots", "0001.h5")))


def test_a_workbook_names_what_it_needs_before_any_work(day: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(spreadsheet, "XLSX", Extra("xlsx", "no_such_module", "openpyxl>=3.1"))
    monkeypatch.setattr(shot_index, "read_document", None)
    with pytest.raises(StoreError, match="openpyxl"):
        index_shots([day], out=day / "index", xlsx=True)


def test_a_mass_that_deviates_is_called_so_on_the_page_as_by_identify(run: Run, day: Path) -> None:
    like(day, "0002", E_n=-1.07)
    like(day, "0003", E_n=2.0, valid=False, reasons=["a reason"])
    done = run("index", day, "--out", day / "index")
    words = {one["shot"]: one["verdict"] for one in INDEX.worded(index_shots([day], out=day / "other").document)}
    assert words == {"0001": "valid", "0002": "valid, deviates", "0003": "not valid"}
    assert done.stdout.count("VALID, deviates") == 1
    assert "2 valid, 1 not valid, 0 without a report" in " ".join(done.stdout.split())


def test_the_page_has_colours_a_sum_the_scatter_of_bare_masses_and_ways_to_the_pages_beside(day: Path) -> None:
    (day / "shots" / "live.html").write_text("x", encoding="utf-8")
    (day / "campaign").mkdir()
    (day / "campaign" / "campaign.html").write_text("x", encoding="utf-8")
    mass = json.loads((day / "reports" / "0001" / "report.json").read_text())["mass"]
    for name, added, valid in (("0002", 121.0, False), ("0003", 122.0, True)):
        log = {"shot": name, "added_mass_kg": 120.0}
        like(day, name, mass={**mass, "value": mass["value"] + added}, shot_log=log, valid=valid)
    page = index_shots([day / "shots", day / "reports"], out=day / "index").page.read_text(encoding="utf-8")
    assert '<span class="chip ok">valid</span>' in page
    assert '<span class="chip fail">not valid</span>' in page
    assert '<a href="./../campaign/campaign.html">Campaign</a>' in page
    assert '<a href="./../shots/live.html">Live page</a>' in page
    assert "3 shots" in page
    page = index_shots([day / "reports"], out=day / "reported").page.read_text(encoding="utf-8")
    assert "Less added" in page
    assert (
        f"The 2 valid masses less what was added: mean {mass['value'] + 1.0:.1f} kg, standard deviation 1.4 kg." in page
    )


def test_every_link_within_the_page_leads_somewhere(day: Path) -> None:
    page = index_shots([day], out=day / "index").page.read_text("utf-8")
    assert set(re.findall(r'href="#([^"]+)"', page)) <= set(re.findall(r'id="([^"]+)"', page))
    assert 'href="#glossary"' in page
