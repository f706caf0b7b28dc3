"""Shots of the virtual rig as its camera and its accelerometers record them, in memory: a real three-body motion.

No file is written: the recorders' samples go straight to where the pipeline has them after reading and assembling.
Loads, clocks, gains, biases, ringing and lost frames differ from shot to shot.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.channel import Channel
from recoil_acquisition.clocks.timebase import TimeBase
from recoil_acquisition.shot.shot import ClockAlignment, Shot
from recoil_processing.alignment.align import judge_motion
from recoil_processing.alignment.motion_alignment import align_motion
from recoil_processing.alignment.motion_fit import MotionFit
from recoil_processing.shot.kinematics import angular_motion, travel_acceleration
from recoil_processing.shot.signals import collect_signals
from recoil_rigs.rig import Rig
from recoil_rigs.shots.assemble import in_si
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.twin import draw_scene
from recoil_rigs.twin.instruments import generator, sample
from recoil_rigs.twin.motion import Motion
from recoil_rigs.twin.sources import Scene, declared_unit
from tests.builders.virtual_shots import with_twin

Array = NDArray[np.float64]

FRAME_RATE_HZ = 6000.0
MARKER_SIGMA_M = 6e-5
DRIFT_ALLOWANCE = 5e-5
"""Standard uncertainty of two clocks' rate ratio that the alignment is told; the true ones lie within it."""
RINGING_MODES = 3
PLAIN = {
    "sample_rate_hz": 40e3, "duration_s": 0.4, "camera_noise_m": MARKER_SIGMA_M, "clock_drift": DRIFT_ALLOWANCE,
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class TrackedShot:
    """What the alignment by motion is given, and the truth.

    Attributes
    ----------
    camera_times_s, displacement_m : ndarray, shape (n_frames,)
        Lost frames NaN.
    start_s, step_s : float
        Time base of the acceleration.
    acceleration_m_s2 : ndarray, shape (n_samples,)
        Of the travel, by the accelerometers and gyros.
    acceleration_sigma_m_s2 : float
        Standard deviation before the shot.
    u_gain : float
        Of the sensors' scales.
    onset_s : float
        First instant of force on the recorder's clock, as found.
    offset_s, drift, gain : float
        The truth; the gain is the camera's over the accelerometer's.
    middle_s : float
        Camera time in the middle of the motion: the mean of the frames' times, weighted by squared velocity.
    """

    camera_times_s: Array
    displacement_m: Array
    start_s: float
    step_s: float
    acceleration_m_s2: Array
    acceleration_sigma_m_s2: float
    u_gain: float
    onset_s: float
    offset_s: float
    drift: float
    gain: float
    middle_s: float

    def align(self, *, drift_allowance: float = DRIFT_ALLOWANCE) -> MotionFit | str:
        """Align camera and accelerometer."""
        return align_motion(
            self.camera_times_s,
            self.displacement_m,
            self.start_s,
            self.step_s,
            self.acceleration_m_s2,
            acceleration_sigma_m_s2=self.acceleration_sigma_m_s2,
            drift_allowance=drift_allowance,
            onset_s=self.onset_s,
        )

    def judge(self, fit: MotionFit | str) -> ClockAlignment:
        """Judge a fit as the pipeline does."""
        return judge_motion(
            "camera",
            fit,
            u_gain=self.u_gain,
            noise_density=self.acceleration_sigma_m_s2**2 * self.step_s,
            frame_period_s=float(np.median(np.diff(self.camera_times_s))),
        )

    def error_s(self, offset_s: float, drift: float = 0.0) -> float:
        """Error of the time that the middle of the motion is mapped to."""
        return offset_s - self.offset_s + (drift - self.drift) * self.middle_s

    def frame_at(self, reference_s: float) -> int:
        """Return the frame that is nearest to an instant of the reference clock."""
        mapped = (1.0 + self.drift) * self.camera_times_s + self.offset_s
        return int(np.argmin(np.abs(mapped - reference_s)))

    def at_wrong_rate(self, factor: float) -> TrackedShot:
        """Declare the camera's frame rate too high by a factor: its seconds are too short."""
        return replace(
            self,
            camera_times_s=self.camera_times_s / factor,
            drift=(1.0 + self.drift) * factor - 1.0,
            middle_s=self.middle_s / factor,
        )

    def with_shifted_zero(self, step_m_s2: float, late_s: float = 0.0) -> TrackedShot:
        """Shift the accelerometer's zero at the shot, or somewhat later."""
        times = self.start_s + self.step_s * np.arange(self.acceleration_m_s2.size)
        shifted = self.acceleration_m_s2 + step_m_s2 * (times >= self.onset_s + late_s)
        return replace(self, acceleration_m_s2=np.asarray(shifted, dtype=np.float64))

    def without_frame(self, index: int) -> TrackedShot:
        """Lose a picture although times and numbers go on as if it had been the next one."""
        return replace(
            self,
            camera_times_s=self.camera_times_s[:-1],
            displacement_m=np.delete(self.displacement_m, index),
        )

    def with_repeated_frame(self, index: int) -> TrackedShot:
        """Write a picture twice although the camera took it once: all later ones are a period late."""
        period = float(np.median(np.diff(self.camera_times_s)))
        return replace(
            self,
            camera_times_s=np.append(self.camera_times_s, self.camera_times_s[-1] + period),
            displacement_m=np.insert(self.displacement_m, index, self.displacement_m[index]),
        )


@lru_cache(maxsize=8)
def _loaded(seed: int, sample_rate_hz: float, duration_s: float) -> tuple[Rig, Scene]:
    """Let the mechanism move under loads of this shot's own."""
    rng = np.random.default_rng([seed, 17])
    loads = {
        "peak_pressure_pa": 130e6 * rng.uniform(0.85, 1.06),
        "rise_s": 1.5e-3 * rng.uniform(0.7, 1.4),
        "orifice_m2": 6.0e-4 * rng.uniform(0.92, 1.08),
        "recuperator_pressure_pa": 1.65e6 * rng.uniform(0.9, 1.1),
        "counter_recoil_n_s2_m2": 8000.0 * rng.uniform(0.6, 2.0),
        "ringing": rng.uniform(0.3, 0.7),
    }
    rig = with_twin("field-2013", **(PLAIN | loads | {"sample_rate_hz": sample_rate_hz, "duration_s": duration_s}))
    scene = draw_scene(rig, seed, f"s{seed}")
    return rig, replace(scene, modes=scene.modes[:RINGING_MODES])


def track_shot(
    seed: int,
    *,
    sample_rate_hz: float = 40e3,
    duration_s: float = 0.4,
    lost_share: float = 0.005,
    moving: bool = True,
    track: int = 0,
) -> TrackedShot:
    """Simulate and record one shot.

    Parameters
    ----------
    seed : int
        Of the loads, the sensors' errors, the clocks and the noise.
    sample_rate_hz, duration_s : float
        Of the recorder.
    lost_share : float
        Of the frames, at random, NaN.
    moving : bool
        False: the shot was not fired.
    track : int
        Another one is another camera's camera track of the same shot: other noise, lost frames and scale.
    """
    rig, scene = _loaded(seed, sample_rate_hz, duration_s)
    if not moving:
        scene = replace(scene, motion=_at_rest(scene.motion), modes=1e-12 * scene.modes)
    scene = replace(scene, gains={}, offsets={})
    reference = rig.source(rig.reference_clock)
    times = scene.instants(scene.clock(reference), sample_rate_hz)
    base = TimeBase.uniform(reference.name, 0.0, 1.0 / sample_rate_hz, times.size)
    channels = {}
    for spec in (c for c in rig.channels if c.source == reference.name):
        si = in_si(spec, declared_unit(spec), scene.samples(spec, times))
        channels[spec.name] = Channel(spec.name, spec.quantity, si, base, spec.signal, spec.role, spec.sensor.u_rel)
    shot = Shot(scene.shot, rig.name, rig.text, reference.name, channels)
    signals = collect_signals(FiredShot(shot, rig), {})
    acceleration = travel_acceleration(signals, rig, angular_motion(signals, rig))
    silent = acceleration[(signals.times_s >= signals.baseline_s[0]) & (signals.times_s < signals.baseline_s[1])]

    camera = next(s for s in rig.sources if s.kind == "camera")
    spec = next(c for c in rig.channels if c.role == "recoil_displacement")
    clock = scene.clock(camera)
    frames = scene.instants(clock, FRAME_RATE_HZ)
    at = clock.to_reference(frames)
    rng = generator(seed, "film", str(track))
    camera_gain = 1.0 + spec.sensor.u_rel * float(rng.standard_normal())
    place = camera_gain * sample(scene.motion.q[:, 4], scene.motion.times_s, at)
    place = place + MARKER_SIGMA_M * rng.standard_normal(place.size)
    place[rng.random(place.size) < lost_share] = np.nan
    speed = sample(scene.motion.qd[:, 4], scene.motion.times_s, at)
    seen = np.isfinite(place) & (at >= 0.0)
    weights = speed[seen] ** 2 if moving else np.ones(int(seen.sum()))
    return TrackedShot(
        camera_times_s=frames,
        displacement_m=place,
        start_s=signals.start_s,
        step_s=signals.step_s,
        acceleration_m_s2=acceleration,
        acceleration_sigma_m_s2=float(np.std(silent)),
        u_gain=math.hypot(spec.sensor.u_rel, rig.channel("acc_recoil").sensor.u_rel),
        onset_s=signals.onset_s,
        offset_s=clock.offset_s,
        drift=clock.drift,
        gain=camera_gain / scene.gains["acc_recoil"],
        middle_s=float(np.average(frames[seen], weights=weights)),
    )


def _at_rest(motion: Motion) -> Motion:
    still = np.zeros_like(motion.q)
    return replace(motion, q=still, qd=still, qdd=still)
