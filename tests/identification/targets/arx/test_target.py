from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from recoil_acquisition.errors import IdentificationError
from recoil_identification.report.figure.drawing import drawing
from recoil_identification.targets import target_function
from recoil_identification.targets.arx.target import find
from recoil_identification.targets.target import Case
from recoil_identification.targets.target_result import TargetResult
from recoil_rigs.shots.fired_shot import FiredShot
from tests.builders.virtual_shots import virtual_shot, with_channels, without_channels

SHOTS = [("field-2013", 3), ("mixed", 3)]


@cache
def found(name: str = "field-2013", seed: int = 3) -> TargetResult:
    virtual = virtual_shot(name, seed)
    return find(Case(FiredShot(virtual.shot, virtual.rig)))


@pytest.mark.whole_way
@pytest.mark.parametrize(("name", "seed"), SHOTS)
def test_the_intervals_hold_the_true_mass(name, seed):
    one, true = found(name, seed), virtual_shot(name, seed).truth["m3"]
    assert one.valid
    low, high = one.quantity("m_dc").U95
    assert low <= true <= high
    assert 3.0 < one.quantity("m_dc").u < 9.0


@pytest.mark.whole_way
@pytest.mark.parametrize(("name", "seed"), SHOTS)
def test_the_chosen_model_leaves_nothing_behind(name, seed):
    parameters = found(name, seed).parameters
    assert parameters["whiteness_p"] >= 0.01
    assert parameters["independence_p"] >= 0.01
    assert parameters["fit_percent"] > 99.0
    assert parameters["delay"] == 0


@pytest.mark.whole_way
def test_the_gain_is_one_over_the_mass():
    one = found()
    gain, mass = one.quantity("G_dc"), one.quantity("m_dc")
    assert gain.value * mass.value == pytest.approx(1.0, rel=1e-12)
    assert gain.u / gain.value == pytest.approx(mass.u / mass.value)
    assert gain.expected == pytest.approx(1.0 / mass.expected)


@pytest.mark.whole_way
def test_the_simulated_series_is_the_measured_one_but_for_the_noise():
    one = found()
    columns = one.series.columns
    assert next(iter(columns)) == "time_s"
    left = columns["acceleration_m_s2"] - columns["simulated_m_s2"]
    assert np.nanstd(left) < 0.01 * np.nanmax(np.abs(columns["acceleration_m_s2"]))


def test_the_page_has_its_tables_and_figures():
    one = found()
    assert [table.title for table in one.tables] == [
        "Parameters", "Quality", "Orders", "Poles and zeros"
    ]  # fmt: skip
    orders = next(table for table in one.tables if table.title == "Orders")
    assert sum("(chosen)" in row[0] for row in orders.rows) == 1
    assert any(row[0].startswith("0, 0, 0") for row in orders.rows)
    for table in one.tables:
        assert all(len(row) == len(table.columns) for row in table.rows)
    assert len({figure.key for figure in one.figures}) == len(one.figures) == 4
    response = next(figure for figure in one.figures if figure.key == "arx-frequency-response")
    assert (response.x_scale, response.panels[0].y_scale) == ("log", "log")
    for figure in one.figures:
        assert drawing(figure)["data"]


@pytest.mark.whole_way
def test_the_mass_owes_the_shots_mass_nothing_and_says_why_both_differ():
    virtual = virtual_shot()
    breech = virtual.shot.channels["p_breech"]
    high = with_channels(virtual.shot, p_breech=1.01 * np.asarray(breech.samples))
    one, case = found(), Case(FiredShot(high, virtual.rig))
    other = find(case)
    # a gauge that reads 1 % high shows in full but for the share of the other forces
    assert other.quantity("m_dc").value - one.quantity("m_dc").value > 3.0
    note = other.notes[-1]
    assert f"{case.identified.chosen.estimate.mass_kg:.1f} kg" in note
    assert note.startswith("m_dc differs by ")


@pytest.mark.whole_way
def test_lost_samples_leave_rows_out_and_the_mass_in_its_interval():
    virtual = virtual_shot()
    one = found()
    pressure = np.array(virtual.shot.channels["p_brake"].samples, dtype=float)
    base = virtual.shot.channels["p_brake"].time_base
    middle = float(np.mean(one.series.columns["time_s"]))
    pressure[np.abs(base.times_s - middle) < 2e-3] = np.nan
    gapped = find(Case(FiredShot(with_channels(virtual.shot, p_brake=pressure), virtual.rig)))
    columns = gapped.series.columns
    lost = np.isnan(columns["force_n"])
    assert lost[np.abs(columns["time_s"] - middle) < 2e-3].all()
    assert np.isnan(columns["simulated_m_s2"][lost]).all()
    low, high = gapped.quantity("m_dc").U95
    assert low <= virtual.truth["m3"] <= high


@pytest.mark.whole_way
def test_a_shot_in_doubt_says_so():
    virtual = virtual_shot()
    stretched = 1.2 * np.asarray(virtual.shot.channels["p_brake"].samples)
    doubtful = find(Case(FiredShot(with_channels(virtual.shot, p_brake=stretched), virtual.rig)))
    assert not doubtful.valid
    assert any("the mass of this shot is in doubt" in reason for reason in doubtful.reasons)


def test_a_missing_pressure_is_refused():
    virtual = virtual_shot()
    with pytest.raises(IdentificationError, match="brake_pressure"):
        find(Case(FiredShot(without_channels(virtual.shot, "p_brake"), virtual.rig)))


def test_the_target_is_found_by_its_name():
    assert target_function("arx") is find
