"""A shot's own information on mass and scales, for what combines many shots of a rig.

The likelihood of a shot about what other shots share is kept as a triangle, without any certificate in it, so that
each certificate counts once however many shots there are. What is the shot's alone, its zeros, its clocks and the
alignment of its camera, is taken out by an orthogonal reduction: the shot's own columns first, and what is left below
them is about the shared ones (G. J. Bierman, Factorization Methods for Discrete Sequential Estimation, 1977).

The resistance that no gauge reads is one rig's: what each shot alone cannot tell from its gauges, many shots can, of
several charges and with a mass added. A drift of the mass within the shot, and steps of it at some instants, are
parameters too, of which nothing is known beforehand: they are zero unless many shots are asked for them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_identification.calibration.calibration import Calibration
from recoil_identification.calibration.mass_over_time import TRIMMED, steps_behind
from recoil_identification.calibration.solution import BESIDE
from recoil_identification.estimate.mass import force_scale
from recoil_identification.estimate.reliability import reliabilities, reliability_of
from recoil_identification.inference.unknown import Prior
from recoil_identification.rows import equation_of_motion as motion
from recoil_identification.rows.breech_chain import OF_CHAIN
from recoil_identification.rows.camera_rows import OTHER
from recoil_identification.rows.causes import DISTORTIONS, Cause, known_delays
from recoil_identification.rows.known_forces import declared_sources, declared_too_large
from recoil_identification.rows.sensor_priors import CAMERA_SCALE, RELEASE
from recoil_identification.rows.suspects import Suspect, columns_of
from recoil_identification.rows.unread_resistance import SHARE, SLIDE
from recoil_identification.shot.shared_identity import (
    OF_DYNAMIC,
    OF_RIG,
    OF_SENSOR,
    OF_SHAPE,
    OF_STANDARD,
    source_of,
)
from recoil_processing.shot.error_source import ErrorSource, SourceKind
from recoil_processing.shot.regression import Regression
from recoil_processing.shot.sensor_scales import dynamic_scale, of_gauge
from recoil_rigs.mechanism.model import Mechanism
from recoil_rigs.rig import ChannelSpec, Rig
from recoil_rigs.tables.force_input import ForceInput
from recoil_rigs.tables.rig_tables import FORCE_ROLES

SCHEMA = 1
LN_MASS, FRICTION_SHARE, FRICTION_N, LN_ACCELERATION = "ln mass", "friction share", "friction", "ln recoil_acceleration"
"""Names of parameters; a gauge's is ``ln`` and its role."""
UNREAD_SHARE, SLIDE_FRICTION, UNREAD_FORCE = "unread share", "slide friction", "unread force"
"""Names of what no gauge reads; that of a shape of the force is followed by its number."""
LN_MASS_DRIFT = "drift of ln mass"
"""Name of the drift of the mass's logarithm over the travel."""
STEPS_AT = tuple(np.linspace(TRIMMED[0], 1.0 - TRIMMED[1], 12).round(3).tolist())
"""Shares of the travel's time at which the mass may step."""
MOST_LN_KG = 30.0
"""Logarithm of a mass in kg beyond which it is none."""
OF_A_SHOT = ("m3", "carried_mass", "phi10", "phi20")
"""Values of the mechanism that are no geometry: what is compared with the mass, and how the stand was laid."""


def ln_mass_step(share: float) -> str:
    """Return the name of a step of the mass's logarithm at a share of the travel's time."""
    return f"step of ln mass at {share:g}"


