"""The equation of motion of the moving part as a linear regression: ``m3 a' = P - R_f``, equation (36).

The force is the breech pressure on the bore, less brake pressure and recuperator pressure on their
pistons, less the packing friction that no gauge reads. Before the part is released both sides are
zero by construction: what the battery stop contributes is not measured. The intervals in which the part is held,
moves, and comes to its end of travel are found from the force and the velocity.

A body on a line has the same equation, ``m3 a' = sum F_j - friction``, with any number of forces that drive or resist.
Gravity is in neither side, for a' is the specific force along the line.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_processing.double_integral import integrate
from recoil_processing.filters import Filtered, LowPassFilter, filter_alike
from recoil_processing.gaps import bridge
from recoil_processing.shot.projectile import breech_force_on_body_n
from recoil_processing.shot.release import FEWEST, end_of_travel, release_index, stop_release_impulse
from recoil_processing.shot.signals import Signals
from recoil_rigs.mechanism.gun import Gun
from recoil_rigs.mechanism.model import Mechanism
from recoil_rigs.tables.force_input import SIGNS
from recoil_rigs.tables.rig_tables import GAUGE_ROLES

FORCES = ("breech", "brake", "recuperator", "friction")
"""Order of the force columns."""
PRESSURE_ROLES = GAUGE_ROLES
MASS_ROLES = ("recoil_acceleration", *PRESSURE_ROLES)
"""Roles on which the mass depends directly."""
MOST_TURNED = 0.01
"""Share of the friction's reversal in a row: a packing turns over the travel by which it gives, and no gauge says when.
Taken as an instant, the reversal alone would make the friction of many shots too small by 10 %.
"""
LEAST_ROWS = 10
"""Fewer rows with errors of their own say nothing about those errors, and fewer samples are no memory."""
MEMORY_S = 0.02
"""Usual memory of a mass over time."""
LONGEST_SHARE = 0.25
"""Share of the motion that the longest one takes."""
BEGINS = 0.01
"""Travel over which an unread force comes up, share of the stroke: nothing grips before the part moves."""
SLOWER = 0.25
"""Share of the cut-off behind which a force tells what a part of it would do."""


@dataclass(frozen=True, eq=False)
class Regression(ReadOnlyArrays):
    """Both sides of the equation of motion on one grid.

    Attributes
    ----------
    times_s : ndarray, shape (n,)
    acceleration_m_s2 : ndarray, shape (n,)
        a' of equation (36).
    forces_n : ndarray, shape (n, n_gauges + 1)
        Contributions to F', signed: those of `gauges`, and friction after them; their sum is F'.
    released : ndarray, shape (n,)
        1 where the part is free to move, 0 where it is held; filtered with the rest, because it is
        the regressor of a constant error of the accelerometer.
    friction_direction : ndarray, shape (n,)
        Force of the packing friction per newton of it: -1 while the part recoils, +1 while it runs
        back, 0 where it is held; filtered with the rest, because it is the regressor of the friction.
    release_per_s : ndarray, shape (n,)
        Force of battery stop and packing while they let the part go, for a unit impulse of it, see
        `stop_release_impulse`; filtered with the rest, because it is the regressor of that impulse.
    trusted : ndarray of bool, shape (n,)
        Flags, false where a sample was lost or lies within the filter's reach of a lost one.
    interval_s
        Interval from the onset of force to the end of recoil travel.
    release_n_s, u_release_n_s
        Expected impulse while the part is let go, which the forces do not contain, and its standard uncertainty, N s;
        0 where that was not recorded.
    table
        All of these columns as one and the same filter left them; None for recorded signals.
    shifts : ndarray, shape (n, n_shifts), or None
        Shapes that a shift of the accelerometer's zero at the shot may have, see
        `recoil_identification.calibration.zero_shift`; filtered with the rest.
    gauges
        Names of the measured forces, in the order of their columns.
    signs
        Signs of their parts in F', as `recoil_rigs.tables.force_input.ForceInput` has them.
    motion_role
        Role of what measured the motion.
    """

    times_s: Array
    step_s: float
    acceleration_m_s2: Array
    forces_n: Array
    released: Array
    friction_direction: Array
    release_per_s: Array
    trusted: Flags
    interval_s: tuple[float, float]
    release_n_s: float
    u_release_n_s: float
    table: Filtered | None = None
    shifts: Array | None = None
    gauges: tuple[str, ...] = PRESSURE_ROLES
    signs: tuple[float, ...] = SIGNS
    motion_role: str = "recoil_acceleration"

    recoils_once: ClassVar[bool] = True
    """Whether it is of one recoil from battery, whose speed nothing tells but the acceleration."""
    force_rate_hz: ClassVar[float] = Gun.force_rate_hz
    """Rate that the force needs at most: noise beyond all that it can be would count as energy of it."""
    bands: ClassVar[float] = 0.0
    """Cut-off over the force's own band where no spectrum tells; 0 where a fixed one is high enough."""
    further_odds: ClassVar[float] = 0.0
    """Logarithm of the odds of a mass that changes that are asked for beside those of every shot."""
    least_identified: ClassVar[float] = 0.5
    """Share of identified samples below which a mass over time does not describe the motion."""
    stroke_rows: ClassVar[int] = 0
    """Rows, two per period of the cut-off, that are left of one stroke however low the force's band is."""
    unread_column: ClassVar[int] = FORCES.index("brake")
    """Column of what no gauge reads: the brake's reads nearly all of what resists, and it is as if it read less."""
    made_of: ClassVar[str] = "breech force less brake, recuperator and friction"
    """What the active force is made of, in words."""
    scales: ClassVar[tuple[str, ...]] = (
        "the scale of the breech gauge or the bore area",
        "what no gauge reads in bore and brake",
    )
    """What of the forces may be off by a share, in words."""
    may_change: ClassVar[str] = "mass, friction or the breech chain"
    """What may change in a shot, in words."""

    @property
    def acts(self) -> Flags:
        """Samples at which the force drives the part, shape (n,)."""
        return self.force_n > 0

    @property
    def low_pass(self) -> LowPassFilter | None:
        """The filter that both sides have passed; None for recorded signals."""
        found = None if self.table is None else self.table.zero_phase
        return found if isinstance(found, LowPassFilter) else None

    @property
    def rms_release_n_s(self) -> float:
        """Root mean square of the impulse while the part is let go, for what expects none."""
        return math.hypot(self.release_n_s, self.u_release_n_s)

    @property
    def rate_hz(self) -> float:
        """Samples per second."""
        return 1.0 / self.step_s

    @property
    def force_n(self) -> Array:
        """F', shape (n,)."""
        return np.asarray(self.forces_n.sum(axis=1))

    def smooth(self, column: Array) -> Array:
        """Pass a column of the regression through a lower cut-off, `SLOWER` of its own; that of recorded signals stays.

        What a change, or a share, of a measured force would leave is that part of the force. With the force as it was
        measured such a column holds the gauges' noise, and so does what the rows leave: their product is no chance,
        but the square of that noise.

        Parameters
        ----------
        column : ndarray, shape (n,)
        """
        low_pass = self.low_pass
        if low_pass is None:
            return column
        return low_pass.at(SLOWER * low_pass.cutoff_hz).apply(column, self.rate_hz)

    @cached_property
    def smooth_force_n(self) -> Array:
        """F' without the gauges' noise, shape (n,)."""
        return self.smooth(self.force_n)

    @property
    def inside(self) -> Flags:
        """Samples of the identification interval, shape (n,)."""
        return (self.times_s >= self.interval_s[0]) & (self.times_s <= self.interval_s[1])

    @property
    def used(self) -> Flags:
        """Samples of the identification interval that can be trusted, shape (n,)."""
        return self.inside & self.trusted

    @cached_property
    def stroke_s(self) -> float:
        """Time of one stroke: that of the interval."""
        return self.interval_s[1] - self.interval_s[0]

    def outward(self, velocity_m_s: Array, travel_m: Array) -> tuple[Array, Array]:
        """Return velocity and travel as their largest values count: to the rear, and from battery."""
        return velocity_m_s, travel_m

    def moved(self, acceleration_m_s2: Array) -> tuple[Array, Array]:
        """Return velocity, and travel from where it is least, shape (n,) each: integrals of an acceleration."""
        moving = self.inside.astype(np.float64)
        velocity = np.maximum(integrate(moving * bridge(acceleration_m_s2, otherwise=0.0), self.step_s), 0.0)
        return velocity, integrate(moving * velocity, self.step_s)

    def unread_shapes(self, travel_m: Array, stroke_m: float) -> tuple[Array, ...]:
        """Return how an unread force may act over time, shape (n,) each: against the recoil from its beginning on."""
        return (np.expm1(-travel_m / (BEGINS * stroke_m)),)

    def turning_m_s2(self, share: float, mass_kg: float) -> Array:  # noqa: ARG002 - its rows end before it turns
        """Return what a share of the dry friction does where the part turns, shape (n,)."""
        return np.zeros(self.times_s.size)

    @property
    def cut_short(self) -> bool:
        """Whether the record ends before the recoil does."""
        return bool(self.interval_s[1] >= self.times_s[-1])

    def begins_in_motion(self, *, rested: bool) -> bool:  # noqa: ARG002 - nothing moves before it is fired
        """Return whether it moves when its record begins, by whether a rest was seen."""
        return False

    @property
    def memory_s(self) -> float:
        """Usual memory of its mass over time."""
        return MEMORY_S

    @property
    def before_the_turn(self) -> Flags:
        """Samples into which the filter spreads nothing of the friction's reversal at the end of travel, shape (n,)."""
        turned = np.abs(1.0 + self.friction_direction) / 2.0 > MOST_TURNED
        # what the filter spreads rings: where it crosses zero it is there all the same
        return ~np.logical_or.accumulate(turned & (self.times_s >= 0.5 * sum(self.interval_s)))

    def rows_from(self, apart: float) -> tuple[float, int, Flags]:
        """Return how far rows lie apart that should by so many samples, which is the first, and which of them count."""
        return apart, int(np.argmax(self.inside)), self.used & self.before_the_turn

    def filtered(self, low_pass: LowPassFilter) -> Regression:
        """Pass every column through one and the same filter.

        A column with lost samples is bridged for the filter, and everything within its reach of the
        bridge is no longer trusted.
        """
        columns = {
            "acceleration": self.acceleration_m_s2,
            "released": self.released,
            "friction_direction": self.friction_direction,
        }
        columns["release"] = self.release_per_s
        names = (*self.gauges, "friction")
        columns |= dict(zip(names, self.forces_n.T, strict=True))
        table = filter_alike(low_pass, columns, self.rate_hz)
        plain = replace(
            self,
            acceleration_m_s2=table["acceleration"],
            forces_n=np.column_stack([table[name] for name in names]),
            released=table["released"],
            friction_direction=table["friction_direction"],
            release_per_s=table["release"],
            trusted=table.trusted & self._reached(low_pass),
            table=table,
            shifts=None,
        )
        return plain if self.shifts is None else plain.with_shifts(self.shifts)

    def _reached(self, low_pass: LowPassFilter) -> Flags:  # noqa: ARG002 - what rests may be continued
        """Return where all that the filter needs of the motion was recorded, shape (n,)."""
        return np.ones(self.times_s.size, dtype=np.bool_)

    def with_shifts(self, shifts: Array) -> Regression:
        """Add the shapes of a shifted zero, as they would be recorded; they pass the regression's filter.

        Parameters
        ----------
        shifts : ndarray, shape (n, n_shifts)
        """
        if self.table is None:
            return replace(self, shifts=shifts)
        table = self.table.joined_by({f"shift {j}": column for j, column in enumerate(shifts.T)})
        filtered = np.column_stack([table[f"shift {j}"] for j in range(shifts.shape[1])])
        return replace(self, shifts=filtered, trusted=self.trusted & table.trusted)

    def with_acceleration(self, acceleration_m_s2: Array, made_of: Filtered) -> Regression:
        """Put another measurement of a' in its place.

        Its level while the part is held is what the battery stop balances; it is taken off there. It is
        found where the filter has not spread the pulse to.

        Parameters
        ----------
        acceleration_m_s2 : ndarray, shape (n,)
        made_of
            Columns that the acceleration was computed from: they must have passed the regression's filter.

        Raises
        ------
        ValueError
            If it has passed another filter.
        """
        if self.table is None or made_of.zero_phase != self.table.zero_phase:
            raise ValueError(f"the acceleration has passed {made_of.zero_phase}, the forces {self.low_pass}")
        baseline = acceleration_m_s2[(np.abs(self.released) < 1e-4) & made_of.trusted]
        held = float(np.median(baseline)) if baseline.size else 0.0
        acceleration = acceleration_m_s2 - held * (1.0 - self.released)
        return replace(self, acceleration_m_s2=acceleration, trusted=self.trusted & made_of.trusted)


