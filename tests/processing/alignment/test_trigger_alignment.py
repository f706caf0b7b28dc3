import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_processing.alignment.align import judge_edges
from recoil_processing.alignment.trigger_alignment import EdgeFit, align_edges, rising_edges

TIMES_S = np.arange(2000) * 1e-3 - 0.5


def pulses(*begins_s: float, width_s: float = 0.05, rise_s: float = 4e-3) -> np.ndarray:
    signal = np.zeros(TIMES_S.size)
    for begin in begins_s:
        up = np.clip((TIMES_S - begin) / rise_s + 0.5, 0, 1)
        signal += up * np.clip((begin + width_s - TIMES_S) / rise_s + 0.5, 0, 1)
    return signal


@settings(deadline=None, max_examples=50)
@given(st.floats(-0.4, 0.4), st.floats(-1e3, 1e3), st.floats(1e-3, 1e3))
def test_edges_are_interpolated_whatever_level_and_height(begin_s, level, height):
    edges = rising_edges(TIMES_S, level + height * pulses(begin_s, begin_s + 0.6))
    assert edges == pytest.approx([begin_s, begin_s + 0.6], abs=1e-6)


def test_noise_on_a_slow_edge_is_one_edge():
    for seed in range(20):
        noisy = 5 * pulses(0.1, rise_s=0.05, width_s=0.8) + 0.3 * np.random.default_rng(seed).standard_normal(2000)
        edges = rising_edges(TIMES_S, noisy)
        assert edges == pytest.approx([0.1], abs=0.015)


def test_a_strobe_of_every_frame_gives_every_frame():
    strobe = (np.arange(2000) % 10 < 5).astype(float)
    assert rising_edges(TIMES_S, strobe).size == 199


def test_a_signal_that_rises_early_and_stays_has_one_edge():
    signal = np.ones(2000)
    signal[:5] = 0.0
    assert rising_edges(TIMES_S, signal) == pytest.approx([TIMES_S[4] + 5e-4])


@pytest.mark.parametrize(
    "signal",
    [
        np.zeros(2000),
        np.full(2000, np.nan),
        np.random.default_rng(1).standard_normal(2000),
        np.linspace(1.0, 0.0, 2000),
    ],
    ids=["constant", "lost", "noise", "falling"],
)
def test_without_a_pulse_there_is_no_edge(signal):
    assert rising_edges(TIMES_S, signal).shape == (0,)


def test_an_empty_record_has_no_edge():
    assert rising_edges(np.empty(0), np.empty(0)).shape == (0,)


def test_one_lost_sample_is_bridged_but_no_edge_is_placed_in_a_gap():
    signal = pulses(0.1, 0.7)
    at = int(np.searchsorted(TIMES_S, 0.1))
    signal[at] = np.nan
    assert rising_edges(TIMES_S, signal) == pytest.approx([0.1, 0.7], abs=1e-6)
    signal[at - 10 : at + 10] = np.nan
    assert rising_edges(TIMES_S, signal) == pytest.approx([0.7], abs=1e-6)


def fit_of(source: list[float], reference: list[float], **options: float) -> EdgeFit:
    fit = align_edges(np.array(source), np.array(reference), **({"u_edge_s": 1e-5, "drift_allowance": 5e-5} | options))
    assert isinstance(fit, EdgeFit), fit
    return fit


@settings(deadline=None, max_examples=50)
@given(
    st.floats(-1e3, 1e3),
    st.floats(-1e-2, 1e-2),
    st.lists(st.floats(-100, 100), min_size=2, max_size=20, unique_by=lambda x: round(x, 1)).map(sorted),
)
def test_exact_edges_give_the_exact_line(offset_s, drift, edges):
    source = np.array(edges)
    fit = fit_of(edges, list((1 + drift) * source + offset_s), drift_allowance=1e3)
    mapped = (1 + fit.drift) * source + fit.offset_s
    assert np.allclose(mapped, (1 + drift) * source + offset_s, rtol=0, atol=1e-7)
    assert fit.residual_s < 1e-7
    assert fit.edges == source.size


