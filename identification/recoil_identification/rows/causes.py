"""Further errors in the rows of a shot, each a shape of known form and unknown size.

The zeros of the pressure gauges, their delays, the offsets of clocks, what repairs may have left, and the delay between
the chains of acceleration and force move the mass through the same rows as the sensors' scales do. So they are unknowns
of the same inference (`recoil_identification.rows.equation_of_motion`), with what is known of their sizes as priors:
what they cost the mass is then what moving them and estimating anew would give.

The carriage's sensors act on a travel that the forces drive: a camera sees the recoil relative to the tipping part, and
an error in that part's motion moves the travel.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_identification.inference.unknown import Prior, Scope, Unknown
from recoil_processing.double_integral import integrate
from recoil_processing.filters import LowPass
from recoil_processing.gaps import bridge
from recoil_processing.motion.derivative import second_derivative
from recoil_processing.picture_bends import picture_bends
from recoil_processing.shot.clocks.force_clocks import METHOD as BY_FORCE
from recoil_processing.shot.clocks.forced_recoil import RATE_ROLES, ForcedRecoil
from recoil_processing.shot.error_source import ErrorSource, SourceKind
from recoil_processing.shot.gauge_zero import MOVES_S, moving_zero_pa, zero_moves
from recoil_processing.shot.instants import delay_of, jitter_s
from recoil_processing.shot.kinematics import (
    AngularMotion,
    angular_motion,
    inertial_acceleration,
    lacks,
    seen_acceleration,
    seen_by_camera,
    turning_as_one,
)
from recoil_processing.shot.regression import Regression
from recoil_processing.shot.signals import Signals
from recoil_rigs.rig import Rig
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.tables.force_input import ForceInput
from recoil_rigs.tables.rig_tables import CARRIAGE_ACCELERATIONS, CARRIAGE_ROLES

SKEW = ErrorSource(SourceKind.SKEW)
NO_CARRIAGE_RATE = ErrorSource(SourceKind.NOT_RECORDED, "carriage_rate")
"""Source of error where a gyro of the rig was not recorded: the share of the tipping part's turning that the carriage
may have had."""
DISTORTIONS = tuple(ErrorSource(SourceKind.PICTURE, detail=shape) for shape in ("bow", "S"))
"""Shapes in which optics bend the picture: names of their sizes, m, and sources of their budget rows."""
U_SKEW_S = 5e-5
"""Standard uncertainty of the delay between the chains of acceleration and force, beyond what was corrected: the rows
tell it to a microsecond or two, and would be asked twice if what was found from them before were believed."""
ASKED_TWICE = 10.0
"""Factor on the uncertainty of a clock that these very rows were asked for: what they tell they tell here."""
U_DELAY_S = 2e-5
"""Standard uncertainty of a gauge's delay where the rig declares none."""
SLOPE_HZ, MOST_OF_RATE = 300.0, 0.2
"""Cut-off behind which recorded forces tell how steep they are, and the share of the rate below which it must lie."""
U_BRIDGED = 0.3
"""Standard uncertainty of what bridges lost samples, share of the largest acceleration."""
MOST_LOST = 4
"""Stretches of lost samples that are causes of their own: the longest, for a single sample is bridged well."""


@dataclass(frozen=True, eq=False)
class Cause(ReadOnlyArrays):
    """An error whose size is zero to its standard uncertainty.

    Attributes
    ----------
    source
        Source that its row in the budget names.
    unit
        Unit of the size.
    u
        Standard uncertainty of its size.
    kind
        Kind of the evaluation of `u`: A by statistics, B otherwise.
    forces_n : ndarray, shape (n, n_gauges)
        Amount by which a size of one makes the measured forces read too little, signed as these are, on the
        regression's grid and behind its filter.
    acceleration_m_s2 : ndarray, shape (n,)
        Amount that a size of one adds to the reading of the acceleration.
    travel_m_s2 : ndarray, shape (n,), optional
        Amount that a size of one adds to the acceleration of the travel that a camera sees, if that is another.
    beside_n : ndarray, shape (n,), optional
        Amount that a size of one acts beside the measured forces, signed, behind the filter; none if left out.
    scope
        Reach of its size, see `recoil_identification.inference.unknown.Unknown`.
    degrees_of_freedom
        Degrees of freedom of `u`; infinite where it is taken as known.
    """

    source: ErrorSource
    unit: str
    u: float
    kind: str
    forces_n: Array
    acceleration_m_s2: Array
    travel_m_s2: Array | None = None
    scope: Scope = "shot"
    beside_n: Array | None = None
    degrees_of_freedom: float = math.inf

    @property
    def unknown(self) -> Unknown:
        """Its size."""
        return Unknown(self.source, self.unit, self.scope)

    @property
    def prior(self) -> Prior:
        """Prior of its size."""
        return Prior.of(self.source, self.source, self.u, degrees_of_freedom=self.degrees_of_freedom)


