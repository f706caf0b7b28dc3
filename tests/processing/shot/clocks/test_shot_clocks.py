from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from recoil_acquisition.channel import Channel
from recoil_acquisition.clocks.timebase import TimeBase
from recoil_acquisition.shot.shot import ClockAlignment, Shot
from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.identified import Options
from recoil_processing.double_integral import integrate
from recoil_processing.shot.clocks.shot_clocks import align_clocks
from recoil_rigs.rig import Rig
from recoil_rigs.shots.fired_shot import FiredShot
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
    assert align_clocks(FiredShot(shot, rig)) == (ClockAlignment("bus", 0.25, 1e-4, 2e-5, 1e-6, "ok", "fixed"),)


def test_a_clock_that_the_shot_has_no_channel_of_is_not_aligned():
    rig = rig_with('method = "fixed", offset_s = 0.25', PLAIN.format("t", "bus", "temperature"))
    assert align_clocks(FiredShot(bench_shot(), rig)) == ()


def test_a_source_without_an_alignment_fails_with_the_reason():
    rig = rig_with('method = "fixed", offset_s = 0.0', PLAIN.format("t", "bus", "temperature"))
    bare = replace(rig, sources=(rig.sources[0], rig.sources[1].model_copy(update={"align": None})))
    shot = on_bus(bench_shot(), "t", 1e-3 * np.arange(50), np.linspace(290, 291, 50), "temperature")
    (found,) = align_clocks(FiredShot(shot, bare))
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
    (found,) = align_clocks(FiredShot(shot, rig))
    assert (found.method, found.status) == ("trigger", "ok")
    assert found.offset_s == pytest.approx(-0.07, abs=3 * found.u_offset_s)
    assert found.u_offset_s == pytest.approx(math.hypot(1e-4, 5e-5) / math.sqrt(12))


def test_the_beat_that_is_reported_is_the_sources_and_not_the_references():
    rig = rig_with(
        'method = "trigger", channel = "edge"',
        PLAIN.format("edge", "bus", "voltage"),
        PLAIN.format("fire", "recorder", "voltage") + 'role = "trigger"\n',
    )
    rig = replace(rig, sources=(rig.sources[0], rig.sources[1].model_copy(update={"kind": "can"})))
    times, beat = bench_motion().times_s, 1e-3 * np.arange(900)
    waited = beat + 1e-4 * np.random.default_rng(8).exponential(1.0, beat.size)
    shot = on_bus(bench_shot(), "fire", times, pulse(times, 0.0300), "voltage", "recorder")
    shot = on_bus(shot, "edge", np.maximum.accumulate(waited), pulse(beat, 0.1000), "voltage")
    (found,) = align_clocks(FiredShot(shot, rig))
    assert found.details["stamps"]["line"] == "lower edge"
    assert found.details["stamps"]["step_s"] == pytest.approx(1e-3, rel=1e-3)


def test_a_trigger_that_was_not_recorded_is_named():
    rig = rig_with(
        'method = "trigger", channel = "edge"',
        PLAIN.format("edge", "bus", "voltage") + PLAIN.format("t", "bus", "temperature"),
        PLAIN.format("fire", "recorder", "voltage") + 'role = "trigger"\n',
    )
    bus = 1e-4 * np.arange(2000)
    shot = on_bus(bench_shot(), "t", bus, np.linspace(290, 291, bus.size), "temperature")
    (found,) = align_clocks(FiredShot(shot, rig))
    assert (found.status, found.u_offset_s) == ("failed", math.inf)
    assert found.reasons == ("edge is not in this shot",)
    (found,) = align_clocks(FiredShot(on_bus(shot, "edge", bus, pulse(bus, 0.1), "voltage"), rig))
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
    (found,) = align_clocks(FiredShot(*repeated(offset_s)))
    assert (found.method, found.status) == ("redundant", "ok")
    assert found.offset_s == pytest.approx(offset_s, abs=3e-5)


