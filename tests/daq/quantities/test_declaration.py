"""Tables of a rig file are strict, and every fault of one has its key's path and the rig file's own words."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import pytest
from pydantic import Field

from recoil_acquisition.errors import Fault, FaultCode, Row
from recoil_acquisition.quantities.declaration import (
    STRICT,
    DeclaredTable,
    Finite,
    NotNegative,
    Positive,
    Text,
    checked,
    declared,
    declared_rows,
)


class Part(DeclaredTable):
    size: Positive
    share: NotNegative = 0.0


class Round(DeclaredTable):
    kind: Literal["round"]
    radius: Positive


class Square(DeclaredTable):
    kind: Literal["square"]
    side: Positive = Field(description="the length of a side, m")


class Pierced(DeclaredTable):
    hole: Finite = 0.0

    def contradictions(self) -> list[Fault]:
        return [Fault(("hole",), "must not be 1", FaultCode.CONTRADICTION)] if self.hole == 1.0 else []


class Whole(DeclaredTable):
    name: Text
    level: Finite = 0.0
    parts: Annotated[tuple[Part, ...], Field(strict=False)] = ()
    shape: Annotated[Round | Square, Field(discriminator="kind")] | None = None
    rates: dict[str, Positive] = Field(default_factory=dict)
    pierced: Pierced = Pierced()
    more: Annotated[tuple[Pierced, ...], Field(strict=False)] = ()

    def contradictions(self) -> list[Fault]:
        wrong = Fault(("level",), "must not be 7", FaultCode.CONTRADICTION)
        return [wrong] if self.level == 7.0 else []


def faults_of(**table: Any) -> list[Fault]:
    faults: list[Fault] = []
    made = declared(Whole, {"name": "one"} | table, ("whole",), faults)
    assert (made is None) == bool(faults)
    return faults


def test_a_sound_table_is_made_without_a_fault() -> None:
    faults: list[Fault] = []
    made = declared(Whole, {"name": "one", "parts": [{"size": 2}], "rates": {"a": 1.0}}, ("whole",), faults)
    assert faults == []
    assert made is not None
    assert (made.parts[0].size, made.parts[0].share, made.rates) == (2.0, 0.0, {"a": 1.0})


@pytest.mark.parametrize(
    ("table", "key", "code", "problem"),
    [
        ({"level": math.inf}, "whole.level", FaultCode.RANGE, "must be a finite number, found inf"),
        ({"level": math.nan}, "whole.level", FaultCode.RANGE, "must be a finite number, found nan"),
        ({"level": "1"}, "whole.level", FaultCode.TYPE, "must be a finite number, found '1'"),
        ({"level": True}, "whole.level", FaultCode.TYPE, "must be a finite number, found True"),
        ({"name": ""}, "whole.name", FaultCode.VALUE, "must not be empty, found ''"),
        ({"level": 7.0}, "whole.level", FaultCode.CONTRADICTION, "must not be 7"),
        (
            {"parts": [{"size": 1}, {"size": 0}]},
            "whole.parts[1].size",
            FaultCode.RANGE,
            "must be greater than 0, found 0",
        ),
        (
            {"parts": [{"size": 1, "share": math.inf}]},
            "whole.parts[0].share",
            FaultCode.RANGE,
            "must be a finite number, found inf",
        ),
        ({"parts": [{"share": 0.5}]}, "whole.parts[0].size", FaultCode.MISSING, "is missing"),
        ({"rates": {"left": -1.0}}, "whole.rates.left", FaultCode.RANGE, "must be greater than 0, found -1.0"),
        ({"shape": {"kind": "square"}}, "whole.shape.side", FaultCode.MISSING, "is missing: the length of a side, m"),
        (
            {"shape": {"kind": "square", "side": "x"}},
            "whole.shape.side",
            FaultCode.TYPE,
            "must be the length of a side, m, found 'x'",
        ),
        ({"shape": {"kind": "round", "side": 1.0}}, "whole.shape.radius", FaultCode.MISSING, "is missing"),
        ({"shape": {}}, "whole.shape.kind", FaultCode.MISSING, "is missing; one of round, square"),
        ({"name": 3 * "a" + 70 * "b", "level": 70 * "c"}, "whole.level", FaultCode.TYPE, None),
    ],
)
def test_a_fault_has_its_keys_path_and_what_would_be_right(
    table: dict[str, Any], key: str, code: FaultCode, problem: str | None
) -> None:
    fault = faults_of(**table)[0]
    assert (fault.key, fault.code) == (key, code)
    if problem is not None:
        assert fault.problem == problem


def test_tables_within_a_table_are_asked_for_contradictions_too() -> None:
    faults = faults_of(level=7.0, pierced={"hole": 1.0}, more=[{}, {"hole": 1.0}])
    assert [fault.key for fault in faults] == ["whole.level", "whole.pierced.hole", "whole.more[1].hole"]


def test_long_values_are_cut_to_sixty_characters() -> None:
    (fault,) = faults_of(level=80 * "c")
    assert fault.problem.endswith("found '" + 56 * "c" + "...")
    (whole,) = faults_of(level=58 * "c")
    assert whole.problem.endswith("found '" + 58 * "c" + "'")


def test_an_unknown_key_and_an_unknown_kind_name_the_nearest() -> None:
    (fault,) = faults_of(levle=1.0)
    assert (fault.key, fault.code) == ("whole.levle", FaultCode.UNKNOWN)
    assert fault.problem.startswith("unknown key")
    assert "`level`" in fault.problem
    (fault,) = faults_of(shape={"kind": "sqare", "side": 1.0})
    assert (fault.key, fault.code) == ("whole.shape.kind", FaultCode.VALUE)
    assert "square" in fault.problem


def test_rows_are_known_by_number_and_name_and_sound_ones_are_kept() -> None:
    faults: list[Fault] = []
    rows = declared_rows(
        {"whole": [{"name": "a"}, {"name": "b", "level": "x"}, {"level": 1.0}]}, "whole", Whole, faults
    )
    assert [(where, one.name) for where, one in rows.sound] == [((Row("whole", "a", 0),), "a")]
    assert [fault.key for fault in faults] == ["whole[1] 'b'.level", "whole[2].name"]
    for tables in ({}, {"whole": []}, {"whole": {}}, {"whole": [1]}):
        faults = []
        assert declared_rows(tables, "whole", Whole, faults).rows == ()
        assert [str(fault) for fault in faults] == ["whole: at least one table [[whole]] is needed"]


@dataclass(frozen=True)
class Kept:
    """What the program wrote."""

    number: int
    level: float
    __pydantic_config__ = STRICT


def test_what_the_program_wrote_is_read_as_strictly() -> None:
    assert checked(Kept, {"number": 3, "level": 1.5}) == checked(Kept, {"number": 3, "level": 1.5}) == Kept(3, 1.5)
    for document, fault in (
        ({"number": "3", "level": 1.0}, "number must be a whole number"),
        ({"number": 3}, "level is missing"),
        ({"number": 3, "level": 1.0, "more": 1}, "more is unknown"),
        ({"number": 3, "level": math.nan}, "level must be a finite number"),
    ):
        with pytest.raises(ValueError, match=fault):
            checked(Kept, document)


def test_a_key_that_is_misspelt_hides_nothing_else_of_its_row() -> None:
    rows: list[dict[str, Any]] = [
        {"name": "a", "levle": 1.0, "level": 2.0},
        {
            "name": "b",
            "parts": [{"size": 1.0}, {"size": 2.0, "sizes": 3.0}],
            "shape": {"kind": "round", "radius": 1.0, "r": 2.0},
        },
        {"name": "c", "level": "high", "levle": 1.0},
        {"name": "d"},
    ]
    faults: list[Fault] = []
    read = declared_rows({"whole": rows}, "whole", Whole, faults)
    assert [one.name for _, one in read.sound] == ["d"]
    assert read.names == ["a", "b", "c", "d"]
    assert [(where, one.name) for where, one in read.legible] == [
        ((Row("whole", "a", 0),), "a"), ((Row("whole", "b", 1),), "b"), ((Row("whole", "d", 3),), "d"),
    ]  # fmt: skip
    assert (read.legible[0][1].level, len(read.legible[1][1].parts)) == (2.0, 2)
    assert len(faults) == 5
    assert rows[0] == {"name": "a", "levle": 1.0, "level": 2.0}