def build_regression(
    signals: Signals, mechanism: Mechanism, acceleration_m_s2: Array, velocity_m_s: Array, static_m_s2: float
) -> Regression:
    """Set up both sides of the equation of motion from signals as recorded.

    Parameters
    ----------
    acceleration_m_s2 : ndarray, shape (n,)
        a' by the inertial route; NaN where lost.
    velocity_m_s : ndarray, shape (n,)
        Velocity of recoil; its sign is that of the friction.
    static_m_s2
        a' at rest in battery, which the battery stop balances while it holds the part.

    Raises
    ------
    IdentificationError
        If a pressure is missing or all that tells of it is lost, or the part is never driven to the rear or never moves
        there.
    """
    if missing := [role for role in PRESSURE_ROLES if role not in signals.series]:
        raise missing_forces(missing)
    m, s = mechanism, signals.series
    times = signals.times_s
    end_s = end_of_travel(times, velocity_m_s, signals.onset_s)
    read = {role: s[role] for role in PRESSURE_ROLES} | {"recoil_acceleration": acceleration_m_s2}
    refuse_lost(read, (times >= signals.onset_s) & (times <= end_s))
    friction_direction = -np.where(times <= end_s, 1.0, np.sign(velocity_m_s))
    forces = np.column_stack(
        [
            breech_force_on_body_n(s[PRESSURE_ROLES[0]], signals.step_s, m),
            *(-s[role] * area for role, area in zip(PRESSURE_ROLES[1:], m.force_areas[1:], strict=True)),
            m.friction * friction_direction - m.slide_friction * velocity_m_s,
        ]
    )
    net = np.asarray(forces.sum(axis=1))
    release = release_index(times, net, signals.onset_s)
    stop_release = stop_release_impulse(times, net, signals.onset_s, m.m3)
    released = (np.arange(times.size) >= release).astype(np.float64)
    friction_direction[:release] = 0.0
    # between the onset and the release a lost pressure may hide the release itself: it stays lost
    known = np.isfinite(forces[:release]) | (times[:release, np.newaxis] < signals.onset_s)
    forces[:release] = np.where(known, 0.0, np.nan)
    acceleration = acceleration_m_s2.copy()
    acceleration[:release] -= static_m_s2
    trusted = np.isfinite(acceleration) & np.isfinite(forces).all(axis=1)
    interval = (signals.onset_s, end_s)
    return Regression(
        times,
        signals.step_s,
        acceleration,
        forces,
        released,
        friction_direction,
        stop_release.per_s,
        trusted,
        interval,
        stop_release.mean_n_s,
        stop_release.u_n_s,
    )


