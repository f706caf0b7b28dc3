"""Readings that are not what the rig file takes them for: each is its equation, and reaches the recorded samples."""

from __future__ import annotations

import dataclasses
import math
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lsim
from scipy.stats import kstest

from recoil_rigs.mechanism.model import specific_acceleration
from recoil_rigs.rig import Rig, parse_rig
from recoil_rigs.twin import draw_scene, simulate_shot, with_settings
from recoil_rigs.twin.draws import NOISE_OF_MOTION, REST_NOISE, draw_noise
from recoil_rigs.twin.readings import Readings
from recoil_rigs.twin.sensor_reading import handed_on, lagged, low_pass, ringing
from recoil_rigs.twin.settings import TwinSettings
from recoil_rigs.twin.sources import Scene
from tests.builders.virtual_shots import with_twin

RATE_HZ, STEP_S = 40e3, 25e-6
QUIET = {
    "sample_rate_hz": RATE_HZ, "duration_s": 0.3, "gain_errors": False, "friction_error": False, "ringing": 0.0,
    "noise": 0.0, "bias": 0.0, "bits": 0, "camera_noise_m": 0.0, "shot_to_shot": 0.0, "camera_lost": 0,
    "camera_missing": 0, "camera_repeated": 0,
}  # fmt: skip


@cache
def clean() -> Rig:
    rig = with_twin("field-2013", **QUIET)
    return parse_rig(rig.text.replace("time_constant_s = 10.0, ", ""), rig.path)


@cache
def scene(**readings: float) -> Scene:
    """Return one shot with other readings; the motion is that of all of them."""
    if not readings:
        return draw_scene(clean(), 7, "s")
    plain = scene()
    settings = plain.settings.model_copy(update={"readings": Readings(**readings)})
    return dataclasses.replace(plain, settings=settings, moves={}, gains={}, offsets={}, late={})


def read(name: str, **readings: float) -> np.ndarray:
    """Return what a channel's recorder has on the grid of the motion, SI."""
    one = scene(**readings)
    factor = 1e6 if name.startswith("p_") else 1.0
    return factor * one.samples(one.rig.channel(name), one.motion.times_s)


def seen(**readings: float) -> np.ndarray:
    one = scene(**readings)
    return one.seen("recoil_displacement", one.rig.channel("x_camera"), one.motion.times_s)


def behind(numerator: list[float], denominator: list[float], signal: np.ndarray) -> np.ndarray:
    """Pass a signal through a system, settled at its start, by another method than the twin's."""
    times = STEP_S * np.arange(signal.size)
    return np.asarray(lsim((numerator, denominator), signal - signal[0], times)[1])


def second_order(hz: float, damping: float) -> tuple[float, list[float]]:
    w = 2 * math.pi * hz
    return w * w, [1.0, 2 * damping * w, w * w]


def test_filters_are_those_of_their_transfer_functions() -> None:
    signal = np.exp(-(((np.arange(4000) * STEP_S - 0.03) / 2e-3) ** 2)) + 2.0
    w2, denominator = second_order(150.0, 0.2)
    close = {"atol": 2e-3}
    np.testing.assert_allclose(low_pass(signal, STEP_S, 150.0, 0.2), 2.0 + behind([w2], denominator, signal), **close)
    np.testing.assert_allclose(
        ringing(signal, STEP_S, 150.0, 0.2), behind([1.0, 0.0, 0.0], denominator, signal), **close
    )
    np.testing.assert_allclose(lagged(signal, STEP_S, 5e-3), 2.0 + behind([1.0], [5e-3, 1.0], signal), **close)


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    ("name", "key", "hz", "damping"),
    [
        ("p_recuperator", "recuperator_line_hz", 40.0, 0.2),
        ("p_brake", "brake_line_hz", 150.0, 0.2),
        ("acc_recoil", "accelerometer_bracket_hz", 800.0, 0.03),
    ],
)
def test_lines_and_brackets_resonate(name: str, key: str, hz: float, damping: float) -> None:
    true = read(name)
    w2, denominator = second_order(hz, damping)
    expected = true[0] + behind([w2], denominator, true)
    assert np.abs(expected - true).max() > 0.01 * np.ptp(true)
    np.testing.assert_allclose(read(name, **{key: hz}), expected, atol=0.01 * np.ptp(true))


