from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from recoil_acquisition.errors import IdentificationError
from recoil_acquisition.shot.quality_check import Check, QualityCheck
from recoil_identification.rows.unread_resistance import SHARE, SLIDE, shape_of_force, unread_causes
from recoil_identification.shot.peaks import peaks_of
from recoil_identification.shot.preparation import prepare
from recoil_identification.targets import target_function
from recoil_identification.targets.forces.force_record import force_record
from recoil_identification.targets.target import Case
from recoil_identification.targets.target_result import TargetResult
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.twin import draw_scene
from tests.builders.virtual_shots import VirtualShot, virtual_shot, without_channels

RIGS = ("field-2013", "mixed")


@cache
def found(name: str) -> tuple[VirtualShot, TargetResult]:
    virtual = virtual_shot(name)
    return virtual, target_function("breech-force")(Case(FiredShot(virtual.shot, virtual.rig)))


@cache
def true_force(name: str) -> tuple[np.ndarray, np.ndarray]:
    virtual = virtual_shot(name)
    motion = draw_scene(virtual.rig, 3, "s1").motion
    return motion.times_s, virtual.rig.mechanism.bore_area * motion.breech_pressure_pa


@pytest.mark.whole_way
@pytest.mark.parametrize("name", RIGS)
def test_the_force_over_time_lies_within_its_band(name):
    _, finding = found(name)
    assert finding.series is not None
    columns = finding.series.columns
    truth = np.interp(columns["time_s"], *true_force(name))
    free = np.isfinite(columns["force_n"])
    for method in ("force_n", "force_inversion_n"):
        inside = np.abs(columns[method] - truth) < 1.96 * columns[f"u_{method}"]
        assert np.mean(inside[free]) > 0.75
        assert np.sqrt(np.mean((columns[method] - truth)[free] ** 2)) < 0.02 * truth.max()


@pytest.mark.whole_way
@pytest.mark.parametrize("name", RIGS)
def test_peak_and_impulse_of_both_methods_are_those_of_the_shot(name):
    _, finding = found(name)
    times, force = true_force(name)
    behind = times >= float(str(finding.parameters["release_s"]))
    behind &= times <= float(str(finding.parameters["end_s"]))
    impulse = np.trapezoid(force[behind], times[behind])
    for method in ("", "_inversion"):
        peak, total = finding.quantity(f"peak_force{method}"), finding.quantity(f"impulse{method}")
        assert abs(peak.value - force.max()) < 3 * peak.u < 0.05 * force.max()
        assert abs(total.value - impulse) < 3 * total.u < 0.01 * impulse
    assert finding.valid, finding.reasons


@pytest.mark.whole_way
@pytest.mark.parametrize("name", RIGS)
def test_what_the_gauge_says_is_what_the_report_says(name):
    virtual, finding = found(name)
    report = peaks_of(Case(FiredShot(virtual.shot, virtual.rig)).identified)
    for symbol, quantity in (("peak_pressure", "breech_pressure_pa"), ("impulse", "impulse_n_s")):
        told = finding.quantity(symbol)
        assert (told.expected, told.u_expected) == (report[quantity].value, report[quantity].u)


@pytest.mark.whole_way
def test_the_gauge_has_no_part_in_the_force():
    virtual, finding = found("field-2013")
    blind = without_channels(virtual.shot, "p_breech")
    without = target_function("breech-force")(Case(FiredShot(blind, virtual.rig)))
    assert without.quantity("peak_force").value == pytest.approx(finding.quantity("peak_force").value, rel=1e-9)
    assert without.quantity("impulse").u == pytest.approx(finding.quantity("impulse").u, rel=1e-9)
    assert without.quantity("peak_force").expected is None
    assert finding.quantity("peak_force").expected is not None
    assert any("no breech gauge" in note for note in without.notes)


