"""Shapes that no rig states and many shots are asked for: bent lines, gradients, what hangs or droops.

One shot asks for each of them by itself (`recoil_identification.calibration.suspicion`); shots of several charges, and
with a mass added, tell it better, for a shape of the rig is the same in all of them. Each is asked for without a new
fit, under every scatter and every size of the force that no gauge reads, as a mass that changes is
(`recoil_identification.campaign.constancy`); and the mass is the mean over all of them and none.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_identification.calibration.suspicion import AS_WELL, described
from recoil_identification.campaign.joint_fit import JointFit
from recoil_identification.campaign.joint_rows import Column
from recoil_identification.inference.averaging import Hypotheses
from recoil_identification.inference.change_odds import LEAST_FACTOR
from recoil_identification.shot.shot_summary import Suspected
from recoil_processing.shot.error_source import ErrorSource


@dataclass(frozen=True, eq=False)
class SharedSuspicion(ReadOnlyArrays):
    """The shapes that no rig states, as all shots see them.

    Attributes
    ----------
    shapes
        All of them.
    hypotheses
        Hypotheses of each trial of the fit.
    by : ndarray, shape (n_trials, n_masses, n_shapes)
        Amount by which the logarithm of each mechanism's mass moves for a size of one of each.
    weights, ln_weights : ndarray, shape (n_trials,)
        Probability of each trial without any of them, and its logarithm.
    """

    shapes: tuple[Suspected, ...]
    hypotheses: tuple[Hypotheses, ...]
    by: Array
    weights: Array
    ln_weights: Array

    @cached_property
    def ln_bayes_factors(self) -> Array:
        """Logarithm of the odds of each against none, averaged over the trials; shape (n_shapes,)."""
        factors = np.array([one.ln_bayes_factors for one in self.hypotheses])
        return np.asarray(np.logaddexp.reduce(factors + self.ln_weights[:, np.newaxis], axis=0))

    @cached_property
    def ln_bayes_factor(self) -> float:
        """Logarithm of the odds of any of them against none."""
        factors = np.array([one.ln_bayes_factor for one in self.hypotheses])
        return float(np.logaddexp.reduce(factors + self.ln_weights))

    @property
    def suspected(self) -> bool:
        """Whether it is far likelier that one of the shapes is there than that none is."""
        return self.ln_bayes_factor > LEAST_FACTOR

    @cached_property
    def likeliest(self) -> int:
        """Place of the shape that explains the shots best."""
        return int(np.argmax(self.ln_bayes_factors))

    @property
    def source(self) -> ErrorSource:
        """Source that explains the shots best."""
        return self.shapes[self.likeliest].source

    def column(self, shots: int) -> Column:
        """Return the likeliest shape as an unknown of so many shots, which it is the same in."""
        name = self.shapes[self.likeliest].name
        return Column(name, name, np.ones(shots))

    def moved(self, mechanism: int) -> tuple[float, float]:
        """Return by how much a mechanism's mass moves on the mean over all, relative, and the variance it gains."""
        whole = np.array([np.logaddexp(0.0, one.ln_bayes_factor) for one in self.hypotheses])
        weights = self.weights * np.exp(whole - whole.max())
        weights = weights / weights.sum()
        means, gained = np.array(
            [one.moved(by) for one, by in zip(self.hypotheses, self.by[:, mechanism], strict=True)]
        ).T
        mean = float(weights @ means)
        return mean, float(weights @ (gained + means**2)) - mean**2

    @cached_property
    def size(self) -> tuple[float, float]:
        """Size of the likeliest shape if it is there, and its standard uncertainty."""
        at = self.likeliest
        sizes = np.array([one.sizes[at] for one in self.hypotheses])
        variances = np.array([one.variances[at] for one in self.hypotheses])
        mean = float(self.weights @ sizes)
        return mean, math.sqrt(float(self.weights @ (variances + (sizes - mean) ** 2)))

    @property
    def spread_rel(self) -> float:
        """Root mean square of the changes of that mass by all shapes, relative, each as likely as the shots say."""
        weights = np.exp(self.ln_bayes_factors - self.ln_bayes_factors.max())
        moves = np.array([by * one.sizes for one, by in zip(self.hypotheses, self.by[:, 0], strict=True)])
        return math.sqrt(float((self.weights @ moves**2) @ weights / weights.sum()))

    @property
    def moves_rel(self) -> float:
        """Change of the first mechanism's mass by the likeliest shape, relative."""
        at = self.likeliest
        sizes = np.array([one.sizes[at] for one in self.hypotheses])
        return float(self.weights @ (self.by[:, 0, at] * sizes))

    def __str__(self) -> str:
        odds = f"ln of the Bayes factor {self.ln_bayes_factor:+.1f}, limit {LEAST_FACTOR:g}"
        if not self.suspected:
            return f"Nothing of the breech chain, a muzzle brake, the tube and their like can be told ({odds})."
        best = self.ln_bayes_factors[self.likeliest]
        nearly = (self.shapes[at].source for at in np.flatnonzero(self.ln_bayes_factors > best - AS_WELL))
        others = [one for one in dict.fromkeys(nearly) if one != self.source]
        as_well = f", {' and '.join(others)} nearly as well" if others else ""
        what, remedy = described(self.source, self.shapes[self.likeliest].variant, *self.size)
        return (
            f"The breech chain, a muzzle brake, the tube or their like ({odds}): {what} explains the shots "
            f"best{as_well}; it moves the mass by {100 * self.moves_rel:+.2g} %; {remedy}."
        )


def shared_suspicion(fit: JointFit) -> SharedSuspicion | None:
    """Ask all shots of a joint fit for what no rig states; None where their summaries have no shapes of it."""
    rows = fit.rows
    shapes = tuple(rows.suspected.values())
    if not shapes:
        return None
    kinds = {source: number for number, source in enumerate(dict.fromkeys(one.kind for one in shapes))}
    of = np.array([kinds[one.kind] for one in shapes], dtype=np.intp)
    sd, one_sided = np.array([one.u for one in shapes]), np.array([one.positive for one in shapes])
    masses = [fit.names.index(name) for name in rows.masses]
    found, by = [], []
    for trial in fit.trials:
        scores = fit.scores(trial, tuple(rows.suspected))
        found.append(Hypotheses.of(scores, of, sd, one_sided))
        by.append(-scores.moves[masses])
    suspicion = SharedSuspicion(shapes, tuple(found), np.array(by), fit.weights, fit.ln_weights)
    return suspicion if np.isfinite(suspicion.ln_bayes_factors).any() else None


def averaged_u_rel(fit: JointFit) -> float:
    """Return the relative standard uncertainty of the first mechanism's mass, the mean over what no rig states."""
    suspicion, u_rel = shared_suspicion(fit), fit.u(fit.rows.masses[0])
    return u_rel if suspicion is None else math.hypot(u_rel, math.sqrt(suspicion.moved(0)[1]))
