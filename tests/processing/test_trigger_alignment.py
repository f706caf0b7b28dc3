import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from processing.trigger_alignment import EdgeFit, align_edges, rising_edges

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


def test_edges_that_are_not_pairs_lie_far_off_the_line():
    assert fit_of([1.0, 2.0], [1.0, 2.5]).residual_s > 1e-3


@pytest.mark.parametrize(
    ("source", "reference", "sentence"),
    [
        ([], [], "no trigger edge was recorded on source and reference"),
        ([], [1.0], "no trigger edge was recorded on source"),
        ([1.0], [], "no trigger edge was recorded on reference"),
        ([1.0, 2.0], [1.0], "2 edges on the source, 1 on the reference"),
    ],
)
def test_edges_that_do_not_pair_up_give_a_sentence(source, reference, sentence):
    assert align_edges(np.array(source), np.array(reference), u_edge_s=1e-5, drift_allowance=5e-5) == sentence


@pytest.mark.parametrize("options", [{"u_edge_s": 0.0}, {"u_edge_s": math.nan}, {"drift_allowance": -1.0}])
def test_uncertainties_that_are_none_are_refused(options):
    with pytest.raises(ValueError, match="u_edge_s must be positive"):
        fit_of([1.0], [1.0], **options)


def test_edges_that_do_not_increase_are_refused():
    with pytest.raises(ValueError, match="edges must increase strictly"):
        fit_of([1.0, 1.0], [1.0, 2.0])
