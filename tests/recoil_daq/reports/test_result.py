"""A mass in memory is that of the commands, and nothing is written unasked; a report comes back as a result."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path

import openpyxl
import pytest

from recoil_acquisition.errors import ReadError, RigError, StoreError
from recoil_acquisition.shot.shot import Shot
from recoil_acquisition.store import write_shot
from recoil_daq.campaigns.campaign import campaign
from recoil_daq.reports.identify import Reported, identify_file
from recoil_daq.reports.identify_folder import identify_folder
from recoil_daq.reports.result import SHEETS, Result, identify, read_report
from recoil_identification.shot.identified import Options
from recoil_rigs.rig import parse_rig
from tests.builders.virtual_shots import virtual_shot


@pytest.fixture(scope="module")
def shot() -> Shot:
    return virtual_shot().shot


@pytest.fixture(scope="module")
def result(shot: Shot) -> Result:
    return identify(shot)


@pytest.fixture(scope="module")
def reported(shot: Shot, tmp_path_factory: pytest.TempPathFactory) -> Reported:
    folder = tmp_path_factory.mktemp("result")
    write_shot(shot, folder / f"{shot.name}.h5")
    return identify_file(folder / f"{shot.name}.h5", out=folder / "reports")


@pytest.mark.indispensable("in memory")
def test_a_mass_in_memory_is_that_of_the_command_to_the_last_digit(result: Result, reported: Reported) -> None:
    assert (result.mass_kg, result.u_kg, result.interval_kg) == (reported.mass_kg, reported.u_kg, reported.interval_kg)
    assert (result.valid, result.reasons, result.findings) == (reported.valid, reported.reasons, reported.findings)
    assert result.document["budget"] == reported.document["budget"]
    assert result.document["provenance"]["inputs"][0]["reader"] == "in memory"
    assert repr(result).startswith("Result(")
    # what the command prints, but for where it stands
    assert str(reported).startswith(str(result).rstrip())


@pytest.mark.whole_way
def test_a_report_that_was_written_comes_back_with_the_same_tables(result: Result, tmp_path: Path) -> None:
    folder = result.save(tmp_path / "reports" / "0001")
    assert (folder / "report.html").exists()
    for path in (folder, folder / "report.json", str(folder)):
        again = read_report(path)
        assert again.document == result.document
        for name in ("trace", "curves", "budget", "methods", "correlation"):
            assert getattr(again, name).equals(getattr(result, name)), name
    with pytest.raises(StoreError, match="exists already"):
        result.save(folder)
    with pytest.raises(ValueError, match="copy its folder"):
        again.save(tmp_path / "elsewhere")


def test_tables_have_what_the_document_has(result: Result) -> None:
    assert list(result.trace.columns) == ["time_s", "mass_kg", "u_kg", "identified"]
    assert result.trace["identified"].dtype == bool
    assert result.trace.loc[~result.trace["identified"], "mass_kg"].isna().all()
    assert (result.budget["u_kg"].to_numpy() == [row["u_kg"] for row in result.document["budget"]]).all()
    assert {"source", "group", "scope"} <= set(result.budget.columns)
    assert "calibrated" in set(result.methods["name"])
    assert list(result.correlation.columns) == ["one", "other", "r"]
    assert result.correlation["r"].abs().max() <= 1.0


@pytest.mark.whole_way
def test_a_plot_has_the_mass_its_interval_and_the_specification(result: Result, tmp_path: Path) -> None:
    figure = result.plot()
    (axes,) = figure.axes
    assert [text.get_text() for text in axes.get_legend().get_texts()] == [
        "mass over time, with u", "mass, 95 %", "specification",
    ]  # fmt: skip
    figure.savefig(tmp_path / "mass.png")


@pytest.mark.whole_way
def test_a_workbook_has_a_sheet_of_each_table_and_replaces_none_unasked(result: Result, tmp_path: Path) -> None:
    path = result.to_excel(tmp_path / "mass.xlsx")
    book = openpyxl.load_workbook(path)
    assert tuple(book.sheetnames) == SHEETS
    head = dict(book["mass"].iter_rows(min_row=2, values_only=True))
    assert head["value"] == result.mass_kg
    assert book["budget"].max_row == 1 + len(result.budget)
    with pytest.raises(StoreError, match="exists already"):
        result.to_excel(path)
    result.to_excel(path, overwrite=True)


@pytest.mark.whole_way
def test_what_is_changed_in_memory_changes_the_mass_and_not_the_shot(shot: Shot, result: Result) -> None:
    breech = shot["p_breech"]
    louder = shot.with_channel(replace(breech, samples=1.004 * breech.samples, raw=None))
    assert identify(louder).mass_kg > result.mass_kg
    assert shot["p_breech"] is breech
    assert identify(shot).document == result.document


@pytest.mark.whole_way
def test_a_corrected_rig_is_taken_and_another_one_refused(shot: Shot) -> None:
    text = shot.rig_text.replace("m3 = 782.0", "m3 = 770.0")
    assert text != shot.rig_text
    corrected = identify(shot, parse_rig(text, Path("corrected.toml")))
    assert corrected.document["mass"]["specification"] == 770.0
    assert any("corrected.toml" in one["text"] for one in corrected.findings)
    other = shot.rig_text.replace('name = "acc_recoil"', 'name = "acc_other"')
    with pytest.raises(RigError):
        identify(shot, parse_rig(other, Path("other.toml")))


@pytest.mark.whole_way
def test_targets_stand_beside_the_mass(shot: Shot) -> None:
    assert list(identify(shot, targets=("resistance",)).targets) == ["resistance"]
    with pytest.raises(ValueError, match="nonsense"):
        identify(shot, targets=("nonsense",))


def test_a_path_is_no_shot_and_a_file_no_report(tmp_path: Path) -> None:
    with pytest.raises(TypeError, match=r"read_shot\(\.\.\)"):
        identify("0001.h5")  # type: ignore[arg-type]  # what a script may do
    (tmp_path / "report.json").write_text(json.dumps({"schema": "other"}), encoding="utf-8")
    with pytest.raises(ReadError, match="no report of a shot"):
        read_report(tmp_path)
    with pytest.raises(ReadError):
        read_report(tmp_path / "nowhere")


@pytest.mark.parametrize(
    ("place", "value"),
    [
        (("mass",), [1, 2]), (("mass", "U95"), 1e308), (("rpe_percent", "U95"), True), (("methods", 0), {}),
        (("budget", 0), [[{}]]), (("budget", 0, "group"), ""), (("uncertainty", "coverage_factor"), "x"),
        (("provenance",), []), (("findings",), 1.0), (("correlations",), "x"), (("assumptions", 0), ""),
        (("constancy",), True), (("filter",), {"cutoff_hz": 1.0}), (("reasons",), None),
        (("mass", "specification"), {}),
    ],
    ids=str,
)  # fmt: skip
def test_a_report_that_cannot_be_shown_is_refused_when_it_is_read(
    result: Result, tmp_path: Path, place: tuple[str | int, ...], value: object
) -> None:
    document = json.loads(json.dumps(result.document))
    part = document
    for key in place[:-1]:
        part = part[key]
    part[place[-1]] = value
    (tmp_path / "report.json").write_text(json.dumps(document), encoding="utf-8")
    with pytest.raises(ReadError) as caught:
        read_report(tmp_path)
    assert len(str(caught.value).splitlines()) == 1
    assert "report.json" in str(caught.value)


@pytest.mark.parametrize("name", ["mass.csv", "curves.csv"])
def test_a_table_beside_a_report_that_is_none_is_refused(result: Result, tmp_path: Path, name: str) -> None:
    folder = result.save(tmp_path / "reports" / "0001")
    (folder / name).write_bytes(b"time_s,mass_kg\n\xff,x\n")
    with pytest.raises(ReadError, match=name):
        read_report(folder)


@pytest.mark.parametrize(("module", "call"), [("matplotlib.figure", "plot"), ("openpyxl", "to_excel")])
def test_a_missing_library_is_named_with_what_to_install(
    result: Result, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, module: str, call: str
) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(StoreError, match="pip install"):
        getattr(result, call)(*([tmp_path / "a.xlsx"] if call == "to_excel" else []))


@pytest.mark.whole_way
def test_what_was_added_is_in_the_specification(shot: Shot, result: Result, tmp_path: Path) -> None:
    added = identify(shot, added_mass_kg=-10.0, u_added_mass_kg=0.05)
    assert added.specification_kg == pytest.approx((result.specification_kg or 0.0) - 10.0)
    assert added.document["mass"]["u_specification"] >= 0.05
    (tmp_path / "shotlog.csv").write_text(f"shot,added_mass_kg,u_added_mass_kg\n{shot.name},-10,0.05\n", "utf-8")
    for log in (tmp_path, tmp_path / "shotlog.csv"):
        logged = identify(shot, log=log)
        assert (logged.mass_kg, logged.specification_kg, logged.E_n) == (
            added.mass_kg, added.specification_kg, added.E_n,
        )  # fmt: skip


def test_a_wrong_argument_is_named(shot: Shot, tmp_path: Path) -> None:
    with pytest.raises(TypeError, match="added_mass_kg must be a number, not '3'"):
        identify(shot, added_mass_kg="3")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="added_mass_kg must be finite"):
        identify(shot, added_mass_kg=float("nan"))
    with pytest.raises(ValueError, match="u_added_mass_kg must not be negative"):
        identify(shot, added_mass_kg=1.0, u_added_mass_kg=-1.0)
    with pytest.raises(ValueError, match="added_mass_kg and log"):
        identify(shot, added_mass_kg=1.0, log=tmp_path)
    with pytest.raises(ReadError, match="no such file"):
        identify(shot, log=tmp_path / "none.csv")
    (tmp_path / "shotlog.csv").write_text("shot,added_mass_kg\nother,3\n", "utf-8")
    with pytest.raises(ReadError, match="no row of shot"):
        identify(shot, log=tmp_path)
    with pytest.raises(TypeError, match="cutoff_hz must be a number, not '300'"):
        Options(cutoff_hz="300")  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="not int"):
        campaign([3])  # type: ignore[list-item]
    with pytest.raises(TypeError, match="not both"):
        campaign([identify(shot), tmp_path])  # type: ignore[list-item]


@pytest.mark.whole_way
def test_results_in_memory_make_the_campaign_of_their_files(tmp_path: Path) -> None:
    shots = [replace(virtual_shot(seed=seed).shot, name=f"{seed:04d}") for seed in (3, 4, 5)]
    for one in shots:
        write_shot(one, tmp_path / "shots" / f"{one.name}.h5")
    together = campaign([identify(one) for one in shots])
    of_files = campaign(tmp_path / "shots", reports=tmp_path / "reports", out=tmp_path / "campaign")
    assert (together.mass_kg, together.u_kg, together.reasons) == (of_files.mass_kg, of_files.u_kg, of_files.reasons)
    assert list(together.shots["shot"]) == list(of_files.shots["shot"])
    assert together.peaks.equals(of_files.peaks)
    assert str(of_files).replace(f" -> {of_files.folder / 'campaign.html'}", "") == str(together)
    table = identify_folder(tmp_path / "shots", out=tmp_path / "again").frame
    assert list(table["shot"].astype(str)) == ["0003", "0004", "0005"]
    assert table["u_impulse_n_s"].notna().all()
    with pytest.raises(ValueError, match="log: of files alone"):
        campaign([identify(one) for one in shots], log=tmp_path)  # type: ignore[call-overload]
    with pytest.raises(ValueError, match="out: of files alone"):
        campaign([identify(one) for one in shots], out=tmp_path)  # type: ignore[call-overload]


def test_the_peaks_are_a_table_with_their_uncertainties(result: Result) -> None:
    table = result.peaks.set_index("quantity")
    document = result.document
    assert table["value"].to_dict() == document["peaks"]
    assert table["u"].to_dict() == document["peaks_u"]
    assert list(table.loc["impulse_n_s", ["low", "high"]]) == document["peaks_U95"]["impulse_n_s"]
    assert (result.rpe_percent, result.E_n) == (document["rpe_percent"]["value"], document["E_n"])
