"""A report beside the same report made again: what counts as the same number, and what as another one."""

from __future__ import annotations

import copy
import math
from typing import Any

import numpy as np
import pytest

from recoil_identification.report.document.reproduction import compare, compare_tables, leaves_of

REPORT: dict[str, Any] = {
    "mass": {"value": 782.5452581923083, "u": 2.647795722239834, "U95": [777.355673938299, 787.7348424463177]},
    "budget": [
        {"source": "packing friction", "u_kg": 1.1718},
        {"source": "camera scale", "u_kg": 1e-5, "sensitivity_kg": -0.01, "u_source": 1e-3},
    ],
    "campaign": {"R": [[2.0, 1.0], [0.0, 1e-13]], "y": [0.5, 3.0]},
    "sensors": [{"source": "camera scale", "pull": 1.2e-9}],
    "rpe_percent": {"value": 0.3},
    "alignment": [{"clock": "camera", "offset_s": 1e-7, "u_offset_s": 2e-5}],
    "valid": True,
    "reasons": ["camera: offset 0.4213 mm, limit 0.4 mm"],
}


def changed(*path: str | int, to: Any) -> dict[str, Any]:
    document = copy.deepcopy(REPORT)
    part: Any = document
    for key in path[:-1]:
        part = part[key]
    part[path[-1]] = to
    return document


def test_a_report_has_the_names_of_its_rows_in_its_key_paths() -> None:
    keys = leaves_of(REPORT)
    assert {"mass.U95[1]", 'budget."packing friction".u_kg', "campaign.R[0][1]", "reasons[0]"} <= keys.keys()


def test_the_same_report_has_no_difference_and_all_its_numbers_are_counted() -> None:
    found = compare(REPORT, copy.deepcopy(REPORT), exact=True)
    assert (found.numbers, found.differences, found.largest) == (18, (), 0.0)


def test_the_last_bit_counts_on_the_same_computer_and_not_elsewhere() -> None:
    other = changed("mass", "value", to=math.nextafter(REPORT["mass"]["value"], math.inf))
    (difference,) = compare(REPORT, other, exact=True).differences
    assert difference.key == "mass.value"
    assert 0 < difference.relative < 1e-15
    assert not compare(REPORT, other, exact=False).differences


@pytest.mark.parametrize(
    ("path", "to", "again"),
    [
        (("mass", "value"), 782.5452581923083 * (1 + 2e-9), False),
        (("mass", "value"), 782.5452581923083 * (1 + 5e-10), True),
        (("mass", "u"), 2.647795722239834 * (1 + 2e-6), False),
        (("mass", "u"), 2.647795722239834 * (1 + 5e-7), True),
        (("rpe_percent", "value"), 0.3 + 5e-8, True),
        (("rpe_percent", "value"), 0.3 + 2e-7, False),
        (("alignment", 0, "offset_s"), 1e-7 + 1e-14, True),
        (("alignment", 0, "offset_s"), 1e-7 + 1e-13, False),
        (("sensors", 0, "pull"), 9e-7, True),
        (("sensors", 0, "pull"), 1.2e-6, False),
        (("budget", 1, "u_kg"), 1e-5 + 2e-6, True),
        (("budget", 1, "u_kg"), 1e-5 + 3e-6, False),
        (("budget", 1, "sensitivity_kg"), -0.01 + 2e-3, True),
        (("budget", 1, "sensitivity_kg"), -0.01 + 3e-3, False),
        (("campaign", "R", 1, 1), 3e-13, True),
        (("campaign", "y", 1), 17.0, True),
        (("campaign", "y", 0), 0.50001, False),
        (("reasons", 0), "camera: offset 0.4214 mm, limit 0.4 mm", True),
        (("reasons", 0), "camera: offset 0.4217 mm, limit 0.4 mm", False),
        (("reasons", 0), "camera: offset 0.4213 mm, limit 0.4 m", False),
        (("valid",), False, False),
        (("mass", "u"), None, False),
    ],
)  # fmt: skip
def test_elsewhere_a_number_may_differ_by_rounding_and_nothing_else(
    path: tuple[str | int, ...], to: Any, again: bool
) -> None:
    assert (not compare(REPORT, changed(*path, to=to), exact=False).differences) == again
    assert compare(REPORT, changed(*path, to=to), exact=True).differences


def test_a_rotation_of_what_a_shot_says_of_others_is_the_same_elsewhere() -> None:
    rng = np.random.default_rng(1)
    triangle, seen = np.triu(rng.standard_normal((5, 5))), rng.standard_normal(5)
    turn = np.linalg.qr(rng.standard_normal((5, 5)))[0]
    one, other = ({"campaign": {"R": (q @ triangle).tolist(), "y": (q @ seen).tolist()}} for q in (np.eye(5), turn))
    assert not compare(one, other, exact=False).differences
    assert compare(one, other, exact=True).differences


def test_the_worst_comes_first_and_what_is_not_there_before_all() -> None:
    other = changed("mass", "value", to=783.0)
    other["mass"]["u"] = 3.0
    del other["valid"]
    found = compare(REPORT, other, exact=True)
    assert [one.key for one in found.differences] == ["valid", "mass.u", "mass.value"]
    assert str(found.differences[1]) == "mass.u: 2.647795722239834 in the report, 3.0 again, relative 0.12"


def test_what_is_set_aside_is_not_compared() -> None:
    assert not compare(REPORT, changed("mass", "u", to=3.0), exact=True, besides=("mass",)).differences


TABLE = "time_s,mass_kg\n0.1,782.000001\n0.2,\n"


@pytest.mark.parametrize(
    ("text", "exact", "keys"),
    [
        (TABLE, True, []),
        (TABLE.replace("0001", "0002"), True, ["mass.csv[0].mass_kg"]),
        (TABLE.replace("0001", "0002"), False, []),
        (TABLE.replace("0001", "0009"), False, ["mass.csv[0].mass_kg"]),
        (TABLE.replace("0.2,", "0.2,1"), False, ["mass.csv[1].mass_kg"]),
        (TABLE.replace("0.1", "0.1000000001"), False, []),
        (TABLE + "0.3,1\n", False, ["mass.csv"]),
        (TABLE.replace("0.2,", "0.2,1,2"), True, ["mass.csv[1]"]),
    ],
)  # fmt: skip
def test_a_table_beside_a_report_is_compared_cell_by_cell(text: str, exact: bool, keys: list[str]) -> None:
    found = compare_tables("mass.csv", text, TABLE, exact=exact)
    assert [one.key for one in found.differences] == keys
    assert found.numbers == 3


@pytest.mark.parametrize("number", ["1e999", "1e-999", "1e" + 5000 * "9", 5000 * "9"])
def test_a_number_in_a_text_that_no_float_holds_is_another_one(number: str) -> None:
    found = compare(changed("reasons", 0, to=f"camera: offset {number} mm, limit 0.4 mm"), REPORT, exact=False)
    assert [one.key for one in found.differences] == ["reasons[0]"]


@pytest.mark.whole_way
def test_a_triangle_of_thousands_of_columns_is_compared_as_it_stands() -> None:
    # squared it would fill 80 GB
    other = changed("campaign", "R", to=[[0.0] * 100_000])
    assert len(compare(other, REPORT, exact=False).differences) > 99_000
