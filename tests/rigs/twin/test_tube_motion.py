"""A shot with a flexible tube: equations, energy, rest, the rigid limit, and what the sensors and the truth say."""

from __future__ import annotations

import dataclasses
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import cumulative_simpson

from recoil_acquisition.errors import RigError
from recoil_rigs.mechanism import flexible_tube as flexible
from recoil_rigs.mechanism import model as rigid
from recoil_rigs.mechanism.flexible_tube import FlexibleTube
from recoil_rigs.mechanism.model import Mechanism
from recoil_rigs.rig import Rig, find_rig, load_rig, parse_rig
from recoil_rigs.twin import draw_scene, simulate_shot
from recoil_rigs.twin.instruments import truth
from recoil_rigs.twin.motion import Motion, simulate_motion, tube_of
from recoil_rigs.twin.settings import TwinSettings
from tests.builders.bore_correction import bore_correction

SETTINGS = TwinSettings(duration_s=0.12, tube_modes=2, sample_rate_hz=40e3)


@cache
def shot(**changed: float) -> tuple[Mechanism, FlexibleTube, Motion]:
    mechanism = dataclasses.replace(load_rig("field-2013").mechanism, bore_friction=0.0)
    settings = SETTINGS.model_copy(update=changed)
    motion = simulate_motion(mechanism, settings, peak_pressure_pa=130e6, friction_n=1500.0)
    tube = tube_of(mechanism, settings)
    assert tube is not None
    return mechanism, tube, motion


def states(motion: Motion) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return (
        np.hstack([motion.q, motion.modal]),
        np.hstack([motion.qd, motion.modal_rate]),
        np.hstack([motion.qdd, motion.modal_acceleration]),
    )


def forces(m: Mechanism, motion: Motion) -> np.ndarray:
    return rigid.generalized_forces(
        m, motion.q, m.bore_area * motion.breech_pressure_pa, motion.resistance_n(m), motion.elevating_moment_n_m,
        motion.ground_x_n, motion.ground_y_n, motion.ground_d_n, motion.ground_friction_n,
    )  # fmt: skip


def rig_with(**settings: float) -> Rig:
    path = find_rig("field-2013")
    head, _, tail = path.read_text(encoding="utf-8").partition("[twin]\n")
    lines = {line.partition("=")[0].strip(): line for line in tail.splitlines() if "=" in line}
    lines |= {key: f"{key} = {value}" for key, value in settings.items()}
    return parse_rig("\n".join([f"{head}[twin]", *lines.values(), ""]), path)


@pytest.mark.exhaustive
@pytest.mark.parametrize("modes", [1, 2])
def test_the_accelerations_are_those_of_the_model_under_the_recorded_loads(modes: int) -> None:
    m, tube, motion = shot(tube_modes=modes)
    q, qd, qdd = states(motion)
    assert q.shape[1] == 5 + modes
    expected = flexible.accelerations(m, tube, q, qd, forces(m, motion))
    np.testing.assert_allclose(qdd, expected, rtol=1e-8, atol=1e-7)


@pytest.mark.exhaustive
def test_work_of_the_loads_less_that_of_the_damping_is_the_change_of_energy() -> None:
    m, tube, motion = shot()
    q, qd, _ = states(motion)
    power = np.sum(forces(m, motion) * motion.qd, axis=1) - np.sum(tube.damping_n_s_m * motion.modal_rate**2, axis=1)
    work = cumulative_simpson(power, dx=motion.times_s[1], initial=0.0)
    energy = flexible.kinetic_energy(m, tube, q, qd) + flexible.potential_energy(m, tube, q)
    np.testing.assert_allclose(energy - energy[0], work, atol=2e-6 * np.ptp(energy))