def test_errors_are_what_the_uncertainties_say():
    offsets, drifts = [], []
    for seed in range(200):
        rng = np.random.default_rng(seed)
        source = np.sort(rng.uniform(3.0, 4.0, 6))
        drift = 5e-5 * rng.standard_normal()
        fit = fit_of(list(source), list((1 + drift) * source - 2.0 + 1e-5 * rng.standard_normal(6)))
        middle = source.mean()
        offsets.append(((1 + fit.drift) * middle + fit.offset_s - (1 + drift) * middle + 2.0) / fit.u_offset_s)
        drifts.append((fit.drift - drift) / fit.u_drift)
    assert 0.85 < np.std(offsets) < 1.15
    assert 0.85 < np.std(drifts) < 1.15


def test_one_edge_tells_the_offset_alone():
    fit = fit_of([2.0], [5.0])
    assert (fit.offset_s, fit.drift, fit.u_offset_s, fit.edges, fit.residual_s) == (3.0, 0.0, 1e-5, 1, 0.0)
    assert fit.u_drift == pytest.approx(5e-5)


def test_two_edges_close_to_one_another_tell_no_drift():
    fit = fit_of([2.0, 2.001], [5.0, 5.00102])
    assert abs(fit.drift) < 5e-5
    assert fit.u_drift == pytest.approx(5e-5, rel=0.01)
    assert (1 + fit.drift) * 2.0005 + fit.offset_s == pytest.approx(5.00051, abs=1e-9)


def test_edges_that_are_not_pairs_have_rivals():
    fit = fit_of([1.0, 2.0], [1.0, 2.5])
    assert (fit.edges, fit.rivals > 0) == (1, True)
    assert judge_edges("bus", fit, u_edge_s=1e-5).status == "ambiguous"


@settings(deadline=None, max_examples=25)
@given(st.floats(-100, 100), st.floats(-1e-4, 1e-4), st.integers(0, 2**32 - 1))
def test_missing_and_strange_edges_of_irregular_trains_are_told_from_the_pairs(offset_s, drift, seed):
    rng = np.random.default_rng(seed)
    true = np.cumsum(0.02 + rng.exponential(0.1, 40))
    own = np.sort(np.concatenate([true[rng.random(40) > 0.2], rng.uniform(0.0, true[-1], 4)]))
    other = np.sort(np.concatenate([true[rng.random(40) > 0.2], rng.uniform(0.0, true[-1], 4)]))
    own = own[np.concatenate([[True], np.diff(own) > 1e-3])]
    fit = fit_of(list(own), list((1 + drift) * other + offset_s))
    assert fit.rivals == 0
    middle = 0.5 * true[-1]
    mapped = (1 + fit.drift) * middle + fit.offset_s
    assert mapped == pytest.approx((1 + drift) * middle + offset_s, abs=2e-5)
    assert fit.edges >= 20
    assert fit.all_source == own.size


def train(seed: int, *, frames: int = 1200, dropped: float = 0.01, strangers: int = 6, more: int = 0):
    """Frame times, the pulses of their exposures, and the clocks' drift and offset between them."""
    rng = np.random.default_rng(seed)
    period, drift, offset = 1 / 2000.0, 4e-5, 0.123
    numbers = np.arange(-more, frames + more)
    pulses = (1 + drift) * period * numbers + offset + 2e-6 * rng.standard_normal(numbers.size)
    keep_frame, keep_pulse = rng.random(frames) >= dropped, rng.random(numbers.size) >= dropped
    keep_frame[[0, -1]] = keep_pulse[[0, -1]] = True
    strange = rng.uniform(pulses[0], pulses[-1], strangers)
    return (
        period * np.arange(frames)[keep_frame],
        np.sort(np.concatenate([pulses[keep_pulse], strange])),
        drift,
        offset,
        int((~keep_frame).sum()),
    )


def test_the_pulses_of_a_track_find_their_frames_whatever_is_missing():
    offsets, drifts = [], []
    for seed in range(25):
        frames, pulses, drift, offset, missing = train(seed)
        fit = align_edges(frames, pulses, u_edge_s=2e-6, drift_allowance=5e-5)
        assert isinstance(fit, EdgeFit)
        middle = float(frames.mean())
        offsets.append(((1 + fit.drift) * middle + fit.offset_s - (1 + drift) * middle - offset) / fit.u_offset_s)
        drifts.append((fit.drift - drift) / fit.u_drift)
        verdict = judge_edges("camera", fit, u_edge_s=2e-6, method="exposure")
        assert verdict.status == "ok", verdict.reasons
        # every pulse whose frame is missing is told, and the strangers with them
        assert missing - 4 <= len(fit.unpaired_reference) <= missing + 7
        assert fit.u_drift < 1e-5
    for pulls in (offsets, drifts):
        assert 0.6 < np.sqrt(np.mean(np.square(pulls))) < 1.5


