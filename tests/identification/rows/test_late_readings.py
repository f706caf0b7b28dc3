"""Zeros of the gauges that move at the shot, and what the breech gauge tells of its own once the bore is empty."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from recoil_identification.rows.causes import moving_zero
from recoil_identification.rows.late_readings import (
    GAS,
    MEAN_S,
    LateReadings,
    late_readings,
    settled_by_late_readings,
)
from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.identified import Identification, Options
from recoil_processing.shot.error_source import SourceKind
from recoil_processing.shot.gauge_zero import EARLIEST_S, MOVES_S, zero_moves
from recoil_rigs.rig import Rig, parse_rig
from recoil_rigs.shots.fired_shot import FiredShot
from tests.builders.virtual_shots import VirtualShot, virtual_shot, with_channels


def still(virtual: VirtualShot) -> Rig:
    """State that no zero moves and that the camera bends nothing."""
    text = virtual.rig.text.replace("u_zero_rel = 0.001", "u_zero_rel = 0").replace(
        "distortion_m = 1e-4", "distortion_m = 0"
    )
    return parse_rig(text, virtual.rig.path)


def shot() -> VirtualShot:
    """Take a shot whose zeros do not move, of a rig that says that they may."""
    virtual = virtual_shot()
    return replace(
        virtual, rig=parse_rig(virtual.rig.text.replace("u_zero_rel = 0.0,", "u_zero_rel = 0.001,"), virtual.rig.path)
    )


@cache
def sound() -> Identification:
    return identify_shot(FiredShot(shot().shot, shot().rig), Options())


def moved(role: str, size_pa: float) -> VirtualShot:
    """Let a gauge's zero move within 10 ms, by one of no shape that the inference knows."""
    virtual = shot()
    channel = virtual.shot.by_role(role)
    assert channel is not None
    since = channel.time_base.times_s - virtual.truth["t_fire"]
    ramp = size_pa * np.clip(since / 0.01, 0.0, 1.0)
    return replace(virtual, shot=with_channels(virtual.shot, **{channel.name: np.asarray(channel.samples) + ramp}))


@cache
def found(role: str, size_pa: float) -> Identification:
    virtual = moved(role, size_pa)
    return identify_shot(FiredShot(virtual.shot, virtual.rig), Options())


def late_of(identification: Identification) -> LateReadings:
    causes = identification.route.calibration.block.causes
    one = late_readings(identification.route.signals, identification.route.fitted.interval_s, causes)
    assert one is not None
    return one


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    ("role", "size_pa"), [("breech_pressure", 250e3), ("brake_pressure", -16e3), ("recuperator_pressure", 6e3)]
)
def test_a_zero_that_moves_by_what_the_rig_says_is_in_the_uncertainty(role, size_pa):
    by_zero = found(role, size_pa).chosen.estimate.mass_kg - sound().chosen.estimate.mass_kg
    assert found(role, size_pa).valid, found(role, size_pa).reasons
    assert abs(by_zero) < found(role, size_pa).chosen.estimate.u_kg


@pytest.mark.exhaustive
def test_the_breech_gauge_tells_its_own_zero():
    apart = {}
    for name, one in (("moved", found("breech_pressure", 250e3)), ("not", sound())):
        inferred = one.route.calibration.inferred
        shapes = zero_moves(np.array([0.15]), 0.0)[0]
        sizes = [inferred.value(moving_zero("breech_pressure", tau)) for tau in MOVES_S]
        apart[name] = float(shapes @ sizes)
    assert apart["moved"] - apart["not"] == pytest.approx(250e3, abs=15e3)


