"""The breech chain: what lies between the pressure that drives the part and its gauge, and what lets go at the muzzle.

A gauge whose line is bent, or that sits ahead of the breech face, reads another curve than the pressure that drives; a
muzzle brake takes from the force once the projectile is out; a tube that rings along its axis moves the sensor at the
breech. All of them are there while the breech drives, and gone when the brake holds, as the effect of a mass would be
that changes early. Each is a shape of known form and unknown size (`recoil_identification.rows.causes`):

===============  =====================================================================================
linearity        ``FS 2 z (1 - z)``, ``z = p / FS`` with the full scale FS
hysteresis       ``FS y (1 - y)``, ``y = p / p_max``, as the pressure falls behind its peak
gauge ahead      ``-p (L0 / (L0 + x_p))^2``: the gas between face and gauge is accelerated, too; with the
                 chamber's length L0 and the projectile's travel x_p, the integral of the integral of
                 ``P / m_p`` (J. Corner, Theory of the Interior Ballistics of Guns, 1950)
muzzle brake     ``-P (1 - exp(-(t - t_e) / 0.3 ms))`` from the projectile's exit t_e on
tube             ``2 F'' / w^2`` beside the whole force F: the breech end of a rod of even section, whose
                 first mode along its axis lies at w, far above the motion
===============  =====================================================================================

Where a rig states none of them they are no unknowns, and a shot may be asked for them instead
(`recoil_identification.rows.suspects`).
"""

from __future__ import annotations

import math

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_identification.inference.unknown import Scope
from recoil_identification.rows.causes import MOST_OF_RATE, SLOPE_HZ, Cause, filtered_columns
from recoil_processing.filters import LowPass
from recoil_processing.gaps import bridge
from recoil_processing.shot.error_source import ErrorSource, SourceKind
from recoil_processing.shot.projectile import muzzle_force_n, projectile_travel_m
from recoil_processing.shot.regression import Regression
from recoil_processing.shot.signals import Signals
from recoil_rigs.rig import ChannelSpec, Rig
from recoil_rigs.tables.channel_table import range_si
from recoil_rigs.tables.force_input import ForceInput
from recoil_rigs.tables.rig_tables import GAUGE_ROLES

BREECH = GAUGE_ROLES[0]
OF_CHAIN = (
    SourceKind.LINEARITY,
    SourceKind.HYSTERESIS,
    SourceKind.GAUGE_AHEAD,
    SourceKind.MUZZLE_BRAKE,
    SourceKind.TUBE,
)
"""Kinds of its sources."""
MUZZLE_BRAKE = ErrorSource(SourceKind.MUZZLE_BRAKE)
TUBE = ErrorSource(SourceKind.TUBE)
"""Sources that are one of a rig each."""
U_TUBE = 1.0
"""Standard uncertainty of the tube's size, share of what a rod of even section has: it is thick at its breech."""


def linearity_of(role: str) -> ErrorSource:
    """Return the source that is the bent line of a gauge."""
    return ErrorSource(SourceKind.LINEARITY, role)


def hysteresis_of(role: str) -> ErrorSource:
    """Return the source that is what a gauge reads otherwise as the pressure falls."""
    return ErrorSource(SourceKind.HYSTERESIS, role)


def gauge_ahead_of(role: str) -> ErrorSource:
    """Return the source that is the pressure between the breech face and a gauge that sits ahead of it."""
    return ErrorSource(SourceKind.GAUGE_AHEAD, role)


def chain_source(name: str) -> ErrorSource | None:
    """Return the source that bears a name; None where it is none of the breech chain."""
    for kind in OF_CHAIN:
        ends = ErrorSource(kind).strip()
        if name.endswith(ends) and (found := ErrorSource(kind, name.removesuffix(ends).strip())) == name:
            return found
    return None


def bent_reading_pa(reading_pa: Array, full_pa: float) -> tuple[Array, Array]:
    """Return by how much a gauge reads too much whose line is bent, and whose reading lags as the pressure falls.

    For a size of one, each of shape (n,): half of full scale in the middle of the line, a quarter of it at half of the
    peak behind that.
    """
    z, peak = reading_pa / full_pa, int(np.argmax(reading_pa))
    y = reading_pa / max(float(reading_pa[peak]), 1e-300)
    falls = np.arange(y.size) > peak
    return np.asarray(full_pa * 2.0 * z * (1.0 - z)), np.asarray(full_pa * y * (1.0 - y) * falls)


def gradient_n(breech_force_n: Array, travel_m: Array, chamber_length_m: float) -> Array:
    """Return by how much a gauge at the chamber's mouth reads too little, of a size of one; shape (n,)."""
    return np.asarray(breech_force_n * (chamber_length_m / (chamber_length_m + travel_m)) ** 2)


