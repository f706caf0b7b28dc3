"""Force and acceleration behind the low-pass, taken as often as they carry errors of their own.

A model of a filtered record must not be fitted at the recorder's rate: neighbours differ by next to
nothing, the criterion sees what little the filter has left at high frequency, and the gain at zero frequency,
which is one over the mass, is what the fit cares for least. Both sides pass one and the same zero-phase
low-pass and are decimated together, so that the transfer function between them stays what it was.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_processing.filters import ROWS_PER_CUTOFF, LowPassFilter, filter_alike
from recoil_processing.gaps import bridge
from recoil_processing.shot.regression import Regression
from recoil_processing.shot.signals import Signals
from recoil_rigs.tables.force_input import ForceInput


@dataclass(frozen=True, eq=False)
class DecimatedRecord(ReadOnlyArrays):
    """Input and output of a system on an even grid.

    Attributes
    ----------
    times_s : ndarray, shape (n,)
    force_n : ndarray, shape (n,)
        F', the input; NaN where it cannot be trusted.
    acceleration_m_s2 : ndarray, shape (n,)
        a', the output; NaN where it cannot be trusted.
    rows : ndarray of bool, shape (n,)
        Instants of the identification interval that can be trusted, before the friction's reversal reaches them.
    stride
        Samples of the recorder per sample.
    low_pass
        The narrowest that both have passed; None for recorded signals.
    """

    times_s: Array
    force_n: Array
    acceleration_m_s2: Array
    rows: Flags
    step_s: float
    stride: int
    low_pass: LowPassFilter | None

    @property
    def rate_hz(self) -> float:
        """Samples per second."""
        return 1.0 / self.step_s


def decimated(
    regression: Regression, acceleration_m_s2: Array, force_n: Array, *, share: float = 1.0
) -> DecimatedRecord:
    """Take every so many-th sample behind the low-pass, the first of the identification interval among them.

    Parameters
    ----------
    regression
        Regression that gives instants, interval, what can be trusted, and the filter.
    acceleration_m_s2, force_n : ndarray, shape (n,)
        Acceleration and force behind that filter.
    share
        Share of its cut-off, where a further low-pass of the same order narrows the band; none at 1.

    Returns
    -------
    DecimatedRecord
        Every sample, where the signals are as recorded.

    Raises
    ------
    ValueError
        If the share is not above 0 and at most 1, or below 1 for recorded signals.
    """
    low_pass = regression.low_pass
    if not 0.0 < share <= 1.0 or (share < 1.0 and low_pass is None):
        raise ValueError(f"share must be above 0 and at most 1, 1 for recorded signals, found {share}")
    trusted = regression.trusted
    acceleration = np.where(trusted, acceleration_m_s2, np.nan)
    force = np.where(trusted, force_n, np.nan)
    stride = 1
    if low_pass is not None:
        if share < 1.0:
            low_pass = low_pass.at(share * low_pass.cutoff_hz)
            table = filter_alike(low_pass, {"acceleration": acceleration, "force": force}, regression.rate_hz)
            trusted = trusted & table.trusted
            acceleration, force = (np.where(trusted, table[name], np.nan) for name in ("acceleration", "force"))
        stride = max(1, int(regression.rate_hz / (ROWS_PER_CUTOFF * low_pass.cutoff_hz)))
    begin = int(np.argmax(regression.inside)) % stride
    return DecimatedRecord(
        times_s=regression.times_s[begin::stride],
        force_n=force[begin::stride],
        acceleration_m_s2=acceleration[begin::stride],
        rows=(regression.inside & regression.before_the_turn & trusted)[begin::stride],
        step_s=stride * regression.step_s,
        stride=stride,
        low_pass=low_pass,
    )


def force_noise_n(signals: Signals, forces: Sequence[ForceInput], low_pass: LowPassFilter) -> float:
    """Return the standard deviation of the gauges' noise in the force behind a low-pass, from the pre-trigger baseline.

    Parameters
    ----------
    forces
        Measured forces of the rig; of one whose series the shot lacks nothing is known.

    Returns
    -------
    float
        NaN without a baseline.
    """
    begin, end = signals.baseline_s
    net = sum(
        force.sign * force.per_reading * bridge(signals.series[force.name], otherwise=0.0)
        for force in forces
        if force.name in signals.series
    )
    times = signals.times_s
    # the filter carries the pulse into the last period of its cut-off before the onset
    baseline = (times >= begin) & (times < end - 1.0 / low_pass.cutoff_hz)
    if int(baseline.sum()) < 2:
        return float("nan")
    return float(np.std(low_pass.apply(np.asarray(net, dtype=np.float64), signals.rate_hz)[baseline]))
