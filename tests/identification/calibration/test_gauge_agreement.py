"""Several gauges of one pressure: each counts as it should, and one that is off is named and set aside."""

from __future__ import annotations

import datetime as dt
import math
import re
from dataclasses import dataclass, replace

import numpy as np
import pytest

from recoil_acquisition.shot.shot import Shot
from recoil_daq.recording.ingest import ingest_files
from recoil_identification.calibration.gauge_agreement import gauge_agreement, gauge_set_aside
from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.identified import Identification, Options
from recoil_identification.targets.target import Case
from recoil_processing.shot.sensor_scales import dynamic_scale, of_gauge, scale_uncertainty
from recoil_processing.shot.signals import GaugeReading, Offset, Signals, collect_signals
from recoil_rigs.rig import ChannelSpec, Rig
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.twin import simulate_shot
from tests.builders.virtual_shots import SHORTER, with_channels, with_second_gauge

FIRST, SECOND = "p_breech", "p_breech_2"


@pytest.fixture(scope="module")
def rig() -> Rig:
    # half as many samples as the rig's own, each as much surer
    return with_second_gauge("field-2013", noise=0.0007, **SHORTER)


@pytest.fixture(scope="module")
def shot(rig: Rig, tmp_path_factory: pytest.TempPathFactory) -> Shot:
    folder = tmp_path_factory.mktemp("two")
    simulated = simulate_shot(rig, folder / "files", seed=9001, shot="s")
    return ingest_files(rig, simulated.files, shot="s", out=folder / "shots", on=dt.date(2026, 6, 1)).shot


@pytest.fixture(scope="module")
def both(rig: Rig, shot: Shot) -> Identification:
    return identify_shot(FiredShot(shot, rig), Options())


@pytest.fixture(scope="module")
def one(rig: Rig, shot: Shot) -> Identification:
    return identify_shot(FiredShot(shot.without_channel(SECOND), rig.without_channel(SECOND)), Options())


def rows(found: Identification) -> dict[str, float]:
    return {row.source: row.u_kg for row in found.route.calibration.estimate.budget}


def of_breech(channel: ChannelSpec, **changed: object) -> ChannelSpec:
    sensor = channel.sensor.model_copy(update=changed)
    return channel.model_copy(update={"sensor": sensor}) if channel.role == "breech_pressure" else channel


@pytest.mark.whole_way
def test_every_scale_is_a_sensors_and_that_of_the_mean_is_both_gauges(both):
    scopes = {row.source: row.scope for row in both.chosen.estimate.budget}
    assert scopes[of_gauge(FIRST)] == scopes[of_gauge(SECOND)] == "sensor"
    assert {source for source, scope in scopes.items() if scope == "sensor"} <= both.sensors.keys()
    assert both.sensors[both.route.calibration.common[0].sources[0]] == "V301 and V399"


@pytest.mark.indispensable("two gauges")
def test_two_gauges_make_the_mass_as_sure_as_one_that_is_as_good_as_their_mean(both, one, rig, shot):
    # of two the scales in a pulse average as those at rest do
    u_rel = math.sqrt((0.005**2 + 0.005**2) / 2 - 0.005**2)
    better = tuple(of_breech(channel, u_rel=u_rel) for channel in rig.without_channel(SECOND).channels)
    as_good = identify_shot(FiredShot(shot.without_channel(SECOND), replace(rig, channels=better)), Options())
    together = both.chosen.estimate.u_kg
    assert together == pytest.approx(as_good.chosen.estimate.u_kg, rel=0.05)
    assert together < 0.9 * one.chosen.estimate.u_kg
    assert rows(both)[of_gauge(FIRST)] == pytest.approx(rows(both)[of_gauge(SECOND)], rel=0.02)
    assert both.valid
    assert not [note for note in both.notes if "set aside" in note]
    assert abs(both.chosen.estimate.mass_kg - 782.0) < 3 * together


@pytest.mark.whole_way
def test_what_only_the_differences_have_is_the_shots_own_and_in_pascal_and_seconds(both):
    units = {one.name: one.unit for one in both.route.calibration.inferred.unknowns if "difference 1" in one.name}
    stated = {row.source: row.sensitivity_per for row in both.route.calibration.estimate.budget}
    assert set(units.values()) == {"Pa", "s"}
    # zeros that are declared not to move have no row
    rows_of = {name.partition(",")[0]: stated[name] for name in units if name in stated}
    assert rows_of == {"zero": "Pa", "delay": "s"}
    own = {row.scope for row in both.route.calibration.estimate.budget if row.source in units}
    assert own == {"shot"}


