"""`simulate` with what happens over a campaign: options, the plan that they make, the truth, the refusals."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest

from recoil_acquisition.errors import StoreError
from recoil_acquisition.store.shot_log import ShotLog
from recoil_daq import CampaignPlan, load_rig, read_shot, simulate
from recoil_daq.campaigns.plan import plan_of_options
from tests.builders.campaigns import ring_campaign
from tests.builders.virtual_shots import with_twin

QUICK = {"sample_rate_hz": 20e3, "duration_s": 0.3}
"""To fire; too short to be identified."""

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


@pytest.mark.whole_way
def test_options_and_python_fire_the_same_campaign_and_its_log_has_what_those_who_fire_know(
    run, tmp_path: Path
) -> None:
    rig = with_twin("field-2013", **QUICK)
    (tmp_path / "rig.toml").write_text(rig.text, encoding="utf-8")
    words = (tmp_path / "rig.toml", "--shots", "3", "--campaign-seed", "3", *OPTIONS)
    result = run("simulate", *words, "--out", tmp_path / "a", "--json")
    assert result.exit_code == 0, result.output
    told = json.loads(result.stdout)
    done = simulate(rig, tmp_path / "b", shots=3, campaign_seed=3, plan=PLAN)
    assert str(done).endswith(f"shot log: {done.log}")
    assert told["shot_log"] == str(tmp_path / "a" / "shotlog.csv")
    with (tmp_path / "a" / "shotlog.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [list(row.values()) for row in rows] == [
        ["0001", "", "", "", "", "1", "", "", "", ""],
        ["0002", "", "long rod", "120", "0.1", "0.8", "", "", "", ""],
        ["0003", "", "long rod", "", "", "1", "", "", "", ""],
    ]
    assert [one["truth"] for one in told["shots"]] == [shot.truth for shot in done.shots]
    for shot in done.shots:
        for file in shot.folder.iterdir():
            assert (tmp_path / "a" / shot.shot / file.name).read_bytes() == file.read_bytes()
    assert [shot.truth["configuration"] for shot in done.shots] == ["", "long rod", "long rod"]
    off_kg = done.shots[1].truth["added_mass_kg"] - 120.0
    assert [shot.truth["m3"] for shot in done.shots] == pytest.approx([782.0, 782.0 + 1.5 + 120.0 + off_kg, 779.5])


@pytest.mark.whole_way
def test_an_exactly_known_added_mass_is_stated_as_such_and_shots_without_a_campaign_have_no_log(tmp_path: Path) -> None:
    exact = CampaignPlan(added_mass_kg=60.0, u_added_mass_kg=0.0)
    rig = with_twin("field-2013", **QUICK)
    fired = simulate(rig, tmp_path / "exact", shots=2, campaign_seed=3, plan=exact)
    row = ShotLog.read(fired.log).row("0002")
    assert (row.added_mass_kg, row.u_added_mass_kg, row.added_mass_is_exact) == (60.0, 0.0, False)
    assert simulate(rig, tmp_path / "alone").log is None
    assert not (tmp_path / "alone" / "shotlog.csv").exists()
    with pytest.raises(StoreError, match=r"shotlog\.csv: exists already"):
        simulate(rig, tmp_path / "exact", shots=2, campaign_seed=3)


def test_a_fired_campaign_is_ingested_with_its_log_beside_the_shot_files() -> None:
    done = ring_campaign().fired
    assert [file.name for file in done.files] == ["0001.h5", "0002.h5", "0003.h5", "0004.h5"]
    log = ShotLog.beside(done.files[0])
    assert log.path == done.log
    assert [row.added_mass_kg for row in log.rows] == [0.0, 120.0, 0.0, 120.0]
    assert log.without_shot() == ()
    for file, truth in zip(done.files, done.truths, strict=True):
        assert read_shot(file).name == truth["shot"]
    assert done.truths[1]["m3"] - done.truths[0]["m3"] == pytest.approx(done.truths[1]["added_mass_kg"])


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
        (("--outlier", "p_brake=0.1@0"), "--outlier: must be greater than or equal to 1"),
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