@pytest.mark.exhaustive
def test_who_does_not_solve_for_the_zero_takes_what_the_gauge_says_of_it():
    lacking = {}
    for name, one in (("moved", found("breech_pressure", 250e3)), ("not", sound())):
        route = one.route
        causes = route.calibration.block.causes
        settled, lacking_n = settled_by_late_readings(causes, route.signals, route.fitted.interval_s)
        at_end = int(np.searchsorted(route.fitted.times_s, route.fitted.interval_s[1])) - 1
        lacking[name] = lacking_n[at_end]
        # of all that the prior allowed a tenth is left, and no other cause is touched
        left, before = (
            np.sqrt(sum(
                (of.u * of.forces_n[at_end, 0]) ** 2 for of in these if of.source.of == "breech_pressure"
                and of.source.kind is SourceKind.MOVING_ZERO
            ))
            for these in (settled, causes)
        )  # fmt: skip
        assert left < 0.1 * before
        assert [of.source for of in settled] == [of.source for of in causes]
        assert all(a is b for a, b in zip(settled, causes, strict=True) if a.source.of != "breech_pressure")
    area = shot().rig.mechanism.force_areas[0]
    assert lacking["moved"][0] - lacking["not"][0] == pytest.approx(-250e3 * area, rel=0.06)
    assert not np.any(lacking["moved"][1:])


def test_where_no_reading_tells_the_zero_its_causes_stay_what_they_are():
    one = sound()
    causes = one.route.calibration.block.causes
    begins_s = one.route.fitted.interval_s[0]
    settled, lacking_n = settled_by_late_readings(causes, one.route.signals, (begins_s, begins_s + 0.5 * EARLIEST_S))
    assert settled == causes
    assert lacking_n.shape == causes[0].forces_n.shape
    assert not np.any(lacking_n)
    assert settled_by_late_readings((), one.route.signals, one.route.fitted.interval_s)[0] == ()


@pytest.mark.exhaustive
def test_a_zero_that_moves_far_beyond_what_the_rig_says_is_named():
    one = found("breech_pressure", 2.5e6)
    assert not one.valid
    assert any("breech_pressure zero" in reason and "contradicts" in reason for reason in one.reasons), one.reasons


@pytest.mark.exhaustive
def test_where_the_rig_says_that_none_moves_there_is_no_row_of_it():
    virtual = shot()
    one = identify_shot(FiredShot(virtual.shot, still(virtual)), Options())
    sources = {row.source for row in one.chosen.estimate.budget}
    assert not any("that moves" in source or "picture" in source for source in sources)
    assert GAS.name not in sources
    assert one.chosen.estimate.u_kg < sound().chosen.estimate.u_kg


def test_rows_begin_when_the_bore_is_empty_and_end_with_the_travel():
    one = sound()
    rows = late_of(one).rows
    onset_s, end_s = one.route.fitted.interval_s
    assert rows.recorded.size == int((end_s - onset_s - EARLIEST_S) / MEAN_S)
    # of the reading itself, its noise averaged
    assert np.std(rows.recorded) == pytest.approx(rows.sigma, rel=0.5)
    assert rows.unknowns[-1] == GAS.name


def test_a_pressure_that_dies_down_slowly_empties_the_bore_later():
    one = sound()
    times, onset_s = one.route.signals.times_s, one.route.fitted.interval_s[0]
    since = np.maximum(times - onset_s, 0.0)
    counts = []
    for tau_s in (5e-3, 15e-3):
        reading = 1e8 * (1.0 - np.exp(-((since / 1e-3) ** 3))) * np.exp(-since / tau_s)
        signals = replace(one.route.signals, series={**one.route.signals.series, "breech_pressure": reading})
        late = late_readings(signals, one.route.fitted.interval_s, one.route.calibration.block.causes)
        counts.append(0 if late is None else late.rows.recorded.size)
        # no more than is left of the gas is taken for a zero
        assert late is None or late.rows.recorded.max() < 4e3
    assert counts[0] > counts[1]


def test_a_gauge_that_never_falls_tells_nothing_of_its_zero():
    one = sound()
    rising = np.linspace(0.0, 1e8, one.route.signals.times_s.size)
    for reading in (rising, np.zeros_like(rising)):
        signals = replace(one.route.signals, series={**one.route.signals.series, "breech_pressure": reading})
        assert late_readings(signals, one.route.fitted.interval_s, one.route.calibration.block.causes) is None
