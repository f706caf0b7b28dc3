import math
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_processing.quality.clipping_checks import check_clipping, check_flat_tops
from recoil_processing.quality.level_checks import check_baseline, check_zero_shift
from recoil_processing.quality.loss_checks import check_losses
from recoil_processing.quality.motion_checks import check_polarity

RATE_HZ = 20_000.0
COUNT = 4000
IN_BASELINE = np.arange(COUNT) < 800


def pulse(height: float = 100.0, noise: float = 0.1, level: float = 0.0, seed: int = 1) -> np.ndarray:
    """Give 40 ms of pre-trigger baseline, a pulse of 10 ms, and silence again."""
    shape = np.zeros(COUNT)
    shape[1000:1200] = np.sin(np.pi * np.arange(200) / 200) ** 2
    return level + height * shape + noise * np.random.default_rng(seed).standard_normal(COUNT)


def clipped(samples: np.ndarray, at: float) -> np.ndarray:
    return np.minimum(samples, at)


def test_a_pulse_within_the_range_is_ok_and_says_how_much_of_it_it_uses():
    assert check_clipping(pulse(), -200.0, 200.0, unit="m/s^2") == (
        "ok",
        "peak uses 50 % of the range [-200, 200] m/s^2",
    )


def test_one_sample_at_the_end_of_the_range_is_a_warning():
    samples = pulse()
    samples[1100] = 200.0
    verdict, detail = check_clipping(samples, -200.0, 200.0, unit="m/s^2")
    assert verdict == "warn"
    assert detail.startswith("range too small: 1 samples, ")
    assert "raise the range beyond 300 m/s^2" in detail


def test_a_clipped_pulse_fails():
    verdict, detail = check_clipping(clipped(pulse(), 80.0), -80.0, 80.0, unit="Pa")
    assert verdict == "fail"
    assert "% of the pulse (limit 2 %)" in detail
    assert "raise the range beyond 120 Pa before the next shot" in detail


def test_the_lower_end_counts_too():
    assert check_clipping(-clipped(pulse(), 80.0), -80.0, 80.0, unit="Pa")[0] == "fail"


def test_a_one_sided_gauge_rests_at_the_end_of_its_range():
    assert check_clipping(pulse(noise=0.01), 0.0, 200.0, unit="Pa")[0] == "ok"
    assert check_clipping(pulse(level=-5.0), 0.0, 200.0, unit="Pa")[0] == "fail"
    assert check_clipping(clipped(pulse(), 80.0), 0.0, 80.0, unit="Pa")[0] == "fail"


def test_lost_samples_are_not_clipped():
    samples = pulse()
    samples[1100:1120] = np.nan
    assert check_clipping(samples, -200.0, 200.0, unit="Pa")[0] == "ok"


def test_an_infinite_sample_is_clipped():
    samples = pulse()
    samples[1100] = math.inf
    assert check_clipping(samples, -200.0, 200.0, unit="Pa")[0] == "fail"


@pytest.mark.parametrize("samples", [np.empty(0), np.full(9, np.nan)])
def test_without_samples_every_check_of_a_channel_fails(samples):
    in_baseline = np.ones(samples.size, dtype=bool)
    for verdict, detail in (
        check_clipping(samples, -1.0, 1.0, unit="Pa"),
        check_flat_tops(samples),
        check_losses(samples, RATE_HZ),
        check_polarity(samples, in_baseline),
    ):
        assert verdict == "fail"
        assert "check" in detail
    assert check_baseline(samples, in_baseline, 0.0, unit="Pa")[0] == "warn"


@pytest.mark.parametrize(("low", "high"), [(1.0, 1.0), (2.0, 1.0), (math.nan, 1.0), (0.0, math.inf)])
def test_a_range_that_is_none_is_refused(low, high):
    with pytest.raises(ValueError, match="a range needs low < high"):
        check_clipping(pulse(), low, high, unit="Pa")


@settings(deadline=None, max_examples=40)
@given(st.floats(20.0, 99.0), st.integers(0, 2**32 - 1))
def test_the_more_is_clipped_the_worse_the_verdict(level, seed):
    order = ["ok", "warn", "fail"]
    samples = pulse(seed=seed)
    harder = check_clipping(clipped(samples, level), -level, level, unit="Pa")[0]
    softer = check_clipping(clipped(samples, level + 1), -level - 1, level + 1, unit="Pa")[0]
    assert order.index(harder) >= order.index(softer)


def test_flat_tops_are_seen_without_a_range():
    assert check_flat_tops(pulse())[0] == "ok"
    verdict, detail = check_flat_tops(clipped(pulse(), 80.0))
    assert verdict == "warn"
    assert "declare the sensor's range" in detail
    assert int(detail.split()[0]) > 20
    assert check_flat_tops(-clipped(pulse(), 80.0))[0] == "warn"


def test_rest_on_a_coarse_scale_is_no_flat_top():
    coarse = np.round(pulse(noise=0.0) / 7.0) * 7.0
    coarse[1100] += 7.0
    assert check_flat_tops(coarse)[0] == "ok"


