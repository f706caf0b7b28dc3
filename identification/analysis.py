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
from identification.calibration import Calibration, CameraScale
from identification.camera_route import mass_by_camera
from identification.kinematics import inertial_acceleration, travel_acceleration, travel_and_velocity, turning
from identification.mass import RANDOM, MassEstimate, ScaleUncertainty, forward_mass, reverse_mass
from identification.regression import Regression, build_regression
from identification.rpe import relative_percentage_error, rpe_interval
from identification.signals import Signals, collect_signals, static_value, without_delay
from identification.trace import LARGEST_RELATIVE_U, MassTrace, mass_trace
from identification.uncertainty import further_contributions
from identification.verdict import notes_on, reasons_against
from identification.zero_shift import Filmed, ZeroShift, calibrated_with_zero_shift
from processing.double_integral import DoubleIntegral
from processing.filters import LowPass
from processing.motion_alignment import INFLATIONS
from processing.scale_and_zero import filmed_motion
from rigs.rig import Rig

Array = NDArray[np.float64]
Method = Literal["calibrated", "reverse", "forward", "paper"]
METHODS: tuple[Method, ...] = ("calibrated", "reverse", "forward", "paper")

DEFAULT_CUTOFF_HZ = 300.0
"""Stress waves of gun-size mechanisms ring above 900 Hz, the recoil pulse has little above 300 Hz."""
DEFAULT_WINDOW_S = 0.02


@dataclass(frozen=True)
class Options:
    """What the user may choose.

    Attributes
    ----------
    method : str
        One of `METHODS`; it gives the mass and the trace of the report. All are computed.
    cutoff_hz : float or None
        -3 dB point of the zero-phase low-pass of both sides; None for the default.
    window_s : float
        Memory of the trace.

    Raises
    ------
    ValueError
        If the method is unknown, or cut-off or window are not positive.
    """

    method: Method = "calibrated"
    cutoff_hz: float | None = None
    window_s: float = DEFAULT_WINDOW_S

    def __post_init__(self) -> None:
        if self.method not in METHODS:
            raise ValueError(f"method must be one of {', '.join(METHODS)}, not {self.method!r}")
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
    zero_shift : ZeroShift
        Of the recoiling part's accelerometer.
    signals : Signals
    recorded, filtered : Regression
        Both sides of the equation of motion as recorded, and behind the low-pass.
    kinematic : Regression or None
        With a' by the camera.
    camera_delay_s : float
        By which the stamps of the camera's displacement are later than the motion; 0 without a camera.
    travel_m, velocity_m_s : ndarray, shape (n,)
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
    zero_shift: ZeroShift
    signals: Signals
    recorded: Regression
    filtered: Regression
    kinematic: Regression | None
    camera_delay_s: float
    travel_m: Array
    velocity_m_s: Array
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
    alignments = {a.clock: a for a in shot.alignments}
    if shot.by_role("recoil_acceleration") is None:
        raise IdentificationError(
            "no channel of role recoil_acceleration",
            found=", ".join(c.role for c in shot.channels.values() if c.role) or "no roles",
            remedy="declare its role in the rig file",
        )
    signals = collect_signals(shot, rig, alignments)
    if "recoil_acceleration" not in signals.series:
        raise IdentificationError("the recoiling part's accelerometer is on a clock that could not be aligned")
    motion = turning(signals, rig)
    camera = shot.by_role("recoil_displacement")
    delay_s = 0.0 if camera is None else rig.channel(camera.name).sensor.delay_s
    if camera is not None:
        camera = without_delay(camera, delay_s)
    camera_clock = None if camera is None else alignments.get(camera.time_base.clock)
    acceleration = travel_acceleration(signals, rig, motion)
    travel, velocity = travel_and_velocity(signals, acceleration, camera, camera_clock)
    static = static_value("recoil_acceleration", rig.mechanism) or 0.0
    recorded = build_regression(signals, rig.mechanism, inertial_acceleration(signals, rig, motion), velocity, static)
    low_pass = LowPass(_cutoff(options, shot))
    scales = scale_uncertainty(rig)
    offset = signals.offsets["recoil_acceleration"]
    filtered, calibration, zero_shift = calibrated_with_zero_shift(
        recorded,
        low_pass,
        scales,
        offset.u,
        camera_scale(camera, camera_clock),
        filmed(signals, acceleration, camera, camera_clock),
    )
    further = further_contributions(recorded, filtered, calibration, signals, shot, rig)
    estimates = {
        "calibrated": calibration.estimate,
        "reverse": reverse_mass(filtered, scales),
        "forward": forward_mass(filtered, scales),
        "paper": replace(forward_mass(recorded, scales), method="paper"),
    }
    estimates = {k: replace(e, budget=(*e.budget, *further)) for k, e in estimates.items()}
    regressions = {name: filtered if name != "paper" else recorded for name in estimates}
    notes: tuple[str, ...] = ()
    if camera is not None and camera_clock is not None and camera_clock.status != "failed":
        try:
            regressions["kinematic"], estimates["kinematic"] = mass_by_camera(
                recorded, signals, motion, shot, rig, camera, camera_clock, low_pass, scales, calibration
            )
        except IdentificationError as error:
            notes = (f"no mass by the camera: {error}",)
    results = {
        name: _result(estimate, regressions[name], calibration, options, rig) for name, estimate in estimates.items()
    }
    trace = results[options.method].trace
    return Identification(
        options=options,
        specification_kg=rig.mechanism.m3,
        u_specification_kg=rig.mechanism.u.get("m3", 0.0),
        results=results,
        calibration=calibration,
        zero_shift=zero_shift,
        signals=signals,
        recorded=recorded,
        filtered=filtered,
        kinematic=regressions.get("kinematic"),
        camera_delay_s=delay_s,
        travel_m=travel,
        velocity_m_s=velocity,
        alignments=alignments,
        reasons=reasons_against(shot, rig, signals, estimates, trace, calibration, zero_shift),
        notes=(*notes_on(signals, recorded, trace, zero_shift), *notes),
    )


