"""Documents of every form that was ever written stay readable: today's code explains, combines and recovers them.

Each archive in ``tests/kept`` holds what the code of its day wrote: a rig, a shot file, two reports, a campaign, and
where there was one by then a journal that a crash left over. An archive is added where a form changes; none is changed.
"""

from __future__ import annotations

import json
import zipfile
from pathlib import Path
from typing import Any

import pytest

from recoil_acquisition.errors import ReadError
from recoil_acquisition.store import read_shot
from recoil_daq.campaigns.campaign import campaign
from recoil_daq.campaigns.history import History
from recoil_daq.campaigns.reproduction import explain
from recoil_daq.live.recover import recover_folder
from recoil_daq.reports.identify import identify_file
from recoil_daq.reports.result import read_report
from recoil_daq.reports.shot_index import index_shots
from recoil_rigs.rig import load_rig

ARCHIVES = sorted((Path(__file__).parents[1] / "kept").glob("*.zip"))
pytestmark = pytest.mark.whole_way


@pytest.fixture(scope="module", params=ARCHIVES, ids=lambda path: path.stem)
def kept(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("kept")
    with zipfile.ZipFile(request.param) as archive:
        archive.extractall(folder)
    return folder


def document(path: Path) -> dict[str, Any]:
    return dict(json.loads(path.read_text("utf-8")))


def test_there_is_one_of_each_form() -> None:
    assert len(ARCHIVES) >= 3


def test_a_rig_file_is_read(kept: Path) -> None:
    assert load_rig(kept / "range/0001/rig.toml").mechanism.m3 == 782.0


def test_a_shot_file_is_read_and_its_mass_is_that_of_its_day_within_its_uncertainty(kept: Path, tmp_path: Path) -> None:
    shot = read_shot(kept / "shots/0001.h5")
    assert shot.by_role("breech_pressure") is not None
    stated = document(kept / "reports/0001/report.json")["mass"]
    found = identify_file(kept / "shots/0001.h5", out=tmp_path)
    # what nobody stated counted for less, two forms ago
    assert abs(found.mass_kg - stated["value"]) < max(stated["u"], found.u_kg)


def test_a_report_is_explained_with_the_numbers_that_it_states(kept: Path) -> None:
    stated = document(kept / "reports/0001/report.json")
    told = explain(kept / "reports/0001")
    shown = {one.key: one for one in told.entries}
    assert {part.label: part.value for part in shown["mass"].parts}["value"] == stated["mass"]["value"]
    assert {part.label for part in shown["peaks"].parts} == set(stated["peaks"])
    # the code is another one: it must not say that they come again to the last bit
    if "peaks_degrees_of_freedom" not in stated:
        assert not told.again
        assert told.comparison.differences


def test_a_report_comes_back_as_a_result(kept: Path) -> None:
    stated = document(kept / "reports/0001/report.json")
    found = read_report(kept / "reports/0001")
    assert (found.mass_kg, found.valid) == (stated["mass"]["value"], stated["valid"])
    assert list(found.peaks["value"]) == list(stated["peaks"].values())
    assert found.trace["identified"].any()


def test_a_campaign_is_explained_and_its_reports_make_it_again(kept: Path, tmp_path: Path) -> None:
    stated = document(kept / "campaign/campaign.json")["mass"]
    told = explain(kept / "campaign")
    mass = next(one for one in told.entries if one.key == "mass")
    assert {part.label: part.value for part in mass.parts}["value"] == stated["value"]
    again = campaign(kept / "reports", reports=tmp_path / "none", out=tmp_path / "campaign")
    assert abs(again.mass_kg - stated["value"]) < stated["u"]
    told = document(kept / "campaign/campaign.json")
    if "budget" in told:
        assert len(History.read(kept, tmp_path / "campaign").past) == 1
        return
    with pytest.raises(ReadError, match="combine its shots"):
        History.read(kept, tmp_path / "campaign")


def test_an_index_lists_its_reports(kept: Path, tmp_path: Path) -> None:
    table = index_shots([kept / "reports"], out=tmp_path)
    assert [row["shot"] for row in table.document["shots"]] == ["0001", "0002"]


def test_a_journal_is_recovered(kept: Path) -> None:
    if not (kept / "live").exists():
        pytest.skip("no journal was written in that form")
    recovered, faults = recover_folder(kept / "live", None)
    assert (len(recovered), faults) == (1, [])
    assert [one.name for one in (kept / "live/captures").glob("*.rdlog")] == ["0001.rdlog"]
