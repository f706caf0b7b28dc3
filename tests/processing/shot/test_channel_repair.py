"""What is mended of a channel before the mass is found, and that it is told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from recoil_acquisition.shot.shot import InputFile
from recoil_identification.report.document.document import report_document
from recoil_identification.report.figure.figures import report_figures
from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.identified import Options
from recoil_processing.shot.channel_repair import level_samples, mend_samples
from recoil_processing.shot.clocks.shot_clocks import align_clocks
from recoil_processing.shot.error_source import SourceKind
from recoil_rigs.rig import parse_rig
from recoil_rigs.shots.fired_shot import FiredShot
from tests.builders.bench_shots import bench_rig, bench_shot
from tests.builders.virtual_shots import identified, virtual_shot, with_channels

SHOT_FILE = InputFile("s1.h5", "ab" * 32, 123, "", "shot file")


def mended(samples: np.ndarray, sensor_range: tuple[float, float] | None = None):
    shot, rig = bench_shot(acc=samples), bench_rig()
    spec = rig.channel("acc")
    spec = spec.model_copy(update={"sensor": spec.sensor.model_copy(update={"range": sensor_range})})
    return mend_samples(shot.channels["acc"], spec, "dewetron")


def noisy() -> np.ndarray:
    samples = np.asarray(bench_shot().channels["acc"].samples, dtype=np.float64)
    return samples + np.random.default_rng(1).normal(0.0, 2.0, samples.size)


def test_a_sound_channel_is_left_alone():
    samples = noisy()
    found = mended(samples, (-5000.0, 5000.0))
    assert found.repairs == ()
    np.testing.assert_array_equal(found.samples, samples)


def test_lost_and_stuck_samples_are_masked_and_counted():
    samples = noisy()
    samples[1000:1010] = np.nan
    samples[2000:2040] = samples[2000]
    found = mended(samples)
    (repair,) = found.repairs
    assert repair.kind == "drop-outs masked"
    assert repair.count == 10 + 39
    assert np.isnan(found.samples[[1000, 2001, 2039]]).all()
    assert np.isfinite(found.samples[2000])


def test_a_clipped_pulse_is_masked_and_never_filled():
    samples = noisy()
    limit = 0.7 * float(samples.max())
    found = mended(np.minimum(samples, limit), (-limit, limit))
    (repair,) = found.repairs
    assert repair.kind == "clipped masked"
    assert np.isnan(found.samples[repair.flags]).all()
    assert repair.count == np.count_nonzero(samples >= limit - 2e-3 * limit)


def test_what_was_mended_once_is_remembered_with_the_channel_and_the_sensors_range():
    rig, channel = bench_rig(), bench_shot(acc=noisy()).channels["acc"]
    spec = rig.channel("acc")
    first = mend_samples(channel, spec, "dewetron")
    assert mend_samples(channel, spec, "dewetron") is first
    narrower = spec.model_copy(update={"sensor": spec.sensor.model_copy(update={"range": (-100.0, 100.0)})})
    assert mend_samples(channel, narrower, "dewetron").repairs


def test_what_was_levelled_last_is_remembered_with_the_channel_and_all_that_it_was_made_of():
    channel = bench_shot(acc=noisy()).channels["acc"]
    samples, step_s, noise = np.asarray(channel.samples), 1e-4, 0.1
    samples = np.append(samples[:-1], np.nan)
    baseline = np.arange(samples.size) < samples.size // 2
    spec = bench_rig().channel("acc")
    slower = spec.model_copy(update={"sensor": spec.sensor.model_copy(update={"time_constant_s": 10.0})})
    first = level_samples(channel, samples, step_s, baseline, spec, noise)
    assert level_samples(channel, samples.copy(), step_s, baseline.copy(), spec, noise) is first
    assert level_samples(replace(channel), samples, step_s, baseline, spec, noise) is not first
    for other in (
        (channel, samples + 1.0, step_s, baseline, spec, noise),
        (channel, samples, 2 * step_s, baseline, spec, noise),
        (channel, samples, step_s, np.roll(baseline, 1), spec, noise),
        (channel, samples, step_s, baseline, slower, noise),
        (channel, samples, step_s, baseline, spec, 2 * noise),
    ):
        before = level_samples(channel, samples, step_s, baseline, spec, noise)
        assert level_samples(*other) is not before


@pytest.mark.exhaustive
def test_hum_is_taken_off_listed_and_a_row_of_the_budget():
    sound = identified("field-2013", 3)
    found = identified("field-2013", 3, hum=0.01)
    told = {(one.channel, one.repair.kind) for one in found.route.signals.repairs}
    assert ("p_breech", "hum subtracted") in told
    assert ("p_brake", "hum subtracted") in told
    assert any(row.source == "brake_pressure hum" and row.u_kg > 0 for row in found.chosen.estimate.budget)
    assert not any("hum" in row.source for row in sound.chosen.estimate.budget)
    low, high = found.chosen.estimate.interval_kg
    assert low < virtual_shot("field-2013", 3).truth["m3"] < high


def test_the_droop_of_a_chain_is_inverted_and_its_time_constant_is_a_row_of_the_budget():
    found = identified("field-2013", 3)
    (droop,) = [one for one in found.route.signals.repairs if one.repair.kind == "droop corrected"]
    assert droop.channel == "acc_recoil"
    (row,) = [row for row in found.chosen.estimate.budget if row.source == "recoil_acceleration droop"]
    assert 0 < row.u_kg < 1.0


HELD = ("p_breech", "p_brake", "p_recuperator", "acc_recoil", "acc_carriage_x", "acc_carriage_y")


@pytest.mark.whole_way
@pytest.mark.parametrize(
    ("names", "one_in"),
    [(("p_breech",), 25), (("p_brake",), 25), (("acc_recoil",), 97), (HELD, 97)],
    ids=["breech", "brake", "acceleration", "all"],
)
def test_samples_lost_one_by_one_cost_the_mass_what_its_budget_says(names, one_in):
    virtual, sound = virtual_shot("field-2013", 3), identified("field-2013", 3).chosen.estimate
    lost = {name: np.array(virtual.shot.channels[name].samples, dtype=np.float64) for name in names}
    for samples in lost.values():
        samples[np.random.default_rng(one_in).random(samples.size) < 1 / one_in] = np.nan
    found = identify_shot(FiredShot(with_channels(virtual.shot, **lost), virtual.rig), Options())
    estimate = found.chosen.estimate
    bridged = {row.source: row.u_kg for row in estimate.budget if row.source.kind is SourceKind.BRIDGED}
    role_of = {channel.name: channel.role for channel in virtual.rig.channels}
    told = {f"{role_of[name]} bridged samples" for name in names}
    assert bridged.keys() <= told
    assert any(bridged.values())
    assert abs(estimate.mass_kg - sound.mass_kg) < 3 * np.sqrt(0.05**2 + np.sum(np.square([*bridged.values()])))
    assert estimate.u_kg < 1.05 * sound.u_kg
    told = {one.channel for one in found.route.signals.repairs if one.repair.kind == "lost samples bridged"}
    assert told == set(names)


@pytest.mark.exhaustive
def test_a_time_constant_that_is_better_known_costs_less():
    virtual = virtual_shot("field-2013", 3)
    exact = virtual.rig.text.replace("time_constant_s = 10.0", "time_constant_s = 10.0, u_time_constant_s = 0.0")
    assert exact != virtual.rig.text
    found = identify_shot(FiredShot(virtual.shot, parse_rig(exact, virtual.rig.path)), Options())
    usual = identified("field-2013", 3)

    def droop_kg(which):
        return next(row.u_kg for row in which.chosen.estimate.budget if row.source == "recoil_acceleration droop")

    assert droop_kg(found) < droop_kg(usual)


@pytest.mark.exhaustive
def test_the_report_lists_every_repair_with_its_samples_and_marks_them_in_the_figures():
    virtual = virtual_shot("field-2013", 3)
    brake = np.asarray(virtual.shot.channels["p_brake"].samples, dtype=np.float64).copy()
    onset = int(np.searchsorted(virtual.shot.channels["p_brake"].time_base.times_s, virtual.truth["t_fire"] + 0.05))
    brake[onset : onset + 40] = np.nan
    shot = with_channels(virtual.shot, p_brake=brake)
    found = identify_shot(FiredShot(shot, virtual.rig), Options())
    rows = report_document(shot, found, version="1", shot_file=SHOT_FILE)["repairs"]
    (row,) = [r for r in rows if r["channel"] == "p_brake"]
    assert (row["what"], row["samples"]) == ("drop-outs masked", f"40 of {brake.size}")
    assert row["spans_s"][0] == pytest.approx([virtual.truth["t_fire"] + 0.05] * 2, abs=2e-3)
    labels = {span.label for figure in report_figures(found) for panel in figure.panels for span in panel.spans}
    assert "p_brake: drop-outs masked, 40 samples" in labels
    assert found.chosen.estimate.mass_kg == pytest.approx(virtual.truth["m3"], rel=0.01)


def test_lost_samples_of_the_carriage_cost_the_clock_nothing():
    virtual = virtual_shot("field-2013", 3)
    lossy = np.asarray(virtual.shot.channels["acc_carriage_x"].samples, dtype=np.float64).copy()
    times = virtual.shot.channels["acc_carriage_x"].time_base.times_s
    inside = (times > virtual.truth["t_fire"] + 0.004) & (times < virtual.truth["t_fire"] + 0.007)
    lossy[inside] = np.nan
    shot = with_channels(virtual.shot, acc_carriage_x=lossy)
    (camera,) = align_clocks(FiredShot(replace(shot, alignments=()), virtual.rig))
    assert camera.status == "ok", camera.reasons
    assert abs(camera.offset_s - virtual.truth["cam_offset"]) < 4 * camera.u_offset_s
