"""The true motion of a virtual body on a line, by the classical Runge-Kutta method.

With x along the driving force, whose direction rises by phi20 over the horizontal:

    m x'' = D(t, x, v) - R(x, v) - Q - c v - dF - m g sin(phi20)

D is what drives: a push ``push_n sin^2(pi t / push_s)``, and a servo that follows strokes of smallest jerk
(``x / L = 10 u^3 - 15 u^4 + 6 u^5``, ``u = t / T``: T. Flash and N. Hogan, J. Neuroscience 5, 1985) by their
acceleration, their speed and their place. R is what resists and is read: a brake and a buffer. Q is the friction of a
packing that gives until it slides, c v that of the slides, dF what else no sensor reads. m is what the forces move:
the body and what it carries.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_rigs.mechanism.model import Mechanism
from recoil_rigs.twin.line_settings import LineSettings
from recoil_rigs.twin.unread_forces import SLIDES_FROM_M_S, Unread, UnreadForces, unread_force

Force = Callable[[float, float], float]

_RINGING_STEP_S, _LONGEST_STEP_S, _ROUGH_STEP_S = 25e-6, 200e-6, 500e-6
"""Longest steps with stress waves, which are computed on the motion's grid, without, and where sizes alone count."""
_STEPS_IN_A_RADIAN = 40
"""Steps in a radian of the fastest oscillation: of the buffer, of the packing."""
_PRESLIDING_DAMPING = 0.5
"""Damping of the packing before it slides, share of the critical one."""
MOVES_FROM = 0.01
"""Share of the largest speed below which the body rests."""


@dataclass(frozen=True, eq=False)
class LineMotion(ReadOnlyArrays):
    """True motion and forces at the instants of the reference clock, shape (n,) each.

    Attributes
    ----------
    times_s
        Times on a uniform grid from 0.
    travel_m, speed_m_s, acceleration_m_s2
        Travel from the start of the motion, its rate, and the rate of that.
    specific_m_s2
        Specific force along the line, which an accelerometer feels.
    driving_n, resisting_n
        Forces that sensors read.
    friction_n
        Friction of the packing, positive against the travel.
    unread_n
        Force that no sensor reads beside it, positive against the travel.
    t_fire_s, t_end_s
        Start of the push and of the strokes, negative if it lies before the record; end of the last motion.
    """

    times_s: Array
    travel_m: Array
    speed_m_s: Array
    acceleration_m_s2: Array
    specific_m_s2: Array
    driving_n: Array
    resisting_n: Array
    friction_n: Array
    unread_n: Array
    t_fire_s: float
    t_end_s: float

    def moves(self, at_s: Array) -> Flags:
        """Return at which instants the body moves, shape (n,)."""
        speed = np.abs(self.speed_m_s)
        return np.interp(at_s, self.times_s, speed) > MOVES_FROM * float(speed.max())

    def ringing_m_s2(self, ringing: float, mechanism: Mechanism) -> float:  # noqa: ARG002 - as of a gun's motion
        """Return the peak of the stress waves, m/s^2, a share of the largest acceleration."""
        return ringing * float(np.abs(self.acceleration_m_s2).max())


def reference_travel(settings: LineSettings, times_s: Array) -> tuple[Array, Array, Array]:
    """Return travel, speed and acceleration that the servo follows, m, m/s and m/s^2, shape (n,) each.

    Parameters
    ----------
    times_s
        Times from the start of the strokes, shape (n,).
    """
    length, lasts, each = settings.stroke_m, settings.stroke_s, settings.stroke_s + settings.pause_s
    number = np.clip(np.floor(times_s / each), 0, max(settings.strokes - 1, 0))
    u = np.clip((times_s - number * each) / lasts, 0.0, 1.0)
    forth = number % 2 == 0
    sign = np.where(forth, 1.0, -1.0)
    x = np.where(forth, 0.0, length) + sign * length * u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
    v = sign * length / lasts * 30.0 * u**2 * (1.0 - u) ** 2
    a = sign * length / lasts**2 * 60.0 * u * (1.0 - u) * (1.0 - 2.0 * u)
    return x, v, a