def scale_uncertainty(rig: Rig) -> ScaleUncertainty:
    """Collect the standard uncertainties of the sensors' scales, areas included, and of the friction."""
    m = rig.mechanism

    def gauge(role: str, area: str) -> float:
        spec = rig.by_role(role)
        return math.hypot(spec.sensor.u_rel if spec else 0.0, m.u.get(area, 0.0) / getattr(m, area))

    accelerometer = rig.by_role("recoil_acceleration")
    return ScaleUncertainty(
        accelerometer.sensor.u_rel if accelerometer else 0.0,
        (
            gauge("breech_pressure", "bore_area"),
            gauge("brake_pressure", "brake_area"),
            gauge("recuperator_pressure", "recuperator_area"),
        ),
        m.u.get("friction", 0.0),
    )


def camera_scale(camera: Channel | None, alignment: ClockAlignment | None) -> CameraScale | None:
    """Return what the camera says of the accelerometer; None unless it was aligned by motion without doubt."""
    if camera is None or alignment is None or alignment.status != "ok" or not alignment.details:
        return None
    d = alignment.details
    if "u_bias_m_s2" not in d:
        return None
    constant = float(d["integration_constants"][2])
    return CameraScale.of_constant(
        d["gain"], d["u_gain"], constant, d["u_bias_m_s2"], d["gain_bias_correlation"], camera.u_rel
    )


def filmed(
    signals: Signals, acceleration_m_s2: Array, camera: Channel | None, alignment: ClockAlignment | None
) -> Filmed | None:
    """Return the motion as camera and accelerometers recorded it; None where `camera_scale` has none.

    Parameters
    ----------
    signals : Signals
    acceleration_m_s2 : ndarray, shape (n,)
        Second derivative of the travel by the accelerometers, on the grid.
    camera : Channel or None
        Displacement, without the delay of its chain.
    alignment : ClockAlignment or None
    """
    if camera is None or alignment is None or camera_scale(camera, alignment) is None or not alignment.details:
        return None
    d = alignment.details
    integral = DoubleIntegral.of(acceleration_m_s2, signals.start_s, signals.step_s)
    motion = filmed_motion(
        alignment.to_reference(camera.time_base.times_s),
        np.asarray(camera.samples, dtype=np.float64),
        integral,
        gain=d["gain"],
        marker_sigma_m=d["marker_sigma_m"],
        u_offset_s=alignment.u_offset_s,
        u_bias_m_s2=math.inf,  # the silence has its say where the mass is found
    )
    quietest = d["acceleration_density"] / d["noise_inflation"]
    return Filmed(motion, tuple(quietest * inflation for inflation in INFLATIONS), camera.u_rel)


def _cutoff(options: Options, shot: Shot) -> float:
    """Return the cut-off asked for, or the default, lowered where a slowly sampled force could not follow it."""
    if options.cutoff_hz is not None:
        return options.cutoff_hz
    rates = [
        c.time_base.rate_hz
        for c in shot.channels.values()
        if c.role in ("recoil_acceleration", "breech_pressure", "brake_pressure", "recuperator_pressure")
    ]
    return min([DEFAULT_CUTOFF_HZ, *(0.2 * rate for rate in rates if math.isfinite(rate))])


def _result(
    estimate: MassEstimate, regression: Regression, calibration: Calibration, options: Options, rig: Rig
) -> Result:
    if estimate.method == "calibrated":
        acceleration, force = calibration.correct(regression)
    else:
        acceleration, force = regression.acceleration_m_s2, regression.force_n
    systematic = math.hypot(*(r.u_kg for r in estimate.budget if r.source != RANDOM)) / estimate.mass_kg
    direction: Literal["reverse", "forward"] = "forward" if estimate.method in ("forward", "paper") else "reverse"
    guard = math.inf if estimate.method == "paper" else LARGEST_RELATIVE_U
    trace = mass_trace(
        regression,
        acceleration,
        force,
        options.window_s,
        direction=direction,
        systematic_rel=systematic,
        largest_relative_u=guard,
    )
    m = rig.mechanism
    return Result(
        estimate,
        trace,
        relative_percentage_error(trace.mass_kg, m.m3),
        rpe_interval(trace.mass_kg, m.m3, systematic, m.u.get("m3", 0.0)),
    )