def missing_forces(roles: Sequence[str]) -> IdentificationError:
    """Return what a shot without some of its forces is refused with."""
    return IdentificationError(
        f"no usable channel of role {', '.join(roles)}: without all forces a motion identifies no mass",
        expected="breech, brake and recuperator pressure, on clocks that could be aligned",
        remedy="declare the roles in the rig file, or mend the alignment",
    )


def refuse_lost(series: Mapping[str, Array], inside: Flags) -> None:
    """Refuse a motion of which a sensor lost all.

    Parameters
    ----------
    series : mapping of str to ndarray, shape (n,)
        Samples as read, by role or name; lost ones NaN.
    inside : ndarray of bool, shape (n,)
        Samples of the motion.

    Raises
    ------
    IdentificationError
        Naming each of which fewer than `FEWEST` samples are there.
    """
    there = {name: int(np.count_nonzero(np.isfinite(samples[inside]))) for name, samples in series.items()}
    lost = {name: count for name, count in there.items() if count < FEWEST}
    if lost:
        raise IdentificationError(
            f"nothing tells of {', '.join(lost)} during the motion: its samples are lost",
            expected=f"{FEWEST} samples or more of each",
            found=", ".join(f"{count} of {name}" for name, count in lost.items()),
            remedy="check file, range and cable",
        )


