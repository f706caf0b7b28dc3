"""`--pdf` and `--figures`: what they write beside a page, what goes with an older report, and what they need."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from pypdf import PdfReader

from recoil_acquisition.packages.extras import Extra
from recoil_daq.reports.identify_folder import identify_folder
from recoil_identification.report.figure.figure import Figure, Panel
from recoil_identification.report.paper import typeset
from recoil_identification.report.paper.paper import write_figures
from recoil_rigs.twin import CampaignPlan
from tests.builders.campaigns import FiredCampaign, fire_campaign

FIGURE = "figures/mass.svg"


@pytest.fixture(scope="module")
def printed(stored: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The field shot's report with its paper copy and its figures."""
    out = tmp_path_factory.mktemp("printed")
    (done,) = identify_folder(stored.parent, out=out, workers=1, pdf=True, figures=True)
    return done.folder


@pytest.fixture
def copied(printed: Path, tmp_path: Path) -> Path:
    """The same, to be changed."""
    return Path(shutil.copytree(printed, tmp_path / "out" / printed.name))


@pytest.mark.indispensable("paper")
def test_the_paper_copy_holds_the_report_beside_it(printed: Path) -> None:
    (content,) = PdfReader(printed / "report.pdf").attachments["report.json"]
    assert content == (printed / "report.json").read_bytes()


def test_each_figure_stands_there_as_svg_and_png(printed: Path) -> None:
    names = {path.name for path in (printed / "figures").iterdir()}
    stems = {Path(name).stem for name in names}
    assert names == {f"{stem}.{suffix}" for stem in stems for suffix in ("svg", "png")}
    assert {"mass", "residuals", "spectrum"} <= stems


@pytest.mark.whole_way
def test_a_second_run_writes_the_same_bytes(run, stored: Path, printed: Path, tmp_path: Path) -> None:
    result = run("identify", stored, "--out", tmp_path, "--pdf", "--figures")
    assert result.exit_code == 0, result.output
    for path in printed.rglob("*.*"):
        assert (tmp_path / "0001" / path.relative_to(printed)).read_bytes() == path.read_bytes(), path.name


@pytest.mark.whole_way
def test_a_paper_copy_is_not_replaced_unasked_and_goes_with_the_report_that_it_tells_of(
    run, stored: Path, copied: Path
) -> None:
    for name in ("report.json", "report.html", "mass.csv", "curves.csv"):
        (copied / name).unlink()
    (copied / "figures" / "mine.svg").write_text("mine")
    shutil.copy(copied / FIGURE, copied / "figures" / "a copy of mine.svg")
    refused = run("identify", stored, "--out", copied.parent)
    assert refused.exit_code == 3
    assert "report.pdf: the report exists already" in refused.stderr
    assert run("identify", stored, "--out", copied.parent, "--overwrite").exit_code == 0
    assert not (copied / "report.pdf").exists()
    assert {path.name for path in (copied / "figures").iterdir()} == {"mine.svg", "a copy of mine.svg"}


def leave_figure(folder: Path, key: str, prefix: str = "") -> str:
    """Put a figure into a report's folder as an earlier report with other clocks or sensors would have left it."""
    write_figures(folder, [Figure(key, "t", "c", "x", (Panel("y", ()),))], prefix)
    return prefix + key


@pytest.mark.whole_way
def test_figures_that_the_new_report_has_not_go_with_the_older_one(run, stored: Path, copied: Path) -> None:
    kept = leave_figure(copied, "inertia-force-2", "inertia-force-")
    gone = leave_figure(copied, "alignment-of a clock, long gone")
    assert len(list((copied / "figures").glob("alignment-of*"))) == 2, gone
    assert run("identify", stored, "--out", copied.parent, "--overwrite", "--figures").exit_code == 0
    assert (copied / FIGURE).exists()
    assert not list((copied / "figures").glob("alignment-of*"))
    assert (copied / f"figures/{kept}.png").exists(), "it is of the page of a target"
    words = ("--target", "inertia-force", "--overwrite")
    assert run("identify", stored, "--out", copied.parent, *words).exit_code in (0, 1)
    assert not (copied / f"figures/{kept}.svg").exists()
    assert not (copied / f"figures/{kept}.png").exists()
    assert (copied / FIGURE).exists(), "it is of the page of the mass"


@pytest.mark.whole_way
def test_a_target_s_paper_stands_beside_the_mass_s(run, stored: Path, copied: Path) -> None:
    words = ("identify", stored, "--out", copied.parent, "--target", "inertia-force", "--pdf", "--figures")
    assert run(*words).exit_code in (0, 1)
    document = json.loads((copied / "inertia-force.json").read_text("utf-8"))
    assert document["title"] in PdfReader(copied / "inertia-force.pdf").metadata.title
    assert (copied / "report.pdf").exists()
    assert (copied / FIGURE).exists()
    assert list((copied / "figures").glob("inertia-force-*.png"))


@pytest.fixture(scope="module")
def fired(tmp_path_factory: pytest.TempPathFactory) -> FiredCampaign:
    return fire_campaign(tmp_path_factory.mktemp("campaign"), CampaignPlan(), shots=2, campaign_seed=5)


@pytest.mark.whole_way
def test_a_campaign_has_a_paper_copy(run, fired: FiredCampaign, tmp_path: Path) -> None:
    result = run("campaign", fired.shots, "--out", tmp_path / "c", "--pdf", "--figures", "--workers", "1")
    assert result.exit_code in (0, 1), result.output
    (content,) = PdfReader(tmp_path / "c" / "campaign.pdf").attachments["campaign.json"]
    assert content == (tmp_path / "c" / "campaign.json").read_bytes()
    assert (tmp_path / "c" / FIGURE).exists()
    leave_figure(tmp_path / "c", "sensor-40")
    before = json.loads(content)
    again = run("campaign", fired.shots, "--out", tmp_path / "c", "--pdf", "--workers", "1", "--overwrite")
    assert again.exit_code == result.exit_code
    (content,) = PdfReader(tmp_path / "c" / "campaign.pdf").attachments["campaign.json"]
    after = json.loads(content)
    for document in (before, after):
        # the forms are others, and the digest with them
        del document["provenance"]["drawn"], document["provenance"]["digest"]
    assert after == before
    assert not list((tmp_path / "c").glob("figures/*"))


@pytest.mark.parametrize("option", ["--pdf", "--figures"])
@pytest.mark.parametrize("command", ["identify", "campaign"])
def test_the_extra_is_named_before_any_work(
    run, stored: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: str, option: str
) -> None:
    monkeypatch.setattr(typeset, "PDF", Extra("pdf", "no_such_module", "typst>=0.15"))
    result = run(command, stored, "--out", tmp_path / "out", option)
    assert result.exit_code == 3
    assert result.stderr.count("\n") == 1
    assert f"{option} needs, is not installed; pip install 'typst>=0.15'" in result.stderr
    assert not (tmp_path / "out").exists()
