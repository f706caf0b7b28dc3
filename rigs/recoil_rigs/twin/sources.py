"""The recorders of the virtual rig: each samples the sensors on its own clock and gives its file's bytes."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from recoil_acquisition.errors import Fault, FaultCode, Row
from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.quantities.quantity import SI_UNITS, Unit, find_unit
from recoil_rigs.mechanism.model import Mechanism
from recoil_rigs.rig import ChannelSpec, Rig, Source
from recoil_rigs.shots.assemble import si_line
from recoil_rigs.tables.channel_table import range_si
from recoil_rigs.tables.rig_tables import FORCE_SENSOR_ROLES, GAUGE_ROLES, SHOT_PLACE
from recoil_rigs.twin.campaign import PlannedShot
from recoil_rigs.twin.files import dewesoft_text, track_text
from recoil_rigs.twin.instruments import chain, digitise, generator, line_truth, mix, sample, truth, wandering
from recoil_rigs.twin.line_motion import LineMotion
from recoil_rigs.twin.motion import Motion
from recoil_rigs.twin.recorder_settings import RecorderSettings
from recoil_rigs.twin.sensor_reading import (
    acceleration_noise,
    acceleration_reading,
    breech_reading,
    gauge_noise,
    handed_on,
    lagged,
    low_pass,
    travel_reading,
)

MIDDLE_AFTER_STAMP = {"start": 0.5, "middle": 0.0, "end": -0.5}
"""Time from a frame's stamp to the middle of its exposure, in exposures, by what is stamped."""
_TRACK_COLUMN = re.compile("(.*) - ([XY])", re.DOTALL)
"""Signal of a virtual camera: a feature and the axis of its position."""


@dataclass(frozen=True)
class Clock:
    """A clock: ``t_ref = (1 + drift) * t + offset_s``."""

    offset_s: float = 0.0
    drift: float = 0.0

    def to_reference(self, times_s: Array) -> Array:
        """Map instants of this clock to the reference clock."""
        return (1.0 + self.drift) * times_s + self.offset_s

    def from_reference(self, times_s: Array) -> Array:
        """Map instants of the reference clock to this clock."""
        return (times_s - self.offset_s) / (1.0 + self.drift)


@dataclass(frozen=True)
class SourceFile:
    """Recording of one source.

    Attributes
    ----------
    name
        Name of the file.
    truth
        Values that the file hides, JSON types only.
    """

    source: str
    name: str
    content: bytes
    truth: Mapping[str, Any]


