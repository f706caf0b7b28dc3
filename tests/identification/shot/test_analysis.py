from __future__ import annotations

import math
import re
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.shot.quality_check import Check
from recoil_acquisition.shot.shot import Shot
from recoil_identification.calibration.methods import METHODS
from recoil_identification.inference.solve import solve
from recoil_identification.rows.camera_rows import CameraRows
from recoil_identification.rows.causes import NO_CARRIAGE_RATE
from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.identified import Identification, Options
from recoil_processing.shot.camera_motion import motion_fit
from recoil_processing.shot.clocks.shot_clocks import align_clocks
from recoil_processing.shot.sensor_scales import scale_uncertainty
from recoil_rigs.rig import Rig, parse_rig
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.tables.specification import Specification
from tests.builders.bench_shots import MASS_KG, bench_motion, bench_rig, bench_shot
from tests.builders.virtual_shots import VirtualShot, identified, virtual_shot, with_channels, without_channels

RIGS = ("field-2013", "mixed")


def true_sensors() -> VirtualShot:
    """Simulate a shot whose sensors and friction are what the rig says."""
    return virtual_shot(gain_errors=False, friction_error=False)


def scaled(virtual: VirtualShot, name: str, factor: float, *, align: bool = False) -> Identification:
    shot = with_channels(virtual.shot, **{name: factor * np.asarray(virtual.shot.channels[name].samples)})
    if align:
        shot = replace(shot, alignments=align_clocks(FiredShot(shot, virtual.rig)))
    return identify_shot(FiredShot(shot, virtual.rig), Options())


# ---- shots of the virtual rig


@pytest.mark.parametrize("name", RIGS)
def test_the_mass_of_a_virtual_shot_is_found_within_its_uncertainty(name):
    found, truth = identified(name), virtual_shot(name).truth
    for method in ("calibrated", "reverse", "forward", "kinematic"):
        estimate = found.results[method].estimate
        assert abs(estimate.mass_kg - truth["m3"]) < 3 * estimate.u_kg
    assert found.chosen.rpe_percent < 2
    assert found.chosen.estimate.u_kg < 0.005 * truth["m3"]
    assert found.chosen.trace.share > 0.95
    assert found.valid, found.reasons
    unidentified = [f"{count} samples not identified: {why}" for why, count in found.chosen.trace.reasons.items()]
    assert list(found.notes) == unidentified


@pytest.mark.parametrize("name", RIGS)
def test_the_papers_method_is_low_by_errors_in_variables(name):
    found = identified(name)
    assert found.results["paper"].estimate.mass_kg < 0.98 * virtual_shot(name).truth["m3"]
    assert found.results["paper"].rpe_percent > 2


def test_frischs_bracket_is_about_the_mass_that_it_stands_beside():
    found = identified("field-2013")
    low, high = found.frisch_bracket_kg
    # sensors' errors taken off, the mass is between both regressions, but for the weights of its rows
    assert low - 0.3 < found.chosen.estimate.mass_kg < high + 0.3
    plain = replace(found, route=replace(found.route, method="reverse")).frisch_bracket_kg
    assert plain[1] == pytest.approx(found.results["reverse"].estimate.mass_kg, rel=1e-12)
    assert plain[0] == pytest.approx(found.results["forward"].estimate.mass_kg, rel=1e-12)
    # the published mass is of the signals as recorded, and low: its bracket begins at it
    published = replace(found, route=replace(found.route, method="paper")).frisch_bracket_kg
    assert published[0] == pytest.approx(found.results["paper"].estimate.mass_kg, rel=1e-12)
    assert published[1] == pytest.approx(low, rel=0.01)


@pytest.mark.whole_way
@pytest.mark.parametrize(("method", "beside"), [("calibrated", "calibrated"), ("paper", "reverse")])
def test_the_test_on_bias_is_about_the_signals_of_the_mass_that_it_stands_beside(method, beside):
    virtual = virtual_shot("field-2013")
    found = identify_shot(FiredShot(virtual.shot, virtual.rig), Options(method=method))
    estimate = found.results[beside].estimate
    assert found.endogeneity.biased
    # the instrument takes the bias off, whatever weights its rows have
    assert found.endogeneity.instrumental_kg == pytest.approx(estimate.mass_kg, abs=0.15 * estimate.u_kg)
    assert found.endogeneity.plain_kg == pytest.approx(found.results["paper"].estimate.mass_kg, rel=2e-3)


