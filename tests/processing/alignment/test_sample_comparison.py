from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_processing.alignment.sample_comparison import (
    BITS,
    COUNTS,
    PRINTED,
    SINGLE,
    SampleComparison,
    Sampled,
    beat_numbers,
    compare_records,
    printed_step,
)

RNG = np.random.default_rng(5)
N, FIRST = 4000, 700
FILE = 50.0 * np.exp(-(((np.arange(N) - 1800) / 90.0) ** 2)) + 0.05 * RNG.normal(size=N)


def sampled(samples: np.ndarray, numbers: np.ndarray | None = None) -> Sampled:
    return Sampled(np.asarray(samples, dtype=float), np.arange(len(samples)) if numbers is None else numbers)


def one(
    preview: Sampled, file: Sampled | None = None, expected: int | None = FIRST, within: int = 0, printed: float = 0.0
) -> SampleComparison:
    pair = {"p": (preview, sampled(FILE) if file is None else file)}
    return compare_records(pair, expected=expected, within=within, printed={"p": printed})["p"]


PART = FILE[FIRST : FIRST + 2500]


@pytest.mark.parametrize("expected", [FIRST, None])
def test_a_preview_that_is_the_file_is_proven_equal_bit_by_bit(expected: int | None) -> None:
    found = one(sampled(PART), expected=expected)
    assert found.proven_equal
    assert (found.compared, found.equal, found.different, found.rule) == (2500, 2500, 0, BITS)
    assert (found.lag, found.aligned_by) == (FIRST, "correlation" if expected is None else "time")
    assert (found.missing_in_preview, found.missing_in_file, found.scale) == (0, 0, 1.0)
    assert json.loads(json.dumps(found.to_json(), allow_nan=False)) == found.to_json()


@pytest.mark.parametrize("scale", [1.01, 0.99, -1.0, 1.00001])
def test_a_preview_of_another_scale_is_told_its_scale(scale: float) -> None:
    found = one(sampled(scale * PART))
    assert not found.proven_equal
    assert found.scale == pytest.approx(scale, rel=1e-9)
    assert (found.offset, found.shift, found.lag) == (0.0, 0, FIRST)
    assert found.first_difference == FIRST
    assert found.values == (scale * PART[0], PART[0])


def test_a_preview_with_another_zero_is_told_it() -> None:
    found = one(sampled(PART + 0.25))
    assert (found.scale, found.offset) == (1.0, pytest.approx(0.25))


@pytest.mark.parametrize("by", [1, -1, 7, 400])
def test_a_preview_that_is_shifted_is_told_by_how_many_samples(by: int) -> None:
    found = one(sampled(FILE[FIRST + by : FIRST + by + 2500]))
    assert found.shift == by
    assert (found.different, found.missing_in_preview) == (0, 0)
    assert not found.proven_equal


def test_what_stands_still_beside_the_shot_hides_no_shift() -> None:
    still = np.round(FILE)  # whole numbers, at rest nearly all the same
    assert np.mean(still[FIRST : FIRST + 600] == 0.0) > 0.99
    for by in (0, 1, -3):
        found = one(sampled(still[FIRST + by :][:2500]), sampled(still))
        assert (found.shift, found.different) == (by, 0)
    wrong = still[FIRST + 1 :][:2500].copy()
    wrong[1100] += 7.0
    found = one(sampled(wrong), sampled(still))
    assert (found.shift, found.different, found.first_difference) == (1, 1, FIRST + 1101)


def test_a_larger_shot_in_the_same_file_is_not_taken_for_it() -> None:
    louder = np.concatenate([FILE, 40.0 * FILE[::-1] + 20.0 * RNG.normal(size=N)])
    found = one(sampled(1.01 * PART), sampled(louder), expected=None)
    assert (found.lag, found.scale) == (FIRST, pytest.approx(1.01))


def test_what_the_time_leaves_open_is_no_shift() -> None:
    assert one(sampled(FILE[FIRST + 3 :][:2500]), within=3).proven_equal
    assert one(sampled(FILE[FIRST + 4 :][:2500]), within=3).shift == 4


def test_without_time_a_shift_shows_beside_the_other_channels() -> None:
    other = np.cumsum(RNG.normal(size=N))
    pairs = {
        "a": (sampled(PART), sampled(FILE)),
        "b": (sampled(other[FIRST + 1 :][:2500]), sampled(other)),
        "c": (sampled(FILE[::-1][FIRST:][:2500]), sampled(FILE[::-1])),
    }
    found = compare_records(pairs)
    assert {name: told.shift for name, told in found.items()} == {"a": 0, "b": 1, "c": 0}
    assert [name for name, told in found.items() if told.proven_equal] == ["a", "c"]
    alone = compare_records({"b": pairs["b"]})["b"]
    assert (alone.shift, alone.lag, alone.proven_equal) == (None, FIRST + 1, True)


def test_a_hole_is_counted_where_it_is() -> None:
    kept = np.r_[0:1000, 1064:2500]
    found = one(sampled(PART[kept], kept))
    assert (found.missing_in_preview, found.first_missing) == (64, FIRST + 1000)
    assert (found.compared, found.different, found.shift) == (2436, 0, 0)
    assert not found.proven_equal
    lost = PART.copy()
    lost[1000:1064] = np.nan
    assert one(sampled(lost)).missing_in_preview == 64


