import builtins
import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import sosfiltfilt

from recoil_acquisition.errors import RecoilDaqError
from recoil_processing.filters import ChannelFrequencyClass, KaiserLowPass, LowPass, filter_engine, interleaved_kernel
from recoil_processing.filters.filter_engine import filter_channels

RATE_HZ = 50_000.0
FILTERS = [LowPass(500.0), LowPass(500.0, 3), LowPass(2000.0, padding="even"), ChannelFrequencyClass(180)]
NUMBA = interleaved_kernel.kernel_at_hand()
needs_numba = pytest.mark.skipif(not NUMBA, reason="needs numba, the extra `fast`")


def table(count, channels, seed=1):
    scales = 10.0 ** (np.arange(channels) % 7)
    return np.random.default_rng(seed).standard_normal((count, channels)).cumsum(axis=0) * scales


def agree(result, expected, samples):
    return bool(np.all(np.abs(result - expected) <= 1e-12 * np.abs(samples).max(axis=0)))


def one_by_one(zero_phase, samples):
    return np.column_stack([zero_phase.apply(column, RATE_HZ) for column in samples.T])


@pytest.mark.parametrize("zero_phase", FILTERS)
@pytest.mark.parametrize("layout", ["C", "F"])
@pytest.mark.parametrize("threads", [1, 2, 5, None])
@pytest.mark.parametrize("in_place", [False, True])
def test_threads_change_nothing(zero_phase, layout, threads, in_place):
    samples = np.array(table(3000, 3), order=layout)
    expected = one_by_one(zero_phase, samples)
    result = filter_channels(
        zero_phase, samples, RATE_HZ, engine="scipy", threads=threads, out=samples if in_place else None
    )
    assert np.array_equal(result, expected)
    assert (result is samples) == in_place


def test_results_go_where_they_are_asked_to():
    samples = table(3000, 3)
    kept, target = samples.copy(), np.empty((3000, 3))
    assert filter_channels(LowPass(500.0), samples, RATE_HZ, out=target) is target
    assert np.array_equal(target, one_by_one(LowPass(500.0), samples))
    assert np.array_equal(samples, kept)


def test_one_channel_is_filtered_in_place():
    samples = table(3000, 1)[:, 0]
    expected = LowPass(500.0).apply(samples, RATE_HZ)
    assert filter_channels(LowPass(500.0), samples, RATE_HZ, out=samples) is samples
    assert np.array_equal(samples, expected)


@needs_numba
@pytest.mark.parametrize("zero_phase", FILTERS)
@pytest.mark.parametrize("in_place", [False, True])
@pytest.mark.parametrize("channels", [1, 5, 16, 21, 32])
def test_the_kernel_gives_what_scipy_gives(zero_phase, in_place, channels):
    samples = table(5000, channels)
    recorded, expected = samples.copy(), one_by_one(zero_phase, samples)
    result = filter_channels(zero_phase, samples, RATE_HZ, engine="kernel", out=samples if in_place else None)
    assert agree(result, expected, recorded)
    assert (result is samples) == in_place


@needs_numba
@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    count=st.one_of(st.integers(1, 5000), st.integers(5000, 40_000)),
    half_order=st.integers(1, 6),
    cutoff_hz=st.floats(20.0, 20_000.0),
    periods=st.sampled_from([0.0, 3.0]),
)
def test_the_kernel_gives_what_scipy_gives_at_any_length(seed, count, half_order, cutoff_hz, periods):
    zero_phase = LowPass(cutoff_hz, half_order, padding_periods=periods)
    samples = table(count, 16, seed)
    design = zero_phase.two_pass(RATE_HZ)
    length = min(design.padding_samples, count - 1)
    expected = sosfiltfilt(design.sections, samples, axis=0, padtype="odd", padlen=length)
    result = filter_channels(zero_phase, samples, RATE_HZ, engine="kernel")
    assert agree(result, expected, samples)


@needs_numba
@pytest.mark.parametrize("layout", ["C", "F"])
@pytest.mark.parametrize("in_place", [False, True])
def test_the_kernel_takes_tables_of_any_layout(layout, in_place):
    for samples in (np.array(table(700, 16), order=layout), np.array(table(700, 20), order=layout)[:, 2:18]):
        recorded, expected = samples.copy(), one_by_one(LowPass(500.0), samples)
        result = filter_channels(LowPass(500.0), samples, RATE_HZ, engine="kernel", out=samples if in_place else None)
        assert agree(result, expected, recorded)
        assert (result is samples) == in_place


@needs_numba
@pytest.mark.parametrize("dtype", [np.float32, np.int16, ">f8"])
def test_the_kernel_takes_other_numbers_and_read_only_ones(dtype):
    samples = (100.0 * np.random.default_rng(5).standard_normal((6000, 16))).astype(dtype)
    samples.flags.writeable = False
    result = filter_channels(LowPass(500.0), samples, RATE_HZ, engine="kernel")
    assert agree(result, one_by_one(LowPass(500.0), samples.astype(np.float64)), samples)


