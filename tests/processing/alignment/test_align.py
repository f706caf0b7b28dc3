import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest

from recoil_acquisition.shot.shot import ClockAlignment
from recoil_processing.alignment.align import judge_edges, judge_motion, judge_redundant
from recoil_processing.alignment.frame_fault import FrameFault
from recoil_processing.alignment.motion_fit import MotionFit
from recoil_processing.alignment.redundant_alignment import RedundantFit
from recoil_processing.alignment.trigger_alignment import EdgeFit

MOTION = MotionFit(
    offset_s=0.05,
    drift=1e-5,
    u_offset_s=4e-6,
    u_drift=5e-5,
    gain=1.002,
    u_gain=0.003,
    u_bias_m_s2=0.1,
    gain_bias_correlation=-0.3,
    integration_constants=(0.001, -0.02, 0.3),
    origin_s=0.4,
    marker_sigma_m=5e-5,
    acceleration_density=1.25e-3,
    innovation_statistic=1.02,
    coarse_offset_s=0.0502,
    correlation=0.99,
    second_peak=0.2,
    at_search_edge=False,
    candidates_s=np.linspace(0.049, 0.051, 5),
    log_likelihood=np.array([-9.0, -2.0, 0.0, -2.0, -9.0]),
    free_drift=2e-4,
    u_free_drift=3e-4,
    frames=1500,
    frames_set_aside=2,
    converged=True,
)
FAULT = FrameFault(1234, 1230, 1236, 0.20567, 1, 1 / 6000, 90.0)
REDUNDANT = RedundantFit(
    offset_s=0.04,
    drift=0.0,
    u_offset_s=2e-5,
    u_drift=5e-5,
    gain=1.0,
    u_gain=0.01,
    coarse_offset_s=0.041,
    correlation=0.98,
    second_peak=0.3,
    at_search_edge=False,
    cutoff_hz=150.0,
    residual_share=0.05,
    rows=12.0,
    u_alias_s=2e-6,
)
EDGES = EdgeFit(offset_s=3.0, u_offset_s=1e-5, drift=1e-6, u_drift=5e-5, edges=4, residual_s=2e-5)


def motion_verdict(**changes) -> ClockAlignment:
    return judge_motion("camera", replace(MOTION, **changes), u_gain=0.01, noise_density=1.25e-3, frame_period_s=5e-4)


@pytest.mark.parametrize(("bias_m_s2", "u_m_s2", "said"), [
    (10.3, 0.1, False), (10.5, 0.1, True), (-10.5, 0.1, True), (10.5, 1.0, False), (-14.5, 1.0, True),
])  # fmt: skip
def test_an_accelerometer_that_is_off_zero_by_more_than_gravity_is_doubted_the_force_is_not(bias_m_s2, u_m_s2, said):
    changes = {"integration_constants": (0.0, 0.0, -1.002 * bias_m_s2), "u_bias_m_s2": u_m_s2}
    verdict = motion_verdict(**changes)
    assert verdict.status == ("ambiguous" if said else "ok")
    words = (
        f"the accelerometer reads {bias_m_s2:+.3g} m/s^2 (u {u_m_s2:.2g} m/s^2) where the camera sees no acceleration"
    )
    assert [reason.startswith(words) for reason in verdict.reasons] == [True] * said
    by_force = judge_motion(
        "c", replace(MOTION, **changes), u_gain=0.01, noise_density=1.25e-3, frame_period_s=5e-4, method="force"
    )
    assert by_force.status == "ok"


def test_a_good_fit_is_ok_and_reported_as_it_is():
    verdict = motion_verdict()
    assert (verdict.clock, verdict.status, verdict.method, verdict.reasons) == ("camera", "ok", "motion", ())
    assert (verdict.offset_s, verdict.u_offset_s, verdict.drift, verdict.u_drift) == (0.05, 4e-6, 1e-5, 5e-5)
    assert verdict.details["gain"] == 1.002
    assert verdict.details["noise_inflation"] == pytest.approx(1.0)
    assert verdict.details["integration_constants"] == [0.001, -0.02, 0.3]