def test_a_hole_that_the_numbers_hide_is_a_slip_from_some_sample_on() -> None:
    found = one(sampled(np.r_[PART[:1000], PART[1064:]]))
    assert (found.slip_at, found.slip, found.shift) == (FIRST + 1000, 64, 0)
    assert found.first_difference == FIRST + 1000
    early = one(sampled(np.r_[PART[:300], PART[310:]]), expected=None)
    assert early.slip == 10
    assert not early.proven_equal


def test_what_the_file_lacks_is_counted_too() -> None:
    found = one(sampled(FILE[3000:]), sampled(FILE[:3500]), expected=3000)
    assert (found.compared, found.missing_in_file, found.beyond, found.proven_equal) == (500, 0, 500, True)
    gap = FILE.copy()
    gap[900:905] = np.nan
    assert one(sampled(PART), sampled(gap)).missing_in_file == 5


def test_counts_are_compared_as_whole_numbers() -> None:
    size = 50.0 / 2**15
    counts = np.rint(FILE / size)
    file = Sampled(counts * size, np.arange(N), size)
    as_float = (counts[FIRST : FIRST + 2500] * size).astype(np.float32).astype(float)
    found = one(sampled(as_float), file)
    assert (found.rule, found.proven_equal, found.tolerance) == (COUNTS, True, 0.0)
    as_float[77] += size
    found = one(sampled(as_float), file)
    assert (found.different, found.first_difference) == (1, FIRST + 77)
    assert found.largest == pytest.approx(size, rel=1e-3)


def test_floats_are_equal_to_a_tolerance_that_has_a_name() -> None:
    single = one(sampled(PART.astype(np.float32).astype(float)))
    assert (single.rule, single.proven_equal) == (SINGLE, True)
    assert 0 < single.tolerance < 1e-5
    digits = np.round(FILE, 3)
    assert printed_step(digits) == 1e-3
    printed = one(sampled(PART), sampled(digits), printed=1e-3)
    assert (printed.rule, printed.proven_equal, printed.tolerance) == (PRINTED, True, 5e-4)
    assert not one(sampled(PART), sampled(digits)).proven_equal
    assert not one(sampled(PART + 6e-4), sampled(digits), printed=1e-3).proven_equal


@pytest.mark.parametrize(
    ("values", "step"),
    [([0.5, 1.25, -3.75], 0.01), ([1.0, 2.0], 1.0), ([1000.0, 12000.0], 1000.0), ([np.pi], 0.0), ([np.nan], 0.0)],
)
def test_the_digits_of_a_text_are_found_in_its_numbers(values: list[float], step: float) -> None:
    assert printed_step(np.array(values)) == pytest.approx(step)


def test_a_record_of_another_shot_is_equal_nowhere() -> None:
    found = one(sampled(RNG.normal(size=2500)), expected=None)
    assert found.equal < 5
    assert not found.proven_equal


def test_a_channel_that_stands_still_is_laid_where_the_others_are_and_proves_nothing_alone() -> None:
    still = sampled(np.full(2500, 2.5)), sampled(np.full(N, 2.5))
    beside = compare_records({"a": (sampled(PART), sampled(FILE)), "still": still})["still"]
    assert (beside.proven_equal, beside.lag) == (True, FIRST)
    alone = compare_records({"still": still})["still"]
    assert (alone.compared, alone.proven_equal) == (0, False)


def test_nothing_at_all_is_compared_without_a_fault() -> None:
    empty = sampled(np.empty(0))
    assert one(empty).compared == 0
    assert one(sampled(PART), empty).compared == 0
    assert one(sampled(np.full(9, np.nan))).compared == 0


def test_instants_on_a_beat_have_numbers_and_others_have_none() -> None:
    times = 5.0 + 2e-5 * np.array([0, 1, 2, 5, 6]) + 1e-7
    assert beat_numbers(times, 2e-5).tolist() == [0, 1, 2, 5, 6]
    assert beat_numbers(np.array([0.0, 1e-5, 1.2e-5]), 1e-5) is None
    assert beat_numbers(np.array([0.0, 1e9]), 1e-5) is None


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.floats(width=64), max_size=60),
    st.lists(st.floats(width=64), max_size=60),
    st.sampled_from([0.0, 1e-3, 5e-324, 1e300]),
    st.none() | st.integers(-70, 70),
)
def test_no_numbers_end_a_comparison(
    preview: list[float], file: list[float], size: float, expected: int | None
) -> None:
    whole = Sampled(np.array(file), np.arange(len(file)), size)
    found = one(sampled(np.array(preview)), whole, expected, printed=1e-3)
    assert json.loads(json.dumps(found.to_json(), allow_nan=False)) == found.to_json()
    assert found.compared <= min(len(preview), len(file))


@settings(max_examples=30, deadline=None)
@given(st.integers(-300, 300), st.integers(400, 1500), st.sampled_from([0.5, 0.99, 1.0, 1.01, 2.0]), st.integers(0, 60))
def test_shift_scale_and_hole_are_told_whatever_they_are(by: int, start: int, scale: float, hole: int) -> None:
    kept = np.r_[0:800, 800 + hole : 1600]
    found = one(sampled(scale * FILE[start + by : start + by + 1600][kept], kept), expected=start)
    assert found.shift == by
    assert found.missing_in_preview == hole
    assert found.scale == pytest.approx(scale, rel=1e-5)
    assert found.proven_equal == (by == 0 and hole == 0 and scale == 1.0)
