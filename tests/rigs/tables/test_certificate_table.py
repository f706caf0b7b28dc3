"""A stand's table of certificates: what a rig file has of a row, and one clear line for each fault."""

from __future__ import annotations

import datetime as dt
from pathlib import Path

import pytest

from recoil_acquisition.errors import ReadError, RigError
from recoil_rigs.tables.certificate_table import COLUMNS, Certificate, certificate_for, read_certificates
from recoil_rigs.tables.channel_table import Sensor

HEAD = "serial,quantity,unit,sensitivity,sensitivity_unit,range_low,range_high,U_percent,k,calibrated,due"
SOUND = "V301,pressure,MPa,40,mV/MPa,0,250,1,2,2026-03-01,2027-03-01"


def read(folder: Path, *lines: str) -> tuple[Certificate, ...]:
    path = folder / "sensors.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return read_certificates(path)


def test_a_row_is_what_a_rig_file_has_of_a_sensor(tmp_path: Path) -> None:
    (one,) = read(tmp_path, HEAD, SOUND)
    sensor = one.sensor("V")
    assert sensor == {
        "serial": "V301", "calibrated": dt.date(2026, 3, 1), "due": dt.date(2027, 3, 1), "U_rel": 0.01, "k": 2.0,
        "range": [0.0, 250.0], "sensitivity": "40 mV/MPa",
    }  # fmt: skip
    assert Sensor.model_validate(sensor).u_rel == 0.005


@pytest.mark.parametrize(("unit", "high"), [("MPa", 250.0), ("bar", 2500.0), ("kPa", 250e3), (None, 250.0)])
def test_the_range_is_in_the_unit_that_the_channel_has(tmp_path: Path, unit: str | None, high: float) -> None:
    (one,) = read(tmp_path, "serial,quantity,unit,range_low,range_high", "V301,pressure,MPa,0,250")
    assert one.sensor(unit)["range"] == [0.0, pytest.approx(high, rel=1e-12)]


def test_a_range_from_a_vacuum_is_one_above_the_air(tmp_path: Path) -> None:
    (one,) = read(tmp_path, "serial,quantity,unit,range_low,range_high", "V301,pressure,bar(a),0,60")
    assert one.sensor("bara")["range"] == [0.0, 60.0]
    assert one.sensor("bar")["range"] == [pytest.approx(-1.01325, rel=1e-12), pytest.approx(58.98675, rel=1e-12)]
    assert one.sensor("kPa")["range"] == [pytest.approx(-101.325, rel=1e-12), pytest.approx(5898.675, rel=1e-12)]


def test_the_range_of_a_chain_is_in_what_its_sensitivity_is_per(tmp_path: Path) -> None:
    (one,) = read(tmp_path, HEAD, SOUND.replace("MPa,40,mV/MPa,0,250", "bar,4,mV/MPa,0,2500"))
    assert one.sensor("mV")["range"] == [0.0, 250.0]


def test_shares_come_of_percent_and_lengths_of_millimetres(tmp_path: Path) -> None:
    head = "serial,U_percent,k,reference,u_reference_percent,zero_percent,distortion_mm,delay_s,u_delay_s,calibration"
    (one,) = read(tmp_path, head, "A,1.2,2.4,dw-7,0.3,0.1,0.05,0.0004,1e-5,Dynamic")
    assert one.sensor(None) == {
        "serial": "A", "U_rel": 0.012, "k": 2.4, "reference": "dw-7", "u_reference_rel": 0.003, "u_zero_rel": 0.001,
        "u_distortion_m": 5e-5, "delay_s": 0.0004, "u_delay_s": 1e-5, "calibration": "dynamic",
    }  # fmt: skip


def test_a_spreadsheet_of_another_country_says_the_same(tmp_path: Path) -> None:
    (one,) = read(tmp_path, HEAD, SOUND)
    german = SOUND.replace(",", ";").replace(";1;2;", ";1,0;2;")
    (other,) = read(tmp_path, "sep=;", HEAD.replace(",", ";"), german)
    assert other.sensor("V") == one.sensor("V")


@pytest.mark.parametrize(
    ("old", "new", "fault"),
    [
        (",1,2,", ",one,2,", "row 2 'V301'.U_percent: expected a number, expanded uncertainty"),
        (",1,2,", ",-1,2,", "row 2 'V301'.U_percent: expected a number not below 0"),
        (",1,2,", ",1,0,", "row 2 'V301'.k: expected a number above 0"),
        (",1,2,", ",1,,", "row 2 'V301'.k: is missing: `U_percent` needs it"),
        ("2026-03-01", "03/01/2026", "row 2 'V301'.calibrated: expected a date as 2026-03-01"),
        ("2027-03-01", "2025-03-01", "row 2 'V301'.due: lies before `calibrated`"),
        ("0,250", "0,250 N", "row 2 'V301'.range_high: expected a number, upper end of the range; what"),
        (",1,2,", ',"1,500",2,', "row 2 'V301'.U_percent: expected a number, expanded uncertainty of the sensitivity"),
        ("pressure", "presure", "row 2 'V301'.quantity: expected a quantity, such as pressure"),
        (",MPa,40", ",MPaz,40", "row 2 'V301'.unit: expected a unit, nearest known MPa"),
        (",MPa,40", ",mm,40", "row 2 'V301'.unit: 'mm' is no unit of pressure; write one of Pa"),
        ("mV/MPa", "mV/g", "row 2 'V301'.sensitivity_unit: is per g, which is no unit of pressure"),
        ("mV/MPa", "MPa/mV", "row 2 'V301'.sensitivity_unit: '40 MPa/mV' is turned round"),
        ("0,250", "250,0", "row 2 'V301'.range_high: expected more than `range_low`, 250; found 0"),
        ("V301", "", "row 2.serial: is missing: a sensor is known by it"),
    ],
)
def test_a_fault_is_one_line_with_its_cell(tmp_path: Path, old: str, new: str, fault: str) -> None:
    assert old in SOUND
    with pytest.raises(RigError) as refused:
        read(tmp_path, HEAD, SOUND.replace(old, new, 1))
    assert len(refused.value.faults) == 1
    assert str(refused.value.faults[0]).startswith(fault)
    assert "\n" not in str(refused.value)


