import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_processing.alignment.align import judge_redundant
from recoil_processing.alignment.redundant_alignment import RedundantFit, align_redundant
from recoil_processing.filters.analog_filter import AnalogLowPass
from tests.builders.motions import ONSET_S, acceleration, velocity

OFFSET_S, GAIN = 0.0412, 1.02
STEP_S = 5e-5


def align(
    seed: int = 0,
    *,
    drift: float = 0.0,
    rate_hz: float = 1000.0,
    count: int = 700,
    sigma: float = 5.0,
    reference_sigma: float = 5.0,
    lost_share: float = 0.0,
    gap_s: tuple[float, float] | None = None,
    jitter_s: float = 0.0,
    source_zero: float = 0.0,
    reference_zero: float = 0.0,
    drift_allowance: float = 5e-5,
    cutoff_hz: float | None = None,
    reference_step_s: float = STEP_S,
) -> RedundantFit | str:
    """Align a bus's repeat of the recoil's acceleration; the clocks' zeros are taken off the result."""
    rng = np.random.default_rng(seed)
    times = reference_step_s * np.arange(round(0.9 / reference_step_s))
    reference = acceleration(times) + reference_sigma * rng.standard_normal(times.size)
    t = np.arange(count) / rate_hz
    source = GAIN * acceleration((1 + drift) * t + OFFSET_S) + 3.0 + sigma * rng.standard_normal(count)
    source[rng.random(count) < lost_share] = np.nan
    if gap_s is not None:
        source[(t > gap_s[0]) & (t < gap_s[1])] = np.nan
    stamps = t + jitter_s * rng.uniform(-0.5, 0.5, count)
    return align_redundant(
        stamps + source_zero,
        source,
        reference_zero,
        reference_step_s,
        reference,
        drift_allowance=drift_allowance,
        cutoff_hz=cutoff_hz,
    )


def fit_of(seed: int = 0, **conditions) -> RedundantFit:
    fit = align(seed, **conditions)
    assert isinstance(fit, RedundantFit), fit
    return fit


def error_s(fit: RedundantFit, drift: float = 0.0) -> float:
    """Error of the mapped time at the shot."""
    at_shot = ONSET_S + 0.004 - OFFSET_S
    return fit.offset_s - OFFSET_S + (fit.drift - drift) * at_shot


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    "conditions",
    [{}, {"rate_hz": 2000.0, "sigma": 50.0}, {"reference_sigma": 50.0}, {"lost_share": 0.02}, {"gap_s": (0.2, 0.25)}],
    ids=["usual", "noisy", "noisy reference", "losses", "gap outside the shot"],
)
def test_errors_are_what_the_uncertainty_says(conditions):
    offsets, gains = [], []
    for seed in range(12):
        drift = float(5e-5 * np.random.default_rng(500 + seed).standard_normal())
        fit = fit_of(seed, drift=drift, **conditions)
        offsets.append(error_s(fit, drift) / fit.u_offset_s)
        gains.append((fit.gain - GAIN) / fit.u_gain)
        assert judge_redundant("bus", fit).status == "ok", judge_redundant("bus", fit).reasons
    for pulls in (offsets, gains):
        # the root of chi-square over 12 stays between 0.43 and 1.66 in 999 of 1000 cases
        assert 0.43 < np.sqrt(np.mean(np.square(pulls))) < 1.66


def test_a_drift_within_reach_of_the_record_is_found():
    fit = fit_of(3, drift=0.002, drift_allowance=0.01)
    assert fit.drift == pytest.approx(0.002, abs=4 * fit.u_drift)
    assert abs(error_s(fit, 0.002)) < 4 * fit.u_offset_s


def test_the_drifts_uncertainty_is_never_above_its_allowance():
    assert fit_of(0, drift_allowance=1e-6).u_drift <= 1e-6


def test_a_gap_in_the_shot_makes_no_wrong_offset():
    for seed in range(5):
        fit = fit_of(seed, gap_s=(0.058, 0.064))
        assert abs(error_s(fit)) < 4 * fit.u_offset_s


def test_jitter_of_stamps_that_were_not_laid_on_their_line_is_in_the_uncertainty():
    even, ragged = fit_of(1), fit_of(1, jitter_s=4e-4)
    assert ragged.u_offset_s > 2 * even.u_offset_s
    assert abs(error_s(ragged)) < 3 * ragged.u_offset_s


