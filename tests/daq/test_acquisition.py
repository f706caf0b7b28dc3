"""What a live shot tells of its acquisition survives the file, and a damaged file is refused."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from recoil_acquisition.acquisition import (
    AcquiredEvent,
    AcquiredSource,
    Acquisition,
    TriggerDecision,
    is_acquisition,
    read_acquisition,
    write_acquisition,
)
from recoil_acquisition.errors import CorruptFileError, StoreError

ACQUISITION = Acquisition(
    shot="0001",
    rig="mixed",
    trigger_ns=5_000_000_000,
    trigger_utc="2026-05-04T10:11:12.123456",
    pre_s=0.5,
    post_s=1.0,
    pre_actual_s=0.4,
    duration_s=1.5,
    decisions=(
        TriggerDecision(-0.1, "suppressed", "within the holdoff of the last trigger", "p_brake", 2e6),
        TriggerDecision(0.0, "trigger", "", "", None),
    ),
    sources=(
        AcquiredSource(
            "can", "can", "0001_can.rdcc", 100, 8800, 0.4, False, 0.002, 0, 1, 2, None, 12, -0.7,
            (AcquiredEvent(0.2, "lost", "the adapter is gone"),),
        ),
    ),
)  # fmt: skip


def test_it_reads_back_as_it_was_written(tmp_path: Path) -> None:
    path = tmp_path / "0001_acquisition.json"
    write_acquisition(ACQUISITION, path)
    assert is_acquisition(path)
    assert read_acquisition(path) == ACQUISITION


def test_it_is_never_overwritten(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_text("mine")
    with pytest.raises(StoreError, match=r"a\.json: cannot be written"):
        write_acquisition(ACQUISITION, path)
    assert path.read_text() == "mine"
    assert not is_acquisition(path)
    assert not is_acquisition(tmp_path / "none")


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda d: d.pop("trigger_ns"), "trigger_ns"),
        (lambda d: d.update(more=1), "more"),
        (lambda d: d.update(pre_s="1"), "pre_s must be of type float"),
        (lambda d: d.update(recovered=1), "recovered must be of type bool"),
        (lambda d: d.update(sources=3), "sources must be a list"),
        (lambda d: d["sources"][0].update(events=[4]), r"sources\[0\].events\[0\] must be an object"),
        (lambda d: d.update(schema="other"), "schema"),
    ],
)
def test_a_damaged_one_is_refused_with_the_place(tmp_path: Path, change, says) -> None:
    document = json.loads(json.dumps(ACQUISITION.to_json()))
    change(document)
    path = tmp_path / "a.json"
    path.write_text(json.dumps(document))
    with pytest.raises(CorruptFileError, match=says):
        read_acquisition(path)


@pytest.mark.parametrize("content", [b"", b"[]", b"\xff\xfe", b'{"schema": "recoil-daq/acquisition/1"', b"[" * 100_000])
def test_what_is_no_json_object_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "a.json"
    path.write_bytes(content)
    with pytest.raises(CorruptFileError):
        read_acquisition(path)
