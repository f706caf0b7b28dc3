"""A virtual recorder streams what its file holds, tick by tick, and tells of whatever it did not."""

from __future__ import annotations

import itertools
import json
import re
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from recoil_rigs.rig import Rig, load_rig, parse_rig
from recoil_rigs.twin import TwinShot, simulate_shot
from recoil_rigs.twin.faults import Change, ClockStep, Faults, Interval, RecorderFaults
from recoil_rigs.twin.player import TwinPlayer, playable_sources
from recoil_rigs.twin.recorder_replay import RecorderTape, StreamForm
from recoil_rigs.twin.timeline import Timeline
from tests.builders.oxygen_client import Listener, OxygenClient, Packet, numbers, scalings

RATE_HZ = 20_000.0
SIGNALS = ("AI 1/acc_recoil", "AI 2/acc_carriage_x", "AI 3/acc_carriage_y", "AI 4/p_breech")
OVER = {"dewetron": "oxygen"}


@pytest.fixture(scope="module")
def rig() -> Rig:
    whole = load_rig("mixed")
    quick = whole.text.replace("sample_rate_hz = 50000.0", f"sample_rate_hz = {RATE_HZ}")
    return parse_rig(quick, whole.path, whole.databases)


def of_recorder(rig: Rig, device: dict[str, Any] | None = None) -> Rig:
    """The rig whose buses and ports are left out; its recorder has a device where one is given."""
    kept = rig.source("dewetron").model_copy(update={"device": device})
    return replace(rig, sources=(kept,), channels=rig.channels_of("dewetron"), trigger=None)


@pytest.fixture(scope="module")
def shots(rig: Rig, tmp_path_factory: pytest.TempPathFactory) -> list[TwinShot]:
    folder = tmp_path_factory.mktemp("shots")
    return [simulate_shot(rig, folder / str(seed), seed=seed, shot=str(seed)) for seed in (3, 4)]


@dataclass
class Heard:
    """What a client heard of a play, what the player says of it, and the end of the stream if it was a bad one."""

    packets: list[Packet]
    truth: dict[str, Any]
    failure: BaseException | None

    @property
    def data(self) -> list[Packet]:
        return [one for one in self.packets if one.data]

    def rows(self, place: int) -> tuple[NDArray[np.uint64], NDArray[Any]]:
        """Ticks and numbers of a channel, one behind the other."""
        parts = [one.data[place] for one in self.data]
        return np.concatenate([one[0] for one in parts]), np.concatenate([numbers(one[2], one[3]) for one in parts])

    def stretches(self, what: str) -> list[list[int]]:
        return list(self.truth[what]["stretches"])


def heard(
    rig: Rig,
    shots: Sequence[TwinShot],
    faults: RecorderFaults | None = None,
    *,
    items: Sequence[str] = SIGNALS,
    rest_s: float = 0.0,
    **play: Any,
) -> Heard:
    options: dict[str, Any] = {"silence_before_s": 0.2, "silence_after_s": 0.1, "transports": OVER} | play
    options["faults"] = {} if faults is None else {"dewetron": faults}
    with TwinPlayer(rig, shots, **options) as player, OxygenClient(player.devices["dewetron"]) as client:
        time.sleep(rest_s)
        with Listener(client.begin(items)) as listener:
            time.sleep(rest_s)
            player.start()
            assert player.wait(60)
            time.sleep(0.1)
        assert not any(player.failures.values())
        truth = player.truth()
    json.dumps(truth, allow_nan=False)
    return Heard(listener.packets, truth["sources"]["dewetron"], listener.failure)


def values_of(shot: TwinShot) -> NDArray[np.float64]:
    """Samples of a shot's file, shape (n, n_channels)."""
    (file,) = (one for one in shot.files if "dewetron" in one.name)
    return np.loadtxt(file, delimiter=",", skiprows=1)[:, 1:]


def test_a_recorder_is_played_only_where_someone_says_so(rig: Rig) -> None:
    assert [one.name for one in playable_sources(rig)] == ["can", "imu"]
    assert [one.name for one in playable_sources(rig, OVER)] == ["dewetron", "can", "imu"]


