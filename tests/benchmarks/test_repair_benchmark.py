"""What repairs are worth, beside what is usual: clipped ringing, clipped impacts, hum."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from recoil_processing.filters import LowPass
from recoil_processing.repairs import clipping
from recoil_processing.repairs.autoregressive import interpolate_unknown
from recoil_processing.repairs.clipping import find_clipped, repair_clipping
from recoil_processing.repairs.hum import subtract_hum
from tests.builders.faulty_records import FULL_SCALE_G, twin_record
from tests.builders.ringing import MASS_KG, PULSE_M_S2, RATE_HZ, RingingRecord, ringing_record
from tests.builders.shared_data import shared_file

SEEDS = range(100, 112)
LOW_PASS = LowPass(450.0)


def _as_recorded(samples: np.ndarray, limit: float) -> np.ndarray:
    assert np.abs(samples).max() <= 1.001 * limit
    return samples


def _spline(samples: np.ndarray, limit: float) -> np.ndarray:
    from scipy.interpolate import CubicSpline

    flags = find_clipped(samples, -limit, limit).flags
    at = np.flatnonzero(~flags)
    return np.where(flags, CubicSpline(at, samples[at])(np.arange(samples.size)), samples)


def _ruled(samples: np.ndarray, limit: float) -> np.ndarray:
    return repair_clipping(samples, -limit, limit).samples


def _everywhere(samples: np.ndarray, limit: float) -> np.ndarray:
    """Interpolate every run, whatever the rule says of it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(clipping, "LONGEST_SHARE", 10.0)
        patch.setattr(clipping, "LARGEST_PEAK", 10.0)
        return repair_clipping(samples, -limit, limit).samples


METHODS: dict[str, Callable[[np.ndarray, float], np.ndarray]] = {
    "none": _as_recorded,
    "cubic spline": _spline,
    "AR everywhere": _everywhere,
    "AR and mask": _ruled,
}


def _mass_and_peak(record: RingingRecord, samples: np.ndarray) -> tuple[float, float, float]:
    """Bias of the mass and error of the low-passed peak in percent, and the share of the pulse that was left out."""
    a, trusted = LOW_PASS.apply_with_gaps(samples, RATE_HZ)
    force = LOW_PASS.apply(record.force_n, RATE_HZ)
    used = trusted & (record.times_s >= -5e-3) & (record.times_s <= 0.12)
    mass = float(force[used] @ a[used] / (a[used] @ a[used]))
    pulse = (record.times_s >= 0) & (record.times_s < 0.02)
    peak = a.max() / record.truth_m_s2.max() - 1 if np.isfinite(samples).all() else np.nan
    return 100 * (mass / MASS_KG - 1), 100 * peak, 100 * float(np.mean(~trusted[pulse]))


def test_clipped_ringing(benchmark, capsys):
    records = [ringing_record(seed) for seed in SEEDS]
    results: dict[tuple[float, str], np.ndarray] = {}
    lines = []
    for level in (2.0, 1.5, 1.2):
        limit = level * PULSE_M_S2
        clipped = [np.clip(r.recorded_m_s2, -limit, limit) for r in records]
        share = np.mean([find_clipped(c, -limit, limit).flags[2000:3000].mean() for c in clipped])
        lines.append(f"clipped at {level:g} x pulse: {100 * share:.1f} % of the first 20 ms")
        for name, method in METHODS.items():
            rows = [_mass_and_peak(r, method(c, limit)) for r, c in zip(records, clipped, strict=True)]
            results[level, name] = np.array(rows)
            mass, peak, left_out = np.array(rows).T
            whole = np.isfinite(peak).all()
            lines.append(
                f"  {name:14s} mass {mass.mean():+6.2f} % ({mass.min():+.2f}..{mass.max():+.2f})  "
                + (f"peak {peak.mean():+6.2f} %" if whole else f"peak not claimed, {left_out.mean():.0f} % left out")
            )
    limit = 1.5 * PULSE_M_S2
    benchmark(_ruled, np.clip(records[0].recorded_m_s2, -limit, limit), limit)
    with capsys.disabled():
        print("\n" + "\n".join(lines))
    assert abs(results[1.5, "AR everywhere"][:, 0].mean()) < 0.9
    assert abs(results[1.5, "AR everywhere"][:, 1].mean()) < 0.6
    assert abs(results[1.5, "AR and mask"][:, 0].mean()) < 0.1
    assert results[1.5, "none"][:, 0].mean() > 2.0