@pytest.mark.whole_way
def test_areas_and_standards_are_the_rigs_and_gauges_the_sensors(rig, shot):
    by_one = tuple(of_breech(one, reference="dead weights", u_reference_rel=0.003) for one in rig.channels)
    mechanism = replace(
        rig.mechanism, u={**rig.mechanism.u, "bore_area": 1e-5, "brake_area": 1e-5, "bore_friction": 0.002}
    )
    found = identify_shot(FiredShot(shot, replace(rig, channels=by_one, mechanism=mechanism)), Options())
    scopes = {row.source: row.scope for row in found.route.calibration.estimate.budget}
    assert {scopes[source] for source in ("bore_area", "bore_friction", "standard dead weights")} == {"rig"}
    assert scopes[of_gauge(SECOND)] == scopes["brake_pressure sensitivity"] == "sensor"


@pytest.mark.whole_way
def test_their_difference_is_told_far_better_than_either(both, shot):
    inferred = both.route.calibration.inferred
    names = [unknown.name for unknown in inferred.unknowns]
    at = [names.index(f"ln {of(name)}") for of in (of_gauge, dynamic_scale) for name in (FIRST, SECOND)]
    apart, first = 2 * np.array([1.0, -1.0, 1.0, -1.0]), 2 * np.array([1.0, 0.0, 1.0, 0.0])
    u, u_first = (math.sqrt(of @ inferred.covariance[np.ix_(at, at)] @ of) for of in (apart, first))
    assert u < 0.2 * u_first
    readings = [np.asarray(shot.channels[name].samples) for name in (FIRST, SECOND)]
    readings = [samples - samples[:500].mean() for samples in readings]
    high = readings[1] > 0.2 * readings[1].max()
    by_hand = np.log(readings[0][high] @ readings[1][high] / (readings[1][high] @ readings[1][high]))
    assert apart @ inferred.values[at] == pytest.approx(by_hand, abs=1e-3)


@pytest.mark.whole_way
@pytest.mark.parametrize(("channel", "other", "factor"), [(FIRST, SECOND, 1.04), (SECOND, FIRST, 0.96)])
def test_a_gauge_that_is_off_is_set_aside_and_the_others_give_the_mass(rig, shot, channel, other, factor):
    off = with_channels(shot, **{channel: factor * np.asarray(shot.channels[channel].samples)})
    found = identify_shot(FiredShot(off, rig), Options())
    alone = identify_shot(FiredShot(shot.without_channel(channel), rig.without_channel(channel)), Options())
    (note,) = [note for note in found.notes if "set aside" in note]
    assert note.startswith(f"{channel} is set aside: it reads ")
    assert f"too {'high' if factor > 1 else 'low'} beside {other} " in note
    told = re.search(r"it reads ([\d.]+) %", note)
    assert told is not None
    assert float(told[1]) == pytest.approx(4.0, abs=0.7)
    assert found.valid
    assert found.chosen.estimate.mass_kg == pytest.approx(alone.chosen.estimate.mass_kg, rel=1e-9)


@pytest.mark.whole_way
def test_a_gauge_that_lost_samples_is_set_aside_where_another_did_not(rig, shot, one):
    samples = np.array(shot.channels[SECOND].samples)
    samples[5000:5200] = np.nan
    found = identify_shot(FiredShot(with_channels(shot, **{SECOND: samples}), rig), Options())
    assert [note for note in found.notes if note.startswith(f"{SECOND} is set aside: its clock or some")]
    assert found.chosen.estimate.mass_kg == pytest.approx(one.chosen.estimate.mass_kg, rel=1e-9)


@pytest.mark.whole_way
def test_a_gauge_that_a_shot_does_not_have_makes_nothing_surer(rig, shot, one):
    found = identify_shot(FiredShot(shot.without_channel(SECOND), rig), Options())
    assert [note for note in found.notes if note == f"{SECOND} is set aside: it is not in this shot"]
    assert found.chosen.estimate.u_kg == pytest.approx(one.chosen.estimate.u_kg, rel=1e-12)
    by_camera = identify_shot(FiredShot(shot.without_channel(SECOND), rig), Options(method="camera"))
    alone = identify_shot(
        FiredShot(shot.without_channel(SECOND), rig.without_channel(SECOND)), Options(method="camera")
    )
    assert by_camera.chosen.estimate.u_kg == alone.chosen.estimate.u_kg