def test_an_orifice_delays_the_recuperators_gauge() -> None:
    true, late = read("p_recuperator"), read("p_recuperator", recuperator_orifice_s=5e-3)
    np.testing.assert_allclose(late, true[0] + behind([1.0], [5e-3, 1.0], true), atol=1e-3 * np.ptp(true))
    np.testing.assert_allclose(late + 5e-3 * np.gradient(late, STEP_S), true, atol=2e-3 * np.ptp(true))


def test_a_gauge_ahead_reads_low_until_the_projectile_is_far() -> None:
    true, found = read("p_breech"), read("p_breech", gauge_ahead=0.02, chamber_length_m=0.4)
    one = scene()
    drive = one.mechanism.bore_area * one.motion.breech_pressure_pa
    x_p = np.cumsum(np.cumsum(drive)) * STEP_S**2 / one.settings.unread.projectile_mass_kg
    np.testing.assert_allclose(found, true * (1 - 0.02 * (0.4 / (0.4 + x_p)) ** 2), atol=2e-4 * true.max())


def test_a_breech_gauge_that_is_not_straight_is_off_in_its_middle_and_on_its_way_back() -> None:
    true = read("p_breech")
    z = true / 250e6
    bent = read("p_breech", breech_linearity=0.01)
    np.testing.assert_allclose(bent - true, 0.01 * 250e6 * 2 * z * (1 - z), atol=1.0)
    peak = true.argmax()
    way_back = read("p_breech", breech_hysteresis=0.01) - true
    y = true / true.max()
    assert np.abs(way_back[:peak]).max() < 1.0
    np.testing.assert_allclose(way_back[peak + 1 :], 2.5e6 * (y * (1 - y))[peak + 1 :], atol=1.0)


@pytest.mark.parametrize(
    ("name", "key", "tau"), [("acc_recoil", "accelerometer_amplifier_s", 1.0), ("p_breech", "breech_amplifier_s", 0.5)]
)
def test_a_charge_amplifier_forgets(name: str, key: str, tau: float) -> None:
    true, found = read(name), read(name, **{key: tau})
    expected = behind([tau, 0.0], [tau, 1.0], true)
    np.testing.assert_allclose(found, expected, atol=1e-3 * np.ptp(true))
    assert np.abs(found - true).max() > 4e-3 * np.ptp(true)


def test_a_tube_that_rings_along_its_axis_is_in_the_accelerometer_and_in_the_picture() -> None:
    one = scene()
    felt = read("acc_recoil")
    _, denominator = second_order(450.0, 0.01)
    added = read("acc_recoil", tube_axial_hz=450.0) - felt
    np.testing.assert_allclose(added, behind([2.0, 0.0, 0.0], denominator, felt), atol=0.03 * np.abs(added).max())
    own = specific_acceleration(one.mechanism, one.motion.q, one.motion.qd, one.motion.qdd)
    moved = seen(tube_axial_hz=450.0) - seen()
    np.testing.assert_allclose(moved, behind([2.0], denominator, own), atol=0.03 * np.abs(moved).max())


def test_a_camera_on_the_ground_sees_the_carriage_move_too() -> None:
    one = scene()
    found, m = seen(camera_on_ground=True), one.mechanism
    xi, eta, alpha, beta, x = one.motion.q.T
    # small angles: what shifts carriage and trunnion along the bore, less what the part travels
    along = xi * math.cos(m.phi20) + eta * math.sin(m.phi20)
    angle = m.phi20 - m.phi10
    lever = m.YA * math.cos(angle) - m.XA * math.sin(angle)
    np.testing.assert_allclose(found, x - along + (lever + m.d) * alpha + m.d * beta, atol=2e-4)
    assert np.abs(found - x).max() > 0.002


