"""A part of the recoiling mass that lets go in the middle of a shot: momentum, energy, the instant, the truth."""

from __future__ import annotations

import dataclasses
import hashlib
import struct
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import cumulative_simpson

from recoil_acquisition.errors import RigError
from recoil_rigs.mechanism import model
from recoil_rigs.mechanism.model import Mechanism
from recoil_rigs.rig import Rig, find_rig, load_rig, parse_rig
from recoil_rigs.twin import draw_scene, simulate_shot
from recoil_rigs.twin.instruments import truth
from recoil_rigs.twin.motion import Motion, simulate_motion
from recoil_rigs.twin.settings import TwinSettings
from tests.builders.naive_log import read_file

SETTINGS = TwinSettings(duration_s=0.13)
LOST_KG = 40.0
ON_GRID_S, OFF_GRID_S = 0.012, 0.0120083
"""After the first rise of force, on the grid of 50 kHz and between two of its instants."""


BEFORE = {
    "field-2013": {
        "0042_camera.csv": "dfbf8b81d04ba4da8a445a35399b3239",
        "0042_dewetron.csv": "948bf090da9d183054bbc04a075f33c2",
    },
    "mixed": {
        "0042_camera.csv": "bf140dba8bc80b2af8c572f615e8de64",
        "0042_dewetron.csv": "64beadef9fb17e8a7946d8572f26103f",
        "0042_imu.rdlog": "a1001ed06e1ba124226e1fcc3b47915c",
    },
}
"""Digests of files from before anything could let go or bend; they hold for these rigs' numbers."""


def rig_with(name: str, **settings: float) -> Rig:
    path = find_rig(name)
    head, _, tail = path.read_text(encoding="utf-8").partition("[twin]\n")
    head = head.replace("[mechanism]\n", "[mechanism]\nbore_friction = 0\nu_bore_friction = 0\n")
    lines = {line.partition("=")[0].strip(): line for line in tail.splitlines() if "=" in line}
    lines |= {key: f"{key} = {value}" for key, value in {"unread_errors": "false", **settings}.items()}
    return parse_rig("\n".join([f"{head}[twin]", *lines.values(), ""]), path)


@cache
def mechanism() -> Mechanism:
    return dataclasses.replace(load_rig("field-2013").mechanism, bore_friction=0.0)


@cache
def lighter() -> Mechanism:
    return dataclasses.replace(mechanism(), m3=mechanism().m3 - LOST_KG)


@cache
def motion(lost_kg: float = LOST_KG, after_s: float = ON_GRID_S, rate_hz: float = 50e3) -> Motion:
    settings = SETTINGS.model_copy(
        update={"released_mass_kg": lost_kg, "release_after_s": after_s, "sample_rate_hz": rate_hz}
    )
    return simulate_motion(mechanism(), settings, peak_pressure_pa=130e6, friction_n=1500.0)


def forces(m: Mechanism, found: Motion) -> np.ndarray:
    return model.generalized_forces(
        m, found.q, m.bore_area * found.breech_pressure_pa, found.resistance_n(m), found.elevating_moment_n_m,
        found.ground_x_n, found.ground_y_n, found.ground_d_n, found.ground_friction_n,
    )  # fmt: skip


def velocity_of_the_part(m: Mechanism, q: np.ndarray, qd: np.ndarray) -> np.ndarray:
    """Forward and up, by moving the centre of mass of the recoiling part along the drawing."""

    def place(state: np.ndarray) -> np.ndarray:
        phi1, phi2, lever = m.phi10 + state[2], m.phi20 + state[2] + state[3], m.b - state[4]
        forward = m.XA * np.cos(phi1) - m.YA * np.sin(phi1) + lever * np.cos(phi2) - m.d * np.sin(phi2)
        up = m.XA * np.sin(phi1) + m.YA * np.cos(phi1) + lever * np.sin(phi2) + m.d * np.cos(phi2)
        return np.array([state[0] + forward, state[1] + up])

    step = 1e-6
    return (place(q + step * qd) - place(q - step * qd)) / (2 * step)


