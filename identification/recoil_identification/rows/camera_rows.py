"""A camera's frames as rows of the inference, beside those of the motion.

The camera saw the travel whose second derivative the accelerometer felt. With the errors ka and al of both scales, the
accelerometer's zero b and whatever else may be wrong in its reading a (`recoil_identification.rows.causes`),

    x = e^ka { II[e^-al (a - b r - S z - sum c h) + (1 - e) o + g - q r] } + x0 + tau v + th v (t - t_m) + D d + noise

II is the double integral from the onset on, where the part rests, o the seen acceleration that is not a' (the
carriage's, gravity's) with the share e and the zero q by which it may be off, tau what is left of the clocks' offset,
th of their rates, and D the shapes in which optics bend the picture. A camera on the ground sees gravity along the
bore at rest, g, for certain, and of the rest what turning the bore makes. What the accelerometer's own noise
integrates to is not white: the rows of the motion hold the same noise behind their filter, see
`recoil_identification.rows.row_noise`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_identification.inference.unknown import Prior, Unknown
from recoil_identification.rows import equation_of_motion as motion
from recoil_identification.rows.causes import DISTORTIONS, Cause
from recoil_processing.double_integral import DoubleIntegral
from recoil_processing.gaps import bridge
from recoil_processing.picture_bends import picture_bends
from recoil_processing.shot.camera_motion import RecordedMotion
from recoil_processing.shot.clocks.forced_recoil import RATE_ROLES, carriage_lacks
from recoil_processing.shot.error_source import ErrorSource, SourceKind
from recoil_processing.shot.regression import Regression
from recoil_processing.shot.signals import Signals
from recoil_rigs.rig import Rig
from recoil_rigs.tables.rig_tables import CARRIAGE_ACCELERATIONS, CARRIAGE_ROLES

MEAN_S = 1e-3
"""Over which frames are averaged: the rows of the motion hold nothing that is faster."""
BEFORE_S = 0.02
"""Time before the onset, s, from when on frames tell where the part rested."""
LEAST_MEANS = 12
"""Fewest means of frames after the onset, below which they say nothing beside place and clock."""
RELEASED = 2
"""Shapes in which the zero may have shifted, of those given, while the noise is looked for: the first ones."""
OTHER = Unknown(ErrorSource(SourceKind.CARRIAGE_PART), scope="rig")
OTHER_ZERO = Unknown(ErrorSource(SourceKind.CARRIAGE_ZERO), "m/s^2")
START = Unknown(ErrorSource(SourceKind.PLACE), "m")
LATE = Unknown(ErrorSource(SourceKind.CAMERA_LATE), "s")
RATE = Unknown("camera's seconds too long")
"""Unknowns of the frames; each is the source of its own prior."""
U_START_M, U_LATE_S = 0.01, 1e-3
"""Standard uncertainties, so large that the frames tell. The clock is asked anew, because it was found from the same
frames."""


@dataclass(frozen=True, eq=False)
class CameraRows(ReadOnlyArrays):
    """Means of frames.

    Attributes
    ----------
    times_s : ndarray, shape (n_rows,)
        Instants on the reference clock, s.
    recorded_m : ndarray, shape (n_rows,)
    sigma_m : ndarray, shape (n_rows,)
        Standard deviation of the camera's own error.
    onset_s
        Instant, s, from which on accelerations are integrated.
    density
        Density of the accelerometers' noise, (m/s^2)^2/Hz, two-sided.
    felt_m, other_m, certain_m, free_m, velocity_m_s : ndarray, shape (n_rows,)
        Double integrals of a', of the rest of the seen acceleration, of the part of it that is certain and stands
        apart, and of r; the travel's velocity.
    zeros_m : ndarray, shape (n_rows, n)
        Double integrals of the shapes of the zero's shifts and of the causes.
    sizes
        Names of the sizes of these shapes.
    bends : ndarray, shape (n_rows, n_distortions)
        Bend of the picture per metre of each distortion.
    u_rel, u_other_rel, u_other_zero_m_s2, u_distortion_m
        Standard uncertainties of the camera's scale, of e, of q, and of the first distortion; half of it is the next
        one's.
    clock
        The camera's.
    drift, u_rate
        Drift of that clock by which the frames lie where they lie, found from them, and the standard uncertainty of a
        drift, of which none is expected, before they were seen.
    """

    times_s: Array
    recorded_m: Array
    sigma_m: Array
    onset_s: float
    density: float
    felt_m: Array
    other_m: Array
    certain_m: Array
    free_m: Array
    velocity_m_s: Array
    zeros_m: Array
    sizes: tuple[str, ...]
    bends: Array
    u_rel: float
    u_other_rel: float
    u_other_zero_m_s2: float
    u_distortion_m: float
    clock: str
    drift: float
    u_rate: float

    @property
    def unknowns(self) -> tuple[str, ...]:
        """Names of those that the frames hang on."""
        own = (OTHER, OTHER_ZERO, START, LATE, RATE)
        of_rows = (motion.ACCELERATION, motion.CAMERA, motion.ZERO)
        return (*(one.name for one in of_rows), *self.sizes, *(one.name for one in own), *DISTORTIONS)

    def with_shifts(self, chosen: Sequence[int]) -> CameraRows:
        """Keep some of the shapes in which the zero may have shifted, counted anew; all causes are kept."""
        causes = [at for at, name in enumerate(self.sizes) if name not in self._shifts]
        sizes = (*(motion.shift(i).name for i in range(len(chosen))), *(self.sizes[at] for at in causes))
        return replace(self, zeros_m=self.zeros_m[:, [*chosen, *causes]], sizes=sizes)

    def with_causes(self, causes: Sequence[Cause], regression: Regression) -> CameraRows:
        """Take further errors of what the accelerometer read, on the regression's grid; of forces the frames know none.

        They are taken at the instants of the means: no suspected shape changes within one.
        """
        felt = [one for one in causes if np.any(one.acceleration_m_s2)]
        if not felt:
            return self
        start_s, step_s = float(regression.times_s[0]), regression.step_s
        wrong = [DoubleIntegral.of(one.acceleration_m_s2, start_s, step_s).at(self.times_s)[0] for one in felt]
        sizes = (*self.sizes, *(one.source for one in felt))
        return replace(self, zeros_m=np.column_stack([self.zeros_m, *wrong]), sizes=sizes)

    @property
    def _shifts(self) -> set[str]:
        return {motion.shift(i).name for i in range(len(self.sizes))}

    @property
    def priors(self) -> list[Prior]:
        """Priors of the unknowns that are in no row of the motion; the camera's scale has a certificate."""
        known: dict[str, float] = {
            OTHER.name: self.u_other_rel,
            OTHER_ZERO.name: self.u_other_zero_m_s2,
            START.name: U_START_M,
            LATE.name: U_LATE_S,
            **{name: self.u_distortion_m / 2**number for number, name in enumerate(DISTORTIONS)},
        }
        # without a pre-trigger baseline a zero is not known
        priors = [Prior.of(name, name, u) for name, u in known.items() if math.isfinite(u)]
        # the drift that aligned the frames was found from them: it is no second knowledge of the rate
        return [*priors, Prior.of(ErrorSource(SourceKind.CLOCK_RATE, self.clock), RATE.name, self.u_rate, -self.drift)]

    def linearised(self, values: Mapping[str, float]) -> tuple[Array, Array]:
        """Return what the motion leaves of the frames, and its derivatives, over the standard deviation."""
        of_accelerometer = math.exp(-values[motion.ACCELERATION.name])
        of_camera = math.exp(values[motion.CAMERA.name])
        wrong = np.column_stack([self.free_m, self.zeros_m])
        given = np.array([values[name] for name in (motion.ZERO.name, *self.sizes)])
        felt = of_accelerometer * (self.felt_m - wrong @ given)
        other = (1.0 - values[OTHER.name]) * self.other_m - values[OTHER_ZERO.name] * self.free_m
        travel = of_camera * (felt + other + self.certain_m)
        since_s = self.times_s - 0.5 * (self.onset_s + self.times_s[-1])
        added = np.column_stack([np.ones_like(travel), self.velocity_m_s, self.velocity_m_s * since_s, self.bends])
        sizes = np.array([values[name] for name in (START.name, LATE.name, RATE.name, *DISTORTIONS)])
        modelled = travel + added @ sizes
        derivatives = np.column_stack(
            [
                -of_camera * felt,
                travel,
                -of_camera * of_accelerometer * wrong,
                -of_camera * self.other_m,
                -of_camera * self.free_m,
                added,
            ]
        )
        return (self.recorded_m - modelled) / self.sigma_m, derivatives / self.sigma_m[:, np.newaxis]