@pytest.mark.real_time
@pytest.mark.parametrize(("values", "packet_ms"), [("f32", 10.0), ("i24", 100.0)])
def test_the_stream_holds_the_samples_of_the_files_at_the_ticks_that_are_told(
    rig: Rig, shots: list[TwinShot], values: str, packet_ms: float
) -> None:
    device = {"virtual": "oxygen", "values": values, "packet_ms": packet_ms, "own_ticks": [SIGNALS[1]]}
    said = heard(of_recorder(rig, device), shots, rest_s=0.3)
    assert said.failure is None
    first, *rest = said.packets
    assert (first.status, first.data) == (1, [])
    assert not any(one.status or one.texts for one in rest)
    assert [one.sequence for one in said.packets] == list(range(len(said.packets)))
    assert len({one.seed for one in said.packets}) == 1
    assert "nanoseconds" in first.texts[0]
    told = scalings(first.texts[1])
    assert [(name, unit) for name, unit, _, _ in told] == [
        (SIGNALS[0], "m/s2"), (SIGNALS[1], "m/s2"), (SIGNALS[2], "m/s2"), (SIGNALS[3], "MPa")
    ]  # fmt: skip
    for place, (_, _, factor, offset) in enumerate(told):
        ticks, raw = said.rows(place)
        np.testing.assert_array_equal(np.diff(ticks), 1)
        # 0.3 s of rest came before the play, and went on in it without a gap
        assert said.truth["began_tick"] - ticks[0] > 0.2 * RATE_HZ
        # ticks count from when it was switched on, which was before anybody asked for the stream
        assert ticks[0] > 0.2 * RATE_HZ
        for number, _, at in said.truth["shots"]:
            stored = values_of(shots[number])[:, place]
            start = int(at - ticks[0])
            mine = raw[start : start + stored.size]
            if values == "f32":
                np.testing.assert_array_equal(mine, stored.astype(np.float32))
            else:
                np.testing.assert_array_equal(mine, np.rint((stored - offset) / factor))
                np.testing.assert_allclose(mine * factor + offset, stored, rtol=0, atol=1e-3 * 256 * factor)
    assert said.truth["sent_ticks"]["stretches"] == [[0, said.truth["began_tick"], int(2 * 0.85 * RATE_HZ)]]
    assert {one[2] for packet in said.data for one in packet.data} == {10 if values == "f32" else 4}


@pytest.mark.real_time
def test_between_shots_there_is_the_noise_of_each_shots_own_rest(rig: Rig, shots: list[TwinShot]) -> None:
    said = heard(of_recorder(rig), shots)
    ticks, raw = said.rows(0)
    (_, _, first), (_, _, second) = said.truth["shots"]
    stored = values_of(shots[1])[:1500, 0]
    before = raw[int(second - ticks[0]) - 2000 : int(second - ticks[0])]
    assert second - first == int(0.85 * RATE_HZ)
    assert np.std(before) == pytest.approx(np.std(stored), rel=0.1)
    assert np.mean(before) == pytest.approx(np.mean(stored), abs=0.2 * float(np.std(stored)))


@pytest.mark.real_time
def test_a_slow_clock_takes_longer_for_its_ticks_and_keeps_the_samples(rig: Rig, shots: list[TwinShot]) -> None:
    timeline = Timeline.plan(2, 0.55, 0.2, 0.1)
    tapes = [
        list(RecorderTape(rig, rig.source("dewetron"), shots, timeline, StreamForm(), ppm=ppm).items())
        for ppm in (0.0, 200.0)
    ]
    good, slow = ([(item.at_s, item.first) for item in tape] for tape in tapes)
    # each shot's first sample is where it was: the same shot is played on a clock that is off
    begins = [[one for item in tape for one in item.begins] for tape in tapes]
    assert [k for k, _ in begins[1]] == [0, 1]
    assert begins[0][1][1] - begins[1][1][1] == pytest.approx(200e-6 * 0.85 * RATE_HZ, abs=2)
    within = [(at_s, first) for at_s, first in slow if 0.25 < at_s < 0.7]
    period_s = (within[-1][0] - within[0][0]) / (within[-1][1] - within[0][1])
    assert period_s * RATE_HZ == pytest.approx(1.0002, abs=1e-9)
    assert len(good) >= len(slow) > 100
    for at_s, first in good[:-1]:
        assert at_s == pytest.approx((first + 199) / RATE_HZ, abs=1.1 / RATE_HZ)


