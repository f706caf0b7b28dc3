"""The true motion of the virtual rig: integration of its equations of motion through one shot.

A part of the recoiling mass may let go while it moves: it leaves with the velocity that it has, so that the
rest goes on with its own. The part is taken to have its centre of mass where the recoiling part has it, and no
moment of inertia worth mentioning: centre of mass and moment of inertia of the rest stay what they were.
"""

from __future__ import annotations

import dataclasses
import math
from array import array
from dataclasses import dataclass, field

import numpy as np

from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_rigs.mechanism.flexible_tube import FlexibleTube, sag, uniform_tube
from recoil_rigs.mechanism.model import Mechanism
from recoil_rigs.twin.equations import Equations, rigid_equations
from recoil_rigs.twin.loads import Rest, State, check_statics, pressures_of, rest_in_battery
from recoil_rigs.twin.nominal_recoil import NominalRecoil, nominal_recoil
from recoil_rigs.twin.settings import TwinSettings
from recoil_rigs.twin.tube_equations import tube_equations
from recoil_rigs.twin.unread_forces import HangingPart, Projectile, Unread, gas_left_kg, unread_force

_LARGEST_STEP_S = 25e-6
MOVES_FROM_M_S = 0.02
"""Speed below which the recoiling part rests, once it is back."""


@dataclass(frozen=True, eq=False)
class Motion(ReadOnlyArrays):
    """True states and loads at the instants of the reference clock, shape (n,) each.

    Attributes
    ----------
    times_s
        Times on a uniform grid from 0; rest before.
    q, qd, qdd : ndarray, shape (n, 5)
        State, rate and acceleration in the order of `recoil_rigs.mechanism.model`.
    friction_n
        Packing friction, positive against recoil.
    contact_n
        Force with which the stop, and the throttling of the counter-recoil, push rearward.
    elevating_moment_n_m, ground_x_n, ground_y_n, ground_d_n, ground_friction_n
        Loads in the signs of `recoil_rigs.mechanism.model.generalized_forces`.
    t_fire_s, t_end_s
        First rise of the breech force; end of recoil travel, NaN if it lies behind the record.
    unread_n, breech_drag_n
        Force that no gauge reads, positive against the recoil: of what resists, oil that is carried along included; and
        what drag and muzzle brake take off the breech force.
    gas_kg
        Mass that has left the recoiling part as gas.
    t_exit_s
        Instant at which the projectile leaves, where anything hangs on it; NaN otherwise.
    released_kg, t_release_s
        Mass that lets go of the recoiling part, and the instant; 0 and NaN if nothing does.
    modal, modal_rate, modal_acceleration : ndarray, shape (n, n_modes)
        Coordinates of the flexible tube and their rates, m, m/s and m/s^2; without columns if it is rigid.
    """

    times_s: Array
    q: Array
    qd: Array
    qdd: Array
    breech_pressure_pa: Array
    brake_pressure_pa: Array
    recuperator_pressure_pa: Array
    friction_n: Array
    contact_n: Array
    elevating_moment_n_m: Array
    ground_x_n: Array
    ground_y_n: Array
    ground_d_n: Array
    ground_friction_n: Array
    t_fire_s: float
    t_end_s: float
    unread_n: Array = field(default_factory=lambda: np.zeros(0))
    breech_drag_n: Array = field(default_factory=lambda: np.zeros(0))
    gas_kg: Array = field(default_factory=lambda: np.zeros(0))
    t_exit_s: float = math.nan
    released_kg: float = 0.0
    t_release_s: float = math.nan
    modal: Array = field(default_factory=lambda: np.zeros((0, 0)))
    modal_rate: Array = field(default_factory=lambda: np.zeros((0, 0)))
    modal_acceleration: Array = field(default_factory=lambda: np.zeros((0, 0)))

    @property
    def speed_m_s(self) -> Array:
        """Rate of the travel, m/s, shape (n,)."""
        return self.qd[:, 4]

    def moves(self, at_s: Array) -> Flags:
        """Return at which instants the part moves, from the first rise of the breech force on, shape (n,)."""
        fast = np.flatnonzero(np.abs(self.speed_m_s) > MOVES_FROM_M_S)
        still_s = float(self.times_s[fast[-1]]) if fast.size else self.t_fire_s
        return np.asarray((at_s >= self.t_fire_s) & (at_s <= still_s))

    def ringing_m_s2(self, ringing: float, mechanism: Mechanism) -> float:
        """Return the peak of the stress waves, m/s^2, a share of the largest acceleration by the breech force."""
        return ringing * mechanism.bore_area * float(self.breech_pressure_pa.max()) / mechanism.m3

    def resistance_n(self, mechanism: Mechanism) -> Array:
        """Return R_f with all its parts, shape (n,)."""
        return (
            mechanism.brake_area * self.brake_pressure_pa
            + mechanism.recuperator_area * self.recuperator_pressure_pa
            + self.friction_n
            - self.contact_n
            + self.unread_n
        )