def test_a_rig_whose_camera_sees_from_the_ground_needs_no_such_setting_and_shows_a_mark_off_the_centre_turn() -> None:
    text = clean().text.replace('kind = "camera"', 'kind = "camera"\nsees = "ground"')
    rig = parse_rig(text.replace('serial = "V401",', 'serial = "V401", position = [0.0, 0.5],'), clean().path)
    one = dataclasses.replace(scene(), rig=rig)
    found = one.seen("recoil_displacement", rig.channel("x_camera"), one.motion.times_s)
    turned = one.motion.q[:, 2] + one.motion.q[:, 3]
    np.testing.assert_allclose(found, seen(camera_on_ground=True) + 0.5 * np.sin(turned), atol=1e-12)
    assert np.abs(turned).max() > 1e-4


def test_a_markers_bracket_a_shutter_and_a_lens_bend_the_picture() -> None:
    x = scene().motion.q[:, 4]
    w2, denominator = second_order(90.0, 0.05)
    np.testing.assert_allclose(seen(marker_bracket_hz=90.0), behind([w2], denominator, x), atol=2e-4)
    share = x / x.max()
    np.testing.assert_allclose(seen(lens_m=3e-3) - seen(), 3e-3 * 4 * share * (1 - share), atol=1e-9)
    late = (seen(rolling_shutter_s=5e-4) - seen())[:-40]
    np.testing.assert_allclose(late, (5e-4 * share * scene().motion.qd[:, 4])[:-40], atol=5e-5)


def test_frames_that_lie_farther_apart_or_jitter_show_another_instant(tmp_path: Path) -> None:
    def frames(name: str, **readings: float) -> np.ndarray:
        rig = with_settings(clean(), {"clock_drift": 0.0, "clock_offset_s": 0.0}
                            | {f"readings.{key}": value for key, value in readings.items()})  # fmt: skip
        shot = simulate_shot(rig, tmp_path / name, seed=7, shot="s")
        rows = [line.split(",") for line in (shot.folder / "s_camera.csv").read_text().splitlines()]
        return np.array([[float(row[1]), float(row[2])] for row in rows if row[0].isdigit() and row[2]])

    plain, motion = frames("plain"), scene().motion
    assert plain.shape[0] > 1000
    for name, given, expected_s in (
        ("slow", {"frame_rate": 0.002}, 1.002 * plain[:, 0]),
        ("jitter", {"frame_jitter_s": 3e-5}, plain[:, 0]),
    ):
        found = frames(name, **given)
        expected = 1e3 * np.interp(expected_s, motion.times_s, motion.q[:, 4])
        late_s = (found[:, 1] - expected) / (1e3 * np.interp(expected_s, motion.times_s, motion.qd[:, 4]) + 1e-9)
        fast = np.interp(expected_s, motion.times_s, motion.qd[:, 4]) > 3.0
        assert fast.sum() > 200
        spread = 3e-5 if name == "jitter" else 0.0
        assert np.std(late_s[fast]) == pytest.approx(spread, rel=0.15, abs=3e-6)
        assert np.mean(late_s[fast]) == pytest.approx(0.0, abs=6e-6)


def test_a_gateway_holds_samples_that_arrive_late() -> None:
    times = STEP_S * np.arange(40_000)
    found = handed_on(times, times, times, 2e-3, 1000.0, np.random.default_rng(3))
    steps = np.diff(np.unique(found))[1:]
    np.testing.assert_allclose(steps, 1e-3 * np.round(1e3 * steps), atol=1e-9)
    behind_s = (times - found)[4000:]
    # on average half a period of holding beside the latency, a little more as none overtakes another
    assert 2.0e-3 < behind_s.mean() < 3.5e-3
    assert behind_s.min() > 0.0
    one = read("p_brake", brake_gateway_s=1e-3)
    true = read("p_brake")
    assert np.unique(one).size < 0.05 * one.size
    assert np.abs(one - true).max() > 1e5