@pytest.mark.real_time
def test_every_tick_is_accounted_for_where_packets_are_lost_doubled_cut_late_or_lack_a_channel(
    rig: Rig, shots: list[TwinShot]
) -> None:
    faults = RecorderFaults(
        lost_frames=0.1, doubled_frames=0.1, lacking_frames=0.1, cut_frames=0.7,
        stalls=(Interval(0.3, 0.2),), silences=(Interval(0.9, 0.1),), clock_steps=(ClockStep(0.95, 0.05),),
    )  # fmt: skip
    said = heard(of_recorder(rig), shots, faults)
    assert said.failure is None
    count = round(0.01 * RATE_HZ)
    made = {what: sum(n for _, _, n in said.stretches(f"{what}_ticks")) for what in ("sent", "lost", "silent")}
    assert min(said.truth[what] for what in ("lost", "doubled", "silent", "stalls")) > 0
    assert sum(made.values()) == int(2 * 0.85 * RATE_HZ) == count * said.truth["frames"]
    came = [int(one.data[0][0][0]) for one in said.data]
    sent = [t for _, first, n in said.stretches("sent_ticks") for t in range(first, first + n, count)]
    twice = [t for _, first, n in said.stretches("doubled_ticks") for t in range(first, first + n, count)]
    assert sorted(one for one in came if one >= said.truth["began_tick"]) == sorted(sent + twice)
    lacking = {first: name for name, _, first, _ in said.truth["lacking"]}
    assert lacking
    assert {int(one.data[0][0][0]) for one in said.data if len(one.data) < len(SIGNALS)} == set(lacking)
    jump = max(b - a for a, b in itertools.pairwise(came))
    assert jump >= 0.05 * RATE_HZ
    # the second shot's samples are where it is said that they are, behind the step
    second, stored = said.truth["shots"][1][2], values_of(shots[1])[:, 0].astype(np.float32)
    whole = [one for one in said.data if len(one.data) == len(SIGNALS) and second <= one.data[0][0][0] < second + 9000]
    assert len(whole) > 10
    for one in whole:
        ticks, _, code, data = one.data[0]
        np.testing.assert_array_equal(numbers(code, data), stored[int(ticks[0]) - second :][: ticks.size])
    sequence = [one.sequence for one in said.packets]
    assert max(sequence) + 1 - len(set(sequence)) == said.truth["lost"]


@pytest.mark.real_time
def test_a_lost_connection_leaves_a_gap_and_a_restart_begins_anew(rig: Rig, shots: list[TwinShot]) -> None:
    faults = RecorderFaults(unplugged=(Interval(0.3, 0.2),), restarts=(Interval(0.9, 0.2),))
    options: dict[str, Any] = {"silence_before_s": 0.2, "silence_after_s": 0.1, "transports": OVER}
    parts = []
    with TwinPlayer(of_recorder(rig), shots, faults={"dewetron": faults}, **options) as player:
        device = player.devices["dewetron"]
        with OxygenClient(device) as client, Listener(client.begin(SIGNALS)) as listener:
            player.start()
            listener._thread.join(5)
        parts.append(listener.packets)
        time.sleep(0.3)
        with OxygenClient(device) as client:
            assert client.ask(":DST:STAT1?") == "RUNNING"
            with Listener(client.connect()) as listener:
                listener._thread.join(5)
        parts.append(listener.packets)
        time.sleep(0.25)
        with OxygenClient(device) as client:
            assert client.ask(":DST:STAT1?") == "INVALID"
            with Listener(client.begin(SIGNALS)) as listener:
                assert player.wait(10)
                time.sleep(0.05)
            parts.append(listener.packets)
        truth = player.truth()["sources"]["dewetron"]
    assert truth["disconnects"] == 2
    seeds = [{one.seed for one in part} for part in parts]
    assert seeds[0] == seeds[1] != seeds[2]
    ends, again = int(parts[0][-1].data[0][0][-1]), int(parts[1][1].data[0][0][0])
    missing = [n for what in ("unplugged", "not_open") for e, _, n in truth[f"{what}_ticks"]["stretches"] if e == 0]
    assert again - ends - 1 == sum(missing[:1]) + sum(
        n for e, first, n in truth["not_open_ticks"]["stretches"] if e == 0 and first < again
    )
    assert 0 <= int(parts[2][1].data[0][0][0]) < 0.4 * RATE_HZ
    for part in parts:
        np.testing.assert_array_equal(np.diff(np.concatenate([one.data[0][0] for one in part if one.data])), 1)
    assert {e for e, _, _ in truth["sent_ticks"]["stretches"]} == {0, 1}