def test_a_certificate_is_static_or_dynamic(tmp_path: Path) -> None:
    with pytest.raises(RigError, match=r"row 2 'V301'\.calibration: expected static or dynamic; found 'in pulses'"):
        read(tmp_path, f"{HEAD},calibration", f"{SOUND},in pulses")


def test_all_faults_are_told_at_once(tmp_path: Path) -> None:
    with pytest.raises(RigError) as refused:
        read(
            tmp_path,
            HEAD + ",serail",
            SOUND.replace("40", "x") + ",",
            SOUND.replace(",1,2,", ",y,2,") + ",",
            SOUND + ",",
            SOUND + ",",
        )
    assert [fault.key for fault in refused.value.faults] == [
        "column serail", "row 2 'V301'.sensitivity", "row 3 'V301'.U_percent", "row 5 'V301'.serial",
    ]  # fmt: skip


def test_dates_may_be_day_month_year_as_a_german_spreadsheet_writes_them(tmp_path: Path) -> None:
    (one,) = read(tmp_path, HEAD, SOUND.replace("2026-03-01", "10.03.2026").replace("2027-03-01", "1.3.2027"))
    assert one.sensor("V")["calibrated"] == dt.date(2026, 3, 10)
    assert one.sensor("V")["due"] == dt.date(2027, 3, 1)


def test_a_number_may_have_its_unit_behind_it(tmp_path: Path) -> None:
    head = "serial,quantity,unit,range_low,range_high,U_percent,k,filter_hz,delay_s"
    (one,) = read(tmp_path, head, "A,pressure,MPa,0 bar,2500 bar,0.5 %,2,10 kHz,0.4 ms")
    sensor = one.sensor("MPa")
    assert (sensor["range"], sensor["U_rel"], sensor["k"]) == ([0.0, 250.0], 0.005, 2.0)
    assert (sensor["filter_hz"], sensor["delay_s"]) == (1e4, 4e-4)


def test_a_fault_that_every_row_has_is_one_line_which_names_the_rows(tmp_path: Path) -> None:
    rows = [SOUND.replace("V301", f"V{n}").replace("2026-03-01", "03/01/2026") for n in range(12)]
    with pytest.raises(RigError) as refused:
        read(tmp_path, HEAD, *rows)
    (fault,) = refused.value.faults
    assert str(fault).startswith("row 2 'V0'.calibrated: expected a date as 2026-03-01 or 01.03.2026, ")
    assert str(fault).endswith("; found '03/01/2026'; so in 11 more: rows 3, 4, 5, 6, 7, 8, 9, 10, ..")


@pytest.mark.parametrize("content", ["", "name,unit\na,b\n", "PK\x03\x04\x00\x00"])
def test_what_is_no_such_table_is_refused(tmp_path: Path, content: str) -> None:
    with pytest.raises(ReadError):
        read(tmp_path, content)


def test_a_sensor_is_found_by_serial_number_or_by_signal(tmp_path: Path) -> None:
    rows = read(
        tmp_path, "serial,signal,quantity", "A,AI 1,pressure", "B,,acceleration", "C,f1,angular_rate",
        "C,f2,angular_rate", "D,,", "E,AI 1,force",
    )  # fmt: skip

    def found(**given: str) -> str | None:
        one = certificate_for(rows, **given)
        return None if one is None else f"{one.serial} {one.line}"

    assert found(signal="AI 1", quantity="pressure") == "A 2"
    assert found(signal="AI 1") is None  # two sensors are said to be there
    assert found(serial="B", signal="AI 7", quantity="acceleration") == "B 3"
    assert found(serial="B", quantity="pressure") is None
    assert found(serial="C", signal="f2", quantity="angular_rate") == "C 5"
    assert found(serial="D", signal="anything", quantity="force") == "D 6"
    assert found(signal="AI 7") is None


def test_every_column_is_explained_on_the_page_of_the_first_day() -> None:
    page = (Path(__file__).resolve().parents[3] / "docs" / "first-day.md").read_text(encoding="utf-8")
    assert [name for name in COLUMNS if f"`{name}`" not in page] == []