def test_a_repeated_channel_may_have_lost_samples():
    lossy = bench_motion().acceleration_m_s2.copy()
    lossy[900:930] = np.nan
    (found,) = align_clocks(FiredShot(*repeated(0.0113, lossy)))
    assert found.offset_s == pytest.approx(0.0113, abs=5e-5)


def test_what_a_repeat_needs_and_is_not_there_is_named():
    shot, rig = repeated(0.0)
    (found,) = align_clocks(FiredShot(without_channels(shot, "acc"), rig))
    assert (found.status, found.reasons) == ("failed", ("channel acc is not in this shot",))
    elsewhere = replace(shot.channels["acc"], time_base=replace(shot.channels["acc"].time_base, clock="third"))
    (found,) = align_clocks(FiredShot(replace(shot, channels={**shot.channels, "acc": elsewhere}), rig))
    assert found.reasons == ("channel acc is not on the reference clock",)


def test_a_constant_repeat_fails_and_does_not_raise():
    shot, rig = repeated(0.0)
    (found,) = align_clocks(FiredShot(with_channels(shot, again=np.zeros(350)), rig))
    assert found.status == "failed"
    assert "constant" in found.reasons[0]


# ---- motion


CAMERA = (
    '[[source]]\nname = "camera"\nkind = "camera"\nframe_rate = 5000.0\n'
    'align = { method = "motion", against = "acc" }\n'
    '[[channel]]\nname = "x"\nsource = "camera"\nsignal = "X"\nquantity = "displacement"\nunit = "m"\n'
    'role = "recoil_displacement"\nsensor = { u_rel = 0.001, delay_s = DELAY }\n'
)


def tracked(delay_s: float) -> tuple[Shot, Rig]:
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


@pytest.mark.exhaustive
@pytest.mark.parametrize("delay_s", [0.0, 0.002])
def test_a_cameras_delay_is_neither_in_its_clock_nor_in_its_travel(delay_s):
    shot, rig = tracked(delay_s)
    alignments = align_clocks(FiredShot(shot, rig))
    (found,) = alignments
    assert found.status == "ok"
    assert found.offset_s == pytest.approx(0.004, abs=4 * found.u_offset_s)
    result = identify_shot(FiredShot(replace(shot, alignments=alignments), rig), Options())
    motion = bench_motion()
    inside = (motion.times_s > 0.01) & (motion.times_s < 0.18)
    assert np.abs(result.route.travel_m - motion.travel_m)[inside].max() < 1e-3
    kinematic = result.results["kinematic"].estimate
    assert kinematic.mass_kg == pytest.approx(782.0, rel=0.005)


def with_quantity(shot: Shot, name: str, quantity: str) -> Shot:
    return replace(shot, channels={**shot.channels, name: replace(shot.channels[name], quantity=quantity)})


@pytest.mark.parametrize("offset_s", [-0.006, 0.0113])
def test_a_bus_is_aligned_by_a_velocity_of_the_motion_that_the_accelerometer_felt(offset_s):
    rig = rig_with('method = "motion", against = "acc"', PLAIN.format("speed", "bus", "velocity"))
    motion, rng = bench_motion(), np.random.default_rng(2)
    downhill = GRAVITY_M_S2 * math.sin(ELEVATION_RAD)
    velocity = integrate(motion.acceleration_m_s2 + downhill, 5e-5)
    bus = 5e-4 * np.arange(350)
    seen = 0.02 * rng.standard_normal(350) + np.interp(bus + offset_s, motion.times_s, velocity)
    (found,) = align_clocks(FiredShot(on_bus(bench_shot(), "speed", bus, seen, "velocity"), rig))
    assert (found.method, found.status) == ("motion", "ok"), found.reasons
    assert found.offset_s == pytest.approx(offset_s, abs=4 * found.u_offset_s)
    assert found.u_offset_s < 5e-5


