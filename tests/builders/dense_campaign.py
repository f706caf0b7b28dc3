"""A campaign with forces that no gauge reads as one normal distribution of its rows, without any code of a campaign.

The rows of all shots are y = D x + noise with the unknowns x drawn from what is known beforehand, so that y has the
covariance ``D P D' + 1``: its density, and the mean and the variance of the mass given y, are three lines.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from recoil_identification.campaign.campaign_shot import CampaignShot
from tests.builders.campaign_summaries import MASS_KG, NAMES, OWN_SHARE, SHAPES, UNREAD_NAMES, UNREAD_U, U

WIDE = 0.1
"""Standard deviation of the logarithm of a mass of which hardly anything is known; a wider one would be rounding."""


def densities(
    shots: Sequence[CampaignShot],
    force: float,
    friction_rel: float = 0.0,
    gain_rel: float = 0.0,
    changes: Sequence[tuple[str, float]] = (),
) -> tuple[float, list[float], float, float]:
    """Return logarithmic densities of all rows, and what they say of the mass.

    Parameters
    ----------
    force
        Factor on the force that no gauge reads.
    changes
        Name and standard deviation of changes of the mass within all shots.

    Returns
    -------
    ln_density : float
        Without any change.
    ln_changed : list of float
        With each of the changes alone.
    ln_mass, u_ln_mass : float
        Logarithm of the mass without what is added and its standard uncertainty, without any change.
    """
    ln_mass = np.log(MASS_KG)
    own = (*[gain_rel] * 3, friction_rel, gain_rel, OWN_SHARE)
    known = np.square([WIDE, 1.0, *U, *UNREAD_U[:1], *[force * u for u in UNREAD_U[1:]], *own * len(shots)])
    names = (*NAMES, *UNREAD_NAMES)
    places = [names.index(name) for name, _ in changes]
    for _ in range(6):
        design, columns, left = [], [], []
        for i, shot in enumerate(shots):
            assert shot.summary is not None
            bare, u_added = np.exp(ln_mass), shot.u_added_mass_kg
            moves = np.zeros((len(names), known.size))
            moves[0, 0], moves[0, 1] = bare / (bare + shot.added_mass_kg), u_added / (bare + shot.added_mass_kg)
            moves[1:6, 2:7] = np.eye(5)
            moves[6 : 7 + SHAPES, 7 : 8 + SHAPES] = np.eye(1 + SHAPES)
            first = 8 + SHAPES + len(own) * i
            moves[1:7, first : first + len(own)] = np.eye(len(own))
            expected = np.zeros(len(names))
            expected[0] = np.log(bare + shot.added_mass_kg)
            summary = shot.summary
            design.append(summary.triangle @ moves)
            columns.append(summary.triangle[:, places])
            left.append(summary.seen - summary.triangle @ (expected - summary.reference))
        rows, rest = np.vstack(design), np.concatenate(left)
        # the mass is expected where the model is linear
        about = (ln_mass - np.log(MASS_KG)) * rows[:, 0]
        covariance = (rows * known) @ rows.T + np.eye(rest.size)
        gain = known[0] * rows[:, 0] @ np.linalg.inv(covariance)
        ln_mass = float(np.log(MASS_KG) + gain @ (rest + about))
    u_ln_mass = float(np.sqrt(known[0] - gain @ rows[:, 0] * known[0]))

    def density(matrix: NDArray[np.float64]) -> float:
        white = np.linalg.solve(np.linalg.cholesky(matrix), rest + about)
        return -0.5 * float(white @ white + np.linalg.slogdet(matrix)[1])

    changed = [
        density(covariance + sd**2 * np.outer(column, column))
        for column, (_, sd) in zip(np.vstack(columns).T, changes, strict=True)
    ]
    return density(covariance), changed, ln_mass, u_ln_mass
