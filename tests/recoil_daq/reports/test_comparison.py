"""`identify --beside`: a report on one page with others."""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import recoil_daq
from recoil_acquisition.errors import ReadError, StoreError
from recoil_acquisition.processes.reader_process import READER
from recoil_daq import beside
from recoil_daq.reports.comparison import Others
from recoil_daq.reports.output import Output
from recoil_identification.report.document.report_files import sealed


@pytest.fixture
def two(identified: Any, tmp_path: Path) -> Path:
    """Folders ``one`` and ``other`` with the same report of shot 0001, to be changed."""
    for name in ("one", "other"):
        shutil.copytree(identified.reports / "0001", tmp_path / name / "0001")
    return tmp_path


def edited(folder: Path, **changes: Any) -> None:
    path = folder / "report.json"
    path.write_text(json.dumps(sealed({**json.loads(path.read_text("utf-8")), **changes})), encoding="utf-8")


def table_of(folder: Path, name: str, content: str) -> None:
    """Replace a table beside a report, as if it had been written with it."""
    (folder / name).write_text(content, encoding="utf-8")
    provenance = json.loads((folder / "report.json").read_text("utf-8"))["provenance"]
    digest = hashlib.sha256(content.encode()).hexdigest()
    outputs = [one | ({"sha256": digest} if one["file"] == name else {}) for one in provenance["outputs"]]
    edited(folder, provenance=provenance | {"outputs": outputs})


@pytest.mark.whole_way
def test_a_shot_with_another_window_is_laid_beside_its_report(
    identified: Any, stored: Path, tmp_path: Path, run: Callable[..., Any]
) -> None:
    words = ["identify", stored, "--out", tmp_path / "short", "--window-s", 0.01, "--beside", identified.reports]
    result = run(*words)
    assert result.exit_code == 0, result.output
    assert (
        "These reports are of one shot file, 0001: what differs between them is how it was evaluated." in result.output
    )
    assert "memory (window) / ms" in result.output
    page = tmp_path / "short" / "0001" / "beside.html"
    assert f"beside one another -> {page}" in result.output
    assert "Mass over time" in page.read_text("utf-8")
    assert {path.name for path in page.parent.iterdir()} == {
        "beside.html", "curves.csv", "mass.csv", "report.html", "report.json"
    }  # fmt: skip
    result = run(*words)
    assert result.exit_code == 3
    assert "the report exists already" in result.stderr
    result = run(*words, "--overwrite", "--json")
    assert result.exit_code == 0
    (found,) = json.loads(result.stdout)["beside"]
    assert found["page"] == str(page)
    assert run(*words[:4], "--overwrite").exit_code == 0
    assert not page.exists(), "it is of the report that was replaced"


def test_a_result_shows_itself(two: Path) -> None:
    edited(two / "other" / "0001", window_s=0.01)
    done = beside(two / "one" / "0001", [two / "other" / "0001" / "report.json"])
    assert isinstance(done, recoil_daq.Beside)
    assert repr(done) == f"Beside(2 reports -> {two / 'one' / '0001' / 'beside.html'})"
    assert "memory (window) / ms" in str(done)
    assert [one["name"] for one in done.document["reports"]] == ["one/0001", "other/0001"]
    assert done.document["reports"][1]["page"] == "../../other/0001/report.html"


@pytest.mark.whole_way
def test_a_page_that_is_there_is_not_replaced_unasked(two: Path) -> None:
    beside(two / "one" / "0001", [two / "other"])
    with pytest.raises(StoreError, match=r"exists already"):
        beside(two / "one" / "0001", [two / "other"])
    beside(two / "one" / "0001", [two / "other"], overwrite=True)


@pytest.mark.whole_way
def test_of_a_folder_of_reports_the_one_of_the_shot_is_taken(two: Path) -> None:
    shutil.copytree(two / "other" / "0001", two / "other" / "0002")
    edited(two / "other" / "0002", shot="0002")
    done = beside(two / "one" / "0001", [two / "other"])
    assert [one["shot"] for one in done.document["reports"]] == ["0001", "0001"]
    done = beside(two / "one" / "0001", [two / "other", two / "other" / "0002"], overwrite=True)
    assert [one["shot"] for one in done.document["reports"]] == ["0001", "0001", "0002"]
    assert done.document["of"].startswith("These reports are of different shots, 0001, 0002: ")
    edited(two / "one" / "0001", shot="0003")
    with pytest.raises(ReadError, match="no report of shot 0003 in this folder of reports"):
        beside(two / "one" / "0001", [two / "other"])


