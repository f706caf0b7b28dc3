"""How long filtering and aligning take on a laptop, and how well clocks are aligned beside other methods.

Each timing checks its answer. The accuracy is that on two hundred shots of the virtual rig, which moves by
the three-body model and not by the estimator's own.
"""

from __future__ import annotations

import numpy as np
import pytest

from recoil_processing.alignment.motion_alignment import MotionFit, align_motion
from recoil_processing.alignment.velocity_lag import camera_velocity, span_frames
from recoil_processing.double_integral import DoubleIntegral
from recoil_processing.filters import LowPass
from tests.builders.motions import record_motion
from tests.builders.tracked_shots import TrackedShot, track_shot

SHOTS = range(1001, 1201)
TRACKED = range(2001, 2201)
"""Other shots, for the share of false alarms."""
TRACKS = 2
"""Of each of these."""
FAULTY = TRACKED[::4]
"""Shots of which camera tracks lose a picture, or write one twice."""
LONGEST_LAG_S = 0.02
"""Over which the picks' correction looks around the picks."""


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


def velocities(shot: TrackedShot) -> tuple[np.ndarray, np.ndarray, float, float, float]:
    """Velocities of both records on grids of the frames' period: source, reference, both begins, period."""
    seen = np.isfinite(shot.displacement_m)
    track = np.interp(shot.camera_times_s, shot.camera_times_s[seen], shot.displacement_m[seen])
    times, source = camera_velocity(shot.camera_times_s, track)
    period = float(np.median(np.diff(shot.camera_times_s)))
    integral = DoubleIntegral.of(shot.acceleration_m_s2, shot.start_s, shot.step_s)
    half = 0.5 * period * span_frames(shot.camera_times_s)
    end_s = shot.start_s + shot.step_s * (shot.acceleration_m_s2.size - 1)
    grid = np.arange(shot.start_s + half, end_s - half, period)
    reference = (integral.at(grid + half)[0] - integral.at(grid - half)[0]) / (2 * half)
    return source, reference, float(times[0]), float(grid[0]), period


def by_whole_frames(shot: TrackedShot) -> float:
    """Offset of the highest correlation of the velocities, a whole number of frames."""
    source, reference, source_zero, reference_zero, period = velocities(shot)
    lag = int(np.argmax(np.correlate(reference, source, mode="full"))) - (source.size - 1)
    return reference_zero + lag * period - source_zero


def by_obspy(shot: TrackedShot) -> float:
    """Offset by the picks' correction of seismology: a parabola through the correlation's peak.

    It is given accelerations over spans: the velocities' correlation is a single arch wider than the lags.
    """
    from obspy import Trace, UTCDateTime
    from obspy.signal.cross_correlation import xcorr_pick_correction

    source, reference, source_zero, reference_zero, period = velocities(shot)
    picks, traces = [], []
    for speed, zero in ((reference, reference_zero), (source, source_zero)):
        times, signal = camera_velocity(zero + period * np.arange(speed.size), speed)
        traces.append(Trace(signal, {"sampling_rate": 1.0 / period, "starttime": UTCDateTime(float(times[0]))}))
        picks.append(float(times[int(np.argmax(signal > 0.5 * signal.max()))]))
    correction, _ = xcorr_pick_correction(
        UTCDateTime(picks[0]), traces[0], UTCDateTime(picks[1]), traces[1], 0.005, 0.15, LONGEST_LAG_S
    )
    return picks[0] - (picks[1] + correction)


def spread(errors_s: list[float]) -> str:
    us = 1e6 * np.array(errors_s)
    return f"{np.median(np.abs(us)):9.2f} {np.sqrt(np.mean(us**2)):9.2f} {us.mean():+9.2f}"


