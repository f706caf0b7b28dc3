from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from daq.channel import Channel
from daq.shot import ClockAlignment, Shot
from daq.timebase import TimeBase
from identification.analysis import Options, identify_shot
from identification.clocks import align_clocks
from processing.motion_alignment import integrate
from rigs.rig import Rig
from tests.builders.bench_shots import ELEVATION_RAD, GRAVITY_M_S2, bench_motion, bench_rig, bench_shot
from tests.builders.virtual_shots import virtual_shot, with_channels, without_channels

BUS = '[[source]]\nname = "bus"\nkind = "dewetron"\nalign = {{ {} }}\n'
PLAIN = '[[channel]]\nname = "{}"\nsource = "{}"\nsignal = "s"\nquantity = "{}"\n'


def rig_with(align: str, *channels: str) -> Rig:
    return bench_rig(tables=BUS.format(align) + "".join(channels))


def on_bus(shot: Shot, name: str, times_s: np.ndarray, samples: np.ndarray, quantity: str, clock: str = "bus") -> Shot:
    channel = Channel(
        name, quantity, samples, TimeBase.stamped(clock, times_s), "s", "trigger" if clock != "bus" else ""
    )
    return replace(shot, channels={**shot.channels, name: channel})


def by_clock(alignments: tuple[ClockAlignment, ...]) -> dict[str, ClockAlignment]:
    return {a.clock: a for a in alignments}


# ---- fixed


def test_a_fixed_alignment_is_taken_as_declared():
    rig = rig_with(
        'method = "fixed", offset_s = 0.25, u_offset_s = 1e-4, drift = 2e-5, u_drift = 1e-6',
        PLAIN.format("t", "bus", "temperature"),
    )
    shot = on_bus(bench_shot(), "t", 1e-3 * np.arange(50), np.linspace(290, 291, 50), "temperature")
    assert align_clocks(shot, rig) == (ClockAlignment("bus", 0.25, 1e-4, 2e-5, 1e-6, "ok", "fixed"),)


def test_a_clock_that_the_shot_has_no_channel_of_is_not_aligned():
    rig = rig_with('method = "fixed", offset_s = 0.25', PLAIN.format("t", "bus", "temperature"))
    assert align_clocks(bench_shot(), rig) == ()


def test_a_source_without_an_alignment_fails_with_the_reason():
    rig = rig_with('method = "fixed", offset_s = 0.0', PLAIN.format("t", "bus", "temperature"))
    bare = replace(rig, sources=(rig.sources[0], rig.sources[1].model_copy(update={"align": None})))
    shot = on_bus(bench_shot(), "t", 1e-3 * np.arange(50), np.linspace(290, 291, 50), "temperature")
    (found,) = align_clocks(shot, bare)
    assert (found.status, found.reasons) == ("failed", ("the rig declares no alignment",))


# ---- trigger


def pulse(times_s: np.ndarray, at_s: float) -> np.ndarray:
    return np.where((times_s >= at_s) & (times_s < at_s + 0.01), 5.0, 0.0)


@pytest.mark.parametrize("delay_s", [0.0, 2e-3])
def test_one_trigger_edge_gives_the_offset_without_the_delays_of_the_chains(delay_s):
    sensor = f"sensor = {{ delay_s = {delay_s} }}\n" if delay_s else ""
    rig = rig_with(
        'method = "trigger", channel = "edge"',
        PLAIN.format("edge", "bus", "voltage") + sensor,
        PLAIN.format("fire", "recorder", "voltage") + 'role = "trigger"\n',
    )
    times, bus = bench_motion().times_s, 1e-4 * np.arange(2000)
    shot = on_bus(bench_shot(), "fire", times, pulse(times, 0.0300), "voltage", "recorder")
    shot = on_bus(shot, "edge", bus, pulse(bus, 0.1000 + delay_s), "voltage")
    (found,) = align_clocks(shot, rig)
    assert (found.method, found.status) == ("trigger", "ok")
    assert found.offset_s == pytest.approx(-0.07, abs=3 * found.u_offset_s)
    assert found.u_offset_s == pytest.approx(math.hypot(1e-4, 5e-5) / math.sqrt(12))


