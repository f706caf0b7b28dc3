from __future__ import annotations

import math
from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_acquisition.clocks.timebase import AbsoluteStart, TimeBase, rounded_step_s

STAMPS = np.array([0.0, 0.1, 0.25])
NOON = AbsoluteStart("2026-03-01T12:00:00", "unknown", "preamble")


def test_a_uniform_time_base_has_its_instants() -> None:
    base = TimeBase.uniform("dewetron", -0.5, 0.25, 4)
    np.testing.assert_array_equal(base.times_s, [-0.5, -0.25, 0.0, 0.25])
    assert (base.start_s, base.end_s, base.rate_hz) == (-0.5, 0.25, 4.0)


def test_a_stamped_time_base_has_the_given_instants() -> None:
    base = TimeBase.stamped("can", STAMPS)
    np.testing.assert_array_equal(base.times_s, STAMPS)
    assert (base.start_s, base.end_s, base.count, base.step_s) == (0.0, 0.25, 3, None)
    assert base.rate_hz == pytest.approx(1 / 0.125)


def test_the_uniform_instants_do_not_accumulate_rounding() -> None:
    base = TimeBase.uniform("dewetron", 0.0, 1e-4, 1_000_001)
    assert base.end_s == 100.0


def test_integer_stamps_become_seconds_in_float64() -> None:
    base = TimeBase.stamped("can", np.array([1, 2, 4]))
    assert base.times_s.dtype == np.float64


@pytest.mark.parametrize("base", [TimeBase.uniform("c", 1.5, 0.1, 0), TimeBase.stamped("c", np.array([]))])
def test_a_time_base_without_instants_is_possible(base: TimeBase) -> None:
    assert base.times_s.shape == (0,)
    assert base.times_s.dtype == np.float64
    assert base.end_s == base.start_s


def test_one_stamp_has_no_rate() -> None:
    assert math.isnan(TimeBase.stamped("c", np.array([3.0])).rate_hz)
    assert TimeBase.uniform("c", 3.0, 0.5, 1).rate_hz == 2.0


@pytest.mark.parametrize("step_s", [0.0, -1e-3, math.nan, math.inf])
def test_a_step_that_is_not_positive_and_finite_is_refused(step_s: float) -> None:
    with pytest.raises(ValueError, match="step_s must be positive"):
        TimeBase.uniform("c", 0.0, step_s, 3)


@pytest.mark.parametrize("start_s", [math.nan, math.inf])
def test_a_start_that_is_not_finite_is_refused(start_s: float) -> None:
    with pytest.raises(ValueError, match="start_s must be finite"):
        TimeBase.uniform("c", start_s, 1.0, 3)


def test_a_negative_count_is_refused() -> None:
    with pytest.raises(ValueError, match="count must not be negative"):
        TimeBase.uniform("c", 0.0, 1.0, -1)


@pytest.mark.parametrize(
    ("stamps", "match"),
    [
        ([0.0, 0.0], "increase strictly"),
        ([1.0, 0.5], "increase strictly"),
        ([0.0, math.nan], "finite"),
        ([math.nan], "finite"),
        ([0.0, math.inf], "finite"),
        ([[0.0, 1.0]], "shape"),
    ],
)
def test_stamps_that_are_no_instants_are_refused(stamps: list[float], match: str) -> None:
    with pytest.raises(ValueError, match=match):
        TimeBase.stamped("c", np.array(stamps))


def test_uniform_and_stamped_at_once_or_neither_is_refused() -> None:
    with pytest.raises(ValueError, match="either uniform"):
        TimeBase("c", 0.0, 0.1, 3, STAMPS)
    with pytest.raises(ValueError, match="either uniform"):
        TimeBase("c", 0.0, None, 3)


def test_fields_that_contradict_each_other_are_refused() -> None:
    with pytest.raises(ValueError, match=r"start_s is 5\.0"):
        TimeBase("c", 5.0, None, 3, STAMPS)
    with pytest.raises(ValueError, match="shape"):
        TimeBase("c", 0.0, None, 4, STAMPS)
    with pytest.raises(ValueError, match="float64"):
        TimeBase("c", 0.0, None, 3, STAMPS.astype(np.float32))