@dataclass(frozen=True)
class Suspected:
    """A shape that the rig does not state, see `recoil_identification.rows.suspects`.

    Attributes
    ----------
    source, gauge, variant
        Source that it would be, the serial number of the gauge that it is of, and what was taken of what nobody
        stated, in words; empty where there is none.
    u
        Standard deviation of its size if there is one.
    positive
        Whether its size cannot be negative.
    """

    source: ErrorSource
    gauge: str
    variant: str
    u: float
    positive: bool

    @property
    def kind(self) -> str:
        """Name of all shapes of one source: another gauge has another line."""
        return f"{self.gauge} {self.source}".strip()

    @property
    def name(self) -> str:
        """Name of the parameter that is its size."""
        return f"suspected {self.kind}: {self.variant}".rstrip(": ")

    @classmethod
    def of_json(cls, stated: Mapping[str, Any] | None) -> Suspected | None:
        """Read it from a report that has it."""
        if stated is None:
            return None
        kind = next((one for one in SourceKind if one.value == stated["kind"]), None)
        if kind is None:
            raise ValueError(f"a suspected {stated['kind']!r}, of no kind that is known")
        source = ErrorSource(kind, str(stated["of"]))
        found = cls(source, str(stated["gauge"]), str(stated["variant"]), float(stated["u"]), bool(stated["positive"]))
        if not (math.isfinite(found.u) and found.u > 0):
            raise ValueError(f"a suspected {source} of a size of {found.u}")
        return found

    def to_json(self) -> dict[str, Any]:
        """Return it as the report has it."""
        of_source = {"kind": self.source.kind.value, "of": self.source.of, "gauge": self.gauge}
        return {**of_source, "variant": self.variant, "u": self.u, "positive": self.positive}


@dataclass(frozen=True)
class Parameter:
    """One of the shared unknowns.

    Attributes
    ----------
    influences
        Influences by which it may be off, each with its identity and its standard uncertainty in the parameter's unit:
        two shots, and two campaigns, that name the same identity share the same error.
    suspected
        Shape that the rig does not state, if it is the size of one: zero unless many shots are asked for it.
    """

    name: str
    influences: tuple[tuple[str, float], ...] = ()
    unit: str = "1"
    suspected: Suspected | None = None