def delay_of_gauge(force: ForceInput) -> ErrorSource:
    """Return the source that is the delay of a measured force: of its chain, or of a line that nothing is said of."""
    of_line = all(spec.u_line_s for spec in force.channels)
    return ErrorSource(SourceKind.LINE if of_line and force.channels else SourceKind.DELAY, force.name)


def moving_zero(role: str, tau_s: float) -> ErrorSource:
    """Return the source that is a gauge's zero that moves at the shot with a time constant."""
    return ErrorSource(SourceKind.MOVING_ZERO, role, f"{1e3 * tau_s:g}")


def causes_of(
    regression: Regression,
    recorded: Regression,
    signals: Signals,
    fired: FiredShot,
    motion_role: str = "recoil_acceleration",
) -> tuple[Cause, ...]:
    """List the causes of a shot.

    Parameters
    ----------
    regression, recorded
        Regressions behind the filter and before it: where samples were lost, what bridges them may be wrong, and the
        filter carries some of that beyond the rows that it spoils.
    signals
        Signals, which give the uncertainties of the gauges' zeros by the pre-trigger baseline, and what repairs may
        have left. A gauge whose zero is not known at all has no cause: no number could be given.
    fired
        Shot and rig: which channel hangs on which clock, how well that is aligned, the areas, and how far the gauges'
        zeros may move.
    motion_role
        Role of the sensor that measured the motion.
    """
    n = regression.times_s.size
    gauges = {force.name: force for force in fired.rig.forces}
    none, unmoved = np.zeros((n, len(gauges))), np.zeros(n)

    def of_gauge(name: str, error: Array) -> Array:
        """Take an error of its reading off one gauge's force."""
        forces = np.zeros((n, len(gauges)))
        forces[:, [*gauges].index(name)] = -gauges[name].sign * gauges[name].per_reading * error
        return forces

    found = []
    for role in gauges:
        offset = signals.offsets.get(role)
        if offset is not None and math.isfinite(offset.u) and offset.u > 0:
            found.append(
                Cause(
                    ErrorSource(SourceKind.ZERO, role), "Pa", offset.u, "A", of_gauge(role, regression.released),
                    unmoved, degrees_of_freedom=offset.degrees_of_freedom,
                )
            )  # fmt: skip
    moves = filtered_columns(regression, zero_moves(regression.times_s, regression.interval_s[0]))
    for role, force in gauges.items():
        u_pa = _u_moving_zero(force, signals)
        if u_pa > 0 and force.unit == "N":  # nothing strikes it: it is off by as much throughout
            zero = of_gauge(role, regression.released)
            found.append(Cause(ErrorSource(SourceKind.ZERO, role), "N", u_pa, "B", zero, unmoved))
        elif u_pa > 0:
            found += [
                Cause(moving_zero(role, tau_s), "Pa", u_pa, "B", of_gauge(role, move), unmoved)
                for tau_s, move in zip(MOVES_S, moves.T, strict=True)
            ]
    for source, left in signals.left.items():
        error = left * regression.released
        if source.kind is SourceKind.BRIDGED_SHAPE:  # no slow error: the filter takes most of it
            error = filtered_columns(regression, (left * recorded.released)[:, np.newaxis])[:, 0]
        if source.of in gauges:
            found.append(Cause(source, "1", 1.0, "B", of_gauge(source.of, error), unmoved))
        elif source.of == motion_role:
            found.append(Cause(source, "1", 1.0, "B", none, error))
    found += _bent(regression, fired, motion_role, none)
    # a recording that is late by dt lacks dt times its slope
    slopes_n_s = _slopes_n_s(regression, recorded)
    jerk_m_s3 = np.gradient(regression.acceleration_m_s2, regression.step_s)
    measured = [*(fired.of_force(force) for force in gauges.values()), fired.roles.get(motion_role, ())]
    channels = [[one.recorded for one in of_one] for of_one in measured]
    clocks = [[channel.time_base.clock for channel in of_role] for of_role in channels]
    for clock in sorted({clock for of_role in clocks for clock in of_role} - {fired.shot.reference_clock}):
        u_s = fired.alignments[clock].u_offset_s
        if fired.alignments[clock].method == BY_FORCE and not regression.recoils_once:
            u_s *= ASKED_TWICE
        if math.isfinite(u_s) and u_s > 0:
            # of the mean of several gauges some may be on it
            on_it = np.array([of_role.count(clock) / max(len(of_role), 1) for of_role in clocks])
            moved = -jerk_m_s3 if on_it[-1] else unmoved
            source = ErrorSource(SourceKind.ALIGNMENT, clock)
            found.append(Cause(source, "s", u_s, "B", slopes_n_s * on_it[:-1], moved))

    def alone(column: int) -> bool:
        """Return whether a sensor has a clock of its own: the clock's alignment knows its delay then."""
        others = (*clocks[:column], *clocks[column + 1 :], [fired.shot.reference_clock])
        return set(clocks[column]).isdisjoint(clock for of_role in others for clock in of_role)

    known = known_delays(fired.rig)
    for column, force in enumerate(gauges.values()):
        if force.name not in signals.series:
            continue
        source = delay_of_gauge(force)
        u_s = known[source]
        if u_s > 0 and not alone(column):
            late = np.where(np.arange(len(gauges)) == column, slopes_n_s, 0.0)
            found.append(Cause(source, "s", u_s, "B", late, unmoved, scope="rig"))
    if regression.low_pass is not None:
        largest = float(np.max(np.abs(regression.acceleration_m_s2[regression.inside]), initial=0.0))
        for first, stop in _longest_lost(recorded):
            bridged = np.zeros(n)
            bridged[first:stop] = 1.0
            spread = filtered_columns(regression, bridged[:, np.newaxis])[:, 0]
            at_ms = f"{1e3 * (recorded.times_s[first] - recorded.interval_s[0]):.1f}"
            source = ErrorSource(SourceKind.LOST_SAMPLES, detail=at_ms)
            found.append(Cause(source, "m/s^2", U_BRIDGED * largest, "B", none, spread))
    # channels that are read one after the other need not share the jitter of their stamps
    jitter = max((jitter_s(channel, fired) for of_role in channels for channel in of_role), default=0.0)
    # what is stated of the motion's delay is uncertain beside that of all chains
    own = [] if alone(len(gauges)) else [one.spec.sensor.u_delay_s or 0.0 for one in measured[-1]]
    stated = math.hypot(*own) / max(len(own), 1)
    found.append(Cause(SKEW, "s", math.hypot(U_SKEW_S, jitter, stated), "B", none, -jerk_m_s3))
    return tuple(found)