def test_a_step_that_float64_cannot_resolve_is_refused() -> None:
    # Seconds since 1970 with 100 ns steps: neighbouring float64 numbers are 238 ns apart there
    with pytest.raises(ValueError, match="cannot distinguish instants"):
        TimeBase.uniform("c", 1.77e9, 1e-7, 1000)
    TimeBase.uniform("c", 1.77e9, 1e-5, 1000)


@pytest.mark.exhaustive
@given(
    start_s=st.floats(-1e9, 1e9),
    step_s=st.floats(1e-9, 1e3),
    count=st.integers(0, 300),
)
@settings(max_examples=200, deadline=None)
def test_every_accepted_uniform_time_base_increases_strictly(start_s: float, step_s: float, count: int) -> None:
    try:
        base = TimeBase.uniform("c", start_s, step_s, count)
    except ValueError:
        assert step_s <= 4 * math.ulp(max(abs(start_s), abs(start_s + step_s * count)))
        return
    assert base.times_s.shape == (count,)
    assert np.all(np.diff(base.times_s) > 0)


def test_the_same_instants_on_another_clock_are_not_the_same() -> None:
    one, other = TimeBase.stamped("camera", STAMPS), TimeBase.stamped("can", STAMPS)
    assert one.same_instants(TimeBase.stamped("camera", STAMPS.copy()))
    assert not one.same_instants(other)
    assert not one.same_instants(TimeBase.stamped("camera", STAMPS[:2]))


def test_uniform_and_stamped_can_be_the_same_instants_without_being_identical() -> None:
    uniform = TimeBase.uniform("c", 0.0, 0.25, 3)
    stamped = TimeBase.stamped("c", uniform.times_s)
    assert uniform.same_instants(stamped)
    assert not uniform.is_identical(stamped)
    assert not stamped.is_identical(uniform)


def test_identical_time_bases_agree_in_every_field() -> None:
    base = TimeBase.stamped("c", STAMPS, NOON)
    assert base.is_identical(TimeBase.stamped("c", STAMPS.copy(), NOON))
    assert not base.is_identical(TimeBase.stamped("c", STAMPS, None))
    assert not base.is_identical(TimeBase.stamped("d", STAMPS, NOON))
    assert not base.is_identical(TimeBase.stamped("c", np.array([0.0, 0.2, 0.25]), NOON))
    uniform = TimeBase.uniform("c", 0.0, 0.1, 3)
    assert uniform.is_identical(TimeBase.uniform("c", 0.0, 0.1, 3))
    assert not uniform.is_identical(TimeBase.uniform("c", 0.0, 0.2, 3))


def test_a_time_base_is_frozen_and_a_replaced_one_computes_anew() -> None:
    base = TimeBase.uniform("c", 0.0, 0.5, 3)
    assert base.end_s == 1.0
    with pytest.raises(FrozenInstanceError):
        base.count = 4  # type: ignore[misc]  # what the test is about
    assert replace(base, count=5).end_s == 2.0


@given(
    start=st.floats(-1e4, 1e4),
    step=st.floats(1e-6, 10.0),
    count=st.integers(0, 200),
    low=st.floats(-3.0, 203.0),
    high=st.floats(-3.0, 203.0),
    stamped=st.booleans(),
)
def test_a_span_holds_the_instants_from_its_start_to_before_its_stop(start, step, count, low, high, stamped):
    times_s = start + step * np.arange(count)
    base = TimeBase.stamped("daq", times_s) if stamped else TimeBase.uniform("daq", start, step, count)
    start_s, stop_s = start + low * step, start + high * step
    first, stop = base.span(start_s, stop_s)
    assert 0 <= first <= stop <= count
    np.testing.assert_array_equal(np.flatnonzero((times_s >= start_s) & (times_s < stop_s)), np.arange(first, stop))


@pytest.mark.parametrize("instant_s", [-math.inf, math.inf])
def test_a_span_may_be_open(instant_s):
    base = TimeBase.uniform("daq", 1.0, 0.1, 10)
    assert base.span(-math.inf, instant_s) == ((0, 10) if instant_s > 0 else (0, 0))


