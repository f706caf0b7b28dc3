"""One shot from aligned channels to a mass: the order of the steps."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from daq.channel import Channel
from daq.errors import IdentificationError
from daq.shot import ClockAlignment, Shot
from identification.calibration import Calibration
from identification.camera_route import mass_by_camera
from identification.constancy.mass_constancy import MassConstancy, constancy_of
from identification.estimators.endogeneity import Endogeneity, durbin_wu_hausman
from identification.estimators.errors_in_variables import neighbouring_force
from identification.estimators.estimates import FilmedShot, further_estimates, other_acceleration
from identification.filter_choice import FilterChoice, choose_filter, mass_filter
from identification.mass import RANDOM, MassEstimate, ScaleUncertainty, forward_mass, reverse_mass
from identification.memory.window_length import WindowChoice
from identification.monte_carlo import MonteCarlo, propagate
from identification.preparation import camera_scale, filmed, prepare
from identification.regression import Regression
from identification.rpe import relative_percentage_error, rpe_interval
from identification.sensor_scales import scale_uncertainty
from identification.signals import Signals
from identification.skew import RecorderSkew, find_skew, skew_contribution
from identification.stress_waves import StressWaves, find_stress_waves
from identification.trace import LARGEST_RELATIVE_U, MassTrace, mass_trace
from identification.trace_window import choose_trace_window
from identification.uncertainty import further_contributions
from identification.verdict import notes_on, reasons_against
from identification.zero_shift import ZeroShift, calibrated_with_zero_shift
from processing.cutoff import CutoffChoice
from processing.filters import LowPass
from processing.fusion import FusedMotion
from processing.repeatability import ShotPeaks, shot_peaks
from rigs.rig import Rig

Array = NDArray[np.float64]
Method = Literal["calibrated", "reverse", "forward", "paper", "tls", "ar-gls", "weak", "camera-gls", "joint"]
METHODS: tuple[Method, ...] = ("calibrated", "reverse", "forward", "paper")
"""Computed for every shot. The default is ``calibrated`` wherever forces and accelerometer are there, because the
scales of the sensors are less certain than the shot is random; a camera that was aligned adds its own scale."""
FURTHER: tuple[Method, ...] = ("tls", "ar-gls", "weak", "camera-gls", "joint")
"""Computed when asked for, see `identification.estimators.estimates`; the last two need a camera that was aligned."""

DEFAULT_WINDOW_S = 0.02
INSTRUMENT_LAG_S = 2.5e-4
"""Of the force that is the instrument of the test on bias: beyond its noise's correlation, short against the pulse."""


@dataclass(frozen=True)
class Options:
    """What the user may choose.

    Attributes
    ----------
    method : str
        One of `METHODS` or `FURTHER`; it gives the mass and the trace of the report.
    cutoff_hz : float or None
        -3 dB point of the zero-phase low-pass of both sides; None to choose it from the data.
    window_s : float or None
        Memory of the trace; None to choose it from the shot, see `identification.trace_window`.
    campaign : CutoffChoice or None
        The cut-off chosen for several shots, this one among them.
    compare : bool
        Whether those of `FURTHER` are all computed.

    Raises
    ------
    ValueError
        If the method is unknown, or cut-off or window are not positive.
    """

    method: Method = "calibrated"
    cutoff_hz: float | None = None
    window_s: float | None = DEFAULT_WINDOW_S
    campaign: CutoffChoice | None = None
    compare: bool = False

    def __post_init__(self) -> None:
        if self.method not in (*METHODS, *FURTHER):
            raise ValueError(f"method must be one of {', '.join((*METHODS, *FURTHER))}, not {self.method!r}")
        for name in ("cutoff_hz", "window_s"):
            value = getattr(self, name)
            if value is not None and not (math.isfinite(value) and value > 0):
                raise ValueError(f"{name} must be positive, not {value}")


@dataclass(frozen=True, eq=False)
class Result:
    """One method's mass, trace and RPE.

    Attributes
    ----------
    estimate : MassEstimate
    trace : MassTrace
    rpe_percent : float
    rpe_interval_percent : tuple of float
        95 %.
    """

    estimate: MassEstimate
    trace: MassTrace
    rpe_percent: float
    rpe_interval_percent: tuple[float, float]


