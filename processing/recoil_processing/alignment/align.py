"""One clock for all: the verdict on an alignment, and how it is reported.

The estimators are `recoil_processing.alignment.motion_alignment`, `recoil_processing.alignment.redundant_alignment` and
`recoil_processing.alignment.trigger_alignment`. Here their figures become a `ClockAlignment` with a status:
``ok``, ``ambiguous`` where the data allow doubt, ``failed`` where there is nothing to align by.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any, Literal

import numpy as np

from recoil_acquisition.measured import measured, worded
from recoil_acquisition.shot.shot import AlignmentStatus, ClockAlignment
from recoil_processing.alignment.motion_alignment import INFLATIONS
from recoil_processing.alignment.motion_fit import MotionFit
from recoil_processing.alignment.redundant_alignment import RedundantFit
from recoil_processing.alignment.trigger_alignment import EdgeFit
from recoil_processing.arguments import require_positive

Fit = MotionFit | RedundantFit | EdgeFit

LEAST_CORRELATION = 0.8
"""Correlation below which the two records are not of one motion."""
LEAST_MARGIN = 0.03
"""Least difference between the best correlation and the next peak away from it."""
INNOVATION_LIMITS = (0.5, 1.6)
"""Mean squared normalised residual of a fit whose noise levels are right is 1."""
GAIN_LIMIT_SIGMA = 4.0
"""Standard uncertainties by which the scales of two sensors may differ."""
DRIFT_LIMIT_SIGMA = 3.5
"""Standard uncertainties by which the record's own drift may be off zero, that of the clocks' quality among them."""
BIAS_LIMIT_SIGMA = 4.0
"""Standard uncertainties by which a zero must be off beyond `MOST_BIAS_M_S2`."""
MOST_BIAS_M_S2 = 10.0
"""Acceleration left at rest beyond which a zero was never taken off: more than gravity, a hundred times what is
usual."""
VELOCITY_LIMIT_SIGMA = 3.0
"""Combined standard uncertainties by which velocities and likelihood may differ."""
MOST_SET_ASIDE = 0.02
"""Share of the frames that may contradict their neighbours: published tracks repeat 1.4 % in the median."""
LOW_NOISE = "the track was smoothed or filled, or too many frames are lost to estimate its noise"
MOST_INFLATION = 300.0
"""Factor on the accelerometer's noise beyond which the two motions differ."""
EDGE_RESIDUAL_SIGMA = 4.0
"""Standard uncertainties by which a pair of edges may lie off the line."""
MOST_UNPAIRED = 0.1
"""Edges without a counterpart over pairs, beyond which the two trains may not be the same."""
MOST_LISTED = 50
"""Instants of edges that are listed one by one."""
MOST_U_OFFSET_S = 2e-4
"""Uncertainty beyond which an offset is hardly known: at 10 m/s it is 2 mm of travel."""
MOST_DRIFT = 1e-3
"""No two quartz clocks differ by a tenth of this; a frame rate that was entered wrongly does."""

OF_ACCELEROMETER = (
    "gain", "u_gain", "u_bias_m_s2", "gain_bias_correlation", "integration_constants", "origin_s", "marker_sigma_m",
    "acceleration_density", "innovation_statistic",
)  # fmt: skip
OF_CLOCK = (
    "free_drift", "u_free_drift", "frames", "frames_set_aside", "coarse_offset_s", "correlation", "second_peak",
    "candidates_s", "log_likelihood", "drift_allowance", "drift_earned",
)  # fmt: skip
"""Figures of an alignment by motion that its details list."""
OF_REPEAT = (
    "gain", "u_gain", "coarse_offset_s", "correlation", "second_peak", "cutoff_hz", "residual_share", "u_alias_s",
    "rows",
)  # fmt: skip
"""Figures of an alignment by a repeated channel."""
OF_EDGES = ("edges", "residual_s", "set_aside", "rivals", "all_source", "all_reference")
"""Figures of an alignment by edges."""