@pytest.mark.parametrize(
    "verdict",
    [
        motion_verdict(),
        judge_redundant("bus", REDUNDANT),
        judge_edges("camera", EDGES, u_edge_s=1e-5),
    ],
    ids=["motion", "redundant", "trigger"],
)
def test_details_are_json(verdict):
    assert json.loads(json.dumps(verdict.details, allow_nan=False)) == verdict.details


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"second_peak": 0.97}, "a second offset fits nearly as well"),
        ({"at_search_edge": True}, "edge of the search"),
        ({"u_offset_s": 3e-4}, "known to 0.30 ms only"),
        ({"drift": 2e-3, "free_drift": 2e-3}, "check the source's declared rate"),
        ({"converged": False}, "did not settle"),
        ({"innovation_statistic": 2.6}, "a dropped frame, a wrong frame rate or another motion"),
        ({"innovation_statistic": 0.2}, "the track was smoothed or filled"),
        ({"innovation_statistic": math.inf}, None),
        ({"free_drift": 0.01}, "check the frame rate"),
        ({"frames_set_aside": 50}, "50 of 1550 frames contradict their neighbours"),
        ({"coarse_offset_s": 0.06}, "velocity correlation and likelihood are 10.00 ms apart"),
        (
            {"velocity_offset_s": 0.05004, "u_velocity_offset_s": 1e-5},
            "velocities alone give an offset +40 us from the likelihood's, 3.7 combined standard uncertainties",
        ),
        ({"frame_faults": (FAULT,)}, "one frame is missing near frame 1234 (t = 0.2057 s; 95 %: 1230 to 1236"),
    ],
)
def test_what_allows_doubt_is_ambiguous(changes, reason):
    verdict = motion_verdict(**changes)
    if reason is None:
        assert verdict.status == "failed"
        return
    assert verdict.status == "ambiguous"
    assert len(verdict.reasons) == 1
    assert reason in verdict.reasons[0]
    assert verdict.offset_s == 0.05


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"correlation": 0.5}, "correlation 0.50 is below 0.8"),
        ({"acceleration_density": 1.25}, "do not show the same motion: 1000 times"),
        ({"gain": 1.2}, "+20.00 % off the accelerometer's"),
        ({"gain": -1.0}, "-200.00 % off"),
    ],
)
def test_what_cannot_be_one_motion_is_failed(changes, reason):
    verdict = motion_verdict(**changes)
    assert verdict.status == "failed"
    assert reason in verdict.reasons[0]


GAIN_SIGMA = math.hypot(0.01, MOTION.u_gain)


# each pair: what is no doubt yet, and what is
@pytest.mark.parametrize(
    ("within", "beyond", "status"),
    [
        ({"correlation": 0.8}, {"correlation": 0.799}, "failed"),
        ({"second_peak": 0.959}, {"second_peak": 0.961}, "ambiguous"),
        ({"u_offset_s": 2e-4}, {"u_offset_s": 2.01e-4}, "ambiguous"),
        ({"drift": 1e-3}, {"drift": 1.01e-3}, "ambiguous"),
        ({"drift": -1e-3}, {"drift": -1.01e-3}, "ambiguous"),
        ({"innovation_statistic": 0.5}, {"innovation_statistic": 0.49}, "ambiguous"),
        ({"innovation_statistic": 1.6}, {"innovation_statistic": 1.61}, "ambiguous"),
        ({"frames": 1470, "frames_set_aside": 30}, {"frames": 1469, "frames_set_aside": 31}, "ambiguous"),
        ({"acceleration_density": 1.25e-3 * 300}, {"acceleration_density": 1.25e-3 * 301}, "failed"),
        ({"gain": 1 + 3.99 * GAIN_SIGMA}, {"gain": 1 + 4.01 * GAIN_SIGMA}, "failed"),
        ({"gain": 1 - 3.99 * GAIN_SIGMA}, {"gain": 1 - 4.01 * GAIN_SIGMA}, "failed"),
        ({"free_drift": 3.49 * math.hypot(3e-4, 5e-5)}, {"free_drift": -3.51 * math.hypot(3e-4, 5e-5)}, "ambiguous"),
        # six frames from the offset in the middle of the motion
        ({"coarse_offset_s": 0.050004 + 2.99e-3}, {"coarse_offset_s": 0.050004 + 3.01e-3}, "ambiguous"),
        ({"coarse_offset_s": 0.050004 - 2.99e-3}, {"coarse_offset_s": 0.050004 - 3.01e-3}, "ambiguous"),
    ],
)
def test_each_figure_has_a_limit_beyond_which_it_counts(within, beyond, status):
    assert motion_verdict(**within).reasons == ()
    verdict = motion_verdict(**beyond)
    assert (verdict.status, len(verdict.reasons)) == (status, 1)