def _bent(regression: Regression, fired: FiredShot, motion_role: str, none: Array) -> Iterator[Cause]:
    """Yield what optics that bend a travel add to the acceleration of a body on a line that it alone tells."""
    if regression.recoils_once or motion_role != "recoil_displacement":
        return
    travel, low_pass = regression.moved(regression.acceleration_m_s2)[1], regression.low_pass
    smooth = travel if low_pass is None else low_pass.apply(travel, regression.rate_hz)
    u_m = max(one.spec.sensor.u_bent_m for one in fired.roles[motion_role])
    for number, (name, bend) in enumerate(zip(DISTORTIONS, picture_bends(smooth), strict=True)):
        added = regression.released * second_derivative(bend, regression.step_s)
        if u_m > 0:
            yield Cause(name, "m", u_m / 2**number, "B", none, added)


def _slopes_n_s(regression: Regression, recorded: Regression) -> Array:
    """Return how steep the gauges' forces are, shape (n, n_gauges), on the regression's grid and behind its filter.

    Before the release they are held at what they are then: a gauge that is late moves no release, where the forces that
    the stop balanced begin to count. Recorded forces pass a low-pass, for their noise has no slope.
    """
    first = int(np.argmax(recorded.released > 0))
    held = [bridge(force, otherwise=0.0) for force in recorded.forces_n[:, :-1].T]
    for force in held:
        force[:first] = force[first]
    if regression.table is not None:
        slow = filtered_columns(regression, np.column_stack(held))
    elif MOST_OF_RATE * regression.rate_hz > SLOPE_HZ:
        slow = np.column_stack([LowPass(SLOPE_HZ).apply(force, regression.rate_hz) for force in held])
    else:
        slow = np.column_stack(held)
    return np.asarray(np.gradient(slow, regression.step_s, axis=0))


