"""One clock for all: the verdict on an alignment, and how it is reported.

The estimators are `processing.motion_alignment`, `processing.redundant_alignment` and
`processing.trigger_alignment`. Here their figures become a `ClockAlignment` with a status:
``ok``, ``ambiguous`` where the data allow doubt, ``failed`` where there is nothing to align by.
"""

from __future__ import annotations

import math

from daq.shot import AlignmentStatus, ClockAlignment
from processing.motion_alignment import MotionFit
from processing.redundant_alignment import RedundantFit
from processing.trigger_alignment import EdgeFit

LEAST_CORRELATION = 0.8
"""Below this the two records are not of one motion."""
LEAST_MARGIN = 0.03
"""By how much the best correlation must exceed the next peak away from it."""
INNOVATION_LIMITS = (0.5, 1.6)
"""Mean squared normalised residual of a fit whose noise levels are right is 1."""
GAIN_LIMIT_SIGMA = 4.0
"""How many standard uncertainties the scales of two sensors may differ by."""
MOST_INFLATION = 300.0
"""How much the accelerometer's noise may have to be raised before the motions differ."""
EDGE_RESIDUAL_SIGMA = 4.0


def judge_motion(
    clock: str, fit: MotionFit | str, *, u_gain: float, noise_density: float, frame_period_s: float
) -> ClockAlignment:
    """Judge a camera's alignment by motion.

    Parameters
    ----------
    clock : str
    fit : MotionFit or str
        A sentence if there was nothing to align by.
    u_gain : float
        Standard uncertainty of the ratio of the two sensors' scales, from their calibrations.
    noise_density : float
        The accelerometer's white noise density before the shot, (m/s^2)^2/Hz, two-sided.
    frame_period_s : float

    Returns
    -------
    ClockAlignment
    """
    if isinstance(fit, str):
        return _failed(clock, "motion", fit)
    doubts, failures = _common_doubts(fit.correlation, fit.second_peak, fit.at_search_edge)
    low, high = INNOVATION_LIMITS
    if not low <= fit.innovation_statistic <= high:
        doubts.append(
            f"residuals are {fit.innovation_statistic:.2f} times their expected variance (limits {low} to {high}): "
            "a dropped frame, a wrong frame rate or another motion"
        )
    inflation = fit.acceleration_density / noise_density
    if inflation > MOST_INFLATION:
        failures.append(
            f"camera and accelerometer do not show the same motion: {inflation:.0f} times the accelerometer's noise "
            "would be needed to explain the difference"
        )
    off = abs(fit.gain - 1.0) / math.hypot(u_gain, fit.u_gain)
    if off > GAIN_LIMIT_SIGMA:
        failures.append(
            f"the camera's travel is {100 * (fit.gain - 1):+.2f} % off the accelerometer's, "
            f"{off:.1f} standard uncertainties: another shot's file, a wrong scale or a wrong sensitivity"
        )
    apart = abs(fit.coarse_offset_s - fit.offset_s)
    if apart > max(2e-3, 6 * frame_period_s):
        doubts.append(f"velocity correlation and likelihood are {1e3 * apart:.2f} ms apart")
    details = {
        "gain": fit.gain,
        "u_gain": fit.u_gain,
        "u_bias_m_s2": fit.u_bias_m_s2,
        "gain_bias_correlation": fit.gain_bias_correlation,
        "integration_constants": list(fit.integration_constants),
        "origin_s": fit.origin_s,
        "marker_sigma_m": fit.marker_sigma_m,
        "acceleration_density": fit.acceleration_density,
        "innovation_statistic": fit.innovation_statistic,
        "noise_inflation": inflation,
        "coarse_offset_s": fit.coarse_offset_s,
        "correlation": fit.correlation,
        "second_peak": fit.second_peak,
        "candidates_s": fit.candidates_s.tolist(),
        "log_likelihood": fit.log_likelihood.tolist(),
    }
    return ClockAlignment(
        clock, fit.offset_s, fit.u_offset_s, fit.drift, fit.u_drift, *_status(doubts, failures, "motion"), details
    )


def judge_redundant(clock: str, fit: RedundantFit | str) -> ClockAlignment:
    """Judge an alignment by a redundant channel."""
    if isinstance(fit, str):
        return _failed(clock, "redundant", fit)
    doubts, failures = _common_doubts(fit.correlation, fit.second_peak, fit.at_search_edge)
    if fit.u_offset_s > 2e-4:
        doubts.append(f"the offset is known to {1e3 * fit.u_offset_s:.2f} ms only")
    details = {
        "gain": fit.gain,
        "u_gain": fit.u_gain,
        "coarse_offset_s": fit.coarse_offset_s,
        "correlation": fit.correlation,
        "second_peak": fit.second_peak,
        "cutoff_hz": fit.cutoff_hz,
        "stamp_scatter_s": fit.stamp_scatter_s,
        "residual_share": fit.residual_share,
    }
    return ClockAlignment(
        clock, fit.offset_s, fit.u_offset_s, fit.drift, fit.u_drift, *_status(doubts, failures, "redundant"), details
    )


def judge_edges(clock: str, fit: EdgeFit | str, *, u_edge_s: float) -> ClockAlignment:
    """Judge an alignment by trigger edges."""
    if isinstance(fit, str):
        return _failed(clock, "trigger", fit)
    doubts = []
    if fit.residual_s > EDGE_RESIDUAL_SIGMA * u_edge_s and fit.edges > 2:
        doubts.append(f"an edge lies {1e6 * fit.residual_s:.1f} us off the line through the others")
    details = {"edges": fit.edges, "residual_s": fit.residual_s}
    return ClockAlignment(
        clock, fit.offset_s, fit.u_offset_s, fit.drift, fit.u_drift, *_status(doubts, [], "trigger"), details
    )


def _common_doubts(correlation: float, second_peak: float, at_edge: bool) -> tuple[list[str], list[str]]:
    doubts: list[str] = []
    failures: list[str] = []
    if correlation < LEAST_CORRELATION:
        failures.append(f"correlation {correlation:.2f} is below {LEAST_CORRELATION}: not the same motion")
    if correlation - second_peak < LEAST_MARGIN:
        doubts.append(f"a second offset fits nearly as well (correlation {second_peak:.3f} against {correlation:.3f})")
    if at_edge:
        doubts.append("the best offset lies at the edge of the search")
    return doubts, failures


def _status(doubts: list[str], failures: list[str], method: str) -> tuple[AlignmentStatus, str, tuple[str, ...]]:
    status: AlignmentStatus = "failed" if failures else "ambiguous" if doubts else "ok"
    return status, method, (*failures, *doubts)


def _failed(clock: str, method: str, reason: str) -> ClockAlignment:
    return ClockAlignment(clock, 0.0, math.inf, 0.0, math.inf, "failed", method, (reason,))
