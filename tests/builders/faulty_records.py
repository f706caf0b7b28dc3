"""Records with known faults: a zero that shifts at the shot, hum, droop, and a clipped sensor beside a sound one."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tests.builders.ringing import BURSTS_S, MASS_KG, PULSE_M_S2, RATE_HZ, modal_acceleration, rigid_body

Array = NDArray[np.float64]

SHIFT_DURATION_S = 0.5
SHIFT_PRE_TRIGGER_S = 0.04


@dataclass(frozen=True, eq=False)
class ShiftedRecord:
    """A recoil whose accelerometer's zero shifts at the shot; times from the shot on."""

    times_s: Array
    truth_m_s2: Array
    shift_m_s2: Array
    recorded_m_s2: Array
    force_n: Array

    @property
    def velocity_m_s(self) -> Array:
        return running_integral(self.truth_m_s2, self.times_s)

    def velocity_error(self, zero_m_s2: Array | float, at_s: float) -> float:
        """Error of the velocity from the shot on, once a zero is taken off, over the peak velocity."""
        since = self.times_s >= 0
        error = running_integral((self.recorded_m_s2 - zero_m_s2 - self.truth_m_s2)[since], self.times_s[since])
        at = int(np.searchsorted(self.times_s[since], at_s))
        return float(abs(error[at]) / np.abs(self.velocity_m_s).max())


def running_integral(samples: Array, times_s: Array) -> Array:
    """Sum up trapezoids from zero."""
    return np.concatenate([[0.0], np.cumsum(0.5 * np.diff(times_s) * (samples[1:] + samples[:-1]))])


def high_passed(samples: Array) -> Array:
    """Pass a record through a zero-phase high-pass of 2 Hz, the usual wrong cure of a zero that shifts."""
    from scipy.signal import butter, sosfiltfilt

    sections = butter(2, 2.0, "highpass", fs=RATE_HZ, output="sos")
    return np.asarray(sosfiltfilt(sections, samples, padlen=samples.size - 1), dtype=np.float64)


def shifted_record(
    seed: int, *, step: float = 0.0, decaying: float = 0.0, time_constant_s: float = 1.0, ringing: float = 2.0
) -> ShiftedRecord:
    """Record a shot of which the zero shifts.

    Parameters
    ----------
    seed : int
    step, decaying : float
        Shares of the pulse's peak.
    time_constant_s : float
    ringing : float
        Peak of the ringing over that of the pulse; white noise is 1 % of it, on the force 0.5 %.
    """
    rng = np.random.default_rng(seed)
    times = np.arange(round(SHIFT_DURATION_S * RATE_HZ)) / RATE_HZ - SHIFT_PRE_TRIGGER_S
    truth = rigid_body(times)
    frequencies = np.sort(np.append(rng.uniform(900.0, 4000.0, 4), 900.0 * rng.uniform(1.0, 1.15)))
    gains = rng.uniform(0.4, 1.0, 5) * rng.choice([-1.0, 1.0], 5)
    instants = np.array(BURSTS_S) + np.array([0.0, 0.3e-3, 0.5e-3, 1e-3]) * rng.uniform(-1.0, 1.0, 4)
    strengths = np.array([1.0, 0.7, 0.5, 0.6]) * rng.uniform(0.7, 1.3, 4)
    knocks = np.column_stack([instants, rng.uniform(0.08e-3, 0.35e-3, 4), strengths])
    waves = modal_acceleration(times, frequencies, rng.uniform(0.006, 0.03, 5), gains, knocks)
    waves *= ringing * PULSE_M_S2 / np.abs(waves).max()
    shift = PULSE_M_S2 * (step + decaying * np.exp(-np.maximum(times, 0.0) / time_constant_s)) * (times >= 0)
    recorded = truth + waves + shift + 0.01 * PULSE_M_S2 * rng.standard_normal(times.size)
    force = MASS_KG * (truth + 0.005 * PULSE_M_S2 * rng.standard_normal(times.size))
    return ShiftedRecord(times, truth, shift, recorded, force)


@dataclass(frozen=True, eq=False)
class TwinRecord:
    """An impact as a 40 g sensor that clips saw it, and what a 100 g sensor beside it saw at the same instants.

    The second one is averaged over the first one's period, delayed and scaled so that both agree where nothing
    clips.
    """

    times_s: Array
    clipped_g: Array
    truth_g: Array

    @property
    def pulse(self) -> NDArray[np.bool_]:
        """From 12 ms before the peak to 30 ms behind it."""
        since = self.times_s - self.times_s[int(np.argmax(self.truth_g))]
        return (since > -0.012) & (since < 0.03)

    def impulse_error(self, samples: Array) -> float:
        """Relative error of the impulse, from either sensor's level before the impact."""
        since = self.times_s - self.times_s[int(np.argmax(self.truth_g))]
        before = (since > -0.1) & (since < -0.03)
        level, truth_level = np.median(samples[before]), np.median(self.truth_g[before])
        return float(np.sum(samples[self.pulse] - level) / np.sum(self.truth_g[self.pulse] - truth_level) - 1.0)


FULL_SCALE_G = 42.0


def twin_record(path: Path) -> TwinRecord:
    """Read an impact and bring its two sensors together."""
    with np.load(path) as file:
        times, clipped = file["t_dc40"], file["dc40_g"][:, 0].astype(np.float64)
        fine_times, fine = file["t_pr100"], file["pr100_g"][:, 0].astype(np.float64)
    averaged = np.convolve(fine, np.full(10, 0.1), "same")
    near = np.abs(times - times[int(np.argmax(clipped))]) < 0.04
    sound = near & (np.abs(clipped) < 0.999 * FULL_SCALE_G)

    def fitted(lag_s: float) -> tuple[float, Array]:
        delayed = np.interp(times - lag_s, fine_times, averaged)
        columns = np.column_stack([delayed, np.ones_like(delayed)])
        scale = np.linalg.lstsq(columns[sound], clipped[sound], rcond=None)[0]
        truth = columns @ scale
        return float(np.sum((truth - clipped)[sound] ** 2)), truth

    _, truth = min((fitted(lag) for lag in np.arange(-2e-3, 2e-3, 1e-5)), key=lambda found: found[0])
    return TwinRecord(times, clipped, truth)
