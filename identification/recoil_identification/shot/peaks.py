"""Largest values of a shot, its time and its impulse: each without the errors of its sensors, with its uncertainty.

The fit of the mass finds scales, zeros and what else may be off of all sensors at once
(`recoil_identification.calibration.calibration`). What it found is taken off each quantity, and its covariance tells
how uncertain that is: with the derivatives J of a quantity by the unknowns its variance is ``J S J'`` (JCGM 102:2011,
6.2), in parts by the sources of the mass's budget. What the fit does not hold is added: noise of the samples about a
peak, and where camera and accelerometer together told the motion, what these leave.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from recoil_acquisition.numerics.arrays import Array, Flags
from recoil_identification.calibration.calibration import Calibration
from recoil_identification.estimate.budget import coverage_factor
from recoil_identification.inference.estimate import ROWS
from recoil_identification.rows import equation_of_motion as motion
from recoil_identification.rows.causes import DISTORTIONS
from recoil_identification.rows.known_forces import OF_READING
from recoil_identification.rows.sensor_priors import CAMERA_SCALE
from recoil_identification.shot.identified import Identification
from recoil_processing.double_integral import integrate
from recoil_processing.gaps import bridge
from recoil_processing.noise import noise_sigma, welch_satterthwaite
from recoil_processing.picture_bends import picture_bends
from recoil_processing.shot.error_source import ErrorSource, SourceKind
from recoil_processing.shot.regression import PRESSURE_ROLES
from recoil_rigs.tables.rig_tables import CARRIAGE_ACCELERATIONS

OF_ROLE = {
    "recoil_acceleration": ("recoil_acceleration_m_s2",),
    "breech_pressure": ("breech_pressure_pa", "impulse_n_s"),
}
"""Peaks that hang on the tips of a channel; of another pressure its own peak."""
CREST, DEGREE, FEWEST = 0.95, 4, 20
"""Share of a pressure's peak above which samples tell it, degree of the polynomial through them, and fewest of them."""
NEAR_S, RISE_S = 5e-3, 2e-3
"""Time on both sides of the largest acceleration from which its noise is taken, and that from the release on from which
it is taken how steeply the force rises."""
SPEED_ROLES = frozenset({"recoil_velocity", "recoil_displacement"})
"""Roles that tell the speed of a body on a line."""
BESIDE_THE_READING = (SourceKind.AREA, SourceKind.BORE_FRICTION)
"""Parts of a force's scale that its pressure has not."""
OF_TIME = (SourceKind.SKEW, SourceKind.DELAY, SourceKind.LINE, SourceKind.ALIGNMENT)
"""Kinds of causes that move a peak and do not change it."""
READING = (*OF_READING, SourceKind.BRIDGED_SHAPE)
"""Kinds of causes that are errors of a gauge's reading."""
LABELS = {
    "breech_pressure_pa": "peak breech pressure",
    "brake_pressure_pa": "peak brake pressure",
    "recuperator_pressure_pa": "peak recuperator pressure",
    "recoil_acceleration_m_s2": "peak acceleration, filtered",
    "recoil_velocity_m_s": "peak velocity",
    "recoil_travel_m": "recoil length",
    "recoil_time_s": "time of recoil",
    "impulse_n_s": "impulse of the driving force",
}
"""Names of all quantities in words."""
UNITS = dict(zip(LABELS, ("Pa", "Pa", "Pa", "m/s^2", "m/s", "m", "s", "N s"), strict=True))
"""Their units."""
NOISE, FUSION, ONSET = "noise of the samples", "camera and accelerometer together", "onset of force"
"""Names of the parts that the fit of the mass does not hold."""


@dataclass(frozen=True)
class Peak:
    """A quantity of a shot.

    Attributes
    ----------
    value
        Value without the errors that were found of the sensors.
    parts
        Contributions to `u` by the names of their sources; their squares add up to its square.
    shared
        Names of those sources that are off alike in every shot of the same sensors, or of the same rig.
    freedom
        Degrees of freedom of the parts by the names of their sources; those that are not in it are known.
    """

    value: float
    parts: Mapping[str, float] = field(default_factory=dict)
    shared: frozenset[str] = frozenset()
    freedom: Mapping[str, float] = field(default_factory=dict)

    @property
    def u(self) -> float:
        """Standard uncertainty, root sum of squares of the parts; infinite where there are none."""
        return math.hypot(*self.parts.values()) if self.parts else math.inf

    @property
    def u_shared(self) -> float:
        """Contribution to `u` of the sources that shots share, which no number of shots averages out."""
        return math.hypot(*(part for name, part in self.parts.items() if name in self.shared))

    @property
    def degrees_of_freedom(self) -> float:
        """Effective degrees of freedom of `u` (JCGM 100:2008, G.2b); may be infinite."""
        return welch_satterthwaite((part, self.freedom.get(name, math.inf)) for name, part in self.parts.items())

    @property
    def interval(self) -> tuple[float, float]:
        """Interval of 95 % coverage."""
        half = coverage_factor(max(self.degrees_of_freedom, 1.0)) * self.u
        return self.value - half, self.value + half

    @property
    def ruled_by(self) -> str:
        """Name of the largest part."""
        return max(self.parts, key=lambda name: self.parts[name])