@pytest.mark.whole_way
def test_without_several_gauges_there_is_nothing_to_compare(rig, shot):
    single, alone = shot.without_channel(SECOND), rig.without_channel(SECOND)
    found = gauge_agreement(collect_signals(FiredShot(single, alone), {}), alone, (0.06, 0.2))
    assert found.rows == found.priors == ()


STEP_S = 2.0**-14
ONSET_S, END_S = 0.0625, 0.125
TIMES_S = STEP_S * np.arange(2560)
PULSE_PA = 2e8 * np.exp(-((np.maximum(TIMES_S - ONSET_S, 0.0) / 0.02 - 1.0) ** 2)) * (TIMES_S >= ONSET_S)
NAMES = (FIRST, SECOND, "p_breech_3")
HELMERT = {
    2: np.array([[1.0, -1.0]]) / math.sqrt(2),
    3: np.array([[1.0, -1.0, 0.0], [1.0, 1.0, -2.0]]) / np.sqrt([[2], [6]]),
}
"""Combinations that add up to nothing, have nothing in common, and a length of one."""


def read(readings: np.ndarray, offsets: list[Offset]) -> Signals:
    """What gauges of the breech read, shape (n_gauges, n)."""
    gauges = [
        GaugeReading(name, samples, offset)
        for name, samples, offset in zip(NAMES[: len(readings)], readings, offsets, strict=True)
    ]
    offset = Offset(0.0, 0.0, 0.0)
    return Signals(
        0.0,
        STEP_S,
        {"breech_pressure": np.mean(readings, axis=0)},
        {"breech_pressure": offset},
        (0.0, 0.05),
        ONSET_S,
        gauges={"breech_pressure": tuple(gauges)},
    )


def with_third(rig: Rig) -> Rig:
    third = rig.channel(SECOND).model_copy(update={"name": NAMES[2], "signal": "AI 27/p_breech_3"})
    return replace(rig, channels=(*rig.channels, third))


@pytest.mark.whole_way
@pytest.mark.parametrize("count", [2, 3])
def test_scales_zeros_that_stand_and_move_and_delays_explain_all_differences(rig, count):
    rng = np.random.default_rng(count)

    def apart(size: float) -> np.ndarray:
        """Errors of each gauge that the mean does not have."""
        errors = size * rng.standard_normal(count)
        return errors - errors.mean()

    scales, zeros, delays_s = apart(0.01), apart(1e5), apart(2e-5)
    moves_s = (2e-3, 30e-3, 0.3)
    moving = [apart(2e5) for _ in moves_s]
    since = np.maximum(TIMES_S - ONSET_S, 0.0)
    at_once, slowly, later = (1.0 - np.exp(-since / tau) for tau in moves_s)
    ways = np.array([at_once, slowly, at_once - later]) / math.sqrt(3)
    moved = sum(np.outer(q, way) for q, way in zip(moving, ways, strict=True))
    readings = (
        np.outer(1.0 + scales, PULSE_PA)
        + zeros[:, np.newaxis]
        + moved
        - np.outer(delays_s, np.gradient(PULSE_PA, STEP_S))
    )
    offsets = [Offset(0.0, 1e3, 1e3)] * count
    found = gauge_agreement(read(readings, offsets), with_third(rig), (ONSET_S, END_S))
    assert len(found.rows) == count - 1
    for number, (block, c) in enumerate(zip(found.rows, HELMERT[count], strict=True), 1):
        name = f"difference {number} of the gauges of breech_pressure"
        # of the mean's scale each gauge has its share
        values = {f"ln {of_gauge(gauge)}": g / count for gauge, g in zip(NAMES, scales, strict=False)}
        values |= {f"ln {dynamic_scale(gauge)}": 0.0 for gauge in NAMES[:count]}
        values |= {f"zero, {name}": c @ zeros, f"delay, {name}": c @ delays_s}
        values |= {
            f"zero that moves in {1e3 * tau:g} ms, {name}": c @ q for q, tau in zip(moving, moves_s, strict=True)
        }
        left, _ = block.linearised(values)
        without, _ = block.linearised(dict.fromkeys(values, 0.0))
        assert np.abs(without).max() > 1.0
        np.testing.assert_allclose(left, 0.0, atol=1e-6)


