"""A shot identified over the values of one option: each row is a whole identification, and a sentence sums it up."""

from __future__ import annotations

import csv
import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from pypdf import PdfReader
from typer.testing import Result

from recoil_acquisition.errors import StoreError
from recoil_daq.reports.sweep import MOST_VALUES, Sweep, Swept, sweep_shot, sweeps_again
from recoil_identification.report.document.report_files import seal_fault
from recoil_identification.report.page.html import render_results_page
from recoil_identification.report.results.sweep import SWEEP, sweep_document, sweep_figures
from recoil_identification.shot.identified import Options
from tests.builders.page_elements import PageElements
from tests.recoil_daq.conftest import Identified

Run = Callable[..., Result]


@pytest.fixture(scope="module")
def swept(stored: Path, tmp_path_factory: pytest.TempPathFactory) -> Swept:
    return sweep_shot(stored, "cutoff_hz=250:350:100", out=tmp_path_factory.mktemp("swept"))


def digits(row: dict[str, Any]) -> list[object]:
    return [row["mass_kg"], row["u_kg"], [row["U95_low_kg"], row["U95_high_kg"]], row["E_n"], row["rpe_percent"]]


def of_report(report: dict[str, Any]) -> list[object]:
    mass = report["mass"]
    return [mass["value"], mass["u"], mass["U95"], report["E_n"], report["rpe_percent"]["value"]]


@pytest.mark.indispensable("sweep")
def test_its_own_row_has_the_digits_of_plain_identify(swept: Swept, identified: Identified) -> None:
    assert digits(swept.document["own"]) == of_report(identified.report)
    assert swept.document["own"]["cutoff_hz"] == identified.report["filter"]["cutoff_hz"]


@pytest.mark.whole_way
def test_a_row_has_the_digits_of_plain_identify_at_that_value(
    run: Run, swept: Swept, stored: Path, tmp_path: Path
) -> None:
    done = run("identify", stored, "--cutoff-hz", "250", "--out", tmp_path, "--json")
    (report,) = json.loads(done.stdout)["reports"]
    first, second = swept.document["rows"]
    assert digits(first) == of_report(report)
    assert digits(first) != digits(second)
    assert [first["value"], second["value"]] == [250.0, 350.0]


@pytest.mark.whole_way
def test_a_row_at_the_default_value_is_its_own(stored: Path, tmp_path: Path, identified: Identified) -> None:
    (row,) = sweep_shot(stored, "window_s=0.02:0.02:1", out=tmp_path).document["rows"]
    assert digits(row) == of_report(identified.report)
    assert row["difference_kg"] == 0.0


