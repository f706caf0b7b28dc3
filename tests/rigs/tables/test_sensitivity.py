"""A sensitivity as certificates have it: what it means by an independent table of units, and every fault of one."""

from __future__ import annotations

from typing import Any

import numpy as np
import pint
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_acquisition.errors import RigError
from recoil_rigs.rig import Rig
from recoil_rigs.tables.channel_table import range_si
from recoil_rigs.tables.sensitivity import sensitivity_from_text
from tests.rigs.shots.test_assemble import read, rig_of

REGISTRY: pint.UnitRegistry[Any] = pint.UnitRegistry()
PINT = {"g": "standard_gravity", "°/s": "degree/s", "ms⁻²": "m/s**2", "m/s2": "m/s**2", "(m/s2)": "(m/s**2)"}
"""Spellings of a certificate that mean something else to pint."""


def rig_in_volts(sensor: str, *, quantity: str = "pressure", unit: str = 'unit = "V"') -> Rig:
    return rig_of(f"{unit}\nsensor = {{ {sensor} }}", quantity=quantity)


def faults_of(sensor: str, *, quantity: str = "pressure", unit: str = 'unit = "V"') -> list[str]:
    with pytest.raises(RigError) as caught:
        rig_in_volts(sensor, quantity=quantity, unit=unit)
    return [str(fault) for fault in caught.value.faults]


def by_pint(volts: float, number: float, output: str, per: str, amplifier: str = "") -> float:
    """Return what a sensor measured, SI, from the volts behind its chain."""
    sensitivity = number * REGISTRY.Quantity(1.0, output) / REGISTRY(PINT.get(per, per))
    chain = sensitivity * (REGISTRY(amplifier) if amplifier else 1.0)
    measured: float = (REGISTRY.Quantity(volts, "V") / chain).to_base_units().magnitude
    return measured


@pytest.mark.parametrize(
    ("text", "quantity", "output", "per", "amplifier", "gain"),
    [
        ("40 mV/MPa", "pressure", "mV", "MPa", "", ""),
        ("40mV/MPa", "pressure", "mV", "MPa", "10", "10"),
        ("2.5 pC/bar", "pressure", "pC", "bar", "0.005", "0.005 V/pC"),
        ("250 nC/MPa", "pressure", "nC", "MPa", "1e-5", "1e-5 V/pC"),
        ("10 mV/g", "acceleration", "mV", "g", "", ""),
        ("3.16 pC/(m/s2)", "acceleration", "pC", "(m/s2)", "0.01", "0.01 V/pC"),
        ("3.16 pC/ms⁻²", "acceleration", "pC", "ms⁻²", "0.01", "0.01 V/pC"),
        ("1.02 mV/m/s2", "acceleration", "mV", "m/s2", "", ""),
        ("0.1 V/V", "voltage", "V", "V", "", ""),
        ("0.02 mV/V/kN", "force", "mV/V", "kN", "5", "5 V/(mV/V)"),
        ("0.5 mA/bar", "pressure", "mA", "bar", "0.25", "0.25 V/mA"),
        ("6.67 mV/°/s", "angular_rate", "mV", "°/s", "", ""),
        ("4e-2 V / mm", "displacement", "V", "mm", "", ""),
    ],
)
def test_volts_become_what_an_independent_table_of_units_says(text, quantity, output, per, amplifier, gain) -> None:
    sensor = f'sensitivity = "{text}"' + (f", amplifier = {amplifier}" if amplifier else "")
    channel = read(rig_in_volts(sensor, quantity=quantity), "V", (5.2, -0.3))
    number = sensitivity_from_text(text).value
    expected = [by_pint(volts, number, output, per, gain) for volts in (5.2, -0.3)]
    np.testing.assert_allclose(channel.samples, expected, rtol=1e-12)


@pytest.mark.exhaustive
@given(
    number=st.floats(1e-3, 1e3), volts=st.floats(-10, 10), output=st.sampled_from(["uV", "mV", "V"]),
    per=st.sampled_from(["Pa", "kPa", "bar", "MPa", "psi"]), file_unit=st.sampled_from(["V", "mV"]),
)  # fmt: skip
@settings(max_examples=60, deadline=None)
def test_any_number_in_any_units_is_what_pint_makes_of_it(number, volts, output, per, file_unit) -> None:
    rig = rig_in_volts(f'sensitivity = "{number!r} {output}/{per}"', unit="")
    written = volts * (1e3 if file_unit == "mV" else 1.0)
    found = read(rig, file_unit, (written,)).samples[0]
    assert found == pytest.approx(by_pint(volts, number, output, per), rel=1e-11, abs=1e-300)


def test_what_the_sensor_gives_out_may_be_in_the_file_itself() -> None:
    charge = read(rig_in_volts('sensitivity = "2.5 pC/bar"', unit='unit = "pC"'), "pC", (250.0,))
    assert charge.samples[0] == pytest.approx(100e5)
    bridge = rig_in_volts('sensitivity = "0.02 mV/V/kN"', quantity="force", unit='unit = "mV/V"')
    assert read(bridge, "mV/V", (1.0,)).samples[0] == pytest.approx(50e3)
    loop = rig_in_volts('sensitivity = "0.1 mA/bar", offset = -40.0', unit='unit = "mA"')
    np.testing.assert_allclose(read(loop, "mA", (4.0, 20.0)).samples, [0.0, 160e5], atol=1e-6)