def test_a_trigger_that_was_not_recorded_is_named():
    rig = rig_with(
        'method = "trigger", channel = "edge"',
        PLAIN.format("edge", "bus", "voltage") + PLAIN.format("t", "bus", "temperature"),
        PLAIN.format("fire", "recorder", "voltage") + 'role = "trigger"\n',
    )
    bus = 1e-4 * np.arange(2000)
    shot = on_bus(bench_shot(), "t", bus, np.linspace(290, 291, bus.size), "temperature")
    (found,) = align_clocks(shot, rig)
    assert (found.status, found.u_offset_s) == ("failed", math.inf)
    assert found.reasons == ("edge is not in this shot",)
    (found,) = align_clocks(on_bus(shot, "edge", bus, pulse(bus, 0.1), "voltage"), rig)
    assert found.reasons == ("a channel of role trigger on the reference clock is not in this shot",)


# ---- redundant


def repeated(offset_s: float, samples: np.ndarray | None = None) -> tuple[Shot, Rig]:
    rig = rig_with(
        'method = "redundant", channel = "again", against = "acc"', PLAIN.format("again", "bus", "acceleration")
    )
    motion = bench_motion()
    bus = 5e-4 * np.arange(350)
    seen = np.interp(bus + offset_s, motion.times_s, motion.acceleration_m_s2)
    shot = bench_shot(**({} if samples is None else {"acc": samples}))
    return on_bus(shot, "again", bus, seen, "acceleration"), rig


@pytest.mark.parametrize("offset_s", [-0.004, 0.0113])
def test_a_repeated_channel_gives_the_offset(offset_s):
    (found,) = align_clocks(*repeated(offset_s))
    assert (found.method, found.status) == ("redundant", "ok")
    assert found.offset_s == pytest.approx(offset_s, abs=3e-5)


def test_a_repeated_channel_may_have_lost_samples():
    lossy = bench_motion().acceleration_m_s2.copy()
    lossy[900:930] = np.nan
    (found,) = align_clocks(*repeated(0.0113, lossy))
    assert found.offset_s == pytest.approx(0.0113, abs=5e-5)


def test_what_a_repeat_needs_and_is_not_there_is_named():
    shot, rig = repeated(0.0)
    (found,) = align_clocks(without_channels(shot, "acc"), rig)
    assert (found.status, found.reasons) == ("failed", ("channel acc is not in this shot",))
    elsewhere = replace(shot.channels["acc"], time_base=replace(shot.channels["acc"].time_base, clock="third"))
    (found,) = align_clocks(replace(shot, channels={**shot.channels, "acc": elsewhere}), rig)
    assert found.reasons == ("channel acc is not on the reference clock",)


def test_a_constant_repeat_fails_and_does_not_raise():
    shot, rig = repeated(0.0)
    (found,) = align_clocks(with_channels(shot, again=np.zeros(350)), rig)
    assert found.status == "failed"
    assert "constant" in found.reasons[0]


# ---- motion


CAMERA = (
    '[[source]]\nname = "camera"\nkind = "camera"\nframe_rate = 5000.0\n'
    'align = { method = "motion", against = "acc" }\n'
    '[[channel]]\nname = "x"\nsource = "camera"\nsignal = "X"\nquantity = "displacement"\nunit = "m"\n'
    'role = "recoil_displacement"\nsensor = { u_rel = 0.001, delay_s = DELAY }\n'
)