def peaks_of(found: Identification) -> dict[str, Peak]:
    """Return the largest values of a shot between the onset of force and the end of recoil travel, units in the names.

    The pressure's peak is that of a polynomial through the samples about it, for the largest of many noisy ones is too
    large. Acceleration, velocity and travel are as identified. The impulse is that of the breech force over the same
    time, without what the projectile's friction takes off. On a line it is that of all that drives, the velocity is the
    largest of either direction, and the travel counts from where the body is furthest back. What the shot has no
    channel for is not in it, nor what a clipped channel would have to tell: of its tips a repair is no measurement.
    """
    signals = found.route.signals
    clipped = {one.role for one in signals.repairs if one.repair.kind.clips}
    untold = {name for role in clipped for name in OF_ROLE.get(role, (f"{role}_pa",))}
    told = dict(_Quantities(found, found.corrections).all)
    return {name: peak for name, peak in told.items() if math.isfinite(peak.value) and name not in untold}


@dataclass(frozen=True, eq=False)
class _Quantities:
    found: Identification
    calibration: Calibration

    @property
    def all(self) -> Iterator[tuple[str, Peak]]:
        """The quantities by name, in the order of the report."""
        for role in PRESSURE_ROLES:
            if role in self.found.route.signals.series:
                yield f"{role}_pa", self.pressure(role)
        yield "recoil_acceleration_m_s2", self.acceleration
        yield "recoil_velocity_m_s", self.velocity
        yield "recoil_travel_m", self.travel
        yield "recoil_time_s", self.time
        yield "impulse_n_s", self.impulse

    def pressure(self, role: str) -> Peak:
        """Return the peak of a pressure."""
        recorded, block = self.found.route.recorded, self.calibration.block
        crest = self._crest(role)
        if crest is None:
            return Peak(math.nan)
        at, read, u_noise = crest
        column = recorded.gauges.index(role)
        name = block.gauges[column].name
        force_n = float(bridge(recorded.forces_n[:, column])[at])
        # what the force's scale has beside the gauge's is none of the pressure's
        beside = [
            prior.unknowns[0] for prior in self.calibration.common
            if isinstance(prior.sources[0], ErrorSource) and prior.sources[0].kind in BESIDE_THE_READING
        ]  # fmt: skip
        of_scale = next((p.unknowns for p in self.calibration.common if p.unknowns[0] == name), (name,))
        scales = {name: 1.0} | {part: -1.0 for part in of_scale[1:] if part in beside}
        log = sum(sign * self.calibration.inferred.value(one) for one, sign in scales.items())
        shares: dict[str, float] = {
            cause.source: float(cause.forces_n[at, column]) / force_n
            for cause in block.causes
            if cause.source.kind in READING and force_n
        }
        factor = math.exp(-log)
        value = read * factor * (1.0 + self._sum(shares))
        slopes = {one: -sign * value for one, sign in scales.items()}
        slopes |= {source: read * factor * share for source, share in shares.items()}
        return self._peak(value, slopes, {NOISE: u_noise * factor})

    @property
    def acceleration(self) -> Peak:
        """The largest acceleration of either direction, behind the low-pass."""
        filtered = self.found.route.filtered
        if not self._felt:
            at = _largest_at(np.abs(filtered.acceleration_m_s2), filtered.inside)
            return Peak(math.nan if at is None else abs(float(filtered.acceleration_m_s2[at])))
        of_zero = self._wrong_m_s2(filtered.released, filtered.shifts)
        zero = sum((self._value(name) * column for name, column in of_zero.items()), np.zeros(filtered.times_s.size))
        scale = self.calibration.block.scale.name
        factor = math.exp(-self.calibration.inferred.value(scale))
        true = (filtered.acceleration_m_s2 - zero) * factor
        at = _largest_at(np.abs(true), filtered.inside)
        if at is None:
            return Peak(math.nan)
        sign = math.copysign(1.0, true[at])
        slopes = {name: -sign * factor * float(column[at]) for name, column in of_zero.items()}
        slopes[scale] = -abs(true[at])
        # what rings within the band is in no row of the fit, whose low-pass is the narrower one
        near = slice(max(at - round(NEAR_S / self._step_s), 0), at + round(NEAR_S / self._step_s) + 1)
        felt, force_n = (side[near] for side in self.calibration.correct(filtered))
        mass_kg = self.calibration.m0_kg * math.exp(self._value(motion.MASS.name))
        noise = math.sqrt(float(np.mean((felt - force_n / mass_kg) ** 2)))
        return self._peak(abs(float(true[at])), slopes, {NOISE: noise})

    @property
    def velocity(self) -> Peak:
        """The largest velocity."""
        recorded, route = self.found.route.recorded, self.found.route
        outward, _ = recorded.outward(self._velocity_m_s, route.travel_m)
        at = _largest_at(outward, recorded.inside)
        if at is None:
            return Peak(math.nan)
        return self._peak(float(outward[at]), *self._of_velocity(at)) if self._told else Peak(float(outward[at]))

    @property
    def travel(self) -> Peak:
        """The recoil length."""
        recorded, route = self.found.route.recorded, self.found.route
        true = self._corrected(route.travel_m, self._wrong_m)
        _, outward = recorded.outward(self._velocity_m_s, true)
        at = _largest_at(outward, recorded.inside)
        if at is None:
            return Peak(math.nan)
        if not self._told:
            return Peak(float(outward[at]))
        slopes = self._slopes(float(true[at]), {name: float(column[at]) for name, column in self._wrong_m.items()})
        fused = route.fused
        beside = self._integrals(at, 2) if fused is None else self._beside(float(true[at]), fused.u_position_m[at])
        return self._peak(float(outward[at]), slopes, beside)

    @property
    def time(self) -> Peak:
        """The time from the onset of force to the end of travel."""
        recorded = self.found.route.recorded
        t0, t1 = recorded.interval_s
        at = min(int(np.searchsorted(recorded.times_s, t1)), recorded.times_s.size - 1)
        slope = abs(float(np.gradient(self.found.route.velocity_m_s, recorded.step_s)[max(at - 50, 0) : at].mean()))
        if not (slope > 0 and self._told and recorded.recoils_once) or recorded.cut_short:
            return Peak(t1 - t0)
        late_s = float(self._velocity_m_s[at]) / slope
        early_s, u_onset_s = self._release
        slopes, beside = self._of_velocity(at)
        slopes = {name: one / slope for name, one in slopes.items()}
        beside = {name: one / slope for name, one in beside.items()}
        return self._peak(t1 - t0 + early_s + late_s, slopes, {**beside, ONSET: u_onset_s})

    @property
    def _release(self) -> tuple[float, float]:
        """By how much the part was let go before the sample that says so, in the mean, and how uncertain that is."""
        recorded = self.found.route.recorded
        first = int(np.searchsorted(recorded.times_s, recorded.interval_s[0] - 1e-9))
        rises_n = bridge(recorded.force_n, otherwise=0.0)[first : first + max(round(RISE_S / recorded.step_s), FEWEST)]
        times_s = recorded.step_s * np.arange(rises_n.size)
        sizes, (squares, *_), *_ = np.polyfit(times_s, rises_n, 2, full=True)
        noise_n = math.sqrt(float(squares) / max(rises_n.size - 3, 1))
        slope_n_s = float(sizes[1])
        by_noise_s = noise_n / slope_n_s if slope_n_s > 0 else math.inf
        return 0.5 * recorded.step_s, math.hypot(recorded.step_s / math.sqrt(12.0), min(by_noise_s, RISE_S))

    @property
    def impulse(self) -> Peak:
        """The impulse of what drives."""
        recorded, block = self.found.route.recorded, self.calibration.block
        value, slopes = 0.0, dict[str, float]()
        for column, name in (
            (column, block.gauges[column].name) for column, sign in enumerate(recorded.signs) if sign > 0
        ):
            factor = math.exp(-self.calibration.inferred.value(name)) * recorded.step_s
            # what was lost is bridged: where that is much the report has its verdict
            read = float(bridge(recorded.forces_n[:, column], otherwise=0.0)[recorded.inside].sum())
            wrong: dict[str, float] = {
                one.source: float(one.forces_n[recorded.inside, column].sum()) for one in block.causes
            }
            whole = factor * (read + self._sum(wrong))
            value += whole
            slopes[name] = -whole
            for source, each in wrong.items():
                slopes[source] = slopes.get(source, 0.0) + factor * each
        return self._peak(value, slopes, {})

    def _crest(self, role: str) -> tuple[int, float, float] | None:
        """Return where a pressure's peak is, its value by the samples about it, and that one's uncertainty by noise."""
        route = self.found.route
        series, inside = bridge(route.signals.series[role], otherwise=0.0), route.recorded.inside
        if not np.isfinite(route.signals.series[role][inside]).any():
            return None
        low_pass = route.filtered.low_pass
        smooth = series if low_pass is None else low_pass.apply(series, route.signals.rate_hz)
        at = _largest_at(smooth, inside)
        if at is None:
            return None
        low = np.flatnonzero((smooth < CREST * smooth[at]) | ~inside)
        first = int(low[low < at].max(initial=-1)) + 1
        stop = int(low[low > at].min(initial=series.size))
        if stop - first < FEWEST:
            noise = route.signals.offsets[role].noise if role in route.signals.offsets else math.nan
            return at, float(series[at]), noise if math.isfinite(noise) else 0.0
        x = np.linspace(-1.0, 1.0, stop - first)
        powers = np.polynomial.legendre.legvander(x, DEGREE)
        sizes = np.linalg.lstsq(powers, series[first:stop], rcond=None)[0]
        fitted = powers @ sizes
        best = int(np.argmax(fitted))
        left = series[first:stop] - fitted
        variance = float(left @ left) / (left.size - DEGREE - 1)
        gain = float(powers[best] @ np.linalg.solve(powers.T @ powers, powers[best]))
        return first + best, float(fitted[best]), math.sqrt(variance * gain)

    @property
    def _felt(self) -> bool:
        """Whether an accelerometer told the acceleration."""
        return self.found.route.tracked is None and self.found.route.recorded.motion_role == "recoil_acceleration"

    @property
    def _told(self) -> bool:
        """Whether the fit knows the scale of what told velocity and travel, and what that may be off by beside it."""
        route = self.found.route
        by_another = not route.recorded.recoils_once and not SPEED_ROLES.isdisjoint(route.signals.series)
        return route.fused is not None or (self._felt and not by_another)

    @cached_property
    def _velocity_m_s(self) -> Array:
        """Velocity behind the low-pass: what rings on the accelerometer is no motion of the part."""
        low_pass, velocity = self.found.route.filtered.low_pass, self.found.route.velocity_m_s
        smooth = velocity if low_pass is None else low_pass.apply(velocity, self.found.route.recorded.rate_hz)
        return self._corrected(smooth, self._wrong_m_s)

    def _of_velocity(self, at: int) -> tuple[dict[str, float], dict[str, float]]:
        """Return the slopes of the velocity at a sample, and what the fit does not hold of it."""
        fused = self.found.route.fused
        value = float(self._velocity_m_s[at])
        slopes = self._slopes(value, {name: float(column[at]) for name, column in self._wrong_m_s.items()})
        return slopes, self._integrals(at, 1) if fused is None else self._beside(value, fused.u_velocity_m_s[at])

    def _beside(self, value: float, u_fused: float) -> dict[str, float]:
        """Return what the fit does not hold of velocity or travel: all of the camera where its frames are not used."""
        camera, fused = self.found.route.camera, {FUSION: float(u_fused)}
        return fused if self._knows_scale or camera is None else {**fused, CAMERA_SCALE: camera.u_rel * abs(value)}

    def _integrals(self, at: int, times: int) -> dict[str, float]:
        """Return what noise, and the zeros of the carriage's sensors, make of so many integrals of the acceleration."""
        signals, recorded = self.found.route.signals, self.found.route.recorded
        since_s = max(float(recorded.times_s[at]) - recorded.interval_s[0], 0.0)
        carriage = {role: signals.offsets[role] for role in CARRIAGE_ACCELERATIONS if role in signals.offsets}
        noise = math.hypot(
            noise_sigma(recorded.acceleration_m_s2[recorded.inside]),
            *(noise_sigma(signals.series[role][recorded.inside]) for role in carriage if role in signals.series),
        )
        # a walk, and the integral of one
        walked = noise * math.sqrt(self._step_s * since_s ** (2 * times - 1) / (2 * times - 1))
        zeros: dict[str, float] = {
            ErrorSource(SourceKind.ZERO, role): offset.u * since_s**times / times for role, offset in carriage.items()
        }
        return {NOISE: walked if math.isfinite(walked) else 0.0, **zeros}

    @property
    def _knows_scale(self) -> bool:
        return self._scale in {one.name for one in self.calibration.inferred.unknowns}

    @cached_property
    def _scale(self) -> str:
        """Name of the scale in which velocity and travel are."""
        return motion.CAMERA.name if self.found.route.fused is not None else self.calibration.block.scale.name

    @cached_property
    def _wrong_m_s(self) -> dict[str, Array]:
        """Velocities that sizes of one add, by the names of their unknowns."""
        if self.found.route.fused is not None:
            return {name: np.gradient(bend, self._step_s) for name, bend in self._bends.items()}
        regression = self.calibration.block.regression
        return {
            name: integrate(column, self._step_s)
            for name, column in self._wrong_m_s2(regression.released, regression.shifts).items()
        }

    @cached_property
    def _wrong_m(self) -> dict[str, Array]:
        """Travels that sizes of one add, likewise."""
        if self.found.route.fused is not None:
            return self._bends
        return {name: integrate(column, self._step_s) for name, column in self._wrong_m_s.items()}

    @cached_property
    def _bends(self) -> dict[str, Array]:
        known = {one.name for one in self.calibration.inferred.unknowns}
        bends = zip(DISTORTIONS, picture_bends(self.found.route.travel_m), strict=True)
        return {name: bend for name, bend in bends if name in known}

    @property
    def _step_s(self) -> float:
        return self.found.route.recorded.step_s

    def _wrong_m_s2(self, released: Array, shifts: Array | None) -> dict[str, Array]:
        """Return what sizes of one add to the reading of the acceleration, by the names of their unknowns."""
        columns = [] if shifts is None else [*shifts.T]
        causes: dict[str, Array] = {
            cause.source: cause.acceleration_m_s2
            for cause in self.calibration.block.causes
            if cause.source.kind not in OF_TIME and np.any(cause.acceleration_m_s2)
        }
        return {
            motion.ZERO.name: released,
            **{motion.shift(i).name: column for i, column in enumerate(columns)},
            **causes,
        }

    def _value(self, name: str) -> float:
        return self.calibration.inferred.value(name)

    def _sum(self, columns: Mapping[str, float]) -> float:
        return math.fsum(self._value(name) * size for name, size in columns.items())

    def _corrected(self, read: Array, wrong: Mapping[str, Array]) -> Array:
        if not self._told:
            return read
        zero = sum((self._value(name) * column for name, column in wrong.items()), np.zeros(read.size))
        return np.asarray((read - zero) * (math.exp(-self._value(self._scale)) if self._knows_scale else 1.0))

    def _slopes(self, value: float, wrong: Mapping[str, float]) -> dict[str, float]:
        return {name: -size for name, size in wrong.items()} | ({self._scale: -value} if self._knows_scale else {})

    def _peak(self, value: float, slopes: Mapping[str, float], beside: Mapping[str, float]) -> Peak:
        parts = self.calibration.inferred.parts_of(slopes)
        parts |= {name: math.hypot(parts.get(name, 0.0), u) for name, u in beside.items()}
        return Peak(value, parts, self._shared, self._freedom)

    @cached_property
    def _freedom(self) -> dict[str, float]:
        priors = (*self.calibration.common, *self.calibration.own)
        known = {source: prior.degrees_of_freedom for prior in priors for source in prior.sources}
        return {**known, ROWS: self.calibration.noise.degrees_of_freedom}

    @cached_property
    def _shared(self) -> frozenset[str]:
        scopes = {one.name: one.scope for one in self.calibration.inferred.unknowns}
        priors = (*self.calibration.common, *self.calibration.own)
        shared = (prior.sources for prior in priors if scopes.get(prior.unknowns[0], "shot") != "shot")
        return frozenset((CAMERA_SCALE, *(source for sources in shared for source in sources)))


def _largest_at(values: Array, inside: Flags) -> int | None:
    """Return where values are largest inside; None where there are none."""
    shown = np.where(inside & np.isfinite(values), values, -np.inf)
    at = int(np.argmax(shown))
    return at if math.isfinite(shown[at]) else None