@pytest.mark.parametrize(
    ("own", "against"), [("angular_rate", "angular_acceleration"), ("angular_acceleration", "angular_rate")]
)
def test_a_rate_and_its_derivative_are_one_motion(own, against):
    rig = rig_with(
        'method = "motion", against = "turn"',
        PLAIN.format("turn", "recorder", against),
        PLAIN.format("own", "bus", own),
    )
    motion, rng = bench_motion(), np.random.default_rng(3)
    turning = {
        "angular_acceleration": 0.03 * motion.acceleration_m_s2,
        "angular_rate": integrate(0.03 * motion.acceleration_m_s2, 5e-5),
    }
    bus = 1e-3 * np.arange(180)
    seen = np.interp(bus + 0.0042, motion.times_s, turning[own])
    seen = seen + 0.01 * np.ptp(seen) * rng.standard_normal(180)
    shot = on_bus(bench_shot(), "own", bus, seen, own)
    channel = Channel("turn", against, turning[against], TimeBase.stamped("recorder", motion.times_s), "s")
    (found,) = align_clocks(FiredShot(replace(shot, channels={**shot.channels, "turn": channel}), rig))
    assert (found.method, found.status) == ("motion", "ok"), found.reasons
    assert found.offset_s == pytest.approx(0.0042, abs=4 * found.u_offset_s)


def test_a_camera_that_is_declared_before_the_bus_whose_rate_it_needs_is_aligned_all_the_same():
    shot, _ = tracked(0.0)
    bus = 1e-3 * np.arange(-20, 200)
    shot = on_bus(shot, "rate", bus - 0.25, np.zeros(bus.size), "angular_rate")
    tipping = replace(shot.channels["rate"], role="tipping_rate")
    rig = bench_rig(
        tables=CAMERA.replace("DELAY", "0.0")
        + BUS.format('method = "fixed", offset_s = 0.25, u_offset_s = 1e-4')
        + PLAIN.format("rate", "bus", "angular_rate")
        + 'role = "tipping_rate"\nsensor = { u_rel = 0.005 }\n'
    )
    camera, other = align_clocks(FiredShot(replace(shot, channels={**shot.channels, "rate": tipping}), rig))
    assert (camera.clock, camera.status, other.clock) == ("camera", "ok", "bus"), camera.reasons
    assert camera.offset_s == pytest.approx(0.004, abs=4 * camera.u_offset_s)


def test_what_a_motion_needs_and_is_not_there_is_named():
    shot, rig = tracked(0.0)
    (found,) = align_clocks(FiredShot(without_channels(shot, "acc", "p_breech"), rig))
    assert found.reasons == ("channel acc is not in this shot",)
    (found,) = align_clocks(FiredShot(without_channels(shot, "acc"), rig))
    assert (found.method, found.status) == ("force", "ok")
    (found,) = align_clocks(FiredShot(with_quantity(shot, "x", "temperature"), rig))
    assert found.reasons == ("a channel of temperature is not the motion of one of acceleration",)
    (found,) = align_clocks(
        FiredShot(replace(shot, channels={**shot.channels, "acc": replace(shot.channels["acc"], role="")}), rig)
    )
    assert found.reasons == ("channel acc must have the role recoil_acceleration",)


def test_a_shot_without_a_shot_fails_the_cameras_clock_with_the_reason():
    shot, rig = tracked(0.0)
    (found,) = align_clocks(
        FiredShot(with_channels(shot, p_breech=np.zeros(shot.channels["p_breech"].samples.size)), rig)
    )
    assert found.status == "failed"
    assert "breech_pressure shows no shot" in found.reasons[0]


# ---- exposures


EXPOSED = (
    '[[source]]\nname = "camera"\nkind = "camera"\nframe_rate = 2000.0\nMORE\n'
    'align = { method = "exposure", channel = "sync"AGAINST }\n'
    '[[channel]]\nname = "x"\nsource = "camera"\nsignal = "X"\nquantity = "displacement"\nunit = "m"\n'
    'role = "recoil_displacement"\nsensor = { u_rel = 0.001 }\n'
    '[[channel]]\nname = "sync"\nsource = "recorder"\nsignal = "sync"\nquantity = "voltage"\n'
)