@dataclass(frozen=True, eq=False)
class ShotSummary(ReadOnlyArrays):
    """A shot's likelihood about the shared unknowns: ``|R (x - reference) - y|^2``.

    Attributes
    ----------
    reference : ndarray, shape (n,)
        The logarithm of the mass in kg first, scales as logarithms, the friction that is declared too large as a share
        of what is declared (in N where none is), the release beyond what is expected in its standard uncertainties.
    triangle : ndarray, shape (n, n)
        R. It is singular: a common factor of mass and forces changes no row.
    seen : ndarray, shape (n,)
        y.
    geometry
        Values of the mechanism with which it was found, those that were stated, as `geometry_of`; numbers in SI units.
    against
        Reasons against the shot, beside what many shots judge better.
    unexplained_share
        Share of the acceleration that forces and motion leave of one another in a coloured way.
    averaged_rel
        Share by which the shot's mass exceeds that of the reference, being the mean over what no rig states.
    degrees_of_freedom
        Degrees of freedom of the standard uncertainties of influences, by identity; of one that is not in it the
        uncertainty is taken as known.
    """

    parameters: tuple[Parameter, ...]
    reference: Array
    triangle: Array
    seen: Array
    geometry: Mapping[str, float]
    against: tuple[str, ...] = ()
    unexplained_share: float = 0.0
    averaged_rel: float = 0.0
    degrees_of_freedom: Mapping[str, float] = field(default_factory=dict)

    @property
    def mass_kg(self) -> float:
        """Mass that the shot's own report states."""
        return math.exp(min(float(self.reference[0]), MOST_LN_KG)) * (1.0 + self.averaged_rel)

    @classmethod
    def of_json(cls, stated: Mapping[str, Any]) -> ShotSummary:
        """Read it from a report.

        Raises
        ------
        ValueError
            If it is of another schema, or what it holds is no summary.
        """
        if stated.get("schema") != SCHEMA:
            raise ValueError(f"schema {stated.get('schema')!r}, expected {SCHEMA}")
        try:
            listed = [
                Parameter(
                    str(one["name"]),
                    tuple((str(name), float(u)) for name, u in one.get("influences", ())),
                    str(one.get("unit", "1")),
                    Suspected.of_json(one.get("suspected")),
                )
                for one in stated["parameters"]
            ]
            arrays = [np.array(stated[key], dtype=np.float64) for key in ("reference", "R", "y")]
            # earlier reports name what was not stated too, with null
            geometry = {str(name): float(value) for name, value in stated["geometry"].items() if value is not None}
            against = tuple(str(one) for one in stated["against"])
            unexplained, averaged = (float(stated.get(key, 0.0)) for key in ("unexplained_share", "averaged_rel"))
            # earlier reports took every uncertainty as known
            freedom = {str(name): float(nu) for name, nu in stated.get("degrees_of_freedom", {}).items()}
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise ValueError(f"{type(error).__name__}: {error}") from error
        n, names = len(listed), [one.name for one in listed]
        if [part.shape for part in arrays] != [(n,), (n, n), (n,)]:
            raise ValueError(f"{n} parameters, but R of shape {arrays[1].shape} and y of shape {arrays[2].shape}")
        if not all(np.isfinite(part).all() for part in (*arrays, np.array(list(geometry.values())))):
            raise ValueError("numbers that are not finite")
        if not (math.isfinite(unexplained) and unexplained >= 0.0):
            raise ValueError(f"a share of {unexplained} that is unexplained")
        if not abs(averaged) < 1.0:
            raise ValueError(f"a share of {averaged} by which the mass is averaged")
        if names[:1] != [LN_MASS] or len(set(names)) < n:
            raise ValueError(f"parameters {', '.join(names)}: the first must be {LN_MASS}, and each once")
        if any(not (math.isfinite(u) and u >= 0) for one in listed for _, u in one.influences):
            raise ValueError("a standard uncertainty that is negative or not finite")
        if not all(nu >= 1.0 for nu in freedom.values()):
            raise ValueError("a standard uncertainty with less than one degree of freedom")
        return cls(tuple(listed), arrays[0], arrays[1], arrays[2], geometry, against, unexplained, averaged, freedom)

    def to_json(self, *, cutoff_hz: float | None, zero_shift: bool) -> dict[str, Any]:
        """Return it as the report has it."""
        return {
            "schema": SCHEMA,
            "parameters": [
                {
                    "name": one.name,
                    "unit": one.unit,
                    "influences": [list(influence) for influence in one.influences],
                    **({} if one.suspected is None else {"suspected": one.suspected.to_json()}),
                }
                for one in self.parameters
            ],
            "reference": self.reference.tolist(),
            "R": self.triangle.tolist(),
            "y": self.seen.tolist(),
            "geometry": dict(self.geometry),
            "against": list(self.against),
            # relative standard uncertainty of the mass that no column holds: there is nothing without one
            "own_u_rel": 0.0,
            "unexplained_share": self.unexplained_share,
            "averaged_rel": self.averaged_rel,
            "degrees_of_freedom": dict(self.degrees_of_freedom),
            "cutoff_hz": cutoff_hz,
            "zero_shift": zero_shift,
        }


