from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from recoil_acquisition.channel import Channel
from recoil_acquisition.clocks.timebase import TimeBase
from recoil_acquisition.shot.shot import Shot
from recoil_processing.alignment.stamps import EvenStamps, even_stamps
from recoil_processing.shot import instants as module
from recoil_processing.shot.instants import delay_of, instants
from recoil_rigs.rig import ChannelSpec, Sensor, Source, parse_rig
from recoil_rigs.shots.fired_shot import FiredShot
from tests.builders.bench_shots import bench_rig, bench_shot

RECORDER = Source(name="recorder", kind="dewetron")
BUS = (
    '[[source]]\nname = "bus"\nkind = "serial"\nalign = { method = "fixed", offset_s = 0.0 }\n'
    'framing = { kind = "sync", sync = "AA 55", length = { fixed = 24 }, counter = { field = "n", modulo = 256 }, '
    'fields = [{ name = "w", at = 2, type = "u16" }, { name = "n", at = 4, type = "u8" }] }\n'
    '[[channel]]\nname = "rate"\nsource = "bus"\nsignal = "w"\nquantity = "angular_rate"\n'
    '[[channel]]\nname = "count"\nsource = "bus"\nsignal = "n"\nquantity = "count"\n'
)


def spec(**sensor: object) -> ChannelSpec:
    return ChannelSpec(name="c", source="recorder", signal="s", quantity="acceleration", sensor=Sensor(**sensor))


def test_a_declared_delay_is_that_of_the_whole_chain():
    both = delay_of(spec(delay_s=4.2e-4, u_delay_s=1e-5, filter_hz=800.0, filter_type="bessel"), RECORDER)
    assert [(p.cause, p.delay_s, p.u_s) for p in both.parts] == [("declared", 4.2e-4, 1e-5)]


def test_a_delay_that_is_declared_as_none_is_none_whatever_the_filter():
    assert delay_of(spec(delay_s=0.0, filter_hz=800.0), RECORDER).parts == ()
    unsaid = delay_of(spec(filter_hz=800.0), RECORDER)
    assert (unsaid.delay_s, unsaid.u_s > 1e-4) == (0.0, True)


def test_filter_mount_and_exposure_add_up():
    camera = Source(name="camera", kind="camera", exposure_s=1e-4, exposure_stamp="start")
    found = delay_of(
        spec(filter_hz=800.0, filter_type="bessel", filter_order=4, resonance_hz=900.0, resonance_damping=0.03), camera
    )
    assert [p.cause for p in found.parts] == ["bessel filter", "mount", "half the exposure"]
    assert found.delay_s == pytest.approx(2.1139 / (2 * np.pi * 800.0) + 0.06 / (2 * np.pi * 900.0) - 5e-5, rel=1e-4)