def exposed(
    *,
    exposure_s: float = 0.0,
    against: bool = False,
    gated: bool = True,
    lost: tuple[int, ...] = (),
    begun_s: float = 0.0,
):
    """A camera track whose exposures the recorder has as pulses; stamps are those of the shutter's opening.

    `begun_s` is what the camera's clock says at the first frame.
    """
    more = f'exposure_s = {exposure_s}\nexposure_stamp = "start"' if exposure_s else ""
    tables = EXPOSED.replace("MORE", more).replace("AGAINST", ', against = "acc"' if against else "")
    motion, rng = bench_motion(), np.random.default_rng(4)
    downhill = GRAVITY_M_S2 * math.sin(ELEVATION_RAD)
    travel = integrate(integrate(motion.acceleration_m_s2 + downhill, 5e-5), 5e-5)
    frames = np.delete(np.arange(370), lost) / 2000.0
    opened = (1 + 3e-5) * frames + 0.00712
    seen = np.interp(opened + exposure_s / 2, motion.times_s, travel) + rng.normal(0.0, 2e-5, frames.size)
    openings = (1 + 3e-5) * np.arange(0 if gated else -14, 370 if gated else 385) / 2000.0 + 0.00712
    since = motion.times_s[:, None] - openings[None, :]
    pulses = 5.0 * np.any((since >= 0) & (since < 2e-4), axis=1)
    noisy = motion.acceleration_m_s2 + rng.normal(0.0, 3.0, motion.times_s.size)
    shot = bench_shot(acc=noisy)
    recorder = shot.channels["acc"].time_base
    channels = {
        **shot.channels,
        "x": Channel(
            "x", "displacement", seen, TimeBase.stamped("camera", begun_s + frames), "X", "recoil_displacement", 0.001
        ),
        "sync": Channel("sync", "voltage", pulses.astype(np.float64), recorder, "sync"),
    }
    return replace(shot, channels=channels), bench_rig(tables=tables)


@pytest.mark.parametrize("exposure_s", [0.0, 2e-4])
def test_the_pulses_of_the_exposures_give_a_cameras_clock_and_its_lost_frames(exposure_s):
    shot, rig = exposed(exposure_s=exposure_s, lost=(40, 41, 200))
    (found,) = align_clocks(FiredShot(shot, rig))
    assert (found.method, found.status) == ("exposure", "ok"), found.reasons
    middle = 0.09
    # frames are mapped as what they show, the middle of the exposure, and so are the pulses
    assert found.to_reference(middle) == pytest.approx((1 + 3e-5) * middle + 0.00712, abs=4 * found.u_offset_s)
    # every frame falls on the same phase of the recorder's sampling: their edges share its rounding
    assert found.u_offset_s == pytest.approx(5e-5 / math.sqrt(12.0))
    assert (found.details["edges"], found.details["unpaired_reference"]) == (367, 3)
    lost_at = np.array(found.details["unpaired_reference_s"]) - exposure_s / 2
    assert lost_at == pytest.approx((1 + 3e-5) * np.array([40, 41, 200]) / 2000.0 + 0.00712, abs=5e-5)
    causes = [row["cause"] for row in found.details["delays"]]
    assert causes == (["half the exposure"] if exposure_s else [])


def test_a_camera_that_runs_on_without_a_motion_leaves_open_which_pulse_is_which_frames():
    (blind,) = align_clocks(FiredShot(*exposed(gated=False)))
    assert blind.status == "ambiguous"
    assert "other offsets pair the edges as well" in blind.reasons[0]