@pytest.mark.parametrize(
    ("name", "key"), [("p_breech", "breech"), ("p_brake", "brake"), ("p_recuperator", "recuperator")]
)
def test_a_zero_drifts(name: str, key: str) -> None:
    drifted = read(name, **{f"{key}_drift_pa_s": 1e5}) - read(name)
    one = scene()
    np.testing.assert_allclose(drifted, 1e5 * (one.motion.times_s - one.motion.t_fire_s), atol=1.0)


# ---- noise


def rest_and_motion(one: Scene) -> tuple[np.ndarray, np.ndarray]:
    t = one.motion.times_s
    return t < one.motion.t_fire_s, (t > one.motion.t_fire_s) & (t < one.motion.t_end_s)


def test_noise_grows_with_acceleration_speed_and_reading() -> None:
    one, true = scene(), read("acc_recoil")
    rest, moves = rest_and_motion(one)
    speed = np.abs(one.motion.qd[:, 4])
    for given, spread in (
        ({"noise_of_acceleration": 0.03}, 0.03 * np.abs(true)),
        ({"noise_of_speed_per_s": 2.0}, 2.0 * speed),
        ({"structure_borne_m_s2": 20.0}, np.full(true.size, 20.0)),
        (
            {"noise_of_acceleration": 0.03, "noise_of_speed_per_s": 2.0, "structure_borne_m_s2": 20.0},
            np.sqrt((0.03 * true) ** 2 + (2.0 * speed) ** 2 + 400.0),
        ),
    ):
        added = read("acc_recoil", **given) - true
        assert np.abs(added[rest]).max() < 1e-9
        known = moves & (spread > 1e-3)
        assert kstest(added[known] / spread[known], "norm").pvalue > 1e-3
    true = read("p_brake")
    for given, spread in (
        ({"noise_of_reading": 0.02}, 0.02 * true),
        ({"gauge_noise_of_speed_s_m": 1e-3}, 1e-3 * 16e6 * speed),
    ):
        added = read("p_brake", **given) - true
        known = moves & (spread > 10.0)
        assert np.abs(added[rest]).max() < 1e-3
        assert kstest(added[known] / spread[known], "norm").pvalue > 1e-3


def test_knocks_are_pulses_while_it_recoils() -> None:
    added = read("acc_recoil", knocks=12, knock_m_s2=10.0) - read("acc_recoil")
    rest, moves = rest_and_motion(scene())
    assert np.abs(added[rest]).max() < 1e-9
    hit = np.abs(added) > 1e-6
    assert 0.5 * 12e-3 < STEP_S * hit[moves].sum() <= 12.1e-3
    assert np.abs(added).max() > 10.0


@pytest.mark.exhaustive
def test_the_rest_is_quieter_than_the_motion_on_every_channel_of_the_recorder() -> None:
    loud = with_settings(clean(), {"noise": 0.001, "duration_s": 1.2})
    quiet = with_settings(loud, {"readings.rest_noise": 0.25})
    one, other = draw_scene(loud, 7, "s"), draw_scene(quiet, 7, "s")
    t = one.motion.times_s
    back = t > t[np.flatnonzero(np.abs(one.motion.qd[:, 4]) > 0.02)[-1]]
    rest, moves = rest_and_motion(one)
    still = draw_scene(with_settings(loud, {"noise": 0.0}), 7, "s")
    for spec in (c for c in loud.channels if c.source == "dewetron"):
        plain, ones, others = (each.samples(spec, t) for each in (still, one, other))
        np.testing.assert_array_equal(ones[moves], others[moves])
        for at_rest in (rest, back):
            if at_rest.sum() > 500:
                np.testing.assert_allclose((others - plain)[at_rest], 0.25 * (ones - plain)[at_rest], atol=1e-9)


# ---- draws