def shot_summary(
    calibration: Calibration, rig: Rig, against: tuple[str, ...] = (), suspects: Sequence[Suspect] = ()
) -> ShotSummary:
    """Summarise a shot.

    Parameters
    ----------
    against
        Reasons that speak against it.
    suspects
        Shapes that the rig does not state, on the regression's grid.
    """
    regression = calibration.block.regression
    causes, late = columns_of(regression, suspects)
    inferred = calibration.with_causes(causes, late).with_changes(_changes(regression), u=0.0).inferred
    changes = (LN_MASS_DRIFT, *map(ln_mass_step, STEPS_AT))
    friction_n, u_release_m_s = rig.mechanism.friction, regression.u_release_n_s / calibration.m0_kg
    certified, declared = certified_influences(rig), declared_sources(rig)
    known = {prior.unknowns[0]: math.sqrt(prior.covariance[0, 0]) for prior in calibration.own if not prior.exact}
    stated = {
        motion.MASS.name: (Parameter(LN_MASS), 1.0),
        **{one.name: (Parameter(one.name, certified[one.name]), 1.0) for one in calibration.block.gauges},
        motion.FRICTION.name: (
            Parameter(FRICTION_SHARE, certified[FRICTION_SHARE])
            if friction_n
            else Parameter(FRICTION_N, certified[FRICTION_N], "N"),
            friction_n or 1.0,
        ),
        motion.ACCELERATION.name: (Parameter(LN_ACCELERATION, certified[LN_ACCELERATION]), 1.0),
        motion.RELEASE.name: (Parameter("release", ((f"{OF_RIG}{rig.name}:{RELEASE}", 1.0),)), u_release_m_s),
        motion.CAMERA.name: (Parameter(motion.CAMERA.name, certified[motion.CAMERA.name]), 1.0),
        # one camera's optics, and one rig's carriage sensors, are the same in all shots
        **{
            name: (Parameter(name, ((f"{OF_RIG}{rig.name}:{name}", known[name]),), BESIDE[name].unit), 1.0)
            for name in (*DISTORTIONS, OTHER.name)
            if name in known
        },
        **{cause.source: (parameter, 1.0) for cause, parameter in _of_causes(calibration, rig)},
        **{declared_too_large(source).name: (Parameter(source, certified[source]), 1.0) for source in declared},
        **{
            cause.source: (Parameter(suspected.name, unit=cause.unit, suspected=suspected), 1.0)
            for cause, suspected in zip(causes, _suspected(rig, suspects), strict=True)
        },
        **{motion.change(number).name: (Parameter(name), 1.0) for number, name in enumerate(changes)},
    }
    if not u_release_m_s:  # nothing was given at the release
        del stated[motion.RELEASE.name]
    own = [prior for prior in calibration.own if prior.unknowns[0] not in stated]
    if not u_release_m_s:
        own.append(Prior.of("release", motion.RELEASE.name, 0.0))
    names = [unknown.name for unknown in inferred.unknowns if unknown.name in stated]
    triangle, seen = inferred.about(names, own)
    units = np.array([stated[name][1] for name in names])
    reference = np.array([inferred.value(name) for name in names]) / units
    reference[0] += math.log(calibration.m0_kg)
    if u_release_m_s:  # counted from what is expected of it, so that its prior is zero as the others' are
        reference[names.index(motion.RELEASE.name)] -= regression.release_n_s / regression.u_release_n_s
    triangle, seen = _with_own_errors(triangle * units, seen, [stated[name][0].name for name in names], declared)
    parameters = tuple(stated[name][0] for name in names)
    return ShotSummary(
        parameters=parameters,
        reference=reference,
        triangle=triangle,
        seen=seen,
        geometry=geometry_of(rig.mechanism),
        against=against,
        unexplained_share=calibration.noise.unexplained_share,
        degrees_of_freedom=_freedom(rig, parameters),
    )


def _freedom(rig: Rig, parameters: Sequence[Parameter]) -> dict[str, float]:
    """Return how well the influences' uncertainties are known, of those where the rig tells it or they are guesses."""
    known = reliabilities(rig)
    dynamic = {
        known_by(rig, one): known.get(dynamic_scale(force.name if len(force.channels) == 1 else one.name))
        for force in rig.forces
        for one in force.channels
    }
    certified = {known_by(rig, one): known.get(of_gauge(one.name)) for one in rig.channels}
    found: dict[str, float] = {}
    for identity in dict.fromkeys(name for one in parameters for name, _ in one.influences):
        source = source_of(identity)
        of_sensor = {SourceKind.SENSOR_SCALE: certified, SourceKind.SENSOR_DYNAMIC: dynamic}.get(source.kind)
        reliability = reliability_of(source, known) if of_sensor is None else of_sensor[source.detail]
        if reliability is not None:
            found[identity] = reliability.degrees_of_freedom
    return found


def known_by(rig: Rig, channel: ChannelSpec) -> str:
    """Return by what a sensor is known: its serial number, or its place on the rig."""
    return channel.sensor.serial or f"{rig.name}/{channel.name}"