def test_a_temperature_in_volts_keeps_the_zero_of_its_unit() -> None:
    thermometer = rig_in_volts('sensitivity = "10 mV/degC"', quantity="temperature")
    assert read(thermometer, "V", (0.25,)).samples[0] == pytest.approx(298.15)


@pytest.mark.parametrize("unit", ['unit = "V"', 'unit = "MPa"', ""])
def test_the_range_is_in_the_unit_of_what_is_measured(unit: str) -> None:
    rig = rig_in_volts('sensitivity = "40 mV/MPa", range = [0, 250]', unit=unit)
    assert range_si(rig.channel("p")) == (0.0, 250e6)
    assert read(rig, "V", (5.2,)).samples[0] == pytest.approx(130e6)


def test_a_rigs_own_unit_of_what_is_measured_decides_over_the_certificates() -> None:
    rig = rig_in_volts('sensitivity = "40 mV/MPa", range = [0, 2500], offset = 10', unit='unit = "bar"')
    assert range_si(rig.channel("p")) == (1e6, 251e6)
    assert read(rig, "V", (5.2,)).samples[0] == pytest.approx(131e6)


def test_a_bare_number_is_per_si_unit_as_it_always_was() -> None:
    rig = rig_in_volts('sensitivity = 40, sensitivity_unit = "mV", range = [0, 250]')
    assert read(rig, "V", (5.2,)).samples[0] == pytest.approx(130.0)
    assert range_si(rig.channel("p")) == (0.0, 250.0)


@pytest.mark.parametrize(
    ("sensor", "key", "problem"),
    [
        ('sensitivity = "40 mV/MPaz"', "sensitivity", "'MPaz' is no known unit; nearest known: MPa"),
        ('sensitivity = "40 mv/MPa"', "sensitivity", "'mv' is nothing that a sensor gives out; nearest known: mV"),
        ('sensitivity = "40 mV/g"', "sensitivity", "'40 mV/g' is per g, which is no unit of pressure; one of Pa, "),
        ('sensitivity = "40 mV/V"', "sensitivity", "is per V, which is no unit of pressure; of a bridge write"),
        ('sensitivity = "40 pC/bar"', "amplifier", "is needed, V per pC: `sensitivity` is in pC, and volts are"),
        ('sensitivity = "4 mA/bar"', "amplifier", "is needed, V per mA"),
        ('sensitivity = "0.2 mV/V/bar"', "amplifier", "is needed, V per mV/V"),
        ('sensitivity = "0 mV/MPa"', "sensitivity", "is zero: such a sensor gives nothing out"),
        ('sensitivity = "-40 mV/MPa"', "sensitivity", "is negative: write it without the sign, and `polarity = -1`"),
        ('sensitivity = "0 mV/MPaz"', "sensitivity", "is zero: such a sensor gives nothing out; 'MPaz' is no known"),
        ('sensitivity = "1,234 mV/MPa"', "sensitivity", "may be thousands or decimals, 1234 or 1.234"),
        ('sensitivity = "25 MPa/V"', "sensitivity", "is turned round: write V per MPa, such as 0.04 V/MPa"),
        ('sensitivity = "40 mV"', "sensitivity", 'is mV per what? write a number and its unit as on the certificate'),
        ('sensitivity = "40 mV/"', "sensitivity", 'is mV per what? write a number and its unit as on the certificate'),
        ('sensitivity = "40 MPa"', "sensitivity", "has no unit per unit"),
        ('sensitivity = "mV/MPa"', "sensitivity", 'must be a number and its unit as on the certificate, such as'),
        ('sensitivity = "inf mV/MPa"', "sensitivity", "must be a number and its unit"),
        ('sensitivity = "1e99 mV/MPa"', "sensitivity", "is no number that a sensor has"),
        ('sensitivity = ""', "sensitivity", 'must be a text as on the certificate, such as "40 mV/MPa"'),
        ("sensitivity = true", "sensitivity", 'must be a text as on the certificate, such as "40 mV/MPa"'),
        ('sensitivity = -40, sensitivity_unit = "mV"', "sensitivity", "or a positive number per SI unit"),
        ('sensitivity = "40 mV/MPa", amplifier = 1e99', "amplifier", "1e+99 is no gain that a chain has"),
    ],
)  # fmt: skip
def test_each_fault_of_a_sensitivity_is_told_with_its_place(sensor: str, key: str, problem: str) -> None:
    (told,) = faults_of(sensor)
    assert told.startswith(f"channel[0] 'p'.sensor.{key}: ")
    assert problem in told


def test_a_unit_beside_a_sensitivity_that_has_its_own_is_a_fault() -> None:
    (told,) = faults_of('sensitivity = "40 mV/MPa", sensitivity_unit = "mV"')
    assert told == "channel[0] 'p'.sensor: `sensitivity_unit` is in '40 mV/MPa' already: leave it out"


def test_all_faults_of_a_chain_and_of_the_channel_are_told_at_once() -> None:
    told = faults_of('sensitivity = "40 pC/g"', unit='unit = "V"\nrole = "breech_presure"')
    assert [line.split(":")[0] for line in told] == [
        "channel[0] 'p'.role",
        "channel[0] 'p'.sensor.sensitivity",
        "channel[0] 'p'.sensor.amplifier",
    ]


def test_a_file_in_volts_contradicts_a_rig_in_pressure_without_a_sensitivity() -> None:
    rig = rig_of('unit = "MPa"')
    with pytest.raises(RigError, match=r"the rig says 'MPa', file\.csv says 'V'"):
        read(rig, "V")