def spaced_rows(regression: Regression) -> NDArray[np.int64]:
    """Return the indices of rows of a filtered regression that carry about independent errors.

    White noise behind a low-pass at fc is uncorrelated at intervals of about ``1 / (2 fc)``; rows are
    taken twice per period of the cut-off, so that nothing is lost and little repeated.
    They end before the filter spreads the friction's reversal at the end of travel into them. Where a body on a line is
    driven for so short a time that this gives few, those of the quiet around it count, too: no stop holds it there, and
    the filter spreads the pulse into them.

    Returns
    -------
    ndarray of int64
        Rows within the identification interval, trusted ones only; every row of it for recorded signals.
    """
    if regression.low_pass is None:
        return np.flatnonzero(regression.used & regression.before_the_turn)
    # by time, not by a whole number of samples: the rows of thinned channels are those of the full rate
    apart, first, used = regression.rows_from(max(1.0, regression.rate_hz / (2.0 * regression.low_pass.cutoff_hz)))
    rows = np.round(np.arange(first, regression.times_s.size - 0.5, apart)).astype(np.int64)
    return rows[used[rows]]


def telling_rows(regression: Regression) -> NDArray[np.int64]:
    """Return the indices of rows that tell a mass, `spaced_rows` of them.

    Raises
    ------
    IdentificationError
        If they are fewer than `LEAST_ROWS`, or no positive mass relates force and acceleration.
    """
    rows = spaced_rows(regression)
    if rows.size < LEAST_ROWS:
        raise IdentificationError(
            f"only {rows.size} independent rows in the identification interval",
            expected=f"at least {LEAST_ROWS}",
            remedy="check for lost samples, raise the cut-off, or record faster",
        )
    common = float(regression.acceleration_m_s2[rows] @ regression.force_n[rows])
    if not common > 0:
        raise IdentificationError(
            "force and acceleration do not go together: no positive mass relates them",
            found=f"a sum of their products of {common:.3g} N m/s^2",
            remedy="check areas, units and polarities in the rig file",
        )
    return rows
