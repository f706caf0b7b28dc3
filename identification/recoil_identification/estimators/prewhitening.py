"""The mass by generalized least squares, with autoregressive errors of the acceleration.

Stress waves ring for milliseconds: neighbouring residuals of ``a = F / m`` repeat one another, and an uncertainty
that counts samples is wrong by a factor. The errors are therefore modelled as an autoregressive process, which
both sides pass inversely until what is left is white (D. Cochrane and G. H. Orcutt, J. Am. Stat. Assoc. 44, 1949). The
first samples of a piece are whitened by the predictors of lower order, so that nothing is lost at its begin.

An uncertainty from one short record is uncertain itself, and too small as often as too large. Two others stand
beside the model's, and the largest counts: one that needs no model of what the whitening left (W. K. Newey and K. D.
West, Econometrica 55, 1987; prewhitened as by D. W. K. Andrews and J. C. Monahan, Econometrica 60, 1992), and the one
that the noise of the pre-trigger baseline would allow, of which no motion is free.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.read_only import ReadOnlyArrays
from recoil_processing.gaps import runs_of
from recoil_processing.shot.clocks.autoregressive_noise import (
    MOST_ORDER,
    AutoregressiveNoise,
    few_samples_factor,
    fit_noise,
    newey_west,
)

Array = NDArray[np.float64]

MOST_ITERATIONS = 20
SETTLED = 1e-3
"""Share of its standard uncertainty by which the mass moves no more."""
NEGLIGIBLE = 1e-9
"""Share of the mass that counts as its uncertainty where a record has no noise."""
LEAST_ROWS = 20
"""Fewest rows: with less there is no telling errors that are correlated from a mass that is wrong."""


@dataclass(frozen=True, eq=False)
class PrewhitenedMass(ReadOnlyArrays):
    """Mass by generalized least squares.

    Attributes
    ----------
    mass_kg, u_kg
        Mass and its standard uncertainty by the random errors: the largest of that by the autoregressive model, of that
        by Newey and West's covariance of the whitened rows, and of that by the noise of the pre-trigger baseline alone.
    noise
        Noise of the acceleration's errors.
    sensitivities_kg : ndarray, shape (n_perturbations,)
        Amount by which the mass is too large if the force is by one of the perturbations.
    """

    mass_kg: float
    u_kg: float
    noise: AutoregressiveNoise
    sensitivities_kg: Array
    rows: int


def prewhitened_mass(
    acceleration_m_s2: Array,
    force_n: Array,
    *,
    perturbations_n: Array | None = None,
    used: NDArray[np.bool_] | None = None,
    force_sigma_n: float = 0.0,
    baseline_sigma_m_s2: float = 0.0,
    noise: AutoregressiveNoise | None = None,
    most_order: int = MOST_ORDER,
) -> PrewhitenedMass:
    """Estimate the mass by acceleration on force, with autoregressive errors.

    Parameters
    ----------
    acceleration_m_s2, force_n : ndarray, shape (n,)
        Evenly sampled, unfiltered.
    perturbations_n : ndarray, shape (n, n_perturbations), optional
        Errors that the force may have; finite where samples are used.
    used : ndarray of bool, shape (n,), optional
        Samples to use; a gap ends one piece and begins another.
    force_sigma_n
        White noise of the force per sample; what it adds to the force's own power is taken off.
    baseline_sigma_m_s2
        White noise of the acceleration per sample in the pre-trigger baseline; 0 if it is not known.
    noise
        Found in turn with the mass if left out.

    Raises
    ------
    ValueError
        If shapes do not fit or a used sample is not finite.
    IdentificationError
        If there are too few rows, or force and acceleration have nothing in common.
    """
    used = np.ones(force_n.shape, dtype=bool) if used is None else used
    if force_n.ndim != 1 or not acceleration_m_s2.shape == force_n.shape == used.shape:
        raise ValueError(
            f"acceleration, force and flags must be equally long, not {acceleration_m_s2.shape}, {force_n.shape}, "
            f"{used.shape}"
        )
    if np.count_nonzero(used) < LEAST_ROWS:
        raise IdentificationError(
            f"only {np.count_nonzero(used)} samples to estimate the mass from",
            expected=f"at least {LEAST_ROWS}",
            remedy="check for lost samples in the identification interval",
        )
    table = np.column_stack([force_n, acceleration_m_s2])
    if not np.all(np.isfinite(table[used])):
        raise ValueError("used samples must be finite")
    pieces = [table[begin:end] for begin, end in runs_of(used)]
    given = noise is not None
    current = noise or AutoregressiveNoise(np.zeros((1, 0)), np.ones(1))
    found = _solve(pieces, current, force_sigma_n)
    moved, iterations = math.inf, 0
    while not given and moved > SETTLED and iterations < MOST_ITERATIONS:
        current = fit_noise([_residual(piece, found.solution) for piece in pieces], most_order)
        before, found = found, _solve(pieces, current, force_sigma_n)
        least = max(float(found.u[0]), NEGLIGIBLE * abs(float(found.solution[0])))
        moved = abs(float(found.solution[0] - before.solution[0])) / least
        iterations += 1
    inverse = float(found.solution[0])
    if not inverse > 0:
        raise IdentificationError(
            "force and acceleration do not go together: no positive mass relates them",
            found=f"an acceleration per force of {inverse:.3g} 1/kg",
            remedy="check areas, units and polarities in the rig file",
        )
    mass = 1.0 / inverse
    u_model, u_robust = mass**2 * float(found.u[0]), mass**2 * found.u_robust
    perturbations = np.zeros((force_n.size, 0)) if perturbations_n is None else perturbations_n
    sensitivities = np.zeros(0)
    if perturbations.shape[1]:
        sensitivities = found.influence @ np.vstack(
            [current.whiten(perturbations[begin:end]) for begin, end in runs_of(used)]
        )
    u_baseline = mass**2 * math.hypot(baseline_sigma_m_s2, force_sigma_n / mass) / float(np.linalg.norm(force_n[used]))
    return PrewhitenedMass(
        mass_kg=mass,
        u_kg=max(u_model, u_robust, u_baseline),
        noise=current,
        sensitivities_kg=mass * sensitivities,
        rows=int(np.count_nonzero(used)),
    )


@dataclass(frozen=True, eq=False)
class _Solution:
    solution: Array
    u: Array
    u_robust: float
    influence: Array
    """Of each whitened row of the acceleration on 1/m."""


def _residual(piece: Array, solution: Array) -> Array:
    return np.asarray(piece[:, -1] - piece[:, :-1] @ solution)


def _solve(pieces: list[Array], noise: AutoregressiveNoise, force_sigma_n: float) -> _Solution:
    rows = np.vstack([noise.whiten(piece) for piece in pieces])
    design, target = rows[:, :-1], rows[:, -1]
    scale = np.sqrt((design**2).sum(axis=0))
    scale[scale == 0] = 1.0
    gram = (design / scale).T @ (design / scale)
    # white noise of the force passes the whitening too, and adds to the power of what it left
    gain = (1.0 + float((noise.predictors[-1] ** 2).sum())) / noise.sigma**2
    gram[0, 0] -= min(rows.shape[0] * gain * force_sigma_n**2 / scale[0] ** 2, 0.5)
    inverse = np.linalg.pinv(gram)
    solution = inverse @ ((design / scale).T @ target) / scale
    residual = target - design @ solution
    freedom = max(target.size - solution.size - noise.order, 1)
    variance = float(residual @ residual) / freedom
    scores = (design / scale) * residual[:, None]
    lags = int(4.0 * (target.size / 100.0) ** (2.0 / 9.0))  # Newey and West's own rule
    few = few_samples_factor(target.size, noise.order)
    robust = inverse @ newey_west(scores, lags) @ inverse
    return _Solution(
        solution,
        few * np.sqrt(variance * np.diag(inverse)) / scale,
        few * math.sqrt(max(float(robust[0, 0]), 0.0)) / float(scale[0]),
        inverse[0] @ (design / scale).T / scale[0],
    )