@dataclass
class Scene:
    """One shot before the recorders: what all sensors feel, and the errors drawn so far.

    Attributes
    ----------
    mechanism
        Mechanism with the true recoiling mass.
    modes : ndarray, shape (n_modes, n)
        Stress waves, see `recoil_rigs.twin.instruments.stress_waves`.
    roles
        Channel -> role whose quantity it measures.
    campaign_seed
        Seed of what the shots of a campaign share, the errors of the sensors' scales and of the friction; None where
        `seed` draws it.
    planned
        Shot of a campaign's plan; None where there is none.
    unread, noise
        Values that were drawn of the forces that no gauge reads and of the noise, see `recoil_rigs.twin.draws`.
    gains, offsets
        Errors drawn, by channel; offsets in the unit of the file. Filled as channels are sampled.
    moves
        Movements of zeros and bends of optics, by channel. Filled as channels are sampled.
    late
        Delays of gauges that the rig file does not know of, s, by channel: a shift, or an orifice's time constant.
        Filled as channels are sampled.
    shares
        Parts of the driving or resisting force of a line that pass its sensors, by channel; empty of a gun.
    """

    rig: Rig
    settings: RecorderSettings
    mechanism: Mechanism
    motion: Motion | LineMotion
    modes: Array
    roles: Mapping[str, str]
    seed: int
    shot: str
    campaign_seed: int | None = None
    planned: PlannedShot | None = None
    unread: Mapping[str, Any] = field(default_factory=dict)
    noise: Mapping[str, Any] = field(default_factory=dict)
    gains: dict[str, float] = field(default_factory=dict)
    offsets: dict[str, float] = field(default_factory=dict)
    moves: dict[str, dict[str, float | str]] = field(default_factory=dict)
    late: dict[str, dict[str, float]] = field(default_factory=dict)
    shares: Mapping[str, float] = field(default_factory=dict)

    def clock(self, source: Source) -> Clock:
        """Return a source's clock: drawn from the seed, or the reference itself."""
        if source.name == self.rig.reference_clock:
            return Clock()
        rng = generator(self.seed, "clock", source.name)
        offset, drift = rng.uniform(-1.0, 1.0, 2) * (self.settings.clock_offset_s, self.settings.clock_drift)
        return Clock(float(offset), float(drift))

    def instants(self, clock: Clock, rate_hz: float) -> Array:
        """Return the instants n / rate of a clock up to the end of the record, on that clock."""
        end = float(clock.from_reference(self.motion.times_s[-1:])[0])
        return np.arange(int(np.floor(end * rate_hz + 1e-6)) + 1) / rate_hz

    def samples(self, spec: ChannelSpec, at_s: Array) -> Array:
        """Return what a channel's recorder stores at instants of the reference clock, in the file's unit."""
        rng = generator(self.seed, "channel", spec.name)
        role = self.roles[spec.name]
        motion, times = self.motion, self.motion.times_s
        at_s = at_s - self.settings.skew_s.get(spec.name, 0.0)
        feels = self._felt(role, spec, spec.sensor.position)
        own = feels
        if role in (*FORCE_SENSOR_ROLES, "recoil_acceleration", "recoil_displacement"):
            feels = self._reading(role, spec, feels)
        if role == "trigger":
            stored = np.interp(at_s, times, feels)
        else:
            peak = self._ringing_peak(role, spec, feels)
            if peak > 0:
                feels = feels + mix(self.modes, peak, rng)
            stored = self._handed_on(role, spec, chain(feels, float(times[1]), spec.sensor), at_s)
        if self.settings.wander and self.settings.gain_errors and role in FORCE_SENSOR_ROLES:
            stored = stored * (1.0 + self.settings.wander * wandering(at_s, generator(self.seed, "wander", spec.name)))
        added = self._noise_of_the_motion(role, spec, own, stored, at_s)
        if drift_pa_s := self._drift_pa_s(role):
            stored = stored + drift_pa_s * (at_s - motion.t_fire_s)
        after_shot = at_s >= motion.t_fire_s
        full_range = _range_in_file(spec)
        stored = to_file(stored, spec)
        if self.settings.hum > 0:
            stored = np.asarray(stored + self._hum(spec, stored, at_s), dtype=np.float64)
        shift = self.settings.shift_share(role) * after_shot + self._moving_zero(role, spec, at_s)
        shared = self.scale_error(spec)
        factor = self.gain_factor(spec)
        rest = self.settings.readings.rest_noise
        quieter = 1.0 if rest == 1.0 else np.where(motion.moves(at_s), 1.0, rest)
        stored, errors = digitise(
            stored, full_range, spec.sensor.u_scale_rel, self.settings, rng, shift, shared, factor, quieter, added
        )
        self.gains[spec.name], self.offsets[spec.name] = errors.gain, errors.offset
        return stored

    def scale_error(self, spec: ChannelSpec) -> float | None:
        """Return by how many standard uncertainties a sensor is off; None where that is drawn with its noise.

        In all shots of a campaign it is off by the same. What its standard is off, all are that were calibrated by it.
        """
        sensor, seed = spec.sensor, self.seed if self.campaign_seed is None else self.campaign_seed
        if self.campaign_seed is None and not sensor.u_reference_rel:
            return None
        own = float(generator(seed, "scale", spec.name).normal())
        if not sensor.u_reference_rel:
            return own
        part = sensor.u_reference_rel / sensor.u_scale_rel
        return math.sqrt(1.0 - part**2) * own + part * float(generator(seed, "standard", sensor.reference).normal())

    def gain_in_pulses(self, spec: ChannelSpec) -> float:
        """Return the factor on a gauge's gain in a pulse, by a draw from what no certificate at rest tells of it."""
        if not (spec.u_dynamic_rel and self.settings.gain_errors):
            return 1.0
        return 1.0 + spec.u_dynamic_rel * float(generator(self.of_rig, "dynamic scale", spec.name).normal())

    def gain_factor(self, spec: ChannelSpec) -> float:
        """Return the factor on a sensor's gain that the campaign's plan has for this shot, and that of its pulse."""
        planned = 1.0 if self.planned is None else self.planned.gain_factors.get(spec.name, 1.0)
        return planned * self.gain_in_pulses(spec)

    def seen(self, role: str, spec: ChannelSpec, at_s: Array) -> Array:
        """Return what a camera sees of a role's quantity at instants of the reference clock, SI."""
        times, feels = self.motion.times_s, self._felt(role, spec, (0.0, 0.0))
        if role == "recoil_displacement":
            late_s = self.settings.readings.rolling_shutter_s
            if late_s:
                at_s = at_s + late_s * np.interp(at_s, times, feels) / max(float(feels.max()), 1e-9)
            feels = self._reading(role, spec, feels)
        return sample(feels, times, at_s)

    def _felt(self, role: str, spec: ChannelSpec, position: tuple[float, float]) -> Array:
        """Return what a sensor feels without any error, SI, on the motion's grid."""
        if isinstance(self.motion, LineMotion):
            return line_truth(role, self.mechanism, self.motion, self.shares.get(spec.name, 1.0))
        return truth(role, self.mechanism, self.motion, position)

    def _reading(self, role: str, spec: ChannelSpec, feels: Array) -> Array:
        """Return what a sensor reads of what it feels, where that is not what the rig file takes it for."""
        r, motion, step = self.settings.readings, self.motion, float(self.motion.times_s[1])
        if role == "breech_pressure" and isinstance(motion, Motion):
            return breech_reading(feels, motion, r, self.mechanism, self.settings.unread, _full_scale(spec, feels))
        if role == "recoil_acceleration":
            return acceleration_reading(feels, step, r)
        if role == "recoil_displacement":
            felt = self._felt("recoil_acceleration", spec, (0.0, 0.0))
            on_ground = r.camera_on_ground or self.rig.source(spec.source).sees == "ground"
            return travel_reading(feels, felt, motion, r, self.mechanism, spec.sensor.position if on_ground else None)
        if role not in GAUGE_ROLES[1:]:
            return feels
        of_brake = role == "brake_pressure"
        orifice_s = 0.0 if of_brake else r.recuperator_orifice_s + self._line_s(spec)
        line_hz = r.brake_line_hz if of_brake else r.recuperator_line_hz
        if orifice_s:
            feels = lagged(feels, step, orifice_s)
            self.late[spec.name] = {"orifice_s": orifice_s}
        return low_pass(feels, step, line_hz, r.line_damping) if line_hz else feels

    def _line_s(self, spec: ChannelSpec) -> float:
        """Return the time constant of the orifice before a recuperator's gauge whose delay nobody stated.

        An orifice only delays: it is the size of a normal draw, whose root mean square is what is taken for the delay.
        """
        if not (spec.u_line_s and self.settings.unread_errors):
            return 0.0
        return spec.u_line_s * abs(float(generator(self.of_rig, "line", spec.name).normal()))

    def _handed_on(self, role: str, spec: ChannelSpec, signal: Array, at_s: Array) -> Array:
        """Sample what a chain gives out, behind a gateway where there is one; late by what nobody knows of it."""
        r, times = self.settings.readings, self.motion.times_s
        if self.settings.unread_errors and role in FORCE_SENSOR_ROLES and spec.sensor.u_delay_s:
            late_s = spec.sensor.u_delay_s * float(generator(self.of_rig, "delay", spec.name).normal())
            self.late[spec.name] = {"shift_s": late_s}
            at_s = at_s - late_s
        latencies_s = {"brake_pressure": r.brake_gateway_s, "recuperator_pressure": r.recuperator_gateway_s}
        if latency_s := latencies_s.get(role, 0.0):
            rng = generator(self.seed, "gateway", spec.name)
            return handed_on(signal, times, at_s, latency_s, r.gateway_hz, rng)
        return sample(signal, times, at_s, spec.sensor)

    def _noise_of_the_motion(
        self, role: str, spec: ChannelSpec, feels: Array, stored: Array, at_s: Array
    ) -> Array | float:
        """Return what the motion adds to a channel's noise, in the file's unit.

        Parameters
        ----------
        feels : ndarray, shape (m,)
            Values that the sensor feels, SI, on the motion's grid.
        stored : ndarray, shape (n,)
            Samples of the channel, SI.
        """
        r, rng = self.settings.readings, generator(self.seed, "motion noise", spec.name)
        if role == "recoil_acceleration":
            if not (r.noise_of_acceleration or r.noise_of_speed_per_s or r.structure_borne_m_s2 or r.knocks):
                return 0.0
            added = acceleration_noise(self.motion, feels, at_s, r, rng)
        elif role in FORCE_SENSOR_ROLES and (r.noise_of_reading or r.gauge_noise_of_speed_s_m):
            added = gauge_noise(self.motion, stored, _full_scale(spec, feels), at_s, r, rng)
        else:
            return 0.0
        factor, _ = si_line(spec, declared_unit(spec))
        return added / factor

    def _drift_pa_s(self, role: str) -> float:
        """Return by what a gauge's zero drifts in a second."""
        r = self.settings.readings
        drifts = (r.breech_drift_pa_s, r.brake_drift_pa_s, r.recuperator_drift_pa_s)
        return dict(zip(GAUGE_ROLES, drifts, strict=True)).get(role, 0.0)

    @property
    def of_rig(self) -> int:
        """Seed of what all shots of a campaign share."""
        return self.seed if self.campaign_seed is None else self.campaign_seed

    def _moving_zero(self, role: str, spec: ChannelSpec, at_s: Array) -> Array:
        """Return how a gauge's zero moves in the shot, share of full scale, if the rig states that it may.

        It moves by a draw from what is stated, in one of three ways: late and at once, slowly, or fast and back again.
        """
        u_rel = spec.sensor.u_zero_rel
        if not (u_rel and role in FORCE_SENSOR_ROLES and self.settings.gain_errors):
            return np.zeros(at_s.shape)
        rng = generator(self.seed, "moving zero", spec.name)
        size, way = u_rel * float(rng.normal()), int(rng.integers(3))
        since = np.maximum(at_s - self.motion.t_fire_s, 0.0)
        ways = (
            np.clip((since - 2e-3) / 4e-3, 0.0, 1.0),
            -np.expm1(-since / 20e-3),
            -np.expm1(-since / 2e-3) * np.exp(-since / 0.3),
        )
        self.moves[spec.name] = {"share_of_full_scale": size, "way": ("late", "slow", "fast and back")[way]}
        return np.asarray(size * ways[way], dtype=np.float64)

    def _hum(self, spec: ChannelSpec, stored: Array, at_s: Array) -> Array:
        """Return the mains' hum on a channel, in the file's unit; each channel catches it in a phase of its own."""
        full_range = _range_in_file(spec)
        full_scale = float(np.abs(stored if full_range is None else full_range).max())
        phase = generator(self.seed, "hum", spec.name).uniform(0.0, 2 * np.pi)
        return np.asarray(
            self.settings.hum * full_scale * np.sin(2 * np.pi * self.settings.hum_hz * at_s + phase), dtype=np.float64
        )

    def _ringing_peak(self, role: str, spec: ChannelSpec, feels: Array) -> float:
        """Return the peak of the stress waves on a channel, SI."""
        s = self.settings
        if role in FORCE_SENSOR_ROLES:
            return 2 * s.ringing * s.ringing_pressure * _full_scale(spec, feels)
        return s.ringing_share(role) * self.motion.ringing_m_s2(s.ringing, self.mechanism)