def _u_moving_zero(force: ForceInput, signals: Signals) -> float:
    """Return by how much the zero may move of a force's reading, the mean of all that measured it."""
    reading = signals.series.get(force.name)
    if not force.channels or reading is None:
        return 0.0
    return math.hypot(*(moving_zero_pa(spec, reading) for spec in force.channels)) / len(force.channels)


def known_delays(rig: Rig) -> dict[ErrorSource, float]:
    """Return how well the delays are known of forces and of the carriage's sensors, s.

    What is not stated of the first force's own delay is the skew.
    """
    of_forces = {
        delay_of_gauge(force): u_delay_s(rig, force.name, U_DELAY_S if number else 0.0)
        for number, force in enumerate(rig.forces)
    }
    of_carriage = {
        ErrorSource(SourceKind.DELAY, role): delay_of(spec, rig.source(spec.source)).u_s
        for role in CARRIAGE_ROLES
        if (spec := rig.by_role(role)) is not None
    }
    return of_forces | of_carriage


def u_delay_s(rig: Rig, force: str, unstated_s: float = U_DELAY_S) -> float:
    """Return how well the delay is known of a force, by its name, the mean of all that measured it."""
    each = [delay_of(spec, rig.source(spec.source)).u_s or unstated_s for spec in rig.force(force).channels]
    return math.hypot(*each) / max(len(each), 1)


def filtered_columns(regression: Regression, columns: Array) -> Array:
    """Pass columns through the regression's filter, shape (n, n_columns); those of recorded signals stay."""
    if regression.table is None:
        return columns
    table = regression.table.joined_by({f"cause {j}": column for j, column in enumerate(columns.T)})
    return np.column_stack([table[f"cause {j}"] for j in range(columns.shape[1])])