def camera_rows(
    tracked: RecordedMotion,
    regression: Regression,
    recorded: Regression,
    inertial_m_s2: Array,
    causes: Sequence[Cause],
    signals: Signals,
    rig: Rig,
) -> CameraRows | None:
    """Average the frames from a little before the onset to the end of travel.

    None where they are too few, and where nothing tells how the tipping part moves, relative to which a camera sees the
    recoil, or which turns the bore before one on the ground.

    Parameters
    ----------
    tracked
        Frames that agree with their neighbours.
    regression, recorded
        Regressions behind the filter and before it, with the columns of the zero's shifts, step and kick first.
    inertial_m_s2 : ndarray, shape (n,)
        a' by the accelerometer, on the regression's grid; lost samples NaN.
    signals, rig
        Signals and rig, which tell how uncertain the carriage's sensors and the camera's picture are.
    """
    if carriage_lacks(signals, rig):
        return None
    shapes = np.zeros((recorded.times_s.size, 0)) if recorded.shifts is None else recorded.shifts
    # a zero that shifted at once must not look like noise
    track = tracked.motion.likeliest(shapes[:, :RELEASED], range(min(RELEASED, shapes.shape[1])), tracked.densities)
    onset_s, end_s = regression.interval_s
    frames_s, positions_m = tracked.motion.times_s, tracked.motion.positions_m
    number = np.floor((frames_s - onset_s) / MEAN_S).astype(np.int64)
    within = (number >= -BEFORE_S / MEAN_S) & (frames_s <= end_s)
    if track is None or np.unique(number[within & (number >= 0)]).size < LEAST_MEANS:
        return None
    at_rest = positions_m[within & (number < 0)]
    if at_rest.size:
        positions_m = positions_m - picture_origin_m(float(np.median(at_rest)))
    _, places, counts = np.unique(number[within], return_inverse=True, return_counts=True)
    times_s, start_s, step_s = frames_s[within], float(regression.times_s[0]), regression.step_s
    moving = regression.times_s >= onset_s

    def means(values: Array) -> Array:
        return np.asarray(np.bincount(places, values) / counts)

    def integral(acceleration: Array) -> Array:
        return means(DoubleIntegral.of(acceleration, start_s, step_s).at(times_s)[0])

    others = [one for one in causes if np.any(one.acceleration_m_s2) or one.travel_m_s2 is not None]
    shifts = [] if regression.shifts is None else [*regression.shifts.T]
    # behind the filter they begin before the onset
    seen = (one.acceleration_m_s2 if one.travel_m_s2 is None else one.travel_m_s2 for one in others)
    wrong = [integral(one) for one in (*shifts, *seen)]
    inertial = bridge(inertial_m_s2, otherwise=0.0)
    travelled = tracked.motion.integral.acceleration
    certain = np.zeros_like(travelled)
    u_zero_m_s2 = math.hypot(*(_u_zero(signals, role) for role in CARRIAGE_ACCELERATIONS))
    if rig.camera_on_ground:
        certain += rig.mechanism.g * math.sin(rig.mechanism.phi20)
        # a gyro whose zero is off turns gravity away from the bore
        u_zero_m_s2 = rig.mechanism.g * (end_s - onset_s) * math.hypot(*(_u_zero(signals, role) for role in RATE_ROLES))
    velocity = DoubleIntegral.of(travelled * moving, start_s, step_s).at(times_s)[1]
    return CameraRows(
        times_s=means(times_s),
        recorded_m=means(positions_m[within]),
        sigma_m=math.sqrt(tracked.motion.marker_variance) / np.sqrt(counts),
        onset_s=onset_s,
        density=track.density,
        felt_m=integral(inertial * moving),
        other_m=integral((travelled - inertial - certain) * moving),
        certain_m=integral(certain * moving),
        free_m=integral(recorded.released),
        velocity_m_s=means(velocity),
        zeros_m=np.column_stack([np.zeros((counts.size, 0)), *wrong]),
        sizes=(*(motion.shift(i).name for i in range(len(shifts))), *(one.source for one in others)),
        bends=np.column_stack([means(bend) for bend in picture_bends(positions_m[within])]),
        u_rel=tracked.u_rel,
        u_other_rel=max(spec.sensor.u_scale_rel for spec in rig.channels if spec.role in CARRIAGE_ROLES),
        u_other_zero_m_s2=u_zero_m_s2,
        u_distortion_m=max(spec.sensor.u_bent_m for spec in rig.with_role("recoil_displacement")),
        clock=tracked.clock,
        drift=tracked.drift,
        u_rate=tracked.u_rate,
    )


def picture_origin_m(rest_m: float) -> float:
    """Return the place of the battery in a camera's picture, whose origin is anywhere.

    Parameters
    ----------
    rest_m
        Place of the mark before the shot, m. One that is within what it is uncertain by anyway, `U_START_M`, is none.
    """
    return rest_m if abs(rest_m) > U_START_M else 0.0


def _u_zero(signals: Signals, role: str) -> float:
    """Return how uncertain a sensor's zero is by its rest before the shot, 0 of one that is not there."""
    return signals.offsets[role].u if role in signals.offsets else 0.0
