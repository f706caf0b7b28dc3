from __future__ import annotations

import numpy as np
import pytest

from recoil_acquisition.channel import Channel, RawCounts, Step
from recoil_acquisition.clocks.timebase import TimeBase
from recoil_acquisition.quantities.quantity import SI_UNITS

BASE = TimeBase.uniform("dewetron", 0.0, 1e-3, 4)


@pytest.mark.parametrize("quantity", SI_UNITS)
def test_the_unit_follows_from_the_quantity(quantity: str) -> None:
    assert Channel("a", quantity, np.zeros(4), BASE).unit == SI_UNITS[quantity]


def test_an_unknown_quantity_is_refused() -> None:
    with pytest.raises(ValueError, match="unknown quantity 'accel'"):
        Channel("a", "accel", np.zeros(4), BASE)


@pytest.mark.parametrize("shape", [(3,), (5,), (4, 1), ()])
def test_samples_that_do_not_fit_their_time_base_are_refused(shape: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match=r"channel 'a'.*time base of 4"):
        Channel("a", "force", np.zeros(shape), BASE)


@pytest.mark.parametrize("dtype", ["int32", "float16", ">f8", "complex128"])
def test_samples_that_are_not_native_floats_are_refused(dtype: str) -> None:
    with pytest.raises(ValueError, match="float64 or float32"):
        Channel("a", "force", np.zeros(4, dtype=dtype), BASE)


def test_lost_samples_are_the_nan_ones() -> None:
    samples = np.array([0.0, np.nan, np.inf, -1.0], dtype=np.float32)
    np.testing.assert_array_equal(Channel("a", "force", samples, BASE).lost, [False, True, False, False])


def test_raw_counts_are_integers_as_many_as_samples() -> None:
    with pytest.raises(ValueError, match="must be integers"):
        RawCounts(np.zeros(4), 1.0, 0.0, "V")  # type: ignore[arg-type]  # what the test is about
    with pytest.raises(ValueError, match=r"\(3,\) raw counts beside \(4,\) samples"):
        Channel("a", "force", np.zeros(4), BASE, raw=RawCounts(np.zeros(3, dtype=np.int16), 1.0, 0.0, "V"))
    kept = Channel("a", "force", np.zeros(4), BASE, raw=RawCounts(np.zeros(4, dtype=np.int16), 1.0, 0.0, "V"))
    assert kept.raw is not None
    assert kept.raw.counts.dtype == np.int16


def test_new_samples_are_a_new_channel_with_one_more_line_of_history() -> None:
    first = Step("convert to SI", "0.1.0", {"unit": "g"})
    second = Step("filter", "0.1.0", {"cutoff_hz": 500.0})
    old = Channel("a", "force", np.zeros(4), BASE, role="", u_rel=0.01, history=(first,))
    new = old.with_samples(np.ones(4), second)
    assert new.history == (first, second)
    assert old.history == (first,)
    np.testing.assert_array_equal(new.samples, 1.0)
    np.testing.assert_array_equal(old.samples, 0.0)
    assert (new.u_rel, new.time_base) == (old.u_rel, old.time_base)


def test_new_samples_of_another_length_are_refused() -> None:
    with pytest.raises(ValueError, match="time base of 4"):
        Channel("a", "force", np.zeros(4), BASE).with_samples(np.zeros(3), Step("cut", "0.1.0"))
