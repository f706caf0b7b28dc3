"""Damaged logs of live sessions: none is removed while anything in it is nowhere else, and nothing untrue is said."""

from __future__ import annotations

import os
import random
import shutil
from collections import Counter
from dataclasses import asdict
from pathlib import Path

from recoil_acquisition.devices.device import SERIAL, Block
from recoil_acquisition.errors import StoreError
from recoil_acquisition.log.record import Kind
from recoil_acquisition.log.writer import LogWriter
from recoil_acquisition.trigger import Decision
from recoil_daq.live.recover import recover_journal
from tests.builders.damaged_logs import KINDS, damage
from tests.builders.left_journals import NAME, RECORD
from tests.builders.live_logs import append
from tests.builders.naive_log import read_folder

LOGS = int(os.environ.get("RECOIL_DAQ_DAMAGED_LOGS", "300"))
RECORDS = 1500
ENDS = ("truncated", "zeroed tail", "segment missing")
"""Damages that leave nothing behind: at the end of a log that was killed nothing tells of them."""


def text_of(number: int) -> bytes:
    return f"{number:8d}".encode() + bytes([number % 251 + 1]) * (number * 37 % 150)


def write(folder: Path, *, closed: bool, crossed: bool) -> dict[bytes, bytes]:
    """Write the log of one port with a shot, and a crossing while disarmed; return its records by their payloads."""
    writer = LogWriter(folder, RECORD.to_json(), 0, segment_bytes=1 << 17)
    for k in range(RECORDS):
        host_ns = 10_000_000_000 + k * 2_000_000
        append(writer, RECORD, [Block("imu", host_ns, text_of(k), SERIAL, host_ns - 2_000_000)])
    for time_s, outcome in ((11.0, "trigger"), (12.5, "suppressed"))[: 1 + crossed]:
        reason = "" if outcome == "trigger" else "not armed"
        decision = Decision(time_s, outcome, reason, "p_brake", 0, 1, 2e6, time_s)
        writer.say(Kind.DECISION, round(time_s * 1e9), asdict(decision))
    writer.close(in_order=closed)
    return {one.payload: one.content for one in read_folder(folder) if one.kind == Kind.SERIAL}


def test_no_damaged_log_goes_while_anything_of_it_is_nowhere_else(tmp_path, capsys):
    choice = random.Random(300)  # noqa: S311 - a test's choice of damages, no secret
    kinds, kept, unreadable, removed, faults = Counter(), 0, 0, 0, []
    whole = {(a, b): tmp_path / f"whole-{a}-{b}" for a in (False, True) for b in (False, True)}
    written = {key: write(folder, closed=key[0], crossed=key[1]) for key, folder in whole.items()}
    for i in range(LOGS):
        key = i % 3 == 0, i % 2 == 0
        out = tmp_path / "out"
        folder = out / "journal" / NAME
        shutil.copytree(whole[key], folder)
        kind = choice.choice(KINDS)
        damage(folder, choice, kind)
        kinds[kind] += 1
        left = b"".join(path.read_bytes() for path in sorted(folder.glob("*.rdlog")))
        sound = {payload for payload, content in written[key].items() if content in left}
        try:
            done = recover_journal(folder, out)
        except StoreError as error:
            unreadable += 1
            if not folder.exists():
                faults.append(f"{i} {kind}: removed although {error}")
            shutil.rmtree(out)
            continue
        copies = b"".join(path.read_bytes() for path in out.rglob("*.rdlog"))
        # of a session that ended in order and lacks nothing, what no shot has and nothing crossed in may go
        closed_and_whole = key[0] and len(sound) == RECORDS
        nowhere = [payload for payload in sound if written[key][payload] not in copies]
        if nowhere and not closed_and_whole:
            faults.append(f"{i} {kind}: {len(nowhere)} sound records are nowhere")
        if key[1] and not folder.exists() and (key[0] or kind not in ENDS):
            faults.append(f"{i} {kind}: removed with a crossing outside of every shot")
        kept, removed = kept + folder.exists(), removed + (not folder.exists())
        if not folder.exists() and len(sound) < RECORDS and (key[0] or kind not in ENDS):
            faults.append(f"{i} {kind}: {RECORDS - len(sound)} records are lost, and the log was removed")
        if done.lost_records > 0 and not done.losses:
            faults.append(f"{i} {kind}: what is lost is not named")
        if len(sound) < RECORDS and not done.damaged and key[0]:
            faults.append(f"{i} {kind}: {RECORDS - len(sound)} records are missing and nothing is said")
        shutil.rmtree(out)
    with capsys.disabled():
        print(f"\n{LOGS} damaged logs: {dict(kinds)}")
        print(f"  {kept} kept, {unreadable} refused and kept, {removed} removed with every record of them in captures")
    assert not faults, "\n".join(faults[:20])
