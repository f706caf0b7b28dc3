"""`simulate` with what happens over a campaign: options, the plan that they make, the truth, the refusals."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from recoil_daq import CampaignPlan, load_rig, simulate
from recoil_daq.campaign_options import plan_of_options

OPTIONS = (
    "--added-mass", "120", "--u-added-mass", "0.1", "--charges", "1,0.8", "--friction-scatter", "0.03",
    "--repeatability", "0.0005", "--mass-step=-4@3", "--mass-step", "1.5@2", "--configuration", "long rod@2",
    "--drift", "p_breech=0.01", "--drift", "p_brake=-0.01", "--outlier", "x_camera=-0.02@2",
    "--outlier", "acc_recoil=0.01@2",
)  # fmt: skip
PLAN = CampaignPlan(
    added_mass_kg=120.0,
    u_added_mass_kg=0.1,
    charges=(1.0, 0.8),
    friction_scatter=0.03,
    repeatability=0.0005,
    mass_steps={3: -4.0, 2: 1.5},
    configurations={2: "long rod"},
    drifts={"p_breech": 0.01, "p_brake": -0.01},
    outliers={2: {"x_camera": -0.02, "acc_recoil": 0.01}},
)


def test_options_and_python_fire_the_same_campaign(run, tmp_path: Path) -> None:
    words = ("field-2013", "--shots", "3", "--campaign-seed", "3", *OPTIONS)
    result = run("simulate", *words, "--out", tmp_path / "a", "--json")
    assert result.exit_code == 0, result.output
    told = json.loads(result.stdout)
    done = simulate(load_rig("field-2013"), tmp_path / "b", shots=3, campaign_seed=3, plan=PLAN)
    assert [one["truth"] for one in told["shots"]] == [shot.truth for shot in done.shots]
    for shot in done.shots:
        for file in shot.folder.iterdir():
            assert (tmp_path / "a" / shot.shot / file.name).read_bytes() == file.read_bytes()
    assert [shot.truth["configuration"] for shot in done.shots] == ["", "long rod", "long rod"]
    off_kg = done.shots[1].truth["added_mass_kg"] - 120.0
    assert [shot.truth["m3"] for shot in done.shots] == pytest.approx([782.0, 782.0 + 1.5 + 120.0 + off_kg, 779.5])


@pytest.mark.parametrize(
    ("words", "problem"),
    [
        (("--added-mass", "-120"), "--added-mass: must be greater than 0, found -120.0"),
        (("--added-mass", "0"), "--added-mass: must be greater than 0"),
        (("--u-added-mass", "0.1"), "that of an added mass, of which there is none"),
        (("--charges", "1,x"), "--charges: must be a valid number"),
        (("--charges", "1,,2"), "--charges: must be a valid number"),
        (("--charges", "1,3", "--friction-scatter", "7"), "--friction-scatter: must be less than or equal to 0.2"),
        (("--mass-step", "4"), "--mass-step takes KG@SHOT, not '4'"),
        (("--mass-step", "4@x"), "--mass-step takes KG@SHOT, not '4@x'"),
        (("--mass-step", "x@2"), "--mass-step: must be a valid number"),
        (("--mass-step", "4@0"), "--mass-step: must be greater than or equal to 1"),
        (("--mass-step", "4@9"), "mass step at shot 9: the campaign ends with shot 2"),
        (("--mass-step", "4@2", "--mass-step", "5@02"), "--mass-step is given twice for shot 2"),
        (("--configuration", "@2"), "--configuration takes NAME@SHOT"),
        (("--drift", "p_brake"), "--drift takes CHANNEL=REL, not 'p_brake'"),
        (("--drift", "p_brake=nan"), "--drift: must be a finite number"),
        (("--drift", "p_brake=0.1", "--drift", "p_brake=0.2"), "--drift is given twice for p_brake"),
        (("--outlier", "p_brake=0.1"), "--outlier takes CHANNEL=REL@SHOT, not 'p_brake=0.1'"),
        (("--outlier", "p_brake@2"), "--outlier takes CHANNEL=REL@SHOT, not 'p_brake@2'"),
        (("--outlier", "a=0.1@2", "--outlier", "a=0.1@2"), "--outlier is given twice for a at shot 2"),
    ],
)
def test_an_option_that_cannot_be_is_wrong_usage_and_leaves_nothing(run, tmp_path: Path, words, problem) -> None:
    out = tmp_path / "out"
    result = run("simulate", "field-2013", "--shots", "2", "--campaign-seed", "3", *words, "--out", out)
    assert result.exit_code == 2
    assert problem in " ".join(result.stderr.split())
    assert not out.exists()


def test_a_channel_that_the_rig_lacks_is_its_fault_and_leaves_nothing(run, tmp_path: Path) -> None:
    words = ("--shots", "2", "--campaign-seed", "3", "--drift", "p_brech=0.1", "--out", tmp_path / "out")
    result = run("simulate", "field-2013", *words)
    assert result.exit_code == 3
    assert "campaign.drifts.p_brech: no such channel; did you mean 'p_breech'?" in result.stderr
    assert not (tmp_path / "out").exists()


def test_a_plan_without_a_campaign_is_refused(run, tmp_path: Path) -> None:
    result = run("simulate", "field-2013", "--shots", "2", "--repeatability", "0.001", "--out", tmp_path / "out")
    assert result.exit_code == 2
    assert "a campaign needs --campaign-seed" in result.stderr
    with pytest.raises(ValueError, match="a plan needs a campaign_seed"):
        simulate(load_rig("field-2013"), tmp_path / "out", shots=2, plan=CampaignPlan())
    assert not (tmp_path / "out").exists()


def test_a_channels_name_may_hold_the_signs_that_part_an_option() -> None:
    plan = plan_of_options({"drifts": ["a=b@c=0.1"], "outliers": ["a=b@c=0.1@2"], "configurations": ["x@y@2"]}, 2)
    assert plan.drifts == {"a=b@c": 0.1}
    assert plan.outliers == {2: {"a=b@c": 0.1}}
    assert plan.configurations == {2: "x@y"}