def test_page_table_and_json_say_the_same(swept: Swept) -> None:
    folder = swept.page.parent
    assert sorted(one.name for one in folder.iterdir()) == [
        "sweep_cutoff_hz.csv", "sweep_cutoff_hz.html", "sweep_cutoff_hz.json",
    ]  # fmt: skip
    document = json.loads(swept.page.with_suffix(".json").read_text("utf-8"))
    assert document == swept.document
    assert seal_fault(document) == ""
    with swept.page.with_suffix(".csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [float(row["mass_kg"]) for row in rows] == swept.rows["mass_kg"].tolist()
    assert rows[0]["value"] == ""
    page = swept.page.read_text("utf-8")
    assert document["detail"].split(":")[0] in PageElements(page).text
    assert 'class="still"' in page  # the figure without scripts
    assert 'class="verdict"' in page
    values = [f"{value:g} Hz" for value in swept.rows["value"].dropna()]
    assert [value for value in values if value not in PageElements(page).text] == []
    *table, said, place = str(swept).splitlines()
    assert [line[:6].strip() for line in table[-len(values) :]] == values
    assert (said, place) == (document["detail"], f"-> {swept.page}")


@pytest.mark.parametrize("change", [{"moves": True}, {"moves": None}, {"own": {"valid": False}}])
def test_a_sweep_that_moves_the_mass_or_is_of_none_that_is_valid_is_not_green(
    swept: Swept, change: dict[str, Any]
) -> None:
    document = swept.document | change
    document["own"] = swept.document["own"] | change.get("own", {})
    page = render_results_page(document, sweep_figures(document))
    assert 'class="verdict doubt"' in page


@pytest.mark.whole_way
def test_nothing_of_a_report_goes_with_a_sweep_and_no_sweep_is_replaced_unasked(stored: Path, tmp_path: Path) -> None:
    folder = tmp_path / "0001"
    (folder / "figures").mkdir(parents=True)
    kept = [folder / name for name in ("report.json", "report.pdf", "figures/mass.svg", "notes.txt")]
    for path in kept:
        path.write_text("<svg><!-- recoil-daq figure mass --></svg>", encoding="utf-8")
    sweep_shot(stored, "window_s=0.02:0.02:1", out=tmp_path)
    assert all(path.exists() for path in kept)
    with pytest.raises(StoreError, match="exists already"):
        sweep_shot(stored, "window_s=0.02:0.02:1", out=tmp_path)
    sweep_shot(stored, "window_s=0.02:0.02:1", out=tmp_path, overwrite=True)


@pytest.mark.whole_way
def test_a_sweep_on_paper_has_its_identity_and_is_drawn_again(stored: Path, tmp_path: Path) -> None:
    (tmp_path / "header.toml").write_text('laboratory = "North"\nnumber = "S-{shot}"\n', encoding="utf-8")
    done = sweep_shot(stored, "cutoff_hz=300:400:100", out=tmp_path / "out", pdf=True, header=tmp_path / "header.toml")
    assert done.document["issued"] == {"laboratory": "North", "number": "S-0001"}
    paper = done.page.with_suffix(".pdf")
    text = " ".join(" ".join(page.extract_text() for page in PdfReader(paper).pages).split())
    for said in ("North", "S-0001", "THE MASS STANDS", "400 Hz"):
        assert said in text
    assert all(said in done.page.read_text("utf-8") for said in ("North", "S-0001"))
    compared, files = sweeps_again(done.folder)
    assert {paper.name, done.page.name} <= files
    assert (paper.name in compared.drawings, compared.differences) == (True, ())
    content = bytearray(paper.read_bytes())
    content[len(content) // 3] ^= 1
    paper.write_bytes(content)
    assert paper.name in str(sweeps_again(done.folder)[0].differences)


@pytest.mark.whole_way
def test_a_value_that_allows_no_mass_is_a_row_that_says_why(stored: Path, tmp_path: Path) -> None:
    (row,) = sweep_shot(stored, "window_s=100:100:1", out=tmp_path).document["rows"]
    assert row["mass_kg"] is None
    assert row["valid"] is False
    assert "interval" in row["reason"]


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("cutoff_hz=150:600:50", [150.0 + 50.0 * k for k in range(10)]),
        ("window_s=0.1:0.3:0.1", [0.1, 0.2, 0.3]),
        ("mass_cutoff_hz=100:250:100", [100.0, 200.0]),
        ("cutoff_hz=1e2:1e2:1", [100.0]),
    ],
)
def test_both_ends_belong_to_a_sweep_as_far_as_its_steps_reach_them(text: str, values: list[float]) -> None:
    assert list(Sweep.of(text).values) == values


@pytest.mark.parametrize(
    "text",
    [
        "", "cutoff_hz", "cutoff_hz=", "cutoff_hz=1", "cutoff_hz=1:2", "cutoff_hz=1:2:3:4", "cutoff_hz=a:b:c",
        "cutoff_hz=300:200:50", "cutoff_hz=100:200:0", "cutoff_hz=100:200:-50", "cutoff_hz=0:100:50",
        "cutoff_hz=-100:100:50", "cutoff_hz=nan:200:50", "cutoff_hz=100:inf:50", "cutoff_hz=1:1e9:1e-9",
        f"cutoff_hz=1:{MOST_VALUES + 1}:1", "compare=0:1:1", "method=1:2:1", "cutoff_hz=1:2:1e-999999999",
        "cutoff_hz=1e400:1e400:1", "cutoff_hz=1e-400:1:1", "cutoff_hz=1:1e999999999:1",
    ],
)  # fmt: skip
def test_what_is_no_sweep_is_wrong_usage_in_a_line(run: Run, stored: Path, tmp_path: Path, text: str) -> None:
    with pytest.raises(ValueError, match="="):
        Sweep.of(f"{text}" if text else "=")
    done = run("identify", stored, "--sweep", text, "--out", tmp_path)
    assert done.exit_code == 2
    assert list(tmp_path.iterdir()) == []


