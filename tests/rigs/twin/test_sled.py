"""The bundled rig of a body on a line: its files, its truth, its settings, its refusals."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from recoil_acquisition.errors import RigError
from recoil_rigs.rig import Rig, load_rig, parse_rig
from recoil_rigs.twin import CampaignPlan, TwinShot, draw_scene, simulate_shot, virtual_settings, with_settings
from recoil_rigs.twin.line_motion import LineMotion
from recoil_rigs.twin.line_settings import LineSettings, devices_of
from recoil_rigs.twin.sources import Scene
from tests.builders.line_rigs import line_rig

EXACT = {
    "gain_errors": False, "friction_error": False, "unread_errors": False, "wander": 0.0, "noise": 0.0, "bias": 0.0,
    "bits": 0, "ringing": 0.0, "shot_to_shot": 0.0,
}  # fmt: skip
"""Settings with which nothing is off."""


@pytest.fixture(scope="module")
def shot(tmp_path_factory: pytest.TempPathFactory) -> TwinShot:
    return simulate_shot(load_rig("sled"), tmp_path_factory.mktemp("sled"), seed=3, shot="0003")


def scene_of(**settings: Any) -> tuple[Scene, LineMotion]:
    scene = draw_scene(with_settings(load_rig("sled"), settings), 4, "0004")
    assert isinstance(scene.motion, LineMotion)
    return scene, scene.motion


def test_it_is_sound_usual_and_a_line() -> None:
    rig = load_rig("sled")
    assert rig.mechanism.model == "line"
    assert rig.warnings == ()
    assert isinstance(virtual_settings(rig), LineSettings)
    assert devices_of(rig) == {"f_push": "driving_force", "f_brake": "resisting_force"}


@pytest.mark.exhaustive
def test_the_files_and_the_truth_are_there(shot: TwinShot) -> None:
    assert sorted(one.name for one in shot.folder.iterdir()) == [
        "0003_camera.csv", "0003_recorder.csv", "rig.toml", "truth.json",
    ]  # fmt: skip
    truth = json.loads(shot.truth_file.read_text())
    assert truth["m3"] == 318.0
    assert {"carried_mass", "friction", "slide_friction", "t_fire", "t_end", "stroke_m"} <= truth.keys()
    assert {"share", "form", "forces", "impulse_n_s", "impulse_share"} <= truth["unread"].keys()
    assert {"noise_of_acceleration", "noise_of_reading", "rest_noise"} == truth["noise"].keys()
    assert truth["gains"].keys() == {"f_push", "f_brake", "acc_sled", "v_sled", "x_sled"}


@pytest.mark.exhaustive
def test_the_same_seed_gives_the_same_bytes(shot: TwinShot, tmp_path: Path) -> None:
    again = simulate_shot(load_rig("sled"), tmp_path / "again", seed=3, shot="0003")
    for one, other in zip(shot.files, again.files, strict=True):
        assert one.read_bytes() == other.read_bytes()
    another = simulate_shot(load_rig("sled"), tmp_path / "another", seed=4, shot="0003")
    assert another.truth["friction"] != shot.truth["friction"]


@pytest.mark.exhaustive
def test_without_errors_the_file_satisfies_newton(tmp_path: Path) -> None:
    rig = with_settings(load_rig("sled"), EXACT)
    table = pd.read_csv(simulate_shot(rig, tmp_path, seed=1, shot="1").files[0])
    push, brake, felt, speed = (table[name].to_numpy() for name in table.columns[1:])
    # behind its Bessel low-pass of 3 kHz the acceleration is late
    times = table["Time (s)"].to_numpy()
    felt = np.interp(times + 2.114 / (2 * np.pi * 3000.0), times, felt)
    m = rig.mechanism
    slides = speed > 0.05
    whole = push - brake - m.friction - m.slide_friction * speed
    assert felt[slides] * (m.m3 + m.carried_mass) == pytest.approx(whole[slides], abs=5.0)
    moved = np.gradient(speed, times) + m.g * np.sin(m.phi20)
    assert moved[slides][5:-5] == pytest.approx(felt[slides][5:-5], abs=0.05)


@pytest.mark.exhaustive
def test_what_is_stated_is_drawn() -> None:
    rig = load_rig("sled")
    m = rig.mechanism
    quick = with_settings(rig, {"sample_rate_hz": 1000.0, "ringing": 0.0, "duration_s": 0.15})
    drawn = [draw_scene(quick, seed, "1") for seed in range(40)]
    forces = [scene.settings.unread for scene in drawn]
    carried = np.array([one.carried_oil_kg for one in forces])
    assert carried.mean() == pytest.approx(m.carried_mass, abs=4 * m.u["carried_mass"] / 40**0.5)
    assert carried.std() == pytest.approx(m.u["carried_mass"], rel=0.5)
    shares = np.array([scene.unread["share"] for scene in drawn])
    assert shares.std() == pytest.approx(m.u["unread_share"], rel=0.5)
    assert {one.latent_share for one in forces} == {m.unread_force}
    assert {scene.unread["form"]["packings"] for scene in drawn if scene.unread["share"] < 0} == {1.0}


@pytest.mark.exhaustive
def test_the_shots_of_a_campaign_share_their_errors(tmp_path: Path) -> None:
    rig = with_settings(load_rig("sled"), {"sample_rate_hz": 2000.0, "ringing": 0.0})
    plan = CampaignPlan(added_mass_kg=80.0, charges=(1.0, 0.8))
    planned = plan.draw(rig, 2, seed=1, campaign_seed=7)
    shots = [
        simulate_shot(rig, tmp_path / str(k), seed=k, shot=str(k), campaign_seed=7, planned=planned[k]) for k in (0, 1)
    ]
    first, second = (one.truth for one in shots)
    assert first["gains"] == second["gains"]
    assert first["carried_mass"] == second["carried_mass"]
    assert second["m3"] == pytest.approx(398.0, abs=0.3)
    assert second["peak_driving_force_n"] / first["peak_driving_force_n"] == pytest.approx(0.8, abs=0.05)


def test_a_mass_that_is_none_cannot_be_planned() -> None:
    with pytest.raises(RigError, match="recoiling mass would be"):
        CampaignPlan(mass_steps={2: -400.0}).draw(load_rig("sled"), 2, seed=1, campaign_seed=1)


@pytest.mark.exhaustive
def test_the_cells_of_a_side_share_its_force() -> None:
    text = load_rig("sled").text
    second = text.split("[[channel]]")[1].replace("f_push", "f_push_2").replace("L101", "L103")
    rig = parse_rig(
        text.replace("[twin]", f"[[channel]]{second}\n[twin]\nshares = {{ f_push = 3.0 }}"), Path("two.toml")
    )
    scene = draw_scene(rig, 1, "1")
    assert scene.shares["f_push"] == pytest.approx(0.75)
    assert scene.shares["f_push_2"] == pytest.approx(0.25)
    assert scene.shares["f_brake"] == 1.0


@pytest.mark.exhaustive
def test_pressures_on_a_line_read_the_force_on_their_areas() -> None:
    rig = line_rig("breech_pressure", "brake_pressure", "recoil_acceleration", bore_area=0.002, brake_area=0.001)
    scene = draw_scene(with_settings(rig, EXACT), 1, "1")
    motion = scene.motion
    assert isinstance(motion, LineMotion)
    breech = scene.samples(rig.channel("breech_pressure"), motion.times_s)
    brake = scene.samples(rig.channel("brake_pressure"), motion.times_s)
    assert 1e6 * breech * 0.002 * 0.99 == pytest.approx(motion.driving_n, abs=1e-3)
    assert 1e6 * brake * 0.001 == pytest.approx(motion.resisting_n, abs=1e-3)


@pytest.mark.parametrize(
    ("settings", "problem"),
    [
        ({"unread.back_pressure_pa": 1e5}, "twin.unread.back_pressure_pa: a body on a line has nothing of the kind"),
        ({"readings.camera_on_ground": True}, "twin.readings.camera_on_ground: a body on a line has nothing"),
        ({"shares.f_pull": 1.0}, "twin.shares.f_pull: nothing of that name drives or resists"),
        ({"peak_pressure_pa": 1e8}, "twin.peak_pressure_pa"),
        ({"measures.x_sled": "carriage_rate"}, "twin.measures.x_sled: unknown role"),
        ({"begins_s": 2.0}, "twin.begins_s: the record must not begin"),
        ({"pre_trigger_s": 1.0}, "twin.pre_trigger_s: must be shorter"),
    ],
)
def test_what_a_line_has_not_is_a_fault(settings: dict[str, Any], problem: str) -> None:
    with pytest.raises(RigError) as caught:
        with_settings(load_rig("sled"), settings)
    assert problem in str(caught.value)


def test_a_level_line_on_which_nothing_drives_does_not_move() -> None:
    rig: Rig = line_rig("driving_force")
    with pytest.raises(RigError, match=r"twin\.push_n: nothing moves"):
        with_settings(rig, {"push_n": 0.0})


@pytest.mark.exhaustive
def test_strokes_of_half_a_minute_and_a_drop_of_a_millisecond_can_be_had() -> None:
    long = {"push_n": 0.0, "strokes": 20, "brake_from_m": -1.0, "ringing": 0.0, "sample_rate_hz": 1000.0}
    scene, motion = scene_of(duration_s=25.0, **long)
    assert motion.t_end_s > 23.0
    assert np.sum(np.diff(np.sign(motion.speed_m_s[::1000])) != 0) >= 15
    scene, motion = scene_of(
        sample_rate_hz=200e3, duration_s=0.01, pre_trigger_s=0.002, push_n=0.0, start_m_s=3.0, brake_n=0.0,
        brake_n_s_m=0.0, buffer_n_m=3e9, buffer_from_m=0.009, clock_offset_s=0.001,
    )  # fmt: skip
    contact = motion.times_s[motion.resisting_n > 0]
    assert np.ptp(contact) == pytest.approx(1.03e-3, abs=3e-5)
    assert scene.mechanism.m3 == 318.0
