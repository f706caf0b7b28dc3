"""The noise of a shot's rows while the part moves, found with all that its sensors may be off released.

What is left of a fit tells noise only where nothing else can have left it: so the scales of gauges and accelerometer
and the friction are given far wider priors meanwhile, the mass stays near to its first value, and all unknowns are
integrated out. The sizes are found anew after each of the first steps of the estimate
(`recoil_identification.rows.motion_noise` for the parts and their likelihood).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from recoil_identification.inference.block import Block, JointBlock, LinearBlock
from recoil_identification.inference.correlation import Correlation
from recoil_identification.inference.solve import expected, solve
from recoil_identification.inference.unknown import Prior, Unknown
from recoil_identification.rows import equation_of_motion as motion
from recoil_identification.rows.camera_rows import CameraRows
from recoil_identification.rows.equation_of_motion import EquationOfMotion
from recoil_identification.rows.motion_noise import PARTS, MotionParts, likeliest_sizes
from recoil_identification.rows.row_noise import RowNoise, by_filter, correlation_of, rest_covariance

Array = NDArray[np.float64]

RELEASED = frozenset({*(gauge.name for gauge in motion.GAUGES), motion.FRICTION.name, motion.ACCELERATION.name})
"""Unknowns whose priors are widened meanwhile."""
WIDER = 6.0
"""Factor on the standard uncertainty of their priors."""
NEAR_MASS = 0.1
"""Standard deviation of the mass's logarithm about its first value: no noise can make the motion that of another
mass."""
FURTHEST = 1e2
"""Standard deviation of what nothing determines, in the size that moves a row by the acceleration's root mean square;
that of the mass before its first value is known."""
SEARCHES = 4
"""Steps of the estimate, before each of which the sizes are looked for."""
SETTLED = 1e-9
"""Change of the sizes, relative, below which they are what they were."""


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
        Rows of the motion, with the columns of all shapes in which the accelerometer's zero may have shifted.
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
    regression, rows, n = block.regression, block.rows, block.rows.size
    rest_m_s2 = float(np.median(noise.rest_m_s2[rows]))
    parts = MotionParts.of(regression, rows, block.m0_kg, rest_m_s2)
    level = max(rest_m_s2, parts.least_m_s2)
    times_s = regression.times_s[rows]
    added = parts.covariances(times_s, rows, by_filter(regression, times_s))
    whole = rest_covariance(regression, rows, noise, camera)
    at_rest, frames = whole[:n, :n], whole[n:, n:]
    alone: list[Block] = [*further]
    if camera is not None:
        alone.append(JointBlock((camera,), Correlation.of(frames)))
    released = [_widened(prior) for prior in priors]
    named = [unknown.name for unknown in unknowns]
    places = [named.index(name) for name in block.unknowns]
    plain = replace(block, sigma_m_s2=np.ones(n))
    reach = np.sqrt(np.mean(regression.acceleration_m_s2[rows] ** 2))

    values, sizes = dict.fromkeys(named, 0.0), np.zeros(PARTS)
    sizes[0], first = parts.least_m_s2, 0.0
    for number in range(SEARCHES):
        left, derivatives = plain.linearised(values)
        columns = np.zeros((n, len(named)))
        columns[:, places] = derivatives
        largest = np.max(np.abs(columns), axis=0)
        limits = np.where(largest > 0, FURTHEST * reach / np.where(largest > 0, largest, 1.0), FURTHEST)
        near = [] if number == 0 else [Prior.of("near", motion.MASS.name, NEAR_MASS, first)]
        step, root = expected(unknowns, alone, [*released, *near], values, limits)
        moved = columns @ root
        before, given = sizes, (left - columns @ step, at_rest + moved @ moved.T, added, level, parts.least_m_s2)
        sizes = likeliest_sizes(*given, sizes, white_only=number == 0)
        if number > 1 and np.allclose(sizes, before, rtol=SETTLED, atol=0.0):
            break
        if number < SEARCHES - 1:
            found = replace(noise, parts=parts, sizes_m_s2=sizes)
            joined = joint_rows(block, found, camera)
            estimate = solve(unknowns, [joined, *further], priors, values, most_steps=1)
            values = {name: estimate.value(name) for name in named}
            first = values[motion.MASS.name] if number == 0 else first
    return replace(noise, parts=parts, sizes_m_s2=sizes)


def joint_rows(block: EquationOfMotion, noise: RowNoise, camera: CameraRows | None) -> JointBlock:
    """Put the rows of a camera's frames after those of the motion, all of them with their noise."""
    weighed = replace(block, sigma_m_s2=noise.sigma_m_s2[block.rows])
    correlation = correlation_of(block.regression, block.rows, noise, camera)
    return JointBlock((weighed,) if camera is None else (weighed, camera), correlation)


def _widened(prior: Prior) -> Prior:
    """Release what a prior says of scales and friction."""
    if prior.exact or RELEASED.isdisjoint(prior.unknowns):
        return prior
    return replace(prior, covariance=WIDER**2 * prior.covariance)
