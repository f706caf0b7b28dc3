"""Forces that no gauge reads: each is its equation along the motion, and the motion is that of all forces together."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.integrate import cumulative_simpson, solve_ivp
from scipy.signal import lsim

from recoil_acquisition.errors import RigError
from recoil_rigs.mechanism import model
from recoil_rigs.mechanism.model import Mechanism
from recoil_rigs.rig import load_rig, parse_rig
from recoil_rigs.twin import read_settings
from recoil_rigs.twin.motion import Motion, breech_pressure, nominal_recoil_of, simulate_motion
from recoil_rigs.twin.settings import TwinSettings
from recoil_rigs.twin.unread_forces import UnreadForces, gaussian, matern, random_curve

SHORT = TwinSettings(duration_s=0.16, sample_rate_hz=20e3)
PEAK_PA, FRICTION_N = 130e6, 1500.0
EXIT = {"projectile_mass_kg": 12.0, "bore_length_m": 1.6}


@cache
def mechanism() -> Mechanism:
    return load_rig("field-2013").mechanism


@cache
def moved(tube_modes: int = 0, **unread: float) -> Motion:
    settings = SHORT.model_copy(update={"unread": UnreadForces(**unread), "tube_modes": tube_modes})
    return simulate_motion(mechanism(), settings, peak_pressure_pa=PEAK_PA, friction_n=FRICTION_N)


def forces(m: Mechanism, motion: Motion) -> np.ndarray:
    drive = m.bore_area * (1.0 - m.bore_friction) * motion.breech_pressure_pa - motion.breech_drag_n
    return model.generalized_forces(
        m, motion.q, drive, motion.resistance_n(m), motion.elevating_moment_n_m,
        motion.ground_x_n, motion.ground_y_n, motion.ground_d_n, motion.ground_friction_n,
    )  # fmt: skip


def brake(motion: Motion) -> np.ndarray:
    return mechanism().brake_area * motion.brake_pressure_pa


def recuperator(motion: Motion) -> np.ndarray:
    return mechanism().recuperator_area * motion.recuperator_pressure_pa


def way(motion: Motion) -> np.ndarray:
    return np.tanh(motion.qd[:, 4] / 0.02)


def x(motion: Motion) -> np.ndarray:
    return motion.q[:, 4]


def v(motion: Motion) -> np.ndarray:
    return motion.qd[:, 4]


def since(motion: Motion) -> np.ndarray:
    return motion.times_s - motion.t_fire_s


WRITTEN: list[tuple[dict[str, float], Callable[[Motion], np.ndarray]]] = [
    ({"packing_share": 0.02}, lambda m: 0.02 * way(m) * (brake(m) + recuperator(m))),
    (
        {"back_pressure_pa": -1e5},
        lambda m: np.where(v(m) > 0, 1e5 * 0.0056 * way(m) * (1 - np.exp(-np.maximum(x(m), 0) / 0.03)), 0.0),
    ),
    ({"slide_n_s_m": 150.0}, lambda m: 150.0 * v(m)),
    ({"rod_share": 0.04}, lambda m: 0.04 * brake(m) * x(m) / 0.9),
    ({"floating_piston_pa": 1e5}, lambda m: 780.0 * way(m)),
    ({"carried_oil_kg": 10.0}, lambda m: 10.0 * m.qdd[:, 4]),
    (
        {"breakaway": 2.0},
        lambda m: 3e3 * np.exp(-((v(m) / 0.3) ** 2)) * way(m) * -np.expm1(-np.maximum(x(m), 0.0) / 3e-4),
    ),
    ({"friction_by_speed": 0.3, "friction_speed_m_s": 2.0}, lambda m: 450.0 * np.exp(-np.abs(v(m)) / 2.0) * way(m)),
    ({"stiffening_n": 700.0}, lambda m: 700.0 * np.clip((x(m) / 0.9 - 0.6) / 0.4, 0.0, None) * way(m)),
    ({"bump_n": 900.0}, lambda m: 900.0 * np.exp(-(((x(m) - 0.4) / 0.03) ** 2)) * way(m)),
    ({"stick_n": 800.0}, lambda m: 800.0 * np.exp(-since(m) / 0.05) * way(m)),
    ({"swing_n": 400.0}, lambda m: 400.0 * np.sin(2 * math.pi * 7.0 * since(m)) * way(m)),
]


@pytest.mark.exhaustive
@pytest.mark.parametrize(("unread", "written"), WRITTEN, ids=[next(iter(one)) for one, _ in WRITTEN])
def test_a_force_is_its_equation_along_the_motion_and_moves_the_part(
    unread: dict[str, float], written: Callable[[Motion], np.ndarray]
) -> None:
    motion, still = moved(**unread), moved()
    expected = written(motion)
    assert np.abs(expected).max() > 100.0
    np.testing.assert_allclose(motion.unread_n, expected, atol=1e-9 * np.abs(expected).max())
    np.testing.assert_allclose(
        motion.qdd,
        model.accelerations(mechanism(), motion.q, motion.qd, forces(mechanism(), motion)),
        rtol=1e-8,
        atol=1e-8,
    )
    # the speed that it takes off, by its impulse: the rest of the mechanism gives a little
    early = since(motion) < 0.03
    impulse = np.trapezoid(expected[early], dx=motion.times_s[1])
    lost = mechanism().m3 * (still.qd[early][-1, 4] - motion.qd[early][-1, 4])
    softer = np.trapezoid((brake(still) - brake(motion) + recuperator(still) - recuperator(motion))[early],
                          dx=motion.times_s[1])  # fmt: skip
    assert lost == pytest.approx(impulse - softer, rel=0.2, abs=2.0)


ALL: dict[str, Any] = {key: value for unread, _ in WRITTEN for key, value in unread.items()} | {
    "friction_by_place": 0.3, "rough_share": 0.01, "latent_share": 0.002, "bore_drag": 0.015, "muzzle_brake": 0.3,
    **EXIT,
}  # fmt: skip


@pytest.mark.exhaustive
def test_the_work_of_all_forces_together_is_the_change_of_energy_with_that_of_the_oil() -> None:
    m, motion = mechanism(), moved(**ALL)
    oil_kg = ALL["carried_oil_kg"]
    power = np.sum(forces(m, motion) * motion.qd, axis=1) + oil_kg * motion.qdd[:, 4] * motion.qd[:, 4]
    work = cumulative_simpson(power, dx=motion.times_s[1], initial=0.0)
    energy = model.kinetic_energy(m, motion.q, motion.qd) + model.potential_energy(m, motion.q)
    energy = energy + 0.5 * oil_kg * motion.qd[:, 4] ** 2
    np.testing.assert_allclose(energy - energy[0], work, atol=5e-5 * np.ptp(energy))  # the force jumps at the exit
    lost = cumulative_simpson(motion.unread_n * motion.qd[:, 4], dx=motion.times_s[1], initial=0.0)
    assert lost[-1] > 500.0


@pytest.mark.exhaustive
@pytest.mark.parametrize(("hz", "damping"), [(12.0, 0.1), (35.0, 0.4)])
def test_a_part_that_hangs_resists_by_how_it_moves_otherwise_than_the_rest(hz: float, damping: float) -> None:
    motion, w = moved(hanging_kg=10.0, hanging_hz=hz, hanging_damping=damping), 2.0 * math.pi * hz
    a = motion.qdd[:, 4]
    _, z_m_s2, _ = lsim(([-1.0, 0.0, 0.0], [1.0, 2 * damping * w, w**2]), a, motion.times_s)
    np.testing.assert_allclose(motion.unread_n, 10.0 * z_m_s2, atol=0.03 * 10.0 * np.abs(a).max())
    # and the whole of it goes along with a motion that is slow against its swing
    late = moved(hanging_kg=10.0, hanging_hz=2000.0, hanging_damping=0.5)
    assert np.abs(late.unread_n).max() < 0.1 * np.abs(motion.unread_n).max()


@pytest.mark.exhaustive
def test_oil_that_is_carried_along_a_tube_that_bends_is_an_inertia_of_the_travel() -> None:
    oil, none = moved(2, carried_oil_kg=10.0), moved(2)
    early = since(oil) < 0.004
    ratio = np.trapezoid(none.qdd[early, 4]) / np.trapezoid(oil.qdd[early, 4])
    # the breech force alone acts at first, and the whole mechanism gives way
    m = mechanism()
    inertia_kg = m.m3 * (1.0 - m.m3 / (m.m1 + m.m2 + m.m3))
    assert ratio - 1.0 == pytest.approx(10.0 / inertia_kg, rel=0.1)


def test_nothing_moves_before_the_shot_whatever_is_unread() -> None:
    motion = moved(**ALL)
    before = motion.times_s < motion.t_fire_s
    assert not motion.q[before].any()
    assert np.abs(motion.qdd[before]).max() < 1e-9
    assert np.abs(motion.unread_n[before]).max() < 1e-9


@cache
def projectile() -> tuple[float, Callable[[np.ndarray], np.ndarray]]:
    """Return the projectile's exit from the first rise on, and its travel, by another integration."""
    m = mechanism()

    def drive(t: float) -> float:
        return 0.99 * m.bore_area * float(pulse(t))

    scale = PEAK_PA / max(float(shape(t)) for t in np.linspace(0, 0.01, 20001))

    def pulse(t: float) -> float:
        return scale * shape(t)

    def leaves(_: float, y: np.ndarray) -> float:
        return float(y[0]) - EXIT["bore_length_m"]

    leaves.terminal = True  # type: ignore[attr-defined]
    found = solve_ivp(lambda t, y: [y[1], drive(t) / EXIT["projectile_mass_kg"]], (0.0, 0.05), [0.0, 0.0], rtol=1e-9,
                      atol=1e-12, events=leaves, dense_output=True, max_step=1e-4)  # fmt: skip
    return float(found.t_events[0][0]), lambda t: found.sol(t)[0]