@dataclass(frozen=True, eq=False)
class Identification:
    """Everything that was found out about one shot.

    Attributes
    ----------
    options : Options
    specification_kg, u_specification_kg : float
    results : mapping of str to Result
        By method, the inertial route; ``kinematic`` is the reverse estimate by the camera's route.
    calibration : Calibration
    filter_choice : FilterChoice
        The low-pass, and why that one.
    mass_low_pass : LowPass
        That of the fit of the mass, the force's own band within it.
    zero_shift : ZeroShift
        Of the recoiling part's accelerometer.
    monte_carlo : MonteCarlo or None
        Of the mass by the calibrated method; None where a draw has no mass.
    endogeneity : Endogeneity or None
        Whether force on acceleration, as recorded, is biased here; None where that cannot be told.
    constancy : MassConstancy or None
        Whether one mass explains the shot; None where that cannot be told.
    window_choice : WindowChoice or None
        Why the trace has this memory, where it was chosen from the shot.
    skew : RecorderSkew
        Of acceleration and force.
    stress_waves : tuple of StressWaves
        By channel.
    peaks : ShotPeaks
        Of the recoil acceleration, recorded and filtered.
    signals : Signals
    recorded, filtered, fitted : Regression
        Both sides of the equation of motion as recorded, behind the low-pass, and behind that of the fit of the mass.
    kinematic : Regression or None
        With a' by the camera.
    camera : Channel or None
        Displacement on its own clock, without the delay of its chain.
    travel_m, velocity_m_s : ndarray, shape (n,)
    fused : FusedMotion or None
        Camera and accelerometers together, with their standard uncertainties.
    alignments : mapping of str to ClockAlignment
    reasons : tuple of str
        Why the result is not valid; empty if it is.
    notes : tuple of str
        What a reader should know although it does not make the result invalid.
    """

    options: Options
    specification_kg: float
    u_specification_kg: float
    results: Mapping[str, Result]
    calibration: Calibration
    filter_choice: FilterChoice
    mass_low_pass: LowPass
    zero_shift: ZeroShift
    monte_carlo: MonteCarlo | None
    endogeneity: Endogeneity | None
    constancy: MassConstancy | None
    window_choice: WindowChoice | None
    skew: RecorderSkew
    stress_waves: tuple[StressWaves, ...]
    peaks: ShotPeaks
    signals: Signals
    recorded: Regression
    filtered: Regression
    fitted: Regression
    kinematic: Regression | None
    camera: Channel | None
    travel_m: Array
    velocity_m_s: Array
    fused: FusedMotion | None
    alignments: Mapping[str, ClockAlignment]
    reasons: tuple[str, ...]
    notes: tuple[str, ...] = field(default=())

    @property
    def chosen(self) -> Result:
        """The result of the method that was asked for."""
        return self.results[self.options.method]

    @property
    def valid(self) -> bool:
        """Whether nothing speaks against the result."""
        return not self.reasons

    @property
    def normalised_error(self) -> float:
        """``E_n = (m - m_spec) / sqrt(U^2 + U_spec^2)`` (ISO/IEC 17043, annex B), with k = 2 throughout.

        NaN where neither mass has an uncertainty.
        """
        estimate = self.chosen.estimate
        expanded = 2 * math.hypot(estimate.u_kg, self.u_specification_kg)
        return (estimate.mass_kg - self.specification_kg) / expanded if expanded > 0 else math.nan


