"""A trigger that fires at rest is told before the day, and is not armed."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest

from recoil_acquisition.capture.live_source import LiveChannel, LiveSamples
from recoil_acquisition.errors import RigError
from recoil_acquisition.quantities.quantity import UNITS
from recoil_acquisition.trigger import Edge, PulseWidth, RateOfChange, Trigger, Window
from recoil_daq.live.device_check import check_devices
from recoil_daq.live.output_folder import OutputFolder
from recoil_daq.live.range import LiveRange
from recoil_daq.live.shot import LiveOptions
from recoil_daq.live.trigger_at_rest import ConditionAtRest, conditions_at_rest
from recoil_rigs.rig import Rig, parse_rig
from recoil_rigs.twin import simulate_shot
from recoil_rigs.twin.player import TwinPlayer
from tests.builders.range_session import Told
from tests.builders.virtual_shots import SHORTER, with_twin

PRESSURE = LiveChannel("p", "M.p", 1e6, 0.0, "Pa", (0.0, 16e6), "MPa", UNITS["MPa"])
RATE = LiveChannel("w", "w", 1.0, 0.0, "rad/s")
CHANNELS = {"p": PRESSURE, "w": RATE}


def heard(name: str, values: Sequence[float]) -> dict[str, list[LiveSamples]]:
    """Return samples a millisecond apart, in two blocks."""
    times_s, all_values = 1e-3 * np.arange(len(values)), np.array(values, dtype=np.float64)
    half = len(values) // 2
    return {
        name: [
            LiveSamples(name, times_s[:half], all_values[:half]),
            LiveSamples(name, times_s[half:], all_values[half:]),
        ]
    }


def at_rest(condition, values: Sequence[float]) -> ConditionAtRest:
    (found,) = conditions_at_rest(Trigger((condition,)), CHANNELS, heard(condition.channel, values), 5.0)
    return found


SPIKES = [0.0, 2e4, 0.0, 1e4, -1e4, 3e4, 0.0, 2e4]


def test_a_level_within_the_noise_is_counted_in_the_channels_own_unit() -> None:
    found = at_rest(Edge("p", 1.5, 1.0), SPIKES)
    assert (found.level, found.value, found.crossed, found.fired) == ("1.5e-06 MPa", "0.02 MPa", 4, 4)
    assert found.finding.startswith(
        "the trigger fires at rest: crossed 1.5e-06 MPa 4 times in 5 s, is at 0.02 MPa: raise the level, with its unit "
        'such as "1.5 MPa"'
    )


def test_a_level_above_the_noise_says_nothing() -> None:
    found = at_rest(Edge("p", 1.5e6, 1e6), SPIKES)
    assert (found.level, found.crossed, found.beyond, found.finding) == ("1.5 MPa", 0, False, "")


def test_a_channel_that_rests_beyond_its_level_cannot_fire_and_that_is_said() -> None:
    found = at_rest(Edge("p", 1.5, 1.0), [1.6e6] * 8)
    assert (found.crossed, found.beyond) == (0, True)
    assert found.finding.startswith("stands at 1.6 MPa, beyond the trigger's 1.5e-06 MPa: it cannot fire before")


@pytest.mark.parametrize(
    ("condition", "level", "crossed"),
    [
        (Window("p", 5e3, 1.5e4), "0.005 MPa .. 0.015 MPa", 1),
        (RateOfChange("p", 1.5e7), "15 MPa/s", 2),
        (PulseWidth("p", 5e3, shorter_than_s=0.1), "0.005 MPa", 3),
        (Edge("w", 2.0), "2 rad/s", 1),
    ],
)
def test_every_kind_of_condition_is_run_over_what_was_heard(condition, level: str, crossed: int) -> None:
    values = SPIKES if condition.channel == "p" else [0.0, 1.0, 3.0, 0.0]
    found = at_rest(condition, values)
    assert (found.level, found.crossed) == (level, crossed)


def test_where_all_conditions_must_be_met_one_alone_does_not_fire() -> None:
    trigger = Trigger((Edge("p", 1.5), Edge("w", 2.0)), "all")
    samples = heard("p", SPIKES) | heard("w", [0.0] * 8)
    noisy, quiet = conditions_at_rest(trigger, CHANNELS, samples, 5.0)
    assert (noisy.crossed, noisy.fired, quiet.crossed, noisy.finding) == (4, 0, 0, "")


def test_a_channel_that_is_not_heard_is_left_out() -> None:
    trigger = Trigger((Edge("p", 1.5), Edge("w", 2.0)))
    assert [one.channel for one in conditions_at_rest(trigger, CHANNELS, heard("p", SPIKES), 5.0)] == ["p"]


# ---- with devices

needs_a_port = pytest.mark.skipif(os.name == "nt", reason="Windows has no pseudo-terminals for the virtual port")


@pytest.fixture(scope="module")
def low() -> Rig:
    """Return a virtual rig whose level was meant in megapascals."""
    rig = with_twin("mixed", **SHORTER)
    text = rig.text.replace("level = 1.5e6 ", "level = 1.5 ").replace("rearm = 1.0e6 ", "rearm = 1.0 ")
    assert text.count("level = 1.5 ") == 1
    return parse_rig(text, rig.path, rig.databases)


@pytest.fixture
def playing(low: Rig, tmp_path: Path) -> Iterator[TwinPlayer]:
    shot = simulate_shot(low, tmp_path / "simulated", seed=1, shot="0001")
    with TwinPlayer(low, [shot], silence_before_s=60.0) as player:
        player.start()
        yield player


def run(rig: Rig, player: TwinPlayer, out: Path, display: Told):
    with OutputFolder(out) as folder:
        return LiveRange(rig, LiveOptions(out), display, folder, devices=player.devices, rest_s=0.4).run()


@pytest.mark.real_time
@needs_a_port
def test_check_says_how_often_the_trigger_fires_at_rest_and_who_stamps(low: Rig) -> None:
    found = {one.channel: one for one in check_devices(low, listen_s=0.5)}
    assert found["p_brake"].verdict == "fail"
    assert "the trigger fires at rest: crossed 1.5e-06 MPa " in found["p_brake"].finding
    (condition,) = found["p_brake"].triggers
    assert condition.crossed > 10
    assert found["p_brake"].value.endswith(" MPa")
    assert {one.source: one.stamped_by for one in found.values()} == {"can": "adapter", "imu": "sensor"}
    assert {one.verdict for name, one in found.items() if name != "p_brake"} == {"ok"}


@pytest.mark.real_time
@needs_a_port
def test_without_keys_a_trigger_that_fires_at_rest_ends_the_session_and_leaves_nothing(
    low: Rig, playing: TwinPlayer, tmp_path: Path
) -> None:
    display = Told()
    outcome = run(low, playing, tmp_path / "out", display)
    assert isinstance(outcome.error, RigError)
    (fault,) = outcome.error.faults
    assert fault.key == "trigger"
    assert fault.problem.startswith("the trigger fires at rest, in 0.4 s: p_brake crossed 1.5e-06 MPa ")
    assert 'correct the level, with its unit such as "1.5 MPa"' in fault.problem
    assert outcome.shots == []
    assert list((tmp_path / "out" / "journal").glob("*/*")) == []


@pytest.mark.real_time
@needs_a_port
def test_at_the_keys_it_is_asked_and_armed_when_somebody_says_so(low: Rig, playing: TwinPlayer, tmp_path: Path) -> None:
    display = Told(keys={"NOT ARMED": "a", "armed": ""}, has_keys=True)
    display.then["armed"] = lambda: setattr(display, "quits", lambda: True)
    outcome = run(low, playing, tmp_path / "out", display)
    asked = display.notices.index(display.told("NOT ARMED: the trigger fires at rest")[0])
    assert display.notices[asked].endswith("or press a to arm all the same")
    assert display.notices.index("armed") > asked
    assert outcome.error is None
    # values are in the unit in which people read the channel, and what goes on is a count
    assert " MPa)" in display.told("trigger (p_brake at ")[0]
    assert len(display.told("within the ")) < 10


@pytest.mark.real_time
@needs_a_port
def test_a_sound_trigger_is_armed_after_it_was_watched(playing: TwinPlayer, low: Rig, tmp_path: Path) -> None:
    rig = parse_rig(low.text.replace("level = 1.5 ", 'level = "1.5 MPa" '), low.path, low.databases)
    display = Told(keys={"is watched": "", "ending": ""}, has_keys=True)
    states: list[str] = []

    def show(state) -> None:
        states.append(state.state)
        if state.state == "armed":
            display.quits = lambda: True

    display.show = show  # type: ignore[method-assign]
    outcome = run(rig, playing, tmp_path / "out", display)
    assert outcome.error is None
    assert "armed" in states
    assert display.told("NOT ARMED") == []
