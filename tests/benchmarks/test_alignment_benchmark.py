"""How long filtering and aligning take on a laptop; each checks its answer."""

from __future__ import annotations

import numpy as np
import pytest

from processing.filters import LowPass
from processing.motion_alignment import MotionFit, align_motion
from tests.builders.motions import record_motion


@pytest.fixture(autouse=True)
def _only_when_asked_for(request):
    if not request.config.getoption("benchmark_enable"):
        pytest.skip("a benchmark: ask for it with --benchmark-enable")


def test_a_camera_of_3000_frames_is_aligned(benchmark):
    motion = record_motion(1, frames=3000, frame_rate_hz=4000.0)
    fit = benchmark(
        align_motion,
        motion.camera_times_s,
        motion.displacement_m,
        motion.start_s,
        motion.step_s,
        motion.acceleration_m_s2,
        acceleration_sigma_m_s2=motion.acceleration_sigma_m_s2,
        drift_allowance=5e-5,
    )
    assert isinstance(fit, MotionFit)
    assert abs(fit.offset_s - motion.offset_s) < 3e-5
    assert fit.u_offset_s < 1e-5


def test_eight_channels_of_a_million_samples_are_filtered(benchmark):
    rate_hz, frequency_hz = 50_000.0, 50.0
    phase = 2 * np.pi * frequency_hz / rate_hz * np.arange(1_000_000)
    table = np.sin(phase)[:, None] * np.arange(1.0, 9.0)
    low_pass = LowPass(500.0)
    filtered = benchmark(low_pass.apply, table, rate_hz)
    gain = float(low_pass.gain(np.array([frequency_hz]))[0])
    assert np.allclose(filtered[1000:-1000], gain * table[1000:-1000], rtol=0, atol=1e-4)
