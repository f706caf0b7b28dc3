"""The target ``stiffness`` on virtual shots."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from recoil_acquisition.errors import IdentificationError
from recoil_identification.targets.stiffness.restoring_force import RestoringFit
from recoil_identification.targets.stiffness.stiffness_budget import SYMBOLS, SupportEstimates
from recoil_identification.targets.stiffness.support_filter import Band
from recoil_identification.targets.stiffness.support_modes import DERIVED, derived_values
from recoil_identification.targets.stiffness.supports import PARAMETERS
from recoil_identification.targets.stiffness.target import NAMES, find, judge
from recoil_identification.targets.target import Case
from recoil_identification.targets.target_result import TargetResult
from recoil_rigs.shots.fired_shot import FiredShot
from tests.builders.virtual_shots import virtual_shot, with_channels, without_channels

TRUE = dict(zip(SYMBOLS, (2e6, 2.5e4, 3e7, 2e5, 0.25, 3e7, 2e5, 3e7, 2e5), strict=True))
COVERED = 3.0
"""Standard uncertainties within which each of many quantities must lie: one of 400 is beyond by chance."""

_FOUND: dict[tuple[str, float], TargetResult] = {}


def found(name: str, factor: float = 1.0) -> TargetResult:
    """Identify a virtual shot of a rigid tube whose elevating gear is stiffer by a factor, once."""
    if (name, factor) not in _FOUND:
        changes = {} if factor == 1.0 else {"elevating_stiffness_n_m_rad": factor * TRUE["k_elevating"]}
        virtual = virtual_shot(name, tube_modes=0, **changes)
        _FOUND[name, factor] = find(Case(FiredShot(virtual.shot, virtual.rig)))
    return _FOUND[name, factor]


@pytest.mark.whole_way
@pytest.mark.parametrize("name", ["field-2013", "mixed"])
def test_every_parameter_of_the_twin_is_within_its_interval(name):
    finding = found(name)

    assert finding.valid, finding.reasons
    for symbol, true in TRUE.items():
        one = finding.quantity(symbol)
        assert abs(one.value - true) <= COVERED * one.u, symbol
        assert one.u < (0.2 if symbol == "friction_d" else 0.08) * true, symbol


@pytest.mark.whole_way
@pytest.mark.parametrize("name", ["field-2013", "mixed"])
def test_every_derived_quantity_of_the_twin_is_within_its_interval(name):
    mechanism = virtual_shot(name).rig.mechanism
    true = derived_values(mechanism, np.array(list(TRUE.values())))
    for (symbol, _, unit), value in zip(DERIVED, true, strict=True):
        one = found(name).quantity(symbol)
        assert abs(one.value - value) <= COVERED * one.u, symbol
        assert one.u < 0.08 * value
        assert one.unit == unit


@pytest.mark.whole_way
def test_a_tube_that_bends_does_not_pass_for_a_soft_elevating_gear():
    """What swings at the muzzle loads the gear, and is in no rigid body's acceleration."""
    virtual = virtual_shot("mixed")
    assert virtual.truth["tube"]["largest_deflection_m"] > 1e-3

    finding = find(Case(FiredShot(virtual.shot, virtual.rig)))

    assert not finding.valid
    assert any(reason.startswith("elevating gear: spring and damper leave") for reason in finding.reasons)
    assert math.isnan(finding.quantity("k_elevating").value)


@pytest.mark.whole_way
@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_a_softer_and_a_stiffer_elevating_gear_are_told(factor):
    one, damping = (found("field-2013", factor).quantity(symbol) for symbol in ("k_elevating", "c_elevating"))

    assert abs(one.value - factor * TRUE["k_elevating"]) <= COVERED * one.u
    assert one.u < 0.06 * one.value
    assert abs(damping.value - TRUE["c_elevating"]) <= COVERED * damping.u


@pytest.mark.whole_way
def test_the_stiffness_over_time_holds_the_truth():
    columns = found("field-2013").series.columns
    for symbol, unit in (("k_elevating", "N_m_per_rad"), ("k_ground_x", "N_per_m"), ("k_ground_d", "N_per_m")):
        value, u = columns[f"{symbol}_{unit}"], columns[f"u_{symbol}_{unit}"]
        known = np.isfinite(value)
        assert known.sum() >= 8, symbol
        assert np.mean(np.abs(value[known] - TRUE[symbol]) <= 2.5 * u[known]) >= 0.9, symbol


@pytest.mark.whole_way
def test_friction_is_compared_with_the_rig_file():
    assert found("field-2013").quantity("friction_d").expected == 0.25