def shape(t: float) -> float:
    return -math.expm1(-((t / 1.5e-3) ** 3)) * math.exp(-t / 5.5e-3)


@pytest.mark.exhaustive
def test_drag_in_the_bore_ends_with_the_exit_and_a_muzzle_brake_begins_there() -> None:
    exit_s, travel = projectile()
    assert 0.003 < exit_s < 0.012
    m = mechanism()
    motion = moved(bore_drag=0.015, muzzle_brake=0.3, **EXIT)
    assert motion.t_exit_s - motion.t_fire_s == pytest.approx(exit_s, abs=2e-6)
    drive, t = m.bore_area * 0.99 * motion.breech_pressure_pa, since(motion)
    inside, behind = (t > 0) & (t < exit_s - 1e-5), t > exit_s + 1e-5
    k = 0.015 * (1 + 2 * np.exp(-((travel(t[inside]) / 0.02) ** 2)))
    np.testing.assert_allclose(motion.breech_drag_n[inside], k * drive[inside], rtol=1e-3)
    held = 0.3 * drive[behind] * (1 - np.exp(-(t[behind] - exit_s) / 3e-4))
    np.testing.assert_allclose(motion.breech_drag_n[behind], held, atol=3e-3 * held.max())
    expected = model.accelerations(m, motion.q, motion.qd, forces(m, motion))
    np.testing.assert_allclose(motion.qdd, expected, rtol=1e-8, atol=1e-8)
    assert not motion.unread_n.any()