def test_the_tube_hangs_still_before_the_shot_and_swings_after_it() -> None:
    m, tube, motion = shot()
    before = motion.times_s < motion.t_fire_s
    np.testing.assert_array_equal(motion.modal[before], np.broadcast_to(flexible.sag(m, tube)[0], (before.sum(), 2)))
    assert not motion.q[before].any()
    _, _, qdd = states(motion)
    assert np.abs(qdd[before]).max() < 1e-8
    assert np.ptp(motion.modal[:, 0]) > 1e-3
    assert np.ptp(motion.modal[:, 1]) < 0.3 * np.ptp(motion.modal[:, 0])


@pytest.mark.exhaustive
def test_a_very_stiff_tube_is_a_rigid_one() -> None:
    # the sample rate resolves its vibration: 16 Hz times the root of the stiffness' ratio
    m, _, stiff = shot(tube_bending_stiffness_n_m2=2e10, tube_modes=1)
    plain = simulate_motion(m, SETTINGS.model_copy(update={"tube_modes": 0}), peak_pressure_pa=130e6, friction_n=1500.0)
    _, _, soft = shot()
    moved = np.abs(plain.q).max(axis=0)
    assert np.all(np.abs(stiff.q - plain.q).max(axis=0) < 1e-4 * moved)
    assert np.all(np.abs(soft.q - plain.q).max(axis=0)[2:4] > 1e-3 * moved[2:4])
    assert plain.modal.shape == (plain.times_s.size, 0)


def test_the_accelerometer_feels_the_force_and_the_correction_of_the_identification_equation() -> None:
    m, tube, motion = shot()
    felt = truth("recoil_acceleration", m, motion, (0.0, 0.0))
    force = m.bore_area * motion.breech_pressure_pa - motion.resistance_n(m)
    correction = bore_correction(tube, *states(motion))
    np.testing.assert_allclose(m.m3 * felt, force + correction, atol=1e-9 * np.abs(force).max())
    assert 1.0 < np.abs(correction).max() < 1e-2 * np.abs(force).max()


@pytest.mark.exhaustive
def test_a_part_may_let_go_of_a_mechanism_that_bends() -> None:
    m, tube, motion = shot(released_mass_kg=30.0, release_after_s=0.0212341)
    q, qd, qdd = states(motion)
    gone = motion.times_s >= motion.t_release_s
    lighter = dataclasses.replace(m, m3=m.m3 - 30.0)
    expected = flexible.accelerations(lighter, tube, q[gone], qd[gone], forces(lighter, motion)[gone])
    np.testing.assert_allclose(qdd[gone], expected, rtol=1e-8, atol=1e-7)


@pytest.mark.exhaustive
def test_the_truth_says_how_the_tube_bends(tmp_path: Path) -> None:
    rig = rig_with(sample_rate_hz=20e3, duration_s=0.3, tube_modes=1)
    told = simulate_shot(rig, tmp_path / "a", seed=2, shot="s1").truth["tube"]
    np.testing.assert_allclose(told["clamped_frequencies_hz"], [15.83], rtol=1e-3)
    assert 0.001 < told["sag_m"] < 0.003
    assert 0.001 < told["largest_deflection_m"] < 0.2


@pytest.mark.parametrize(
    ("settings", "problem"),
    [
        ({"tube_modes": 3}, "twin.tube_modes: "),
        ({"tube_modes": 1, "tube_mass_kg": 800.0}, "twin.tube_mass_kg: must be less than the recoiling mass of 782 kg"),
        ({"tube_modes": 1, "tube_length_m": 4.0}, "twin.tube_length_m: such a tube alone would give"),
        ({"tube_modes": 1, "tube_bending_stiffness_n_m2": 0.0}, "twin.tube_bending_stiffness_n_m2: "),
    ],
)
def test_a_tube_that_cannot_be_is_refused_with_its_key(settings: dict[str, float], problem: str) -> None:
    with pytest.raises(RigError) as caught:
        draw_scene(rig_with(**settings), 1, "s1")
    assert problem in str(caught.value)