@pytest.mark.whole_way
def test_figures_and_tables_are_whole():
    finding = found("field-2013")

    assert [figure.key for figure in finding.figures] == [
        "elevating-loop", "ground-loops", "stiffness-over-time", "stiffness-residuals",
    ]  # fmt: skip
    assert [len(figure.panels) for figure in finding.figures] == [1, 3, 8, 4]
    assert any("lifted off" in span.label for panel in finding.figures[3].panels for span in panel.spans)
    assert all(len(row) == len(table.columns) for table in finding.tables for row in table.rows)
    assert any("lifted off" in note for note in finding.notes)


@pytest.mark.whole_way
def test_the_same_shot_gives_the_same_numbers():
    virtual = virtual_shot("field-2013")
    again = find(Case(FiredShot(virtual.shot, virtual.rig)))
    assert [q.value for q in again.quantities] == [q.value for q in found("field-2013").quantities]
    assert [q.u for q in again.quantities] == [q.u for q in found("field-2013").quantities]


@pytest.mark.parametrize("role", ["tipping_rate", "carriage_acceleration_x", "brake_pressure"])
def test_a_missing_channel_is_refused_by_its_role(role):
    virtual = virtual_shot("field-2013")
    shot = without_channels(virtual.shot, virtual.shot.by_role(role).name)

    with pytest.raises(IdentificationError, match=role):
        find(Case(FiredShot(shot, virtual.rig)))


def test_a_rig_that_does_not_declare_an_inertia_is_refused():
    virtual = virtual_shot("field-2013")
    rig = replace(virtual.rig, mechanism=replace(virtual.rig.mechanism, J2=math.nan))

    with pytest.raises(IdentificationError, match="J2"):
        find(Case(FiredShot(virtual.shot, rig)))


@pytest.mark.whole_way
def test_gyros_the_wrong_way_round_do_not_pass_for_a_result():
    virtual = virtual_shot("field-2013")
    names = [virtual.shot.by_role(role).name for role in ("tipping_rate", "carriage_rate")]
    turned = with_channels(virtual.shot, **{name: -virtual.shot.channels[name].samples for name in names})

    assert find(Case(FiredShot(turned, virtual.rig))).reasons


@pytest.mark.whole_way
def test_a_declared_uncertainty_of_an_inertia_is_in_the_budget():
    virtual = virtual_shot("field-2013")
    mechanism = virtual.rig.mechanism
    doubtful = replace(mechanism, u={**mechanism.u, "J3c": 0.1 * mechanism.J3c})

    finding = find(Case(FiredShot(virtual.shot, replace(virtual.rig, mechanism=doubtful))))

    plain, wider = (one.quantity("k_elevating") for one in (found("field-2013"), finding))
    assert wider.value == plain.value
    assert wider.u > 1.5 * plain.u
    assert any(row[0] == "mechanism J3c" for row in finding.tables[1].rows)


def _estimates(values, u, *, rows=40, singular=0.3, share=0.02) -> SupportEstimates:
    fits = {
        name: RestoringFit(
            np.ones(len(symbols)), np.zeros(0), np.eye(len(symbols)), share, np.array([1.4, singular]), {"k": 1.0}, rows
        )
        for name, symbols in PARAMETERS.items()
    }
    bands = dict.fromkeys(PARAMETERS, Band(80.0, 5.0, 1))
    return SupportEstimates(np.asarray(values), np.diag(np.square(u)), {}, fits, bands, dict.fromkeys(PARAMETERS, 0.0))


def test_a_parameter_that_is_too_uncertain_has_no_number_but_a_reason():
    values, u = np.array(list(TRUE.values())), 0.02 * np.array(list(TRUE.values()))
    u[SYMBOLS.index("c_ground_d")] = 1.5e5

    judged, reasons = judge(_estimates(values, u))

    assert np.flatnonzero(np.isnan(judged)).tolist() == [SYMBOLS.index("c_ground_d")]
    assert len(reasons) == 1
    assert NAMES["c_ground_d"][0] in reasons[0]


def test_supports_that_are_not_excited_have_no_numbers_but_reasons():
    values = np.array(list(TRUE.values()))
    judged, reasons = judge(_estimates(values, 0.02 * values, singular=0.01))

    assert np.isnan(judged).all()
    assert len(reasons) == len(PARAMETERS)
    assert all("not excite" in reason for reason in reasons)


def test_a_support_that_is_no_spring_has_reasons():
    values = np.array(list(TRUE.values()))
    judged, reasons = judge(_estimates(values, 0.02 * values, share=0.4))

    assert np.isfinite(judged).all()
    assert len(reasons) == len(PARAMETERS)
    assert all("40 % of the load" in reason for reason in reasons)


def test_a_negative_stiffness_has_a_reason():
    values = np.array(list(TRUE.values()))
    values[0] = -2e6
    _, reasons = judge(_estimates(values, 0.02 * np.abs(values)))

    assert any("negative" in reason for reason in reasons)