@pytest.mark.exhaustive
@settings(deadline=None, max_examples=8)
@given(st.floats(1e-3, 1e3), st.floats(-1e3, 1e3), st.sampled_from([-1.0, 1.0]))
def test_units_constants_and_gains_change_nothing(scale, constant, sign):
    times = STEP_S * np.arange(18_000)
    rng = np.random.default_rng(4)
    reference = acceleration(times) + 5.0 * rng.standard_normal(times.size)
    t = np.arange(700) / 1000.0
    source = GAIN * acceleration(t + OFFSET_S) + 5.0 * rng.standard_normal(t.size)
    one = align_redundant(t, source, 0.0, STEP_S, reference, drift_allowance=5e-5)
    other = align_redundant(t, scale * sign * source + constant, 0.0, STEP_S, sign * reference, drift_allowance=5e-5)
    assert isinstance(one, RedundantFit)
    assert isinstance(other, RedundantFit)
    assert other.offset_s == pytest.approx(one.offset_s, abs=0.1 * one.u_offset_s)
    assert other.u_offset_s == pytest.approx(one.u_offset_s, rel=2e-2)
    assert other.gain == pytest.approx(scale * one.gain, rel=1e-3)


@settings(deadline=None, max_examples=8)
@given(st.floats(-0.05, 0.05), st.floats(-1e-4, 1e-4))
def test_a_known_offset_is_recovered_at_any_drift(offset_s, drift):
    times = STEP_S * np.arange(18_000)
    t = np.arange(700) / 1000.0
    source = acceleration((1 + drift) * t + offset_s)
    fit = align_redundant(t, source, 0.0, STEP_S, acceleration(times), drift_allowance=1e-4)
    assert isinstance(fit, RedundantFit)
    at_shot = (ONSET_S + 0.004 - offset_s) / (1 + drift)
    # cubic interpolation of a pulse of 8 ms at 1 kHz
    assert (1 + fit.drift) * at_shot + fit.offset_s == pytest.approx(ONSET_S + 0.004, abs=1e-5)


@pytest.mark.exhaustive
def test_a_velocity_is_aligned_by_its_derivative_and_its_errors_are_what_the_uncertainty_says():
    times = STEP_S * np.arange(18_000)
    pulls = []
    for seed in range(30):
        rng = np.random.default_rng(seed)
        felt = acceleration(times) + 4.0 + 5.0 * rng.standard_normal(times.size)
        t = np.arange(700) / 1000.0
        seen = velocity(t + OFFSET_S) + 0.03 * rng.standard_normal(t.size)
        fit = align_redundant(t, seen, 0.0, STEP_S, felt, drift_allowance=5e-5, derivative=True)
        assert isinstance(fit, RedundantFit)
        assert judge_redundant("radar", fit, method="motion").method == "motion"
        assert fit.gain == pytest.approx(1.0, abs=4 * fit.u_gain)
        assert abs(error_s(fit)) < 1e-4
        pulls.append(error_s(fit) / fit.u_offset_s)
    assert 0.5 < np.sqrt(np.mean(np.square(pulls))) < 1.4


@pytest.mark.exhaustive
def test_ringing_that_a_slow_source_folds_into_the_motion_is_in_the_uncertainty():
    times = STEP_S * np.arange(18_000)
    errors, seen_u, blind_u = [], [], []
    for seed in range(30):
        rng = np.random.default_rng(seed)
        after = np.maximum(times - ONSET_S - rng.uniform(0.0, 1e-3), 0.0)
        # 1.9 kHz, sampled at 2 kHz, comes to lie at 100 Hz
        wave = np.sin(2 * np.pi * 1900.0 * after) * np.exp(-after / 8e-3) * (after > 0)
        t = np.arange(1400) / 2000.0
        reference = acceleration(times) + 800.0 * wave + 5.0 * rng.standard_normal(times.size)
        source = acceleration(t + OFFSET_S) + 5.0 * rng.standard_normal(t.size)
        source += 300.0 * np.interp(t + OFFSET_S + rng.uniform(0.0, 1e-4), times, wave)
        weak = AnalogLowPass(1163.0, "butterworth", 2)  # lets 3/8 of 1.9 kHz through
        fit = align_redundant(t, source, 0.0, STEP_S, reference, drift_allowance=5e-5, source_filter=weak)
        assert isinstance(fit, RedundantFit)
        errors.append(error_s(fit))
        seen_u.append(fit.u_offset_s)
        blind_u.append(np.sqrt(fit.u_offset_s**2 - fit.u_alias_s**2))
        assert fit.u_alias_s < fit.u_offset_s
    assert 0.4 < np.sqrt(np.mean(np.square(np.array(errors) / seen_u))) < 1.4
    assert np.sqrt(np.mean(np.square(np.array(errors) / blind_u))) > 2.0