@pytest.mark.parametrize(
    ("frame_period_s", "apart_s", "status"),
    [(1e-4, 2e-3, "ok"), (1e-4, 2.01e-3, "ambiguous"), (5e-4, 3e-3, "ok"), (5e-4, 3.01e-3, "ambiguous")],
)
def test_estimates_may_be_six_frames_apart_and_of_a_fast_track_two_milliseconds(frame_period_s, apart_s, status):
    fit = replace(MOTION, drift=0.0, offset_s=0.0, coarse_offset_s=apart_s)
    verdict = judge_motion("c", fit, u_gain=0.01, noise_density=1.25e-3, frame_period_s=frame_period_s)
    assert verdict.status == status


def test_a_second_offset_counts_from_nearer_than_the_margin_on():
    (reason,) = motion_verdict(correlation=0.03, second_peak=0.0).reasons
    assert "not the same motion" in reason
    assert len(motion_verdict(correlation=0.03, second_peak=1e-3).reasons) == 2


def test_a_drift_that_no_clock_has_is_not_also_called_a_wrong_frame_rate():
    verdict = motion_verdict(drift=5e-3, free_drift=5e-3, coarse_offset_s=0.052)
    assert len(verdict.reasons) == 1
    assert "the clocks' rates differ by +0.500 %" in verdict.reasons[0]


def test_another_motion_is_failed_without_a_word_on_the_frame_rate():
    verdict = motion_verdict(acceleration_density=1.25, free_drift=0.01)
    assert verdict.status == "failed"
    assert len(verdict.reasons) == 1


@pytest.mark.parametrize("sigma", [3.0, -3.0, 3.01, -3.01])
def test_velocities_may_be_three_combined_standard_uncertainties_off(sigma):
    unit = 2.0**-20
    verdict = motion_verdict(
        offset_s=0.0, coarse_offset_s=0.0, u_offset_s=3 * unit,
        velocity_offset_s=sigma * 5 * unit, u_velocity_offset_s=4 * unit,
    )  # fmt: skip
    assert verdict.status == ("ok" if abs(sigma) == 3 else "ambiguous")


def test_what_the_fit_did_not_find_is_not_among_the_details():
    details = motion_verdict().details
    assert not {"shifted_zero_m_s2", "velocity_apart_s", "u_velocity_offset_s", "corrected_offset_s"} & set(details)
    assert motion_verdict(shifted_zero_m_s2=0.0).details["shifted_zero_m_s2"] == 0.0


def test_velocities_that_agree_within_their_uncertainty_are_no_doubt():
    verdict = motion_verdict(velocity_offset_s=0.05002, u_velocity_offset_s=1e-5)
    assert verdict.status == "ok"
    assert verdict.details["velocity_apart_s"] == pytest.approx(2e-5)


def test_a_track_with_a_missing_frame_is_judged_by_the_corrected_one_and_keeps_its_own_figures():
    broken = {"innovation_statistic": 3.0, "acceleration_density": 1.25, "frame_faults": (FAULT,)}
    verdict = motion_verdict(**broken, corrected=replace(MOTION, offset_s=0.05003))
    assert verdict.status == "ambiguous"
    assert verdict.reasons == (str(FAULT),)
    assert verdict.offset_s == 0.05
    assert verdict.details["corrected_offset_s"] == 0.05003
    assert verdict.details["frame_faults"][0]["index"] == 1234
    assert json.loads(json.dumps(verdict.details, allow_nan=False)) == verdict.details
    assert motion_verdict(**broken, corrected=replace(MOTION, gain=1.2)).status == "failed"
    assert motion_verdict(**broken).status == "failed"


def test_what_the_record_could_tell_of_the_drift_is_stated():
    details = motion_verdict().details
    assert not details["drift_earned"]
    assert details["drift_told_from"] == pytest.approx(3.5 * math.hypot(3e-4, 5e-5))
    assert details["drift_departure"] == pytest.approx(2e-4 / math.hypot(3e-4, 5e-5))
    assert motion_verdict(u_free_drift=1e-5, free_drift=1e-5).details["drift_earned"]
    # the clocks' own allowance is among the uncertainties: a drift within it is none to doubt
    assert motion_verdict(u_free_drift=1e-6, free_drift=1e-4).status == "ok"


@pytest.mark.parametrize("name", ["offset_s", "u_offset_s", "drift", "gain", "u_gain", "innovation_statistic"])
def test_a_figure_that_is_none_never_passes(name):
    assert motion_verdict(**{name: math.nan}).status == "failed"
    if hasattr(REDUNDANT, name):
        assert judge_redundant("bus", replace(REDUNDANT, **{name: math.nan})).status == "failed"