def breech_pressure(times_s: Array, peak_pa: float, rise_s: float, decay_s: float) -> Array:
    """Return a breech pressure that rises like ``1 - exp(-(t / rise)^3)`` and decays like ``exp(-t / decay)``.

    Parameters
    ----------
    times_s
        Times from the first rise; the pressure is zero before.
    peak_pa
        Largest value of the pressure.
    rise_s, decay_s
        Time constants.
    """

    def shape(t: Array) -> Array:
        since = np.maximum(t, 0.0)
        pulse: Array = -np.expm1(-((since / rise_s) ** 3)) * np.exp(-since / decay_s)
        return pulse

    highest = float(shape(np.linspace(0.0, 5.0 * (rise_s + decay_s), 50_001)).max())
    return peak_pa / highest * shape(times_s)


def nominal_recoil_of(mechanism: Mechanism, settings: TwinSettings) -> NominalRecoil:
    """Return the recoil of a shot by the settings alone, see `recoil_rigs.twin.nominal_recoil`."""

    def breech(since_s: Array) -> Array:
        return breech_pressure(since_s, settings.peak_pressure_pa, settings.rise_s, settings.decay_s)

    return nominal_recoil(mechanism, pressures_of(mechanism, settings), breech)


def _trial(y: State, change: State, step: float) -> State:
    """Return ``y`` moved by a step along rates of change."""
    return tuple([value + step * rate for value, rate in zip(y, change, strict=True)])


def _step(
    evaluate: Equations, y: State, k1: State, forces: tuple[float, float], t: float, step: float, slip: float
) -> State:
    """Return the state a step later, by the classical Runge-Kutta method.

    Parameters
    ----------
    y, k1
        State and its accelerations at the start.
    forces
        Breech force in the middle of the step and at its end.
    t
        Time at the start.
    slip
        Largest deflection of the packing's bristle, m.
    """
    n = len(y) // 2
    # how coordinates, rates and bristle change: the rates themselves, then what the equations of motion say
    d1 = y[n : 2 * n] + k1
    y2 = _trial(y, d1, 0.5 * step)
    d2 = y2[n : 2 * n] + evaluate(y2, forces[0], t + 0.5 * step)[0]
    y3 = _trial(y, d2, 0.5 * step)
    d3 = y3[n : 2 * n] + evaluate(y3, forces[0], t + 0.5 * step)[0]
    y4 = _trial(y, d3, step)
    d4 = y4[n : 2 * n] + evaluate(y4, forces[1], t + step)[0]
    sixth = step / 6.0
    *moved, bristle = [p + sixth * (a + 2 * (b + c) + d) for p, a, b, c, d in zip(y, d1, d2, d3, d4, strict=True)]
    return (*moved, min(max(bristle, -slip), slip))


def tube_of(mechanism: Mechanism, settings: TwinSettings) -> FlexibleTube | None:
    """Return the flexible tube of a virtual rig; None if it is rigid."""
    if not settings.tube_modes:
        return None
    return uniform_tube(
        settings.tube_length_m,
        settings.tube_mass_kg,
        settings.tube_bending_stiffness_n_m2,
        settings.tube_modes,
        settings.tube_damping,
        settings.tube_root_m,
        mechanism.e,
    )


def _equations(
    mechanism: Mechanism,
    tube: FlexibleTube | None,
    settings: TwinSettings,
    friction_n: float,
    rest: Rest,
    unread: Unread | None,
) -> Equations:
    if tube is None:
        return rigid_equations(mechanism, settings, friction_n, rest, unread)
    return tube_equations(mechanism, tube, settings, friction_n, rest, unread)