def resistance(settings: LineSettings) -> Force:
    """Return the force of brake and buffer as a function of travel and its rate, N, positive against the travel."""
    tanh, s = math.tanh, settings
    brakes, buffers = bool(s.brake_n or s.brake_n_s_m), bool(s.buffer_n_m)

    def force(x: float, v: float) -> float:
        total = 0.0
        if brakes and x > s.brake_from_m:
            share = min((x - s.brake_from_m) / s.brake_over_m, 1.0)
            total = share * (s.brake_n * tanh(v / SLIDES_FROM_M_S) + s.brake_n_s_m * v)
        if buffers and x > s.buffer_from_m:
            total += max(s.buffer_n_m * (x - s.buffer_from_m) + s.buffer_n_s_m * v, 0.0)
        return total

    return force


def _unread(forces: UnreadForces, stroke_m: float, friction_n: float, t_fire_s: float) -> Unread | None:
    return unread_force(
        forces, brake_area_m2=1.0, recuperator_area_m2=0.0, stroke_m=stroke_m, friction_n=friction_n,
        largest_force_n=forces.largest_force_n or 0.0, t_fire_s=t_fire_s,
    )  # fmt: skip


def simulate_line(
    mechanism: Mechanism,
    settings: LineSettings,
    *,
    moved_kg: float,
    friction_n: float,
    reach_m: float,
    rough: bool = False,
) -> LineMotion:
    """Integrate the equation of motion through one shot, or one record of strokes.

    Parameters
    ----------
    moved_kg
        Mass that the forces move, that is carried along included.
    friction_n
        True friction of the packing while it slides.
    reach_m
        Travel from the lowest place to the highest, over which forces by place are drawn.
    rough
        Whether the sizes of forces and travel are all that is asked for, which longer steps tell as well.

    Raises
    ------
    ValueError
        If a mass or a friction is none.
    """
    if not moved_kg > 0:
        raise ValueError(f"moved_kg must be positive, found {moved_kg!r}")
    if not friction_n >= 0:
        raise ValueError(f"friction_n must not be negative, found {friction_n!r}")
    s = settings
    longest_s = _ROUGH_STEP_S if rough else _RINGING_STEP_S if s.ringing else _LONGEST_STEP_S
    longest_s = min(longest_s, _resolved_s(s, moved_kg, friction_n))
    rate_hz = float(math.ceil(1.0 / longest_s))
    if not rough:
        rate_hz = s.sample_rate_hz * math.ceil(1.0 / (s.sample_rate_hz * longest_s) - 1e-9)
    step = 1.0 / rate_hz
    first = round(s.begins_s * rate_hz)
    count = first + round(s.duration_s * rate_hz)
    halves_s = np.arange(2 * count + 1) / (2.0 * rate_hz) - s.pre_trigger_s
    push, ahead, to_m, to_m_s = _drive(mechanism, s, halves_s, moved_kg)
    stiffness, damping = _servo(s, moved_kg)
    weight = mechanism.g * math.sin(mechanism.phi20)
    holds, k_packing, slip = resistance(s), friction_n / s.presliding_m, s.presliding_m
    c_packing = _PRESLIDING_DAMPING * 2.0 * math.sqrt(k_packing * moved_kg)
    hidden = _unread(s.unread, reach_m, friction_n, s.pre_trigger_s)
    slides = s.unread.slide_n_s_m

    def evaluate(x: float, v: float, bristle: float, i: int) -> tuple[float, float, float, float, float, float]:
        """Return acceleration and the bristle's rate; driving, resisting, packing and unread force."""
        drive = push[i] + ahead[i] + stiffness * (to_m[i] - x) + damping * (to_m_s[i] - v)
        held = holds(x, v)
        drag = 0.0 if (bristle >= slip and v > 0.0) or (bristle <= -slip and v < 0.0) else v
        packing = min(max(k_packing * bristle + c_packing * drag, -friction_n), friction_n)
        unread = 0.0
        if hidden is not None:
            unread = hidden(x, v, abs(held) + friction_n + slides * abs(v), 0.0, 0.5 * i * step)
        return (drive - held - packing - unread) / moved_kg - weight, drag, drive, held, packing, unread

    rests_until = round(s.pre_trigger_s * rate_hz) if s.rests else 0
    x, v, bristle = 0.0, s.start_m_s, math.copysign(slip, s.start_m_s) if s.start_m_s else 0.0
    rows = array("d")
    sixth = step / 6.0
    for n in range(count):
        i = 2 * n
        a1, b1, drive, held, packing, unread = evaluate(x, v, bristle, i)
        if n < rests_until:
            # the latch takes up whatever acts
            rows.extend((x, v, 0.0, 0.0, held, packing, unread))
            continue
        if n >= first:
            rows.extend((x, v, a1, drive, held, packing, unread))
        v2 = v + 0.5 * step * a1
        a2, b2 = evaluate(x + 0.5 * step * v, v2, bristle + 0.5 * step * b1, i + 1)[:2]
        v3 = v + 0.5 * step * a2
        a3, b3 = evaluate(x + 0.5 * step * v2, v3, bristle + 0.5 * step * b2, i + 1)[:2]
        v4 = v + step * a3
        a4, b4 = evaluate(x + step * v3, v4, bristle + step * b3, i + 2)[:2]
        x += sixth * (v + 2.0 * (v2 + v3) + v4)
        v += sixth * (a1 + 2.0 * (a2 + a3) + a4)
        bristle = min(max(bristle + sixth * (b1 + 2.0 * (b2 + b3) + b4), -slip), slip)
    table = np.frombuffer(rows).reshape(-1, 7)[-(count - first) :]
    travel, speed, acceleration, driving, resisting, packing_n, unread_n = (np.array(column) for column in table.T)
    times = np.arange(count - first) / rate_hz
    moving = np.flatnonzero(np.abs(speed) > MOVES_FROM * float(np.abs(speed).max()))
    return LineMotion(
        times, travel, speed, acceleration, acceleration + weight, driving, resisting, packing_n, unread_n,
        t_fire_s=s.pre_trigger_s - first / rate_hz, t_end_s=float(times[moving[-1]]) if moving.size else 0.0,
    )  # fmt: skip