@pytest.mark.whole_way
def test_the_stop_and_a_mass_without_uncertainty_are_told():
    virtual, finding = found("field-2013")
    assert any("battery stop" in note for note in finding.notes)
    assert any("u_m3" in note for note in finding.notes)
    rig = replace(virtual.rig, mechanism=replace(virtual.rig.mechanism, u={**virtual.rig.mechanism.u, "m3": 7.82}))
    wider = target_function("breech-force")(Case(FiredShot(virtual.shot, rig)))
    assert not any("u_m3" in note for note in wider.notes)
    assert wider.quantity("peak_force").u > 0.008 * wider.quantity("peak_force").value


@pytest.mark.whole_way
def test_a_gauge_that_reads_a_tenth_high_and_a_check_that_failed_are_reasons():
    virtual, _ = found("field-2013")
    gauge = virtual.shot.channels["p_breech"]
    high = replace(gauge, samples=1.1 * gauge.samples)
    failed = tuple(QualityCheck(name, Check.LOSSES, "fail", "all lost") for name in ("acc_carriage_x", "p_breech"))
    shot = replace(virtual.shot, channels={**virtual.shot.channels, "p_breech": high}, quality=failed)
    finding = target_function("breech-force")(Case(FiredShot(shot, virtual.rig)))
    assert any("less gauge" in reason for reason in finding.reasons)
    # the breech gauge has no part in the force
    assert [one.about for one in finding.reasons if "all lost" in one] == ["acc_carriage_x"]


@pytest.mark.whole_way
def test_figures_draw_and_a_shot_without_resistance_is_refused():
    virtual, finding = found("field-2013")
    assert [figure.key for figure in finding.figures] == ["breech-force", "breech-pressure", "breech-force-parts"]
    blind = without_channels(virtual.shot, "p_brake")
    with pytest.raises(IdentificationError, match="brake_pressure"):
        target_function("breech-force")(Case(FiredShot(blind, virtual.rig)))


def test_slides_that_the_rig_states_take_their_part_of_the_breech_force():
    virtual = virtual_shot("field-2013")
    rig = replace(virtual.rig, mechanism=replace(virtual.rig.mechanism, slide_friction=100.0))
    plain, held = (force_record(FiredShot(virtual.shot, one)).measured for one in (virtual.rig, rig))
    n = min(plain.force_n.size, held.force_n.size)
    assert plain.start_s == held.start_s
    motion = draw_scene(virtual.rig, 3, "s1").motion
    slower = 100.0 * np.interp(plain.start_s + plain.step_s * np.arange(n), motion.times_s, motion.speed_m_s)
    for name in ("resistance_n", "force_n"):
        more = getattr(held, name)[:n] - getattr(plain, name)[:n]
        np.testing.assert_allclose(more, slower, atol=0.03 * slower.max())
    assert slower.max() > 500.0


@pytest.mark.whole_way
def test_what_no_gauge_reads_is_known_as_the_mass_knows_it():
    virtual = virtual_shot("mixed", kind=False)
    mechanism = virtual.rig.mechanism
    rig = replace(virtual.rig, mechanism=replace(mechanism, u=dict(mechanism.u) | {"slide_friction": 20.0}))
    fired = FiredShot(virtual.shot, rig)
    record, recorded = force_record(fired), prepare(fired).recorded
    of_mass = unread_causes(recorded, recorded, rig.mechanism, recorded.acceleration_m_s2)
    assert {SHARE, SLIDE, shape_of_force(0)} < {cause.source for cause in of_mass}
    times = record.measured.times_s
    expected = [np.interp(times, recorded.times_s, one.u * one.forces_n.sum(axis=1)) for one in of_mass]
    # one stands on a travel that turns with the carriage, and both on a release that is as exact as a sample or two
    later = times > recorded.times_s[recorded.released > 0][0] + 2e-4
    u_n, u_of_mass_n = (np.sqrt(np.sum(np.square(errors), axis=0))[later] for errors in (
        [record.systematic_n[one.source] for one in of_mass], expected,
    ))  # fmt: skip
    np.testing.assert_allclose(u_n, u_of_mass_n, atol=0.03 * u_of_mass_n.max())
