"""How well uncertainties are known, and what that does to the coverage factor and to the draws."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from recoil_identification.calibration.calibration import sources_of
from recoil_identification.estimate.budget import BudgetRow
from recoil_identification.estimate.mass import MassEstimate
from recoil_identification.estimate.monte_carlo import IntervalBy, MonteCarlo, propagate
from recoil_identification.estimate.reliability import GUESS, of_sources, reliabilities, with_reliabilities
from recoil_identification.inference.solve import solve
from recoil_identification.inference.unknown import Prior, Reliability, Unknown
from recoil_processing.shot.error_source import ErrorSource, SourceKind
from recoil_processing.shot.sensor_scales import dynamic_scale
from recoil_rigs.rig import Rig, load_rig, parse_rig
from tests.builders.virtual_shots import identified, virtual_shot

SHARE = ErrorSource(SourceKind.UNREAD_SHARE)
SHAPE = ErrorSource(SourceKind.UNREAD_SHAPE, "", "3")
BREECH = ErrorSource(SourceKind.FORCE_SCALE, "breech_pressure")


def rig_with(*changes: tuple[str, str]) -> Rig:
    rig = load_rig("field-2013")
    text = rig.text
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    return parse_rig(text, Path("rig.toml"), rig.databases)


def test_what_the_rig_does_not_state_is_a_guess_and_what_it_states_is_not() -> None:
    known = of_sources((SHARE, SHAPE, BREECH), rig_with())
    assert known == {SHARE: GUESS, SHAPE: GUESS}
    assert GUESS.degrees_of_freedom == 8.0
    stated = rig_with(("[mechanism]", "[mechanism]\nunread_share = 0.0\nu_unread_share = 0.01\nunread_force = 0.001"))
    assert of_sources((SHARE, SHAPE, BREECH), stated) == {}


def test_degrees_of_freedom_of_a_certificate_are_those_of_its_scale() -> None:
    rig = load_rig("field-2013")
    (gauge,) = rig.with_role("breech_pressure")
    sensor = gauge.sensor.model_copy(update={"nu": 12.0})
    rig = replace(rig, channels=tuple(
        one.model_copy(update={"sensor": sensor}) if one is gauge else one for one in rig.channels
    ))  # fmt: skip
    assert reliabilities(rig)[BREECH] == Reliability(12.0)
    rows = (
        BudgetRow(BREECH, 2.0, "B"),
        BudgetRow(SHARE, 1.0, "B"),
        BudgetRow(ErrorSource(SourceKind.RANDOM), 1.0, "A", degrees_of_freedom=7.0),
    )
    estimate = with_reliabilities(MassEstimate("calibrated", 780.0, rows, 9, 1.0), rig, corrected=True)
    assert [one.degrees_of_freedom for one in estimate.budget] == [12.0, 8.0, 7.0]
    # of the other methods a gauge's row is of its whole scale: certificate, pulse and the bore's friction
    whole = with_reliabilities(MassEstimate("reverse", 780.0, rows, 9, 1.0), rig, corrected=False)
    u_rel, dynamic, bore = 0.005, 0.005, rig.mechanism.u_bore_friction_rel
    nu = (u_rel**2 + dynamic**2 + bore**2) ** 2 / (u_rel**4 / 12.0 + dynamic**4 / 8.0 + bore**4 / 8.0)
    assert whole.budget[0].degrees_of_freedom == pytest.approx(nu, rel=1e-9)


@pytest.mark.parametrize(
    ("known", "end"),
    [
        (None, stats.norm.ppf(0.975)),
        (Reliability(4.0), stats.t.ppf(0.975, 4.0)),
        # a normal whose standard deviation is itself normal, known to a quarter
        (Reliability(8.0, 0.25), 2.07),
    ],
)
def test_draws_of_a_source_are_as_its_uncertainty_is_known(known: Reliability | None, end: float) -> None:
    found = solve([Unknown("x")], [], [Prior.of("s", "x", 1.0)])
    drawn = found.draws("x", np.random.default_rng(1), 400_000, known={} if known is None else {"s": known})
    assert np.quantile(drawn, 0.975) == pytest.approx(end, abs=0.02)


@pytest.mark.whole_way
def test_the_reported_interval_is_that_of_the_draws_where_they_do_not_validate_the_other() -> None:
    found = identified()
    estimate, drawn = found.chosen.estimate, found.distribution
    assert isinstance(drawn, MonteCarlo)
    freedom = {
        name: {row.source: row.degrees_of_freedom for row in one.estimate.budget} for name, one in found.results.items()
    }
    assert freedom["calibrated"][dynamic_scale("breech_pressure")] == 8.0
    # half of the variance of its whole scale is a guess that has 8: the other methods have no row of the parts
    assert 16.0 <= freedom["reverse"][BREECH] <= 40.0
    known = of_sources(sources_of(found.route.calibration.inferred), virtual_shot().rig)
    assert found.chain is not None
    plain, drawn_too = (propagate(found.chain.draws(found.route.calibration.draws(one))) for one in ({}, known))
    assert drawn == drawn_too != plain  # of guesses the u is drawn, too
    low, high = estimate.interval_kg
    assert math.log(estimate.mass_kg / low) == pytest.approx(math.log(high / estimate.mass_kg), rel=1e-9)
    agreeing = replace(found, monte_carlo=replace(drawn, interval=(low, high)))
    assert (agreeing.interval_by, agreeing.interval_kg) == (IntervalBy.LOGARITHM, (low, high))
    other = (low - 1.0, high + 1.0)
    differing = replace(found, monte_carlo=replace(drawn, interval=other))
    assert (differing.interval_by, differing.interval_kg) == (IntervalBy.MONTE_CARLO, other)
    assert differing.expanded_kg == pytest.approx(0.5 * (high - low) + 1.0)
    assert replace(found, monte_carlo=None).interval_by is IntervalBy.LOGARITHM