def _resolved_s(s: LineSettings, moved_kg: float, friction_n: float) -> float:
    """Return the longest step that resolves what oscillates; infinite if nothing does."""
    fastest = math.sqrt(max(s.buffer_n_m, friction_n / s.presliding_m) / moved_kg)
    return 1.0 / (_STEPS_IN_A_RADIAN * fastest) if fastest else math.inf


def _servo(s: LineSettings, moved_kg: float) -> tuple[float, float]:
    """Return the servo's force per travel and per speed that it is off, critically damped; 0 without strokes."""
    w = 2.0 * math.pi * s.servo_hz if s.strokes else 0.0
    return moved_kg * w**2, 2.0 * moved_kg * w


def _drive(m: Mechanism, s: LineSettings, since_s: Array, moved_kg: float) -> tuple[list[float], ...]:
    """Return the push, what the servo gives ahead of any error, and the travel and speed it follows, by half steps."""
    phase = since_s / s.push_s
    push = np.where((phase > 0.0) & (phase < 1.0), s.push_n * np.sin(np.pi * phase) ** 2, 0.0)
    ahead = place = speed = np.zeros(since_s.shape)
    if s.strokes:
        place, speed, acceleration = reference_travel(s, since_s)
        ahead = moved_kg * (acceleration + m.g * math.sin(m.phi20))
    return tuple([float(value) for value in one] for one in (push, ahead, place, speed))