@pytest.mark.whole_way
def test_a_method_without_a_mass_over_time_has_no_rpe():
    virtual = virtual_shot("field-2013")
    found = identify_shot(FiredShot(virtual.shot, virtual.rig), Options(method="tls"))
    assert math.isnan(found.chosen.rpe_percent)
    assert all(math.isnan(end) for end in found.chosen.rpe_interval_percent)
    assert found.results["reverse"].rpe_percent > 0


@pytest.mark.parametrize("name", RIGS)
def test_the_interval_is_that_of_the_recoil(name):
    found, truth = identified(name), virtual_shot(name).truth
    start, end = found.route.filtered.interval_s
    assert start == pytest.approx(truth["t_fire"], abs=1e-3)
    assert end == pytest.approx(truth["t_end"], abs=2e-3)
    at = found.route.signals.times_s
    assert found.route.travel_m[np.argmin(np.abs(at - truth["t_end"]))] == pytest.approx(truth["stroke_m"], rel=0.005)
    assert found.route.velocity_m_s[np.argmin(np.abs(at - truth["t_end"]))] == pytest.approx(0.0, abs=0.05)


@pytest.mark.parametrize("name", RIGS)
def test_the_identified_errors_of_the_sensors_point_at_the_true_ones(name):
    found, truth = identified(name), virtual_shot(name).truth
    calibration = found.route.calibration
    true = [truth["gains"][n] - 1 for n in ("p_breech", "p_brake", "p_recuperator")]
    friction = virtual_shot(name).rig.mechanism.friction - truth["friction"]
    # within what the calibrations leave, and the accelerometer's, known by the camera, much closer
    assert np.all(np.abs(calibration.gauge_errors - true) < 3 * np.array([0.005, 0.004, 0.004]))
    assert abs(calibration.friction_error_n - friction) < 3 * 150
    assert calibration.acceleration_error == pytest.approx(truth["gains"]["acc_recoil"] - 1, abs=0.004)


@pytest.mark.parametrize("name", RIGS)
def test_the_budget_of_every_method_is_complete_and_named_once(name):
    found = identified(name)
    for method, result in found.results.items():
        sources = [row.source for row in result.estimate.budget]
        assert len(set(sources)) == len(sources), method
        assert all(math.isfinite(row.u_kg) and row.u_kg >= 0 for row in result.estimate.budget)
        assert ("alignment of clock can" in sources) == (name == "mixed")
    assert "alignment of clock camera" in [row.source for row in found.results["kinematic"].estimate.budget]
    assert "camera scale" in [row.source for row in found.results["kinematic"].estimate.budget]


@pytest.mark.whole_way
@pytest.mark.parametrize("method", METHODS)
def test_the_chosen_method_gives_the_mass_and_the_rest_is_there_too(method):
    virtual = virtual_shot()
    found = identify_shot(FiredShot(virtual.shot, virtual.rig), Options(method=method, window_s=0.03))
    assert found.chosen.estimate.method == method
    assert set(found.results) == {*METHODS, "kinematic"}
    assert found.chosen.trace.window_s == pytest.approx(0.03)


# ---- what makes a result not valid


@pytest.mark.whole_way
@pytest.mark.parametrize(
    ("name", "factor", "sensor"),
    [("p_breech", 1.03, "breech_pressure"), ("p_breech", 0.97, "breech_pressure"), ("p_brake", 0.95, "brake_pressure")],
)
def test_a_sensitivity_that_is_wrong_beyond_its_uncertainty_is_named(name, factor, sensor):
    found = scaled(true_sensors(), name, factor)
    assert not found.valid
    word = "high" if factor > 1 else "low"
    assert any(re.match(f"{sensor} sensitivity and area contradicts .* reads {word}", r) for r in found.reasons)


@pytest.mark.whole_way
@pytest.mark.parametrize(("name", "factor"), [("acc_recoil", 1.03), ("x_camera", 0.97)])
def test_an_accelerometer_and_a_camera_that_disagree_are_named(name, factor):
    found = scaled(virtual_shot(), name, factor, align=True)
    assert not found.valid
    assert any("camera" in r and "accelerometer" in r for r in found.reasons)