@pytest.mark.real_time
def test_changes_and_a_missing_licence_are_said_in_the_stream(rig: Rig, shots: list[TwinShot]) -> None:
    faults = RecorderFaults(
        changes=(Change(0.1, "unit"), Change(0.2, "factor"), Change(0.3, "channels")), licence_s=0.5
    )
    said = heard(of_recorder(rig), shots[:1], faults)
    told = [scalings(one.texts[1]) for one in said.packets if one.texts]
    assert [(rows[0][1], rows[0][2], len(rows)) for rows in told] == [
        ("m/s2", 1.0, 4), ("V", 1.0, 4), ("V", 2.0, 4), ("V", 2.0, 3)
    ]  # fmt: skip
    holds_from = [first for _, _, first in said.truth["changes"]]
    before = [said.packets[said.packets.index(one) + 1] for one in said.packets if one.texts]
    assert [int(one.data[0][0][0]) for one in before[1:]] == holds_from
    assert said.packets[-1].status == 2
    assert sum(n for _, _, n in said.stretches("silent_ticks")) == pytest.approx(0.35 * RATE_HZ, abs=200)


@pytest.mark.real_time
def test_a_device_table_is_the_plays_and_the_hosts(rig: Rig, shots: list[TwinShot]) -> None:
    with pytest.raises(ValueError, match="faults must be those of a recorder"):
        TwinPlayer(rig, shots, transports=OVER, faults={"dewetron": Faults()})
    asked = {"virtual": "oxygen", "values": "i24", "faults": {}, "start": True}
    player = TwinPlayer(of_recorder(rig, asked), shots)
    assert set(player.devices["dewetron"]) == {"oxygen", "stream_port", "start"}
    with pytest.raises(ValueError, match=re.escape("source 'dewetron'.device.packet_ms must be")):
        TwinPlayer(of_recorder(rig, {"virtual": "oxygen", "packet_ms": 0}), shots)


def test_what_makes_no_sense_is_refused() -> None:
    for table, said in (
        ({"values": "f64"}, "values must be one of f32, i24"),
        ({"packet_ms": 0.0}, "packet_ms must be from 0.1 to 1000"),
    ):
        with pytest.raises(ValueError, match=said):
            StreamForm.from_table(table)
    with pytest.raises(ValueError, match="own_ticks: the recorder has no AI 9"):
        StreamForm.from_table({"own_ticks": ["AI 9", SIGNALS[0]]}, SIGNALS)
    with pytest.raises(ValueError, match="error_frames is no fault of a recorder"):
        RecorderFaults(error_frames=0.1)
    with pytest.raises(ValueError, match="unplugged and restarts must follow each other"):
        RecorderFaults(unplugged=(Interval(0.0, 2.0),), restarts=(Interval(1.0, 2.0),))
    with pytest.raises(ValueError, match="there is no fault 'restarts'"):
        Faults.from_table({"restarts": []})
    assert RecorderFaults.from_table({"changes": [[1.0, "unit"]], "restarts": [[1, 2]], "clock_ppm": 200}) == (
        RecorderFaults(changes=(Change(1.0, "unit"),), restarts=(Interval(1.0, 2.0),), clock_ppm=200.0)
    )
    with pytest.raises(ValueError, match=re.escape("changes: a change has a time")):
        RecorderFaults.from_table({"changes": [[1.0, "colour"]]})
