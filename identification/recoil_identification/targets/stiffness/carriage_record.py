"""The channels of the mechanism's motion as one narrow-band table: what loads and displacements come from.

The channels of a shot have different bandwidths: a recorder's gyro passes kilohertz, one on a serial port 250 Hz.
Where load and displacement come from both, the narrower one would take amplitude off one side alone. So every
channel first gets the response of the narrowest anti-alias filter that the rig declares, without its delay, and
then all pass one low-pass and are thinned out alike.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_identification.shot.preparation import Prepared
from recoil_identification.targets.stiffness.mechanism_loads import MeasuredMotion
from recoil_processing.filters import LowPass, filter_alike
from recoil_processing.filters.analog_filter import AnalogLowPass
from recoil_processing.shot.instants import anti_alias_filter
from recoil_processing.shot.projectile import breech_force_on_body_n
from recoil_processing.shot.regression import PRESSURE_ROLES
from recoil_rigs.mechanism.model import Mechanism
from recoil_rigs.rig import Rig
from recoil_rigs.tables.force_input import SIGNS

MOTION_ROLES = ("carriage_rate", "tipping_rate", "carriage_acceleration_x", "carriage_acceleration_y")
"""Roles whose channels tell how carriage and tipping part move."""
THINNED_HZ = 600.0
"""Low-pass before thinning: stress waves are gone, and products of columns are still formed within the band."""
THINNED_RATE_HZ = 5000.0
"""Least rate of the thinned table, samples per second."""
LEAST_GAIN = 0.3
"""Gain of a channel's own filter below which its amplitude is not divided by: there is little signal, and noise."""
MARGIN_S = 0.05
"""Time, s, by which a record is continued at both ends, at rest before, for the response of a filter."""
BEFORE_S, BEHIND_S = 0.1, 0.15
"""Lengths, s, of the record that is kept before the onset of force and behind the end of recoil, for the filters."""


@dataclass(frozen=True, eq=False)
class CarriageRecord(ReadOnlyArrays):
    """The channels on one thinned grid, alike filtered, SI.

    Attributes
    ----------
    times_s : ndarray, shape (n,)
    channels : mapping of str to ndarray, shape (n,)
        Channels by role: `MOTION_ROLES`, the three pressures, which are zero until the part is released, and
        ``recoil_acceleration``, moved to the recoiling part's centre of mass.
    friction_direction, released : ndarray, shape (n,)
        Columns of `recoil_processing.shot.regression.Regression`.
    travel_m, velocity_m_s : ndarray, shape (n,)
        Travel and velocity of recoil.
    static_m_s2
        a' at rest in battery.
    r_x, r_y
        Place of the carriage's accelerometers from the trunnion A, m.
    trusted : ndarray of bool, shape (n,)
        False near lost samples.
    interval_s
        Interval from the onset of force to the end of recoil.
    narrowest
        Filter whose response all channels have.
    """

    times_s: Array
    step_s: float
    channels: Mapping[str, Array]
    friction_direction: Array
    released: Array
    travel_m: Array
    velocity_m_s: Array
    static_m_s2: float
    r_x: float
    r_y: float
    trusted: Flags
    interval_s: tuple[float, float]
    narrowest: AnalogLowPass | None = None

    def motion(self, mechanism: Mechanism) -> MeasuredMotion:
        """Return the motion with the recoiling part's acceleration from the forces on it, ``m3 a' = P - R_f``.

        While it recoils, the gauges of brake and recuperator tell R_f far more precisely than the breech gauge
        and the accelerometer, whose difference it is as well. What holds the part back while it runs forward no
        gauge reads, and its acceleration is small: there its accelerometer is taken.
        """
        m, c = mechanism, self.channels
        recoils = self.times_s <= self.interval_s[1]
        brake, recuperator = (c[r] * area for r, area in zip(PRESSURE_ROLES[1:], m.force_areas[1:], strict=True))
        breech = breech_force_on_body_n(c["breech_pressure"], self.step_s, m)
        force = breech - brake - recuperator + m.friction * self.friction_direction
        force = force - m.slide_friction * self.velocity_m_s
        return MeasuredMotion(
            step_s=self.step_s,
            w1=c["carriage_rate"],
            w2=c["tipping_rate"],
            f_x=c["carriage_acceleration_x"],
            f_y=c["carriage_acceleration_y"],
            r_x=self.r_x,
            r_y=self.r_y,
            breech_force_n=breech,
            acceleration_m_s2=np.where(
                recoils, force / m.m3 + self.static_m_s2 * (1.0 - self.released), c["recoil_acceleration"]
            ),
            travel_m=self.travel_m,
            velocity_m_s=self.velocity_m_s,
            rest=max(1, int(np.searchsorted(self.times_s, self.interval_s[0]))),
        )

    def scaled(self, role: str, factor: float) -> CarriageRecord:
        """Return the record with one channel in another scale; an accelerometer's about its reading at rest."""
        rest = self.channels[role][0]
        return self._with(role, rest + factor * (self.channels[role] - rest))

    def added(self, role: str, error: Array | float) -> CarriageRecord:
        """Return the record with something added to one channel."""
        return self._with(role, self.channels[role] + error)

    def later(self, roles: tuple[str, ...], shift_s: float) -> CarriageRecord:
        """Return the record with some channels later by a shift."""
        moved = {r: np.interp(self.times_s - shift_s, self.times_s, self.channels[r]) for r in roles}
        return replace(self, channels={**self.channels, **moved})

    def _with(self, role: str, samples: Array) -> CarriageRecord:
        return replace(self, channels={**self.channels, role: samples})


