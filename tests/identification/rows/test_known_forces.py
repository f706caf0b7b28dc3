"""What a rig file knows of forces beside their gauges' certificates: its rows, its budget, and what it tells."""

from __future__ import annotations

import dataclasses
import math
from functools import cache

import numpy as np
import pytest

from recoil_identification.inference.block import LinearBlock
from recoil_identification.inference.solve import solve
from recoil_identification.inference.unknown import Prior, Unknown
from recoil_identification.rows.known_forces import known_forces
from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.identified import Identification, Options
from recoil_identification.shot.shared_identity import source_of
from recoil_processing.shot.error_source import SourceKind
from recoil_rigs.rig import Rig, parse_rig
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.shots.stated_uncertainty import with_dynamic_certificate
from tests.builders.virtual_shots import VirtualShot, virtual_shot, with_channels

SETTINGS = {"gain_errors": False, "friction_error": False}
V0_M_S, CHARGE_KG, SHARE = 650.0, 2.0, 1.5
U_V0_REL = 0.004
SOURCE = "declared impulse of breech_pressure"


@cache
def plain() -> VirtualShot:
    return virtual_shot("field-2013", 3, **SETTINGS)


@cache
def impulse_n_s() -> float:
    """Impulse of the breech's force; nothing of this shot's gauges is off."""
    channel, rig = plain().shot.channels["p_breech"], plain().rig
    part = (channel.time_base.times_s > 0.05) & (channel.time_base.times_s < 0.12)
    pressure = channel.measured - np.mean(channel.measured[channel.time_base.times_s < 0.045])
    return float(np.sum(pressure[part])) / channel.time_base.rate_hz * rig.mechanism.force_areas[0]


def knowing(table: str) -> Rig:
    rig = plain().rig
    return parse_rig(rig.text.replace("[twin]", f"{table}\n[twin]"), rig.path)


def projectile(factor: float = 1.0) -> str:
    """State a projectile whose impulse is a multiple of the true one."""
    mass_kg = factor * impulse_n_s() / V0_M_S - SHARE * CHARGE_KG
    return (
        f"[knowledge.projectile]\nmass_kg = {mass_kg!r}\nmuzzle_velocity_m_s = {V0_M_S}\n"
        f"u_muzzle_velocity_m_s = {U_V0_REL * V0_M_S}\ncharge_kg = {CHARGE_KG}\nu_gas_share = 0.0\n"
    )


def load(channel: str, known: float, u: float, read: float | None = None) -> str:
    stated = "" if read is None else f"read = {read!r}\n"
    return f'[[knowledge.load]]\nchannel = "{channel}"\nknown = {known!r}\nu_known = {u!r}\n{stated}'


def identify(table: str = "", **scales: float) -> Identification:
    shot = plain().shot
    if scales:
        shot = with_channels(shot, **{name: by * shot.channels[name].samples for name, by in scales.items()})
    return identify_shot(FiredShot(shot, knowing(table) if table else plain().rig), Options())


@cache
def known() -> Identification:
    return identify(projectile())


@pytest.mark.exhaustive
def test_an_impulse_that_agrees_makes_the_mass_surer_and_moves_it_little():
    before, after = identify().chosen.estimate, known().chosen.estimate
    assert after.u_kg < 0.97 * before.u_kg
    assert abs(after.mass_kg - before.mass_kg) < before.u_kg
    assert not known().reasons
    (check,) = known().force_checks
    assert (check.about, check.against) == (SOURCE, "breech_pressure")
    assert check.u_percent == pytest.approx(100 * U_V0_REL, rel=1e-6)
    assert abs(check.off_percent) < 0.1
    assert abs(check.normalised_residual) < 2.0