def test_far_from_the_clocks_zero_a_drift_is_no_distance_between_the_estimates():
    assert motion_verdict(origin_s=1000.0, offset_s=0.05 - 1e-5 * 1000.0).status == "ok"


def test_a_failure_keeps_the_doubts_behind_it():
    verdict = motion_verdict(correlation=0.5, second_peak=0.49)
    assert [reason.split()[0] for reason in verdict.reasons] == ["correlation", "a"]


def test_a_noise_density_that_is_none_is_refused():
    with pytest.raises(ValueError, match="noise_density must be positive"):
        judge_motion("camera", MOTION, u_gain=0.01, noise_density=0.0, frame_period_s=5e-4)


def test_a_sentence_becomes_a_failed_clock():
    for verdict in (
        judge_motion("c", "no motion", u_gain=0.01, noise_density=1.0, frame_period_s=5e-4),
        judge_redundant("c", "no motion"),
        judge_edges("c", "no motion", u_edge_s=1e-5),
    ):
        assert (verdict.clock, verdict.status, verdict.reasons) == ("c", "failed", ("no motion",))
        assert verdict.u_offset_s == math.inf


def test_a_redundant_channel_is_judged_alike():
    assert judge_redundant("bus", REDUNDANT).status == "ok"
    assert judge_redundant("bus", replace(REDUNDANT, second_peak=0.97)).status == "ambiguous"
    assert judge_redundant("bus", replace(REDUNDANT, u_offset_s=1e-3)).status == "ambiguous"
    assert judge_redundant("bus", replace(REDUNDANT, converged=False)).status == "ambiguous"
    assert judge_redundant("bus", replace(REDUNDANT, correlation=0.3)).status == "failed"
    assert judge_redundant("bus", REDUNDANT).details["cutoff_hz"] == 150.0


@pytest.mark.parametrize(
    ("changes", "status"),
    [
        ({}, "ok"),
        ({"edges": 1, "residual_s": 0.0}, "ok"),
        ({"residual_s": 1e-4}, "ambiguous"),
        ({"edges": 2, "residual_s": 1e-4}, "ambiguous"),
        ({"drift": 0.4}, "ambiguous"),
    ],
)
def test_edges_are_judged_by_the_line_through_them(changes, status):
    verdict = judge_edges("camera", replace(EDGES, **changes), u_edge_s=1e-5)
    assert verdict.status == status
    assert bool(verdict.reasons) == (status != "ok")


@pytest.mark.parametrize(
    ("within", "beyond", "reason"),
    [
        ({"u_offset_s": 2e-4}, {"u_offset_s": 2.01e-4}, "known to 0.20 ms only"),
        ({"drift": -1e-3}, {"drift": -1.01e-3}, "the clocks' rates differ by -0.101 %"),
        ({"edges": 1, "residual_s": 4e-5}, {"edges": 1, "residual_s": 4.01e-5}, "an edge lies 40.1 us off the line"),
        # the largest of a thousand
        ({"edges": 1000, "residual_s": 5.4e-5}, {"edges": 1000, "residual_s": 5.5e-5}, "an edge lies 55.0 us off"),
        ({}, {"rivals": 1, "all_source": 4, "all_reference": 6}, "1 other offsets .*: 4 edges on the source, 6 on"),
        (
            {"edges": 30, "set_aside": 1, "unpaired_source": (0.1,), "unpaired_reference": (3.2,)},
            {"edges": 30, "set_aside": 1, "unpaired_source": (0.1,), "unpaired_reference": (3.2, 3.3)},
            "4 edges between the first and the last pair have no counterpart",
        ),
    ],
)
def test_each_figure_of_edges_has_a_limit_beyond_which_it_is_doubted(within, beyond, reason):
    assert judge_edges("camera", replace(EDGES, **within), u_edge_s=1e-5).reasons == ()
    verdict = judge_edges("camera", replace(EDGES, **beyond), u_edge_s=1e-5)
    assert (verdict.status, len(verdict.reasons)) == ("ambiguous", 1)
    assert re.search(reason, verdict.reasons[0])


def test_all_edges_without_a_counterpart_are_counted_and_the_first_are_listed():
    lost = tuple(0.01 * k for k in range(80))
    fit = replace(EDGES, edges=5000, unpaired_source=lost[:3], unpaired_reference=lost)
    details = judge_edges("camera", fit, u_edge_s=1e-5).details
    assert (details["unpaired_source"], details["unpaired_reference"]) == (3, 80)
    assert details["unpaired_source_s"] == list(lost[:3])
    assert details["unpaired_reference_s"] == list(lost[:50])
