"""How accurate and how fast derivatives of a recoil's displacement are, beside peers with the best parameters.

The peers' parameters are chosen knowing the truth, for velocity and for acceleration apart; ours know nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import pytest
from numpy.typing import NDArray

from recoil_processing.motion.jerk_smoother import smooth_jerk
from recoil_processing.motion.savitzky_golay import local_polynomials
from recoil_processing.motion.smoothing_spline import fit_spline, smooth_spline
from tests.builders.sharp_recoil import motion, record_recoil

Array = NDArray[np.float64]
Pair = tuple[Array, Array]

SEEDS = range(10)
RATE_HZ = 2000.0


@pytest.fixture(autouse=True)
def _only_when_asked_for(request):
    if not request.config.getoption("benchmark_enable"):
        pytest.skip("a benchmark: ask for it with --benchmark-enable")


def gradient_twice(times: Array, z: Array, _: float) -> Iterator[Pair]:
    velocity = np.gradient(z, times)
    yield velocity, np.gradient(velocity, times)


def savitzky_golay(_: Array, z: Array, __: float) -> Iterator[Pair]:
    from scipy.signal import savgol_filter

    for order in (2, 3, 4, 5):
        for window in range(order + 1 + order % 2, 41, 2):
            yield tuple(savgol_filter(z, window, order, deriv=power, delta=1 / RATE_HZ) for power in (1, 2))


def quintic_spline(times: Array, z: Array, sigma: float) -> Iterator[Pair]:
    at = RATE_HZ * times
    for factor in np.geomspace(0.6, 2.0, 15):
        spline = fit_spline(at, z / sigma, factor * z.size)
        yield sigma * RATE_HZ * spline(at, 1), sigma * RATE_HZ**2 * spline(at, 2)


def smoother_of_one_intensity(times: Array, z: Array, sigma: float) -> Iterator[Pair]:
    import recoil_processing.motion.jerk_smoother as module
    from recoil_processing.motion.derivative import ScaledTrack

    track = ScaledTrack.of(times, z, sigma, 8)
    for log_q in np.arange(-10.0, 10.5, 1.0):
        states = module._smooth(track, np.full(z.size - 1, log_q)).states
        yield sigma * RATE_HZ * states[:, 1], sigma * RATE_HZ**2 * states[:, 2]


PEERS: dict[str, Callable[[Array, Array, float], Iterator[Pair]]] = {
    "np.gradient twice": gradient_twice,
    "Savitzky-Golay, oracle": savitzky_golay,
    "quintic spline, oracle": quintic_spline,
    "white jerk, oracle": smoother_of_one_intensity,
}
OURS = {
    "ours: jerk smoother": smooth_jerk,
    "ours: one intensity": lambda t, z: smooth_jerk(t, z, adaptive=False),
    "ours: quintic spline": smooth_spline,
    "ours: Savitzky-Golay 13": lambda t, z: local_polynomials(t, z, window=13),
}


def rms(errors: Array) -> float:
    return float(np.sqrt(np.mean(errors**2)))


@pytest.mark.parametrize("sigma", [5e-5, 2e-4])
def test_ours_is_at_least_as_accurate_as_the_best_peer_with_the_best_parameters(sigma, capsys):
    errors: dict[str, list[tuple[float, float, float]]] = {}
    for seed in SEEDS:
        recorded = record_recoil(seed, begin_s=0.06, end_s=0.30, frame_rate_hz=RATE_HZ, marker_sigma_m=sigma)
        times, z = recorded.frame_times_s, recorded.displacement_m
        _, v, a = motion(times)
        for name, peer in PEERS.items():
            found = [
                (rms(velocity - v), rms(acceleration - a), acceleration.max())
                for velocity, acceleration in peer(times, z, sigma)
            ]
            errors.setdefault(name, []).append(
                (min(f[0] for f in found), min(f[1] for f in found), min(found, key=lambda f: f[1])[2] / a.max())
            )
        for name, method in OURS.items():
            d = method(times, z)
            errors.setdefault(name, []).append(
                (rms(d.velocity - v), rms(d.acceleration - a), d.peak_acceleration()[1] / a.max())
            )
    table = {name: np.mean(values, axis=0) for name, values in errors.items()}
    with capsys.disabled():
        print(f"\n{1e3 * sigma:g} mm, {RATE_HZ:g} frames/s, {len(SEEDS)} records")
        print(f"{'RMSE':26s}{'v, m/s':>10s}{'a, m/s^2':>10s}{'peak a':>8s}")
        for name, (velocity, acceleration, peak) in table.items():
            print(f"{name:26s}{velocity:10.4f}{acceleration:10.1f}{peak:8.2f}")
    best = np.min([table[name][:2] for name in PEERS], axis=0)
    assert np.all(table["ours: jerk smoother"][:2] <= best)


def test_a_second_at_3000_frames_is_differentiated(benchmark):
    recorded = record_recoil(1, frame_rate_hz=5000.0)
    found = benchmark.pedantic(smooth_jerk, (recorded.frame_times_s, recorded.displacement_m), rounds=3)
    _, v, _ = motion(recorded.frame_times_s)
    assert rms(found.velocity - v) < 0.01
