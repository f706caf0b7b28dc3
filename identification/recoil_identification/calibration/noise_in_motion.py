"""The noise of a shot's rows while the part moves, found with all that its sensors may be off released.

What is left of a fit tells noise only where nothing else can have left it: so the scales of gauges and accelerometer
and the friction are given far wider priors meanwhile, the mass stays near to its first value, and all unknowns are
integrated out. The sizes are found anew after each of the first steps of the estimate
(`recoil_identification.rows.motion_noise` for the parts and their likelihood). Where a camera's frames stand in the
place of the motion's rows, the parts are those of the acceleration that the frames show integrated twice.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_identification.inference.block import Block, JointBlock, LinearBlock
from recoil_identification.inference.correlation import Correlation
from recoil_identification.inference.solve import expected, solve
from recoil_identification.inference.unknown import Prior, Unknown
from recoil_identification.rows import equation_of_motion as motion
from recoil_identification.rows.camera_rows import CameraRows
from recoil_identification.rows.equation_of_motion import EquationOfMotion
from recoil_identification.rows.motion_noise import PARTS, WHITE, MotionParts, likeliest_sizes
from recoil_identification.rows.row_noise import RowNoise, by_filter, correlation_of, rest_covariance
from recoil_identification.rows.travel_rows import ForcedTravel, TravelRows
from recoil_processing.shot.error_source import ErrorSource

WIDER = 6.0
"""Factor on the standard uncertainty of what is known of scales and friction, meanwhile."""
LATE_S = 2e-3
"""Standard deviation by which a gauge or a clock may be late meanwhile, s: what one that is leaves looks like coloured
noise."""
DRIFTS = 0.03
"""Standard deviation of a drift of the mass's logarithm over the travel meanwhile, where no other change is asked for:
what one leaves looks like coloured noise, too."""
NEAR_MASS = 0.1
"""Standard deviation of the mass's logarithm about its first value: no noise can make the motion that of another
mass."""
FURTHEST = 1e2
"""Standard deviation of what nothing determines, in the size that moves a row by all of the motion."""
SEARCHES = 4
"""Steps of the estimate, before each of which the sizes are looked for."""
SETTLED = 1e-9
"""Change of the sizes, relative, below which they are what they were."""


@dataclass(frozen=True, eq=False)
class MotionRows(ReadOnlyArrays):
    """Rows of a motion whose noise is looked for.

    Attributes
    ----------
    block
        Rows over standard deviations of one.
    at_rest : ndarray, shape (n_rows, n_rows)
        Covariance at rest, in the square of the rows' unit.
    parts : ndarray, shape (PARTS, n_rows, n_rows)
        Covariance of each part for a size of 1 m/s^2.
    size
        Root mean square of what the rows show, in their unit.
    acceleration_m_s2
        Root mean square of the acceleration, m/s^2.
    level_m_s2, least_m_s2
        Standard deviation of the acceleration without the parts, or of its white part, whichever is larger, and the
        smallest size of the first part.
    """

    block: Block
    at_rest: Array
    parts: Array
    size: float
    acceleration_m_s2: float
    level_m_s2: float
    least_m_s2: float


def noise_in_motion(
    block: EquationOfMotion,
    noise: RowNoise,
    camera: CameraRows | None,
    further: Sequence[LinearBlock],
    priors: Sequence[Prior],
    unknowns: Sequence[Unknown],
) -> RowNoise:
    """Find what the motion adds to the noise of a shot's rows.

    Parameters
    ----------
    block
        Rows of the motion, with the columns of all shapes in which the accelerometer's zero may have shifted; a drift
        of the mass is added where it has no shape in which the mass changes.
    noise
        Noise at rest.
    camera
        Rows of its frames, if there are any, with the same shapes.
    further
        Rows of the gauges.
    priors
        Priors of all unknowns.
    unknowns
        All unknowns, those of the block first.
    """
    if block.changes is None:
        block = replace(block, changes=motion.ramps(block.regression.times_s, block.regression.interval_s, 1))
        priors = [*priors, Prior.of("drift", motion.change(0).name, DRIFTS)]
        others = [unknown for unknown in unknowns if unknown.name not in block.unknowns]
        unknowns = [*block.all_unknowns, *others]
    regression, rows, n = block.regression, block.rows, block.rows.size
    rest_m_s2 = float(np.median(noise.rest_m_s2[rows]))
    parts = MotionParts.of(regression, rows, block.m0_kg, rest_m_s2)
    times_s = regression.times_s[rows]
    whole = rest_covariance(regression, rows, noise, camera)
    size = float(np.sqrt(np.mean(regression.acceleration_m_s2[rows] ** 2)))
    of_motion = MotionRows(
        block=replace(block, sigma_m_s2=np.ones(n)),
        at_rest=whole[:n, :n],
        parts=parts.covariances(times_s, rows, by_filter(regression, times_s)),
        size=size,
        acceleration_m_s2=size,
        level_m_s2=max(rest_m_s2, parts.least_m_s2),
        least_m_s2=parts.least_m_s2,
    )
    beside: list[Block] = [*further]
    if camera is not None:
        beside.append(JointBlock((camera,), Correlation.of(whole[n:, n:])))

    def with_sizes(sizes: Array) -> RowNoise:
        share = float(np.linalg.norm(sizes[WHITE:])) / size if size > 0 else 0.0
        return replace(noise, parts=parts, sizes_m_s2=sizes, unexplained_share=share)

    def joined(sizes: Array) -> Sequence[Block]:
        found = with_sizes(sizes)
        weighed = replace(block, sigma_m_s2=found.sigma_m_s2[rows])
        correlation = correlation_of(regression, rows, found, camera, at_rest=whole, parts=of_motion.parts)
        return [JointBlock((weighed,) if camera is None else (weighed, camera), correlation), *further]

    return with_sizes(_sizes(of_motion, beside, joined, priors, _released(priors, block), unknowns))


def travel_with_noise(
    block: EquationOfMotion,
    travel: ForcedTravel,
    noise: RowNoise,
    further: Sequence[LinearBlock],
    priors: Sequence[Prior],
    unknowns: Sequence[Unknown],
) -> tuple[ForcedTravel, RowNoise]:
    """Find what the motion adds to the noise of a travel that the forces drive.

    Parameters
    ----------
    block
        Equation of motion of every sample.
    travel
        Means of frames, with the noise of the camera and of the forces at rest.
    noise
        Noise at rest.
    further
        Rows of the gauges.
    priors
        Priors of all unknowns.
    unknowns
        All unknowns, those of the block first.

    Returns
    -------
    travel : ForcedTravel
        Travel with the noise that was found.
    noise : RowNoise
        Noise with the sizes of its parts.
    """
    parts, acceleration_m_s2 = travel.motion_parts(block)
    level = max(travel.level_m_s2, float(np.finfo(np.float32).tiny))
    of_motion = MotionRows(
        block=TravelRows(block, replace(travel, sigma_m=np.ones_like(travel.sigma_m))),
        at_rest=travel.covariance_m2,
        parts=parts,
        size=float(np.sqrt(np.mean((travel.recorded_m - travel.recorded_m[0]) ** 2))),
        acceleration_m_s2=acceleration_m_s2,
        level_m_s2=level,
        least_m_s2=0.0,
    )

    def with_sizes(sizes: Array) -> ForcedTravel:
        return replace(travel, motion_m2=np.tensordot(sizes**2, parts, 1))

    def joined(sizes: Array) -> Sequence[Block]:
        seen = with_sizes(sizes)
        return [JointBlock((TravelRows(block, seen),), seen.correlation), *further]

    sizes = _sizes(of_motion, further, joined, priors, _released(priors, block), unknowns)
    share = float(np.linalg.norm(sizes[WHITE:])) / acceleration_m_s2 if acceleration_m_s2 > 0 else 0.0
    return with_sizes(sizes), replace(noise, sizes_m_s2=sizes, unexplained_share=share)


def _sizes(
    rows: MotionRows,
    beside: Sequence[Block],
    joined: Callable[[Array], Sequence[Block]],
    priors: Sequence[Prior],
    released: Sequence[Prior],
    unknowns: Sequence[Unknown],
) -> Array:
    """Find the sizes of the parts, with the first steps of the estimate between one search and the next.

    Parameters
    ----------
    beside
        Blocks that the parts are not in, of what stands beside the rows.
    joined
        Function from sizes to all blocks of the estimate.
    released
        The priors while the sizes are looked for.
    """
    named = [unknown.name for unknown in unknowns]
    places = [named.index(name) for name in rows.block.unknowns]
    values, sizes, first = dict.fromkeys(named, 0.0), np.zeros(PARTS), 0.0
    sizes[0] = rows.least_m_s2
    for number in range(SEARCHES):
        left, derivatives = rows.block.linearised(values)
        columns = np.zeros((left.size, len(named)))
        columns[:, places] = derivatives
        largest = np.max(np.abs(columns), axis=0)
        limits = np.where(largest > 0, FURTHEST * rows.size / np.where(largest > 0, largest, 1.0), FURTHEST)
        near = [] if number == 0 else [Prior.of("near", motion.MASS.name, NEAR_MASS, first)]
        step, root = expected(unknowns, beside, [*released, *near], values, limits)
        moved = columns @ root
        before = sizes
        sizes = likeliest_sizes(
            left - columns @ step,
            rows.at_rest + moved @ moved.T,
            rows.parts,
            rows.level_m_s2,
            rows.least_m_s2,
            sizes,
            highest=rows.acceleration_m_s2 * float(np.sqrt(np.mean(left**2))) / rows.size,
            white_only=number == 0,
        )
        if number > 1 and np.allclose(sizes, before, rtol=SETTLED, atol=0.0):
            break
        if number < SEARCHES - 1:
            estimate = solve(unknowns, joined(sizes), priors, values, most_steps=1)
            values = {name: estimate.value(name) for name in named}
            first = values[motion.MASS.name] if number == 0 else first
    return sizes


def _released(priors: Sequence[Prior], block: EquationOfMotion) -> list[Prior]:
    """Release what priors say of scales and friction, and of what may be late."""
    known = (*block.gauges, motion.FRICTION, motion.scale_of(block.regression.motion_role))
    names = frozenset(unknown.name for unknown in known)
    return [_widened(prior, names) for prior in priors]


def _widened(prior: Prior, names: frozenset[str]) -> Prior:
    if prior.exact:
        return prior
    if not names.isdisjoint(prior.unknowns):
        return replace(prior, covariance=WIDER**2 * prior.covariance)
    source = prior.sources[0]
    if len(prior.sources) == 1 and isinstance(source, ErrorSource) and source.is_of_time:
        return replace(prior, covariance=np.maximum(prior.covariance, LATE_S**2))
    return prior
