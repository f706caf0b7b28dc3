"""The estimate of the unknowns by blocks and priors together."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.numerics.arrays import Array
from recoil_acquisition.numerics.read_only import ReadOnlyArrays
from recoil_identification.inference.unknown import Prior, Reliability, Unknown, exactly_known

LEAST_PART = 0.03
"""Share of a standard uncertainty below which it does not matter how well a part is known: 1e-3 of the variance."""
LEAST_REDUNDANCY = 1e-4
"""Share of a prior's variance below which everything else says nothing about a prior, and it has no normalised
residual: what could be seen there would be off by more than three hundred standard uncertainties."""

ROWS = "random errors of this shot"
"""Name of what the errors of the rows contribute."""


def residual_against_none(normalised_residual: float, pull: float) -> float:
    """Return the distance from zero of what all else says of a source, over its own standard deviation.

    The normalised residual is that over the standard deviation of the difference to the prior. With v the share of the
    prior's variance that is left, it is ``sqrt(v)`` times this one, and ``1 - v`` the square of pull over it.
    """
    redundancy = (pull / normalised_residual) ** 2 if normalised_residual else 0.0
    return normalised_residual / math.sqrt(max(1.0 - redundancy, LEAST_REDUNDANCY))


@dataclass(frozen=True, eq=False)
class Estimate(ReadOnlyArrays):
    """Values of the unknowns, and where their uncertainties come from.

    Attributes
    ----------
    values : ndarray, shape (n_unknowns,)
    covariance : ndarray, shape (n_unknowns, n_unknowns)
    determined : ndarray of bool, shape (n_unknowns,)
        False for an unknown that neither rows nor priors determine.
    sources
        Names of the rows of all priors that are not exact.
    contributions : ndarray, shape (n_unknowns, n_sources)
        Contribution of each source to each unknown: by how much the unknown rises if the source's value rises by its
        standard uncertainty, the part apart that it shares with the sources before it in the same prior. The squares
        over the sources, and those of the rows' errors, add up to the variance.
    u_sources : ndarray, shape (n_sources,)
        The standard uncertainty that a contribution stands for.
    pulls : ndarray, shape (n_sources,)
        Distance of the unknowns from each source, over its standard uncertainty.
    normalised_residuals : ndarray, shape (n_sources,)
        The same over its own standard deviation, everything else being right: standard normal (W. Baarda, A testing
        procedure for use in geodetic networks, 1968). 0 where nothing else says anything about the source.
    misfit
        Sum of the squares that was minimised.
    rows
        Number of rows of all blocks.
    triangle : ndarray, shape (n_unknowns, n_unknowns + 1)
        Square-root information of the blocks without any prior, about `values`: ``|R (x - values) - y|^2``.
    steps
        Number of steps of the iteration.
    converged
        Whether the last step moved nothing any more.
    """

    unknowns: tuple[Unknown, ...]
    values: Array
    covariance: Array
    determined: NDArray[np.bool_]
    sources: tuple[str, ...]
    contributions: Array
    u_sources: Array
    pulls: Array
    normalised_residuals: Array
    misfit: float
    rows: int
    triangle: Array
    steps: int
    converged: bool

    def value(self, name: str) -> float:
        """Return the value of an unknown."""
        return float(self.values[self._place(name)])

    def u(self, name: str) -> float:
        """Return the standard uncertainty of an unknown; infinite if nothing determines it."""
        at = self._place(name)
        return math.sqrt(float(self.covariance[at, at])) if self.determined[at] else math.inf

    def u_random(self, name: str) -> float:
        """Return the part of it that comes from the errors of the rows."""
        at = self._place(name)
        return float(np.linalg.norm(self.triangle[:, :-1] @ self.covariance[:, at]))

    def contribution(self, source: str, name: str) -> float:
        """Return by how much an unknown rises if a source's value rises by its standard uncertainty."""
        return float(self.contributions[self._place(name), self._source(source)])

    def parts_of(self, slopes: Mapping[str, float]) -> dict[str, float]:
        """Return what the sources contribute to a quantity, by name, that of the rows' errors under `ROWS`.

        Their squares add up to the quantity's variance. Infinite where the quantity hangs on an unknown that nothing
        determines.

        Parameters
        ----------
        slopes
            Derivatives of the quantity by the unknowns, by their names; 0 by the others.
        """
        slope = np.zeros(len(self.unknowns))
        for name, one in slopes.items():
            slope[self._place(name)] = one
        if np.any(slope[~self.determined]):
            return {ROWS: math.inf}
        of_rows = float(np.linalg.norm(self.triangle[:, :-1] @ (self.covariance @ slope)))
        parts = np.abs(slope @ self.contributions).tolist()
        return {ROWS: of_rows, **dict(zip(self.sources, parts, strict=True))}

    def normalised_residual(self, source: str) -> float:
        """Return the normalised residual of a source."""
        return float(self.normalised_residuals[self._source(source)])

    def about(self, names: Sequence[str], priors: Sequence[Prior]) -> tuple[Array, Array]:
        """Return all that the blocks and some priors say of some unknowns, whatever the others are.

        Parameters
        ----------
        names
            Names of the unknowns that are kept.
        priors
            Priors of any unknowns; those of `names` keep what they say.

        Returns
        -------
        triangle : ndarray, shape (n_names, n_names)
        seen : ndarray, shape (n_names,)
            Square-root information about the values of the estimate: ``|R (x - values) - y|^2``.
        """
        parts = [self.triangle]
        for prior in (one for one in priors if not one.exact):
            rows = np.zeros((len(prior.sources), len(self.unknowns) + 1))
            rows[:, [self._place(name) for name in prior.unknowns]] = prior.rows
            rows[:, -1] = prior.values - rows[:, :-1] @ self.values
            parts.append(np.linalg.solve(np.linalg.cholesky(prior.covariance), rows))
        kept = [self._place(name) for name in names]
        fixed = [self._place(name) for name in exactly_known(priors)]
        stacked = np.vstack([*parts, np.zeros((len(self.unknowns) + 1, len(self.unknowns) + 1))])
        # what is in no row takes nothing away
        others = [at for at in range(len(self.unknowns)) if at not in (*kept, *fixed) and bool(np.any(stacked[:, at]))]
        reduced = np.asarray(np.linalg.qr(stacked[:, [*others, *kept, -1]], mode="r"))
        below = reduced[len(others) : len(others) + len(kept), len(others) :]
        return below[:, :-1], below[:, -1]

    def draws(
        self,
        name: str,
        rng: np.random.Generator,
        count: int,
        degrees_of_freedom: float = math.inf,
        known: Mapping[str, Reliability] = MappingProxyType({}),
    ) -> Array:
        """Draw values of an unknown from its distribution, shape (count,).

        Parameters
        ----------
        degrees_of_freedom
            Degrees of freedom with which the size of the rows' errors is known: their part is then of Student's t.
        known
            Knowledge of the uncertainties of sources: of Student's t where a certificate states degrees of freedom
            (JCGM 101:2008, 6.4.9.7); of what is guessed the uncertainty is drawn too, as it is known.
        """
        random = self.u_random(name) * rng.standard_normal(count)
        if math.isfinite(degrees_of_freedom):
            random *= np.sqrt(degrees_of_freedom / rng.chisquare(degrees_of_freedom, count))
        parts = self.contributions[self._place(name)]
        weighty = [
            (part, known[source])
            for part, source in zip(parts.tolist(), self.sources, strict=True)
            if source in known and abs(part) > LEAST_PART * float(np.linalg.norm(parts))
        ]
        found = self.value(name) + random
        for part, of in weighty:
            size = part * rng.standard_normal(count)
            if of.u_rel:
                size *= 1.0 + of.u_rel * rng.standard_normal(count)
            else:
                size *= np.sqrt(of.degrees_of_freedom / rng.chisquare(of.degrees_of_freedom, count))
            found = found + size
        # of sources that are normal and enter linearly the sum is drawn at once: it is normal, too
        normal = math.sqrt(max(float(parts @ parts) - math.fsum(part**2 for part, _ in weighty), 0.0))
        return np.asarray(found + normal * rng.standard_normal(count))

    def __repr__(self) -> str:
        return f"Estimate({len(self.unknowns)} unknowns, {len(self.sources)} sources, {self.rows} rows)"

    def __str__(self) -> str:
        rows = [(one.name, self.value(one.name), self.u(one.name), one.unit) for one in self.unknowns]
        lines = [f"{name:<32}{value:>12.5g}{u:>12.2g}  {unit}" for name, value, u, unit in rows]
        return "\n".join([f"{'unknown':<32}{'value':>12}{'u':>12}  unit", *lines])

    def _place(self, name: str) -> int:
        return [unknown.name for unknown in self.unknowns].index(name)

    def _source(self, source: str) -> int:
        return self.sources.index(source)