def test_a_sweep_is_of_one_shot_and_goes_alone(run: Run, stored: Path, tmp_path: Path) -> None:
    words = ("--sweep", "cutoff_hz=200:300:50", "--out", tmp_path)
    assert run("identify", stored.parent, *words).exit_code == 2
    assert run("identify", stored, stored, *words).exit_code == 2
    assert run("identify", stored, *words, "--compare").exit_code == 2
    assert run("identify", stored, *words, "--target", "resistance").exit_code == 2
    assert list(tmp_path.iterdir()) == []


def row_of(mass_kg: float) -> dict[str, Any]:
    return {**dict.fromkeys(SWEEP.cells), "mass_kg": mass_kg, "u_kg": 2.0, "valid": True}


@pytest.mark.parametrize(("mass_kg", "moves"), [(101.9, False), (102.1, True), (97.9, True), (98.1, False)])
def test_the_mass_moves_where_it_is_off_by_more_than_its_u(mass_kg: float, moves: bool) -> None:
    document = sweep_document(
        "cutoff_hz", {None: row_of(100.0), 200.0: row_of(100.5), 300.0: row_of(mass_kg), 400.0: "no peak"},
        shot="0001", rig="mixed", specification_kg=100.0, version="1", inputs=(), options=Options().to_json(),
    )  # fmt: skip
    assert document["moves"] is moves
    assert document["largest_difference_kg"] == mass_kg - 100.0
    assert document["at"] == 300.0
    assert ("by more than u" in document["detail"]) is moves
    assert "1 of 3" in document["detail"]


def test_a_jump_between_two_values_is_said_though_the_mass_stays_within_its_u() -> None:
    found = {None: row_of(100.0), 400.0: row_of(99.5), 450.0: row_of(99.6), 500.0: row_of(100.9)}
    document = sweep_document(
        "cutoff_hz", found, shot="0001", rig="mixed", specification_kg=100.0, version="1", inputs=(),
        options=Options().to_json(),
    )  # fmt: skip
    assert document["moves"] is False
    assert "it jumps by +1.3 kg, 0.65 of u, between 450 and 500 Hz" in document["detail"]
    assert [row["tone"] for row in SWEEP.worded(document)] == ["ok"] * 4


@pytest.mark.parametrize("ending", ["html", "csv", "json"])
def test_a_sweep_beside_a_report_is_drawn_again_and_a_changed_byte_is_told(
    swept: Swept, tmp_path: Path, ending: str
) -> None:
    folder = tmp_path / "0001"
    shutil.copytree(swept.folder, folder)
    found, names = sweeps_again(folder)
    assert found.again
    assert set(found.drawings) == {"sweep_cutoff_hz.csv", "sweep_cutoff_hz.html"}
    assert names == {path.name for path in folder.iterdir()}
    path = folder / f"sweep_cutoff_hz.{ending}"
    path.write_text(path.read_text("utf-8").replace("250.0" if ending != "html" else "250 Hz", "251.0"), "utf-8")
    found, _ = sweeps_again(folder)
    assert not found.again
    assert any(path.name in one.key for one in found.differences)
    (folder / "sweep_cutoff_hz.html").unlink()
    assert "sweep_cutoff_hz.html" in [one.key for one in sweeps_again(folder)[0].differences]


def test_what_is_no_sweep_is_named_as_not_compared(swept: Swept, tmp_path: Path) -> None:
    (tmp_path / "sweep_cutoff_hz.json").write_text(json.dumps({**swept.document, "rows": 7}), "utf-8")
    found, _ = sweeps_again(tmp_path)
    assert found.again
    assert [one.file for one in found.not_compared] == ["sweep_cutoff_hz.json"]