@given(first=st.integers(0, 50), length=st.integers(0, 50), stamped=st.booleans())
def test_a_part_is_the_instants_of_its_numbers(first, length, stamped):
    whole = TimeBase.uniform("daq", 12.5, 2e-5, 100, AbsoluteStart("2026-08-03T12:23:05", "UTC", "header"))
    if stamped:
        whole = TimeBase.stamped("daq", whole.times_s, whole.absolute_start)
    part = whole.part(first, first + length)
    assert part.count == length
    np.testing.assert_allclose(part.times_s, whole.times_s[first : first + length], rtol=0, atol=4e-15)
    assert (part.clock, part.absolute_start) == (whole.clock, whole.absolute_start)
    if length:
        assert part.end_s == part.times_s[-1]


def stamps(rate_hz: float, count: int = 4000) -> np.ndarray:
    return np.arange(count) / rate_hz


@pytest.mark.parametrize("share", [0.002, 0.008, 0.05])
def test_the_rate_of_stamps_that_jitter_is_that_of_all_of_them(share: float) -> None:
    rng = np.random.default_rng(2)
    for jitter in (share * rng.standard_normal(21_000), share * (np.arange(21_000) % 2)):
        base = TimeBase.stamped("c", stamps(50_000.0, 21_000) + jitter / 50_000.0)
        assert base.rate_hz == pytest.approx(50_000.0, rel=1e-5)


def test_gaps_leave_the_rate_and_bursts_do_not_raise_it() -> None:
    kept = np.delete(stamps(50_000.0), np.r_[100:180, 700, 2000:2900])
    assert TimeBase.stamped("c", kept).rate_hz == pytest.approx(50_000.0)
    number = np.arange(1262)
    read_by_tens = 1e-2 * (number // 10) + 1e-4 * (number % 10)
    assert TimeBase.stamped("c", read_by_tens).rate_hz == pytest.approx(1000.0, rel=1e-3)


@pytest.mark.parametrize("rate_hz", [8000.0, 6000.0, 4900.0, 1980.0])
def test_stamps_that_are_rounded_to_ticks_have_the_rate_of_what_was_rounded(rate_hz: float) -> None:
    rounded = np.round(stamps(rate_hz) / 1e-4) * 1e-4
    assert TimeBase.stamped("c", rounded).rate_hz == pytest.approx(rate_hz, rel=1e-4)
    assert rounded_step_s(rounded) == pytest.approx(1 / rate_hz, rel=1e-4)


def test_lost_samples_are_no_rounding() -> None:
    rng = np.random.default_rng(3)
    for lost in ([500, 1000, 2700], np.sort(rng.choice(4000, 400, replace=False))):
        kept = np.delete(stamps(10_000.0), lost)
        assert rounded_step_s(kept) is None
        assert TimeBase.stamped("c", kept).rate_hz == pytest.approx(10_000.0)


@pytest.mark.parametrize(
    ("text", "doubtful"),
    [
        ("1601-01-01T00:00:00", True), ("1904-01-01T00:00:00", True), ("1970-01-01T00:00:03", True),
        ("1980-01-06T00:00:00", True), ("9999-12-31T23:59:59", True), ("2026-08-03T12:23:05", False),
        ("2100-01-01T00:00:00", False), ("sometime", False),
    ],
)  # fmt: skip
def test_a_start_of_a_clock_that_was_never_set_is_doubtful(text: str, doubtful: bool) -> None:
    assert AbsoluteStart(text, "unknown", "head").is_doubtful == doubtful


@pytest.mark.parametrize(
    ("text", "zone", "exact"),
    [
        ("2026-03-01T12:00:00", "UTC", (1_772_366_400_000_000_000, 10**9)),
        ("2026-03-01T12:00:00.978", "UTC", (1_772_366_400_978_000_000, 10**6)),
        ("2026-03-01T12:00:00.123456789", "UTC", (1_772_366_400_123_456_789, 1)),
        ("2026-03-01T12:00:00.1234567891234", "UTC", (1_772_366_400_123_456_789, 1)),
        ("2026-03-01T14:00:00.5", "+02:00", (1_772_366_400_500_000_000, 10**8)),
        ("2026-03-01T12:00:00,25", "unknown", (1_772_366_400_250_000_000, 10**7)),
        ("1969-12-31T23:59:59.75", "UTC", (-250_000_000, 10**7)),
        ("noon", "UTC", None),
    ],
)
def test_a_start_is_exact_to_the_digits_that_it_is_given_with(
    text: str, zone: str, exact: tuple[int, int] | None
) -> None:
    assert AbsoluteStart(text, zone, "header").exact_ns == exact
