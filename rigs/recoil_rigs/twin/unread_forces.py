"""Forces along the bore that no gauge reads, as a virtual rig may have them: the table ``[twin.unread]``.

Each is a resistance dF, positive against the recoil, in the equation of the travel: ``m3 a' = P - K - R - Q - dF`` with
the forces of breech, brake, recuperator and packing. With the travel x, its rate v and ``dir = tanh(v / 0.02 m/s)``,
which is the sign of a motion that slides:

=============================  =======================================================================
packings that grip             ``packing_share dir (K + R)``
other side of the brake        ``-back_pressure_pa A_K (1 - exp(-x / back_pressure_reach_m))``, v > 0
slides and seals               ``slide_n_s_m v``
control rod, taper             ``rod_share K x / stroke``
floating piston                ``floating_piston_pa A_R dir``
oil that is carried along      ``carried_oil_kg x''``
part that hangs elastically    ``hanging_kg z''`` with ``z'' = -x'' - 2 h w z' - w^2 z``, ``w = 2 pi hanging_hz``
                               and h its damping
engraving and drag in the bore ``bore_drag P [1 + 2 exp(-(x_p / 20 mm)^2)]`` until the exit
muzzle brake                   ``muzzle_brake P (1 - exp(-(t - t_e) / 0.3 ms))`` after the exit
breakaway                      ``breakaway Q exp(-(v / 0.3 m/s)^2) (1 - exp(-x / 0.3 mm)) dir``
friction by place              ``friction_by_place Q g(x) dir``
friction by speed (Stribeck)   ``friction_by_speed Q exp(-|v| / friction_speed_m_s) dir``
rough force                    ``rough_share F_max g(x) (1 - exp(-x / 0.01 stroke))``
latent force                   ``latent_share F_max g(x) (1 - exp(-x / 0.01 stroke))``
slide that stiffens            ``stiffening_n (x / stroke - 0.6) / 0.4 dir`` beyond 60 % of the stroke
bump                           ``bump_n exp(-((x - bump_place_m) / bump_width_m)^2) dir``
stick that lets go             ``stick_n exp(-(t - t_0) / stick_decay_s) dir``
structure that swings          ``swing_n sin(2 pi swing_hz (t - t_0)) dir``
=============================  =======================================================================

t_0 is the first rise of the breech force, t_e the projectile's exit, x_p its travel, the integral of the integral of
``P / m_p``; F_max the largest resistance of brake, recuperator and packing together. g are random curves of mean 0 and
variance 1 over the travel: with covariance ``exp(-(x / l)^2 / 2)`` of friction and rough force, and
``(1 + d) exp(-d)``, ``d = sqrt(3) x / l``, of the latent one (Matern 3/2: B. Matern, "Spatial Variation", 1960). The
mass of the oil is an inertia between tipping and recoiling part and moves neither of their centres: it counts in the
equation of the travel alone. Drag and muzzle brake act where the breech force does.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_acquisition.quantities.declaration import Finite, NotNegative, Positive

Unread = Callable[[float, float, float, float, float], float]
"""Function from travel, its rate, pressures of brake and recuperator, and time to the force that no gauge reads."""

SLIDES_FROM_M_S = 0.02
"""Speed at which a force that opposes the motion is fully there."""
_ENGRAVING_M, _ENGRAVING = 0.02, 2.0
_MUZZLE_RISE_S = 3e-4
_BREAKAWAY_M_S, _BREAKAWAY_M = 0.3, 3e-4
_SETTLES = 0.01
"""Share of the stroke within which a force over the travel has come up from none in battery."""
_STIFF_FROM = 0.6
_NODES, _TABLE, _REACH = 8, 2000, 1.25
"""Places in a length at which a curve is drawn, places at which it is tabled, and strokes over which it reaches."""

Share = Annotated[float, Field(ge=-0.5, le=0.5)]


class UnreadForces(BaseModel):
    """Forces that resist the recoil and that no gauge reads; none of them is there if left out."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    packing_share: Share = 0.0
    """Share of brake and recuperator force with which packings grip, beside the constant friction."""
    back_pressure_pa: Finite = 0.0
    """Pressure on the other side of the brake's piston while it recoils, against the gauge's; negative for a vacuum."""
    back_pressure_reach_m: Positive = 0.03
    """Travel within which that pressure builds up."""
    slide_n_s_m: Finite = 0.0
    """Viscous friction of slides and seals."""
    rod_share: Share = 0.0
    """Share by which the brake's effective area grows over the stroke: a control rod, a taper."""
    floating_piston_pa: Finite = 0.0
    """Pressure that a floating piston between oil and gas takes, where the gauge sits on the gas."""
    carried_oil_kg: NotNegative = 0.0
    """Mass of the oil that is accelerated with the recoiling part, as it acts on the travel."""
    hanging_kg: NotNegative = 0.0
    """Part of the recoiling mass that hangs on it elastically: oil, hoses, a sight."""
    hanging_hz: Positive = 20.0
    """Frequency at which that part swings along the bore."""
    hanging_damping: Annotated[float, Field(ge=0, lt=1)] = 0.2
    """Damping of that swing, share of the critical one."""
    bore_drag: Share = 0.0
    """Share of the breech force that engraving and drag take off until the exit, beside its friction."""
    muzzle_brake: Annotated[float, Field(ge=-1, le=1)] = 0.0
    """Share of the breech force that a muzzle brake takes off after the exit."""
    projectile_mass_kg: Positive = 15.0
    """Mass of the projectile, which decides when it leaves."""
    bore_length_m: Positive = 2.0
    """Travel of the projectile to its exit."""
    breakaway: NotNegative = 0.0
    """Rise of the friction as it breaks away, share of the packing friction."""
    leaving_gas_kg: NotNegative = 0.0
    """Mass that leaves the recoiling part as gas after the exit, with the velocity that it has."""
    leaving_s: Positive = 7e-3
    """Time constant with which that mass leaves."""
    friction_by_place: NotNegative = 0.0
    """Standard deviation of the packing friction over the travel, share of it."""
    friction_place_m: Positive = 0.15
    """Length over which that friction is alike."""
    friction_by_speed: Finite = 0.0
    """Rise of the packing friction towards rest, share of it."""
    friction_speed_m_s: Positive = 1.0
    """Speed over which that rise is lost."""
    rough_share: NotNegative = 0.0
    """Standard deviation of a random smooth force over the travel, share of `largest_force_n`."""
    rough_length_m: Positive = 0.15
    """Length over which that force is alike."""
    latent_share: NotNegative = 0.0
    """Standard deviation of a random force over the travel that has corners, share of `largest_force_n`."""
    latent_length: Positive = 0.35
    """Length over which that force is alike, strokes."""
    stiffening_n: Finite = 0.0
    """Force at the whole stroke of a slide that stiffens from 60 % of it on."""
    bump_n: Finite = 0.0
    """Force of a bump of the slide at its top."""
    bump_place_m: Positive = 0.4
    """Travel at the top of that bump."""
    bump_width_m: Positive = 0.03
    """Width of that bump, to 1/e of its top."""
    stick_n: Finite = 0.0
    """Force of a seal that sticks, at the first rise of the breech force."""
    stick_decay_s: Positive = 0.05
    """Time constant with which it lets go."""
    swing_n: Finite = 0.0
    """Amplitude of a force of the structure, which swings while the part moves."""
    swing_hz: Positive = 7.0
    """Frequency of that force."""
    largest_force_n: Positive | None = None
    """Largest resistance of brake, recuperator and packing together; that of a shot by the settings if left out."""
    curves_seed: Annotated[int, Field(ge=0)] | None = None
    """Seed of the random curves over the travel; that of the campaign, or of the shot, if left out."""

    @property
    def has_curves(self) -> bool:
        """Whether any force is a random curve over the travel."""
        return bool(self.friction_by_place or self.rough_share or self.latent_share)


