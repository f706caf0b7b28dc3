import copy
import dataclasses
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_processing.filters import ChannelFrequencyClass, LowPass
from recoil_processing.filters.filtered import Filtered, filter_alike

RATE_HZ = 20_000.0
FILTERS = [LowPass(300.0), ChannelFrequencyClass(180)]


def columns(count=2000):
    rng = np.random.default_rng(1)
    return {"acceleration": rng.standard_normal(count), "force": rng.standard_normal(count)}


@pytest.mark.parametrize("zero_phase", FILTERS, ids=lambda f: type(f).__name__)
def test_every_column_passes_the_one_filter(zero_phase):
    table = filter_alike(zero_phase, columns(), RATE_HZ)
    assert list(table) == ["acceleration", "force"]
    assert len(table) == 2
    for name, recorded in columns().items():
        assert np.array_equal(table[name], zero_phase.apply(recorded, RATE_HZ))
    assert table.trusted.all()
    assert table.zero_phase is zero_phase
    assert table.describe() == zero_phase.describe(RATE_HZ)


@pytest.mark.parametrize("zero_phase", FILTERS, ids=lambda f: type(f).__name__)
@settings(max_examples=10, deadline=None)
@given(gaps=st.lists(st.tuples(st.sampled_from(["acceleration", "force"]), st.integers(0, 1900), st.integers(1, 90))))
def test_what_a_gap_in_any_column_reaches_is_trusted_in_none(zero_phase, gaps):
    recorded = columns()
    for name, begin, length in gaps:
        recorded[name][begin : begin + length] = np.nan
    table = filter_alike(zero_phase, recorded, RATE_HZ)
    expected = np.ones(2000, dtype=bool)
    reach = zero_phase.reach_samples(RATE_HZ)
    for _, begin, length in gaps:
        expected[max(begin - reach, 0) : begin + length + reach] = False
    assert np.array_equal(table.trusted, expected)


@pytest.mark.parametrize("zero_phase", FILTERS, ids=lambda f: type(f).__name__)
@settings(max_examples=10, deadline=None)
@given(mass_kg=st.floats(1.0, 5000.0), seed=st.integers(0, 2**32 - 1))
def test_force_is_mass_times_acceleration_behind_the_filter_if_it_was_before(zero_phase, mass_kg, seed):
    acceleration = np.random.default_rng(seed).standard_normal(2000)
    table = filter_alike(zero_phase, {"a": acceleration, "f": mass_kg * acceleration}, RATE_HZ)
    assert np.allclose(table["f"], mass_kg * table["a"], rtol=0, atol=1e-9 * mass_kg)


def test_a_joined_column_passes_the_same_filter():
    recorded = columns()
    recorded["acceleration"][100:110] = np.nan
    step = (np.arange(2000) > 700).astype(float)
    step[1500] = np.nan
    table = filter_alike(LowPass(300.0), recorded, RATE_HZ).joined_by({"step": step})
    at_once = filter_alike(LowPass(300.0), {**recorded, "step": step}, RATE_HZ)
    assert list(table) == ["acceleration", "force", "step"]
    assert all(np.array_equal(table[name], at_once[name]) for name in at_once)
    assert np.array_equal(table.trusted, at_once.trusted)
    assert table.zero_phase == at_once.zero_phase


def test_there_is_no_other_way_to_make_one():
    table = filter_alike(LowPass(300.0), columns(), RATE_HZ)
    with pytest.raises(TypeError, match="by filter_alike"):
        Filtered(columns(), table.trusted, LowPass(300.0), RATE_HZ)
    with pytest.raises(TypeError, match="by filter_alike"):
        Filtered()
    with pytest.raises(TypeError):
        dataclasses.replace(table, columns=columns())
    with pytest.raises(TypeError, match="no subclasses"):

        class Other(Filtered):
            pass


def test_one_cannot_be_changed():
    table = filter_alike(LowPass(300.0), columns(), RATE_HZ)
    with pytest.raises(TypeError, match="cannot be changed"):
        table.columns = columns()
    with pytest.raises(TypeError, match="cannot be changed"):
        table.zero_phase = LowPass(100.0)
    with pytest.raises(TypeError, match="cannot be changed"):
        del table.columns
    with pytest.raises(TypeError):
        table.columns["force"] = columns()["force"]
    with pytest.raises(ValueError, match="read-only"):
        table["force"][0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        table.trusted[0] = False


def test_recorded_columns_stay_as_they_were():
    recorded = columns()
    kept = {name: column.copy() for name, column in recorded.items()}
    filter_alike(LowPass(300.0), recorded, RATE_HZ)
    recorded["force"][0] = 2.0
    kept["force"][0] = 2.0
    assert all(np.array_equal(recorded[name], kept[name]) for name in kept)


def test_one_survives_copies_and_pickling():
    table = filter_alike(LowPass(300.0), columns(), RATE_HZ)
    assert copy.copy(table) is table
    assert copy.deepcopy({"a": table})["a"] is table
    back = pickle.loads(pickle.dumps(table))  # noqa: S301  # its own bytes
    assert all(np.array_equal(back[name], table[name]) for name in table)
    assert (back.zero_phase, back.rate_hz) == (table.zero_phase, table.rate_hz)
    with pytest.raises(ValueError, match="read-only"):
        back["force"][0] = 1.0


def test_one_can_be_compared_and_shown():
    table = filter_alike(LowPass(300.0), columns(), RATE_HZ)
    assert table == table  # comparing arrays would raise
    assert table != filter_alike(LowPass(300.0), columns(), RATE_HZ)
    assert "acceleration, force; LowPass(cutoff_hz=300.0" in repr(table)


@pytest.mark.parametrize(
    ("recorded", "message"),
    [
        ({}, "no columns"),
        ({"a": np.zeros(5), "b": np.zeros(6)}, r"not b \(6,\)"),
        ({"a": np.zeros((5, 2))}, r"not a \(5, 2\)"),
        ({"a": np.zeros(50), "b": np.full(50, np.inf)}, "column b: samples must be finite"),
    ],
)
def test_columns_that_are_no_table_are_refused(recorded, message):
    with pytest.raises(ValueError, match=message):
        filter_alike(LowPass(300.0), recorded, RATE_HZ)


def test_nothing_of_a_table_is_trusted_where_a_column_lost_all():
    table = filter_alike(LowPass(300.0), {"a": np.zeros(50), "b": np.full(50, np.nan)}, RATE_HZ)
    assert not table.trusted.any()
    assert np.isnan(table["b"]).all()


def test_columns_that_do_not_fit_are_not_joined():
    table = filter_alike(LowPass(300.0), columns(), RATE_HZ)
    with pytest.raises(ValueError, match="are there already: force"):
        table.joined_by({"force": np.zeros(2000)})
    with pytest.raises(ValueError, match="columns have 1999 samples, the table has 2000"):
        table.joined_by({"step": np.zeros(1999)})
