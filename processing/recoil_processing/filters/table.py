"""The table of low-passes by which an identification can be asked to filter, by name.

Other packages announce theirs by entry points, under the name by which it is asked for; each leads to a `LowPassFilter`
of any cut-off, or to a class that is called without arguments::

    [project.entry-points."recoil_daq.filters"]
    gaussian = "recoil_gaussian:Gaussian"
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_acquisition.packages.others import announced, at_work, named
from recoil_processing.filters.butterworth import LowPass
from recoil_processing.filters.zero_phase_filter import FilterDescription, LowPassFilter

GROUP = "recoil_daq.filters"
"""Entry points by which other packages announce their filters."""

USUAL = "butterworth"

FILTERS: Mapping[str, LowPassFilter] = MappingProxyType({USUAL: LowPass(1.0)})
"""Name on the command line -> filter, whose cut-off is replaced."""

_MEMBERS = sorted({name for one in LowPassFilter.__mro__ for name in vars(one) if not name.startswith("_")})

_TRIED_HZ, _TRIED_RATE_HZ, _TRIED_SAMPLES = 100.0, 10_000.0, 2001
_TRIED_TO = 1e-6
_GAIN_TO = 5e-3


def filter_names() -> tuple[str, ...]:
    """Return the names of all filters: those of the table, and those that other packages announce under `GROUP`."""
    return tuple(dict.fromkeys((*FILTERS, *(point.name for point in announced(GROUP)))))


def filter_of(name: str) -> LowPassFilter:
    """Return the filter of a name, of some cut-off.

    Raises
    ------
    ValueError
        If there is none of that name.
    IdentificationError
        If it is of another package, which cannot be loaded, or it is no linear low-pass without phase.
    """
    if name in FILTERS:
        return FILTERS[name]
    if name not in filter_names():
        raise ValueError(f"filter must be one of {', '.join(filter_names())}, not {name!r}")
    found = OthersFilter(name, named(GROUP, name))
    with found.at_work():
        if lacking := [name for name in _MEMBERS if not hasattr(found.own, name)]:
            raise TypeError(f"{type(found.own).__name__} has no {', '.join(lacking)}: see LowPassFilter")
        require_low_pass(found)
    return found


@dataclass(frozen=True)
class OthersFilter:
    """A filter of another package, whose mistakes are its own: an error in one line that names it."""

    name: str
    own: LowPassFilter

    def at_work(self) -> AbstractContextManager[None]:
        """Let it do its work."""
        return at_work(f"the filter {self.name!r} of another package")

    @property
    def cutoff_hz(self) -> float:
        """Frequency at which its amplitude is ``1/sqrt(2)``."""
        with self.at_work():
            return float(self.own.cutoff_hz)

    @property
    def reach_s(self) -> float:
        """Time over which a sample spreads to either side, s."""
        with self.at_work():
            return float(self.own.reach_s)

    def at(self, cutoff_hz: float) -> OthersFilter:
        """Return one of its kind with another cut-off."""
        with self.at_work():
            return OthersFilter(self.name, self.own.at(cutoff_hz))

    def apply(self, samples: Array, rate_hz: float) -> Array:
        """Filter samples along their first axis; those that it is given are its own to write over."""
        with self.at_work():
            filtered = _of_shape(self.own.apply(samples.copy(), rate_hz), samples.shape)
            if not np.isfinite(filtered).all():
                raise ValueError("of finite samples it returns some that are not")
            return filtered

    def apply_with_gaps(self, samples: Array, rate_hz: float) -> tuple[Array, Flags]:
        """Filter one channel with missing samples, and say which results depend on them."""
        with self.at_work():
            filtered, trusted = self.own.apply_with_gaps(samples.copy(), rate_hz)
            kept = np.array(trusted, dtype=np.bool_)
            if kept.shape != samples.shape or not np.isfinite(filtered[kept]).all():
                raise ValueError("its flags are none of the samples', or trust some that are no numbers")
            return _of_shape(filtered, samples.shape), kept

    def gain(self, frequency_hz: Array, rate_hz: float | None = None) -> Array:
        """Amplitude of all passes together, any shape."""
        with self.at_work():
            return _of_shape(self.own.gain(frequency_hz, rate_hz), np.shape(frequency_hz))

    def reach_samples(self, rate_hz: float) -> int:
        """Return the number of samples over which one spreads to either side."""
        with self.at_work():
            return int(self.own.reach_samples(rate_hz))

    def describe(self, rate_hz: float | None = None) -> FilterDescription:
        """Say what the filter is."""
        with self.at_work():
            return self.own.describe(rate_hz)


def _of_shape(values: Array, shape: tuple[int, ...]) -> Array:
    """Return float64 values of their own; ValueError if they are of another shape."""
    found = np.array(values, dtype=np.float64)
    if found.shape != shape:
        raise ValueError(f"of values of the shape {shape} it returns some of {found.shape}")
    return found


def require_low_pass(kind: LowPassFilter) -> None:
    """Try a filter on a pulse.

    Raises
    ------
    ValueError
        If it is no value, is not linear, delays, is not of unit gain at 0 Hz, or does not let through what its `gain`
        says, ``1/sqrt(2)`` at its cut-off.
    """
    tried, again = kind.at(_TRIED_HZ), kind.at(_TRIED_HZ)
    if tried.cutoff_hz != _TRIED_HZ or tried != again or hash(tried) != hash(again) or tried == kind.at(2 * _TRIED_HZ):
        raise ValueError("at(cutoff_hz) gives none of that cut-off, or two that are not equal")
    pulse = np.zeros(_TRIED_SAMPLES)
    pulse[_TRIED_SAMPLES // 2] = 1.0
    out, trusted = tried.apply_with_gaps(pulse, _TRIED_RATE_HZ)
    both = tried.apply(np.column_stack([pulse, 2.0 * pulse]), _TRIED_RATE_HZ)
    if not trusted.all():
        raise ValueError("it does not trust what depends on no missing sample")
    if not np.allclose(both, np.column_stack([out, 2.0 * out]), rtol=0.0, atol=_TRIED_TO):
        raise ValueError("it filters one channel otherwise than two, or twice the samples not to twice as much")
    if not np.allclose(out, out[::-1], rtol=0.0, atol=_TRIED_TO):
        raise ValueError("it is not without phase: of a pulse it makes no symmetric one")
    hz = np.array([0.0, 0.5, 1.0, 2.0]) * _TRIED_HZ
    passed = np.abs(np.exp(-2j * np.pi * np.outer(hz, np.arange(pulse.size)) / _TRIED_RATE_HZ) @ out)
    stated = tried.gain(hz, _TRIED_RATE_HZ)
    if not (np.allclose(passed, stated, atol=_GAIN_TO) and np.allclose(stated[[0, 2]], [1, 0.5**0.5], atol=_GAIN_TO)):
        raise ValueError(
            f"at 0, 1/2, 1 and 2 times its cut-off it lets through {np.round(passed, 4)}, its gain says "
            f"{np.round(stated, 4)}, and at 0 and 1 it must be 1 and 0.7071"
        )
    if not (tried.reach_samples(_TRIED_RATE_HZ) > 0 and tried.reach_s > 0.0):
        raise ValueError("it reaches over no time")
    tried.describe(_TRIED_RATE_HZ).to_json()
