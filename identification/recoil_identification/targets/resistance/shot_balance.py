"""Balance of energy and of momentum of the recoiling part over a shot.

From ``m (x'' + c) = P - R_f``, with c the gravity and the carriage's motion along the bore, times x' or alone,

    work of P     = m x'^2 / 2 + work of brake, recuperator and friction + m integral c x' dt,
    impulse of P  = m x'       + impulse of the same                     + m integral c dt,

from the release to any instant. The forces are the gauges', the motion is the camera's and the accelerometer's: what is
left over tells whether they belong together. How much may be left over follows from the standard uncertainty of
every part: each balance is linear in the relative error of a force, so the tolerance is their root sum of squares.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.normal_distribution import CRITICAL_VALUE
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_identification.estimate.budget import COVERAGE_FACTOR
from recoil_processing.double_integral import integrate


class Conserved(StrEnum):
    """Quantity that is balanced."""

    ENERGY = "energy"
    MOMENTUM = "momentum"


class Until(StrEnum):
    """Instant until which a balance is drawn."""

    FASTEST = "largest velocity"
    END = "end of recoil"


@dataclass(frozen=True, eq=False)
class Terms(ReadOnlyArrays):
    """Terms of the balance over time, and their errors.

    Attributes
    ----------
    forces_n : mapping of str to ndarray, shape (n,)
        Positive if they drive the part to the rear: ``breech`` positive, resistances negative; zero while it is held.
    carried_m_s2 : ndarray, shape (n,)
        c, zero while the part is held.
    velocity_m_s, u_velocity_m_s : ndarray, shape (n,)
    force_errors_n : mapping of str to ndarray, shape (n,)
        Error of the total force by cause, if the cause is off by its standard uncertainty.
    noise_n
        White noise of the total force, per sample.
    u_velocity_scale
        Relative standard uncertainty of the velocity's scale.
    u_clock_s
        Standard uncertainty of the instants of the motion against those of the forces.
    """

    step_s: float
    forces_n: Mapping[str, Array]
    carried_m_s2: Array
    velocity_m_s: Array
    u_velocity_m_s: Array
    mass_kg: float
    force_errors_n: Mapping[str, Array]
    noise_n: float
    u_mass_kg: float
    u_velocity_scale: float
    u_clock_s: float


@dataclass(frozen=True, eq=False)
class Balance(ReadOnlyArrays):
    """One balance over time.

    Attributes
    ----------
    quantity
        Quantity that is balanced.
    unit
        Unit of all arrays.
    parts : mapping of str to ndarray, shape (n,)
        Work or impulse since the release by each force, ``motion`` (kinetic energy or momentum, negative), and
        ``gravity and carriage`` (negative if they take).
    left : ndarray, shape (n,)
        Sum of the parts; zero if all is right.
    errors : mapping of str to ndarray, shape (n,)
        Rest of the balance by cause, if it alone is off by its standard uncertainty.
    """

    quantity: Conserved
    unit: str
    parts: Mapping[str, Array]
    left: Array
    errors: Mapping[str, Array]

    @property
    def u(self) -> Array:
        """Standard uncertainty of what is left, shape (n,)."""
        return np.sqrt(sum((error**2 for error in self.errors.values()), np.zeros_like(self.left)))

    def at(self, index: int, until: Until) -> BalancePoint:
        """Return the balance from the release to one instant, and which that is."""
        numbers = float(self.left[index]), float(self.u[index]), float(abs(self.parts["breech"][index]))
        return BalancePoint(self.quantity, self.unit, until, *numbers)


@dataclass(frozen=True)
class BalancePoint:
    """A balance from the release to one instant.

    Attributes
    ----------
    quantity
        Quantity that is balanced.
    unit
        Unit of `left`, `u` and `given`.
    until
        Instant at which the balance is drawn.
    left, u
        Rest of the balance, and its standard uncertainty.
    given
        Amount that the breech force gave.
    """

    quantity: Conserved
    unit: str
    until: Until
    left: float
    u: float
    given: float

    @property
    def name(self) -> str:
        """Name of the balance, as tables and reasons have it."""
        return f"{self.quantity} until the {self.until}"

    @property
    def tolerance(self) -> float:
        """Half width of the 95 % interval in which it lies if all is right."""
        return COVERAGE_FACTOR * self.u

    @property
    def ratio(self) -> float:
        """Imbalance over its tolerance; infinite where the tolerance is zero."""
        return abs(self.left) / self.tolerance if self.tolerance > 0 else math.inf

    @property
    def violated(self) -> bool:
        """True if the imbalance is beyond chance."""
        return abs(self.left) > CRITICAL_VALUE * self.u

    @property
    def verdict(self) -> str:
        """In words."""
        if self.violated:
            return "violated"
        return "closed" if self.ratio <= 1.0 else "beyond its tolerance, which happens by chance once in twenty"


def energy_balance(terms: Terms) -> Balance:
    """Return the balance of energy over time, J."""
    v, m = terms.velocity_m_s, terms.mass_kg
    parts = {name: _integral(force * v, terms) for name, force in terms.forces_n.items()}
    carried = -m * _integral(terms.carried_m_s2 * v, terms)
    motion = -0.5 * m * v**2
    parts |= {"gravity and carriage": carried, "motion": motion}
    left = np.asarray(sum(parts.values()))
    errors = {cause: _integral(error * v, terms) for cause, error in terms.force_errors_n.items()}
    net = sum(terms.forces_n.values()) - m * terms.carried_m_s2
    errors |= {
        "mass": terms.u_mass_kg / m * (carried + motion),
        # all works are proportional to the velocity, the kinetic energy to its square
        "scale of the velocity": terms.u_velocity_scale * (left + motion),
        "velocity": m * v * terms.u_velocity_m_s,
        "noise of the gauges": terms.noise_n * terms.step_s * np.sqrt(np.cumsum(v**2)),
        "clock of the motion": terms.u_clock_s * (_integral(net * np.gradient(v, terms.step_s), terms)),
    }
    return Balance(Conserved.ENERGY, "J", parts, left, errors)


def momentum_balance(terms: Terms) -> Balance:
    """Return the balance of momentum over time, N s."""
    m = terms.mass_kg
    parts = {name: _integral(force, terms) for name, force in terms.forces_n.items()}
    carried, motion = -m * _integral(terms.carried_m_s2, terms), -m * terms.velocity_m_s
    parts |= {"gravity and carriage": carried, "motion": motion}
    errors = {cause: _integral(error, terms) for cause, error in terms.force_errors_n.items()}
    errors |= {
        "mass": terms.u_mass_kg / m * (carried + motion),
        "scale of the velocity": terms.u_velocity_scale * motion,
        "velocity": m * terms.u_velocity_m_s,
        "noise of the gauges": terms.noise_n * terms.step_s * np.sqrt(np.arange(1.0, terms.velocity_m_s.size + 1.0)),
        "clock of the motion": terms.u_clock_s * m * np.gradient(terms.velocity_m_s, terms.step_s),
    }
    return Balance(Conserved.MOMENTUM, "N s", parts, np.asarray(sum(parts.values())), errors)


def _integral(rate: Array, terms: Terms) -> Array:
    return integrate(np.ascontiguousarray(rate), terms.step_s)