@pytest.mark.exhaustive
@settings(deadline=None, max_examples=8)
@given(st.floats(-1e5, 1e5), st.floats(-1e5, 1e5))
def test_where_the_clocks_have_their_zeros_changes_nothing(source_zero, reference_zero):
    here, there = fit_of(2), fit_of(2, source_zero=source_zero, reference_zero=reference_zero)
    shot = ONSET_S - OFFSET_S
    mapped = (1 + there.drift) * (shot + source_zero) + there.offset_s - reference_zero
    assert mapped == pytest.approx((1 + here.drift) * shot + here.offset_s, abs=1e-6)
    assert there.u_offset_s == pytest.approx(here.u_offset_s, rel=0.02)
    assert judge_redundant("bus", there).status == "ok"


def test_the_cutoff_follows_the_slower_of_the_two_and_is_reported():
    assert fit_of(0).cutoff_hz == pytest.approx(150.0)
    assert fit_of(0, rate_hz=10_000.0, count=7000).cutoff_hz == 300.0
    assert fit_of(0, rate_hz=10_000.0, count=7000, reference_step_s=1e-3).cutoff_hz == pytest.approx(150.0)
    assert fit_of(0, cutoff_hz=80.0).cutoff_hz == 80.0


def test_what_is_left_over_is_reported():
    assert fit_of(0, sigma=1.0, reference_sigma=1.0).residual_share < 0.02
    assert fit_of(0, sigma=200.0).residual_share > 0.1


@pytest.mark.parametrize(
    ("source", "reference", "sentence"),
    [
        (np.full(700, np.nan), np.zeros(1000), "only 0 samples"),
        (np.arange(700.0), np.zeros(3), "only 3 samples"),
        (np.full(700, 2.0), acceleration(STEP_S * np.arange(18_000)), "constant signal"),
        (acceleration(np.arange(700) / 1000), np.zeros(18_000), "constant signal"),
    ],
)
def test_nothing_to_align_by_gives_a_sentence_and_a_failed_clock(source, reference, sentence):
    found = align_redundant(np.arange(700) / 1000, source, 0.0, STEP_S, reference, drift_allowance=5e-5)
    assert isinstance(found, str)
    assert sentence in found
    verdict = judge_redundant("bus", found)
    assert (verdict.status, verdict.reasons) == ("failed", (found,))


def test_another_signal_is_not_ok():
    rng = np.random.default_rng(3)
    reference = acceleration(STEP_S * np.arange(18_000))
    source = np.cumsum(rng.standard_normal(700))
    found = align_redundant(np.arange(700) / 1000, source, 0.0, STEP_S, reference, drift_allowance=5e-5)
    assert judge_redundant("bus", found).status in ("ambiguous", "failed")


def test_a_callers_mistakes_are_refused():
    times, source, reference = np.arange(100) / 1000, np.arange(100.0), np.zeros(1000)
    with pytest.raises(ValueError, match="source_times_s must increase strictly"):
        align_redundant(np.zeros(100), source, 0.0, STEP_S, reference, drift_allowance=5e-5)
    with pytest.raises(ValueError, match="equally many"):
        align_redundant(times, source[1:], 0.0, STEP_S, reference, drift_allowance=5e-5)
    reference[5] = np.nan
    with pytest.raises(ValueError, match="reference must be finite"):
        align_redundant(times, source, 0.0, STEP_S, reference, drift_allowance=5e-5)


def test_stamps_in_bursts_are_named_where_they_keep_two_records_apart():
    times = STEP_S * np.arange(18000)
    t = np.arange(700) * 1e-3
    packet = np.ceil(t / 16e-3 + 1e-9)
    place = np.arange(700) - np.searchsorted(packet, packet)
    stamps = 16e-3 * packet + 1.26e-4 * place
    source = GAIN * acceleration(t + OFFSET_S)
    found = align_redundant(stamps, source, 0.0, STEP_S, acceleration(times), drift_allowance=5e-5)
    assert isinstance(found, str), found
    assert "stamps come in bursts, 16 within 1.89 ms" in found
    assert "overlap" not in found