def _suspected(rig: Rig, suspects: Sequence[Suspect]) -> Iterator[Suspected]:
    """Yield what each shape of the suspects is of: another gauge has another line."""
    for one in suspects:
        for variant in one.variants:
            yield Suspected(one.source, _gauge_of(rig, one.source).rstrip(":"), variant, one.u, one.positive)


def _with_own_errors(
    triangle: Array, seen: Array, names: Sequence[str], declared: Mapping[ErrorSource, tuple[float, float]]
) -> tuple[Array, Array]:
    """Take out what a declared force is off by in this shot alone: its variance D makes the rows' ``1 + R D R'``."""
    own = {str(source): u_own for source, (_, u_own) in declared.items()}
    variances = np.square([own.get(name, 0.0) for name in names])
    if not variances.any():
        return triangle, seen
    factor = np.linalg.cholesky(np.eye(seen.size) + (triangle * variances) @ triangle.T)
    white = np.asarray(np.linalg.qr(np.linalg.solve(factor, np.column_stack([triangle, seen])), mode="r"))
    return white[:, :-1], white[:, -1]


def _changes(regression: Regression) -> Array:
    """Return the shapes of a drift and of steps of the mass, on the regression's grid and behind its filter."""
    start_s, end_s = regression.interval_s
    steps = steps_behind(regression, start_s + (end_s - start_s) * np.array(STEPS_AT))
    return np.column_stack([motion.ramps(regression.times_s, regression.interval_s, 1), steps])


def _of_causes(calibration: Calibration, rig: Rig) -> Iterator[tuple[Cause, Parameter]]:
    """Yield the causes that are the same in all shots of a rig, with their parameters."""
    identity = f"{OF_RIG}{rig.name}:"
    for cause in calibration.block.causes:
        source = cause.source
        if source == SHARE:
            yield cause, Parameter(UNREAD_SHARE, ((f"{identity}unread_share", cause.u),))
        elif source == SLIDE:
            yield cause, Parameter(SLIDE_FRICTION, ((f"{identity}slide_friction", cause.u),), cause.unit)
        elif source.kind is SourceKind.UNREAD_SHAPE:
            name = f"{UNREAD_FORCE} {source.detail}"
            yield cause, Parameter(name, ((f"{identity}{OF_SHAPE}{source.detail}", cause.u),))
        elif source.kind in (SourceKind.DELAY, SourceKind.LINE):
            yield cause, Parameter(source, ((f"{identity}{source}", cause.u),), cause.unit)
        elif source.kind in OF_CHAIN:
            yield cause, Parameter(source, ((f"{identity}{_gauge_of(rig, source)}{source}", cause.u),), cause.unit)


def _gauge_of(rig: Rig, source: ErrorSource) -> str:
    """Return the serial number of the gauge that a source is of, for an identity: another gauge has another line."""
    gauge = next((one for one in rig.channels if source.of and source.of in (one.role, one.name)), None)
    return f"{gauge.sensor.serial}:" if gauge is not None and gauge.sensor.serial else ""


def geometry_of(mechanism: Mechanism) -> dict[str, float]:
    """Return what is stated of a mechanism but for `OF_A_SHOT`, by symbol; what a virtual rig alone needs may lack."""
    values = {symbol: getattr(mechanism, symbol) for symbol in Mechanism.symbols() if symbol not in OF_A_SHOT}
    return {symbol: value for symbol, value in values.items() if not math.isnan(value)}


