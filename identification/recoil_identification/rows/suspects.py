"""Shapes that a rig does not state and a shot may be asked for, each of known form and unknown size.

Beside the shapes of the breech chain (`recoil_identification.rows.breech_chain`), with what nobody stated taken at
several values:

==================  ==================================================================================
part that hangs     ``F - H F`` beside the force, ``H = (2 z w s + w^2) / (s^2 + 2 z w s + w^2)``: it
                    swings with w and the damping z, and the rest of the mass does not feel it where it
                    moves otherwise (C. M. Harris, A. G. Piersol, Harris' Shock and Vibration Handbook,
                    base excitation)
breakaway           ``exp(-(v / v_0)^2)`` of the friction's direction: packings grip harder near to rest (B.
                    Armstrong-Helouvry et al., Automatica 30(7), 1994)
time constant       the integral of a reading, per second of an amplifier's time constant that nobody
                    declared: of ``y = s tau / (s tau + 1) x`` is ``x = y + y / (s tau)``
==================  ==================================================================================

The force F that the mass follows stands in its own column, noise and all; H passes next to nothing of that.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_identification.rows.breech_chain import (
    BREECH,
    MUZZLE_BRAKE,
    TUBE,
    U_TUBE,
    bent_reading_pa,
    breech_force_n,
    breech_of,
    curvature_n_s2,
    force_read_n,
    full_scale_pa,
    gauge_ahead_of,
    gradient_n,
    in_column,
    linearity_of,
)
from recoil_identification.rows.causes import Cause, filtered_columns
from recoil_identification.rows.late_readings import late_readings
from recoil_processing.double_integral import integrate
from recoil_processing.gaps import bridge
from recoil_processing.shot.error_source import ErrorSource, SourceKind
from recoil_processing.shot.projectile import projectile_travel_m, risen_behind
from recoil_processing.shot.regression import Regression
from recoil_processing.shot.signals import Signals
from recoil_rigs.rig import Rig

HANGING = ErrorSource(SourceKind.HANGING_PART)
"""Source that is a part of the recoiling mass which hangs on it elastically."""
BREAKAWAY = ErrorSource(SourceKind.BREAKAWAY)
"""Source that is a friction which is larger near to rest."""
SUSPECTED_LINEARITY, SUSPECTED_SHARE, SUSPECTED_MUZZLE = 0.01, 0.05, 0.2
SUSPECTED_HANGING, SUSPECTED_PER_S, SUSPECTED_FRICTIONS = 0.015, 2.0, 1.0
"""Standard deviations of the sizes of what is suspected, if it is there; of a friction in what the rig declares."""
PULSE_ENDS = 0.1
"""Share of the peak to which the breech pressure has fallen when the projectile is taken to have left."""
SUSPECTED_TRAVELS = (2.5, 4.0, 6.5, 10.0, 15.0, 24.0)
"""Travels of the projectile up to then, in lengths of the chamber, at which a gauge ahead is suspected: of a pressure
that reaches the gauge's full scale, so that a chamber is as long in shots of every charge."""
SUSPECTED_EXITS = (0.03, 0.06, 0.11, 0.18, 0.28, 0.42, 0.6)
"""Shares of that travel at which the projectile is suspected to leave."""
SUSPECTED_HZ = 500.0
"""Frequency of a tube or a bracket that is suspected: its shape is one for all."""
HANGING_HZ, HANGING_DAMPING = (9.0, 13.0, 19.0, 28.0, 42.0), (0.08, 0.2, 0.45)
"""Frequencies and dampings at which a part is suspected to hang."""
BREAKS_AWAY_M_S = (0.1, 0.3, 1.0)
"""Speeds up to which a friction is suspected to be larger."""
MAY_DROOP = ("breech_pressure", "brake_pressure")
"""Gauges whose amplifier may have a time constant that nobody declared: they read nothing before the shot, so that
nothing shows it there."""


BESIDE, MOTION = "beside", "motion"
"""Where a shape acts that is of no gauge: beside the forces, and in what measured the motion."""