class HangingPart:
    """A part that hangs elastically on the recoiling one, moved step by step beside it.

    It is a part of the recoiling mass: what it resists is how its acceleration differs from that of the rest.

    Attributes
    ----------
    force_n
        Force that it adds to the resistance, at the instant to which it was moved.
    """

    def __init__(self, unread: UnreadForces) -> None:
        self.force_n = 0.0
        self._mass_kg, self._w = unread.hanging_kg, 2.0 * math.pi * unread.hanging_hz
        self._damping, self._z, self._dz = unread.hanging_damping, 0.0, 0.0

    def beside(self, unread: Unread | None) -> Unread:
        """Return a force that no gauge reads with that of this part."""

        def both(x: float, v: float, p_brake: float, p_gas: float, t: float) -> float:
            return self.force_n if unread is None else unread(x, v, p_brake, p_gas, t) + self.force_n

        return both

    def move(self, acceleration_m_s2: float, step_s: float) -> None:
        """Move it by a step, short against its period, in which the rest has an acceleration."""
        ddz = -acceleration_m_s2 - 2.0 * self._damping * self._w * self._dz - self._w**2 * self._z
        self._dz += step_s * ddz
        self._z += step_s * self._dz
        self.force_n = self._mass_kg * ddz


@dataclass(frozen=True, eq=False)
class Projectile(ReadOnlyArrays):
    """The projectile in the bore, which decides what of the breech force reaches the recoiling part.

    Attributes
    ----------
    times_s, travel_m : ndarray, shape (n,)
        Times from the first rise of the breech force, and its travel.
    exit_s
        Time of its exit; infinite if it stays.
    """

    times_s: Array
    travel_m: Array
    exit_s: float

    @classmethod
    def driven(cls, times_s: Array, forces_n: Array, mass_kg: float, bore_m: float) -> Projectile:
        """Integrate its travel; times from the first rise of the breech force, shape (n,), evenly spaced."""
        step = float(times_s[1] - times_s[0])
        speed = np.concatenate([[0.0], np.cumsum(0.5 * (forces_n[1:] + forces_n[:-1]))]) * step / mass_kg
        travel = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]))]) * step
        leaves = float(np.interp(bore_m, travel, times_s)) if travel[-1] >= bore_m else math.inf
        return cls(times_s, travel, leaves)

    def drag(self, since_s: Array, unread: UnreadForces) -> Array:
        """Return the share of the breech force that drag and muzzle brake take off, shape (n,).

        Parameters
        ----------
        since_s : ndarray, shape (n,)
            Times from the first rise of the breech force.
        """
        travel = np.interp(since_s, self.times_s, self.travel_m)
        in_bore = unread.bore_drag * (1.0 + _ENGRAVING * np.exp(-((travel / _ENGRAVING_M) ** 2)))
        behind = np.maximum(since_s - self.exit_s, 0.0)
        return np.where(since_s < self.exit_s, in_bore, -unread.muzzle_brake * np.expm1(-behind / _MUZZLE_RISE_S))