def swapped(rig: Rig, one: str, other: str) -> Rig:
    """Exchange two areas of the mechanism."""
    values = {k: str(getattr(rig.mechanism, k)) for k in (one, other)}
    text = rig.text
    for key, value in ((one, values[other]), (other, values[one])):
        text = re.sub(rf"(?m)^{key} = \S+", f"{key} = {value}", text)
    return parse_rig(text, rig.path, rig.databases)


@pytest.mark.whole_way
@pytest.mark.parametrize(
    ("one", "other"),
    [("bore_area", "brake_area"), ("bore_area", "recuperator_area"), ("brake_area", "recuperator_area")],
)
def test_swapped_areas_are_noticed_by_name(one, other):
    virtual = virtual_shot()
    found = identify_shot(FiredShot(virtual.shot, swapped(virtual.rig, one, other)), Options())
    assert not found.valid
    doubted = [r for r in found.reasons if "contradicts the other sensors" in r]
    assert any(r.startswith(("breech_pressure", "brake_pressure")) for r in doubted)


@pytest.mark.whole_way
def test_every_failed_check_and_every_doubtful_clock_is_one_reason():
    virtual = virtual_shot()
    (good,) = virtual.shot.alignments
    failed = replace(virtual.shot.quality[0], verdict="fail", detail="cable off")
    alignment = replace(failed, channel="camera", check=Check.ALIGNMENT, detail="by motion: no motion")
    bad = replace(good, status="failed", reasons=("no motion",))
    shot = replace(virtual.shot, alignments=(bad,), quality=(failed, alignment))
    found = identify_shot(FiredShot(shot, virtual.rig), Options())
    assert found.reasons == (
        "clock camera: alignment failed: no motion",
        f"quality: {failed.channel}: cable off",
    )
    assert "kinematic" not in found.results


@pytest.mark.whole_way
def test_a_shot_of_which_little_can_be_identified_is_not_valid():
    virtual = virtual_shot()
    noise = np.random.default_rng(1).normal(0.0, 400.0, virtual.shot.channels["acc_recoil"].samples.size)
    loud = with_channels(virtual.shot, acc_recoil=virtual.shot.channels["acc_recoil"].samples + noise)
    found = identify_shot(FiredShot(loud, virtual.rig), Options(method="reverse", window_s=0.002))
    assert any(r.startswith("only ") and "could be identified" in r for r in found.reasons)


@pytest.mark.whole_way
def test_without_a_baseline_the_result_is_not_valid():
    motion = bench_motion()
    shot = bench_shot()
    first = int(np.searchsorted(motion.times_s, 0.027))
    cut = {
        n: replace(
            c,
            samples=c.samples[first:],
            time_base=replace(c.time_base, start_s=float(motion.times_s[first]), count=c.samples.size - first),
        )
        for n, c in shot.channels.items()
    }
    found = identify_shot(FiredShot(replace(shot, channels=cut), bench_rig()), Options())
    assert any(r.startswith("no pre-trigger baseline") for r in found.reasons)
    assert found.chosen.estimate.mass_kg == pytest.approx(MASS_KG, rel=0.01)


def test_a_recuperator_gauge_that_loses_the_pressure_at_rest_is_refused_as_valid():
    found = identify_shot(FiredShot(bench_shot(), bench_rig(p_recuperator="time_constant_s = 1.0")), Options())
    assert any(r.startswith("p_recuperator is AC-coupled") for r in found.reasons)


# ---- what is missing


CARRIAGE = ["carriage_acceleration_x", "carriage_acceleration_y", "carriage_rate", "tipping_rate"]


@pytest.mark.whole_way
def test_a_rig_without_carriage_sensors_and_camera_says_what_is_not_measured():
    found = identify_shot(FiredShot(bench_shot(), bench_rig()), Options())
    assert found.valid
    assert set(found.results) == set(METHODS)
    assert [row["quantity"] for row in found.assumptions if row["taken"] == "not measured"] == CARRIAGE
    assert found.notes == ()


@pytest.mark.whole_way
def test_a_carriage_sensor_that_the_shot_lacks_is_noted():
    shot, rig = bench_shot(), bench_rig()
    less = parse_rig(
        f"""{rig.text}
[[channel]]
name = "gyro"
source = "recorder"
signal = "gyro"
quantity = "angular_rate"
role = "carriage_rate"
sensor = {{ u_rel = 0.01 }}
""",
        rig.path,
    )
    (note,) = identify_shot(FiredShot(shot, less), Options()).notes
    assert note.startswith("no usable channel of role carriage_rate: ")