@dataclass(frozen=True, eq=False)
class Suspect(ReadOnlyArrays):
    """A shape that the rig does not state, and how large it would be.

    Attributes
    ----------
    source
        Source that it would be.
    u
        Standard deviation of its size if there is one.
    shapes : ndarray, shape (n_variants, n)
        Effect of a size of one, for each value of what nobody stated, on the regression's grid and behind its filter:
        how much too little the force of a gauge reads, N; what acts beside the forces, N; or what the accelerometer
        reads too much, m/s^2.
    where
        Name of the force whose gauge it is; ``beside`` or ``motion``.
    variants
        Value that was taken for each shape, in words.
    unit
        Unit of its size.
    positive
        Whether its size cannot be negative.
    late : ndarray, shape (n_late,), optional
        Amount that a size of one adds to the late readings of the breech gauge, Pa.
    """

    source: ErrorSource
    u: float
    shapes: Array
    where: str
    variants: tuple[str, ...]
    unit: str = "1"
    positive: bool = False
    late: Array | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Name of each of its shapes, the same in all shots of a rig."""
        return tuple(f"suspected {self.source}: {variant}".rstrip(": ") for variant in self.variants)

    def cause(self, regression: Regression, variant: int, source: ErrorSource | None = None) -> Cause:
        """Return one of its shapes as a further error of a shot's rows, by its source or by another name."""
        shape, source = self.shapes[variant], source or self.source
        none, unmoved = np.zeros((shape.size, len(regression.gauges))), np.zeros(shape.size)
        if self.where == BESIDE:
            return Cause(source, self.unit, self.u, "B", none, unmoved, scope="rig", beside_n=shape)
        if self.where == MOTION:
            return Cause(source, self.unit, self.u, "B", none, shape, scope="sensor")
        columns = in_column(regression, self.where, shape)
        return Cause(source, self.unit, self.u, "B", columns, unmoved, scope="sensor")


def columns_of(regression: Regression, suspects: Sequence[Suspect]) -> tuple[tuple[Cause, ...], Mapping[str, Array]]:
    """Return all shapes as errors of a shot's rows, each by a name of its own, and what each adds to late readings."""
    causes, late = list[Cause](), dict[str, Array]()
    for suspect in suspects:
        for at, name in enumerate(suspect.names):
            source = ErrorSource(SourceKind.CHOICE, detail=name)
            causes.append(suspect.cause(regression, at, source))
            if suspect.late is not None:
                late[source] = suspect.late
    return tuple(causes), late


def droop_of(role: str) -> ErrorSource:
    """Return the source that is the time constant of a sensor's amplifier, by its role or force."""
    return ErrorSource(SourceKind.TIME_CONSTANT, role)


def suspects(
    regression: Regression, recorded: Regression, signals: Signals, rig: Rig, causes: Sequence[Cause]
) -> tuple[Suspect, ...]:
    """List the shapes that the rig does not state; none where no gauge reads the breech pressure.

    Parameters
    ----------
    regression, recorded
        Regressions behind the filter and before it.
    signals, rig
        Readings of the gauges, and what the rig states of them, of the projectile and of the tube.
    causes
        Causes of the shot's rows.
    """
    reading, breech = signals.series.get(BREECH), breech_of(rig)
    breech_n = np.maximum(breech_force_n(recorded, signals, rig), 0.0)
    if reading is None or breech is None or not breech_n.any():
        return ()
    step_s, peak = recorded.step_s, int(np.argmax(breech_n))
    sensors = [spec.sensor for spec in breech.channels]
    found: list[tuple[ErrorSource, float, dict[str, Array], bool]] = []
    reading_pa = bridge(reading, otherwise=0.0)
    full_pa = float(np.mean([full_scale_pa(spec, reading_pa) for spec in breech.channels]))
    if all(sensor.u_linearity_rel is None for sensor in sensors):
        bent, lags = bent_reading_pa(reading_pa, full_pa)
        errors_pa = {"bent": bent, "lagging": lags, "bent and lagging": bent + lags}
        shapes = {name: force_read_n(breech, error_pa, recorded) for name, error_pa in errors_pa.items()}
        found.append((linearity_of(BREECH), SUSPECTED_LINEARITY, shapes, False))
    free_m = projectile_travel_m(breech_n, step_s, 1.0)
    ends_m = free_m[_falls_to(breech_n, peak, PULSE_ENDS)] * full_pa / float(np.max(reading_pa))
    if all(sensor.gauge_ahead is None for sensor in sensors):
        shapes = {f"{travels:g}": gradient_n(breech_n, free_m, ends_m / travels) for travels in SUSPECTED_TRAVELS}
        found.append((gauge_ahead_of(BREECH), SUSPECTED_SHARE, shapes, True))
    if {"muzzle_brake", "u_muzzle_brake"} <= rig.mechanism.unstated:
        exits = {share: float(np.interp(share * ends_m, free_m, recorded.times_s)) for share in SUSPECTED_EXITS}
        shapes = {f"{share:g}": -breech_n * risen_behind(recorded.times_s, at_s) for share, at_s in exits.items()}
        found.append((MUZZLE_BRAKE, SUSPECTED_MUZZLE, shapes, True))
    behind = [
        Suspect(
            source, u, filtered_columns(regression, np.column_stack([*shapes.values()])).T, BREECH, (*shapes,),
            positive=positive,
        )
        for source, u, shapes, positive in found
    ]  # fmt: skip
    if not rig.mechanism.tube_axial_hz:
        shape = 2.0 * curvature_n_s2(regression) / (2.0 * math.pi * SUSPECTED_HZ) ** 2
        behind.append(Suspect(TUBE, U_TUBE, shape[np.newaxis], BREECH, (f"{SUSPECTED_HZ:g} Hz",)))
    behind.append(_hanging(regression))
    if rig.mechanism.friction:
        behind.append(_breaking_away(regression, recorded, SUSPECTED_FRICTIONS * rig.mechanism.friction))
    late = late_readings(signals, regression.interval_s, causes)
    behind += _drooping(regression, rig, None if late is None else -late.drooped_pa_s)
    return tuple(behind)