def test_noise_of_the_motion_and_a_quiet_rest_are_drawn_from_their_bounds() -> None:
    drawn = [draw_noise(TwinSettings(), seed, None).readings for seed in range(300)]
    for key, limits in (
        ("noise_of_acceleration", NOISE_OF_MOTION), ("noise_of_reading", NOISE_OF_MOTION), ("rest_noise", REST_NOISE),
    ):  # fmt: skip
        place = np.log([getattr(one, key) / limits[0] for one in drawn]) / math.log(limits[1] / limits[0])
        assert kstest(place, "uniform").pvalue > 0.01
    campaign = {draw_noise(TwinSettings(), seed, 9).readings for seed in range(5)}
    assert len(campaign) == 1
    assert draw_noise(TwinSettings(unread_errors=False), 3, None).readings == Readings()
    asked = TwinSettings(readings=Readings(rest_noise=0.05))
    found = draw_noise(asked, 3, None)
    assert (found.readings.rest_noise, found.truth["rest_noise"]) == (0.05, 0.05)
    assert found.readings.noise_of_reading == draw_noise(TwinSettings(), 3, None).readings.noise_of_reading


def drawn_late(rig: Rig, seeds: range, campaign_seed: int | None = None) -> list[dict[str, dict[str, float]]]:
    plain = draw_scene(rig, 1, "s")
    found = []
    for seed in seeds:
        one = dataclasses.replace(
            plain, seed=seed, campaign_seed=campaign_seed, late={}, gains={}, offsets={}, moves={}
        )
        for name in ("p_brake", "p_recuperator"):
            one.samples(rig.channel(name), one.motion.times_s[:10])
        found.append(one.late)
    return found


@pytest.mark.exhaustive
def test_a_recuperator_gauge_of_unknown_delay_sits_behind_an_orifice_of_the_usual_size() -> None:
    rig = with_twin("field-2013", kind=False, sample_rate_hz=1e3, duration_s=0.3)
    taus = np.array([late["p_recuperator"]["orifice_s"] for late in drawn_late(rig, range(200))])
    assert taus.min() > 0.0
    assert kstest(taus / 2e-3, "halfnorm").pvalue > 0.01
    assert len({late["p_recuperator"]["orifice_s"] for late in drawn_late(rig, range(3), 5)}) == 1
    stated = parse_rig(rig.text.replace('serial = "V303"', 'serial = "V303", delay_s = 0'), rig.path)
    assert drawn_late(stated, range(2)) == [{}, {}]


@pytest.mark.exhaustive
def test_a_delay_that_is_stated_is_off_by_draws_from_its_uncertainty() -> None:
    rig = with_twin("field-2013", kind=False, sample_rate_hz=1e3, duration_s=0.3)
    text = rig.text.replace('serial = "V303"', 'serial = "V303", u_delay_s = 0.001')
    text = text.replace('serial = "V302"', 'serial = "V302", delay_s = 0.002, u_delay_s = 0.0005')
    late = drawn_late(parse_rig(text, rig.path), range(200))
    for name, u_s in (("p_recuperator", 1e-3), ("p_brake", 5e-4)):
        assert kstest([one[name]["shift_s"] / u_s for one in late], "norm").pvalue > 0.01


@pytest.mark.exhaustive
def test_the_truth_tells_noise_and_delays_and_what_was_set(tmp_path: Path) -> None:
    rig = with_twin("field-2013", kind=False, sample_rate_hz=10e3, duration_s=0.3)
    given = with_settings(rig, {"readings.rest_noise": 0.5, "readings.lens_m": 0.001, "unread.bump_n": 300.0})
    shot = simulate_shot(given, tmp_path, seed=4, shot="s")
    truth = shot.truth
    assert truth["noise"]["rest_noise"] == 0.5
    assert NOISE_OF_MOTION[0] <= truth["noise"]["noise_of_acceleration"] <= NOISE_OF_MOTION[1]
    assert truth["unread"]["delays"]["p_recuperator"]["orifice_s"] > 0
    assert truth["readings"] == {"lens_m": 0.001}
    assert truth["settings"] == {"readings.rest_noise": 0.5, "readings.lens_m": 0.001, "unread.bump_n": 300.0}
    assert shot.rig_file.read_text(encoding="utf-8") == rig.text
