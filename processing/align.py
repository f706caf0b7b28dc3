"""One clock for all: the verdict on an alignment, and how it is reported.

The estimators are `processing.motion_alignment`, `processing.redundant_alignment` and
`processing.trigger_alignment`. Here their figures become a `ClockAlignment` with a status:
``ok``, ``ambiguous`` where the data allow doubt, ``failed`` where there is nothing to align by.
"""

from __future__ import annotations

import math

from daq.shot import AlignmentStatus, ClockAlignment
from processing.motion_fit import MotionFit
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
DRIFT_LIMIT_SIGMA = 5.0
"""How many standard uncertainties the record's own drift may be off the one that the clocks' quality allows."""
MOST_SET_ASIDE = 0.02
"""Share of the frames that may contradict their neighbours: published tracks repeat 1.4 % in the median."""
LOW_NOISE = "the track was smoothed or filled, or too many frames are lost to tell its noise"
MOST_INFLATION = 300.0
"""How much the accelerometer's noise may have to be raised before the motions differ."""
EDGE_RESIDUAL_SIGMA = 4.0
"""How many standard uncertainties a pair of edges may lie off the line."""
MOST_U_OFFSET_S = 2e-4
"""Beyond this an offset is hardly known: at 10 m/s it is 2 mm of travel."""
MOST_DRIFT = 1e-3
"""No two quartz clocks differ by a tenth of this; a frame rate that was entered wrongly does."""


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

    Raises
    ------
    ValueError
        If the noise density is not positive.
    """
    if not noise_density > 0:
        raise ValueError(f"noise_density must be positive, not {noise_density}")
    if isinstance(fit, str):
        return failed_alignment(clock, "motion", fit)
    if not _finite(fit.offset_s, fit.u_offset_s, fit.drift, fit.gain, fit.u_gain, fit.innovation_statistic):
        return failed_alignment(clock, "motion", "the fit gives no finite number: check both records for spikes")
    doubts, failures = _common_doubts(fit)
    low, high = INNOVATION_LIMITS
    if not low <= fit.innovation_statistic <= high:
        doubts.append(
            f"residuals are {fit.innovation_statistic:.2f} times their expected variance (limits {low} to {high}): "
            + (
                "a dropped frame, a wrong frame rate or another motion"
                if fit.innovation_statistic > high
                else LOW_NOISE
            )
        )
    if fit.frames_set_aside > MOST_SET_ASIDE * (fit.frames + fit.frames_set_aside):
        doubts.append(
            f"{fit.frames_set_aside} of {fit.frames + fit.frames_set_aside} frames contradict their neighbours"
        )
    inflation = fit.acceleration_density / noise_density
    if inflation > MOST_INFLATION:
        failures.append(
            f"camera and accelerometer do not show the same motion: {inflation:.0f} times the accelerometer's noise "
            "would be needed to explain the difference"
        )
    off = abs(fit.gain - 1.0) / max(math.hypot(u_gain, fit.u_gain), 1e-12)
    if off > GAIN_LIMIT_SIGMA:
        failures.append(
            f"the camera's travel is {100 * (fit.gain - 1):+.2f} % off the accelerometer's, "
            f"{off:.1f} standard uncertainties: another shot's file, a wrong scale or a wrong sensitivity"
        )
    if not failures and abs(fit.free_drift - fit.drift) > DRIFT_LIMIT_SIGMA * fit.u_free_drift:
        doubts.append(
            f"the motions fit best if the camera's seconds are {100 * (fit.free_drift - fit.drift):+.3f} % longer "
            f"(u {100 * fit.u_free_drift:.3f} %): check the frame rate"
        )
    apart = abs(fit.coarse_offset_s - (fit.offset_s + fit.drift * fit.origin_s))
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
        "free_drift": fit.free_drift,
        "u_free_drift": fit.u_free_drift,
        "frames": fit.frames,
        "frames_set_aside": fit.frames_set_aside,
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
        return failed_alignment(clock, "redundant", fit)
    if not _finite(fit.offset_s, fit.u_offset_s, fit.drift, fit.gain, fit.u_gain):
        return failed_alignment(clock, "redundant", "the fit gives no finite number: check both records for spikes")
    doubts, failures = _common_doubts(fit)
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
        return failed_alignment(clock, "trigger", fit)
    doubts = []
    if abs(fit.drift) > MOST_DRIFT:
        doubts.append(_too_much_drift(fit.drift))
    if fit.residual_s > EDGE_RESIDUAL_SIGMA * u_edge_s:
        doubts.append(f"an edge lies {1e6 * fit.residual_s:.1f} us off the line through the others")
    details = {"edges": fit.edges, "residual_s": fit.residual_s}
    return ClockAlignment(
        clock, fit.offset_s, fit.u_offset_s, fit.drift, fit.u_drift, *_status(doubts, [], "trigger"), details
    )


def _common_doubts(fit: MotionFit | RedundantFit) -> tuple[list[str], list[str]]:
    doubts: list[str] = []
    failures: list[str] = []
    if fit.correlation < LEAST_CORRELATION:
        failures.append(f"correlation {fit.correlation:.2f} is below {LEAST_CORRELATION}: not the same motion")
    if fit.correlation - fit.second_peak < LEAST_MARGIN:
        doubts.append(
            f"a second offset fits nearly as well (correlation {fit.second_peak:.3f} against {fit.correlation:.3f})"
        )
    if fit.at_search_edge:
        doubts.append("the best offset lies at the edge of the search")
    if fit.u_offset_s > MOST_U_OFFSET_S:
        doubts.append(f"the offset is known to {1e3 * fit.u_offset_s:.2f} ms only")
    if abs(fit.drift) > MOST_DRIFT:
        doubts.append(_too_much_drift(fit.drift))
    if not fit.converged:
        doubts.append("the search for the offset did not settle")
    return doubts, failures


def _too_much_drift(drift: float) -> str:
    return f"the clocks' rates differ by {100 * drift:+.3f} %, more than clocks do: check the source's declared rate"


def _finite(*figures: float) -> bool:
    return all(math.isfinite(figure) for figure in figures)


def _status(doubts: list[str], failures: list[str], method: str) -> tuple[AlignmentStatus, str, tuple[str, ...]]:
    status: AlignmentStatus = "failed" if failures else "ambiguous" if doubts else "ok"
    return status, method, (*failures, *doubts)


def failed_alignment(clock: str, method: str, reason: str) -> ClockAlignment:
    """Return the alignment of a clock that could not be related to the reference, with the reason."""
    return ClockAlignment(clock, 0.0, math.inf, 0.0, math.inf, "failed", method, (reason,))