@pytest.mark.exhaustive
def test_the_estimate_is_that_of_generalised_least_squares_with_one_more_observation():
    """The row and its prior are one observation of variance u^2 + sigma^2, beside all others and without an unknown."""
    calibration = identify(projectile(1.003)).route.calibration
    inferred, priors = calibration.inferred, [*calibration.common, *calibration.own]
    names = [one.name for one in inferred.unknowns]
    off = f"ln {SOURCE}"
    fewer = [one for one in inferred.unknowns if one.name != off]
    (row,) = (block for block in calibration.further if off in block.unknowns)
    (known_to,) = (math.sqrt(one.covariance[0, 0]) for one in priors if one.sources == (SOURCE,))
    others = [block for block in calibration.further if block is not row]
    without = solve(
        fewer, [calibration.rows, *others], [one for one in priors if one.sources != (SOURCE,)], calibration.values
    )
    column = np.zeros(len(fewer))
    for name, value in zip(row.unknowns, row.columns[0], strict=True):
        if name != off:
            column[[one.name for one in fewer].index(name)] = value
    # one observation more: the gain of Kalman
    left = row.recorded[0] - column @ without.values
    gain = without.covariance @ column / (column @ without.covariance @ column + known_to**2 + row.sigma**2)
    expected = without.values + gain * left
    u = np.sqrt(np.diag(without.covariance) - gain * (without.covariance @ column))
    mass = names.index("ln mass")
    assert inferred.values[mass] == pytest.approx(expected[0], abs=2e-3 * u[0])
    assert inferred.u("ln mass") == pytest.approx(u[0], rel=2e-3)


@pytest.mark.exhaustive
def test_its_row_in_the_budget_is_what_moving_it_and_estimating_anew_gives():
    found = known()
    (row,) = (one for one in found.chosen.estimate.budget if one.source == SOURCE)
    assert (row.scope, row.kind, row.sensitivity_per) == ("rig", "B", "1")
    assert row.u_source == pytest.approx(U_V0_REL, rel=1e-6)
    up, down = (identify(projectile(math.exp(sign * U_V0_REL))).chosen.estimate.mass_kg for sign in (1.0, -1.0))
    assert row.sensitivity * row.u_source == pytest.approx((up - down) / 2, abs=0.02 * found.chosen.estimate.u_kg)


@pytest.mark.exhaustive
def test_a_gauge_that_reads_five_percent_low_is_told_by_the_declared_impulse_alone():
    """Its own scale is taken for unknown, so that nothing but the impulse says what it should read."""
    rig = knowing(projectile())
    channels = tuple(
        one.model_copy(update={"sensor": one.sensor.model_copy(update={"u_rel": 0.2})})
        if one.name == "p_breech"
        else one
        for one in rig.channels
    )
    loose = dataclasses.replace(rig, channels=channels)
    shot = plain().shot
    low = with_channels(shot, p_breech=0.95 * shot.channels["p_breech"].samples)
    found = identify_shot(FiredShot(low, loose), Options())
    error = found.route.calibration.gauge_errors[0]
    assert error == pytest.approx(-0.05, abs=0.01)
    assert abs(found.chosen.estimate.mass_kg - plain().truth["m3"]) < 2.0 * found.chosen.estimate.u_kg


@pytest.mark.exhaustive
def test_a_gauge_off_its_certificate_contradicts_what_is_declared_and_both_sides_are_named():
    shot = plain().shot
    low = with_channels(shot, p_breech=0.95 * shot.channels["p_breech"].samples)
    found = identify_shot(FiredShot(low, with_dynamic_certificate(knowing(projectile()), "p_breech")), Options())
    (check,) = found.force_checks
    assert check.off_percent == pytest.approx(-5.0, abs=0.2)
    assert abs(check.normalised_residual) > check.limit
    assert not found.valid
    text = next(str(one) for one in found.reasons if SOURCE in str(one))
    assert f"{SOURCE} contradicts breech_pressure and the other sensors" in text
    assert "is declared too large" in text
    assert any("breech_pressure" in str(one) and "reads low" in str(one) for one in found.reasons)
    # one that was calibrated at rest is the likelier cause, and is named alone
    at_rest = identify(projectile(), p_breech=0.95)
    (reason,) = at_rest.reasons
    assert reason.startswith("breech_pressure sensitivity and area contradicts the other sensors: it reads low")
    assert "breech_pressure dynamic scale reads low" in reason


@pytest.mark.exhaustive
@pytest.mark.parametrize(("channel", "off"), [("p_brake", 1.03), ("p_recuperator", 0.97)])
def test_a_known_load_tells_what_its_gauge_reads_wrong(channel, off):
    table = load(channel, 10.0, 0.01, 10.0 * off)
    found = identify(table, **{channel: off})
    plainly, told = identify(**{channel: off}), found.chosen.estimate
    assert abs(told.mass_kg - identify().chosen.estimate.mass_kg) < abs(
        plainly.chosen.estimate.mass_kg - identify().chosen.estimate.mass_kg
    )
    check = found.force_checks[0]
    assert (check.about, check.against) == (f"declared load on {channel}", channel)
    assert check.off_percent == pytest.approx(100.0 * (off - 1.0), abs=1e-6)


