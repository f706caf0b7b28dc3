"""Every number that people ask for has a formula, a source, and inputs that are there."""

from __future__ import annotations

import platform
from fnmatch import fnmatchcase
from functools import cache
from typing import Any

import pytest

from recoil_acquisition.shot.shot import InputFile
from recoil_identification.report.document import formulas
from recoil_identification.report.document.document import report_document
from recoil_identification.report.document.explanation import EXPLAINED, Entry, explained, unit_of
from recoil_identification.report.document.report_files import computer, digest_of, sealed
from recoil_rigs.shots.fired_shot import FiredShot
from recoil_rigs.tables.issue import Issue
from tests.builders.virtual_shots import identified, virtual_shot

ISSUED = Issue(tolerance_kg=(-4.0, 4.0))
RIGS = ("mixed", "field-2013")


@cache
def document(rig: str) -> dict[str, Any]:
    file = InputFile("s1.h5", "ab" * 32, 123, "", "shot file")
    return report_document(virtual_shot(rig).shot, identified(rig), version="0.1.0", shot_file=file, issued=ISSUED)


def entries(rig: str, key: str | None = None) -> list[Entry]:
    found = list(explained(document(rig), key, FiredShot(virtual_shot(rig).shot, virtual_shot(rig).rig)))
    for entry in found:
        found += entry.parts
    return found


@pytest.mark.parametrize("rig", RIGS)
def test_every_number_that_is_explained_has_a_formula(rig: str) -> None:
    def bare(entry: Entry, formula: bool) -> list[str]:
        known = formula or entry.formula is not None
        if entry.parts:
            return [key for part in entry.parts for key in bare(part, known)]
        number = isinstance(entry.value, int | float) and not isinstance(entry.value, bool)
        # degrees of freedom and drifts are no quantities
        return [entry.key] if number and not known and not entry.key.endswith("degrees_of_freedom") else []

    top = explained(document(rig), None, FiredShot(virtual_shot(rig).shot, virtual_shot(rig).rig))
    assert [one.key for one in top] == [key for key in EXPLAINED if document(rig).get(key) is not None]
    without = [key for entry in top for key in bare(entry, False)]
    assert all(key.endswith("u_source") for key in without), without


@pytest.mark.parametrize("rig", RIGS)
def test_what_a_formula_is_made_of_is_in_the_report_the_shot_or_the_rig(rig: str) -> None:
    for entry in entries(rig):
        if entry.formula is None:
            continue
        assert entry.formula.source
        names = {given.name for given in entry.given}
        for key in entry.formula.inputs:
            # of a shot without a shot log there is no added mass
            assert key in names or key.startswith("shot_log"), (entry.key, key)
        for role in entry.formula.roles:
            channels = {f"channel {one.name}" for one in virtual_shot(rig).shot.with_role(role)}
            assert channels <= names or f".{role}" not in entry.key, (entry.key, role)


def test_every_formula_of_the_table_is_that_of_a_number() -> None:
    keys = {key for rig in RIGS for key in plain_keys(document(rig), "")}
    unused = [pattern for pattern, _ in formulas._TABLE if not any(fnmatchcase(key, pattern) for key in keys)]
    # what a shot may have and these have not, and what a campaign and a target have
    campaigns = {"mass.E_n", "mass.deviation_kg", "mass.deviation_percent"}
    campaigns |= {"budget.random errors of the shots.degrees_of_freedom"}
    campaigns |= {"agreement.*probability", "agreement.*factor", "agreement.*", "gauges.*"}
    targets = {"quantities.*.conformity.probability", "quantities.*.conformity.u_kg"}
    assert set(unused) <= {"budget.*zero that moves*.u_source"} | campaigns | targets


def plain_keys(value: Any, parent: str) -> list[str]:
    if isinstance(value, list) and value and isinstance(value[0], dict):
        value = {one.get("source", str(number)): one for number, one in enumerate(value)}
    if not isinstance(value, dict):
        return [parent]
    return [key for name, one in value.items() for key in plain_keys(one, f"{parent}.{name}" if parent else name)]


@pytest.mark.parametrize(
    ("key", "text"),
    [("mass.value", "m = m0 e^mu"), ("methods.reverse.mass_kg", "1/m = sum a F / sum F^2"),
     ("methods.paper.mass_kg", "m = sum a F / sum a^2, unfiltered"), ("E_n", "E_n = ")],
)  # fmt: skip
def test_each_method_has_its_own_formula(key: str, text: str) -> None:
    (entry,) = explained(document("mixed"), key, FiredShot(virtual_shot("mixed").shot, virtual_shot("mixed").rig))
    assert entry.formula is not None
    assert entry.formula.text.startswith(text)


def test_a_clocks_alignment_is_explained_with_what_the_rig_says_of_it() -> None:
    (entry,) = explained(
        document("mixed"), "alignment.can", FiredShot(virtual_shot("mixed").shot, virtual_shot("mixed").rig)
    )
    (given,) = entry.given
    assert given.name == "[[source]] can, align"
    assert given.value == {"method": "redundant", "channel": "acc_recoil_can", "against": "acc_recoil"}


def test_the_kind_of_computer_is_stated_and_its_name_is_not() -> None:
    found = computer()
    assert found == computer()
    assert found["python"] == platform.python_version()
    assert found["simd"]
    assert "openblas" in found["blas"] or found["blas"]
    assert platform.node() not in " ".join(found.values()).split()


def test_a_report_bears_the_digest_of_itself() -> None:
    report = document("mixed")
    assert report["provenance"]["digest"] == digest_of(report)
    assert sealed(report) == report
    assert digest_of({**report, "valid": not report["valid"]}) != digest_of(report)


@pytest.mark.parametrize(
    ("key", "unit"),
    [("E_n", ""), ("mass.u", "kg"), ("peaks.impulse_n_s", "N s"), ("could_hide.packing friction.largest_error", "N"),
     ("could_hide.camera scale.largest_error", ""), ("could_hide.camera scale.mass_kg", "kg"),
     ("baseline.p_breech.noise", "Pa"), ("endogeneity.bias_percent", "%")],
)  # fmt: skip
def test_a_number_has_the_unit_of_what_it_is_of_and_a_ratio_has_none(key: str, unit: str) -> None:
    assert unit_of(key, document("field-2013")) == unit