@pytest.mark.exhaustive
def test_gas_leaves_after_the_exit_and_takes_no_momentum_from_the_rest() -> None:
    exit_s, _ = projectile()
    motion, m = moved(leaving_gas_kg=6.0, **EXIT), mechanism()
    t = since(motion)
    gone = np.where(t > exit_s, 6.0 * (1 - np.exp(-(t - exit_s) / 7e-3)), 0.0)
    np.testing.assert_allclose(motion.gas_kg, gone, atol=2e-3)
    force = forces(m, motion)
    for i in range(0, t.size, 53):
        lighter = dataclasses.replace(m, m3=m.m3 - motion.gas_kg[i])
        # what weighs less is in the weights, too: they are the model's own
        expected = model.accelerations(lighter, motion.q[i], motion.qd[i], of_mass(lighter, motion, i))
        np.testing.assert_allclose(motion.qdd[i], expected, rtol=1e-7, atol=1e-7)
    assert force.shape == (t.size, 5)
    integral = cumulative_simpson(motion.qdd[:, 4], dx=motion.times_s[1], initial=0.0)
    np.testing.assert_allclose(motion.qd[:, 4], integral, atol=1e-4 * np.abs(integral).max())


def of_mass(m: Mechanism, motion: Motion, i: int) -> np.ndarray:
    drive = m.bore_area * (1.0 - m.bore_friction) * motion.breech_pressure_pa[i]
    return model.generalized_forces(
        m, motion.q[i], drive, motion.resistance_n(m)[i], motion.elevating_moment_n_m[i],
        motion.ground_x_n[i], motion.ground_y_n[i], motion.ground_d_n[i], motion.ground_friction_n[i],
    )  # fmt: skip


