"""`check --devices --keep` writes all that a recorder says, whole or not at all, and what it wrote plays back."""

from __future__ import annotations

import errno
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from recoil_acquisition.errors import DeviceError, StoreError
from recoil_daq.cli import app
from recoil_daq.live import device_check
from recoil_daq.live.device_check import check_devices
from recoil_daq.live.first_contact import FirstContact
from recoil_rigs.rig import load_rig
from tests.builders.kept_recorder import FirstContact as ReadContact
from tests.builders.kept_recorder import KeptRecorder
from tests.builders.recorder_rigs import UNITS, ramps, recorder_rig


@pytest.mark.real_time
def test_what_is_kept_of_a_recorder_plays_it_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(device_check, "KEPT_S", 3.0)
    recorder, path = ramps(), tmp_path / "contact.jsonl"
    recorder.plug()
    try:
        with FirstContact(path) as contact:
            first = check_devices(recorder_rig(recorder.device), listen_s=0.5, keep=contact)
    finally:
        recorder.unplug()
    assert {one.channel for one in first} == {"acc_recoil", "acc_carriage_x", "acc_carriage_y", "p_breech"}
    kept = ReadContact.read(path)
    assert (kept.head["rig"], kept.head["source"]) == ("mixed", "dewetron")
    assert kept.items == [*UNITS]
    assert kept.stream[-1].at_s > 2.5, "it is listened to for longer than it is judged"
    stream = b"".join(one.data for one in kept.stream)
    assert stream.startswith(b"OXYGEN Data Stream")
    assert len(stream) > 4 * 3 * 2000
    with KeptRecorder(kept) as again:
        second = check_devices(recorder_rig(again.device), listen_s=0.5)
        assert again.unanswered == []
    assert [one.channel for one in second] == [one.channel for one in first]
    assert [one.rate_hz for one in second] == pytest.approx([2000.0] * 4, rel=0.3)
    assert np.isfinite([one.mean for one in second]).all()


@pytest.mark.real_time
def test_a_recorder_that_cannot_be_opened_leaves_what_it_said(tmp_path: Path) -> None:
    recorder, path = ramps(dict(list(UNITS.items())[:3])), tmp_path / "contact.jsonl"
    recorder.plug()
    try:
        with FirstContact(path) as contact:
            (heard,) = check_devices(recorder_rig(recorder.device), listen_s=0.1, keep=contact)
    finally:
        recorder.unplug()
    assert heard.verdict == "fail"
    assert "'AI 4/p_breech'" in heard.finding
    kept = ReadContact.read(path)
    assert (":CHANNEL:NAMES?", 1) in [(asked, len(replies)) for asked, replies in kept.exchanges]


def test_text_that_is_none_is_kept_as_bytes(tmp_path: Path) -> None:
    path = tmp_path / "contact.jsonl"
    with FirstContact(path) as contact:
        contact.begin("own", "daq")
        contact.heard("scpi", "recorder", b"\xff\xfe")
        contact.heard("scpi", "host", 'says "Weg °C"'.encode())
        contact.heard("stream", "recorder", bytes(range(256)))
    head, *rows = map(json.loads, path.read_text(encoding="utf-8").splitlines())
    assert head["schema"] == "recoil-daq/first-contact/1"
    assert [sorted(row) for row in rows] == [
        ["at_s", "base64", "from", "link"], ["at_s", "from", "link", "text"], ["at_s", "base64", "from", "link"]
    ]  # fmt: skip
    assert [one.data for one in ReadContact.read(path).lines] == [
        b"\xff\xfe", 'says "Weg °C"'.encode(), bytes(range(256))
    ]  # fmt: skip


def spoilt(path: Path, write: Callable[[FirstContact], None]) -> None:
    with FirstContact(path) as contact:
        contact.begin("own", "daq")
        write(contact)


def interrupted(_: FirstContact) -> None:
    raise KeyboardInterrupt


def on_a_full_disk(contact: FirstContact) -> None:
    class Full:
        def write(self, _: str) -> None:
            raise OSError(errno.ENOSPC, "No space left on device")

        def close(self) -> None:
            pass

    assert contact._stream is not None
    contact._stream.close()
    contact._stream = Full()  # type: ignore[assignment]
    contact.heard("stream", "recorder", b"1")
    contact.heard("stream", "recorder", b"2")


def test_a_file_that_is_there_is_replaced_only_when_asked(tmp_path: Path) -> None:
    path = tmp_path / "contact.jsonl"
    path.write_text("mine")
    with pytest.raises(StoreError, match="the file exists already"):
        spoilt(path, interrupted)
    assert path.read_text() == "mine"
    with FirstContact(path, overwrite=True) as contact:
        contact.begin("own", "daq")
    assert "first-contact" in path.read_text()
    assert [*tmp_path.iterdir()] == [path]


def test_what_was_said_before_an_interruption_is_kept_and_a_file_that_lacks_something_is_none(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt):
        spoilt(tmp_path / "contact.jsonl", interrupted)
    assert ReadContact.read(tmp_path / "contact.jsonl").lines == ()
    with pytest.raises(StoreError, match="cannot be written: No space left on device"):
        spoilt(tmp_path / "full.jsonl", on_a_full_disk)
    with pytest.raises(StoreError, match="cannot be written"):
        spoilt(tmp_path / "none" / "contact.jsonl", interrupted)
    assert [*tmp_path.iterdir()] == [tmp_path / "contact.jsonl"]


@pytest.mark.whole_way
def test_a_rig_without_a_recorder_has_nothing_to_keep(tmp_path: Path) -> None:
    path = tmp_path / "contact.jsonl"
    contact = FirstContact(path)
    with contact, pytest.raises(DeviceError, match="has no recorders whose commands"):
        check_devices(load_rig("mixed"), listen_s=0.1, keep=contact)
    assert [*tmp_path.iterdir()] == []
    result = CliRunner().invoke(app, ["check", "mixed", "--keep", str(path)])
    assert result.exit_code == 2
    assert "--devices" in result.stderr