def gas_left_kg(unread: UnreadForces, since_exit_s: float) -> float:
    """Return the mass that has left as gas at a time from the exit on."""
    if not since_exit_s > 0.0:
        return 0.0
    return -unread.leaving_gas_kg * math.expm1(-since_exit_s / unread.leaving_s)


def matern(distances: Array) -> Array:
    """Return the covariance ``(1 + d) exp(-d)``, ``d = sqrt(3)`` times a distance in correlation lengths."""
    d = math.sqrt(3.0) * np.abs(distances)
    return np.asarray((1.0 + d) * np.exp(-d), dtype=np.float64)


def gaussian(distances: Array) -> Array:
    """Return the covariance ``exp(-d^2 / 2)`` of a distance in correlation lengths."""
    return np.asarray(np.exp(-0.5 * distances**2), dtype=np.float64)


def random_curve(
    covariance: Callable[[Array], Array], length_m: float, reach_m: float, rng: np.random.Generator
) -> Array:
    """Draw a curve of mean 0 and variance 1 over 0 .. reach, tabled at even places, shape (n,)."""
    from scipy.interpolate import CubicSpline

    nodes = np.linspace(0.0, reach_m, max(math.ceil(_NODES * reach_m / length_m), _NODES) + 1)
    # of a smooth covariance some eigenvalues are of the size of rounding, which a Cholesky factor would not take
    matrix = covariance((nodes[:, np.newaxis] - nodes) / length_m) + 1e-9 * np.eye(nodes.size)
    drawn = np.linalg.cholesky(matrix) @ rng.normal(0.0, 1.0, nodes.size)
    return np.asarray(CubicSpline(nodes, drawn)(np.linspace(0.0, reach_m, _TABLE)), dtype=np.float64)