def _longest_lost(recorded: Regression) -> list[tuple[int, int]]:
    """Return the longest stretches of lost samples of the motion, as first and one after the last."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], recorded.inside & ~recorded.trusted, [False]])))
    stretches = [(int(first), int(stop)) for first, stop in zip(edges[::2], edges[1::2], strict=True)]
    return sorted(sorted(stretches, key=lambda one: one[0] - one[1])[:MOST_LOST])


def carriage_part_causes(regression: Regression, signals: Signals, fired: FiredShot) -> tuple[Cause, ...]:
    """State what may be wrong of the carriage's part of the motion beside its scale and its zero.

    Its sensors may be late, and what they drained may be told wrongly. What a rate that the shot has not could have
    contributed is unknown too, for the carriage is taken for at rest: it may turn as the tipping part does, of which a
    camera's frames tell something. Without the rate of the tipping part no shape of that is known, see
    `recoil_identification.shot.verdict`.
    """
    rig, taken = fired.rig, angular_motion(signals, fired.rig)
    none = np.zeros((signals.times_s.size, len(rig.forces)))

    def cause(
        source: ErrorSource, unit: str, u: float, wrong: AngularMotion, right: AngularMotion, scope: Scope = "shot"
    ) -> Cause:
        felt, seen = (
            regression.released / u * bridge(of(signals, rig, wrong) - of(signals, rig, right), otherwise=0.0)
            for of in (inertial_acceleration, seen_acceleration)
        )
        filtered = filtered_columns(regression, felt[:, np.newaxis])[:, 0]
        return Cause(source, unit, u, "B", none, filtered, seen, scope)

    found = [cause(source, "s", u_s, late, taken, scope) for source, u_s, scope, late in _late(signals, fired)]
    # what other repairs leave is short, and no travel
    found += [
        cause(source, "1", 1.0, _misread(signals, rig, {source.of: left}), taken)
        for source, left in signals.left.items()
        if source.of in CARRIAGE_ROLES and source.detail.startswith("droop")
    ]
    if lacks(signals, rig, "carriage_rate") and "tipping_rate" in signals.series:
        found.append(cause(NO_CARRIAGE_RATE, "1", 1.0, taken, turning_as_one(taken)))
    return tuple(found)


def _late(signals: Signals, fired: FiredShot) -> Iterator[tuple[ErrorSource, float, Scope, AngularMotion]]:
    """Yield by how much the carriage's sensors may be late, each and all of one clock, and what they tell if they are.

    A clock that a force or the motion is on as well has its offset among what those hang on.
    """
    rig = fired.rig
    recorded = {
        role: one for role in CARRIAGE_ROLES
        if role in signals.series and (one := fired.channel(role)) is not None
    }  # fmt: skip
    for source, u_s in known_delays(rig).items():
        if source.of in recorded and u_s > 0:
            yield source, u_s, "rig", _with_delay(signals, rig, (source.of,), u_s)
    others = {of[0].recorded.time_base.clock for role, of in fired.roles.items() if role not in CARRIAGE_ROLES}
    clocks = {role: one.recorded.time_base.clock for role, one in recorded.items()}
    for clock in sorted({*clocks.values()} - others - {fired.shot.reference_clock}):
        on_it = tuple(role for role, its in clocks.items() if its == clock)
        u_s = fired.alignments[clock].u_offset_s
        if 0 < u_s < math.inf:
            source = ErrorSource(SourceKind.ALIGNMENT, clock)
            yield source, u_s, "shot", _with_delay(signals, rig, on_it, u_s)


def _with_delay(signals: Signals, rig: Rig, roles: Sequence[str], delay_s: float) -> AngularMotion:
    """Return the motion that the carriage's sensors tell if some are late."""
    times = signals.times_s
    readings = {role: bridge(signals.series[role], otherwise=0.0) for role in roles}
    late = {role: np.interp(times - delay_s, times, one) - one for role, one in readings.items()}
    return _misread(signals, rig, late)


def _misread(signals: Signals, rig: Rig, errors: Mapping[str, Array]) -> AngularMotion:
    """Return the motion that the carriage's sensors tell with errors in what some read."""
    series = {role: signals.series[role] + error for role, error in errors.items()}
    return angular_motion(replace(signals, series={**signals.series, **series}), rig)


def carriage_causes(forced: ForcedRecoil) -> tuple[Cause, ...]:
    """List the zeros, the scales, the delays and what repairs may have left of the carriage's sensors.

    Parameters
    ----------
    forced
        Forced recoil of a shot with its alignments.
    """
    free, signals = forced.recorded.released, forced.signals

    def cause(
        source: ErrorSource, unit: str, u: float, kind: str, other: AngularMotion, scope: Scope = "shot",
        freedom: float = math.inf,
    ) -> Cause:  # fmt: skip
        """State an error of a sensor by the motion that it tells if it is off by a standard uncertainty."""
        none = np.zeros((free.size, len(forced.recorded.gauges)))
        moved = -_moved(forced, other) / u
        return Cause(source, unit, u, kind, none, moved, scope=scope, degrees_of_freedom=freedom)

    found = []
    for source, left in signals.left.items():
        if source.of in CARRIAGE_ROLES:
            found.append(cause(source, "1", 1.0, "B", _misread(signals, forced.fired.rig, {source.of: left})))
    for role in CARRIAGE_ACCELERATIONS:
        offset = signals.offsets.get(role)
        if offset is not None and math.isfinite(offset.u) and offset.u > 0:
            source, other = ErrorSource(SourceKind.ZERO, role), _with_error(forced.motion, role, offset.u * free)
            found.append(cause(source, "m/s^2", offset.u, "A", other, freedom=offset.degrees_of_freedom))
    if forced.fired.rig.camera_on_ground:
        found += _ground_causes(forced)
    for role in (*CARRIAGE_ACCELERATIONS, *RATE_ROLES):
        spec = forced.fired.rig.by_role(role)
        if spec is not None and role in signals.series and spec.sensor.u_scale_rel:
            other = _with_scale(forced, role, spec.sensor.u_scale_rel)
            source = ErrorSource(SourceKind.SENSITIVITY, role)
            found.append(cause(source, "1", spec.sensor.u_scale_rel, "B", other, "sensor"))
    found += [cause(source, "s", u_s, "B", late, scope) for source, u_s, scope, late in _late(signals, forced.fired)]
    if lacks(signals, forced.fired.rig, "carriage_rate"):  # without both rates the camera gives no mass
        found.append(cause(NO_CARRIAGE_RATE, "1", 1.0, "B", turning_as_one(forced.motion)))
    return tuple(found)


