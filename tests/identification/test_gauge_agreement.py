"""Several gauges of one pressure: each counts as it should, and one that is off is named and set aside."""

from __future__ import annotations

import datetime as dt
import math
from dataclasses import replace

import numpy as np
import pytest

from recoil_acquisition.shot import Shot
from recoil_daq.ingest import ingest_files
from recoil_identification.analysis import Options, identify_shot
from recoil_identification.gauge_agreement import gauge_agreement
from recoil_identification.identified import Identification
from recoil_identification.targets.target import Case
from recoil_processing.shot.sensor_scales import of_gauge, scale_uncertainty
from recoil_processing.shot.signals import collect_signals
from recoil_rigs.rig import ChannelSpec, Rig
from recoil_rigs.twin import simulate_shot
from tests.builders.virtual_shots import with_channels, with_second_gauge

FIRST, SECOND = "p_breech", "p_breech_2"


@pytest.fixture(scope="module")
def rig() -> Rig:
    return with_second_gauge("field-2013")


@pytest.fixture(scope="module")
def shot(rig: Rig, tmp_path_factory: pytest.TempPathFactory) -> Shot:
    folder = tmp_path_factory.mktemp("two")
    simulated = simulate_shot(rig, folder / "files", seed=9001, shot="s")
    return ingest_files(rig, simulated.files, shot="s", out=folder / "shots", on=dt.date(2026, 6, 1)).shot


@pytest.fixture(scope="module")
def both(rig: Rig, shot: Shot) -> Identification:
    return identify_shot(shot, rig, Options())


@pytest.fixture(scope="module")
def one(rig: Rig, shot: Shot) -> Identification:
    return identify_shot(shot.without_channel(SECOND), rig.without_channel(SECOND), Options())


def rows(found: Identification) -> dict[str, float]:
    return {row.source: row.u_kg for row in found.calibration.estimate.budget}


def of_breech(channel: ChannelSpec, **changed: object) -> ChannelSpec:
    sensor = channel.sensor.model_copy(update=changed)
    return channel.model_copy(update={"sensor": sensor}) if channel.role == "breech_pressure" else channel


def test_two_gauges_make_the_mass_as_sure_as_one_that_is_as_good_as_their_mean(both, one, rig, shot):
    better = tuple(of_breech(channel, u_rel=0.005 / math.sqrt(2)) for channel in rig.without_channel(SECOND).channels)
    as_good = identify_shot(shot.without_channel(SECOND), replace(rig, channels=better), Options())
    together = both.chosen.estimate.u_kg
    assert together == pytest.approx(as_good.chosen.estimate.u_kg, rel=0.05)
    assert together < 0.9 * one.chosen.estimate.u_kg
    assert rows(both)[of_gauge(FIRST)] == pytest.approx(rows(both)[of_gauge(SECOND)], rel=0.02)
    assert both.valid
    assert not [note for note in both.notes if "set aside" in note]
    assert abs(both.chosen.estimate.mass_kg - 782.0) < 3 * together


def test_their_difference_is_told_far_better_than_either(both, shot):
    inferred = both.calibration.inferred
    at = [[unknown.name for unknown in inferred.unknowns].index(f"ln {of_gauge(name)}") for name in (FIRST, SECOND)]
    apart = 2 * np.array([1.0, -1.0])
    u = math.sqrt(apart @ inferred.covariance[np.ix_(at, at)] @ apart)
    assert u < 0.2 * 2 * inferred.u(f"ln {of_gauge(FIRST)}")
    readings = [np.asarray(shot.channels[name].samples) for name in (FIRST, SECOND)]
    readings = [samples - samples[:500].mean() for samples in readings]
    high = readings[1] > 0.2 * readings[1].max()
    by_hand = np.log(readings[0][high] @ readings[1][high] / (readings[1][high] @ readings[1][high]))
    assert apart @ inferred.values[at] == pytest.approx(by_hand, abs=1e-3)


@pytest.mark.parametrize(("channel", "other", "factor"), [(FIRST, SECOND, 1.04), (SECOND, FIRST, 0.96)])
def test_a_gauge_that_is_off_is_set_aside_and_the_others_give_the_mass(rig, shot, channel, other, factor):
    off = with_channels(shot, **{channel: factor * np.asarray(shot.channels[channel].samples)})
    found = identify_shot(off, rig, Options())
    alone = identify_shot(shot.without_channel(channel), rig.without_channel(channel), Options())
    (note,) = [note for note in found.notes if "set aside" in note]
    assert note.startswith(f"{channel} is set aside: it reads ")
    assert f"too {'high' if factor > 1 else 'low'} beside {other} " in note
    assert found.valid
    assert found.chosen.estimate.mass_kg == pytest.approx(alone.chosen.estimate.mass_kg, rel=1e-9)