def _hanging(regression: Regression) -> Suspect:
    """Return the part that hangs, over frequency and damping."""
    force_n = bridge(regression.force_n, otherwise=0.0)
    variants = [(hz, damping) for hz in HANGING_HZ for damping in HANGING_DAMPING]
    shapes = [force_n - followed(force_n, regression.step_s, hz, damping) for hz, damping in variants]
    named = tuple(f"{hz:g} Hz, damping {damping:g}" for hz, damping in variants)
    return Suspect(HANGING, SUSPECTED_HANGING, np.array(shapes), BESIDE, named, positive=True)


def _breaking_away(regression: Regression, recorded: Regression, friction_n: float) -> Suspect:
    """Return the friction that is larger near to rest."""
    speed_m_s = integrate(bridge(recorded.acceleration_m_s2, otherwise=0.0), recorded.step_s)
    shapes = [recorded.friction_direction * np.exp(-((speed_m_s / slow_m_s) ** 2)) for slow_m_s in BREAKS_AWAY_M_S]
    named = tuple(f"{slow_m_s:g} m/s" for slow_m_s in BREAKS_AWAY_M_S)
    filtered = filtered_columns(regression, np.column_stack(shapes)).T
    return Suspect(BREAKAWAY, friction_n, filtered, BESIDE, named, "N", positive=True)


def followed(force_n: Array, step_s: float, hz: float, damping: float) -> Array:
    """Return what of a force a part that hangs on the rest follows, shape (n,); settled at the start."""
    from scipy.signal import bilinear, lfilter

    w = 2.0 * math.pi * hz
    numerator, denominator = bilinear([2.0 * damping * w, w**2], [1.0, 2.0 * damping * w, w**2], 1.0 / step_s)
    return np.asarray(force_n[0] + lfilter(numerator, denominator, force_n - force_n[0]))


def _drooping(regression: Regression, rig: Rig, late: Array | None) -> list[Suspect]:
    """Return the time constants that amplifiers may have beside what the rig states of them."""
    found = []
    for force in rig.forces:
        if force.role in MAY_DROOP and force.name in regression.gauges:
            column = bridge(regression.forces_n[:, regression.gauges.index(force.name)], otherwise=0.0)
            shape = integrate(column, regression.step_s)[np.newaxis]
            of_late = late if force.role == BREECH else None
            found.append(Suspect(droop_of(force.name), SUSPECTED_PER_S, shape, force.name, ("",), "1/s", True, of_late))
    if regression.motion_role == "recoil_acceleration":
        shape = -integrate(bridge(regression.acceleration_m_s2, otherwise=0.0), regression.step_s)[np.newaxis]
        found.append(Suspect(droop_of(regression.motion_role), SUSPECTED_PER_S, shape, MOTION, ("",), "1/s", True))
    return found


def _falls_to(pressure: Array, peak: int, share: float) -> int:
    """Return the first sample behind the peak at which a pressure has fallen to a share of it; the last if never."""
    below = np.flatnonzero(pressure[peak:] < share * pressure[peak])
    return peak + int(below[0]) if below.size else pressure.size - 1