@pytest.mark.whole_way
@pytest.mark.parametrize(("first", "second"), [(3e4, 4e4), (0.0, 0.0)])
@pytest.mark.parametrize("pressure_pa", [0.0, 1e8])
def test_a_row_is_the_difference_of_a_millisecond_over_its_noise_and_a_thousandth_of_the_pressure(
    rig, first, second, pressure_pa
):
    apart_pa = 5e4
    readings = np.outer([1.0, 1.0], np.full(TIMES_S.size, pressure_pa)) + 0.5 * apart_pa * np.array([[1.0], [-1.0]])
    signals = read(readings, [Offset(0.0, 1e3, first), Offset(0.0, 2e3, second)])
    (block,) = gauge_agreement(signals, rig, (ONSET_S, END_S)).rows
    of_each_ms = np.histogram(TIMES_S[(TIMES_S >= ONSET_S) & (TIMES_S <= END_S)], ONSET_S + 1e-3 * np.arange(64))[0]
    assert block.recorded.shape == of_each_ms.shape == (63,)
    # records without any error are not known better than to a thousandth of a pascal
    noise_pa = max(math.hypot(first, second) / math.sqrt(2), 1e-3)
    sigma_pa = np.hypot(noise_pa / np.sqrt(of_each_ms), 1e-3 * pressure_pa)
    left, _ = block.linearised(dict.fromkeys(block.unknowns, 0.0))
    np.testing.assert_allclose(left, apart_pa / math.sqrt(2) / sigma_pa, rtol=1e-9)


@pytest.mark.whole_way
@pytest.mark.parametrize(
    ("instant_s", "counts"), [(ONSET_S - STEP_S, False), (ONSET_S, True), (END_S, True), (END_S + STEP_S, False)]
)
def test_gauges_are_compared_from_the_onset_to_the_end_of_travel(rig, instant_s, counts):
    readings = np.zeros((2, TIMES_S.size))
    readings[0, np.searchsorted(TIMES_S, instant_s)] = 1e6
    (block,) = gauge_agreement(read(readings, [Offset(0.0, 1e3, 1e3)] * 2), rig, (ONSET_S, END_S)).rows
    assert bool(block.recorded.any()) is counts


@pytest.mark.whole_way
def test_of_a_difference_is_known_what_is_known_of_its_gauges(rig):
    readings = np.zeros((2, TIMES_S.size))
    rig = replace(rig, channels=tuple(of_breech(channel, u_zero_rel=0.001) for channel in rig.channels))
    moving_pa = 0.001 * 250e6
    known = gauge_agreement(read(readings, [Offset(0.0, 3e3, 1e3), Offset(0.0, 4e3, 1e3)]), rig, (ONSET_S, END_S))
    assert {prior.sources[0].partition(",")[0]: math.sqrt(prior.covariance[0, 0]) for prior in known.priors} == {
        "zero": pytest.approx(5e3 / math.sqrt(2)),
        "zero that moves in 2 ms": pytest.approx(moving_pa),
        "zero that moves in 30 ms": pytest.approx(moving_pa),
        "zero that moves in 300 ms": pytest.approx(moving_pa),
        "delay": pytest.approx(5e-5),
    }
    unknown = gauge_agreement(
        read(readings, [Offset(0.0, math.inf, 1e3), Offset(0.0, 4e3, 1e3)]), rig, (ONSET_S, END_S)
    )
    assert not any(name.startswith("zero, ") for name in unknown.rows[0].unknowns)


@dataclass
class Residuals:
    """What a calibration says of the gauges."""

    normalised_residuals: dict[str, float]

    @property
    def pulls(self) -> dict[str, float]:
        return {source: 0.5 * w for source, w in self.normalised_residuals.items()}

    @property
    def inferred(self) -> Residuals:
        return self

    def value(self, name: str) -> float:
        return 0.01 * math.copysign(1.0, self.normalised_residuals[name.removeprefix("ln ")])