def judge_motion(
    clock: str,
    fit: MotionFit | str,
    *,
    u_gain: float,
    noise_density: float,
    frame_period_s: float,
    method: Literal["motion", "force"] = "motion",
) -> ClockAlignment:
    """Judge a camera's alignment by motion.

    Parameters
    ----------
    fit
        Fit, or a sentence on why there was nothing to align by.
    u_gain
        Standard uncertainty of the ratio of the two sensors' scales, from their calibrations.
    noise_density
        The accelerometer's white noise density before the shot, (m/s^2)^2/Hz, two-sided.
    method
        Method of the alignment: the camera's motion against that of the accelerometer, or against that by the forces.

    Returns
    -------
    ClockAlignment
        Alignment, ``ambiguous`` and of the file as it is where the camera track is wrong from some frame on
        (`alignment.frame_fault`); the details hold the places, and the offset of a corrected track. ``drift_told_from``
        is the drift beyond which the record would have shown a wrong frame rate.

    Raises
    ------
    ValueError
        If the noise density is not positive.
    """
    require_positive(noise_density=noise_density)
    if isinstance(fit, str):
        return failed_alignment(clock, method, fit)
    if not _finite(fit.offset_s, fit.u_offset_s, fit.drift, fit.gain, fit.u_gain, fit.innovation_statistic):
        return failed_alignment(clock, method, "the fit gives no finite number: check both records for spikes")
    against = "accelerometer" if method == "motion" else "force"
    # what a missing frame or a jump does to the fit is stated by itself; the rest is judged without it
    sound = fit.corrected or fit
    doubts, failures = _common_doubts(sound, sound.drift_allowance)
    doubts = [*(fault.told for fault in fit.frame_faults), *doubts]
    low, high = INNOVATION_LIMITS
    if not low <= sound.innovation_statistic <= high:
        doubts.append(
            f"residuals are {sound.innovation_statistic:.2f} times their expected variance (limits {low} to {high}): "
            + (
                "a dropped frame, a wrong frame rate or another motion"
                if sound.innovation_statistic > high
                else LOW_NOISE
            )
        )
    if sound.frames_set_aside > MOST_SET_ASIDE * (sound.frames + sound.frames_set_aside):
        doubts.append(
            f"{sound.frames_set_aside} of {sound.frames + sound.frames_set_aside} frames contradict their neighbours"
        )
    inflation = sound.acceleration_density / noise_density
    if inflation > MOST_INFLATION:
        failures.append(
            f"camera and {against} do not show the same motion: {_times(inflation)} the {against}'s noise "
            "would be needed to explain the difference"
        )
    off = abs(sound.gain - 1.0) / max(math.hypot(u_gain, sound.u_gain), 1e-12)
    if off > GAIN_LIMIT_SIGMA:
        failures.append(
            f"the camera's travel is {100 * (sound.gain - 1):+.2f} % off the {against}'s, "
            f"{off:.1f} standard uncertainties: another shot's file, a wrong scale or a wrong sensitivity"
        )
    if (
        not failures
        and abs(sound.drift) <= _most_drift(sound.drift_allowance)
        and sound.drift_departure > DRIFT_LIMIT_SIGMA
    ):
        way = "longer" if sound.free_drift > 0 else "shorter"
        doubts.append(
            f"the motions fit best if the camera's seconds are {100 * abs(sound.free_drift):.3f} % {way} "
            f"(u {100 * sound.u_free_drift:.3f} %): check the frame rate, and that both files are of this shot"
        )
    # what the forces leave unexplained at rest is no sensor's zero
    if method == "motion" and abs(sound.bias_m_s2) > MOST_BIAS_M_S2 + BIAS_LIMIT_SIGMA * sound.u_bias_m_s2:
        doubts.append(
            worded(
                f"the {against} reads ",
                measured(sound.bias_m_s2, "m/s^2", "+.3g"),
                " (u ",
                measured(sound.u_bias_m_s2, "m/s^2", ".2g"),
                ") where the camera sees no acceleration: take its zero from the time before the shot, and check its "
                "sensitivity",
            )
        )
    apart = abs(sound.coarse_offset_s - (sound.offset_s + sound.drift * sound.origin_s))
    if apart > max(2e-3, 6 * frame_period_s):
        doubts.append(f"velocity correlation and likelihood are {1e3 * apart:.2f} ms apart")
    by_velocity_s = sound.velocity_offset_s - sound.offset_s
    combined = abs(by_velocity_s) / math.hypot(sound.u_velocity_offset_s, sound.u_offset_s)
    if combined > VELOCITY_LIMIT_SIGMA:
        doubts.append(
            f"velocities alone give an offset {1e6 * by_velocity_s:+.0f} us from the likelihood's, "
            f"{combined:.1f} combined standard uncertainties: check that both files are of this shot"
        )
    details = {
        **_figures(fit, OF_ACCELEROMETER),
        "noise_inflation": inflation,
        **_figures(fit, OF_CLOCK),
        "drift_departure": sound.drift_departure,
        "drift_told_from": DRIFT_LIMIT_SIGMA * math.hypot(sound.u_free_drift, sound.drift_allowance),
        "frame_faults": [asdict(fault) for fault in fit.frame_faults],
    }
    if fit.shifted_zero_m_s2 is not None:
        details["shifted_zero_m_s2"] = fit.shifted_zero_m_s2
    if math.isfinite(sound.u_velocity_offset_s):
        details |= {"velocity_apart_s": by_velocity_s, "u_velocity_offset_s": sound.u_velocity_offset_s}
    if fit.corrected is not None:
        details |= {
            "corrected_offset_s": fit.corrected.offset_s,
            "u_corrected_offset_s": fit.corrected.u_offset_s,
            "corrected_drift": fit.corrected.drift,
        }
    return _judged(clock, fit, doubts, failures, method, details)


