"""Wiener's filter: each frequency by the share of it that is signal.

Of all linear filters it leaves the least mean square error, if both spectra are right (N. Wiener,
Extrapolation, Interpolation and Smoothing of Stationary Time Series, 1949). Its amplitude is
``S / (S + N)``, real and therefore without phase.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from recoil_processing.filters.zero_phase_filter import (
    HALF_AMPLITUDE,
    HALF_POWER,
    FilterDescription,
    apply_bridged,
    check_finite,
    check_rate,
    check_shape,
)

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Density = Callable[[Array], Array]

RESPONSE_SAMPLES = 1 << 17
"""Length of the impulse response that is looked at: at 50 kHz, spectra finer than 0.4 Hz are not seen."""
LEFT_OVER = 0.01
"""Of a disturbance that lasts, beyond the filter's reach."""
PADDED_OVER = 1e-12
"""Of a disturbance that lasts, beyond the padding: the transform closes the record to a ring there."""


@dataclass(frozen=True, eq=False)
class WienerFilter:
    """A zero-phase filter whose amplitude is the signal's share of the power density at each frequency.

    One value filters every channel of a regression, as any filter here; which channel's spectra it was
    made from makes no difference to that. Unlike the other filters its amplitude at zero frequency is not
    1 but that of the spectra there.

    Attributes
    ----------
    signal, noise : callable
        One-sided power densities over frequency in hertz, of arrays of any shape; in one and the same unit.
        `from_spectra` makes a filter from arrays.
    """

    signal: Density
    noise: Density

    @classmethod
    def from_spectra(cls, frequency_hz: Array, signal: Array, noise: Array) -> WienerFilter:
        """Make a filter from densities at given frequencies.

        Parameters
        ----------
        frequency_hz : ndarray, shape (n,)
            Increasing, from 0 or above. Between them densities are straight lines, beyond them those of the
            first and the last.
        signal, noise : ndarray, shape (n,)

        Returns
        -------
        WienerFilter

        Raises
        ------
        ValueError
            If frequencies do not increase or are negative, a density is negative or not finite, or the shapes
            differ.
        """
        frequency, *densities = (np.array(a, dtype=np.float64) for a in (frequency_hz, signal, noise))
        if frequency.ndim != 1 or frequency.size == 0 or any(d.shape != frequency.shape for d in densities):
            raise ValueError(
                f"frequencies and densities must be of one shape (n,), not {frequency.shape}, "
                + " and ".join(str(d.shape) for d in densities)
            )
        if not (np.all(np.isfinite(frequency)) and frequency[0] >= 0 and np.all(np.diff(frequency) > 0)):
            raise ValueError("frequency_hz must increase, from 0 or above")
        for name, density in zip(("signal", "noise"), densities, strict=True):
            if not np.all(np.isfinite(density) & (density >= 0)):
                raise ValueError(f"{name} density must be finite and not negative")
        first, second = densities
        return cls(lambda f: np.interp(f, frequency, first), lambda f: np.interp(f, frequency, second))

    def gain(self, frequency_hz: Array, rate_hz: float | None = None) -> Array:
        """Amplitude ``S / (S + N)``, any shape, the same at every rate; 0 where both are 0.

        Raises
        ------
        ValueError
            If a density is negative, infinite or NaN.
        """
        del rate_hz
        frequency = np.abs(np.asarray(frequency_hz, dtype=np.float64))
        signal, noise = (np.asarray(density(frequency), dtype=np.float64) for density in (self.signal, self.noise))
        if not np.all(np.isfinite(signal) & np.isfinite(noise) & (signal >= 0) & (noise >= 0)):
            raise ValueError("densities of signal and noise must be finite and not negative at every frequency")
        total = signal + noise
        return np.divide(signal, total, out=np.zeros_like(total), where=total > 0)

    def apply(self, samples: Array, rate_hz: float) -> Array:
        """Filter samples along their first axis, see `filters.zero_phase_filter.ZeroPhaseFilter.apply`.

        By fast Fourier transform of the whole record, continued by odd reflection until the filter's response
        has died away, over the whole record where that is shorter, and over 32,768 samples at most.

        Raises
        ------
        ValueError
            If a density or a sample is not finite, or a density is negative.
        """
        check_rate(rate_hz)
        check_shape(samples)
        check_finite(samples)
        if samples.size == 0:
            return np.array(samples, dtype=np.float64)
        from scipy.fft import irfft, next_fast_len, rfft

        padding = self._padding_samples(rate_hz)
        count = samples.shape[0]
        length = min(padding, count - 1)
        total = next_fast_len(count + 2 * length, real=True)
        amplitude = self.gain(np.linspace(0.0, rate_hz * (total // 2) / total, total // 2 + 1))
        filtered = np.empty(samples.shape)
        columns, targets = (samples.T, filtered.T) if samples.ndim == 2 else ([samples], [filtered])
        for column, target in zip(columns, targets, strict=True):
            padded = np.pad(column.astype(np.float64), length, mode="reflect", reflect_type="odd")
            # the record's end must not be taken for what comes before its beginning
            spare = total - padded.size
            padded = np.concatenate([padded, np.linspace(padded[-1], padded[0], spare)])
            target[...] = irfft(rfft(padded) * amplitude, n=total)[length : length + count]
        return filtered

    def apply_with_gaps(self, samples: Array, rate_hz: float) -> tuple[Array, Flags]:
        """Filter samples some of which are missing, see `recoil_processing.filters.zero_phase_filter.apply_bridged`."""
        return apply_bridged(self, samples, rate_hz)

    def reach_samples(self, rate_hz: float) -> int:
        """How far a sample spreads to either side: beyond, under 1 % is left of a disturbance that lasts.

        From the impulse response over `RESPONSE_SAMPLES`; half of these where it does not die away.
        """
        beyond = _beyond(self, rate_hz)
        return int(np.argmax(beyond < LEFT_OVER)) if beyond[-1] < LEFT_OVER else beyond.size

    def memory_samples(self, rate_hz: float, tolerance: float) -> int:
        """Return how far a sample has an influence above a tolerance, see `recoil_processing.filters.filter_blocks`.

        Raises
        ------
        ValueError
            If the response does not die away so far: the spectra have steps or corners.
        """
        beyond = _beyond(self, rate_hz)
        # in the later half the response of the other side begins to be seen
        if not beyond[beyond.size // 2] < tolerance:
            raise ValueError(
                f"the Wiener filter's response does not die away to {tolerance:g} within {beyond.size // 2} samples: "
                "its spectra have steps or corners; filter the record as a whole, not in blocks"
            )
        return int(np.argmax(beyond < tolerance))

    def describe(self, rate_hz: float | None = None) -> FilterDescription:
        """Say what the filter is; its -3 and -6 dB points are below half the rate, or below 1 MHz without one."""
        top_hz = 1e6 if rate_hz is None else rate_hz / 2
        padding_s = 0.0 if rate_hz is None else self._padding_samples(rate_hz) / rate_hz
        return FilterDescription(
            "wiener",
            None,
            1,
            self._first_below(HALF_POWER, top_hz),
            self._first_below(HALF_AMPLITUDE, top_hz),
            "odd",
            padding_s,
            rate_hz,
            {"gain_at_0_hz": float(self.gain(np.zeros(1))[0])},
        )

    def _padding_samples(self, rate_hz: float) -> int:
        beyond = _beyond(self, rate_hz)
        least = beyond.size // 2
        return int(np.argmax(beyond < PADDED_OVER)) if beyond[least] < PADDED_OVER else least

    def _first_below(self, amplitude: float, top_hz: float) -> float | None:
        """Return the lowest frequency at which the gain falls to an amplitude, to 1e-12, of 200,001 looked at."""
        frequency = np.concatenate([[0.0], np.geomspace(1e-7 * top_hz, top_hz, 200_001)])
        low = self.gain(frequency) <= amplitude
        first = int(np.argmax(low))
        if not low[first]:
            return None
        if first == 0:
            return 0.0
        a, b = frequency[first - 1], frequency[first]
        for _ in range(40):
            middle = 0.5 * (a + b)
            a, b = (a, middle) if self.gain(np.asarray(middle)) <= amplitude else (middle, b)
        return float(0.5 * (a + b))


@lru_cache(maxsize=4)
def _beyond(wiener: WienerFilter, rate_hz: float) -> Array:
    """Sum of the magnitudes of the impulse response beyond each lag on one side, shape (RESPONSE_SAMPLES / 2,)."""
    from scipy.fft import irfft

    check_rate(rate_hz)
    gain = wiener.gain(np.linspace(0.0, rate_hz / 2, RESPONSE_SAMPLES // 2 + 1))
    response = np.abs(irfft(gain, n=RESPONSE_SAMPLES)[: RESPONSE_SAMPLES // 2 + 1])
    # rounding of the transform is no response
    response[response < 1e-15 * response.max(initial=0.0)] = 0.0
    beyond = np.cumsum(response[:0:-1])[::-1].copy()
    beyond.flags.writeable = False
    return beyond