def _full_scale(spec: ChannelSpec, feels: Array) -> float:
    """Return the full scale of a sensor, SI; the largest value that it feels where it has no range."""
    limits = range_si(spec)
    return float(np.abs(feels).max()) if limits is None else max(abs(limits[0]), abs(limits[1]))


def _distortion(scene: Scene, spec: ChannelSpec, travel_m: Array) -> Array:
    """Return what optics add to a travel, by draws from what the rig states: a bow, and an S half as large."""
    u_m = spec.sensor.u_distortion_m
    if not (u_m and scene.settings.gain_errors):
        return np.zeros(travel_m.shape)
    # one camera's optics are the same in all shots of a campaign
    seed = scene.seed if scene.campaign_seed is None else scene.campaign_seed
    bow_m, s_m = np.array([u_m, 0.5 * u_m]) * generator(seed, "distortion", spec.name).normal(0.0, 1.0, 2)
    share = travel_m / max(float(np.max(travel_m)), 1e-9)
    scene.moves[spec.name] = {"bow_m": float(bow_m), "s_m": float(s_m)}
    bow = 4.0 * share * (1.0 - share)
    return np.asarray(bow_m * bow + s_m * 2.6 * bow * (1.0 - 2.0 * share), dtype=np.float64)


def file_unit(spec: ChannelSpec) -> str:
    """Return the unit of a channel's numbers in its file, as the rig spells it."""
    return spec.unit or SI_UNITS[spec.quantity]


