"""The cut in another process gives what the cut in this one gives, and its faults come back as one line."""

from __future__ import annotations

import io
import json
import os
from pathlib import Path

import pytest

from recoil_acquisition.capture import cut_process
from recoil_acquisition.capture.cut import acquisition_in, write_shot
from recoil_acquisition.capture.cut_process import cut_apart
from recoil_acquisition.capture.session_record import LiveRecord, RecordedSource
from recoil_acquisition.capture.shot_record import acquisition_of
from recoil_acquisition.devices.device import event_block
from recoil_acquisition.errors import StoreError
from recoil_acquisition.files.new_file import partial_path
from recoil_acquisition.log.folder import open_log
from recoil_acquisition.log.writer import LogWriter
from recoil_acquisition.trigger import Edge, ShotWindow, Trigger
from tests.builders.live_logs import append
from tests.builders.live_sources import ANCHOR, can_block, can_record, serial_block, serial_frame

RECORD = LiveRecord(
    "rig", "text", "rig.toml", {}, ANCHOR, (RecordedSource("bus", "can"), RecordedSource("port", "serial"))
)
SPAN_NS = int(11e9), int(12e9)
TRIGGER = Trigger((Edge("pressure", 5e4),), pre_s=0.5, post_s=0.5)
BEGUN = acquisition_of("0001", RECORD, TRIGGER, ShotWindow(11.0, 11.5, 12.0, 0.5, {}, ()), {})


@pytest.fixture
def journal(tmp_path: Path) -> Path:
    """Two minutes in many small segments."""
    folder = tmp_path / "journal"
    with LogWriter(folder, RECORD.to_json(), 0, segment_bytes=1 << 14) as writer:
        for k in range(1200):
            t = 10.0 + 0.1 * k
            blocks = [can_block(t, can_record(t, 1.0, k)), serial_block(t, serial_frame(k, 1.0))]
            blocks += [event_block("port", round(t * 1e9), "reopened", "x")] if k == 15 else []
            append(writer, RECORD, blocks)
    return folder


@pytest.mark.exhaustive
def test_it_is_the_same_as_here(journal: Path, tmp_path: Path) -> None:
    here = write_shot(open_log(journal), RECORD, tmp_path / "here" / "0001.rdlog", BEGUN, *SPAN_NS)
    there = cut_apart(journal, tmp_path / "there" / "0001.rdlog", BEGUN, *SPAN_NS)
    assert here == there == acquisition_in(tmp_path / "there" / "0001.rdlog")
    assert (tmp_path / "here" / "0001.rdlog").read_bytes() == (tmp_path / "there" / "0001.rdlog").read_bytes()
    assert [(s.name, s.blocks, [event.name for event in s.events]) for s in there.sources] == [
        ("bus", 13, []),
        ("port", 13, ["reopened"]),
    ]
    with pytest.raises(StoreError) as refused:
        cut_apart(journal, tmp_path / "there" / "0001.rdlog", BEGUN, *SPAN_NS)
    assert str(refused.value) == f"{tmp_path}/there/0001.rdlog: exists already; move it elsewhere"


@pytest.mark.exhaustive
def test_what_an_earlier_attempt_left_is_made_anew(journal: Path, tmp_path: Path) -> None:
    partial_path(tmp_path / "0001.rdlog").write_text("x")
    cut_apart(journal, tmp_path / "0001.rdlog", BEGUN, *SPAN_NS)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["0001.rdlog", "journal"]


@pytest.mark.exhaustive
def test_a_fault_comes_back_as_one_line(tmp_path: Path) -> None:
    with pytest.raises(StoreError, match="holds no log"):
        cut_apart(tmp_path, tmp_path / "out" / "0001.rdlog", BEGUN, *SPAN_NS)
    assert not (tmp_path / "out").exists()


@pytest.mark.skipif(os.name == "nt", reason="Windows keeps the number of a parent that has ended")
def test_nothing_is_made_for_an_acquisition_that_has_ended(
    journal: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        "sys.stdin", io.TextIOWrapper(io.BytesIO(json.dumps(BEGUN.to_json()).encode()), encoding="utf-8")
    )
    nobody = os.getppid() + 1
    cut_process.main([str(journal), str(tmp_path / "out"), *map(str, SPAN_NS), str(nobody)])
    assert "the acquisition has ended meanwhile" in capsys.readouterr().out
    assert [path.name for path in tmp_path.iterdir()] == ["journal"]
