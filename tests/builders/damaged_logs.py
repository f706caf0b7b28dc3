"""Logs that are damaged at random, and what a reader must find in them, known without reading them."""

from __future__ import annotations

import random
import shutil
import time
from collections import Counter
from pathlib import Path

from recoil_acquisition.errors import StoreError
from recoil_acquisition.log import folder as folder_module
from recoil_acquisition.log.record import Kind
from recoil_acquisition.log.writer import LogWriter
from tests.builders.naive_log import Found, read_folder

SEGMENT_BYTES = 1 << 17
PAGE = 4096
KINDS = (
    "bit", "bits", "noise", "page zeroed", "pages swapped", "page missing", "page doubled", "truncated", "zeroed tail",
    "segment missing",
)  # fmt: skip


def write_log(folder: Path, records: int = 900, *, closed: bool = True) -> list[Found]:
    """Write a log of four sources over several segments; return its records, by the naive reader."""
    choice = random.Random(records)  # noqa: S311 - a test's choice of payloads, no secret
    writer = LogWriter(folder, {"rig": "name = 'stand'\n"}, 0, segment_bytes=SEGMENT_BYTES)
    for _ in range(records):
        source = choice.choice((0, 0, 1, 2, 3))
        size = (40, 700, 12, 3000)[source]
        now_ns = time.monotonic_ns()
        writer.append(source, Kind.SERIAL, now_ns, choice.randbytes(choice.randrange(size)), empty_ns=now_ns - 5000)
    writer.close(in_order=closed)
    return read_folder(folder)


def damage(folder: Path, choice: random.Random, kind: str) -> None:
    """Damage one segment of a log."""
    least = 2 * PAGE if kind == "pages swapped" else 1
    path = choice.choice([path for path in sorted(folder.glob("*.rdlog")) if path.stat().st_size >= least])
    content = bytearray(path.read_bytes())
    at = choice.randrange(len(content))
    page = at // PAGE * PAGE
    if kind == "bit":
        content[at] ^= 1 << choice.randrange(8)
    elif kind == "bits":
        for _ in range(20):
            content[choice.randrange(len(content))] ^= 1 << choice.randrange(8)
    elif kind == "noise":
        size = len(content[at : at + 300])
        content[at : at + size] = choice.randbytes(size)
    elif kind == "page zeroed":
        content[page : page + PAGE] = bytes(len(content[page : page + PAGE]))
    elif kind == "pages swapped":
        first, second = (number * PAGE for number in sorted(choice.sample(range(len(content) // PAGE), 2)))
        content[first : first + PAGE], content[second : second + PAGE] = (
            content[second : second + PAGE], content[first : first + PAGE],
        )  # fmt: skip
    elif kind == "page missing":
        del content[page : page + PAGE]
    elif kind == "page doubled":
        content[page:page] = content[page : page + PAGE]
    elif kind == "truncated":
        del content[at:]
    elif kind == "zeroed tail":
        content[at:] = bytes(len(content) - at)
    if kind == "segment missing":
        path.unlink()
    else:
        path.write_bytes(content)


def faults_of_reading(folder: Path, written: list[Found]) -> list[str]:
    """Return what a reader gets wrong of a log that is damaged.

    A record is sound if its bytes still stand somewhere in the files.
    """
    contents = [path.read_bytes() for path in sorted(folder.glob("*.rdlog"))]
    sound = {one.number: one for one in written if any(one.content in content for content in contents)}
    try:
        log = folder_module.open_log(folder)
        returned = list(log.records())
        survey = log.survey()
    except StoreError as error:
        return [] if not sound else [f"refused with {len(sound)} sound records: {error}"]
    faults = []
    numbers = [record.number for record in returned]
    if missing := sorted(set(sound) - set(numbers)):
        faults.append(f"{len(missing)} sound records are not returned, the first {missing[0]}")
    if len(set(numbers)) < len(numbers):
        faults.append(f"{len(numbers) - len(set(numbers))} are returned twice")
    if numbers != sorted(numbers):
        faults.append("not in order")
    wrong = [
        record
        for record in returned
        if record.number not in sound
        or (record.payload, record.source, record.source_number, record.position, record.host_ns)
        != (
            sound[record.number].payload, sound[record.number].source, sound[record.number].source_number,
            sound[record.number].position, sound[record.number].host_ns,
        )
    ]  # fmt: skip
    faults += [f"{len(wrong)} are wrong"] if wrong else []
    return faults + _faults_of_counts(survey, written, sound)


def _faults_of_counts(survey: folder_module.LogSurvey, written: list[Found], sound: dict[int, Found]) -> list[str]:
    faults = []
    lost = Counter(one.source for one in written if one.number not in sound)
    lost_bytes: Counter[int] = Counter()
    for one in written:
        lost_bytes[one.source] += len(one.payload) * (one.number not in sound)
    ended = [one for one in written if one.kind == Kind.CLOSED and one.number in sound]
    for source in {one.source for one in written}:
        said = sum(loss.records for loss in survey.losses if loss.source == source)
        said_bytes = sum(loss.bytes for loss in survey.losses if loss.source == source)
        last = max(one.number for one in written if one.source == source)
        exact = (bool(ended) and source != 0xFFFF) or last in sound
        if said > lost[source] or said_bytes > lost_bytes[source]:
            faults.append(f"source {source}: {said} lost are said, {lost[source]} are")
        if exact and (said, said_bytes) != (lost[source], lost_bytes[source]):
            faults.append(f"source {source}: {said} lost, {said_bytes} bytes are said; {lost[source]}, {lost_bytes}")
    if survey.closed != bool(ended):
        faults.append(f"closed is said to be {survey.closed}")
    # what follows the first totals is the log's own and says the same again
    until = min((one.number for one in written if one.kind == Kind.CLOSED), default=0)
    if any(one.number not in sound for one in written[:until]) and not survey.damaged and ended:
        faults.append("records are lost and nothing is said")
    return faults


def faults_of_trials(
    whole: Path, written: list[Found], into: Path, trials: int, seed: int
) -> tuple[list[str], Counter]:
    """Damage copies of a log one to three times each; return what a reader gets wrong, and each damage by count."""
    choice = random.Random(seed)  # noqa: S311 - a test's choice of damages, no secret
    faults: list[str] = []
    kinds: Counter[str] = Counter()
    for trial in range(trials):
        shutil.copytree(whole, into)
        done = [choice.choice(KINDS) for _ in range(choice.randint(1, 3))]
        for kind in done:
            if any(path.stat().st_size >= 2 * PAGE for path in into.glob("*.rdlog")):
                damage(into, choice, kind)
        kinds.update(done)
        faults += [f"trial {trial}, {', '.join(done)}: {fault}" for fault in faults_of_reading(into, written)]
        shutil.rmtree(into)
    return faults, kinds
