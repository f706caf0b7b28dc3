"""Forces that the rig file knows beside the certificates of their gauges, as rows of the inference.

The impulse I of projectile and charge is that of the breech's force: with the gauge's scale error g, the shapes h_k in
which its reading may be wrong by sizes c_k, and the error E of what is declared,

    ln(I / integral F dt) = E - g + sum_k c_k (integral h_k dt) / (integral F dt) + noise

from the onset until the bore is empty. A gauge j under a load L that is known reads R, before the day or at rest before
the shot:

    ln(R / L) = e_j - E + noise

with the gauge's own error e_j, which is its force's scale error without the parts of area and bore. Of every E the
inference has the declared uncertainty as a prior, so that the budget has a row of it and its normalised residual is the
check: how far what is declared is off what gauges and motion say together.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from recoil_identification.inference.block import LinearBlock
from recoil_identification.inference.unknown import Prior, Unknown
from recoil_identification.rows.causes import Cause
from recoil_identification.rows.equation_of_motion import gauge
from recoil_identification.rows.sensor_priors import part_of_scale
from recoil_processing.gaps import bridge
from recoil_processing.shot.error_source import ErrorSource, SourceKind
from recoil_processing.shot.gauge_zero import empty_bore_s
from recoil_processing.shot.regression import Regression
from recoil_processing.shot.sensor_scales import of_gauge, scale_uncertainty
from recoil_processing.shot.signals import Signals
from recoil_rigs.rig import Rig
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.tables.knowledge import KnownLoad, ProjectileImpulse

BREECH = "breech_pressure"
OF_READING = (
    SourceKind.ZERO, SourceKind.MOVING_ZERO, SourceKind.REPAIR, SourceKind.LINEARITY, SourceKind.HYSTERESIS,
    SourceKind.GAUGE_AHEAD,
)  # fmt: skip
"""Kinds of causes that are errors of a gauge's reading, which an impulse sums up."""
INTEGRATION = 2e-4
"""Relative standard uncertainty of an impulse by its samples."""
OF_FORCE = (SourceKind.AREA, SourceKind.BORE_FRICTION, SourceKind.DYNAMIC_SCALE)
"""Kinds of the parts of a force's scale that are none of what its gauge reads of a load at rest."""


@dataclass(frozen=True)
class Declared:
    """Value that is declared of a force, beside what its gauge reads.

    Attributes
    ----------
    source
        Source of its prior.
    against
        Channel, or force, that it is compared with.
    value, u, read
        Declared value, its standard uncertainty, and what the gauge reads, in `unit`.
    unit
        Unit of these.
    """

    source: ErrorSource
    against: str
    value: float
    u: float
    read: float
    unit: str


@dataclass(frozen=True)
class KnownForces:
    """Rows of what is declared, the unknowns that only these have, and what is known of them."""

    declared: tuple[Declared, ...] = ()
    rows: tuple[LinearBlock, ...] = ()
    unknowns: tuple[Unknown, ...] = ()
    priors: tuple[Prior, ...] = ()

    def joined(self, other: KnownForces) -> KnownForces:
        """Put two together."""
        return KnownForces(
            (*self.declared, *other.declared),
            (*self.rows, *other.rows),
            (*self.unknowns, *other.unknowns),
            (*self.priors, *other.priors),
        )


IMPULSE = ErrorSource(SourceKind.KNOWN_IMPULSE, BREECH)
"""Source of the declared impulse of projectile and charge."""


def is_declared(source: str) -> bool:
    """Return whether a source is what the rig file declares of a force."""
    kinds = (SourceKind.KNOWN_IMPULSE, SourceKind.KNOWN_LOAD)
    return isinstance(source, ErrorSource) and source.kind in kinds


def declared_sources(rig: Rig) -> Mapping[ErrorSource, tuple[float, float]]:
    """Return by how much each thing that a rig file declares of its forces may be off, relative standard uncertainties.

    Returns
    -------
    Mapping of ErrorSource to (float, float)
        Part that is the same in all shots of the rig, and part that each shot has of its own.
    """
    found = {_of_load(one): (one.u_known / abs(one.known), 0.0) for one in rig.knowledge.load}
    if (projectile := rig.knowledge.projectile) is not None:
        found[IMPULSE] = (projectile.u_common_rel, projectile.u_own_rel)
    return found


def declared_source(identity: str) -> ErrorSource | None:
    """Return what a rig declares of a force whose name ends an identity in summaries; None where it is none of that."""
    if identity.endswith(f":{IMPULSE}"):
        return IMPULSE
    _, mark, channel = identity.partition(f":{ErrorSource(SourceKind.KNOWN_LOAD)}")
    return ErrorSource(SourceKind.KNOWN_LOAD, channel) if mark else None


def _of_load(load: KnownLoad) -> ErrorSource:
    return ErrorSource(SourceKind.KNOWN_LOAD, load.channel)


def declared_too_large(source: ErrorSource) -> Unknown:
    """Return the logarithm of what is declared over what is true, by its source."""
    return Unknown(f"ln {source}", scope="rig")


