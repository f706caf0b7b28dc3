"""Contributions of `recoil_identification.rows.causes` to estimates that have no unknown for them.

Each is moved by its standard uncertainty either way and the mass estimated again, by acceleration on force: what moves
all rows alike moves every such estimate alike. The inference has unknowns for them.
"""

from __future__ import annotations

from collections.abc import Sequence

from recoil_acquisition.remark import Note, NoteCode
from recoil_identification.calibration.calibration import Calibration
from recoil_identification.estimate.budget import CHOICE_FACTORS, BudgetRow, with_shapes_together
from recoil_identification.rows.causes import Cause
from recoil_processing.filters import LowPassFilter
from recoil_processing.shot.regression import LEAST_ROWS, Regression, spaced_rows

LARGEST_CUTOFF_EFFECT = 9e-4
"""Largest change of the mass by other cut-offs, relative: as much is the noise of other samples, which the random part
has already."""


def contributions(regression: Regression, causes: Sequence[Cause]) -> tuple[BudgetRow, ...]:
    """Evaluate what each cause contributes to the mass by acceleration on force.

    Parameters
    ----------
    regression
        Filtered.
    causes
        Causes on the regression's grid, behind its filter.
    """
    rows = spaced_rows(regression)
    acceleration, force = regression.acceleration_m_s2[rows], regression.force_n[rows]

    def mass_kg(cause: Cause, size: float) -> float:
        f = force + size * cause.forces_n[rows].sum(axis=1)
        if cause.beside_n is not None:
            f = f + size * cause.beside_n[rows]
        return float(f @ f / ((acceleration - size * cause.acceleration_m_s2[rows]) @ f))

    found = []
    for cause in causes:
        # what is off by a size is left in the estimate
        change = (mass_kg(cause, -cause.u) - mass_kg(cause, cause.u)) / 2
        found.append(
            BudgetRow(
                cause.source, abs(change), cause.kind, change / cause.u, cause.unit, cause.degrees_of_freedom,
                scope=cause.scope,
            )
        )  # fmt: skip
    return with_shapes_together(found)


def note_on_cutoff(recorded: Regression, filtered: Regression, calibration: Calibration) -> Note | None:
    """Say by how much other cut-offs would move the mass, where that is more than other noise would or is not known."""
    if filtered.low_pass is None:
        return None
    mass = corrected_mass(filtered, calibration)
    for other in other_cutoffs(filtered.low_pass, recorded.rate_hz):
        moved = recorded.filtered(other)
        rows = spaced_rows(moved).size
        if rows < LEAST_ROWS:
            return Note(
                NoteCode.FILTER,
                None,
                f"by how much a cut-off of {other.cutoff_hz:.0f} Hz would move the mass cannot be told: it leaves "
                f"{rows} rows that no lost sample reaches, and {LEAST_ROWS} are needed",
            )
        change = corrected_mass(moved, calibration) / mass - 1.0
        if abs(change) > LARGEST_CUTOFF_EFFECT:
            return Note(
                NoteCode.FILTER,
                None,
                f"a cut-off of {other.cutoff_hz:.0f} Hz would move the mass by {100 * change:+.2g} %, more than other "
                f"noise does ({100 * LARGEST_CUTOFF_EFFECT:.2g} %): look for what is left of the stress waves",
            )
    return None


def corrected_mass(regression: Regression, calibration: Calibration) -> float:
    """Mass by acceleration on force, with the sensors' errors as identified taken off, kg."""
    acceleration, force = calibration.correct(regression)
    rows = spaced_rows(regression)
    a, f = acceleration[rows], force[rows]
    return float(f @ f / (a @ f))


def other_cutoffs(low_pass: LowPassFilter, rate_hz: float) -> list[LowPassFilter]:
    """Return the filters that might have been chosen instead, as far as the grid's rate allows them."""
    others = [low_pass.at(factor * low_pass.cutoff_hz) for factor in CHOICE_FACTORS]
    return [other for other in others if (other.describe().minus_6_db_hz or other.cutoff_hz) < 0.5 * rate_hz]