def test_of_a_folder_of_reports_no_more_is_read_than_it_takes(
    stored: Path, two: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copytree(two / "other" / "0001", two / "other" / "0002")
    edited(two / "other" / "0002", shot="0002")
    table_of(two / "other" / "0002", "mass.csv", "of no concern")
    table_of(two / "other" / "0002", "curves.csv", "of no concern")
    asked, ask = [], READER.ask
    monkeypatch.setattr(READER, "ask", lambda path, what, size: asked.append(what) or ask(path, what, size))
    Others.read([two / "other"]).refuse_before([stored], Output(two / "out"))
    assert asked == ["headers"]
    assert [one["shot"] for one in beside(two / "one" / "0001", [two / "other"]).document["reports"]] == 2 * ["0001"]
    with pytest.raises(ReadError, match="this is no mass over time"):
        beside(two / "one" / "0001", [two / "other" / "0002"], overwrite=True)


def test_what_cannot_be_laid_beside_is_said_before_any_shot_is_identified(
    identified: Any, stored: Path, two: Path, run: Callable[..., Any]
) -> None:
    out = two / "out"
    for other, words in (
        (two / "nowhere", "no such file or folder"),
        (two / "one" / "0001" / "mass.csv", "this is no report of a shot"),
    ):
        result = run("identify", stored, "--out", out, "--beside", other)
        assert result.exit_code == 3
        assert words in result.stderr
        assert result.stderr.count("\n") == 1
    result = run("identify", stored, "--out", identified.reports, "--overwrite", "--beside", identified.reports)
    assert result.exit_code == 3
    assert "this report is to be laid beside itself" in result.stderr
    table_of(two / "one" / "0001", "mass.csv", "time,mass\n1,2\n")
    result = run("identify", stored, "--out", out, "--beside", two / "one")
    assert result.exit_code == 3
    assert "this is no mass over time" in result.stderr
    assert run("identify", stored, "--out", out, "--beside", two, "--target", "arx").exit_code == 2
    assert not out.exists()


@pytest.mark.parametrize(
    "changes",
    [
        {"interval_s": None}, {"filter": "x"}, {"reasons": None}, {"window_s": "x"}, {"peaks": {"recoil_time_s": "x"}},
        {"rig": "\ud800"}, {"mass": {"value": "782"}}, {"mass": {"U95": [1, 2, 3]}},
    ],
    ids=str,
)  # fmt: skip
def test_a_report_that_holds_something_else_where_a_number_belongs_is_named(two: Path, changes: dict[str, Any]) -> None:
    edited(two / "other" / "0001", **changes)
    with pytest.raises(ReadError, match="this report cannot be laid beside others") as raised:
        beside(two / "one" / "0001", [two / "other"])
    assert raised.value.path == two / "other" / "0001" / "report.json"
    assert not (two / "one" / "0001" / "beside.html").exists()


def test_a_report_that_was_changed_is_laid_beside_none(two: Path) -> None:
    path = two / "other" / "0001" / "report.json"
    document = json.loads(path.read_text("utf-8"))
    path.write_text(json.dumps({**document, "window_s": 0.01}), encoding="utf-8")
    with pytest.raises(ReadError, match="this report was changed after it was written"):
        beside(two / "one" / "0001", [two / "other"])
    # of this version nothing is without a digest, of an earlier one it may be
    del document["provenance"]["digest"]
    path.write_text(json.dumps(document), encoding="utf-8")
    with pytest.raises(ReadError, match="this report has no digest of its content"):
        beside(two / "one" / "0001", [two / "other"])
    document["provenance"]["version"] = "0.0.9"
    path.write_text(json.dumps(document), encoding="utf-8")
    beside(two / "one" / "0001", [two / "other"])


def test_a_table_that_was_changed_is_laid_beside_none(two: Path) -> None:
    table = two / "other" / "0001" / "mass.csv"
    table.write_text(table.read_text("utf-8").replace("7", "8", 1), encoding="utf-8")
    with pytest.raises(ReadError, match=r"mass\.csv: was changed after it was written; expected SHA-256 "):
        beside(two / "one" / "0001", [two / "other"])
