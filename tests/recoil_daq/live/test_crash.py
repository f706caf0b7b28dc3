"""An armed acquisition that is killed, ended or runs out of disk: what was captured is there, and recovers.

Every process here is the real command; it is played to over a pseudo-terminal and a multicast bus from this process.
"""

from __future__ import annotations

import contextlib
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from typer.testing import CliRunner

from recoil_acquisition.capture.cut import acquisition_in
from recoil_acquisition.capture.session_record import operator_records
from recoil_acquisition.log.folder import find_logs, open_log
from recoil_daq.cli import app
from tests.builders.live_rigs import (
    AT_THE_TRIGGER_NS,
    GRACE_NS,
    HELD_BACK,
    LEAST_DUE,
    PRE_S,
    SEGMENTS_OF_256_KIB,
    UNDECIDED,
    Armed,
    Killed,
    LiveProcess,
    armed,
    kill,
    kill_and_recover,
    recovered,
    run_recover,
    write_live_rig,
)
from tests.builders.port_player import FRAME_BYTES, PortPlayer

pytestmark = [
    pytest.mark.real_time,
    pytest.mark.skipif(not sys.platform.startswith("linux"), reason="needs pseudo-terminals and SIGKILL"),
]


CHOICE = random.Random()  # noqa: S311 - a test's choice of moments, no secret; different ones at every run


def while_armed(_: Armed) -> None:
    time.sleep(CHOICE.uniform(0.7, 1.1))


def within_a_shot(one: Armed) -> None:
    time.sleep(0.3)
    one.port.fire()
    time.sleep(CHOICE.uniform(0.4, 0.55))


def while_cutting(one: Armed) -> None:
    one.port.fire()
    one.process.wait_for("captures being written", one.cutting)


def assert_nothing_is_lost(done: Killed, shots: int) -> None:
    print(f"due: {done.port.due} of {done.port.sent} sent to the port, {done.bus.due} of {done.bus.sent} to the bus;")
    print(f"lost the last {1e3 * done.tail_s:.0f} ms, the machine let it wait for {1e3 * done.waited_s:.0f} ms")
    assert min(done.port.due, done.bus.due) > LEAST_DUE
    assert done.port.sound, done.port
    assert done.bus.sound, done.bus
    assert (done.shots_due, done.shots_found, done.shots_wrong, done.shots) == (shots, shots, 0, shots), done
    assert done.shots_told <= shots


@pytest.mark.parametrize(("moment", "shots"), [(while_armed, 0), (while_cutting, 1)])
def test_a_kill_loses_nothing_that_was_sent_a_quarter_of_a_second_before(tmp_path, moment, shots):
    with armed(tmp_path / "live", warms=moment is while_cutting) as one:
        moment(one)
        done = kill_and_recover(one)
    assert_nothing_is_lost(done, shots)
    (journal,) = done.document["journals"]
    assert (journal["removed"], journal["in_order"], journal["lost_records"]) == (True, False, 0)
    assert not one.journal.exists()
    assert not list((one.out / "captures").glob(".*")), "something half-written was left behind"
    assert run_recover(one.out)["journals"] == []


def test_a_shot_on_which_the_trigger_had_not_decided_yet_is_recovered(tmp_path):
    with armed(tmp_path / "live", before=UNDECIDED) as one:
        within_a_shot(one)
        done = kill_and_recover(one)
    assert_nothing_is_lost(done, 1)
    assert done.shots_told == 0


def test_a_program_that_keeps_what_it_reads_a_little_late_is_seen_to_lose_it(tmp_path):
    with armed(tmp_path / "live", before=HELD_BACK) as one:
        one.process.wait_for("frames that are due", lambda: one.due > 1.5 * LEAST_DUE)
        killed_ns = one.process.kill()
    done = recovered(one, killed_ns, run_recover(one.out), waited_ns=0)
    assert min(done.port.due, done.bus.due) > LEAST_DUE
    with pytest.raises(AssertionError, match="lost="):
        assert_nothing_is_lost(done, 0)


def test_a_new_session_recovers_what_a_killed_one_left_over(tmp_path):
    with armed(tmp_path / "killed") as one:
        within_a_shot(one)
        killed_ns, waited_ns = kill(one)
    with armed(tmp_path / "next", out=one.out) as following:
        assert following.journal != one.journal
        assert find_logs(one.out) == (one.journal,)  # removing it is left to a person
        assert following.process.end(signal.SIGINT) == 130
    assert f"recovering {one.journal}" in following.process.said
    shot = one.out / "captures" / "0001.rdlog"
    everything = one.out / "recovered" / f"{one.journal.name}.rdlog"
    document = {"journals": [{"everything": everything, "shots": [{"capture": shot}]}]}
    done = recovered(one, killed_ns, document, waited_ns=waited_ns)
    assert_nothing_is_lost(done, 1)