def test_a_gauge_that_lost_samples_is_set_aside_where_another_did_not(rig, shot, one):
    samples = np.array(shot.channels[SECOND].samples)
    samples[5000:5200] = np.nan
    found = identify_shot(with_channels(shot, **{SECOND: samples}), rig, Options())
    assert [note for note in found.notes if note.startswith(f"{SECOND} is set aside: its clock or some")]
    assert found.chosen.estimate.mass_kg == pytest.approx(one.chosen.estimate.mass_kg, rel=1e-9)


def test_a_gauge_that_a_shot_does_not_have_makes_nothing_surer(rig, shot, one):
    found = identify_shot(shot.without_channel(SECOND), rig, Options())
    assert [note for note in found.notes if note == f"{SECOND} is set aside: it is not in this shot"]
    assert found.chosen.estimate.u_kg == pytest.approx(one.chosen.estimate.u_kg, rel=1e-12)
    by_camera = identify_shot(shot.without_channel(SECOND), rig, Options(method="camera"))
    alone = identify_shot(shot.without_channel(SECOND), rig.without_channel(SECOND), Options(method="camera"))
    assert by_camera.chosen.estimate.u_kg == alone.chosen.estimate.u_kg


def test_without_several_gauges_there_is_nothing_to_compare(rig, shot):
    single, alone = shot.without_channel(SECOND), rig.without_channel(SECOND)
    found = gauge_agreement(collect_signals(single, alone, {}), alone, (0.06, 0.2))
    assert found.rows == found.priors == ()


def test_of_three_gauges_the_mean_is_as_uncertain_as_three_are_and_two_differences_are_told(rig, shot):
    third = rig.channel(SECOND).model_copy(update={"name": "p_breech_3", "signal": "AI 27/p_breech_3"})
    three = replace(rig, channels=(*rig.channels, third))
    channel = replace(shot.channels[SECOND], name="p_breech_3")
    more = replace(shot, channels={**shot.channels, "p_breech_3": channel})
    scales = scale_uncertainty(three)
    assert scales.gauges[0] == pytest.approx(0.005 / math.sqrt(3))
    found = gauge_agreement(collect_signals(more, three, {}), three, (0.06, 0.2))
    assert len(found.rows) == 2
    # two gauges that read the same differ in nothing: of all combinations only one holds a difference
    readings = [np.abs(block.recorded).max() for block in found.rows]
    assert min(readings) > 0
    # no combination holds anything of the mean, nor of another
    shares = np.array([block.columns[:, :3][np.abs(block.columns[:, 0]).argmax()] for block in found.rows])
    shares /= np.linalg.norm(shares, axis=1, keepdims=True)
    np.testing.assert_allclose(shares @ shares.T, np.eye(2), atol=1e-12)
    np.testing.assert_allclose(shares.sum(axis=1), 0.0, atol=1e-12)
    parts = dict(scales.parts["breech_pressure"])
    assert parts == pytest.approx(dict.fromkeys(map(of_gauge, (FIRST, SECOND, "p_breech_3")), 0.005 / 3))


def test_gauges_of_one_standard_share_its_part(rig):
    by_one = [of_breech(channel, reference="dead weights", u_reference_rel=0.003) for channel in rig.channels]
    shared = replace(rig, channels=tuple(by_one))
    parts = dict(scale_uncertainty(shared).parts["breech_pressure"])
    assert parts["standard dead weights"] == pytest.approx(0.003)
    assert parts[of_gauge(FIRST)] == pytest.approx(math.sqrt(0.005**2 - 0.003**2) / 2)
    assert scale_uncertainty(shared).gauges[0] == pytest.approx(math.hypot(0.003, 0.004 / math.sqrt(2)))


def test_targets_take_the_gauges_that_the_mass_takes(rig, shot):
    sound, off = Case(shot, rig), Case(with_channels(shot, **{SECOND: 1.03 * shot.channels[SECOND].samples}), rig)
    assert sound.with_agreeing_gauges() is sound
    agreeing = off.with_agreeing_gauges()
    (left_out,) = set(shot.channels) - set(agreeing.shot.channels)
    assert left_out in (FIRST, SECOND)
    assert not any(channel.name == left_out for channel in agreeing.rig.channels)
    assert agreeing.identified.set_aside == ()