def late_bus(mean_wait_s: float, *, counted: bool) -> tuple[Shot, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(8)
    index = np.flatnonzero(rng.random(900) > 0.03)
    stamps = 1.0 + 1e-3 * index + mean_wait_s * rng.exponential(1.0, index.size)
    stamps = np.maximum.accumulate(stamps) + 1e-9 * np.arange(index.size)
    base = TimeBase.stamped("bus", stamps)
    channels = dict(bench_shot().channels)
    channels["rate"] = Channel("rate", "angular_rate", np.sin(index / 50.0), base, "w")
    if counted:
        channels["count"] = Channel("count", "count", ((index + 13) % 256).astype(np.float64), base, "n")
    return replace(bench_shot(), channels=channels), index, stamps


def test_samples_of_a_bus_lie_on_the_beat_below_their_stamps():
    rig = bench_rig(tables=BUS)
    shot, index, _ = late_bus(1e-4, counted=False)
    found = instants(shot.channels["rate"], FiredShot(shot, rig))
    assert found.stamps.line == "lower edge"
    assert np.allclose(found.times_s, 1.0 + 1e-3 * index, rtol=0, atol=1e-5)
    assert found.stamps_to_json()["wait_s"] == pytest.approx(1e-4, rel=0.2)
    assert found.u_s < 1e-5


def test_a_late_host_is_seen_through_by_the_message_counter():
    rig = bench_rig(tables=BUS)
    shot, index, stamps = late_bus(1.5e-3, counted=True)
    found = instants(shot.channels["rate"], FiredShot(shot, rig))
    off = found.times_s - 1.0 - 1e-3 * index
    assert found.stamps.even
    assert np.ptp(off) < 3e-4
    assert np.median(np.abs(off)) < 0.3 * np.median(stamps - 1.0 - 1e-3 * index)
    bare = replace(shot, channels={n: c for n, c in shot.channels.items() if n != "count"})
    blind = instants(bare.channels["rate"], FiredShot(bare, rig))
    assert np.array_equal(blind.times_s, stamps)
    assert blind.stamps_to_json() == {"line": "none"}


def test_a_counter_that_was_reset_is_not_trusted():
    rig = bench_rig(tables=BUS)
    shot, index, _ = late_bus(1e-4, counted=True)
    broken = np.asarray(shot.channels["count"].samples).copy()
    broken[400:] = 0.0
    channels = {**shot.channels, "count": replace(shot.channels["count"], samples=broken)}
    found = instants(channels["rate"], FiredShot(replace(shot, channels=channels), rig))
    assert np.allclose(found.times_s, 1.0 + 1e-3 * index, rtol=0, atol=1e-5)


CAN_DBC = """VERSION ""
BO_ 256 M: 8 X
 SG_ w : 0|16@1- (1,0) [0|0] "rad/s" X
 SG_ n : 16|8@1+ (1,0) [0|0] "" X
"""
CAN_BUS = (
    '[[source]]\nname = "bus"\nkind = "can"\ndatabase = "a.dbc"\ncounters = ["M.n"]\n'
    'align = { method = "fixed", offset_s = 0.0 }\n'
    '[[channel]]\nname = "rate"\nsource = "bus"\nsignal = "M.w"\nquantity = "angular_rate"\n'
    '[[channel]]\nname = "count"\nsource = "bus"\nsignal = "M.n"\nquantity = "count"\n'
)


@pytest.mark.parametrize(
    "counts",
    [lambda k: k % 15, lambda k: 1 + k % 15, lambda k: 2 * k % 256, lambda k: k % 256, lambda k: k % 100],
    ids=["0 to 14", "1 to 15", "by 2", "8 bits", "0 to 99"],
)
def test_a_counter_of_any_cycle_sees_through_a_late_host(counts):
    rig = parse_rig(bench_rig().text + CAN_BUS, Path("bench.toml"), {"a.dbc": CAN_DBC})
    shot, index, _ = late_bus(1.5e-3, counted=True)
    channels = dict(shot.channels)
    channels["count"] = replace(channels["count"], samples=counts(index).astype(np.float64))
    found = instants(channels["rate"], FiredShot(replace(shot, channels=channels), rig))
    assert found.stamps.even
    assert np.ptp(found.times_s - 1.0 - 1e-3 * index) < 3e-4


@pytest.mark.parametrize(("most", "times"), [(module.MOST_REMEMBERED, 1), (100, 2)])
def test_the_beat_of_stamps_is_found_once_unless_they_are_very_many(
    monkeypatch: pytest.MonkeyPatch, most: int, times: int
) -> None:
    rig, (shot, _, _) = bench_rig(tables=BUS), late_bus(1.1e-4, counted=False)
    asked: list[EvenStamps] = []
    monkeypatch.setattr(module, "even_stamps", lambda *given: asked.append(even_stamps(*given)) or asked[-1])
    monkeypatch.setattr(module, "MOST_REMEMBERED", most)
    module._remembered.cache_clear()
    one, two = (instants(shot.channels["rate"], FiredShot(shot, rig)) for _ in range(2))
    assert np.array_equal(one.times_s, two.times_s)
    assert len(asked) == times


def test_stamps_that_were_written_to_since_are_other_stamps() -> None:
    rig, (shot, _, stamps) = bench_rig(tables=BUS), late_bus(1e-4, counted=False)
    before = instants(shot.channels["rate"], FiredShot(shot, rig)).times_s
    stamps += 0.5
    assert np.allclose(instants(shot.channels["rate"], FiredShot(shot, rig)).times_s, before + 0.5, rtol=0, atol=1e-9)


def test_a_recorders_instants_are_its_own_less_the_delay():
    shot, rig = bench_shot(), bench_rig(acc="delay_s = 1e-4")
    found = instants(shot.channels["acc"], FiredShot(shot, rig))
    assert np.allclose(found.times_s, shot.channels["acc"].time_base.times_s - 1e-4, rtol=0, atol=1e-12)
    assert (found.stamps.line, found.u_s) == ("none", 0.0)


def recorder_with_jitter(share: float, *, at_stamps: bool, noise: float = 1e-3) -> Shot:
    """Make the bench's shot of one fast wave, its recorder's stamps off the beat by a share of a step."""
    rng = np.random.default_rng(9)
    even_s = 1e-4 * np.arange(6000)
    stamps_s = even_s + 1e-4 * share * rng.standard_normal(even_s.size)
    taken_s = stamps_s if at_stamps else even_s
    samples = np.sin(2 * np.pi * 700.0 * taken_s) + noise * rng.standard_normal(even_s.size)
    base = TimeBase.stamped("recorder", stamps_s)
    return replace(bench_shot(), channels={"acc": Channel("acc", "acceleration", samples, base, "acc")})


def test_a_recorder_whose_stamps_jitter_samples_on_its_beat_and_the_jitter_is_in_u():
    shot = recorder_with_jitter(0.05, at_stamps=False)
    found = instants(shot.channels["acc"], FiredShot(shot, bench_rig()))
    assert found.stamps.even
    # their mean is the beat to the jitter over the root of the samples
    assert np.allclose(np.diff(found.times_s), 1e-4, rtol=1e-4, atol=0)
    assert found.stamps.scatter_s == pytest.approx(5e-6, rel=0.05)
    assert found.u_s == pytest.approx(5e-6, rel=0.1)
    assert found.stamps_to_json()["scatter_s"] == found.stamps.scatter_s


def test_a_recorder_whose_signals_show_that_they_were_taken_at_the_stamps_is_believed():
    shot = recorder_with_jitter(0.05, at_stamps=True)
    channel = shot.channels["acc"]
    found = instants(channel, FiredShot(shot, bench_rig()))
    assert not found.stamps.even
    assert found.times_s.tobytes() == channel.time_base.times_s.tobytes()
    assert found.u_s == pytest.approx(5e-6, rel=0.1)
    assert set(found.stamps_to_json()) == {"line", "scatter_s"}


def test_a_recorder_whose_stamps_wander_is_taken_at_its_stamps():
    rng = np.random.default_rng(10)
    stamps_s = np.cumsum(1e-4 * (1.0 + 0.02 * rng.standard_normal(6000)))
    base = TimeBase.stamped("recorder", stamps_s)
    shot = replace(bench_shot(), channels={"acc": Channel("acc", "acceleration", np.sin(stamps_s), base, "acc")})
    found = instants(shot.channels["acc"], FiredShot(shot, bench_rig()))
    assert not found.stamps.even
    assert found.times_s.tobytes() == stamps_s.tobytes()