def test_clipped_impacts(benchmark, capsys):
    lines, found = [], []
    for name in ("4mps_sphere_1_event", "6mps_150degcone_1_event"):
        twin = twin_record(shared_file(f"shock/{name}.npz"))
        for label, clipped, limit in (
            ("as recorded", twin.clipped_g, FULL_SCALE_G),
            ("its twin, clipped at 2/3", np.minimum(twin.truth_g, twin.truth_g.max() / 1.5), twin.truth_g.max() / 1.5),
        ):
            (run,) = repair_clipping(clipped, -limit, limit).runs
            errors = {n: 100 * twin.impulse_error(method(clipped, limit)) for n, method in METHODS.items()}
            told = "  ".join(f"{n} {e:+.1f} %" for n, e in errors.items() if np.isfinite(e))
            lines.append(f"{name}, {label}: {run.count} samples; {told}; {run.refusal or 'repaired'}")
            found.append((bool(run.refusal), errors["AR and mask"]))
    benchmark(_ruled, twin.clipped_g, FULL_SCALE_G)
    with capsys.disabled():
        print("\n" + "\n".join(lines))
    assert [refused for refused, _ in found] == [False, True, False, True]
    assert all(abs(error) < 1.0 for refused, error in found if not refused)


def test_hum(benchmark, capsys):
    rate_hz, lines, ratios = 10_000.0, [], []
    for quiet_s in (0.04, 0.1, 0.25):
        left = []
        for seed in range(40):
            rng = np.random.default_rng(seed)
            t = np.arange(round((quiet_s + 0.3) * rate_hz)) / rate_hz
            line = np.cos(2 * np.pi * rng.normal(50.0, 0.05) * t + rng.uniform(0.0, 6.28))
            samples = line + 0.3 * rng.standard_normal(t.size)
            hum = subtract_hum(samples, rate_hz, t < quiet_s)
            behind = t >= quiet_s
            left.append([np.mean((line - samples + hum.samples)[behind] ** 2), np.mean(hum.u[behind] ** 2)])
        share, told = np.sqrt(2 * np.mean(left, axis=0))
        ratios.append(share)
        percent = f"{100 * share:.1f} % left in the 300 ms behind it, told {100 * told:.1f} %"
        lines.append(f"  {1e3 * quiet_s:.0f} ms of silence: {percent}")
    benchmark(subtract_hum, samples, rate_hz, t < 0.25)
    with capsys.disabled():
        print("\nhum of 50 Hz in noise of 0.3 of it, off the nominal frequency by 0.05 Hz (sd)\n" + "\n".join(lines))
    assert ratios[2] < ratios[1] < ratios[0] < 0.5


def test_a_lone_pulse_must_not_get_the_order_of_ringing(capsys):
    twin = twin_record(shared_file("shock/4mps_sphere_1_event.npz"))
    flags = find_clipped(twin.clipped_g, -FULL_SCALE_G, FULL_SCALE_G).flags
    peak = int(np.argmax(twin.clipped_g))
    piece = slice(peak - 160, peak + 170)
    lowest = np.where(flags, twin.clipped_g, -np.inf)[piece]
    errors = {}
    for order in (4, 8, 16, 48):
        found = interpolate_unknown(twin.clipped_g[piece], flags[piece], lowest=lowest, most_order=order)
        assert not isinstance(found, str)
        samples = twin.clipped_g.copy()
        samples[piece] = found.samples
        errors[order] = 100 * twin.impulse_error(samples)
    with capsys.disabled():
        print("\nimpulse of a clipped impact by order: " + ", ".join(f"{k}: {e:+.1f} %" for k, e in errors.items()))
    assert abs(errors[4]) < 1.0 < abs(errors[48])