def judge_redundant(
    clock: str, fit: RedundantFit | str, *, method: str = "redundant", most_u_s: float = MOST_U_OFFSET_S
) -> ClockAlignment:
    """Judge an alignment by a channel that repeats another, or its integral or derivative (method ``motion``).

    Parameters
    ----------
    most_u_s
        Uncertainty beyond which the offset is hardly known.
    """
    if isinstance(fit, str):
        return failed_alignment(clock, method, fit)
    if not _finite(fit.offset_s, fit.u_offset_s, fit.drift, fit.gain, fit.u_gain):
        return failed_alignment(clock, method, "the fit gives no finite number: check both records for spikes")
    doubts, failures = _common_doubts(fit, most_u_s=most_u_s)
    return _judged(clock, fit, doubts, failures, method, _figures(fit, OF_REPEAT))


def judge_edges(clock: str, fit: EdgeFit | str, *, u_edge_s: float, method: str = "trigger") -> ClockAlignment:
    """Judge an alignment by edges: triggers, or the pulses of a camera's exposures (method ``exposure``).

    Parameters
    ----------
    fit
        Fit, or a sentence on why there was nothing to align by.
    u_edge_s
        Standard uncertainty of one pair.

    Returns
    -------
    ClockAlignment
        Alignment whose details list the edges without a counterpart, on the clock of each.
    """
    if isinstance(fit, str):
        return failed_alignment(clock, method, fit)
    doubts = []
    if abs(fit.drift) > MOST_DRIFT:
        doubts.append(_too_much_drift(fit.drift))
    # the largest of many residuals is larger than one
    if fit.residual_s > u_edge_s * math.sqrt(EDGE_RESIDUAL_SIGMA**2 + 2.0 * math.log(fit.edges)):
        doubts.append(f"an edge lies {1e6 * fit.residual_s:.1f} us off the line through the others")
    counts = f"{fit.all_source} edges on the source, {fit.all_reference} on the reference"
    if fit.rivals:
        doubts.append(f"{fit.rivals} other offsets pair the edges as well: {counts}")
    alone = fit.set_aside + len(fit.unpaired_source) + len(fit.unpaired_reference)
    if alone > MOST_UNPAIRED * fit.edges:
        doubts.append(f"{alone} edges between the first and the last pair have no counterpart: {counts}")
    if fit.u_offset_s > MOST_U_OFFSET_S:
        doubts.append(hardly_known(fit.u_offset_s))
    details = {
        **_figures(fit, OF_EDGES),
        "unpaired_source": len(fit.unpaired_source),
        "unpaired_reference": len(fit.unpaired_reference),
        "unpaired_source_s": list(fit.unpaired_source[:MOST_LISTED]),
        "unpaired_reference_s": list(fit.unpaired_reference[:MOST_LISTED]),
    }
    return _judged(clock, fit, doubts, [], method, details)


def _times(inflation: float) -> str:
    """Say how many times; of the most that was tried no more is known than that it is not less."""
    at_most = inflation >= 0.99 * INFLATIONS[-1]
    return f"{INFLATIONS[-1]:.0f} times or more (no more are tried)" if at_most else f"{inflation:.0f} times"


def _most_drift(drift_allowance: float) -> float:
    """Return the largest drift that clocks may have, one whose rate is less certain than a quartz's included."""
    return max(MOST_DRIFT, DRIFT_LIMIT_SIGMA * drift_allowance)


def _common_doubts(
    fit: MotionFit | RedundantFit, drift_allowance: float = 0.0, most_u_s: float = MOST_U_OFFSET_S
) -> tuple[list[str], list[str]]:
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
    if fit.u_offset_s > most_u_s:
        doubts.append(hardly_known(fit.u_offset_s))
    if abs(fit.drift) > _most_drift(drift_allowance):
        doubts.append(_too_much_drift(fit.drift))
    if not fit.converged:
        doubts.append("the search for the offset did not settle")
    return doubts, failures


def _too_much_drift(drift: float) -> str:
    return f"the clocks' rates differ by {100 * drift:+.3f} %, more than clocks do: check the source's declared rate"


def hardly_known(u_offset_s: float) -> str:
    """Say that an offset is hardly known."""
    return f"the offset is known to {1e3 * u_offset_s:.2f} ms only"


def _finite(*figures: float) -> bool:
    return all(math.isfinite(figure) for figure in figures)


def _figures(fit: Fit, names: Sequence[str]) -> dict[str, Any]:
    """Return some figures of a fit in JSON types."""
    return {name: np.asarray(getattr(fit, name)).tolist() for name in names}


def _judged(
    clock: str, fit: Fit, doubts: list[str], failures: list[str], method: str, details: Mapping[str, Any]
) -> ClockAlignment:
    status: AlignmentStatus = "failed" if failures else "ambiguous" if doubts else "ok"
    line = fit.offset_s, fit.u_offset_s, fit.drift, fit.u_drift
    return ClockAlignment(clock, *line, status, method, (*failures, *doubts), details)


def failed_alignment(clock: str, method: str, reason: str) -> ClockAlignment:
    """Return the alignment of a clock that could not be related to the reference, with the reason."""
    return ClockAlignment(clock, 0.0, math.inf, 0.0, math.inf, "failed", method, (reason,))