def identify_shot(shot: Shot, rig: Rig, options: Options) -> Identification:
    """Identify the recoiling mass of one shot.

    Parameters
    ----------
    shot : Shot
        With its alignments.
    rig : Rig
    options : Options

    Returns
    -------
    Identification

    Raises
    ------
    IdentificationError
        If no number can be given at all; a doubtful number is a result with reasons.
    """
    prepared = prepare(shot, rig)
    signals, recorded = prepared.signals, prepared.recorded
    camera, camera_clock = prepared.camera, prepared.camera_clock
    choice = choose_filter(recorded, shot, given_hz=options.cutoff_hz, campaign=options.campaign)
    low_pass = choice.low_pass
    scales = scale_uncertainty(rig)
    offset = signals.offsets["recoil_acceleration"]
    told = camera_scale(camera, camera_clock), filmed(signals, prepared.acceleration_m_s2, camera, camera_clock)

    mass_low_pass = mass_filter(recorded, choice)

    def calibrated(regression: Regression) -> tuple[Regression, Regression, Regression, Calibration, ZeroShift]:
        shifted, narrow, found, shift = calibrated_with_zero_shift(regression, mass_low_pass, scales, offset.u, *told)
        # the trace, the skew and the figures need the whole band
        return shifted, narrow, narrow if mass_low_pass == low_pass else shifted.filtered(low_pass), found, shift

    recorded, narrow, filtered, calibration, zero_shift = calibrated(recorded)
    skew = find_skew(filtered, calibration)
    while skew.due_s:
        recorded = prepared.without_skew(shot, rig, skew.corrected_s + skew.due_s)
        recorded, narrow, filtered, calibration, zero_shift = calibrated(recorded)
        skew = find_skew(filtered, calibration, corrected_s=skew.corrected_s + skew.due_s, steps=skew.steps + 1)
    further = (
        *further_contributions(recorded, narrow, calibration, signals, shot, rig),
        *skew_contribution(narrow, calibration, skew),
    )
    estimates = {
        "calibrated": calibration.estimate,
        "reverse": reverse_mass(narrow, scales),
        "forward": forward_mass(narrow, scales),
        "paper": replace(forward_mass(recorded, scales), method="paper"),
    }
    estimates = {k: replace(e, budget=(*e.budget, *further)) for k, e in estimates.items()}
    if options.compare or options.method in FURTHER:
        film = None
        if camera is not None and camera_clock is not None:
            # a clock that was aligned by the accelerometer is as much less late as that was
            clock = replace(camera_clock, offset_s=camera_clock.offset_s - skew.corrected_s)
            other = other_acceleration(prepared.acceleration_m_s2, prepared.inertial_m_s2)
            film = FilmedShot(camera, clock, other)
        estimates |= further_estimates(narrow, recorded, signals, shot, rig, scales, further, film)
    if options.method not in estimates:
        raise IdentificationError(
            f"this shot allows no estimate by the method {options.method}",
            found=f"estimates by {', '.join(estimates)}",
            remedy="take another --method, or mend the camera's alignment and what was lost",
        )
    constancy = _constancy(filtered, calibration, scales, offset.u)
    regressions = {name: filtered if name != "paper" else recorded for name in estimates}
    notes: tuple[str, ...] = ()
    if camera is not None and camera_clock is not None and camera_clock.status != "failed":
        try:
            regressions["kinematic"], estimates["kinematic"] = mass_by_camera(
                recorded, signals, prepared.motion, shot, rig, camera, camera_clock, low_pass, scales, calibration
            )
        except IdentificationError as error:
            notes = (f"no mass by the camera: {error}",)
    window_s, window_choice = options.window_s, None
    if window_s is None:
        window_s, window_choice = choose_trace_window(filtered, *calibration.correct(filtered))
    results = {
        name: _result(estimate, regressions[name], calibration, window_s, rig) for name, estimate in estimates.items()
    }
    trace = results[options.method].trace
    return Identification(
        options=options,
        specification_kg=rig.mechanism.m3,
        u_specification_kg=rig.mechanism.u.get("m3", 0.0),
        results=results,
        calibration=calibration,
        filter_choice=choice,
        mass_low_pass=mass_low_pass,
        zero_shift=zero_shift,
        monte_carlo=propagate(calibration.problem.draws(further)),
        endogeneity=_endogeneity(recorded),
        constancy=constancy,
        window_choice=window_choice,
        skew=skew,
        stress_waves=find_stress_waves(shot, signals, choice),
        peaks=shot_peaks(shot.name, recorded.acceleration_m_s2, recorded.rate_hz, low_pass),
        signals=signals,
        recorded=recorded,
        filtered=filtered,
        fitted=narrow,
        kinematic=regressions.get("kinematic"),
        camera=camera,
        travel_m=prepared.travel_m,
        velocity_m_s=prepared.velocity_m_s,
        fused=prepared.fused,
        alignments=prepared.alignments,
        reasons=reasons_against(shot, rig, signals, estimates, trace, calibration, zero_shift, filtered, constancy),
        notes=(*notes_on(signals, recorded, trace, zero_shift, constancy), *notes),
    )


def _constancy(
    filtered: Regression, calibration: Calibration, scales: ScaleUncertainty, u_zero_m_s2: float
) -> MassConstancy | None:
    try:
        return constancy_of(filtered, calibration, scales, u_zero_m_s2)
    except IdentificationError:
        # too few rows to tell; the mass itself has its own reasons then
        return None


def _endogeneity(recorded: Regression) -> Endogeneity | None:
    force = recorded.force_n
    lag = max(1, round(INSTRUMENT_LAG_S * recorded.rate_hz))
    instrument = neighbouring_force(np.where(np.isfinite(force), force, 0.0), lag)
    used = recorded.used & np.roll(recorded.trusted, lag) & np.roll(recorded.trusted, -lag)
    try:
        return durbin_wu_hausman(recorded.acceleration_m_s2, force, instrument, used=used)
    except IdentificationError:
        return None


def _result(
    estimate: MassEstimate, regression: Regression, calibration: Calibration, window_s: float, rig: Rig
) -> Result:
    systematic = common = math.hypot(*(r.u_kg for r in estimate.budget if r.source != RANDOM)) / estimate.mass_kg
    left = None
    if estimate.method == "calibrated":
        acceleration, force = calibration.correct(regression)
        # what the sensors' errors do differs from window to window
        left, sensors = calibration.errors_left(regression), {r.source for r in calibration.estimate.budget}
        common = math.hypot(0.0, *(r.u_kg for r in estimate.budget if r.source not in sensors)) / estimate.mass_kg
    else:
        acceleration, force = regression.acceleration_m_s2, regression.force_n
    direction: Literal["reverse", "forward"] = "forward" if estimate.method in ("forward", "paper") else "reverse"
    guard = math.inf if estimate.method == "paper" else LARGEST_RELATIVE_U
    trace = mass_trace(
        regression,
        acceleration,
        force,
        window_s,
        direction=direction,
        systematic_rel=common,
        errors_m_s2=left,
        largest_relative_u=guard,
    )
    m = rig.mechanism
    return Result(
        estimate,
        trace,
        relative_percentage_error(trace.mass_kg, m.m3),
        rpe_interval(trace.mass_kg, m.m3, systematic, m.u.get("m3", 0.0)),
    )
