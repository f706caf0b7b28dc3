"""Packed documents: what comes out again, how exactly, and that nothing but the document decides the bytes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from recoil_identification.report.page.packing import packed, unpacked


def again(values):
    return unpacked(packed({"a": [values]}))["a"][0]


def noise(n, seed=0):
    return np.random.default_rng(seed).standard_normal(n)


@pytest.mark.whole_way
@given(arrays(np.float64, st.integers(0, 300), elements=st.floats(-1e9, 1e9) | st.just(np.nan)))
def test_a_curve_comes_again_within_a_ten_thousandth_of_what_it_spans(values):
    found = again(values)
    present = np.isfinite(values)
    np.testing.assert_array_equal(np.isfinite(found), present)
    if present.any():
        assert np.abs(found - values)[present].max() <= 1e-4 * np.ptp(values[present])


def test_an_outlier_does_not_coarsen_the_others():
    values = noise(1000)
    values[500] = 1e6
    np.testing.assert_allclose(again(values), values, atol=2e-4)


def test_what_spans_decades_keeps_its_digits_at_every_size():
    values = 10.0 ** np.linspace(-12.0, 3.0, 500)
    np.testing.assert_allclose(again(values), values, rtol=2e-5)


def test_time_far_from_zero_keeps_its_resolution():
    times_s = 86_400.0 + np.arange(1000) / 1e5
    np.testing.assert_allclose(again(times_s), times_s, atol=1e-10, rtol=0)


@pytest.mark.whole_way
@pytest.mark.parametrize("jitter", [0.0, 0.01, 0.3])
@pytest.mark.parametrize("rate_hz", [1e3, 1e5])
def test_instants_with_jitter_come_again_within_a_tenth_of_the_way_to_the_next(rate_hz, jitter):
    random = np.random.default_rng(2)
    late = random.uniform(0.0, jitter, int(10 * rate_hz))
    times_s = 12.5 + (np.arange(late.size) + late) / rate_hz
    thinned = times_s[np.unique(random.integers(0, times_s.size, 8000))]
    for instants in (times_s, thinned):
        way_s = np.median(np.diff(instants))
        np.testing.assert_allclose(again(instants), instants, atol=0.1 * way_s, rtol=0)


@pytest.mark.parametrize("values", [[1e300, -1e300] * 50, [0.1] * 80, [], [np.nan] * 70, [1.5]])
def test_numbers_beyond_what_steps_can_say_are_kept(values):
    values = np.array(values)
    np.testing.assert_array_equal(again(values), values)


def test_gaps_stay_where_they_are():
    values = noise(500)
    values[::7] = np.nan
    values[:3] = np.nan
    values[200:260] = np.inf
    np.testing.assert_array_equal(np.isnan(again(values)), ~np.isfinite(values))


def test_a_smooth_curve_takes_a_byte_a_sample_and_noise_three():
    n = 20_000
    smooth = np.sin(np.linspace(0.0, 6.0, n))
    assert len(packed(smooth)) < 1.0 * n
    assert len(packed(noise(n))) < 3.2 * n


def test_text_of_any_kind_comes_again_and_the_same_document_gives_the_same_bytes():
    document = {"name": "µ\u2028</script>", "of": [1, None, True, {"x": 0.1}]}
    assert unpacked(packed(document)) == document
    assert packed(document) == packed(document)
    assert set(packed(document)) < set("ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/=")


def test_a_key_that_is_called_as_packed_arrays_are_is_no_array():
    document = {"shot_log": {"shot": "0001", "packed": "12 rings"}, "x": np.arange(100.0)}
    found = unpacked(packed(document))
    assert found["shot_log"] == document["shot_log"]
    np.testing.assert_array_equal(found["x"], document["x"])
