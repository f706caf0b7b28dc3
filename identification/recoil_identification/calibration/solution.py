"""The solution of a shot: the mass by rows and priors, and what each source contributes to its uncertainty."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_identification.calibration.calibration import Calibration, joined_rows, sources_of
from recoil_identification.calibration.misfit import largest_misfit, misfit_of_weights
from recoil_identification.estimate.budget import BudgetRow, with_shapes_together
from recoil_identification.estimate.mass import FRICTION, RANDOM, MassEstimate
from recoil_identification.inference.block import JointBlock, LinearBlock
from recoil_identification.inference.correlation import Correlation
from recoil_identification.inference.estimate import Estimate
from recoil_identification.inference.solve import solve
from recoil_identification.inference.unknown import Prior, Unknown
from recoil_identification.rows import equation_of_motion as motion
from recoil_identification.rows.camera_rows import LATE, OTHER, OTHER_ZERO, RATE, START, CameraRows
from recoil_identification.rows.causes import DISTORTIONS
from recoil_identification.rows.equation_of_motion import EquationOfMotion
from recoil_identification.rows.late_readings import GAS
from recoil_identification.rows.row_noise import LEAST_NOISE_M_S2, RowNoise
from recoil_identification.rows.sensor_priors import RELEASE, ZERO
from recoil_identification.rows.travel_rows import ForcedTravel
from recoil_processing.noise import welch_satterthwaite

BESIDE = {
    one.name: one
    for one in (
        *(motion.CAMERA, GAS, OTHER, OTHER_ZERO, START, LATE, RATE),
        *(Unknown(name, "m", "rig") for name in DISTORTIONS),
    )
}
"""Unknowns that are in no row of the motion alone; those of the rig's scales and gauges are further ones."""
UNITS = {FRICTION: "N", ZERO: "m/s^2", RELEASE: "m/s"}
"""Units of the sources that are no scales, and about unknowns of the motion."""


def calibration_of(
    method: str,
    block: EquationOfMotion,
    noise: RowNoise,
    common: Sequence[Prior],
    own: Sequence[Prior],
    camera: CameraRows | ForcedTravel | None,
    correlation: Correlation | None,
    further: tuple[LinearBlock, ...],
    unknowns: Sequence[Unknown] = (),
) -> Calibration:
    """Estimate the mass by rows and priors, and state what each source contributes.

    Parameters
    ----------
    method
        Name of the method.
    block, noise, common, own, camera, correlation, further
        Attributes of `Calibration`. Where frames stand in the place of the motion's rows the residual of its estimate
        is left open, NaN.
    unknowns
        Further unknowns, by which the rig's scales and the further rows may be off.
    """
    joined = joined_rows(block, camera, correlation)
    priors = [*common, *own]
    known = BESIDE | {one.name: one for one in unknowns}
    inferred = solve(all_unknowns(block, joined, priors, unknowns), [joined, *further], priors)
    mass = block.m0_kg * math.exp(inferred.value(motion.MASS.name))
    random_kg = mass * inferred.u_random(motion.MASS.name)
    beside = [] if block.regression.recoils_once else _misfits(block, joined, further, priors, unknowns, inferred)
    misfit = math.hypot(*(u for u, _ in beside))
    parts = [(random_kg, noise.degrees_of_freedom), *((mass * u, freedom) for u, freedom in beside)]
    freedom_of_random = welch_satterthwaite(parts) if misfit else noise.degrees_of_freedom
    budget = [BudgetRow(RANDOM, math.hypot(random_kg, mass * misfit), "A", degrees_of_freedom=freedom_of_random)]
    stated = {source: ("B", "1") for prior in common for source in prior.sources}
    stated |= {source: ("B", unit) for source, unit in UNITS.items()}
    about = [(prior, known[name]) for prior in own for name in prior.unknowns[:1] if name in known]
    stated |= {source: ("B", unknown.unit) for prior, unknown in about for source in prior.sources}
    stated |= {cause.source: (cause.kind, cause.unit) for cause in block.causes}
    scopes = {unknown.name: unknown.scope for unknown in inferred.unknowns}
    shared = {source: scopes[prior.unknowns[0]] for prior in priors for source in prior.sources}
    freedom = {source: prior.degrees_of_freedom for prior in priors for source in prior.sources}
    for source, u in zip(sources_of(inferred), inferred.u_sources.tolist(), strict=True):
        change = mass * inferred.contribution(source, motion.MASS.name)
        # a sensor that reads high has a value that lies too low
        kind, unit = stated.get(source, ("B", "1"))
        if math.isfinite(freedom[source]):  # so many samples of this shot tell it
            kind = "A"
        budget.append(BudgetRow(source, abs(change), kind, -change / u, unit, freedom[source], scope=shared[source]))
    rows, deviation = inferred.rows, math.nan
    if not isinstance(camera, ForcedTravel):
        values = {unknown.name: inferred.value(unknown.name) for unknown in inferred.unknowns}
        residual = block.sigma_m_s2 * block.linearised(values)[0]
        # of the unknowns the mass and the shifts are not restricted, and zero and release hardly
        shifts = block.regression.shifts
        rows, free = residual.size, 3 + (0 if shifts is None else shifts.shape[1])
        deviation = math.sqrt(float(residual @ residual) / max(rows - free, 1))
    return Calibration(
        estimate=MassEstimate(method, mass, with_shapes_together(budget), rows, deviation),
        noise=noise,
        block=block,
        inferred=inferred,
        common=tuple(common),
        own=tuple(own),
        correlation=correlation,
        further=further,
        camera=camera,
        misfit=misfit,
    )


