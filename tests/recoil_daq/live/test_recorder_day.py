"""A range day whose recorder is read live: it triggers, its samples are its file's, and the mass needs no file."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Hashable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from recoil_acquisition.store import read_shot
from recoil_daq.live.acquisition import run_live
from recoil_daq.live.shot import LiveOptions, LiveOutcome
from recoil_rigs.twin import TwinShot
from recoil_rigs.twin.range_day import RangeDay
from tests.builders.machine_stalls import MachineStalls
from tests.builders.range_session import Told
from tests.builders.recorder_rigs import LEVEL_PA, with_recorder
from tests.builders.virtual_shots import SHORTER, with_twin

pytestmark = [
    pytest.mark.real_time,
    pytest.mark.skipif(os.name == "nt", reason="Windows has no pseudo-terminals for the virtual port"),
]

PACKET_S = 0.01
RATE_HZ = 25e3
MASS_WITHIN_S = 15.0
"""Longest time from a shot's end to its mass on a machine that runs other tests; benchmarks measure what it takes."""


class Timed(Told):
    """A display that keeps when it was told what."""

    def __init__(self) -> None:
        super().__init__()
        self.at_s: dict[str, float] = {}

    def notice(self, text: str, same: Hashable = None) -> None:
        self.at_s.setdefault(text, time.monotonic())
        super().notice(text, same)


@dataclass
class Day:
    """What became of a day of one shot."""

    outcome: LiveOutcome
    display: Timed
    twin: TwinShot
    played: dict[str, Any]
    fired_ns: int
    stalled_s: float
    out: Path

    @property
    def breech_mpa(self) -> np.ndarray[Any, Any]:
        """The breech pressure in the recorder's file."""
        (file,) = (one for one in self.twin.files if "dewetron" in one.name)
        lines = file.read_text(encoding="utf-8").splitlines()
        column = [i for i, name in enumerate(lines[0].split(",")) if "p_breech" in name]
        return np.loadtxt(lines[1:], delimiter=",", usecols=column)


@pytest.fixture(scope="module", params=["f32", "i24"])
def day(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Day:
    out = tmp_path_factory.mktemp("recorder")
    rig = with_recorder(with_twin("mixed", **SHORTER), file=False, values=request.param)
    days: list[RangeDay] = []
    kept: list[TwinShot] = []

    def keep(one: RangeDay) -> None:
        days.append(one)
        kept.extend(one.shots)

    display = Timed()
    options = LiveOptions(out=out, shots=1, identify=True, without=("camera",))
    with MachineStalls() as machine, pytest.MonkeyPatch.context() as patch:
        patch.setattr("recoil_rigs.twin.range_day.temporary_folder", lambda _: Kept(tmp_path_factory.mktemp("day")))
        play = {"seed": 1, "silence_before_s": 1.5, "silence_after_s": 0.9}
        outcome = run_live(rig, options, display, play=play, watch_day=keep)
    player = days[0].player
    return Day(
        outcome, display, kept[0], player.truth()["sources"]["dewetron"], player.fired_ns[0], machine.largest_s, out
    )


class Kept:
    """A folder that stays."""

    def __init__(self, folder: Path) -> None:
        self.name = str(folder)

    def cleanup(self) -> None:
        """Do nothing."""


def test_the_breech_pressure_of_the_recorder_triggers_within_a_packet_of_its_files_instant(day: Day) -> None:
    crossing = int(np.flatnonzero(day.breech_mpa >= 1e-6 * LEVEL_PA)[0])
    crossed_s = day.fired_ns / 1e9 + crossing / RATE_HZ - day.twin.truth["t_fire"]
    window = day.outcome.shots[0].window
    assert window.decisions[0].channel == "p_breech"
    # a packet comes when its last sample is taken, and later where the machine stood still
    assert abs(window.trigger_s - crossed_s) < PACKET_S + day.stalled_s


def test_the_shot_file_has_every_sample_of_the_recorders_file(day: Day) -> None:
    shot = read_shot(day.out / "0001.h5")
    ((_, _, at_tick),) = day.played["shots"]
    channel = shot.channels["p_breech"]
    stored = 1e6 * day.breech_mpa
    # times of a recorder begin with a whole second of its ticks
    start = round((at_tick / RATE_HZ - channel.time_base.start_s) % 1.0 * RATE_HZ)
    found = channel.samples[start : start + stored.size]
    np.testing.assert_allclose(found, stored, rtol=1e-7, atol=1.0)
    assert float(np.abs(found).max()) > 100e6
    assert channel.time_base.step_s == 1.0 / RATE_HZ
    assert "tick_anchors" in shot.clock_fits["dewetron"]


def test_the_mass_is_there_without_any_file_and_says_that_it_is_of_a_preview(day: Day) -> None:
    assert not list((day.out / "incoming").glob("*dewetron*"))
    (said,) = [text for text in day.display.notices if text.startswith("0001 mass")]
    assert "VALID (provisional: preview of dewetron" in said
    mass = day.outcome.shots[0].mass
    assert mass is not None
    document = json.loads((Path(mass["report"]) / "report.json").read_text(encoding="utf-8"))
    low, high = document["mass"]["U95"]
    assert low < day.twin.truth["m3"] < high
    assert day.display.at_s[said] - day.outcome.shots[0].window.stop_s < MASS_WITHIN_S + day.stalled_s
