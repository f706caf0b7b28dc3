"""Stiffness and damping of the supports over time, by limited memory, with an uncertainty that knows the drift.

In a short window the drift of a deflection is nearly a straight line, and so may be the deflection itself, late in
recoil. How much a window suffers is found as for the whole shot: noise and zeros of the sensors are drawn
and added, and every window is fitted again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from recoil_identification.targets.stiffness.carriage_record import CarriageRecord
from recoil_identification.targets.stiffness.restoring_force import RestoringTrace, rows_of, trace_restoring_force
from recoil_identification.targets.stiffness.stiffness_budget import SYMBOLS, SupportEstimates
from recoil_identification.targets.stiffness.support_filter import Band
from recoil_identification.targets.stiffness.supports import PARAMETERS, supports_of
from recoil_rigs.mechanism.model import Mechanism

LARGEST_RELATIVE_U = 0.5
"""Relative standard uncertainty of a parameter; one that is less certain is not identified, and a window gives no
number of it."""


def trace_supports(
    record: CarriageRecord,
    noisy: Sequence[CarriageRecord],
    mechanism: Mechanism,
    found: SupportEstimates,
    window_s: float,
) -> dict[str, RestoringTrace]:
    """Follow each support over time.

    Parameters
    ----------
    noisy
        The same with drawn errors of the sensors added, two or more; see
        `recoil_identification.targets.stiffness.stiffness_budget.noisy_records`.
    found
        Estimates of the whole shot: its bands, and its systematic share of the uncertainty.

    Returns
    -------
    dict of str to RestoringTrace
        Traces by support, all at the same instants.

    Raises
    ------
    ValueError
        With fewer than two noisy records.
    """
    if len(noisy) < 2:
        raise ValueError(f"{len(noisy)} noisy records; expected two or more")
    low_pass_hz = next(iter(found.bands.values())).low_pass_hz
    rows = rows_of(record.times_s, record.interval_s, record.trusted, low_pass_hz)
    band = Band(low_pass_hz, 0.0, 0)
    base = supports_of(record, mechanism)

    def traced(one: CarriageRecord) -> dict[str, RestoringTrace]:
        # where a foot bears is told by the record itself: a window must not differ in its rows
        supports = {n: replace(s, contact=base[n].contact) for n, s in supports_of(one, mechanism).items()}
        return {
            n: trace_restoring_force(s.filtered(band, record.interval_s[0], rows), window_s)
            for n, s in supports.items()
        }

    whole, drawn = traced(record), [traced(one) for one in noisy]
    systematic = np.sqrt(np.maximum(np.diag(found.covariance - found.random), 0.0)) / np.abs(found.values)
    traces = {}
    for name, trace in whole.items():
        apart = np.array([one[name].parameters for one in drawn]) - trace.parameters
        scatter = np.sqrt(np.mean(apart**2, axis=0))
        relative = systematic[[SYMBOLS.index(symbol) for symbol in PARAMETERS[name]]]
        u = np.hypot(np.fmax(trace.u, scatter), relative * np.abs(trace.parameters))
        lost = ~(u <= LARGEST_RELATIVE_U * np.abs(trace.parameters))
        parameters = np.where(lost, np.nan, trace.parameters)
        traces[name] = replace(trace, parameters=parameters, u=np.where(lost, np.nan, u))
    return traces


def noise_shares(
    record: CarriageRecord, noisy: Sequence[CarriageRecord], mechanism: Mechanism, found: SupportEstimates
) -> dict[str, tuple[float, float]]:
    """Return the noise of load and of deflection over their own size, behind the band-pass, by support.

    Parameters
    ----------
    record, noisy, mechanism, found
        Arguments of `trace_supports`.
    """
    supports, others = supports_of(record, mechanism), [supports_of(one, mechanism) for one in noisy]
    shares = {}
    for name, support in supports.items():
        band = found.bands[name]
        rows = rows_of(record.times_s, record.interval_s, record.trusted, band.low_pass_hz)
        plain = support.filtered(band, record.interval_s[0], rows)
        apart = []
        for other in others:
            alike = replace(other[name], contact=support.contact)
            one = alike.filtered(band, record.interval_s[0], rows)
            apart.append((one.load - plain.load, one.columns[:, 0] - plain.columns[:, 0]))
        noise = np.sqrt(np.mean(np.square(apart), axis=(0, 2)))
        size = np.sqrt([np.mean(plain.load**2), np.mean(plain.columns[:, 0] ** 2)])
        shares[name] = (float(noise[0] / size[0]), float(noise[1] / size[1]))
    return shares