@pytest.mark.whole_way
@pytest.mark.parametrize("method", ["calibrated", "camera"])
def test_what_a_carriages_missing_gyro_could_have_contributed_is_in_the_budget(method: str) -> None:
    virtual, options = virtual_shot("mixed"), Options(method=method)
    lacking = without_channels(virtual.shot, "gyro_carriage")
    estimate = identify_shot(FiredShot(lacking, virtual.rig), options).chosen.estimate
    (row,) = [row for row in estimate.budget if row.source == NO_CARRIAGE_RATE]
    whole = identify_shot(FiredShot(virtual.shot, virtual.rig), options).chosen.estimate
    assert NO_CARRIAGE_RATE not in [row.source for row in whole.budget]
    assert abs(estimate.mass_kg - whole.mass_kg) < 0.1 * estimate.u_kg
    assert 0.0 < row.u_kg < 0.1 * estimate.u_kg


@pytest.mark.whole_way
def test_the_frames_see_what_a_carriage_that_turns_with_the_tipping_part_would_make_of_the_travel() -> None:
    virtual = virtual_shot("mixed")
    tipping = np.array(virtual.shot.channels["gyro_tipping"].samples)

    def rows(shot: Shot) -> CameraRows:
        found = identify_shot(FiredShot(shot, virtual.rig), Options()).route.calibration.camera
        assert isinstance(found, CameraRows)
        return found

    at_rest, as_one = (rows(with_channels(virtual.shot, gyro_carriage=share * tipping)) for share in (0.0, 1.0))
    lacking = rows(without_channels(virtual.shot, "gyro_carriage"))
    added_m = -lacking.zeros_m[:, lacking.sizes.index(NO_CARRIAGE_RATE)]
    expected_m = as_one.felt_m + as_one.other_m - at_rest.felt_m - at_rest.other_m
    assert np.abs(expected_m).max() > 1e-4
    np.testing.assert_allclose(added_m, expected_m, atol=0.05 * np.abs(expected_m).max())


@pytest.mark.whole_way
@pytest.mark.parametrize("method", ["calibrated", "camera"])
def test_without_the_gyro_of_the_tipping_part_no_mass_is_valid(method: str) -> None:
    virtual = virtual_shot("mixed")
    found = identify_shot(
        FiredShot(without_channels(virtual.shot, "gyro_tipping"), virtual.rig), Options(method=method)
    )
    assert any(reason.startswith("no usable channel of role tipping_rate: ") for reason in found.reasons)


def test_a_record_that_ends_before_the_recoil_is_noted():
    motion = bench_motion()
    shot = bench_shot()
    short = {
        n: replace(c, samples=c.samples[:1800], time_base=replace(c.time_base, count=1800))
        for n, c in shot.channels.items()
    }
    found = identify_shot(FiredShot(replace(shot, channels=short), bench_rig()), Options())
    assert "the record ends before the recoil does: the interval ends with it" in found.notes
    assert found.route.filtered.interval_s[1] == pytest.approx(motion.times_s[1799])


def test_without_the_recoiling_parts_accelerometer_there_is_no_number():
    with pytest.raises(IdentificationError, match="no channel of role recoil_acceleration") as caught:
        identify_shot(FiredShot(without_channels(bench_shot(), "acc"), bench_rig()), Options())
    assert "breech_pressure" in str(caught.value)


def test_an_accelerometer_on_a_clock_that_failed_is_no_number():
    shot = bench_shot()
    away = replace(shot.channels["acc"], time_base=replace(shot.channels["acc"].time_base, clock="bus"))
    with pytest.raises(IdentificationError, match="accelerometer is on a clock that could not be aligned"):
        identify_shot(FiredShot(replace(shot, channels={**shot.channels, "acc": away}), bench_rig()), Options())


@pytest.mark.parametrize("role", ["breech", "brake", "recuperator"])
def test_without_a_pressure_there_is_no_number(role):
    with pytest.raises(IdentificationError, match=f"no usable channel of role {role}_pressure"):
        identify_shot(FiredShot(without_channels(bench_shot(), f"p_{role}"), bench_rig()), Options())