def _unread(mechanism: Mechanism, settings: TwinSettings, friction_n: float) -> Unread | None:
    """Return the force that no gauge reads, as a function of the state."""
    largest_n = settings.unread.largest_force_n
    if largest_n is None:
        shared = settings.unread.rough_share or settings.unread.latent_share
        largest_n = nominal_recoil_of(mechanism, settings).largest_force_n if shared else 0.0
    return unread_force(
        settings.unread,
        brake_area_m2=mechanism.brake_area,
        recuperator_area_m2=mechanism.recuperator_area,
        stroke_m=settings.stroke_m,
        friction_n=friction_n,
        largest_force_n=largest_n,
        t_fire_s=settings.pre_trigger_s,
    )


def simulate_motion(
    mechanism: Mechanism, settings: TwinSettings, *, peak_pressure_pa: float, friction_n: float
) -> Motion:
    """Integrate the equations of motion through one shot by the classical Runge-Kutta method.

    The step in which a part of the mass lets go is taken in two: up to that instant, and from it.

    Parameters
    ----------
    mechanism
        Mechanism with the true recoiling mass, before anything lets go.
    peak_pressure_pa
        Peak pressure of this shot.
    friction_n
        True packing friction.

    Raises
    ------
    ValueError
        If the mechanism cannot rest in battery (see `check_statics`), ``friction_n`` is negative, or all of
        the recoiling mass would let go or leave.
    """
    if check_statics(mechanism, settings):
        raise ValueError("the mechanism cannot rest in battery")
    if not friction_n >= 0:
        raise ValueError(f"friction_n must not be negative, found {friction_n!r}")
    released, hidden = settings.released_mass_kg, settings.unread
    if not released + hidden.leaving_gas_kg + hidden.hanging_kg < mechanism.m3:
        raise ValueError(f"released_mass_kg must be less than m3 = {mechanism.m3!r}, found {released!r}")
    substeps = math.ceil(1.0 / (settings.sample_rate_hz * _LARGEST_STEP_S) - 1e-9)
    rate_hz = settings.sample_rate_hz * substeps
    step = 1.0 / rate_hz
    count = round(settings.duration_s * rate_hz)

    def breech(since_start_s: Array) -> Array:
        since = since_start_s - settings.pre_trigger_s
        return breech_pressure(since, peak_pressure_pa, settings.rise_s, settings.decay_s)

    halves_s = np.arange(2 * count) / (2.0 * rate_hz)
    pressure = breech(halves_s)
    drag = np.zeros(2 * count)
    projectile = None
    if hidden.bore_drag or hidden.muzzle_brake or hidden.leaving_gas_kg:
        since_s = np.arange(0.0, settings.duration_s - settings.pre_trigger_s, 1e-5)
        driven_n = mechanism.force_areas[0] * breech(since_s + settings.pre_trigger_s)
        projectile = Projectile.driven(since_s, driven_n, hidden.projectile_mass_kg, hidden.bore_length_m)
        drag = projectile.drag(halves_s - settings.pre_trigger_s, hidden)

    def breech_force(instants_s: Array) -> list[float]:
        force = mechanism.force_areas[0] * breech(instants_s)
        if projectile is not None:
            force = force * (1.0 - projectile.drag(instants_s - settings.pre_trigger_s, hidden))
        return [float(value) for value in force]

    forces = breech_force(halves_s)
    tube = tube_of(mechanism, settings)
    hangs, sag_n_m = (np.zeros(0), 0.0) if tube is None else sag(mechanism, tube)
    rest = rest_in_battery(mechanism, settings, sag_n_m)
    unread = _unread(mechanism, settings, friction_n)
    hung = HangingPart(hidden) if hidden.hanging_kg else None
    if hung is not None:
        unread = hung.beside(unread)
    t_exit = math.nan if projectile is None else settings.pre_trigger_s + projectile.exit_s

    def equations(lost_kg: float) -> Equations:
        lighter = dataclasses.replace(mechanism, m3=mechanism.m3 - lost_kg)
        return _equations(lighter, tube, settings, friction_n, rest, unread)

    evaluate, without = equations(0.0), equations(released)
    slip = friction_n / settings.packing_stiffness_n_m
    t_release, last_whole, share = _release(settings, rate_hz)

    n = 5 + hangs.size
    y: State = (*(0.0,) * 5, *hangs.tolist(), *(0.0,) * (n + 1))
    # numbers without objects: a hundred thousand tuples would be looked through for garbage, and copied at the end
    states, changes, loads = array("d"), array("d"), array("d")
    for i in range(count):
        t = i * step
        if i > last_whole:
            evaluate = without
        if hidden.leaving_gas_kg and t + step > t_exit:
            # in each step the mass of its middle; what is recorded has that of its start
            gone = released if i > last_whole else 0.0
            k1, load = equations(gone + gas_left_kg(hidden, t - t_exit))(y, forces[2 * i], t)
            evaluate = equations(gone + gas_left_kg(hidden, t + 0.5 * step - t_exit))
            without = equations(released + gas_left_kg(hidden, t + 0.5 * step - t_exit))
            states.extend(y)
            changes.extend(k1)
            loads.extend(load)
            k1, _ = evaluate(y, forces[2 * i], t)
        else:
            k1, load = evaluate(y, forces[2 * i], t)
            states.extend(y)
            changes.extend(k1)
            loads.extend(load)
        if hung is not None:
            hung.move(k1[4], step)
        if forces[2 * i + 1] == 0.0:
            continue  # rest is an equilibrium: nothing moves before the shot
        if i == last_whole and share:
            before, after = share * step, (1.0 - share) * step
            instants = np.array([t_release - 0.5 * before, t_release, t_release + 0.5 * after, (i + 1) * step])
            middle, end, next_middle, next_end = breech_force(instants)
            y = _step(evaluate, y, k1, (middle, end), t, before, slip)
            y = _step(without, y, without(y, end, t_release)[0], (next_middle, next_end), t_release, after, slip)
        else:
            y = _step(evaluate, y, k1, (forces[2 * i + 1], forces[min(2 * i + 2, 2 * count - 1)]), t, step, slip)
    q = np.frombuffer(states).reshape(count, -1)
    qd, qdd = q[:, n : n + 5], np.frombuffer(changes).reshape(count, -1)
    ended = np.flatnonzero((qd[:-1, 4] > 0) & (qd[1:, 4] <= 0) & (q[:-1, 4] > 1e-3))
    end = math.nan
    if ended.size:
        last = int(ended[0])
        end = (last + qd[last, 4] / (qd[last, 4] - qd[last + 1, 4])) / rate_hz
    times = np.arange(count) / rate_hz
    p_brake, p_gas, packing, contact, M_C, N_x, N_y, N_d, N_f, unread_n = np.frombuffer(loads).reshape(count, -1).T
    if hidden.carried_oil_kg:
        unread_n = unread_n + hidden.carried_oil_kg * qdd[:, 4]
    gas_kg = np.zeros(count)
    if hidden.leaving_gas_kg:
        gas_kg = np.array([gas_left_kg(hidden, t - t_exit) for t in times.tolist()])
    return Motion(
        times, q[:, :5], qd, qdd[:, :5], pressure[::2], p_brake, p_gas, packing, contact, M_C, N_x, N_y,
        N_d, N_f, t_fire_s=settings.pre_trigger_s, t_end_s=float(end), unread_n=unread_n,
        breech_drag_n=mechanism.force_areas[0] * pressure[::2] * drag[::2], gas_kg=gas_kg, t_exit_s=t_exit,
        released_kg=released, t_release_s=t_release,
        modal=q[:, 5:n], modal_rate=q[:, n + 5 : 2 * n], modal_acceleration=qdd[:, 5:n],
    )  # fmt: skip


def _release(settings: TwinSettings, rate_hz: float) -> tuple[float, float, float]:
    """Return when a part lets go, the last step that begins with the whole mass, and the share of it with it.

    The share is 0 where the step ends at the instant; NaN, infinity and 0 if nothing lets go.
    """
    if not settings.released_mass_kg:
        return math.nan, math.inf, 0.0
    place = (settings.pre_trigger_s + settings.release_after_s) * rate_hz
    nearest = round(place)
    if abs(place - nearest) < 1e-6:
        return nearest / rate_hz, nearest - 1, 0.0
    return place / rate_hz, math.floor(place), place - math.floor(place)