def _misfits(
    block: EquationOfMotion,
    joined: JointBlock,
    further: Sequence[LinearBlock],
    priors: Sequence[Prior],
    unknowns: Sequence[Unknown],
    inferred: Estimate,
) -> list[tuple[float, float]]:
    """Return what stretches and even weights add to the logarithm of a line's mass, each with degrees of freedom."""
    regression, n = block.regression, block.rows.size
    left, influence = _influence(joined, inferred)
    found = [largest_misfit(regression.times_s[block.rows], influence[:n], left[:n], regression.stroke_s)]
    if joined.correlation is None or len(joined.parts) > 1:
        return found
    left_m_s2 = block.sigma_m_s2 * (joined.correlation.factor @ left)
    sigma_m_s2 = max(float(np.sqrt(np.mean(left_m_s2**2))), LEAST_NOISE_M_S2)
    evenly = JointBlock((replace(block, sigma_m_s2=np.full(n, sigma_m_s2)),))
    other = solve(all_unknowns(block, evenly, priors, unknowns), [evenly, *further], priors)
    by_noise = joined.correlation.factor.T @ (_influence(evenly, other)[1] * block.sigma_m_s2 / sigma_m_s2)
    variance = float(by_noise @ by_noise) - inferred.u_random(motion.MASS.name) ** 2
    apart = other.value(motion.MASS.name) - inferred.value(motion.MASS.name)
    return [*found, misfit_of_weights(apart, variance)]


def _influence(rows: JointBlock, inferred: Estimate) -> tuple[Array, Array]:
    """Return what a fit leaves of rows of independent errors, and how each moves the logarithm of the mass."""
    names = [one.name for one in inferred.unknowns]
    left, derivatives = rows.linearised({name: inferred.value(name) for name in names})
    of_mass = inferred.covariance[names.index(motion.MASS.name), [names.index(name) for name in rows.unknowns]]
    return left, np.asarray(derivatives @ of_mass)


def all_unknowns(
    block: EquationOfMotion, joined: JointBlock, priors: Sequence[Prior], unknowns: Sequence[Unknown]
) -> list[Unknown]:
    """Return the unknowns of the motion, and after them those of the camera, of areas and of standards.

    Parameters
    ----------
    joined
        All rows, those of the block first.
    unknowns
        Further unknowns, by which the rig's scales and the further rows may be off.
    """
    known = BESIDE | {one.name: one for one in unknowns}
    names = dict.fromkeys((*joined.unknowns, *(name for prior in priors for name in prior.unknowns)))
    return [*block.all_unknowns, *(known[name] for name in names if name not in block.unknowns)]


def with_shifts(calibration: Calibration, shifts: Array, camera: CameraRows | None) -> Calibration:
    """Let the accelerometer's zero shift in given shapes, and estimate the mass anew.

    Parameters
    ----------
    shifts : ndarray, shape (n, n_shifts)
        Shapes on the regression's grid, behind its filter.
    camera
        Rows of its frames with the same shapes.
    """
    block = replace(calibration.block, regression=replace(calibration.block.regression, shifts=shifts))
    return calibration_of(
        calibration.estimate.method,
        block,
        calibration.noise,
        calibration.common,
        calibration.own,
        camera,
        calibration.correlation,
        calibration.further,
        calibration.inferred.unknowns,
    )