@pytest.mark.exhaustive
@pytest.mark.parametrize(("key", "size"), [("rough_share", 0.01), ("latent_share", 0.01), ("friction_by_place", 0.3)])
def test_a_random_force_is_one_curve_over_the_travel_and_another_seed_another(key: str, size: float) -> None:
    one, same, other = (
        moved(**{key: size, "curves_seed": seed}, slide_n_s_m=slide) for seed, slide in ((3, 0.0), (3, 60.0), (4, 0.0))
    )
    recoils = (since(one) > 0.01) & (since(one) < 0.1)
    places = x(one)[recoils]
    found = [
        np.interp(places, x(m)[recoils], (m.unread_n - c * v(m))[recoils])
        for m, c in ((one, 0.0), (same, 60.0), (other, 0.0))
    ]
    # linear between places half a step apart: the table's own grain is finer
    assert np.abs(found[0] - found[1]).max() < 0.01 * np.ptp(found[0])
    assert np.abs(found[0] - found[2]).max() > 0.2 * np.ptp(found[0])
    largest = FRICTION_N if key == "friction_by_place" else nominal_recoil_of(mechanism(), SHORT).largest_force_n
    assert 0.1 < np.std(found[0]) / (size * largest) < 2.0


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    ("covariance", "written"),
    [
        (gaussian, lambda d: np.exp(-(d**2) / 2)),
        (matern, lambda d: (1 + math.sqrt(3) * d) * np.exp(-math.sqrt(3) * d)),
    ],
)
def test_random_curves_have_the_covariance_that_they_are_drawn_from(covariance, written) -> None:
    length, reach = 0.3, 1.2
    drawn = np.array([random_curve(covariance, length, reach, np.random.default_rng(k)) for k in range(1200)])
    places = np.linspace(0.0, reach, drawn.shape[1])
    chosen = np.searchsorted(places, [0.05, 0.3, 0.6, 1.1])
    found = np.cov(drawn[:, chosen], rowvar=False)
    at = places[chosen]
    np.testing.assert_allclose(found, written(np.abs(at[:, None] - at) / length), atol=0.1)
    assert np.abs(drawn[:, chosen].mean(axis=0)).max() < 0.1


@pytest.mark.exhaustive
def test_the_nominal_recoil_is_that_of_a_body_on_a_line() -> None:
    m, s = mechanism(), SHORT
    found = nominal_recoil_of(m, s)
    scale = s.peak_pressure_pa / max(shape(t) for t in np.linspace(0, 0.01, 20001))

    def slope(t: float, y: np.ndarray) -> list[float]:
        at, speed = y
        orifice = s.leak_m2 + s.orifice_m2 * math.sqrt(max(1 - at / s.stroke_m, 0.0))
        oil = 0.5 * s.oil_density_kg_m3 * (m.brake_area * speed / (s.discharge * orifice)) ** 2 * (speed > 0)
        gas = s.recuperator_pressure_pa * (1 - m.recuperator_area * at / s.recuperator_volume_m3) ** -s.polytropic
        force = 0.99 * m.bore_area * scale * shape(t) - m.brake_area * oil - m.recuperator_area * gas - m.friction
        force += m.m3 * m.g * math.sin(m.phi20)
        return [speed, max(force, 0.0) / m.m3 if at <= 0 and speed <= 0 else force / m.m3]

    exact = solve_ivp(
        slope, (0.0, found.times_s[-1]), [0.0, 0.0], rtol=1e-9, atol=1e-9, max_step=1e-4, t_eval=found.times_s
    )
    np.testing.assert_allclose(found.travel_m, exact.y[0], atol=1e-4)
    np.testing.assert_allclose(found.speed_m_s, exact.y[1], atol=1e-3)
    assert found.times_s[-1] == pytest.approx(0.2, abs=0.05)


def test_gas_that_would_be_all_of_the_mass_and_unknown_keys_are_refused() -> None:
    rig = load_rig("field-2013")
    for table, problem in (
        ("leaving_gas_kg = 790.0", "twin.unread.leaving_gas_kg: must be less than what else is left"),
        ("packing_shar = 0.1", "twin.unread.packing_shar: "),
        ("packing_share = 3.0", "twin.unread.packing_share: "),
    ):
        text = f"{rig.text}\n[twin.unread]\n{table}\n"
        with pytest.raises(RigError) as caught:
            read_settings(parse_rig(text, rig.path))
        assert problem in str(caught.value)
    with pytest.raises(ValueError, match="released_mass_kg must be less"):
        moved(leaving_gas_kg=800.0)


def test_the_pulse_of_these_tests_is_the_twins() -> None:
    times = np.linspace(0.0, 0.02, 401)
    scale = PEAK_PA / max(shape(t) for t in np.linspace(0, 0.01, 20001))
    np.testing.assert_allclose(
        breech_pressure(times, PEAK_PA, 1.5e-3, 5.5e-3), [scale * shape(t) for t in times], rtol=1e-6
    )