@pytest.mark.parametrize("engine", ["scipy", pytest.param("kernel", marks=needs_numba)])
@pytest.mark.parametrize("value", [np.nan, np.inf])
@pytest.mark.parametrize("in_place", [False, True])
def test_samples_that_are_not_finite_are_refused_and_stay(engine, value, in_place):
    samples = table(4000, 16)
    samples[2500, 15] = value
    kept = samples.copy()
    with pytest.raises(ValueError, match="samples must be finite"):
        filter_channels(LowPass(500.0), samples, RATE_HZ, engine=engine, threads=2, out=samples if in_place else None)
    assert np.array_equal(samples, kept, equal_nan=True)


def test_filtering_in_place_needs_little_memory_beside_the_table():
    samples = table(200_000, 12).copy(order="F")
    LowPass(500.0).apply(samples[:1000], RATE_HZ)
    tracemalloc.start()
    filter_channels(LowPass(500.0), samples, RATE_HZ, engine="scipy", threads=2, out=samples)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 2 * 5 * samples[:, 0].nbytes


@needs_numba
def test_the_kernel_needs_no_memory_beside_the_table_but_for_the_padding():
    samples = table(200_000, 16)
    filter_channels(LowPass(500.0), samples[:1000], RATE_HZ, engine="kernel")
    tracemalloc.start()
    filter_channels(LowPass(500.0), samples, RATE_HZ, engine="kernel", out=samples)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 0.2 * samples.nbytes


def without_numba(monkeypatch):
    plain_import = builtins.__import__

    def refuse(name, *rest, **more):
        if name.split(".")[0] == "numba":
            raise ModuleNotFoundError("No module named 'numba'")
        return plain_import(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", refuse)
    monkeypatch.setattr(interleaved_kernel, "_compiled", {})
    monkeypatch.setattr(filter_engine, "kernel_at_hand", lambda: False)


def test_without_numba_plain_use_takes_scipy_in_silence(monkeypatch):
    samples = table(3000, 16)
    expected = one_by_one(LowPass(500.0), samples)
    without_numba(monkeypatch)
    monkeypatch.setattr(filter_engine, "KERNEL_FROM", 1)
    assert np.array_equal(LowPass(500.0).apply(samples, RATE_HZ), expected)
    assert np.array_equal(filter_channels(LowPass(500.0), samples, RATE_HZ), expected)


def test_without_numba_a_kernel_that_is_asked_for_names_the_extra(monkeypatch):
    without_numba(monkeypatch)
    with pytest.raises(RecoilDaqError, match=r"needs numba; install it by `pip install 'recoil-daq\[fast\]'`"):
        filter_channels(LowPass(500.0), table(100, 16), RATE_HZ, engine="kernel")


@needs_numba
def test_short_tables_do_not_wait_for_the_compiler(monkeypatch):
    monkeypatch.setattr(interleaved_kernel, "_compiled", {})
    LowPass(500.0).apply(table(20_000, 16), RATE_HZ)
    assert not interleaved_kernel._compiled


@needs_numba
def test_long_tables_take_the_kernel(monkeypatch):
    monkeypatch.setattr(interleaved_kernel, "_compiled", {})
    monkeypatch.setattr(filter_engine, "KERNEL_FROM", 16 * 3000)
    LowPass(500.0).apply(table(2999, 16), RATE_HZ)
    LowPass(500.0).apply(table(3000, 16)[:, ::-1], RATE_HZ)
    LowPass(500.0).apply(table(30_000, 2), RATE_HZ)
    assert not interleaved_kernel._compiled
    LowPass(500.0).apply(table(3000, 16), RATE_HZ)
    assert interleaved_kernel._compiled


@needs_numba
def test_a_read_only_installation_compiles_for_itself(monkeypatch):
    import numba

    plain_njit = numba.njit

    def njit(**options):
        if options.get("cache"):
            raise RuntimeError("cannot cache function: no locator available")
        return plain_njit(**options)

    monkeypatch.setattr(interleaved_kernel, "_compiled", {})
    monkeypatch.setattr(numba, "njit", njit)
    samples = table(400, 16)
    result = filter_channels(LowPass(500.0), samples, RATE_HZ, engine="kernel")
    assert agree(result, one_by_one(LowPass(500.0), samples), samples)


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"engine": "gpu"}, ValueError, "engine must be automatic, scipy or kernel, not 'gpu'"),
        ({"threads": 0}, ValueError, "threads must be at least 1"),
        ({"rate_hz": -1.0}, ValueError, "rate_hz must be positive"),
        ({"rate_hz": 900.0}, ValueError, "needs more than 1000 samples/s"),
        ({"out": np.zeros((10, 2), dtype=np.float32)}, TypeError, "float64, not float32"),
        ({"out": np.zeros((10, 3))}, ValueError, "out must have the shape of the samples"),
        ({"samples": np.zeros((10, 2, 2))}, ValueError, "n_samples, n_channels"),
    ],
)
def test_a_callers_mistakes_are_told(options, error, message):
    arguments = {"samples": np.zeros((10, 2)), "rate_hz": RATE_HZ, **options}
    with pytest.raises(error, match=message):
        filter_channels(LowPass(500.0), **arguments)


def test_a_filter_that_is_no_recursion_is_refused():
    with pytest.raises(TypeError, match="KaiserLowPass is no recursion"):
        filter_channels(KaiserLowPass(500.0), np.zeros((10, 2)), RATE_HZ)
