"""Channel frequency classes of SAE J211-1 and ISO 6487: the low-pass that crash and impact reports agree on.

One pass is a two-pole Butterworth low-pass whose corner lies at 2.0775 times the class; it is run forward
and backward. Both standards print the filter as a difference equation with its own start; this is that
equation, not a filter of similar gain.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_processing.arguments import require_positive
from recoil_processing.filters.two_pass import TwoPass
from recoil_processing.filters.zero_phase_filter import FilterDescription, apply_bridged, check_shape

CORNER = 2.0775
"""Corner of one pass over the class: the -6 dB point of both."""
LEAST_RATE = 10.0
"""Samples per second over the class, below which SAE J211-1 allows no such filter."""
PADDING_S = 0.01
LEAST_PADDING = 100
"""Samples over which a record is continued at least, however few 10 ms are."""
LEAST_SAMPLES = 10
"""Samples of a record: the standards' start takes their mean."""
_TIME_CONSTANTS = 4.0
"""Time constants after which under 1 % of a step is left of both passes, each of a damping of ``1/sqrt(2)``."""


@dataclass(frozen=True)
class ChannelFrequencyClass:
    """A channel frequency class.

    The nominal -3 dB point is ``1.65 CFC``; that of the equation is ``1.6667 CFC`` at high rates and moves up
    towards the Nyquist frequency, where the bilinear transform compresses frequencies about the corner, which
    stays: by 0.05 % at 100 times the class, 0.2 % at 50 times, 5 % at the least rate of 10 times.

    Attributes
    ----------
    number
        60, 180, 600 and 1000 are the standards'; any other is filtered alike.

    Raises
    ------
    ValueError
        If the number is not positive and finite.
    """

    number: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.number) and self.number > 0):
            raise ValueError(f"a channel frequency class must be positive, not {self.number}")

    @property
    def design_hz(self) -> float:
        """Corner of one pass and -6 dB point of both, at any sampling rate."""
        return CORNER * self.number

    def cutoff_hz(self, rate_hz: float | None = None) -> float:
        """-3 dB point of both passes, at a sampling rate or in the limit of high rates.

        Two passes have the amplitude ``1 / (1 + r^4)`` with r the ratio of the warped frequencies, which is
        ``1/sqrt(2)`` where ``r^4 = sqrt(2) - 1``.

        Raises
        ------
        ValueError
            If the rate is too low for the class.
        """
        ratio = math.sqrt(math.sqrt(math.sqrt(2.0) - 1.0))
        if rate_hz is None:
            return ratio * self.design_hz
        return rate_hz / math.pi * math.atan(ratio * self._warped(rate_hz))

    def _warped(self, rate_hz: float) -> float:
        """Corner as the bilinear transform sees it, w_a of the standards."""
        require_positive(rate_hz=rate_hz)
        if rate_hz < LEAST_RATE * self.number:
            raise ValueError(
                f"channel frequency class {self.number:g} needs at least {LEAST_RATE * self.number:g} samples/s, "
                f"not {rate_hz:g}: SAE J211-1 asks for ten times the class, below which the filter's pass band shifts"
            )
        return math.tan(math.pi * self.design_hz / rate_hz)

    def reach_samples(self, rate_hz: float) -> int:
        """Return the number of samples over which one spreads to either side.

        Beyond, under 1 % is left of a disturbance that lasts.
        Four time constants of the poles, which both have one magnitude.
        """
        pole = self._warped(rate_hz) * complex(-math.sqrt(0.5), math.sqrt(0.5))
        return math.ceil(_TIME_CONSTANTS / -math.log(abs((1 + pole) / (1 - pole))))

    def gain(self, frequency_hz: Array, rate_hz: float | None = None) -> Array:
        """Amplitude of both passes, any shape: in the limit of high rates, or of the filter sampled at a rate."""
        if rate_hz is None:
            ratio = frequency_hz / self.design_hz
        else:
            ratio = np.tan(np.pi * frequency_hz / rate_hz) / self._warped(rate_hz)
        return np.asarray(1.0 / (1.0 + ratio**4))

    def two_pass(self, rate_hz: float) -> TwoPass:
        """Return the standards' difference equation, see `recoil_processing.filters.two_pass.TwoPass`.

        ``y[k] = a0 x[k] + a1 x[k-1] + a2 x[k-2] + b1 y[k-1] + b2 y[k-2]`` with ``wa = tan(pi 2.0775 CFC / rate)``,
        ``a0 = a2 = a1 / 2 = wa^2 / d``, ``b1 = -2 (wa^2 - 1) / d``, ``b2 = (-1 + sqrt(2) wa - wa^2) / d``,
        ``d = 1 + sqrt(2) wa + wa^2`` (SAE J211-1, appendix C; ISO 6487, annex A). The record is continued by
        odd reflection over 10 ms, 100 samples at least; the first two outputs of each pass are the mean of
        its first ten inputs.

        Raises
        ------
        ValueError
            If the rate is below ten times the class.
        """
        wa = self._warped(rate_hz)
        d = 1.0 + math.sqrt(2.0) * wa + wa**2
        a0 = wa**2 / d
        b1 = -2.0 * (wa**2 - 1.0) / d
        b2 = (-1.0 + math.sqrt(2.0) * wa - wa**2) / d
        sections = np.array([[a0, 2.0 * a0, a0, 1.0, -b1, -b2]])
        return TwoPass(sections, self._padding_samples(rate_hz), "mean of ten")

    def apply(self, samples: Array, rate_hz: float) -> Array:
        """Filter samples along their first axis.

        See `recoil_processing.filters.zero_phase_filter.ZeroPhaseFilter.apply`.

        Raises
        ------
        ValueError
            If the rate is below ten times the class, there are fewer than ten samples, or one is not finite.
        """
        check_shape(samples)
        return self.two_pass(rate_hz).run(samples)

    def apply_with_gaps(self, samples: Array, rate_hz: float) -> tuple[Array, Flags]:
        """Filter samples some of which are missing, see `recoil_processing.filters.zero_phase_filter.apply_bridged`."""
        return apply_bridged(self, samples, rate_hz)

    def describe(self, rate_hz: float | None = None) -> FilterDescription:
        """Say what the filter is, see `recoil_processing.filters.zero_phase_filter.FilterDescription`."""
        return FilterDescription(
            "channel frequency class",
            2,
            2,
            self.cutoff_hz(rate_hz),
            self.design_hz,
            "odd",
            PADDING_S if rate_hz is None else self._padding_samples(rate_hz) / rate_hz,
            rate_hz,
            {"class": self.number},
        )

    @staticmethod
    def _padding_samples(rate_hz: float) -> int:
        return max(LEAST_PADDING, math.ceil(PADDING_S * rate_hz))