@pytest.mark.parametrize("after_s", [ON_GRID_S, OFF_GRID_S])
def test_the_accelerations_are_those_of_the_whole_mass_before_and_of_the_rest_afterwards(after_s: float) -> None:
    found = motion(after_s=after_s)
    gone = found.times_s >= found.t_release_s
    assert found.t_release_s == pytest.approx(0.05 + after_s, abs=1e-12)
    for m, rows in ((mechanism(), ~gone), (lighter(), gone)):
        expected = model.accelerations(m, found.q, found.qd, forces(m, found))
        np.testing.assert_allclose(found.qdd[rows], expected[rows], rtol=1e-9, atol=1e-9)
        a = model.specific_acceleration(m, found.q, found.qd, found.qdd)[rows]
        balance = (m.bore_area * found.breech_pressure_pa - found.resistance_n(m))[rows]
        moving = found.times_s[rows] > 0.06
        np.testing.assert_allclose(m.m3 * a[moving], balance[moving], rtol=1e-8, atol=1e-4)


def test_the_rest_keeps_its_momentum_and_the_part_takes_its_own_along() -> None:
    found = motion()
    at = int(np.searchsorted(found.times_s, found.t_release_s))
    q, qd = found.q[at], found.qd[at]
    part = LOST_KG * velocity_of_the_part(mechanism(), q, qd)
    whole, rest = (model.momentum(m, q, qd) for m in (mechanism(), lighter()))
    assert np.linalg.norm(part) > 300.0
    np.testing.assert_allclose(rest + part, whole, rtol=1e-7)
    # no impulse: the velocity gains what the accelerations of the whole give it up to the instant, and the rest's after
    step = found.times_s[1]
    still_whole = model.accelerations(mechanism(), q, qd, forces(mechanism(), found)[at])
    assert abs(found.qdd[at, 4] - still_whole[4]) > 5.0
    up_to_it, from_it = found.qd[at] - found.qd[at - 1], found.qd[at + 1] - found.qd[at]
    small = 1e-7 * np.abs(found.qd[:, 4]).max()
    np.testing.assert_allclose(up_to_it, 0.5 * step * (found.qdd[at - 1] + still_whole), atol=small)
    np.testing.assert_allclose(from_it, 0.5 * step * (found.qdd[at] + found.qdd[at + 1]), atol=small)


def test_an_instant_between_two_samples_is_stepped_on_exactly() -> None:
    found = motion(after_s=OFF_GRID_S)
    after = int(np.searchsorted(found.times_s, found.t_release_s))
    before, step = after - 1, found.times_s[1]
    share = (found.t_release_s - found.times_s[before]) / step
    assert 0.1 < share < 0.9

    def towards(at: int, span_s: float) -> np.ndarray:
        slope = (
            (found.qdd[at] - found.qdd[at - 1]) / step if at == before else (found.qdd[at + 1] - found.qdd[at]) / step
        )
        return found.qd[at] + span_s * found.qdd[at] + 0.5 * span_s**2 * slope

    here, there = towards(before, share * step), towards(after, (share - 1) * step)
    np.testing.assert_allclose(here[4], there[4], atol=1e-7)
    # taken at the sample after or before, the velocity would have another jump in it
    assert abs(found.qdd[after, 4] - found.qdd[before, 4]) * 0.1 * step > 1e-5


@pytest.mark.exhaustive
def test_halving_the_step_does_not_move_the_instant() -> None:
    coarse, fine = motion(after_s=OFF_GRID_S), motion(after_s=OFF_GRID_S, rate_hz=100e3)
    np.testing.assert_allclose(coarse.qd, fine.qd[::2], atol=1e-4)
    np.testing.assert_allclose(coarse.q, fine.q[::2], atol=1e-6)
    assert coarse.t_release_s == pytest.approx(fine.t_release_s, abs=1e-15)


def test_work_of_the_loads_is_the_change_of_energy_of_the_rest_and_of_the_part_together() -> None:
    found, m = motion(), mechanism()
    at = int(np.searchsorted(found.times_s, found.t_release_s))
    step = found.times_s[1]
    scale = 1e-6

    def energy(body: Mechanism, rows: slice | int) -> np.ndarray:
        q, qd = found.q[rows], found.qd[rows]
        return model.kinetic_energy(body, q, qd) + model.potential_energy(body, q)

    power = np.sum(forces(m, found) * found.qd, axis=1)
    work = cumulative_simpson(power[: at + 1], dx=step, initial=0.0)
    whole = energy(m, slice(0, at + 1))
    np.testing.assert_allclose(whole - whole[0], work, atol=scale * np.ptp(whole))
    speed = velocity_of_the_part(m, found.q[at], found.qd[at])
    part = 0.5 * LOST_KG * speed @ speed
    taken_along = part + model.potential_energy(m, found.q[at]) - model.potential_energy(lighter(), found.q[at])
    assert part > 1e3
    assert energy(m, at) - energy(lighter(), at) == pytest.approx(taken_along, rel=1e-7)
    power = np.sum(forces(lighter(), found)[at:] * found.qd[at:], axis=1)
    rest = energy(lighter(), slice(at, None))
    work = cumulative_simpson(power, dx=step, initial=0.0)
    np.testing.assert_allclose(rest - rest[0], work, atol=scale * np.ptp(rest))