def known_forces(signals: Signals, fired: FiredShot, regression: Regression, causes: Sequence[Cause]) -> KnownForces:
    """Compare what the rig file declares of forces with what their gauges read; what a shot lacks is left out.

    Parameters
    ----------
    regression
        Regression whose grid and filter the causes have.
    causes
        Causes, of which those of the breech gauge's reading are unknowns of its impulse.
    """
    found, rig = KnownForces(), fired.rig
    if (projectile := rig.knowledge.projectile) is not None:
        found = found.joined(_impulse(projectile, signals, rig, regression, causes))
    for load in rig.knowledge.load:
        found = found.joined(_load(load, signals, rig))
    return found


def _impulse(
    projectile: ProjectileImpulse, signals: Signals, rig: Rig, regression: Regression, causes: Sequence[Cause]
) -> KnownForces:
    """Compare the impulse of projectile and charge with that of the breech gauge."""
    reading, times = signals.series.get(BREECH), signals.times_s
    if reading is None:
        return KnownForces()
    end_s = empty_bore_s(times, reading, regression.interval_s)
    inside = (times >= regression.interval_s[0]) & (times <= end_s)
    if not math.isfinite(end_s) or end_s > times[-1] or np.isnan(reading[inside]).any():
        return KnownForces()
    names = [force.name for force in rig.forces]
    per_reading = rig.force(BREECH).per_reading
    impulse_n_s = float(np.sum(bridge(reading, otherwise=0.0)[inside])) * signals.step_s * per_reading
    if not impulse_n_s > 0:
        return KnownForces()
    column = names.index(BREECH)
    wrong = {
        one.source: float(np.sum(one.forces_n[inside, column])) * regression.step_s / impulse_n_s
        for one in causes
        if one.source.kind in OF_READING and one.source.of == BREECH
    }
    noise = signals.offsets[BREECH].noise * math.sqrt(int(np.count_nonzero(inside))) * signals.step_s * per_reading
    off = declared_too_large(IMPULSE)
    rows = LinearBlock(
        (off.name, gauge(BREECH).name, *wrong),
        np.array([[1.0, -1.0, *wrong.values()]]),
        np.array([math.log(projectile.impulse_n_s / impulse_n_s)]),
        math.hypot(INTEGRATION, noise / impulse_n_s),
    )
    u_n_s = projectile.impulse_n_s * projectile.u_rel
    said = Declared(IMPULSE, BREECH, projectile.impulse_n_s, u_n_s, impulse_n_s, "N s")
    return KnownForces((said,), (rows,), (off,), (Prior.of(IMPULSE, off.name, projectile.u_rel),))


def _load(load: KnownLoad, signals: Signals, rig: Rig) -> KnownForces:
    """Compare a load that is known with what its gauge reads."""
    spec = rig.channel(load.channel)
    force = next((one for one in rig.forces if any(c.name == load.channel for c in one.channels)), None)
    if force is None or force.name not in signals.series:
        return KnownForces()
    read, noise = load.read, 0.0
    if read is None:
        of_gauges = {one.channel: one.samples for one in signals.gauges.get(force.name, ())}
        rest = of_gauges.get(load.channel, signals.series[force.name])[signals.in_baseline]
        rest = rest[np.isfinite(rest)]
        if not rest.size:
            return KnownForces()
        si = 1.0 if spec.own_unit is None else spec.own_unit.to_si(1.0) - spec.own_unit.to_si(0.0)
        read, noise = float(np.mean(rest)) / si, float(np.std(rest)) / si / math.sqrt(rest.size)
    if not read / load.known > 0:
        return KnownForces()
    source = _of_load(load)
    off, u_rel = declared_too_large(source), load.u_known / abs(load.known)
    own = _own_error(rig, force.name, load.channel)
    rows = LinearBlock(
        (off.name, *own),
        np.array([[-1.0, *own.values()]]),
        np.array([math.log(read / load.known)]),
        math.hypot(INTEGRATION, noise / read),
    )
    unit = spec.own_unit_name or ("Pa" if spec.quantity == "pressure" else "N")
    said = Declared(source, load.channel, load.known, load.u_known, read, unit)
    return KnownForces((said,), (rows,), (off,), (Prior.of(source, off.name, u_rel),))


def _own_error(rig: Rig, force: str, channel: str) -> dict[str, float]:
    """Return what a gauge's own error is of the unknowns, each with its factor."""
    parts = scale_uncertainty(rig).parts.get(force, ())
    of_channel = part_of_scale(of_gauge(channel)).name
    if (count := len(rig.force(force).channels)) > 1:
        # the part of a gauge is what the mean of all has of it; a standard that it shares is off besides
        reference = rig.channel(channel).sensor.reference
        standards = {
            part_of_scale(part).name: _share_of_standard(rig, force, reference, channel)
            for part, _ in parts
            if part.kind is SourceKind.STANDARD and part.of == reference
        }
        return {of_channel: float(count), **standards}
    return {gauge(force).name: 1.0, **{part_of_scale(part).name: -1.0 for part, _ in parts if part.kind in OF_FORCE}}


def _share_of_standard(rig: Rig, force: str, reference: str, channel: str) -> float:
    """Return what a gauge has of its standard's error, over what the mean of all has."""
    sensors = [one.sensor for one in rig.force(force).channels if one.sensor.reference == reference]
    whole = math.fsum(sensor.u_reference_rel for sensor in sensors) / len(rig.force(force).channels)
    return rig.channel(channel).sensor.u_reference_rel / whole