def test_a_switch_is_no_clipped_signal():
    assert check_flat_tops(np.where(IN_BASELINE, 0.0, 5.0)) == ("ok", "a signal of two values")


def test_a_constant_fails():
    verdict, detail = check_flat_tops(np.full(100, 2.5))
    assert verdict == "fail"
    assert "always 2.5: sensor not connected" in detail


def test_losses_are_counted():
    samples = pulse()
    assert check_losses(samples, RATE_HZ) == ("ok", "no sample lost")
    samples[[5, 90, 91]] = np.nan
    verdict, detail = check_losses(samples, RATE_HZ)
    assert verdict == "warn"
    assert "3 of 4000 samples lost (0.07 %, limit 5 %), longest gap 0.10 ms (limit 10 ms)" in detail
    assert "check the cable and the bus load" in detail


def test_an_overload_is_the_instruments_range_and_no_cable():
    samples = pulse()
    samples[[5, 90, 91]] = np.nan
    verdict, detail = check_losses(samples, RATE_HZ, 3)
    assert verdict == "warn"
    assert "overload: 3 of them the instrument itself marked as beyond its range; set it to a larger range" in detail
    assert "check the cable" not in detail
    detail = check_losses(samples, RATE_HZ, 2)[1]
    assert "overload: 2 of them" in detail
    assert "check the cable" in detail


def test_many_losses_or_a_long_gap_fail():
    scattered, gap = pulse(), pulse()
    scattered[::10] = np.nan
    gap[100:320] = np.nan
    assert check_losses(gap[:300], RATE_HZ)[0] == "fail"
    for samples in (scattered, np.tile(gap, 2)):
        verdict, detail = check_losses(samples, RATE_HZ)
        assert verdict == "fail"
        assert "check the cable" in detail


def test_the_baseline_is_measured():
    verdict, detail = check_baseline(pulse(level=0.5), IN_BASELINE, 0.0, unit="Pa")
    assert verdict == "ok"
    assert re.match(r"offset 0\.(49|50)\d* Pa, noise 0\.(09|10)\d* Pa", detail)
    assert "peak 60 dB above it" in detail


@pytest.mark.parametrize(
    ("samples", "verdict", "advice"),
    [
        (pulse(noise=20.0), "fail", "below 20 dB: check gain and cable"),
        (pulse(noise=6.0), "warn", "below 30 dB: a smaller range would help"),
        (pulse(level=50.0), "fail", "the offset is 50 % of the peak: zero the sensor"),
        (pulse(level=5.0), "warn", "zero the sensor before the next shot"),
        (np.full(COUNT, 3.0), "fail", "never leaves 3 Pa: check gain and cable"),
    ],
)
def test_noise_and_offsets_are_judged_with_advice(samples, verdict, advice):
    found, detail = check_baseline(samples, IN_BASELINE, 0.0, unit="Pa")
    assert found == verdict
    assert advice in detail


def test_without_a_known_rest_there_is_no_offset():
    assert check_baseline(pulse(level=50.0), IN_BASELINE, None, unit="Pa")[0] == "ok"


def test_a_baseline_below_the_resolution_is_no_fault():
    verdict, detail = check_baseline(pulse(noise=0.0), IN_BASELINE, 0.0, unit="Pa")
    assert verdict == "ok"
    assert "below the resolution" in detail


def test_too_short_a_baseline_is_a_warning():
    verdict, detail = check_baseline(pulse(), np.arange(COUNT) < 49, 0.0, unit="Pa")
    assert verdict == "warn"
    assert "49 samples of pre-trigger baseline (limit 50)" in detail
    assert "lengthen the pre-trigger" in detail


@pytest.mark.parametrize(
    ("bias", "u_bias", "verdict"),
    [(1.0, 0.1, "ok"), (10.0, 0.1, "warn"), (10.0, 5.0, "ok"), (-200.0, 1.0, "fail"), (-200.0, 60.0, "warn")],
)
def test_a_zero_that_moved_is_judged_by_what_is_sure(bias, u_bias, verdict):
    found, detail = check_zero_shift(bias, u_bias, 2500.0, unit="m/s^2")
    assert found == verdict
    assert f"zero moved by {bias:+.3g} m/s^2" in detail
    assert ("check its mounting and charge amplifier" in detail) == (verdict != "ok")


@pytest.mark.parametrize(("bias", "peak"), [(math.nan, 2500.0), (1.0, 0.0), (1.0, math.nan)])
def test_a_zero_shift_that_is_no_number_is_not_ok(bias, peak):
    assert check_zero_shift(bias, 0.1, peak, unit="m/s^2")[0] == "warn"


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 2**32 - 1), st.floats(-1e3, 1e3), st.integers(1, 40))
def test_the_polarity_is_that_of_the_pulse_at_any_level_in_any_record(seed, level, times_longer):
    samples = np.concatenate([pulse(seed=seed), np.zeros(COUNT * (times_longer - 1))]) + level
    in_baseline = np.arange(samples.size) < 800
    assert check_polarity(samples, in_baseline)[0] == "ok"
    verdict, detail = check_polarity(-samples, in_baseline)
    assert verdict == "fail"
    assert "set `polarity = -1` or turn the sensor" in detail


