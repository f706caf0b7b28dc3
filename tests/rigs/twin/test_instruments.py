"""The virtual sensors: stress waves, chains, digitising, and that perfect ones satisfy equation (36)."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import cumulative_trapezoid

from recoil_rigs.mechanism import model
from recoil_rigs.rig import ChannelSpec, Sensor, find_rig, parse_rig
from recoil_rigs.shots.assemble import in_si
from recoil_rigs.twin import draw_scene
from recoil_rigs.twin.instruments import chain, digitise, generator, mix, sample, stress_waves, wandering
from recoil_rigs.twin.settings import TwinSettings
from recoil_rigs.twin.sources import Scene, declared_unit, in_unit, to_file

PERFECT = """
gain_errors = false
friction_error = false
ringing = 0.0
noise = 0.0
bias = 0.0
bits = 0
unread_errors = false
"""


@cache
def perfect_scene() -> Scene:
    path = find_rig("field-2013")
    text = path.read_text(encoding="utf-8").replace("time_constant_s = 10.0, ", "")
    text = text[: text.index("[twin]")] + "[twin]\n" + PERFECT
    return draw_scene(parse_rig(text, path), 7, "s")


@pytest.mark.exhaustive
def test_perfect_instruments_satisfy_the_identification_equation_both_ways() -> None:
    scene = perfect_scene()
    m, motion = scene.mechanism, scene.motion
    si = {c.name: in_si(c, declared_unit(c), scene.samples(c, motion.times_s)) for c in scene.rig.channels}
    held = (motion.contact_n > 0) | (motion.friction_n < m.friction)
    moving = ~held & (motion.times_s > motion.t_fire_s) & (motion.times_s < motion.t_end_s)
    assert moving.sum() > 9000
    force = m.bore_area * (1.0 - m.bore_friction) * si["p_breech"] - m.brake_area * si["p_brake"]
    force -= m.recuperator_area * si["p_recuperator"] + m.friction
    w1, dw1, w2, dw2 = si["gyro_carriage"], motion.qdd[:, 2], si["gyro_tipping"], motion.qdd[:, 2] + motion.qdd[:, 3]
    place = scene.rig.channel("acc_carriage_x").sensor.position
    r5, r6 = scene.rig.channel("acc_recoil").sensor.position
    inertial = model.specific_acceleration_inertial(si["acc_recoil"], w2, dw2, r5, r6)
    kinematic = model.specific_acceleration_kinematic(
        m, motion.qdd[:, 4], si["x_camera"], w2, dw2, si["acc_carriage_x"], si["acc_carriage_y"], motion.q[:, 3],
        w1=w1, dw1=dw1, r_x=place[0], r_y=place[1],
    )  # fmt: skip
    for a in (inertial, kinematic):
        np.testing.assert_allclose(m.m3 * a[moving], force[moving], atol=1e-6 * np.abs(force).max())
    assert m.m3 * np.abs(si["acc_recoil"] - inertial).max() > 1e-4 * np.abs(force).max()


@pytest.mark.exhaustive
@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 2**32))
def test_ringing_carries_no_net_velocity_and_no_net_displacement(seed: int) -> None:
    times = np.arange(100_000) / 50e3
    modes = stress_waves(times, 0.05, 0.25, generator(seed, "stress waves"))
    ringing = mix(modes, 1000.0, generator(seed, "some channel"))
    velocity = cumulative_trapezoid(ringing, dx=times[1], initial=0.0)
    displacement = cumulative_trapezoid(velocity, dx=times[1], initial=0.0)
    assert np.abs(ringing).max() == pytest.approx(1000.0)
    assert np.abs(velocity[-1]) < 1e-6 * np.abs(velocity).max()
    assert np.abs(displacement[-1]) < 1e-4 * np.abs(displacement).max()
    assert not ringing[times < 0.05].any()


def test_a_force_gauges_gain_wanders_within_a_shot_and_no_other_sensors() -> None:
    scene = perfect_scene()
    still, moving = (
        replace(scene, settings=scene.settings.model_copy(update={"gain_errors": True, "wander": wander}))
        for wander in (0.0, 2e-3)
    )
    times_s = scene.motion.times_s
    for name in ("p_breech", "p_brake", "p_recuperator"):
        before, after = (one.samples(scene.rig.channel(name), times_s) for one in (still, moving))
        told = before > 0.01 * before.max()
        wanders = (after[told] / before[told] - 1.0) / 2e-3
        assert 0.6 < wanders.std() < 1.3, name
        assert abs(wanders.mean()) < 0.5, name
    accelerometer = scene.rig.channel("acc_recoil")
    np.testing.assert_array_equal(*(one.samples(accelerometer, times_s) for one in (still, moving)))


def test_what_wanders_keeps_its_size_and_forgets_itself_in_some_milliseconds() -> None:
    curve = wandering(np.arange(0.0, 4.0, 5e-4), np.random.default_rng(3))
    assert curve.std() == pytest.approx(0.9, abs=0.06)
    later = [float(np.mean(curve[:-n] * curve[n:]) / curve.var()) for n in (1, 16)]
    assert later[0] > 0.8
    assert abs(later[1]) < 0.1


def test_ringing_lies_between_900_and_4000_hertz_and_returns_at_later_knocks() -> None:
    times = np.arange(50_000) / 50e3
    modes = stress_waves(times, 0.05, 0.25, generator(3, "stress waves"))
    power = np.abs(np.fft.rfft(modes, axis=1)) ** 2
    frequency = np.fft.rfftfreq(len(times), times[1])
    strongest = frequency[power.argmax(axis=1)]
    assert strongest.min() > 880.0
    assert strongest.max() < 4000.0
    ringing = np.abs(modes.sum(axis=0))
    for knock in (0.05 + 0.0068, 0.05 + 0.0155, 0.25):
        before = ringing[(times > knock - 0.0005) & (times < knock)].max()
        assert ringing[(times > knock) & (times < knock + 0.001)].max() > 1.2 * before


def test_a_piezoelectric_chain_forgets_what_is_constant_with_its_time_constant() -> None:
    step = 1e-4
    signal = np.where(np.arange(100_000) * step > 1.0, 12.0, 2.0)
    out = chain(signal, step, Sensor(time_constant_s=2.0))
    assert np.abs(out[: int(1.0 / step)]).max() < 1e-12  # settled on the constant at the start
    since = np.arange(100_000) * step - 1.0
    later = since > 0.01
    np.testing.assert_allclose(out[later], 10.0 * np.exp(-since[later] / 2.0), rtol=1e-3)


@pytest.mark.parametrize("delay_s", [0.0, 0.5e-3])
def test_a_filtered_chain_is_late_by_exactly_the_delay_it_declares(delay_s: float) -> None:
    step = 2e-5
    times = np.arange(25_000) * step
    sensor = Sensor(filter_hz=800.0, delay_s=delay_s)

    def slow(t: np.ndarray) -> np.ndarray:
        return 3.0 + np.sin(2 * np.pi * 40.0 * t)

    at = np.linspace(0.1, 0.4, 777)
    seen = sample(chain(slow(times), step, sensor), times, at, sensor)
    np.testing.assert_allclose(seen, slow(at - delay_s), atol=2e-3)


def test_a_filtered_chain_is_3_db_down_at_its_cut_off() -> None:
    step = 2e-5
    times = np.arange(25_000) * step
    out = chain(np.sin(2 * np.pi * 800.0 * times), step, Sensor(filter_hz=800.0))
    assert np.abs(out[5000:]).max() == pytest.approx(np.sqrt(0.5), rel=5e-3)


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 1000), bits=st.integers(4, 16), size=st.floats(0.1, 50.0))
def test_digitised_values_lie_within_the_range_and_on_the_converters_steps(seed: int, bits: int, size: float) -> None:
    values = np.linspace(-size, size, 501)
    stored, _ = digitise(values, (-4.0, 12.0), 0.01, TwinSettings(bits=bits), generator(seed), np.zeros(501))
    counts = (stored + 4.0) / (16.0 / 2**bits)
    np.testing.assert_allclose(counts, np.round(counts), atol=1e-9)
    assert stored.min() >= -4.0
    assert stored.max() < 12.0


def test_gain_errors_scatter_as_the_sensor_declares_and_can_be_switched_off() -> None:
    one, zero = (-1.0, 1.0), np.zeros(2)
    never = np.zeros(2)
    drawn = [digitise(zero, one, 0.02, TwinSettings(), generator(i), never)[1].gain for i in range(400)]
    assert np.mean(drawn) == pytest.approx(1.0, abs=3 * 0.02 / 20)
    assert np.std(drawn) == pytest.approx(0.02, rel=0.15)
    off = TwinSettings(gain_errors=False)
    assert {digitise(zero, one, 0.02, off, generator(i), never)[1].gain for i in range(9)} == {1.0}


def test_a_zero_shift_strikes_only_the_samples_after_the_shot() -> None:
    settings_ = TwinSettings(noise=0.0, bias=0.0, bits=0)
    shift = 0.1 * np.array([0.0, 0.0, 1.0, 1.0])
    stored, _ = digitise(np.zeros(4), (-5.0, 5.0), 0.01, settings_, generator(1), shift)
    np.testing.assert_allclose(stored, [0.0, 0.0, 0.5, 0.5])


def test_channels_draw_from_generators_of_their_own() -> None:
    assert generator(1, "channel", "a").normal() == generator(1, "channel", "a").normal()
    assert generator(1, "channel", "a").normal() != generator(1, "channel", "b").normal()
    assert generator(1, "channel", "a").normal() != generator(2, "channel", "a").normal()


SPECS = [
    (ChannelSpec(name="p", source="s", signal="p", quantity="pressure", unit="bar", polarity=-1), 2e5, -2.0),
    (ChannelSpec(name="t", source="s", signal="t", quantity="temperature", unit="degC"), 293.15, 20.0),
    (
        ChannelSpec(
            name="a", source="s", signal="a", quantity="acceleration", unit="mV",
            sensor=Sensor(sensitivity=0.32, sensitivity_unit="pC", amplifier=0.01),
        ),
        100.0,
        320.0,
    ),
    # a newer calibration counts before the polarity, in the unit of the file
    (
        ChannelSpec(
            name="p", source="s", signal="p", quantity="pressure", unit="bar", polarity=-1,
            sensor=Sensor(gain=1.25, offset=0.5),
        ),
        -1.3e5,
        0.64,
    ),
    (
        ChannelSpec(
            name="a", source="s", signal="a", quantity="acceleration", unit="mV",
            sensor=Sensor(sensitivity=0.32, sensitivity_unit="pC", amplifier=0.01, gain=2.0, offset=40.0),
        ),
        240.0,
        320.0,
    ),
    (
        ChannelSpec(
            name="T", source="s", signal="T", quantity="temperature", unit="degC", sensor=Sensor(gain=2.0, offset=-1.0)
        ),
        312.15,
        20.0,
    ),
]  # fmt: skip


@pytest.mark.parametrize(("spec", "si", "number"), SPECS)
def test_the_files_numbers_follow_unit_polarity_and_voltage_chain(spec: ChannelSpec, si: float, number: float) -> None:
    np.testing.assert_allclose(to_file(np.array([si]), spec), [number])
    np.testing.assert_allclose(in_si(spec, declared_unit(spec), np.array([number])), [si])


def test_a_message_carries_its_own_unit() -> None:
    spec = SPECS[0][0]
    np.testing.assert_allclose(in_unit(np.array([-2.0]), spec, "MPa"), [-0.2])
    np.testing.assert_allclose(in_unit(np.array([-2.0]), spec, ""), [-2.0])


def test_the_perfect_scene_is_read_from_the_bundled_rig() -> None:
    assert perfect_scene().rig.path == Path(find_rig("field-2013"))


@pytest.mark.parametrize("filter_hz", [800.0, 30e3])
def test_a_filter_without_a_declared_delay_is_late_by_its_own_on_any_grid(filter_hz: float) -> None:
    step = 2e-5
    times = np.arange(25_000) * step
    sensor = Sensor(filter_hz=filter_hz, filter_type="bessel", filter_order=4)

    def slow(t: np.ndarray) -> np.ndarray:
        return np.sin(2 * np.pi * 40.0 * t)

    at = np.linspace(0.1, 0.4, 777)
    seen = sample(chain(slow(times), step, sensor), times, at, sensor)
    np.testing.assert_allclose(seen, slow(at - 2.114 / (2 * np.pi * filter_hz)), atol=2e-3)
