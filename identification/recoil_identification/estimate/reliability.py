"""How well the uncertainties themselves are known: degrees of freedom of what is not of this shot's statistics.

A certificate may state its own (JCGM 100:2008, G.4.1). What a program takes because a rig does not state it is a guess:
by G.4.2 a standard uncertainty that is known to a share r has ``nu = 1 / (2 r^2)`` degrees of freedom.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace

from recoil_identification.estimate.budget import BudgetRow
from recoil_identification.estimate.mass import MassEstimate, force_scale
from recoil_identification.inference.unknown import Reliability
from recoil_processing.noise import welch_satterthwaite
from recoil_processing.shot.error_source import ErrorSource, SourceKind
from recoil_processing.shot.sensor_scales import BORE_FRICTION, dynamic_scale, of_gauge, scale_uncertainty
from recoil_rigs.rig import Rig
from recoil_rigs.tables.channel_table import ChannelSpec

GUESS_REL = 0.25
"""Share to which the uncertainty is known of what a rig does not state: the figure of JCGM 100:2008, G.4.2, for limits
that somebody of experience sets (8 degrees of freedom)."""


def known_to(u_rel: float) -> float:
    """Return the degrees of freedom of a standard uncertainty that is known to a share (JCGM 100:2008, G.4.2)."""
    return 0.5 * u_rel**-2


GUESS = Reliability(known_to(GUESS_REL), GUESS_REL)
"""Knowledge of the uncertainty of what a rig does not state."""


def reliabilities(rig: Rig) -> Mapping[ErrorSource, Reliability]:
    """Return what is known of the uncertainties of a rig's sources; of one that is left out it is taken as known."""
    return dict(_guessed(rig)) | dict(_certified(rig))


def of_sources(sources: Iterable[ErrorSource], rig: Rig) -> dict[str, Reliability]:
    """Return what is known of the uncertainties of some sources, those left out of which they are taken as known."""
    known = reliabilities(rig)
    return {source: found for source in sources if (found := reliability_of(source, known)) is not None}


def with_reliabilities(estimate: MassEstimate, rig: Rig, *, corrected: bool) -> MassEstimate:
    """State the degrees of freedom of the rows of an estimate's budget that have none of this shot.

    Parameters
    ----------
    corrected
        Whether each part of a scale has a row of its own; in the other methods a gauge's row is of its whole scale.
    """
    known = reliabilities(rig)
    if not corrected:
        known = {**known, **dict(_of_whole_scales(rig, known))}

    def stated(row: BudgetRow) -> BudgetRow:
        found = None if math.isfinite(row.degrees_of_freedom) else reliability_of(row.source, known)
        return row if found is None else replace(row, degrees_of_freedom=found.degrees_of_freedom)

    return replace(estimate, budget=tuple(map(stated, estimate.budget)))


def reliability_of(source: ErrorSource, known: Mapping[ErrorSource, Reliability]) -> Reliability | None:
    """Return what is known of a source's uncertainty; of a source that has several shapes, that of all."""
    return known.get(source) or known.get(ErrorSource(source.kind, source.of)) or known.get(ErrorSource(source.kind))


def _guessed(rig: Rig) -> Iterator[tuple[ErrorSource, Reliability]]:
    """Yield the sources of which the rig states nothing: those that every verdict and report names as assumed."""
    unstated = rig.mechanism.unstated
    for key, sources in (
        ("u_bore_friction", (BORE_FRICTION,)),
        ("u_unread_share", (ErrorSource(SourceKind.UNREAD_SHARE),)),
        ("unread_force", (ErrorSource(SourceKind.UNREAD_FORCE), ErrorSource(SourceKind.UNREAD_SHAPE))),
    ):
        if key in unstated:
            yield from ((source, GUESS) for source in sources)
    for force in rig.forces:
        for spec in force.channels:
            of = force.name if len(force.channels) == 1 else spec.name
            if spec.u_dynamic_rel:  # how much less it tells of a pulse no certificate at rest says
                yield dynamic_scale(of), GUESS
        if any(spec.sensor.u_zero_rel is None for spec in force.channels):
            yield ErrorSource(SourceKind.MOVING_ZERO, force.name), GUESS
        if force.channels and all(spec.u_line_s for spec in force.channels):
            yield ErrorSource(SourceKind.LINE, force.name), GUESS
        if not any(_states_delay(spec) for spec in force.channels):
            yield ErrorSource(SourceKind.DELAY, force.name), GUESS
    camera = rig.by_role("recoil_displacement")
    if camera is not None and camera.sensor.u_distortion_m is None:
        yield ErrorSource(SourceKind.PICTURE), GUESS


def _states_delay(spec: ChannelSpec) -> bool:
    return bool({"delay_s", "u_delay_s"} & spec.sensor.model_fields_set)


def _certified(rig: Rig) -> Iterator[tuple[ErrorSource, Reliability]]:
    """Yield the scales whose sensors' certificates state degrees of freedom."""
    for channel in rig.channels:
        sensor = channel.sensor
        freedom = welch_satterthwaite([(sensor.u_rel, sensor.nu), (sensor.u_gain / sensor.gain, math.inf)])
        if math.isfinite(freedom):
            alone = len(rig.with_role(channel.role)) == 1
            for source in (
                of_gauge(channel.name),
                *((of_gauge(channel.role), force_scale(channel.role)) if alone else ()),
                *((ErrorSource(SourceKind.CAMERA_SCALE),) if channel.role == "recoil_displacement" else ()),
            ):
                yield source, Reliability(freedom)
    for force in rig.forces:  # on a line each force is of its channel, by whose name it goes
        if len(force.channels) == 1 and math.isfinite(nu := force.channels[0].sensor.nu):
            yield force_scale(force.name), Reliability(nu)


def _of_whole_scales(rig: Rig, known: Mapping[ErrorSource, Reliability]) -> Iterator[tuple[ErrorSource, Reliability]]:
    """Yield the forces' scales with all their parts."""
    scales = scale_uncertainty(rig)
    for name, whole in zip(scales.forces, scales.gauges, strict=True):
        parts = scales.parts.get(name, ())
        own = math.sqrt(max(whole**2 - math.fsum(u**2 for _, u in parts), 0.0))
        each = [(force_scale(name), own), *parts]
        found = [(u, one.degrees_of_freedom) for source, u in each if (one := known.get(source)) is not None]
        rest = [(u, math.inf) for source, u in each if source not in known]
        yield force_scale(name), Reliability(welch_satterthwaite([*found, *rest]))