def certified_influences(rig: Rig) -> dict[str, tuple[tuple[str, float], ...]]:
    """Return what a rig's certificates say of the parameters of its shots' summaries, by name.

    Parameters of which they say nothing, the mass, the release and what a camera's optics bend, are left out, and so
    are the shapes of the force that no gauge reads, which are counted in what the rig says of them.
    """
    return {
        **{motion.gauge(force.name).name: _gauge(rig, force) for force in rig.forces},
        **dict.fromkeys((FRICTION_SHARE, FRICTION_N), _friction(rig)),
        LN_ACCELERATION: _scale(rig, "recoil_acceleration", rig.with_role("recoil_acceleration")),
        motion.CAMERA.name: _scale(rig, "recoil_displacement", rig.with_role("recoil_displacement")),
        **{
            name: ((f"{OF_RIG}{rig.name}:{symbol}", rig.mechanism.u.get(symbol, 0.0)),)
            for name, symbol in ((UNREAD_SHARE, "unread_share"), (SLIDE_FRICTION, "slide_friction"))
        },
        **{delay: ((f"{OF_RIG}{rig.name}:{delay}", u_s),) for delay, u_s in known_delays(rig).items()},
        **{
            source: ((f"{OF_RIG}{rig.name}:{source}", u_common),)
            for source, (u_common, _) in declared_sources(rig).items()
        },
    }


def sensors_of(rig: Rig) -> dict[ErrorSource, str]:
    """Return which sensor, or sensors, each source of a budget is of that is a sensor's scale."""
    found: dict[ErrorSource, str] = {}
    of_roles = {"recoil_displacement": CAMERA_SCALE, **{force.name: force_scale(force.name) for force in rig.forces}}
    of_forces = {force.name: force.channels for force in rig.forces}
    roles = dict.fromkeys(one.role for one in rig.channels if one.role and one.role not in FORCE_ROLES)
    for role, channels in ({role: rig.with_role(role) for role in roles} | of_forces).items():
        names = {one.name: known_by(rig, one) for one in channels}
        whole = " and ".join(names.values())
        sensitivity = ErrorSource(SourceKind.SENSITIVITY, role)
        found |= {sensitivity: whole, of_roles.get(role, sensitivity): whole}
        if len(channels) > 1:
            found |= {of_gauge(name): known for name, known in names.items()}
        of_pulses = {role if len(channels) == 1 else one.name: one for one in channels if one.u_dynamic_rel}
        found |= {dynamic_scale(of): names[one.name] for of, one in of_pulses.items()}
    return found


def _scale(rig: Rig, role: str, channels: Sequence[ChannelSpec]) -> tuple[tuple[str, float], ...]:
    """Return what the scale of a role may be off by; of the mean of several gauges each has its part."""
    found: dict[str, float] = {}
    for channel in channels:
        sensor = channel.sensor
        calibrated = "" if sensor.calibrated is None else f":{sensor.calibrated.isoformat()}"
        identity = known_by(rig, channel)
        own = math.sqrt(sensor.u_scale_rel**2 - sensor.u_reference_rel**2)
        found[f"{OF_SENSOR}{role}:{identity}{calibrated}"] = own / len(channels)
        if channel.u_dynamic_rel:  # no certificate at rest tells of it, and none that is renewed
            found[f"{OF_DYNAMIC}{role}:{identity}"] = channel.u_dynamic_rel / len(channels)
        if sensor.u_reference_rel:
            name = f"{OF_STANDARD}{sensor.reference}"
            found[name] = found.get(name, 0.0) + sensor.u_reference_rel / len(channels)
    return tuple(found.items())


def _gauge(rig: Rig, force: ForceInput) -> tuple[tuple[str, float], ...]:
    scale = _scale(rig, force.role, force.channels)
    if not force.area:
        return scale
    u_area = rig.mechanism.u.get(force.area, 0.0) / getattr(rig.mechanism, force.area)
    of_bore = force.role == "breech_pressure" and rig.mechanism.u_bore_friction_rel
    bore = ((f"{OF_RIG}{rig.name}:bore_friction", rig.mechanism.u_bore_friction_rel),) if of_bore else ()
    return (*scale, (f"{OF_RIG}{rig.name}:{force.area}", u_area), *bore)


def _friction(rig: Rig) -> tuple[tuple[str, float], ...]:
    u_friction, friction_n = rig.mechanism.u.get("friction", 0.0), rig.mechanism.friction
    return ((f"{OF_RIG}{rig.name}:friction", u_friction / (friction_n or 1.0)),)