def with_response(samples: Array, step_s: float, wanted: AnalogLowPass, own: AnalogLowPass | None) -> Array:
    """Give a channel the amplitude response of a filter, without phase, in the place of its own.

    Parameters
    ----------
    samples : ndarray, shape (n,)
        Samples without missing values.
    own
        Filter that the channel has passed already.

    Returns
    -------
    ndarray, shape (n,)
    """
    margin = round(MARGIN_S / step_s)
    padded = np.pad(samples, margin, mode="edge")
    frequency = np.asarray(np.fft.rfftfreq(padded.size, step_s), dtype=np.float64)
    gain = wanted.gain(frequency)
    if own is not None:
        gain = np.minimum(gain / np.maximum(own.gain(frequency), LEAST_GAIN), 1.0)
    # the ends differ: a straight line between them passes any low-pass unchanged, the rest is periodic
    line = np.linspace(padded[0], padded[-1], padded.size)
    changed = np.fft.irfft(np.fft.rfft(padded - line) * gain, padded.size) + line
    return np.asarray(changed[margin : margin + samples.size])


def carriage_record(prepared: Prepared, rig: Rig) -> CarriageRecord:
    """Thin out the channels of a shot that tell loads and displacements.

    Raises
    ------
    IdentificationError
        If a channel of the carriage's or the tipping part's motion is missing or on a clock that failed.
    """
    signals, recorded = prepared.signals, prepared.recorded
    missing = [role for role in MOTION_ROLES if role not in signals.series]
    if missing:
        raise IdentificationError(
            f"no usable channel of role {', '.join(missing)}",
            expected=f"{', '.join(MOTION_ROLES)}, on clocks that could be aligned",
            remedy="declare the roles in the rig file, or mend the alignment",
        )
    specs = {role: rig.by_role(role) for role in (*MOTION_ROLES, "recoil_acceleration", *PRESSURE_ROLES)}
    places = {spec.sensor.position for role in MOTION_ROLES[2:] if (spec := specs[role]) is not None}
    if len(places) != 1:
        raise IdentificationError(
            "the carriage's accelerometers are at different places",
            expected="both axes at one place",
            found=", ".join(str(place) for place in sorted(places)),
            remedy="use two axes of one sensor",
        )
    columns = {role: signals.series[role] for role in MOTION_ROLES}
    for number, (role, area, sign) in enumerate(zip(PRESSURE_ROLES, rig.mechanism.force_areas, SIGNS, strict=True)):
        columns[role] = sign * recorded.forces_n[:, number] / area
    columns["recoil_acceleration"] = prepared.inertial_m_s2
    columns |= {"friction_direction": recorded.friction_direction, "released": recorded.released}
    columns |= {"travel": prepared.travel_m, "velocity": prepared.velocity_m_s}
    rate = signals.rate_hz
    stride = max(1, int(rate / THINNED_RATE_HZ))
    table = filter_alike(LowPass(min(THINNED_HZ, 0.2 * rate)), columns, rate)
    step = stride * signals.step_s
    thinned = {name: np.array(column[::stride]) for name, column in table.items()}
    filters = {role: None if spec is None else anti_alias_filter(spec.sensor) for role, spec in specs.items()}
    narrowest = min((f for f in filters.values() if f is not None), key=lambda f: f.cutoff_hz, default=None)
    if narrowest is not None:
        for name, column in thinned.items():
            if filters.get(name) != narrowest:
                thinned[name] = with_response(column, step, narrowest, filters.get(name))
    r_x, r_y = places.pop()
    times = signals.times_s[::stride]
    kept = slice(*np.searchsorted(times, (recorded.interval_s[0] - BEFORE_S, recorded.interval_s[1] + BEHIND_S)))
    thinned = {name: column[kept] for name, column in thinned.items()}
    return CarriageRecord(
        times_s=times[kept],
        step_s=step,
        channels={role: thinned[role] for role in (*MOTION_ROLES, "recoil_acceleration", *PRESSURE_ROLES)},
        friction_direction=thinned["friction_direction"],
        released=thinned["released"],
        travel_m=thinned["travel"],
        velocity_m_s=thinned["velocity"],
        static_m_s2=prepared.static_m_s2,
        r_x=r_x,
        r_y=r_y,
        trusted=np.array(table.trusted[::stride][kept]),
        interval_s=recorded.interval_s,
        narrowest=narrowest,
    )