def declared_unit(spec: ChannelSpec) -> Unit:
    """Return the unit of a channel's numbers in its file; that of SI for pixels, whose scale is the camera's."""
    return find_unit(file_unit(spec)) or Unit(frozenset(), 1.0)


def to_file(values: Array, spec: ChannelSpec) -> Array:
    """Convert SI values to the numbers of the channel's file: its unit, its polarity, its chain."""
    factor, offset = si_line(spec, declared_unit(spec))
    return (values - offset) / factor


def _range_in_file(spec: ChannelSpec) -> tuple[float, float] | None:
    """Return the sensor's range in the numbers of the file, the lower one first."""
    limits = range_si(spec)
    if limits is None:
        return None
    low, high = np.sort(to_file(np.array(limits), spec)).tolist()
    return low, high


def in_unit(numbers: Array, spec: ChannelSpec, unit_name: str) -> Array:
    """Convert the numbers of a channel from the unit that the rig declares to the one that its message carries."""
    unit = find_unit(unit_name) if unit_name else None
    if unit is None or spec.sensor.sensitivity is not None:
        return numbers
    return (declared_unit(spec).to_si(numbers) - unit.offset) / unit.factor


def file_name(scene: Scene, source: Source, suffix: str, faults: list[Fault]) -> str:
    """Return a name for a source's file that its ``match`` pattern, and no other source's, fits.

    Buses may share one.
    """
    name = f"{scene.shot}_{source.name}{suffix}"
    if source.match and SHOT_PLACE in source.match:
        name = source.match.replace(SHOT_PLACE, scene.shot).replace("*", "")
    elif source.match and not (source.pattern and source.pattern.fullmatch(name)):
        head, star, tail = source.match.partition("*")
        name = head + (f"{scene.shot}_" if not head else f"_{scene.shot}") * bool(star) + tail.replace("*", "")
        name += suffix if source.match.endswith("*") else ""
    owners = [s.name for s in scene.rig.matching(name) if s == source or s.bus is None or source.bus is None]
    key = (Row("source", source.name), "match")
    if owners not in ([], [source.name]):
        faults.append(Fault(key, f"{name!r} would also match {', '.join(owners)}", FaultCode.AMBIGUOUS))
    elif source.match and not owners:
        faults.append(Fault(key, f"{source.match!r} gives no name; use only `*` in it", FaultCode.VALUE))
    return name