@pytest.mark.parametrize("begun_s", [0.0, 200.0])
def test_a_camera_that_runs_on_is_told_by_the_motion_which_pulse_is_which_frames(begun_s):
    (found,) = align_clocks(FiredShot(*exposed(gated=False, against=True, begun_s=begun_s)))
    assert (found.method, found.status) == ("exposure", "ok"), found.reasons
    assert found.to_reference(begun_s + 0.09) == pytest.approx((1 + 3e-5) * 0.09 + 0.00712, abs=1e-5)
    assert abs(found.details["second_apart_s"]) < 5 * found.details["u_second_s"]


def test_pulses_that_are_not_there_are_named():
    shot, rig = exposed()
    (found,) = align_clocks(FiredShot(without_channels(shot, "sync"), rig))
    assert found.reasons == ("channel sync is not in this shot",)
    (found,) = align_clocks(FiredShot(with_channels(shot, sync=np.zeros(shot.channels["sync"].samples.size)), rig))
    assert (found.method, found.status) == ("exposure", "failed")


# ---- delays


def test_what_is_declared_of_delays_is_taken_off_budgeted_and_listed():
    tables = CAMERA.replace("DELAY", "0.0, u_delay_s = 3e-5").replace(
        "frame_rate = 5000.0", "frame_rate = 5000.0\nexposure_s = 1e-4"
    )
    shot, _ = tracked(0.0)
    plain = by_clock(align_clocks(FiredShot(shot, tracked(0.0)[1])))["camera"]
    found = by_clock(align_clocks(FiredShot(shot, bench_rig(tables=tables))))["camera"]
    # stamps of the shutter's opening are early by half the exposure: the camera track is that much later than they say
    assert found.offset_s == pytest.approx(plain.offset_s - 5e-5, abs=2e-6)
    assert found.u_offset_s == pytest.approx(math.hypot(plain.u_offset_s, 3e-5, 5e-5 / math.sqrt(3.0)), rel=0.05)
    assert [(row["channel"], row["cause"]) for row in found.details["delays"]] == [
        ("x", "declared"),
        ("x", "half the exposure, stamps taken for its start"),
    ]


def test_a_delay_that_is_hardly_known_leaves_doubt():
    shot, _ = tracked(0.0)
    (found,) = align_clocks(FiredShot(shot, bench_rig(tables=CAMERA.replace("DELAY", "0.0, u_delay_s = 5e-4"))))
    assert found.status == "ambiguous"
    assert "known to 0.50 ms only" in found.reasons[-1]


# ---- all clocks of the virtual rig


@pytest.mark.parametrize(("name", "clocks"), [("field-2013", ["camera"]), ("mixed", ["can", "imu", "camera"])])
def test_all_clocks_of_a_virtual_shot_are_found_in_the_rigs_order(name, clocks):
    virtual = virtual_shot(name)
    assert [a.clock for a in virtual.shot.alignments] == clocks
    for a in virtual.shot.alignments:
        truth = virtual.truth["clocks"][a.clock]
        middle = 0.5 * (virtual.truth["t_fire"] + virtual.truth["t_end"])
        at_source = (middle - truth["offset_s"]) / (1 + truth["drift"])
        # stamps of a bus are laid on their lower edge: late by the shortest way, not by the mean wait
        true = (
            middle - truth.get("latency_s", 0.0) + (a.details["stamps"].get("wait_s", 0.0) if name == "mixed" else 0.0)
        )
        assert a.status == "ok", a.reasons
        limit = 3 if a.clock == "camera" else 4
        assert abs(a.to_reference(at_source) - true) < limit * a.u_offset_s


@pytest.mark.exhaustive
def test_the_camera_of_another_shot_is_noticed():
    virtual, other = virtual_shot(), virtual_shot(seed=4, peak_pressure_pa=115e6)
    strange = {**virtual.shot.channels, "x_camera": other.shot.channels["x_camera"]}
    (found,) = align_clocks(FiredShot(replace(virtual.shot, channels=strange, alignments=()), virtual.rig))
    assert found.status != "ok"
    assert found.reasons