@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # obspy 1.4 asks for its plug-ins as Python 3.9 did
def test_two_hundred_shots_are_aligned_within_what_is_stated(benchmark, capsys):
    """Median error, its ratio to the stated uncertainty, coverage, and other methods on the same shots."""
    shots = [track_shot(seed) for seed in SHOTS]
    fits = benchmark.pedantic(lambda: [shot.align() for shot in shots], rounds=1, warmup_rounds=0)
    table: dict[str, list[float]] = {"likelihood (this)": [], "velocities alone (this)": [], "whole frames": []}
    try:
        import obspy  # noqa: F401  # whether it is there is all that is asked

        table["obspy pick correction"] = []
    except ImportError:
        with capsys.disabled():
            print("\nobspy is not installed: its line is left out")
    pulls, status = [], []
    for shot, fit in zip(shots, fits, strict=True):
        assert isinstance(fit, MotionFit), fit
        table["likelihood (this)"].append(shot.error_s(fit.offset_s, fit.drift))
        table["velocities alone (this)"].append(shot.error_s(fit.velocity_offset_s, fit.drift))
        table["whole frames"].append(shot.error_s(by_whole_frames(shot)))
        if "obspy pick correction" in table:
            table["obspy pick correction"].append(shot.error_s(by_obspy(shot)))
        pulls.append(table["likelihood (this)"][-1] / fit.u_offset_s)
        status.append(shot.judge(fit).status)
    ok, covered, ratio = status.count("ok"), np.mean(np.abs(pulls) < 1.96), np.sqrt(np.mean(np.square(pulls)))
    stated = np.median([fit.u_offset_s for fit in fits if isinstance(fit, MotionFit)])
    with capsys.disabled():
        print(f"\n{len(shots)} shots, {benchmark.stats.stats.min / len(shots):.3f} s each to align, {ok} ok")
        print(f"{'method':24} {'median us':>9} {'RMS us':>9} {'mean us':>9}")
        for method, errors in table.items():
            print(f"{method:24} {spread(errors)}")
        print(
            f"likelihood: median u {1e6 * stated:.2f} us, RMS of error/u {ratio:.3f}, 95 % hold {100 * covered:.1f} %"
        )
    assert np.median(np.abs(table["likelihood (this)"])) < 5e-6
    assert 0.8 < ratio < 1.2
    assert 0.92 <= covered <= 0.98
    assert ok >= 0.97 * len(shots)


def test_missing_and_repeated_pictures_are_found_and_clean_tracks_raise_no_alarm(benchmark, capsys):
    """Faults at any time from the shot to the end of recoil, one per camera track, and clean camera tracks."""

    def run() -> dict[str, list[tuple[float, bool, bool, bool]]]:
        found: dict[str, list[tuple[float, bool, bool, bool]]] = {"clean": [], "missing": [], "twice": []}
        for seed in TRACKED:
            rng = np.random.default_rng(seed)
            for track in range(TRACKS):
                shot = track_shot(seed, track=track)
                fit = shot.align()
                assert isinstance(fit, MotionFit), fit
                found["clean"].append((0.0, bool(fit.frame_faults), True, shot.judge(fit).status == "ok"))
            for name in ("missing", "twice") if seed in FAULTY else ():
                at = shot.frame_at(rng.uniform(0.052, 0.25))
                faulty = shot.without_frame(at) if name == "missing" else shot.with_repeated_frame(at)
                place = at if name == "missing" else at + 1
                seen = np.flatnonzero(np.isfinite(shot.displacement_m))
                steps = np.diff(shot.displacement_m[seen])[np.abs(seen[1:] - at) < 12]
                fit = faulty.align()
                assert isinstance(fit, MotionFit), fit
                right = [f for f in fit.frame_faults if f.missing == (1 if name == "missing" else -1)]
                located = len(right) == len(fit.frame_faults) == 1 and right[0].first <= place <= right[0].last
                sigmas = abs(float(np.median(steps))) / 6e-5
                found[name].append((sigmas, bool(right), located, faulty.judge(fit).status == "ok"))
        return found

    found = benchmark.pedantic(run, rounds=1, warmup_rounds=0)
    with capsys.disabled():
        clean = np.array(found["clean"])
        print(
            f"\nclean tracks: {int(clean[:, 1].sum())} of {len(clean)} with a false alarm, {int(clean[:, 3].sum())} ok"
        )
        for name in ("missing", "twice"):
            rows = np.array(found[name])
            for low, high in ((0.0, 1.0), (1.0, 3.0), (3.0, np.inf)):
                part = rows[(rows[:, 0] >= low) & (rows[:, 0] < high)]
                if len(part):
                    print(
                        f"{name:8} {low:.0f} to {high:.0f} sigma a frame: {len(part):3d} camera tracks, "
                        f"{100 * part[:, 1].mean():5.1f} % found, {100 * part[:, 2].mean():5.1f} % in the stated "
                        f"range, {100 * part[:, 3].mean():5.1f} % ok"
                    )
    assert clean[:, 1].mean() < 0.01
    for name in ("missing", "twice"):
        rows = np.array(found[name])
        fast = rows[rows[:, 0] > 3.0]
        assert fast[:, 1].mean() > 0.97
        assert fast[:, 2].mean() > 0.9
        assert not fast[:, 3].any()