@pytest.mark.exhaustive
def test_a_lighter_part_recoils_farther_and_a_release_too_late_changes_nothing() -> None:
    none = motion(0.0)
    assert none.released_kg == 0.0
    assert np.isnan(none.t_release_s)
    found = motion()
    before = found.times_s <= found.t_release_s
    np.testing.assert_array_equal(found.q[before], none.q[before])
    assert not np.array_equal(found.q, none.q)
    late = simulate_motion(
        mechanism(),
        SETTINGS.model_copy(update={"released_mass_kg": LOST_KG, "release_after_s": 5.0}),
        peak_pressure_pa=130e6,
        friction_n=1500.0,
    )
    np.testing.assert_array_equal(late.q, none.q)


def test_all_of_the_mass_cannot_let_go() -> None:
    with pytest.raises(ValueError, match="released_mass_kg must be less"):
        motion(782.0)


@pytest.mark.exhaustive
def test_the_sensors_feel_the_rest_and_the_truth_states_it(tmp_path: Path) -> None:
    settings = {"sample_rate_hz": 20e3, "duration_s": 0.3, "released_mass_kg": LOST_KG, "release_after_s": 0.03}
    rig = rig_with("field-2013", **settings)
    scene = draw_scene(rig, 4, "s1")
    found = scene.motion
    felt = truth("recoil_acceleration", scene.mechanism, found, (0.0, 0.0))
    force = scene.mechanism.bore_area * found.breech_pressure_pa - found.resistance_n(scene.mechanism)
    moving = (found.times_s > found.t_fire_s + 0.01) & (found.times_s < found.t_end_s)
    mass_kg = np.where(found.times_s >= found.t_release_s, 742.0, 782.0)
    np.testing.assert_allclose((force / felt)[moving], mass_kg[moving], rtol=1e-6)
    told = simulate_shot(rig, tmp_path / "a", seed=4, shot="s1").truth
    assert (told["m3"], told["m3_after"]) == (782.0, 742.0)
    assert told["t_release"] == pytest.approx(told["t_fire"] + 0.03)
    plain = simulate_shot(rig_with("field-2013", sample_rate_hz=20e3, duration_s=0.3), tmp_path / "b", seed=4, shot="s")
    assert not {"m3_after", "t_release"} & set(plain.truth)


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    ("settings", "problem"),
    [
        ({"released_mass_kg": 782.0}, "twin.released_mass_kg: must be less than the recoiling mass, 782 kg"),
        ({"released_mass_kg": -1.0}, "twin.released_mass_kg: "),
        ({"released_mass_kg": 7.0, "release_after_s": 0.0}, "twin.release_after_s: "),
        ({"released_mass_kg": 7.0, "release_after_s": 0.22}, "twin.release_after_s: the recoil ends 0.1"),
    ],
)
def test_a_release_that_cannot_be_is_refused_with_its_key(settings: dict[str, float], problem: str) -> None:
    with pytest.raises(RigError) as caught:
        draw_scene(rig_with("field-2013", sample_rate_hz=20e3, duration_s=0.3, **settings), 1, "s1")
    assert problem in str(caught.value)


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", list(BEFORE))
def test_where_nothing_lets_go_or_bends_or_wanders_shots_are_what_they_were_before_anything_could(
    tmp_path: Path, name: str
) -> None:
    rig = rig_with(name, sample_rate_hz=20e3, duration_s=0.3, tube_modes=0, wander=0.0)
    still = rig.text.replace("u_zero_rel = 0.001, ", "").replace(", u_distortion_m = 1e-4", "")
    still = still.replace('serial = "V301",', 'calibration = "dynamic", serial = "V301",')
    rig = parse_rig(still, rig.path)
    simulate_shot(rig, tmp_path / "a", seed=11, shot="0042")
    for file, digest in BEFORE[name].items():
        assert hashlib.sha256(content_of(tmp_path / "a" / file)).hexdigest()[:32] == digest, file


def content_of(path: Path) -> bytes:
    """Return what a file holds: of a capture its reads, each with its host time and length, without the log's heads."""
    if path.suffix != ".rdlog":
        return path.read_bytes()
    reads = [one for one in read_file(path) if one.source == 0]
    return b"".join(struct.pack("<qI", one.host_ns, len(one.payload)) + one.payload for one in reads)