def unread_force(
    unread: UnreadForces,
    *,
    brake_area_m2: float,
    recuperator_area_m2: float,
    stroke_m: float,
    friction_n: float,
    largest_force_n: float,
    t_fire_s: float,
) -> Unread | None:
    """Return the force that no gauge reads as a function of the state; None if there is none.

    What acts where the breech force does, and what oil and gas weigh, is not in it.

    Parameters
    ----------
    friction_n
        Packing friction.
    largest_force_n
        Largest resistance in a shot, of which rough and latent forces are shares.
    t_fire_s
        First rise of the breech force.
    """
    exp, tanh, sin, u = math.exp, math.tanh, math.sin, unread
    over_place = _curve_n(u, stroke_m, largest_force_n)
    by_place = _friction_curve(u, stroke_m)
    plain = (
        u.packing_share, u.back_pressure_pa, u.slide_n_s_m, u.rod_share, u.floating_piston_pa, u.breakaway,
        u.friction_by_speed, u.stiffening_n, u.bump_n, u.stick_n, u.swing_n,
    )  # fmt: skip
    if not any(plain) and over_place is None and by_place is None:
        return None
    per_m = (_TABLE - 1) / (_REACH * stroke_m)
    last = _TABLE - 2
    packing, slide, reach = u.packing_share, u.slide_n_s_m, u.back_pressure_reach_m
    back_n, piston_n = u.back_pressure_pa * brake_area_m2, u.floating_piston_pa * recuperator_area_m2
    rod = u.rod_share / stroke_m
    shapes = any((u.breakaway, u.friction_by_speed, u.stiffening_n, u.bump_n, u.stick_n, u.swing_n))

    def at(table: list[float], x: float) -> float:
        place = x * per_m
        if place <= 0.0:
            return table[0]
        i = min(int(place), last)
        return table[i] + (place - i) * (table[i + 1] - table[i])

    def force(x: float, v: float, p_brake: float, p_gas: float, t: float) -> float:
        sign = tanh(v / SLIDES_FROM_M_S)
        K = brake_area_m2 * p_brake
        total = sign * (packing * (K + recuperator_area_m2 * p_gas) + piston_n) + slide * v + rod * K * x
        if back_n and sign > 0.0 and x > 0.0:
            total -= back_n * sign * (1.0 - exp(-x / reach))
        if over_place is not None:
            total += at(over_place, x)
        if by_place is not None:
            total += friction_n * sign * at(by_place, x)
        if shapes:
            opposing = u.stick_n * exp(-(t - t_fire_s) / u.stick_decay_s)
            opposing += u.swing_n * sin(2.0 * math.pi * u.swing_hz * (t - t_fire_s))
            opposing += u.bump_n * exp(-(((x - u.bump_place_m) / u.bump_width_m) ** 2))
            opposing += friction_n * u.friction_by_speed * exp(-abs(v) / u.friction_speed_m_s)
            if x > 0.0:
                settled = 1.0 - exp(-x / _BREAKAWAY_M)
                opposing += friction_n * u.breakaway * exp(-((v / _BREAKAWAY_M_S) ** 2)) * settled
            if x > _STIFF_FROM * stroke_m:
                opposing += u.stiffening_n * (x / stroke_m - _STIFF_FROM) / (1.0 - _STIFF_FROM)
            total += sign * opposing
        return total

    return force


def _curve_n(u: UnreadForces, stroke_m: float, largest_force_n: float) -> list[float] | None:
    """Return the table of rough and latent force together, N; None if there is neither."""
    if not (u.rough_share or u.latent_share):
        return None
    reach, total = _REACH * stroke_m, np.zeros(_TABLE)
    if u.rough_share:
        total += u.rough_share * random_curve(gaussian, u.rough_length_m, reach, _curves(u, 1))
    if u.latent_share:
        total += u.latent_share * random_curve(matern, u.latent_length * stroke_m, reach, _curves(u, 2))
    settled = -np.expm1(-np.linspace(0.0, reach, _TABLE) / (_SETTLES * stroke_m))
    return [float(value) for value in largest_force_n * settled * total]


def _friction_curve(u: UnreadForces, stroke_m: float) -> list[float] | None:
    """Return the table of the friction by place, share of it; None if it is the same everywhere."""
    if not u.friction_by_place:
        return None
    curve = random_curve(gaussian, u.friction_place_m, _REACH * stroke_m, _curves(u, 3))
    # a friction may fall to a tenth, and never drives
    return [float(value) for value in np.maximum(u.friction_by_place * curve, -0.9)]


def _curves(u: UnreadForces, which: int) -> np.random.Generator:
    return np.random.default_rng(np.random.SeedSequence(u.curves_seed or 0, spawn_key=[which]))
