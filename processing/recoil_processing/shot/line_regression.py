"""The equation of motion of a body on a line as a linear regression: ``m3 a' = sum F_j - friction``.

Gravity is in neither side, for a' is the specific force along the line.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_processing.filters import LowPassFilter
from recoil_processing.gaps import bridge, bridged_smoothly, near, runs_of
from recoil_processing.shot.blow import Blow
from recoil_processing.shot.line_motion import LineMotion, changes_in_s
from recoil_processing.shot.regression import LEAST_ROWS, LONGEST_SHARE, Regression, refuse_lost
from recoil_processing.shot.signals import Signals
from recoil_rigs.mechanism.line import Line
from recoil_rigs.rig import Rig

SLOW_SHARE = 0.05
"""Share of the largest speed below which a body stops."""
LEAST_SPACED = 24
"""Rows of a body on a line below which those of the quiet around its motion are counted."""
STANDS = 0.2
"""Share of the dry friction that is left, behind the filter, where a body on a line stands or turns."""

MOST_ZERO = 0.01
"""Share of the largest speed that its reading at rest may be off by: a friction turns within less."""
BRIDGED_CHANGE = 0.25
"""Share of the time in which the forces change for which a travel needs no frame: it is smoother than they by two
integrals."""


@dataclass(frozen=True, eq=False, kw_only=True)
class LineRegression(Regression):
    """Both sides of the equation of motion of a body that may move to and fro, driven or held at any time.

    Attributes
    ----------
    speed_m_s, travel_m : ndarray, shape (n,)
        Speed and place, behind no filter.
    turning_n
        Dry friction, which turns with the motion.
    blow
        Blows in a long record, which alone tell the mass; None where it is driven throughout.
    """

    speed_m_s: Array
    travel_m: Array
    turning_n: float = 0.0
    blow: Blow | None = None

    recoils_once = False
    further_odds = 2.0  # 150 to 1 in all, very strong by Kass and Raftery: strokes differ by themselves
    least_identified = 0.0  # it coasts between its drives, and nothing tells a mass then
    stroke_rows = 30  # a force that stays the same has its energy at nothing
    unread_column = -1  # beside all gauges
    force_rate_hz = Line.force_rate_hz
    bands = 2.0  # a pulse on a line may be far shorter than a gun's
    made_of = "all that drives less all that resists and friction"
    scales = ("the scale of what drives", "what no gauge reads of what resists")
    may_change = "mass or friction"

    @property
    def inside(self) -> Flags:
        """Samples of the identification interval, shape (n,).

        Of blows in a long record those alone: beside them there is noise of force and motion, and it has a mass, too.
        """
        return super().inside if self.blow is None else np.asarray(super().inside & self.blow.flags)

    @property
    def acts(self) -> Flags:
        """Samples with a force, shape (n,): what moves already is driven by what stops it."""
        return np.asarray(self.force_n != 0)

    def smooth(self, column: Array) -> Array:
        """Leave a column as it is: the cut-off is as low as the force allows, there is nothing below it."""
        return column

    @cached_property
    def stroke_s(self) -> float:
        """Time from one stop of the body to the next; it stops where its speed is below `SLOW_SHARE` of the largest."""
        whole_s = self.interval_s[1] - self.interval_s[0]
        speed = np.abs(self.speed_m_s[self.inside])
        moves = speed > SLOW_SHARE * np.max(speed, initial=0.0)
        strokes = np.sort([stop - start for start, stop in runs_of(moves)])
        if not strokes.size:
            return whole_s
        # that of which half of the motion is part: about a stop noise makes many short ones
        middle = int(np.searchsorted(np.cumsum(strokes), 0.5 * strokes.sum()))
        return min(float(strokes[middle]) * self.step_s, whole_s)

    def outward(self, velocity_m_s: Array, travel_m: Array) -> tuple[Array, Array]:
        """Return velocity and travel as their largest values count: either way, and from where it is furthest back."""
        return np.abs(velocity_m_s), travel_m - np.min(travel_m, initial=np.inf)

    def moved(self, acceleration_m_s2: Array) -> tuple[Array, Array]:  # noqa: ARG002 - they are told
        """Return velocity, and travel from where it is least, shape (n,) each: as told."""
        return self.speed_m_s, self.travel_m - float(np.min(self.travel_m[self.inside], initial=np.inf))

    def unread_shapes(self, travel_m: Array, stroke_m: float) -> tuple[Array, ...]:  # noqa: ARG002 - anywhere alike
        """Return how an unread force may act: it turns with the motion as friction, or stays as a spring: as likely."""
        return math.sqrt(0.5) * self.friction_direction, -math.sqrt(0.5) * self.released

    def turning_m_s2(self, share: float, mass_kg: float) -> Array:
        """Return what a share of the dry friction does where the body turns, shape (n,)."""
        turns = np.clip(1.0 - np.abs(self.friction_direction), 0.0, 1.0)
        return np.asarray(share * self.turning_n / mass_kg * turns)

    @property
    def cut_short(self) -> bool:
        """Whether the record ends before the recoil does: there is none."""
        return False

    def begins_in_motion(self, *, rested: bool) -> bool:
        """Return whether it moves when its record begins, by whether a rest was seen."""
        return not rested

    @property
    def memory_s(self) -> float:
        """Usual memory of its mass over time: a share of a stroke."""
        return max(LONGEST_SHARE * self.stroke_s, LEAST_ROWS * self.step_s)

    @property
    def before_the_turn(self) -> Flags:
        """Samples at which the body does not stand, shape (n,): what holds it then no gauge reads."""
        return np.asarray((np.abs(self.friction_direction) >= STANDS) | (self.turning_n == 0.0))

    def rows_from(self, apart: float) -> tuple[float, int, Flags]:
        """Return how far rows lie apart, which is the first, and which count: of few those of the quiet around, too."""
        # a body on a line is at no other rate than its own, and may have few rows: rounded down there are more
        whole = int(apart)
        _, first, used = super().rows_from(apart)
        count = int(self.inside.sum())
        lacking = LEAST_SPACED - int(count / whole)
        if lacking > 0:
            around = whole * -(-lacking // 2)
            used = self.trusted & near(self.inside, around)
            first = max(first - around, first % whole)
        return float(whole), first, used

    def _reached(self, low_pass: LowPassFilter) -> Flags:
        """Leave out a period of the cut-off at either end of the record, beyond which the body moves on.

        Of what was differentiated two, and of its own record: its noise is largest where it ends.
        """
        reached, known = super()._reached(low_pass), np.flatnonzero(self.trusted)
        felt = self.motion_role == "recoil_acceleration"
        reach = math.ceil((1 if felt else 2) * self.rate_hz / low_pass.cutoff_hz)
        ends = (0, reached.size) if felt or not known.size else (int(known[0]), int(known[-1]) + 1)
        reached[: ends[0] + reach] = reached[max(ends[1] - reach, 0) :] = False
        return reached


def line_motion(signals: Signals, rig: Rig) -> LineMotion:
    """Return the motion of a body on a line by its signals.

    Raises
    ------
    IdentificationError
        If nothing was recorded of it.
    """
    forces = [signals.series[force.name] for force in rig.forces if force.name in signals.series]
    series = dict(signals.series)
    if "recoil_displacement" in series and forces:
        longest_s = BRIDGED_CHANGE * changes_in_s(
            np.sum([bridge(one, otherwise=0.0) for one in forces], axis=0), signals.step_s
        )
        series["recoil_displacement"] = bridged_smoothly(series["recoil_displacement"], int(longest_s / signals.step_s))
    speed = series.get("recoil_velocity")
    if speed is not None and (rests := signals.in_baseline & np.isfinite(speed)).any():
        level = float(np.median(speed[rests]))
        # what coasts is no zero
        if abs(level) < MOST_ZERO * float(np.nanmax(np.abs(speed))):
            series["recoil_velocity"] = speed - level
    static = rig.mechanism.at_rest.get("recoil_acceleration", 0.0)
    offset = signals.offsets.get("recoil_acceleration")
    u_zero = 0.0 if offset is None else offset.u
    return LineMotion.of(signals.times_s, series, forces, static, u_zero)


def line_regression(signals: Signals, rig: Rig, motion: LineMotion) -> LineRegression:
    """Set up both sides of the equation of motion of a body on a line, as recorded.

    While it is held, before it moves and after, both sides are zero by construction.

    Raises
    ------
    IdentificationError
        If a force was not recorded or all that tells of it is lost, or a speed is needed that nothing tells.
    """
    m, s = rig.mechanism, signals.series
    missing = [force.name for force in rig.forces if force.name not in s]
    if missing or not rig.forces:
        raise IdentificationError(
            f"no usable channel of force {', '.join(missing)}" if missing else "the rig has no channel of a force",
            expected="every force that the rig declares, on a clock that could be aligned",
            remedy="declare its role in the rig file, or mend the alignment",
        )
    inside = (signals.times_s >= motion.interval_s[0]) & (signals.times_s <= motion.interval_s[1])
    refuse_lost({force.name: s[force.name] for force in rig.forces}, inside)
    rubs = any((m.friction, m.slide_friction, m.u.get("friction", 0.0), m.u.get("slide_friction", 0.0)))
    if rubs and not motion.speed_told and motion.driven[0]:
        raise IdentificationError(
            "the body moves when the record begins, and nothing tells how fast: where its friction points is unknown",
            expected="a channel of role recoil_velocity or recoil_displacement, or a rest before the motion",
            remedy="record the speed, begin the record earlier, or state a friction of 0 with `u_friction = 0`",
        )
    whole = 1.0 + m.unread_share
    direction = motion.friction_direction
    speed = np.where(motion.driven, motion.velocity_m_s, 0.0)
    columns = [force.sign * force.per_reading * s[force.name] for force in rig.forces]
    forces = np.column_stack([*columns, whole * (m.friction * direction - m.slide_friction * speed)])
    read = np.sum([bridge(column, otherwise=0.0) for column in columns], axis=0)
    blow = Blow.of(read, inside, signals.rate_hz)
    interval_s = motion.interval_s
    if blow is not None:
        interval_s = tuple(signals.times_s[np.flatnonzero(blow.flags)[[0, -1]]].tolist())
    released = motion.driven.astype(np.float64)
    static = m.at_rest.get("recoil_acceleration", 0.0)
    forces = np.where(motion.driven[:, np.newaxis], forces, 0.0)
    acceleration = np.where(motion.driven, motion.acceleration_m_s2, motion.acceleration_m_s2 - static)
    return LineRegression(
        times_s=signals.times_s,
        step_s=signals.step_s,
        acceleration_m_s2=acceleration,
        forces_n=forces,
        released=released,
        friction_direction=direction,
        release_per_s=np.zeros(speed.size),
        trusted=np.isfinite(acceleration) & np.isfinite(forces).all(axis=1),
        interval_s=interval_s,
        release_n_s=0.0,
        u_release_n_s=0.0,
        gauges=tuple(force.name for force in rig.forces),
        signs=tuple(force.sign for force in rig.forces),
        motion_role=motion.role,
        speed_m_s=speed,
        travel_m=motion.travel_m,
        blow=blow,
        turning_n=whole * math.hypot(m.friction, m.u.get("friction", 0.0)),
    )