def chain_causes(regression: Regression, recorded: Regression, signals: Signals, rig: Rig) -> tuple[Cause, ...]:
    """List what the rig states that the breech chain may be off by; empty where it states nothing.

    Parameters
    ----------
    regression, recorded
        Regressions behind the filter and before it.
    signals, rig
        Readings of the gauges, and what the rig states of them, of the projectile and of the tube.
    """
    columns: list[tuple[ErrorSource, ForceInput, float, Scope, Array]] = []
    breech_n = breech_force_n(recorded, signals, rig)
    for force in rig.forces:
        reading = signals.series.get(force.name)
        if reading is None:
            continue
        reading_pa = bridge(reading, otherwise=0.0)
        for spec in force.channels:
            # of the mean of several gauges each has its part
            of, part = force.name if len(force.channels) == 1 else spec.name, 1.0 / len(force.channels)
            u_rel, ahead = spec.sensor.u_linearity_rel, spec.sensor.gauge_ahead
            if u_rel:
                bent = bent_reading_pa(reading_pa, full_scale_pa(spec, reading_pa))
                for source, error_pa in zip((linearity_of(of), hysteresis_of(of)), bent, strict=True):
                    columns.append((source, force, u_rel, "sensor", part * force_read_n(force, error_pa, recorded)))
            if ahead is not None and ahead.u_share:
                travel_m = projectile_travel_m(breech_n, recorded.step_s, ahead.projectile_mass_kg)
                lacks_n = gradient_n(breech_n, travel_m, ahead.chamber_length_m)
                columns.append((gauge_ahead_of(of), force, ahead.u_share, "sensor", part * lacks_n))
    u_muzzle, breech = rig.mechanism.u.get("muzzle_brake", 0.0), breech_of(rig)
    if u_muzzle and breech is not None:
        takes_n = -muzzle_force_n(breech_n, recorded.step_s, rig.mechanism)
        columns.append((MUZZLE_BRAKE, breech, u_muzzle, "rig", takes_n))
    unmoved = np.zeros(recorded.times_s.size)
    behind = filtered_columns(regression, np.column_stack([error for *_, error in columns])).T if columns else ()
    found = [
        Cause(source, "1", u, "B", in_column(regression, force.name, error_n), unmoved, scope=scope)
        for (source, force, u, scope, _), error_n in zip(columns, behind, strict=True)
    ]
    tube_hz = rig.mechanism.tube_axial_hz
    if tube_hz:
        shape = 2.0 * curvature_n_s2(regression) / (2.0 * math.pi * tube_hz) ** 2
        found.append(
            Cause(TUBE, "1", U_TUBE, "B", in_column(regression, regression.gauges[0], shape), unmoved, scope="rig")
        )
    return tuple(found)


def curvature_n_s2(regression: Regression) -> Array:
    """Return the second derivative of the force behind the regression's filter, N/s^2, shape (n,).

    Recorded forces pass a low-pass first, for their noise has no curvature.
    """
    force_n = bridge(regression.force_n, otherwise=0.0)
    if regression.table is None and MOST_OF_RATE * regression.rate_hz > SLOPE_HZ:
        force_n = LowPass(SLOPE_HZ).apply(force_n, regression.rate_hz)
    return np.asarray(np.gradient(np.gradient(force_n, regression.step_s), regression.step_s))


def in_column(regression: Regression, gauge: str, error_n: Array) -> Array:
    """Put an error of one gauge's force in its column, shape (n, n_gauges)."""
    found = np.zeros((error_n.size, len(regression.gauges)))
    found[:, regression.gauges.index(gauge)] = error_n
    return found


def breech_of(rig: Rig) -> ForceInput | None:
    """Return the force of the breech pressure; None where nothing reads one."""
    return next((force for force in rig.forces if force.role == BREECH), None)


def breech_force_n(recorded: Regression, signals: Signals, rig: Rig) -> Array:
    """Return the breech force where the part is free, nothing of it taken off at the muzzle; none without a gauge."""
    reading, breech = signals.series.get(BREECH), breech_of(rig)
    if reading is None or breech is None:
        return np.zeros(recorded.times_s.size)
    return np.asarray(breech.per_reading * bridge(reading, otherwise=0.0) * recorded.released)


def force_read_n(force: ForceInput, error_pa: Array, recorded: Regression) -> Array:
    """Return by how much too little a pressure's force is where the part is free, for what its gauge reads too much."""
    return np.asarray(-force.sign * force.per_reading * error_pa * recorded.released)


def full_scale_pa(spec: ChannelSpec, reading_pa: Array) -> float:
    """Return the full scale of a gauge: of its range, or what it reads where none is declared."""
    return max(map(abs, range_si(spec) or (0.0, float(np.max(np.abs(reading_pa), initial=0.0)))))