def test_a_pulse_without_a_frame_is_told_by_its_instant():
    pulses = 0.5 + np.arange(300) / 1000.0
    frames = np.delete(np.arange(300) / 1000.0, [70, 71, 200])
    fit = fit_of(list(frames), list(pulses))
    assert fit.unpaired_reference == pytest.approx((0.57, 0.571, 0.7))
    assert (fit.edges, fit.unpaired_source, fit.rivals) == (297, (), 0)
    assert fit.offset_s == pytest.approx(0.5, abs=1e-9)


def test_a_frame_that_was_dropped_and_its_number_given_to_the_next_leaves_two_offsets():
    pulses, frames = 0.5 + np.arange(300) / 1000.0, np.arange(299) / 1000.0
    fit = fit_of(list(frames), list(pulses))
    assert fit.rivals == 1
    verdict = judge_edges("camera", fit, u_edge_s=1e-5, method="exposure")
    assert (verdict.status, verdict.method) == ("ambiguous", "exposure")
    assert "299 edges on the source, 300 on the reference" in verdict.reasons[0]


def test_an_offset_that_is_known_tells_which_pulse_of_a_running_train_is_which_frames():
    frames, pulses, drift, offset, _ = train(3, more=80, dropped=0.0, strangers=0)
    middle = float(frames.mean())
    there = offset + drift * middle
    fit = align_edges(frames, pulses, u_edge_s=2e-6, drift_allowance=5e-5, near_s=(there + 1e-4, 2.4e-4))
    assert isinstance(fit, EdgeFit)
    assert (fit.rivals, fit.edges) == (0, 1200)
    assert fit.offset_s + fit.drift * middle == pytest.approx(there, abs=1e-6)
    blind = align_edges(frames, pulses, u_edge_s=2e-6, drift_allowance=5e-5)
    assert isinstance(blind, EdgeFit)
    assert blind.rivals == 160
    # nothing tells a lag of 0.5 s from the pulses at all
    assert isinstance(
        align_edges(frames[:5], pulses[:5], u_edge_s=2e-6, drift_allowance=5e-5, near_s=(there + 9.0, 1e-3)), str
    )


def test_a_wrong_frame_rate_is_found_by_the_train():
    frames = np.arange(800) / 2000.0
    fit = fit_of(list(frames), list(0.1 + 1.002 * frames), drift_allowance=5e-5)
    assert fit.drift == pytest.approx(0.002, rel=0.05)
    assert judge_edges("camera", fit, u_edge_s=1e-5).status == "ambiguous"


def test_edges_that_always_fall_on_one_phase_of_the_sampling_share_its_rounding():
    frames = np.arange(500) / 1000.0
    same = fit_of(list(frames), list(0.1 + frames))
    spread = fit_of(list(frames), list(0.1 + frames + 1e-5 * np.random.default_rng(1).standard_normal(500)))
    assert same.u_offset_s == pytest.approx(1e-5)
    assert spread.u_offset_s == pytest.approx(1e-5 / math.sqrt(500), rel=0.5)


@pytest.mark.parametrize(
    ("source", "reference", "sentence"),
    [
        ([], [], "no trigger edge was recorded on source and reference"),
        ([], [1.0], "no trigger edge was recorded on source"),
        ([1.0], [], "no trigger edge was recorded on reference"),
    ],
)
def test_edges_that_do_not_pair_up_give_a_sentence(source, reference, sentence):
    assert align_edges(np.array(source), np.array(reference), u_edge_s=1e-5, drift_allowance=5e-5) == sentence


@pytest.mark.parametrize("options", [{"u_edge_s": 0.0}, {"u_edge_s": math.nan}, {"drift_allowance": -1.0}])
def test_uncertainties_that_are_none_are_refused(options):
    with pytest.raises(ValueError, match=r"u_edge_s must be positive|drift_allowance must not be negative"):
        fit_of([1.0], [1.0], **options)


def test_edges_that_do_not_increase_are_refused():
    with pytest.raises(ValueError, match="source_edges_s must increase strictly"):
        fit_of([1.0, 1.0], [1.0, 2.0])
