"""A source of error is its name, and keeps its kind beside it."""

from __future__ import annotations

import copy
import pickle

from recoil_processing.shot.error_source import ErrorSource, SourceKind


def test_every_kind_has_a_name_of_its_own() -> None:
    named = {str(ErrorSource(kind, "p_breech", "5")): kind for kind in SourceKind}
    # a declared area, length and parameter are each called by their symbol
    assert len(named) == len(SourceKind) - 2
    assert "" not in named


def test_a_source_is_its_name_as_budgets_print_it() -> None:
    assert ErrorSource(SourceKind.ALIGNMENT, "camera") == "alignment of clock camera"
    assert ErrorSource(SourceKind.MOVING_ZERO, "brake_pressure", "30") == "brake_pressure zero that moves in 30 ms"
    assert ErrorSource(SourceKind.FORCE_SCALE, "brake_pressure") == "brake_pressure sensitivity and area"


def test_its_kind_survives_another_process_and_a_copy() -> None:
    source = ErrorSource(SourceKind.REPAIR, "breech_pressure", "hum")
    for again in (pickle.loads(pickle.dumps(source)), copy.deepcopy(source)):  # noqa: S301  # what the test is about
        assert (again, again.kind, again.of, again.detail) == (source, SourceKind.REPAIR, "breech_pressure", "hum")
    assert not source.is_of_time
    assert ErrorSource(SourceKind.DELAY, "brake_pressure").is_of_time
    assert [ErrorSource(kind, "p").is_late_alone for kind in (SourceKind.DELAY, SourceKind.LINE)] == [False, True]
