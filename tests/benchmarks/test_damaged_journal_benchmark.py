"""Damaged journals: none is removed while anything in it is nowhere else, and nothing is said that is not so."""

from __future__ import annotations

import os
import random
import shutil
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import pytest

from recoil_acquisition.capture.session_record import CLOSED, DECISION, KINDS, OPERATOR, pack_decision
from recoil_acquisition.devices.device import SERIAL
from recoil_acquisition.errors import StoreError
from recoil_acquisition.frames import capture_file
from recoil_acquisition.journal import JournalWriter, read_journal
from recoil_acquisition.journal.layout import RECORD_OVERHEAD
from recoil_acquisition.trigger import Decision
from recoil_daq.recover import Recovered, recover_journal
from tests.recoil_daq.test_recover import NAME, RECORD

JOURNALS = int(os.environ.get("RECOIL_DAQ_DAMAGED_JOURNALS", "300"))
RECORDS = 1500
PAGE = 4096


@pytest.fixture(autouse=True)
def _only_when_asked_for(request):
    if not request.config.getoption("benchmark_enable"):
        pytest.skip("a benchmark of minutes: ask for it with --benchmark-enable")


@dataclass(frozen=True)
class Place:
    """Where a record of the port lies, and what it holds."""

    segment: str
    begin: int
    end: int
    payload: bytes


def text_of(number: int) -> bytes:
    return f"{number:8d}".encode() + bytes([number % 251 + 1]) * (number * 37 % 150)


def write(folder: Path, *, closed: bool, crossed: bool) -> list[Place]:
    """Write a journal of one port with a shot, and a crossing while disarmed; return where each record is."""
    source = RECORD.number("imu")
    with JournalWriter(folder, RECORD.to_json(), 0, segment_bytes=1 << 16) as writer:
        for k in range(RECORDS):
            host_ns = 10_000_000_000 + k * 2_000_000
            writer.append(source, KINDS.index(SERIAL), host_ns, text_of(k), empty_ns=host_ns - 2_000_000)
        for time_s, outcome in ((11.0, "trigger"), (12.5, "suppressed"))[: 1 + crossed]:
            reason = "" if outcome == "trigger" else "not armed"
            decision = Decision(time_s, outcome, reason, "p_brake", 0, 1, 2e6, time_s)
            writer.append(OPERATOR, DECISION, round(time_s * 1e9), pack_decision(decision))
        if closed:
            writer.append(OPERATOR, CLOSED, int(17e9), b"{}")
    places = []
    for segment in read_journal(folder).segments:
        at = segment.header.size
        for sequence in range(segment.first_sequence, segment.last_sequence + 1):
            if sequence >= RECORDS:
                break
            end = at + RECORD_OVERHEAD + len(text_of(sequence))
            places.append(Place(segment.path.name, at, end, text_of(sequence)))
            at = end
    return places


def damage(folder: Path, choice: random.Random) -> tuple[str, dict[str, list[tuple[int, int]]]]:
    """Damage a journal; return how, and the bytes of each segment that are not what they were."""
    path = choice.choice(sorted(folder.glob("*.journal")))
    content = bytearray(path.read_bytes())
    before = bytes(content)
    kind = choice.choice(["bit", "bits", "page", "truncated", "zeroed tail", "missing segment", "noise"])
    at = choice.randrange(len(content))
    if kind == "bit":
        content[at] ^= 1 << choice.randrange(8)
    elif kind == "bits":
        for _ in range(3):
            content[choice.randrange(len(content))] ^= 1 << choice.randrange(8)
    elif kind == "page":
        page = at // PAGE * PAGE
        content[page : page + PAGE] = bytes(len(content[page : page + PAGE]))
    elif kind == "truncated":
        del content[at:]
    elif kind == "zeroed tail":
        content[at:] = bytes(len(content) - at)
    elif kind == "noise":
        content[at : at + 200] = choice.randbytes(len(content[at : at + 200]))
    if kind == "missing segment":
        path.unlink()
        return kind, {path.name: [(0, len(before))]}
    path.write_bytes(content)
    changed = [i for i in range(len(before)) if i >= len(content) or before[i] != content[i]]
    spans: list[tuple[int, int]] = []
    for i in changed:
        if spans and i <= spans[-1][1] + 8:
            spans[-1] = (spans[-1][0], i + 1)
        else:
            spans.append((i, i + 1))
    return kind, {path.name: spans}


def held(done: Recovered) -> set[bytes]:
    """Return every text that the captures of a recovery hold."""
    folders = [shot.folder for shot in done.shots] + ([] if done.everything is None else [done.everything])
    texts = set()
    for folder in folders:
        for path in folder.glob("*_imu.rdsc"):
            capture = capture_file.parse_capture(path.read_bytes())
            begin = 0
            for end in capture.ends.tolist():
                texts.add(capture.stream[begin:end])
                begin = end
    return texts


def test_no_damaged_journal_goes_while_anything_of_it_is_nowhere_else(tmp_path, capsys):
    choice = random.Random(300)  # noqa: S311 - a test's choice of damages, no secret
    kinds, kept, unreadable, removed, faults = Counter(), 0, 0, 0, []
    whole = {(a, b): tmp_path / f"whole-{a}-{b}" for a in (False, True) for b in (False, True)}
    places = {key: write(folder, closed=key[0], crossed=key[1]) for key, folder in whole.items()}
    for i in range(JOURNALS):
        closed, crossed = i % 3 == 0, i % 2 == 0
        key = closed, crossed
        out = tmp_path / "out"
        folder = out / "journal" / NAME
        shutil.copytree(whole[key], folder)
        kind, changed = damage(folder, choice)
        kinds[kind] += 1
        sound = {
            place.payload
            for place in places[key]
            if not any(begin < place.end and place.begin < end for begin, end in changed.get(place.segment, ()))
        }
        try:
            done = recover_journal(folder, out)
        except StoreError as error:
            unreadable += 1
            if not folder.exists():
                faults.append(f"{i} {kind}: removed although {error}")
            shutil.rmtree(out)
            continue
        texts = held(done)
        if folder.exists():
            kept += 1
            texts |= {record.payload for record in read_journal(folder).records(RECORD.number("imu"))}
        else:
            removed += 1
            if any(changed.values()) and kind not in (
                "truncated",
                "zeroed tail",
                "missing segment",
            ):
                faults.append(f"{i} {kind}: damaged and removed")
        if sound - texts:
            faults.append(f"{i} {kind}: {len(sound - texts)} sound records are nowhere")
        if texts - {place.payload for place in places[key]}:
            faults.append(f"{i} {kind}: a record came back that was never written")
        total = RECORDS + 1 + crossed + closed
        if done.lost_records > total - done.records:
            faults.append(f"{i} {kind}: {done.lost_records} missing are said, {total - done.records} are")
        if any(changed.values()) and not done.damaged and done.records != total and done.in_order:
            faults.append(f"{i} {kind}: {total - done.records} records are missing and nothing is said")
        shutil.rmtree(out)
    with capsys.disabled():
        print(f"\n{JOURNALS} damaged journals: {dict(kinds)}")
        print(f"  {kept} kept, {unreadable} refused and kept, {removed} removed with every record of them in captures")
    assert not faults, "\n".join(faults[:20])
