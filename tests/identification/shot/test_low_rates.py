"""At a rate too low for an estimator, a memory or a cut-off each says so in a line, and the rest is computed."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from recoil_acquisition.clocks.timebase import TimeBase
from recoil_acquisition.errors import IdentificationError
from recoil_identification.calibration.methods import CAMERA_METHODS, FURTHER, METHODS
from recoil_identification.estimators import total_least_squares
from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.filter_choice import choose_filter, mass_filter
from recoil_identification.shot.identified import Options
from recoil_identification.targets import TARGETS, target_function
from recoil_identification.targets.target import Case
from recoil_rigs.shots.fired_shot import FiredShot
from tests.builders.virtual_shots import virtual_shot

SLOW = {"sample_rate_hz": 1000.0, "duration_s": 0.42}


@pytest.mark.whole_way
def test_a_comparison_leaves_out_what_the_shot_does_not_allow_and_says_why(monkeypatch: pytest.MonkeyPatch):
    def refusing(*_: object, **__: object) -> None:
        raise IdentificationError("only 12 samples to estimate the mass from")

    monkeypatch.setattr(total_least_squares, "deming_mass", refusing)
    virtual = virtual_shot("mixed", **SLOW)
    found = identify_shot(FiredShot(virtual.shot, virtual.rig), Options(compare=True))
    assert {"calibrated", "reverse"} <= set(found.results)
    assert "tls" not in found.results
    (note,) = (note for note in found.notes if note.startswith("no estimate by"))
    assert note == "no estimate by tls: only 12 samples to estimate the mass from"


@pytest.mark.whole_way
def test_every_method_memory_and_cutoff_gives_a_mass_or_a_line():
    virtual = virtual_shot(**SLOW)
    asked = [Options(method=method) for method in (*METHODS, *CAMERA_METHODS, *FURTHER)]
    asked += [Options(window_s=window_s) for window_s in (1e-4, 1e-3, 0.05, 0.3, 1e3, None)]
    asked += [Options(cutoff_hz=hz, compare=True) for hz in (1e-3, 1.0, 20.0, 200.0, 400.0, 490.0, 500.0, 1e3, 1e7)]
    asked += [Options(mass_cutoff_hz=hz) for hz in (1.0, 400.0, 500.0, 1e7)]
    lines = []
    for options in asked:
        try:
            assert math.isfinite(identify_shot(FiredShot(virtual.shot, virtual.rig), options).chosen.estimate.mass_kg)
        except IdentificationError as error:
            lines.append(str(error))
    assert all("--window-s" in line for line in lines if "memory" in line)
    assert sum("needs more than" in line for line in lines) == 3
    assert len(lines) < len(asked) - 11


def averaged(rate_hz: float) -> FiredShot:
    """Average neighbours of the recorder's samples of a virtual shot down to a rate; without its camera."""
    virtual = virtual_shot()
    channels = {}
    for name, channel in virtual.shot.channels.items():
        if channel.time_base.clock != virtual.shot.reference_clock:
            continue
        times_s, samples = channel.time_base.times_s, channel.samples
        count = round(channel.time_base.rate_hz / rate_hz)
        whole = samples[: samples.size // count * count].reshape(-1, count).mean(axis=1)
        start_s, step_s = float(np.mean(times_s[:count])), count * float(times_s[1] - times_s[0])
        base = TimeBase.uniform(channel.time_base.clock, start_s, step_s, whole.size)
        channels[name] = replace(channel, samples=whole, time_base=base, raw=None)
    return FiredShot(replace(virtual.shot, channels=channels, alignments=()), virtual.rig)


@pytest.mark.whole_way
@pytest.mark.parametrize("rate_hz", [500.0, 250.0, 160.0])
def test_at_500_hz_and_below_there_is_a_mass_which_is_not_valid_where_hardly_a_sample_shows_the_force(rate_hz):
    fired = averaged(rate_hz)
    found = identify_shot(fired, Options(compare=True))
    assert found.chosen.estimate.mass_kg == pytest.approx(782.0, rel=0.03)
    assert {"calibrated", "reverse", "forward", "paper"} <= set(found.results)
    assert any("record faster" in reason for reason in found.reasons) is (rate_hz < 300.0)
    # the memory of 20 ms that nobody asked for holds too few samples
    assert found.chosen.trace.window_s >= 9.9 / rate_hz
    lines = []
    for name in TARGETS:
        try:
            target_function(name)(Case(fired, Options()))
        except IdentificationError as error:
            lines.append(str(error))
    assert all("record faster" in line for line in lines)
    assert len(lines) <= 3


@pytest.mark.parametrize("rate_hz", [100.0, 40.0, 10.0])
def test_a_record_that_is_too_slow_says_so_in_a_line(rate_hz):
    with pytest.raises(IdentificationError, match="record faster"):
        identify_shot(averaged(rate_hz), Options())


@pytest.mark.whole_way
def test_a_cutoff_of_a_campaign_that_a_slow_shot_does_not_allow_is_its_own():
    virtual = virtual_shot(**SLOW)
    found = identify_shot(FiredShot(virtual.shot, virtual.rig), Options())
    choice = choose_filter(found.route.recorded, virtual.shot)
    assert mass_filter(found.route.recorded, choice, 800.0) == mass_filter(found.route.recorded, choice)
    with pytest.raises(IdentificationError, match="a cut-off of 500 Hz needs more than 1000 samples/s"):
        choose_filter(found.route.recorded, virtual.shot, given_hz=np.nextafter(500.0, 501.0))