@pytest.mark.exhaustive
def test_a_recuperators_load_at_rest_is_read_from_the_shot():
    shot = plain().shot
    channel = shot.channels["p_recuperator"]
    at_rest = float(np.mean(channel.measured[channel.time_base.times_s < 0.045]))
    found = identify(load("p_recuperator", 1e-6 * at_rest / 1.002, 0.004))
    assert found.force_checks[0].off_percent == pytest.approx(0.2, abs=0.05)


@pytest.mark.exhaustive
def test_what_a_shot_lacks_is_left_out():
    found = known()
    route = found.route
    fired = FiredShot(plain().shot, knowing(projectile()))
    series = {role: one for role, one in route.signals.series.items() if role != "breech_pressure"}
    block = route.calibration.block
    nothing = known_forces(dataclasses.replace(route.signals, series=series), fired, block.regression, block.causes)
    assert dataclasses.astuple(nothing) == ((), (), (), ())


def uncertain(u_velocity_m_s: float, u_gas_share: float) -> str:
    """State a projectile of which the gas is uncertain in all shots alike, and the velocity in each of its own."""
    other = projectile().replace(
        f"u_muzzle_velocity_m_s = {U_V0_REL * V0_M_S}", f"u_muzzle_velocity_m_s = {u_velocity_m_s}"
    )
    return other.replace("u_gas_share = 0.0", f"u_gas_share = {u_gas_share}")


def breech_u(shots: int, table: str) -> float:
    """Standard uncertainty of the breech gauge's scale that so many equal shots leave; what is at random is in it."""
    summary = identify(table).summary
    names = [one.name for one in summary.parameters]
    told = shots * summary.triangle.T @ summary.triangle
    for at, one in enumerate(summary.parameters[1:], 1):
        u = math.hypot(*(u for _, u in one.influences)) if one.influences else 1e-9
        if one.name == "ln breech_pressure":
            u = 0.05  # nothing but what is declared says much of it
        told[at, at] += 1.0 / max(u, 1e-9) ** 2
    place = names.index("ln breech_pressure")
    return float(np.sqrt(np.linalg.inv(told)[place, place]))


@pytest.mark.exhaustive
def test_a_campaign_takes_the_muzzle_velocity_anew_in_each_shot_and_the_gas_once() -> None:
    """Of errors that all shots have alike many shots leave what one leaves; of own ones the root of their number."""
    impulse_share = CHARGE_KG * V0_M_S / impulse_n_s()
    u_rel = 1e-3  # little beside what the other sensors say of the gauge
    common, own = uncertain(0.0, u_rel / impulse_share), uncertain(u_rel * V0_M_S, 0.0)
    assert breech_u(16, common) == pytest.approx(u_rel, rel=0.06)
    assert breech_u(16, own) == pytest.approx(breech_u(1, own) / 4.0, rel=0.06)


@pytest.mark.exhaustive
def test_what_a_rig_declares_is_one_rigs_in_all_campaigns() -> None:
    by_name = {one.name: dict(one.influences) for one in identify(uncertain(2.6, 0.1)).summary.parameters}
    (identity,) = by_name[SOURCE]
    assert identity == f"rig:field-2013:{SOURCE}"
    assert by_name[SOURCE][identity] == pytest.approx(0.1 * CHARGE_KG * V0_M_S / impulse_n_s(), rel=1e-9)
    found = source_of(identity)
    assert (found, found.kind) == (SOURCE, SourceKind.KNOWN_IMPULSE)


@pytest.mark.exhaustive
def test_the_summary_with_what_is_declared_is_the_shot() -> None:
    found = identify(uncertain(2.6, 0.1) + load("p_brake", 10.0, 0.02, 10.01))
    summary = found.summary
    names = tuple(one.name for one in summary.parameters)
    about = LinearBlock(names, summary.triangle, summary.seen + summary.triangle @ summary.reference, 1.0)
    priors = [
        Prior.of(one.name, one.name, math.hypot(*(u for _, u in one.influences), 0.0)) for one in summary.parameters[1:]
    ]
    again = solve([Unknown(each) for each in names], [about], priors)
    own = found.route.calibration
    assert math.exp(again.value("ln mass")) == pytest.approx(own.estimate.mass_kg, rel=1e-9)
    assert again.u("ln mass") == pytest.approx(own.inferred.u("ln mass"), rel=1e-8)