def test_ringing_does_not_decide_the_polarity():
    samples = pulse()
    samples[1000:1400] -= 300 * np.exp(-np.arange(400) / 10) * np.sin(2 * np.pi * 3000 * np.arange(400) / RATE_HZ)
    samples[1200:3000] -= 15.0
    assert samples.min() < -samples.max()
    assert check_polarity(samples, IN_BASELINE)[0] == "ok"


def test_without_a_baseline_the_level_is_zero():
    assert check_polarity(pulse(), np.zeros(COUNT, dtype=bool))[0] == "ok"


@pytest.mark.parametrize("noise", [0.01, 0.5, 2.0])
def test_noise_about_the_zero_of_a_one_sided_range_is_not_clipped(noise):
    verdict, detail = check_clipping(pulse(noise=noise), 0.0, 200.0, unit="MPa")
    assert verdict == "ok"
    assert re.fullmatch(r"peak uses 5\d % of the range \[0, 200\] MPa", detail)
    upside_down = check_clipping(-pulse(noise=noise), -200.0, 0.0, unit="MPa")
    assert upside_down == (verdict, detail.replace("[0, 200]", "[-200, 0]"))


def test_noise_that_reaches_an_end_beside_zero_is_not_clipped_either():
    assert check_clipping(pulse(noise=0.5), -0.5, 200.0, unit="MPa")[0] == "ok"


def test_what_a_recorder_cuts_off_at_rest_piles_up_and_the_low_end_is_named():
    verdict, detail = check_clipping(np.maximum(pulse(noise=0.5), 0.0), 0.0, 200.0, unit="MPa")
    assert verdict == "warn"
    assert ", 0.0 % of the pulse (limit 2 %), at the low end of [0, 200] MPa; " in detail
    assert detail.endswith("let the range begin below -1 MPa before the next shot")


def test_a_rest_without_noise_at_the_end_of_its_range_is_cut_off_by_nothing():
    silent = np.maximum(pulse(noise=0.0), 0.0)
    rounded = np.abs(np.round(pulse(noise=0.05)))
    for samples in (silent, rounded):
        assert check_clipping(samples, 0.0, 200.0, unit="MPa")[0] == "ok"


def test_the_end_that_was_left_is_named_with_its_own_remedy():
    both = np.clip(pulse() - pulse(seed=2)[::-1], -80.0, 80.0)
    for samples, end, remedy in (
        (clipped(pulse(), 80.0), "the high end", "raise the range beyond 120 MPa before"),
        (-clipped(pulse(), 80.0), "the low end", "let the range begin below -120 MPa before"),
        (both, "both ends", "raise the range beyond 120 MPa and let the range begin below -120 MPa before"),
    ):
        verdict, detail = check_clipping(samples, -80.0, 80.0, unit="MPa")
        assert verdict == "fail"
        assert f"at {end} of [-80, 80] MPa; {remedy}" in detail


def test_a_sensor_that_rests_or_goes_far_beyond_its_range_has_another_range_unit_or_polarity():
    verdict, detail = check_clipping(pulse(level=-5.0), 0.0, 200.0, unit="MPa")
    assert (verdict, detail.partition(":")[0]) == ("fail", "rests at -5 MPa, beyond the low end of [0, 200] MPa")
    verdict, detail = check_clipping(-pulse(), 0.0, 200.0, unit="MPa")
    assert (verdict, detail.partition(":")[0]) == ("fail", "goes to -100 MPa, far beyond the low end of [0, 200] MPa")


def test_the_share_is_that_of_the_pulse_whatever_the_level_it_stands_on():
    samples = clipped(pulse(level=50.0), 149.5)
    count = int(np.count_nonzero(samples >= 149.5 - 1e-3 * 199.5))
    detail = check_clipping(samples, -50.0, 149.5, unit="MPa")[1]
    in_pulse = int(np.count_nonzero(np.abs(samples - 50.0) > 10.0))
    assert f"{count} samples, {100 * count / in_pulse:.1f} % of the pulse" in detail


def test_a_polarity_that_is_declared_already_is_to_be_taken_out():
    assert "set `polarity = -1` or turn the sensor" in check_polarity(-pulse(), IN_BASELINE)[1]
    verdict, detail = check_polarity(-pulse(), IN_BASELINE, polarity=-1)
    assert verdict == "fail"
    assert detail.endswith("its `polarity` in the rig is -1: take it out, or turn the sensor")


def test_a_signal_that_rests_beyond_its_range_says_so_and_names_the_bias() -> None:
    samples = np.full(1000, 25.0)
    samples[400:420] = 30.0
    verdict, detail = check_clipping(samples, -20.0, 20.0, unit="g")
    assert verdict == "fail"
    assert detail.startswith("it rests at 25 g, beyond its range [-20, 20] g: state `zero` of a sensor with a bias")
