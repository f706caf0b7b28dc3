"""A rig as the docs describe it, and one with nothing that may lack, go through every command."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from recoil_daq.campaigns.prediction import predict
from recoil_identification.report.document.report_files import sealed
from recoil_rigs.mechanism.model import Mechanism
from recoil_rigs.rig import find_rig, load_rig, parse_rig
from recoil_rigs.twin import CampaignPlan, simulate_shot
from tests.builders.rig_variants import bare, bundled_tables, documented_rig, toml_of, with_virtual_values
from tests.builders.shared_motions import once_in_this_run
from tests.builders.virtual_shots import SHORTER
from tests.builders.whole_way import Done, whole_way

SHOTS = 3
NEEDED_BY_TARGETS = ("parameters", "stiffness", "inertia-force")
"""Those that need more channels than the rig of the page has."""


def fired(text: str, beside: Path, folder: Path, shots: int) -> list[list[Path]]:
    """Fire the shots of a virtual rig, every second one with 120 kg more, and return the files of each."""
    rig = parse_rig(text, beside)
    planned = CampaignPlan(added_mass_kg=120.0).draw(rig, shots, seed=1, campaign_seed=3)
    all_fired = [
        simulate_shot(rig, folder / f"{k + 1:04d}", seed=1 + k, shot=f"{k + 1:04d}", campaign_seed=3, planned=one)
        for k, one in enumerate(planned)
    ]
    return [list(one.files) for one in all_fired]


def all_done(text: str, virtual: str, folder: Path, *, shots: int = SHOTS, all_targets: bool = True) -> list[Done]:
    """Take the shots of a rig through all commands."""
    (folder / "rig.toml").write_text(text, encoding="utf-8")
    files = fired(virtual, folder / "virtual.toml", folder / "files", shots)
    return list(whole_way(folder / "rig.toml", files, folder, all_targets=all_targets))


def documented(folder: Path) -> tuple[list[Done], Path]:
    return all_done(documented_rig(), with_virtual_values(documented_rig(), **SHORTER), folder), folder


@pytest.fixture(scope="module")
def way() -> tuple[list[Done], Path]:
    return once_in_this_run("documented-rig", documented)


def test_the_rig_of_the_page_states_nothing_that_virtual_rigs_alone_need(tmp_path: Path) -> None:
    (tmp_path / "rig.toml").write_text(documented_rig(), encoding="utf-8")
    mechanism = load_rig(tmp_path / "rig.toml").mechanism
    assert {name for name in Mechanism.symbols() if getattr(mechanism, name) != getattr(mechanism, name)} >= {"m1", "f"}


@pytest.mark.whole_way
def test_every_command_takes_the_rig_of_the_page(way: tuple[list[Done], Path]) -> None:
    done, _ = way
    assert {one.words: one.fault for one in done if one.fault} == {}
    refused = {one.words[one.words.index("--target") + 1] for one in done if one.exit_code == 3}
    assert refused == set(NEEDED_BY_TARGETS)
    assert all("no channel of role carriage_" in one.output for one in done if one.exit_code == 3)
    # what speaks against a resistance, without the carriage's motion, is not the rig's being unstated
    assert [one.words for one in done if one.exit_code == 1 and "resistance" not in one.words] == []


def test_its_campaign_is_the_mass_and_its_geometry_is_what_it_states(way: tuple[list[Done], Path]) -> None:
    _, folder = way
    campaign = json.loads((folder / "campaign" / "campaign.json").read_text(encoding="utf-8"))
    truth = json.loads((folder / "files" / "0001" / "truth.json").read_text(encoding="utf-8"))["m3"]
    assert campaign["valid"], campaign["reasons"]
    assert abs(campaign["mass"]["value"] - truth) < 3 * campaign["mass"]["u"]
    report = json.loads((folder / "reports" / "0001" / "report.json").read_text(encoding="utf-8"))
    assert {"XA", "bore_area", "g"} <= set(report["campaign"]["geometry"])
    assert not {"m1", "m2", "J1", "f", "m3"} & set(report["campaign"]["geometry"])


@pytest.mark.whole_way
def test_reports_that_state_null_of_what_lacks_are_combined_too(
    run, way: tuple[list[Done], Path], tmp_path: Path
) -> None:
    _, folder = way
    for path in sorted((folder / "reports").glob("*/report.json")):
        document = json.loads(path.read_text(encoding="utf-8"))
        document["campaign"]["geometry"] |= {"m1": None, "f": None}
        (tmp_path / "reports" / path.parent.name).mkdir(parents=True)
        whole = json.dumps(sealed(document))
        (tmp_path / "reports" / path.parent.name / "report.json").write_text(whole, encoding="utf-8")
    result = run("campaign", tmp_path / "reports", "--out", tmp_path / "campaign", "--json")
    assert result.exit_code == 0, result.output


@pytest.mark.whole_way
def test_a_shot_of_the_page_is_taken_by_the_rig_that_states_more(way: tuple[list[Done], Path], tmp_path: Path) -> None:
    _, folder = way
    (tmp_path / "more.toml").write_text(with_virtual_values(documented_rig()), encoding="utf-8")
    found = predict(load_rig(tmp_path / "more.toml"), from_shot=folder / "shots" / "0001.h5")
    assert 0.0 < found.u_rel < 0.01


@pytest.mark.whole_way
@pytest.mark.parametrize("name", ["mixed"])  # each key alone, and of both rigs: a benchmark
def test_every_command_takes_a_rig_that_states_what_it_must(name: str, tmp_path: Path) -> None:
    tables = bundled_tables(name)
    virtual = toml_of(tables | {"twin": tables["twin"] | SHORTER})
    (tmp_path / "mixed.dbc").write_bytes(find_rig("mixed").with_suffix(".dbc").read_bytes())
    done = all_done(toml_of(bare(tables)), virtual, tmp_path, shots=2, all_targets=False)
    assert {one.words: one.fault for one in done if one.fault} == {}
    assert (tmp_path / "campaign" / "campaign.json").exists()