@pytest.mark.parametrize(
    ("first", "second", "set_aside"),
    [
        (2.81, 0.0, None),
        (2.82, 0.0, FIRST),
        (2.82, -2.5, FIRST),
        (-2.82, 2.53, None),
        (2.0, -2.82, SECOND),
        (2.82, 2.82, None),
        (2.0, 2.0, None),
    ],
)
def test_a_gauge_is_set_aside_beyond_the_limit_where_no_other_is_as_far_off(first, second, set_aside):
    signals = read(np.zeros((2, TIMES_S.size)), [Offset(0.0, 1e3, 1e3)] * 2)
    found = gauge_set_aside(Residuals({of_gauge(FIRST): first, of_gauge(SECOND): second}), signals)
    assert (None if found is None else found[0]) == set_aside
    if found is not None:
        # a hundredth of the mean's scale is two of one gauge's, and of what it is off the shot shows a quarter
        off, other = (first, SECOND) if set_aside == FIRST else (second, FIRST)
        assert found[1].startswith(f"it reads 8 % too {'high' if off > 0 else 'low'} beside {other} and")


def test_gauges_that_are_taken_for_exact_are_not_doubted():
    signals = read(np.zeros((2, TIMES_S.size)), [Offset(0.0, 1e3, 1e3)] * 2)
    assert gauge_set_aside(Residuals({}), signals) is None
    assert gauge_set_aside(Residuals({}), replace(signals, gauges={})) is None


@pytest.mark.whole_way
def test_of_three_gauges_the_mean_is_as_uncertain_as_three_are_and_two_differences_are_told(rig, shot):
    third = rig.channel(SECOND).model_copy(update={"name": "p_breech_3", "signal": "AI 27/p_breech_3"})
    three = replace(rig, channels=(*rig.channels, third))
    channel = replace(shot.channels[SECOND], name="p_breech_3")
    more = replace(shot, channels={**shot.channels, "p_breech_3": channel})
    scales = scale_uncertainty(three)
    assert scales.gauges[0] == pytest.approx(math.hypot(0.005, 0.005) / math.sqrt(3))
    found = gauge_agreement(collect_signals(FiredShot(more, three), {}), three, (0.06, 0.2))
    assert len(found.rows) == 2
    # two gauges that read the same differ in nothing: of all combinations only one holds a difference
    readings = [np.abs(block.recorded).max() for block in found.rows]
    assert min(readings) > 0
    # no combination holds anything of the mean, nor of another
    shares = np.array([block.columns[:, :3][np.abs(block.columns[:, 0]).argmax()] for block in found.rows])
    for block in found.rows:  # in a pulse each is off by its scale at rest and by that beside it
        np.testing.assert_array_equal(block.columns[:, :3], block.columns[:, 3:6])
    shares /= np.linalg.norm(shares, axis=1, keepdims=True)
    np.testing.assert_allclose(shares @ shares.T, np.eye(2), atol=1e-12)
    np.testing.assert_allclose(shares.sum(axis=1), 0.0, atol=1e-12)
    parts = dict(scales.parts["breech_pressure"])
    gauges = (FIRST, SECOND, "p_breech_3")
    assert parts == pytest.approx(
        dict.fromkeys((of(one) for of in (of_gauge, dynamic_scale) for one in gauges), 0.005 / 3)
    )


@pytest.mark.whole_way
def test_gauges_of_one_standard_share_its_part(rig):
    by_one = [of_breech(channel, reference="dead weights", u_reference_rel=0.003) for channel in rig.channels]
    shared = replace(rig, channels=tuple(by_one))
    parts = dict(scale_uncertainty(shared).parts["breech_pressure"])
    assert parts["standard dead weights"] == pytest.approx(0.003)
    assert parts[of_gauge(FIRST)] == pytest.approx(math.sqrt(0.005**2 - 0.003**2) / 2)
    own = math.hypot(0.004, 0.005) / math.sqrt(2)
    assert scale_uncertainty(shared).gauges[0] == pytest.approx(math.hypot(0.003, own))


@pytest.mark.whole_way
def test_targets_take_the_gauges_that_the_mass_takes(rig, shot):
    sound, off = (
        Case(FiredShot(shot, rig)),
        Case(FiredShot(with_channels(shot, **{SECOND: 1.03 * shot.channels[SECOND].samples}), rig)),
    )
    assert sound.with_agreeing_gauges() is sound
    agreeing = off.with_agreeing_gauges()
    (left_out,) = set(shot.channels) - set(agreeing.fired.shot.channels)
    assert left_out in (FIRST, SECOND)
    assert not any(channel.name == left_out for channel in agreeing.fired.rig.channels)
    assert agreeing.identified.set_aside == ()
