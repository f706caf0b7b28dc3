"""A virtual body on a line moves as an independent integration, and as what can be written down, say."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from recoil_rigs.mechanism.line import Line
from recoil_rigs.mechanism.model import Mechanism
from recoil_rigs.twin.line_motion import LineMotion, reference_travel, simulate_line
from recoil_rigs.twin.line_settings import LineSettings

SLED = Line(m3=300.0, phi20=0.0, friction=60.0)
NO_BRAKE = {"brake_n": 0.0, "brake_n_s_m": 0.0, "ringing": 0.0}


def moved(mechanism: Mechanism = SLED, friction_n: float = 0.0, **settings: Any) -> LineMotion:
    return simulate_line(mechanism, LineSettings(**settings), moved_kg=mechanism.m3, friction_n=friction_n, reach_m=1.0)


def test_an_integrator_of_scipy_gives_the_same_push_and_brake() -> None:
    chosen = {"push_n": 12e3, "brake_from_m": 0.05, "ringing": 0.0, "duration_s": 0.45, "sample_rate_hz": 20e3}
    s, m = LineSettings(**chosen), replace(SLED, phi20=0.1)
    found = moved(m, 0.0, **chosen)

    def rates(t: float, y: np.ndarray) -> list[float]:
        x, v = y
        since = (t - s.pre_trigger_s) / s.push_s
        drive = s.push_n * math.sin(math.pi * since) ** 2 if 0 < since < 1 else 0.0
        share = min(max((x - s.brake_from_m) / s.brake_over_m, 0.0), 1.0)
        brake = share * (s.brake_n * math.tanh(v / 0.02) + s.brake_n_s_m * v)
        return [v, (drive - brake) / m.m3 - m.g * math.sin(m.phi20)]

    at = found.times_s[found.times_s >= s.pre_trigger_s]
    expected = solve_ivp(rates, (at[0], at[-1]), [0.0, 0.0], t_eval=at, method="DOP853", rtol=1e-10, atol=1e-12)
    behind = found.times_s >= s.pre_trigger_s
    assert np.max(np.abs(found.travel_m[behind] - expected.y[0])) < 1e-7
    assert np.max(np.abs(found.speed_m_s[behind] - expected.y[1])) < 1e-5


def test_a_drop_on_a_spring_is_half_a_sine_of_one_millisecond() -> None:
    contact_s, speed = 1e-3, 3.0
    stiffness = SLED.m3 * (math.pi / contact_s) ** 2
    found = moved(
        sample_rate_hz=200e3, duration_s=0.012, pre_trigger_s=0.0, start_m_s=speed, push_n=0.0, buffer_n_m=stiffness,
        buffer_from_m=0.015, **NO_BRAKE,
    )  # fmt: skip
    pushes = found.times_s[found.resisting_n > 0]
    assert pushes[-1] - pushes[0] == pytest.approx(contact_s, abs=2e-5)
    assert pushes[0] == pytest.approx(0.005, abs=1e-5)
    assert found.resisting_n.max() == pytest.approx(speed * math.sqrt(stiffness * SLED.m3), rel=1e-3)
    assert found.speed_m_s[-1] == pytest.approx(-speed, rel=1e-4)


def test_what_falls_falls_and_an_accelerometer_feels_nothing() -> None:
    falls = replace(SLED, phi20=-math.pi / 2)
    found = moved(falls, push_n=0.0, pre_trigger_s=0.0, duration_s=0.3, **NO_BRAKE)
    assert found.travel_m[-1] == pytest.approx(0.5 * falls.g * found.times_s[-1] ** 2, rel=1e-9)
    assert np.max(np.abs(found.specific_m_s2)) < 1e-9


def test_a_latch_holds_and_the_accelerometer_feels_gravity_along_the_line() -> None:
    found = moved(replace(SLED, phi20=0.2), push_n=20e3, **NO_BRAKE)
    rests = found.times_s < 0.0499
    assert not found.travel_m[rests].any()
    assert found.specific_m_s2[rests] == pytest.approx(SLED.g * math.sin(0.2))


@pytest.mark.exhaustive
def test_friction_takes_what_the_motion_loses() -> None:
    found = moved(friction_n=90.0, push_n=0.0, start_m_s=0.4, pre_trigger_s=0.0, duration_s=2.5, **NO_BRAKE)
    stopped = 0.5 * SLED.m3 * 0.4**2 / 90.0
    assert found.travel_m[-1] == pytest.approx(stopped, rel=1e-3)
    assert np.ptp(found.travel_m[-1000:]) < 1e-9
    assert np.max(np.abs(found.acceleration_m_s2[-1000:])) < 1e-6


def test_strokes_go_to_and_fro_with_a_rest_between() -> None:
    chosen = {"push_n": 0.0, "strokes": 3, "stroke_m": 0.3, "stroke_s": 0.8, "pause_s": 0.3, "duration_s": 3.4}
    found = moved(friction_n=60.0, sample_rate_hz=1e3, **chosen, **NO_BRAKE)
    at = {ends_s: float(np.interp(ends_s, found.times_s, found.travel_m)) for ends_s in (1.0, 2.1, 3.2)}
    assert list(at.values()) == pytest.approx([0.3, 0.0, 0.3], abs=2e-3)
    assert found.speed_m_s.max() == pytest.approx(1.875 * 0.3 / 0.8, rel=0.02)
    assert found.speed_m_s.min() == pytest.approx(-1.875 * 0.3 / 0.8, rel=0.02)
    residual = found.driving_n - found.resisting_n - found.friction_n - SLED.m3 * found.acceleration_m_s2
    assert np.max(np.abs(residual)) < 1e-6


@pytest.mark.parametrize("n", [0, 1])
def test_what_the_servo_follows_is_smooth(n: int) -> None:
    times_s = np.linspace(0.0, 3.0, 30_001)
    curves = reference_travel(LineSettings(strokes=2), times_s)
    assert np.gradient(curves[n], times_s)[2:-2] == pytest.approx(curves[n + 1][2:-2], abs=2e-3)


@pytest.mark.exhaustive
def test_a_record_may_begin_in_the_motion() -> None:
    chosen = {"push_n": 0.0, "strokes": 6, "ringing": 0.0, "sample_rate_hz": 1e3}
    whole, part = moved(duration_s=5.0, **chosen), moved(duration_s=3.0, begins_s=1.5, **chosen)
    assert part.times_s[0] == 0.0
    assert part.t_fire_s == pytest.approx(-1.45)
    later = np.interp(part.times_s + 1.5, whole.times_s, whole.travel_m)
    assert part.travel_m == pytest.approx(later, abs=1e-9)


def test_the_mass_of_grams_moves() -> None:
    light = replace(SLED, m3=0.002, friction=0.001)
    found = moved(light, 0.001, push_n=0.5, **NO_BRAKE)
    assert found.speed_m_s.max() == pytest.approx(0.5 * 0.5 * 0.08 / 0.002, rel=0.01)


@pytest.mark.parametrize(("moved_kg", "friction_n"), [(0.0, 1.0), (1.0, -1.0), (math.nan, 1.0)])
def test_what_is_no_mass_or_no_friction_is_refused(moved_kg: float, friction_n: float) -> None:
    with pytest.raises(ValueError, match="must"):
        simulate_line(SLED, LineSettings(), moved_kg=moved_kg, friction_n=friction_n, reach_m=1.0)


@pytest.mark.exhaustive
def test_every_form_of_force_by_place_acts(recwarn: pytest.WarningsRecorder) -> None:
    del recwarn
    forces: dict[str, Callable[[], dict[str, float]]] = {
        "slide_n_s_m": lambda: {"slide_n_s_m": 50.0},
        "latent": lambda: {"latent_share": 0.05, "largest_force_n": 2000.0},
        "bump": lambda: {"bump_n": 100.0, "bump_place_m": 0.1},
        "packing": lambda: {"packing_share": 0.05},
    }
    plain = moved(friction_n=60.0)
    for name, force in forces.items():
        found = moved(friction_n=60.0, unread=force())
        assert np.max(np.abs(found.unread_n)) > 1.0, name
        assert found.travel_m[-1] != plain.travel_m[-1]