def test_a_signal_ends_a_session_in_order(tmp_path):
    # the shot is recorded to its end: as long as a busy machine may take to send the signal within it
    with armed(tmp_path / "live", post_s=1.5) as one:
        pulse = one.port.fire()
        one.process.wait_for("trigger", lambda: "  trigger (imu_acc_x at " in one.process.said)
        signalled_ns = time.monotonic_ns()
        assert one.process.end(signal.SIGTERM) == 130, one.process.said
    capture = one.out / "captures" / "0001.rdlog"
    for source, player in (("imu", one.port), ("can", one.bus)):
        numbers, _ = player.numbers(capture, source)
        assert (numbers[1:] - numbers[:-1] == 1).all()
        assert numbers[-1] >= player.sent_before(signalled_ns) - 1, "what waited in the device was not read"
    assert one.port.numbers(capture, "imu")[0][0] < pulse
    journal = open_log(one.journal)
    known = operator_records(journal)
    assert known.in_order
    assert [shot.shot for shot in known.shots] == ["0001"]
    assert (journal.survey().damaged_bytes, journal.survey().lost_records) == (0, 0)
    (found,) = run_recover(one.out)["journals"]
    assert (found["in_order"], found["everything"], found["removed"]) == (True, None, True)
    assert [shot["was_there"] for shot in found["shots"]] == [True]


def test_leaving_at_once_keeps_the_journal_of_an_open_shot(tmp_path):
    with armed(tmp_path / "live", post_s=30.0) as one:
        one.port.fire()
        time.sleep(0.4)
        signalled_ns = time.monotonic_ns()
        one.process.process.send_signal(signal.SIGINT)
        time.sleep(0.05)
        assert one.process.end(signal.SIGINT) == 130, one.process.said
    run_recover(one.out)
    captures = [path for path in (one.out / "captures").glob("*.rdlog") if acquisition_in(path) is not None]
    assert len(captures) == 1, f"the shot is gone:\n{one.process.said}"
    numbers, _ = one.port.numbers(captures[0], "imu")
    assert (numbers[1:] - numbers[:-1] == 1).all()
    assert numbers[-1] >= one.port.sent_before(signalled_ns - GRACE_NS) - 1


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A disk of 4 MB."""
    disk = tmp_path / "disk"
    disk.mkdir()
    mount, umount = shutil.which("mount"), shutil.which("umount")
    if mount is None or umount is None or os.geteuid() != 0:
        pytest.skip("a disk that is really full needs a small file system of its own, and only root may mount one")
    done = subprocess.run([mount, "-t", "tmpfs", "-o", "size=4m", "tmpfs", str(disk)], capture_output=True, check=False)
    if done.returncode:
        pytest.skip(f"this system lets even root mount no small file system: {os.fsdecode(done.stderr).strip()}")
    try:
        yield disk
    finally:
        subprocess.run([umount, str(disk)], check=True)


def test_a_disk_without_room_is_refused_when_arming(tmp_path, small_disk):
    port = PortPlayer("port")
    rig = write_live_rig(tmp_path, [port.path])
    with LiveProcess(rig, small_disk / "out", tmp_path / "log.txt") as process:
        assert process.process.wait(20.0) == 3, process.said
    port.stop()
    assert "the disk has not enough room for the log" in process.said
    assert list(small_disk.iterdir()) == []


def test_a_disk_that_fills_up_ends_the_session_at_once_and_all_before_is_intact(tmp_path, small_disk):
    out = small_disk / "out"
    port = PortPlayer("port", 20_000.0, most=50)
    rig = write_live_rig(tmp_path, [port.path], pre_s=PRE_S, post_s=60.0, baudrate=9600)
    with LiveProcess(rig, out, tmp_path / "log.txt", before=SEGMENTS_OF_256_KIB) as process:
        folder = process.journal()
        with port:
            process.recording(folder)
            time.sleep(0.3)
            pulse = port.fire()  # of a shot that is open nothing is released: its room runs out
            filler = small_disk / "another program's file"
            with filler.open("wb") as stream:
                while free := shutil.disk_usage(small_disk).free:
                    with contextlib.suppress(OSError):  # the session took some of it meanwhile
                        os.posix_fallocate(stream.fileno(), os.fstat(stream.fileno()).st_size, free)
            assert process.process.wait(30.0) == 3, process.said
            ended_ns = time.monotonic_ns()
    assert "the log cannot be written: No space left on device" in process.said
    left = open_log(folder)
    last_ns = max(record.host_ns for record in left.records() if record.source < 2)
    survey = left.survey()
    assert (survey.damaged_bytes, survey.lost_records) == (0, 0)
    assert ended_ns - last_ns < 5e9, "it went on without a journal"

    refused = CliRunner().invoke(app, ["recover", str(out)])
    assert refused.exit_code == 3, refused.output
    assert "No space left on device" in refused.output
    assert not list((out / "captures").glob("*")), "half a capture was left behind"
    (journal,) = run_recover(out, "--out", tmp_path / "elsewhere")["journals"]
    assert (journal["records"], journal["removed"]) == (survey.records, True)
    (shot,) = journal["shots"]
    numbers, _ = port.numbers(Path(shot["capture"]), "imu")
    assert (numbers[1:] - numbers[:-1] == 1).all()
    assert numbers[0] <= port.sent_before(port.returned_ns[pulse] - round(PRE_S * 1e9) + AT_THE_TRIGGER_NS)
    assert numbers[-1] >= port.sent_before(last_ns - GRACE_NS) - 1
    assert numbers.size * FRAME_BYTES > 1 << 17, "the space that was reserved was not used"