def test_a_brake_whose_record_lies_elsewhere_is_no_number():
    shot = bench_shot()
    brake = shot.channels["p_brake"]
    later = replace(brake, time_base=replace(brake.time_base, start_s=50.0))
    with pytest.raises(IdentificationError, match="nothing tells of brake_pressure during the motion"):
        identify_shot(FiredShot(replace(shot, channels={**shot.channels, "p_brake": later}), bench_rig()), Options())


# ---- parts


@pytest.mark.whole_way
def test_friction_of_zero_and_uncertainties_of_zero_divide_by_nothing():
    motion = bench_motion(friction=0.0)
    for u in (0.0, 150.0):
        found = identify_shot(
            FiredShot(bench_shot(motion), bench_rig(friction=0.0, u_friction=u, u_rel=0.0)), Options()
        )
        assert found.chosen.estimate.mass_kg == pytest.approx(MASS_KG, rel=1e-3)
        assert math.isfinite(found.normalised_error)


def test_without_any_uncertainty_the_normalised_error_is_not_a_number():
    found = identified()
    bare = replace(found.chosen, estimate=replace(found.chosen.estimate, budget=()))
    assert math.isnan(replace(found, results={"calibrated": bare}).normalised_error)


def test_the_normalised_error_is_that_of_expanded_uncertainties():
    # what is added and what goes along are as uncertain as they are stated to be
    specified = Specification(780.0, 2.0, added_kg=1.0, u_added_kg=2.0, carried_kg=1.0, u_carried_kg=1.0)
    found = replace(identified(), specification=specified)
    e = found.chosen.estimate
    assert found.normalised_error == pytest.approx((e.mass_kg - 782) / math.hypot(2 * e.u_kg, 6.0))


def test_scales_are_gauge_and_area_together():
    rig = bench_rig(u_rel=0.003, p_breech='calibration = "dynamic"')
    mechanism = replace(rig.mechanism, u={"bore_area": 0.004 * 0.00883, "friction": 80.0})
    scales = scale_uncertainty(replace(rig, mechanism=mechanism))
    assert scales.gauges == pytest.approx((0.005, 0.003, 0.003))
    assert (scales.acceleration, scales.friction_n) == (0.003, 80.0)


def test_only_a_camera_aligned_by_motion_without_doubt_says_something_of_the_scale():
    (good,) = virtual_shot().shot.alignments
    assert motion_fit(good)["gain"] == good.details["gain"]
    for bad in (
        None,
        replace(good, status="ambiguous"),
        replace(good, details=None),
        replace(good, details={"edges": 1}),
    ):
        assert motion_fit(bad) is None


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"method": "best"}, "method must be one of calibrated"),
        ({"cutoff_hz": 0.0}, "cutoff_hz must be positive"),
        ({"window_s": -1.0}, "window_s must be positive"),
        ({"window_s": math.nan}, "window_s must be positive"),
    ],
)
def test_options_that_make_no_sense_are_the_callers_mistake(options, message):
    with pytest.raises(ValueError, match=message):
        Options(**options)


@pytest.mark.whole_way
def test_the_cutoff_by_the_spectra_is_lowered_for_the_slowest_force():
    virtual = virtual_shot("mixed")
    thin = virtual.shot.channels["p_brake"]
    base = replace(thin.time_base, stamps_s=thin.time_base.times_s[::4].copy(), count=thin.samples[::4].size)
    slow = replace(thin, samples=thin.samples[::4], time_base=base, raw=None)
    found = identify_shot(
        FiredShot(replace(virtual.shot, channels={**virtual.shot.channels, "p_brake": slow}), virtual.rig), Options()
    )
    assert found.route.filtered.low_pass.cutoff_hz == pytest.approx(0.2 * slow.time_base.rate_hz)
    assert found.route.filter_choice.basis == "shot"
    assert (
        identify_shot(FiredShot(virtual.shot, virtual.rig), Options(cutoff_hz=150.0)).route.filtered.low_pass.cutoff_hz
        == 150.0
    )


@pytest.mark.whole_way
def test_what_did_not_settle_is_not_valid(monkeypatch):
    virtual = virtual_shot()
    never = partial(solve, most_steps=0)
    monkeypatch.setattr("recoil_identification.calibration.solution.solve", never)
    found = identify_shot(FiredShot(virtual.shot, virtual.rig), Options())
    assert not found.route.calibration.inferred.converged
    assert any("did not settle" in reason for reason in found.reasons)