def filmed(delay_s: float) -> tuple[Shot, Rig]:
    motion, rng = bench_motion(), np.random.default_rng(9)
    noisy = motion.acceleration_m_s2 + rng.normal(0.0, 3.0, motion.times_s.size)
    downhill = GRAVITY_M_S2 * math.sin(ELEVATION_RAD)
    travel = integrate(integrate(motion.acceleration_m_s2 + downhill, 5e-5), 5e-5)
    frames = np.arange(950) / 5000.0
    seen = np.interp(frames + 0.004 - delay_s, motion.times_s, travel) + rng.normal(0.0, 5e-5, 950)
    shot = bench_shot(acc=noisy)
    track = Channel("x", "displacement", seen, TimeBase.stamped("camera", frames), "X", "recoil_displacement", 0.001)
    return replace(shot, channels={**shot.channels, "x": track}), bench_rig(
        tables=CAMERA.replace("DELAY", str(delay_s))
    )


@pytest.mark.parametrize("delay_s", [0.0, 0.002])
def test_a_cameras_delay_is_neither_in_its_clock_nor_in_its_travel(delay_s):
    shot, rig = filmed(delay_s)
    alignments = align_clocks(shot, rig)
    (found,) = alignments
    assert found.status == "ok"
    assert found.offset_s == pytest.approx(0.004, abs=4 * found.u_offset_s)
    result = identify_shot(replace(shot, alignments=alignments), rig, Options())
    motion = bench_motion()
    inside = (motion.times_s > 0.01) & (motion.times_s < 0.18)
    assert np.abs(result.travel_m - motion.travel_m)[inside].max() < 1e-3
    kinematic = result.results["kinematic"].estimate
    assert kinematic.mass_kg == pytest.approx(782.0, rel=0.005)


def test_what_a_motion_needs_and_is_not_there_is_named():
    shot, rig = filmed(0.0)
    (found,) = align_clocks(without_channels(shot, "acc"), rig)
    assert found.reasons == ("channel acc is not in this shot",)
    length = replace(shot.channels["x"], quantity="velocity")
    (found,) = align_clocks(replace(shot, channels={**shot.channels, "x": length}), rig)
    assert found.reasons == ("a displacement channel of this source is not in this shot",)
    (found,) = align_clocks(
        replace(shot, channels={**shot.channels, "acc": replace(shot.channels["acc"], role="")}), rig
    )
    assert found.reasons == ("channel acc must have the role recoil_acceleration",)


def test_a_shot_without_a_shot_fails_the_cameras_clock_with_the_reason():
    shot, rig = filmed(0.0)
    (found,) = align_clocks(with_channels(shot, p_breech=np.zeros(shot.channels["p_breech"].samples.size)), rig)
    assert found.status == "failed"
    assert "breech_pressure shows no shot" in found.reasons[0]


# ---- all clocks of the virtual rig


@pytest.mark.parametrize(("name", "clocks"), [("field-2013", ["camera"]), ("mixed", ["can", "imu", "camera"])])
def test_all_clocks_of_a_virtual_shot_are_found_in_the_rigs_order(name, clocks):
    virtual = virtual_shot(name)
    assert [a.clock for a in virtual.shot.alignments] == clocks
    for a in virtual.shot.alignments:
        truth = virtual.truth["clocks"][a.clock]
        middle = 0.5 * (virtual.truth["t_fire"] + virtual.truth["t_end"])
        at_source = (middle - truth["offset_s"]) / (1 + truth["drift"])
        true = middle - truth.get("latency_s", 0.0)
        assert a.status == "ok", a.reasons
        limit = 3 if a.clock == "camera" else 4
        assert abs(a.to_reference(at_source) - true) < limit * a.u_offset_s


def test_the_camera_of_another_shot_is_noticed():
    virtual, other = virtual_shot(), virtual_shot(seed=4, peak_pressure_pa=115e6)
    strange = {**virtual.shot.channels, "x_camera": other.shot.channels["x_camera"]}
    (found,) = align_clocks(replace(virtual.shot, channels=strange, alignments=()), virtual.rig)
    assert found.status != "ok"
    assert found.reasons
