"""The cut in another process gives what the cut in this one gives, and its faults come back as one line."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from recoil_acquisition.capture import cut_process
from recoil_acquisition.capture.cut import take_name, write_captures
from recoil_acquisition.capture.cut_process import cut_apart
from recoil_acquisition.capture.session_record import KINDS, LiveRecord, RecordedSource
from recoil_acquisition.devices.device import event_block
from recoil_acquisition.errors import StoreError
from recoil_acquisition.journal import JournalWriter, read_journal
from tests.builders.live_sources import ANCHOR, can_block, can_record, serial_block, serial_frame

RECORD = LiveRecord(
    "rig", "text", "rig.toml", {}, ANCHOR, (RecordedSource("bus", "can"), RecordedSource("port", "serial"))
)
SPAN_NS = int(11e9), int(12e9)


@pytest.fixture
def journal(tmp_path: Path) -> Path:
    """Two minutes in many small segments."""
    folder = tmp_path / "journal"
    with JournalWriter(folder, RECORD.to_json(), 0, segment_bytes=1 << 14) as writer:
        for k in range(1200):
            t = 10.0 + 0.1 * k
            blocks = [can_block(t, can_record(t, 1.0, k)), serial_block(t, serial_frame(k, 1.0))]
            blocks += [event_block("port", round(t * 1e9), "reopened", "x")] if k == 15 else []
            for block in blocks:
                writer.append(RECORD.number(block.source), KINDS.index(block.kind), block.host_ns, block.payload)
    return folder


def test_it_is_the_same_as_here(journal: Path, tmp_path: Path) -> None:
    here = write_captures(read_journal(journal), RECORD, tmp_path / "here", "0001", *SPAN_NS)
    there = cut_apart(journal, tmp_path / "there", "0001", *SPAN_NS)
    assert [(c.blocks, c.bytes, c.events) for c in there.values()] == [
        (c.blocks, c.bytes, c.events) for c in here.values()
    ]
    for name, cut in there.items():
        mine = here[name].file
        assert cut.file is not None
        assert mine is not None
        assert cut.file.read_bytes() == mine.read_bytes()
    assert there["port"].events[0][1].name == "reopened"


def test_only_segments_of_the_span_are_read(journal: Path) -> None:
    whole, part = read_journal(journal), read_journal(journal, *SPAN_NS)
    assert len(part.segments) < len(whole.segments) / 2
    wanted = [r.sequence for r in whole.records(None, *SPAN_NS)]
    assert [r.sequence for r in part.records(None, *SPAN_NS)] == wanted
    late = read_journal(journal, int(128e9), None)
    assert [r.sequence for r in late.records(None, int(128e9))] == [r.sequence for r in whole.records(None, int(128e9))]


def test_what_an_earlier_attempt_left_is_made_anew(journal: Path, tmp_path: Path) -> None:
    (tmp_path / ".0001.cut").mkdir()
    (tmp_path / ".0001.cut" / "half").write_text("x")
    cuts = cut_apart(journal, tmp_path / ".0001.cut", "0001", *SPAN_NS)
    assert sorted(path.name for path in (tmp_path / ".0001.cut").iterdir()) == ["0001_bus.rdcc", "0001_port.rdsc"]
    take_name(tmp_path / ".0001.cut", tmp_path / "0001")
    assert (tmp_path / "0001" / "0001_bus.rdcc").exists()
    assert cuts["bus"].blocks == 13
    (tmp_path / "other").mkdir()
    with pytest.raises(StoreError, match="exist already"):
        take_name(tmp_path / "0001", tmp_path / "other")


def test_a_fault_comes_back_as_one_line(tmp_path: Path) -> None:
    with pytest.raises(StoreError, match="holds no journal"):
        cut_apart(tmp_path, tmp_path / "out", "0001", *SPAN_NS)
    assert not (tmp_path / "out").exists()


@pytest.mark.skipif(os.name == "nt", reason="Windows keeps the number of a parent that has ended")
def test_nothing_is_made_for_an_acquisition_that_has_ended(
    journal: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    nobody = os.getppid() + 1
    cut_process.main([str(journal), str(tmp_path / "out"), "0001", *map(str, SPAN_NS), str(nobody)])
    assert "the acquisition has ended meanwhile" in capsys.readouterr().out
    assert [path.name for path in tmp_path.iterdir()] == ["journal"]