def _ground_causes(forced: ForcedRecoil) -> Iterator[Cause]:
    """List what a camera on the ground hangs on beside: the zeros of the gyros, and where the bore points at rest."""
    mechanism, free, signals = forced.fired.rig.mechanism, forced.recorded.released, forced.signals
    for role in RATE_ROLES:
        offset = signals.offsets.get(role)
        if offset is not None and math.isfinite(offset.u) and offset.u > 0:
            shape = -_moved(forced, _with_zero(forced, role, offset.u)) / offset.u
            yield Cause(
                ErrorSource(SourceKind.ZERO, role), "rad/s", offset.u, "A", np.zeros((free.size, 3)), shape,
                degrees_of_freedom=offset.degrees_of_freedom,
            )  # fmt: skip
    u_phi20 = mechanism.u.get("phi20", 0.0)
    if u_phi20 > 0:
        source, shape = ErrorSource(SourceKind.DECLARED, "phi20"), -mechanism.g * math.cos(mechanism.phi20) * free
        yield Cause(source, "rad", u_phi20, "B", np.zeros((free.size, 3)), shape, scope="rig")


def _with_zero(forced: ForcedRecoil, role: str, error: float) -> AngularMotion:
    """Let one of the gyros read an amount too much from the onset on."""
    motion, signals = forced.motion, forced.signals
    added = np.where(signals.times_s >= signals.onset_s, error, 0.0)
    if "tipping_rate" not in signals.series:  # the one gyro tells how both turn
        return replace(motion, w1=motion.w1 + added, w2=motion.w2 + added)
    turned = integrate(added, signals.step_s)
    if role == "carriage_rate":
        return replace(motion, w1=motion.w1 + added, beta=motion.beta - turned)
    return replace(motion, w2=motion.w2 + added, beta=motion.beta + turned)


def _with_scale(forced: ForcedRecoil, role: str, error: float) -> AngularMotion:
    """Let one of the carriage's sensors read high by a share of what it reads beyond its reading at rest."""
    motion, step_s = forced.motion, forced.signals.step_s
    if role == "carriage_rate" and "tipping_rate" not in forced.signals.series:  # it tells how both turn
        more = 1.0 + error
        return replace(motion, w1=more * motion.w1, dw1=more * motion.dw1, w2=more * motion.w2, dw2=more * motion.dw2)
    if role == "carriage_rate":
        beta = motion.beta - error * integrate(motion.w1, step_s)
        return replace(motion, w1=(1.0 + error) * motion.w1, dw1=(1.0 + error) * motion.dw1, beta=beta)
    if role == "tipping_rate":
        beta = motion.beta + error * integrate(motion.w2, step_s)
        return replace(motion, w2=(1.0 + error) * motion.w2, dw2=(1.0 + error) * motion.dw2, beta=beta)
    reading = motion.f_x if role == CARRIAGE_ACCELERATIONS[0] else motion.f_y
    static = forced.fired.rig.mechanism.at_rest.get(role, 0.0)
    return _with_error(motion, role, error * (reading - static))


def _with_error(motion: AngularMotion, role: str, error: Array) -> AngularMotion:
    """Add an error to what one of the carriage's accelerometers reads."""
    if role == CARRIAGE_ACCELERATIONS[0]:
        return replace(motion, f_x=motion.f_x + error)
    return replace(motion, f_y=motion.f_y + error)


def _moved(forced: ForcedRecoil, other: AngularMotion) -> Array:
    """Return what another motion of the tipping part adds to the travel's acceleration, shape (n,)."""
    rigid, free = forced.inputs.force_n / forced.mass_kg, forced.recorded.released
    moved = seen_by_camera(rigid, forced.fired.rig, other, forced.signals.step_s, free)
    return np.asarray(moved - forced.acceleration_m_s2)
