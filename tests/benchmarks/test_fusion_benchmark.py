"""What fusing camera and accelerometer gains over the camera alone, how true its uncertainties are, and its speed."""

from __future__ import annotations

import time

import numpy as np
import pytest
from scipy.interpolate import UnivariateSpline

from recoil_processing.motion.fusion import FusedMotion, fuse
from tests.builders.sharp_recoil import ONSET_S, Recorded, motion, record_recoil

SEEDS = range(60)
ROWS = ((2000.0, 5e-5, 5.0), (1000.0, 2e-4, 20.0), (500.0, 5e-4, 20.0))
"""Frame rate in Hz, noise of the marker in m and of the accelerometer in m/s^2."""


def fused(
    recorded: Recorded, sigma: float, acceleration_sigma: float, shift_s: float = 0.0, u_s: float = 0.0
) -> FusedMotion:
    result = fuse(
        recorded.frame_times_s + shift_s,
        recorded.displacement_m,
        0.0,
        recorded.step_s,
        recorded.acceleration_m_s2,
        marker_sigma_m=sigma,
        acceleration_density=acceleration_sigma**2 * recorded.step_s,
        u_offset_s=u_s,
    )
    assert isinstance(result, FusedMotion)
    return result


def rms(errors) -> float:
    return float(np.sqrt(np.mean(np.square(errors))))


def camera_alone(recorded: Recorded, sigma: float, x, v) -> tuple[float, float]:
    """Errors of the quintic spline whose misfit is the best there is, in the motion."""
    at = (recorded.frame_times_s > ONSET_S) & (recorded.frame_times_s < ONSET_S + 0.3)
    step = float(np.median(np.diff(recorded.frame_times_s)))
    frames, z = recorded.frame_times_s / step, recorded.displacement_m / sigma
    tried = []
    for factor in np.geomspace(0.7, 1.6, 8):
        spline = UnivariateSpline(frames, z, k=5, s=factor * z.size)
        tried.append((rms((sigma * spline(frames) - x)[at]), rms((sigma / step * spline(frames, 1) - v)[at])))
    return min(t[0] for t in tried), min(t[1] for t in tried)


@pytest.mark.parametrize("row", ROWS)
def test_fusion_beats_the_camera_alone_and_states_its_uncertainty(row, capsys):
    rate, sigma, acceleration_sigma = row
    errors, alone, z, covered, shifts = [], [], [], [], []
    rng = np.random.default_rng(0)
    for seed in SEEDS:
        recorded = record_recoil(
            seed, frame_rate_hz=rate, marker_sigma_m=sigma, acceleration_sigma_m_s2=acceleration_sigma
        )
        shift = 50e-6 * rng.standard_normal()
        results = [fused(recorded, sigma, acceleration_sigma, *clock) for clock in ((), (50e-6,), (shift, 50e-6))]
        x, v, _ = motion(results[0].times_s)
        at = (results[0].times_s > ONSET_S) & (results[0].times_s < ONSET_S + 0.3)
        errors.append([part for r in results for part in (rms((r.position_m - x)[at]), rms((r.velocity_m_s - v)[at]))])
        parts = [
            [((r.position_m - x) / r.u_position_m)[at], ((r.velocity_m_s - v) / r.u_velocity_m_s)[at]]
            for r in (results[0], results[2])
        ]
        z.append([[rms(p) for p in pair] for pair in parts])
        covered.append([[np.mean(np.abs(p) < 1.96) for p in pair] for pair in parts])
        shifts.append([results[0].innovation_statistic, results[1].innovation_statistic,
                       results[0].shift_statistic(0.0), results[1].shift_statistic(0.0)])  # fmt: skip
        if seed < 10:
            alone.append(camera_alone(recorded, sigma, *motion(recorded.frame_times_s)[:2]))
    mean, other = np.mean(errors, axis=0), np.mean(alone, axis=0)
    z_rms, share, shift_figures = rms_of(z), np.mean(covered, axis=0), np.mean(shifts, axis=0)
    with capsys.disabled():
        print(
            f"\n{rate:g} frames/s, {1e3 * sigma:g} mm, accelerometer {acceleration_sigma:g} m/s^2, {len(SEEDS)} shots"
        )
        print(f"{'':34s}{'x, mm':>9s}{'v, m/s':>9s}")
        print(f"{'camera alone, oracle spline':34s}{1e3 * other[0]:9.4f}{other[1]:9.4f}")
        print(f"{'fused':34s}{1e3 * mean[0]:9.4f}{mean[1]:9.4f}")
        print(f"{'  over the oracle spline':34s}{other[0] / mean[0]:9.2f}{other[1] / mean[1]:9.2f}")
        print(f"{'fused, clock 50 us wrong':34s}{1e3 * mean[2]:9.4f}{mean[3]:9.4f}")
        for name, i in (("clock right", 0), ("clock wrong by N(0, 50 us), told", 1)):
            print(f"{name}: z RMS of x, v", np.round(z_rms[i], 2), "95 % cover", np.round(100 * share[i], 1))
        print("innovation statistic {:.3f}, with 50 us untold {:.3f}".format(*shift_figures[:2]))
        print("offset by the motion {:.1f}, with 50 us untold {:.1f} sigma off".format(*shift_figures[2:]))
    assert np.all((z_rms > 0.8) & (z_rms < 1.2))
    assert np.all((share[0] > 0.92) & (share[0] < 0.98))
    assert other[0] / mean[0] > 1.4
    assert other[1] / mean[1] > 4
    assert shift_figures[1] > shift_figures[0]
    assert shift_figures[3] > 1.5 * shift_figures[2]


def rms_of(values) -> np.ndarray:
    return np.sqrt(np.mean(np.square(values), axis=0))


def test_200_000_samples_and_3000_frames_are_fused(benchmark):
    recorded = record_recoil(1, frame_rate_hz=5000.0, rate_hz=333_333.0)
    assert recorded.times_s.size == 200_001
    assert recorded.frame_times_s.size == 3000
    started = time.process_time()
    result = benchmark.pedantic(fused, (recorded, 5e-5, 5.0, 0.0, 5e-6), rounds=5)
    assert (time.process_time() - started) / 5 < 0.3
    x, _, _ = motion(result.times_s)
    assert rms(result.position_m - x) < 2e-5