def dewetron_file(scene: Scene, source: Source, faults: list[Fault]) -> SourceFile:
    """Record the channels of a Dewetron recorder as a Dewesoft text export."""
    clock = scene.clock(source)
    times = scene.instants(clock, scene.settings.sample_rate_hz)
    at = clock.to_reference(times)
    specs = [c for c in scene.rig.channels if c.source == source.name]
    columns = {f"{c.signal} ({file_unit(c)})": scene.samples(c, at) for c in specs}
    content = dewesoft_text(times, columns, scene.settings.dewesoft_style)
    return SourceFile(source.name, file_name(scene, source, ".csv", faults), content, clock_truth(clock))


def clock_truth(clock: Clock, **more: float) -> dict[str, Any]:
    """Return what the truth says of a clock."""
    return {"clock": {"offset_s": clock.offset_s, "drift": clock.drift, **more}}


def camera_file(scene: Scene, source: Source, faults: list[Fault]) -> SourceFile:
    """Record the tracks of a camera: the features of its channels, and one that is fixed on the tipping part.

    Positions are relative to the tipping part, along the bore (rearward) and across it, as a tracker
    reports them that takes its origin from a mark on the tipping part.
    """
    s = scene.settings
    rng = generator(scene.seed, "camera", source.name)
    clock = scene.clock(source)
    rate = float(source.frame_rate or 0.0)
    times = scene.instants(clock, rate)
    # frames that lie farther apart than is declared
    at = clock.to_reference(times * (1.0 + s.readings.frame_rate))
    if s.readings.frame_jitter_s:
        at = at + s.readings.frame_jitter_s * generator(scene.seed, "frame jitter", source.name).normal(size=at.size)
    if source.exposure_s is not None:
        # a moving mark's picture has its centre where the mark was in the middle of the exposure
        at = at + MIDDLE_AFTER_STAMP[source.exposure_stamp or "start"] * source.exposure_s
    count = len(times)
    unit, positions = "mm", {}
    for spec in (c for c in scene.rig.channels if c.source == source.name):
        column = _TRACK_COLUMN.fullmatch(spec.signal)
        if column is None:
            problem = f"{spec.signal!r} should end in ' - X' or ' - Y'; a virtual camera names its axes so"
            faults.append(Fault((Row("channel", spec.name), "signal"), problem, FaultCode.VALUE))
            continue
        unit = file_unit(spec)
        shared = scene.scale_error(spec)
        drawn = float(generator(scene.seed, "channel", spec.name).normal()) if shared is None else shared
        gain = (1.0 + spec.sensor.u_scale_rel * drawn * s.gain_errors) * scene.gain_factor(spec)
        place = np.zeros((count, 2))
        travel = scene.seen(scene.roles[spec.name], spec, at)
        feature, axis = column.groups()
        place[:, "XY".index(axis)] = gain * (travel + _distortion(scene, spec, travel))
        positions[feature] = _in_picture(place + rng.normal(0.0, 1.0, place.shape) * s.camera_noise_m, spec, source)
        scene.gains[spec.name] = gain
        fixed = np.array([-0.35, 0.12]) + rng.normal(0.0, 1.0, place.shape) * s.camera_noise_m
        positions.setdefault("Feature #2", _in_picture(fixed, spec, source))
    wanted = s.camera_lost + s.camera_missing + s.camera_repeated
    if wanted > count - 4:
        problem = f"{wanted} faulty frames are too many for a camera track of {count}"
        faults.append(Fault(("twin", "camera_lost"), problem, FaultCode.CONTRADICTION))
    if faults:
        return SourceFile(source.name, "", b"", clock_truth(clock))
    chosen = rng.choice(np.arange(2, count - 2), wanted, replace=False)
    lost, missing, repeated = np.split(chosen, [s.camera_lost, s.camera_lost + s.camera_missing])
    for place in positions.values():
        place[repeated] = place[repeated - 1]
    kept = np.setdiff1d(np.arange(count), missing)
    # a camera that drops a picture without knowing it numbers the next one in its place
    dropped = np.sort(generator(scene.seed, "dropped frames").choice(kept[2:-2], s.camera_dropped, replace=False))
    seen = np.setdiff1d(kept, dropped)
    numbers = seen - np.searchsorted(dropped, seen)
    content = track_text(numbers, rate, {k: v[seen] for k, v in positions.items()}, np.isin(seen, lost), unit)
    hidden = {
        **clock_truth(clock),
        "lost_frames": np.sort(lost).tolist(),
        "missing_frames": np.sort(missing).tolist(),
        "repeated_frames": np.sort(repeated).tolist(),
        "dropped_frames": dropped.tolist(),
    }
    return SourceFile(source.name, file_name(scene, source, ".csv", faults), content, hidden)


def _in_picture(place_m: Array, spec: ChannelSpec, source: Source) -> Array:
    """Convert positions to the unit of the tracks: a length, or pixels of a declared scale."""
    if file_unit(spec) == "px":
        return to_file(place_m, spec) * 1e3 / float(source.scale_mm_per_px or 1.0)
    return to_file(place_m, spec)
