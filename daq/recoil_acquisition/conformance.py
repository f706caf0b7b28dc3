"""Rules that every reader keeps, one function each, for the readers of this package and of others.

A rule takes a `Case`, which is a reader with one of its files, and a folder to write in, and raises `BrokenRuleError`
if the reader breaks it::

    CASE = Case("itx", ItxReader(), CONTENT, Declarations("dewetron"), {"force": (0.0, 5e3)})

    @pytest.mark.parametrize("rule", RULES)
    def test_the_reader_keeps(rule, tmp_path):
        rule(CASE, tmp_path)
"""

from __future__ import annotations

import json
import random
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recoil_acquisition.errors import MissingChannelError, ReadError
from recoil_acquisition.readers.head import HEAD_BYTES, Head
from recoil_acquisition.readers.reader import Declarations, Reader
from recoil_acquisition.readers.recording import Recording

LIMIT_S = 20.0
"""Time after which a reader of a small file is taken to hang."""

Flips = Sequence[tuple[float, int]]
"""Places, as shares of the file, and the bytes that are written there."""

_RANDOM = random.Random(7)  # noqa: S311 - damage that can be repeated
FLIPS: tuple[Flips, ...] = tuple(
    tuple((_RANDOM.random(), _RANDOM.randrange(256)) for _ in range(1 + i % 6)) for i in range(40)
)
"""Damage that `flipped_bytes_are_refused_or_read` does if it is given none."""

_EVERYWHERE_BYTES, _PLACES = 25, 70

STATEMENTS = ("scale", "offset", "unit", "range", "lost", "counter")
"""Statements of which a file may hold one too many: a factor, an offset, another unit, a range that samples leave, a
code for lost samples, and a column that counts the rows and shows that some are missing."""


class BrokenRuleError(AssertionError):
    """A reader breaks a rule.

    Attributes
    ----------
    check
        Check that failed.
    """

    def __init__(self, check: str, detail: str) -> None:
        self.check = check
        super().__init__(f"{check}: {detail}")


def _require(kept: object, check: str, detail: str = "") -> None:
    if not kept:
        raise BrokenRuleError(check, detail)


@dataclass(frozen=True)
class Case:
    """A reader with one of its files.

    Attributes
    ----------
    content
        Content of a file of a few kilobytes: it is read some hundred times.
    magnitudes
        Least and largest physically plausible sample, signed, by the names of signals; a signal may be left out.
    cut_is_invisible
        Whether the beginning of the file, up to a byte, is a whole file by its format.
    too_many
        Files with one more of `STATEMENTS` each, as the format would carry it; a case where what is declared carries
        it; a sentence that begins with ``cannot`` where the format cannot carry any.
    """

    name: str
    reader: Reader
    content: bytes
    declared: Declarations
    magnitudes: Mapping[str, tuple[float, float]]
    cut_is_invisible: Callable[[bytes], bool] = lambda _: False
    limit_s: float = LIMIT_S
    too_many: Mapping[str, bytes | Case | str] = field(default_factory=dict)

    def path(self, folder: Path) -> Path:
        """Return where `open` writes the file."""
        return folder / f"case{self.reader.suffixes[0]}"

    def open(self, folder: Path, content: bytes | None = None) -> Recording:
        """Write the file, or another content in its place, and open it."""
        self.path(folder).write_bytes(self.content if content is None else content)
        return self.reader.open(self.path(folder), self.declared)


def claims_its_own_file(case: Case, folder: Path) -> None:
    """Claim a file of the format, and no other."""
    case.path(folder).write_bytes(case.content)
    own = Head(case.content[:HEAD_BYTES], case.path(folder))
    _require(case.reader.claims(own), "its own file is claimed")
    nothing, every_byte = Head(b""), Head(bytes(range(256)) * 4)
    letter = Head(b"A letter.\n\nDear all,\nthe tests went well.\n")
    _require(not case.reader.claims(nothing), "no bytes are not claimed")
    _require(not case.reader.claims(every_byte), "bytes without meaning are not claimed")
    _require(not case.reader.claims(letter), "a letter is not claimed")


def headers_come_before_samples(case: Case, folder: Path) -> None:
    """Say what there is before samples are read, and nothing else afterwards."""
    recording = case.open(folder)
    before = tuple(recording.signals)
    names = [header.name for header in before]
    _require(names, "there are signals")
    _require(len(set(names)) == len(names), "names of signals are unique", ", ".join(names))
    _require(recording.reader == case.reader.name, "the recording names its reader", recording.reader)
    _require(recording.path == case.path(folder), "the recording names its file", str(recording.path))
    for header in before:
        _require(header.sample_count > 0, "signals have samples", header.name)
        count = len(recording.read(header.name))
        _require(count == header.sample_count, "the header counts the samples", f"{header.name}: {count}")
        _require(_is_json(header.metadata), "metadata of a signal are JSON", header.name)
    _require(tuple(recording.signals) == before, "headers stay as they are")
    _require(_is_json(recording.metadata), "metadata of the file are JSON")


def samples_have_the_promised_dtype(case: Case, folder: Path) -> None:
    """Return samples of the type that the header promises."""
    recording = case.open(folder)
    for header in recording.signals:
        dtype = recording.read(header.name).dtype
        _require(dtype == np.dtype(header.dtype), "samples are of the promised type", f"{header.name}: {dtype!r}")


def a_part_equals_the_whole_cut(case: Case, folder: Path) -> None:
    """Read a part as the whole has it, whether the whole was read before or not; so parts concatenate."""
    whole = _samples(case.open(folder))
    recording = case.open(folder)
    for name, samples in whole.items():
        for start, stop in _parts(len(samples)):
            same = np.array_equal(recording.read(name, start, stop), samples[start:stop], equal_nan=True)
            _require(same, "a part is a cut of the whole", f"{name}, {start} to {stop}")


def what_was_read_is_the_callers_own(case: Case, folder: Path) -> None:
    """Return arrays that nobody else holds."""
    recording = case.open(folder)
    for header in recording.signals:
        first = recording.read(header.name)
        kept = first.copy()
        _require(first.flags.writeable, "samples can be written to", header.name)
        first[:] = -12345.0
        again = recording.read(header.name)
        _require(np.array_equal(again, kept, equal_nan=True), "samples are nobody else's", header.name)


def the_time_base_is_as_long_as_the_samples(case: Case, folder: Path) -> None:
    """Give each sample an instant on the declared clock."""
    recording = case.open(folder)
    for header in recording.signals:
        base = recording.time_base(header.name)
        _require(base.count == header.sample_count, "each sample has an instant", f"{header.name}: {base.count}")
        _require(
            base.clock == case.declared.clock, "instants are on the declared clock", f"{header.name}: {base.clock}"
        )
    for track in recording.tracks():
        _require(track.time_base.count == len(track.positions), "each position has an instant", track.name)
        _require(track.time_base.clock == case.declared.clock, "tracks are on the declared clock", track.name)
        _require(len(track.frame_numbers) == len(track.positions), "each position has a frame", track.name)


def stamps_increase_strictly(case: Case, folder: Path) -> None:
    """Give instants that are numbers and increase."""
    recording = case.open(folder)
    for header in recording.signals:
        times_s = recording.time_base(header.name).times_s
        _require(np.isfinite(times_s).all(), "instants are finite", header.name)
        _require((np.diff(times_s) > 0).all(), "instants increase", header.name)


def an_unknown_name_says_which_exist(case: Case, folder: Path) -> None:
    """Answer an unknown name with those that exist."""
    recording = case.open(folder)
    names = {header.name for header in recording.signals}
    _require(_nearest(recording.read) == names, "samples of an unknown name are refused, the known are named")
    _require(_nearest(recording.time_base) == names, "instants of an unknown name are refused, the known are named")
    _require(_nearest(recording.raw) == names, "counts of an unknown name are refused, the known are named")


def magnitudes_are_plausible(case: Case, folder: Path) -> None:
    """Read numbers of the size that the quantity has."""
    recording = case.open(folder)
    names = {header.name for header in recording.signals}
    for name, (lowest, highest) in case.magnitudes.items():
        _require(name in names, "the signal exists", name)
        samples = recording.read(name)
        _require(np.isfinite(samples).any(), "not all samples are lost", name)
        _require(np.nanmin(samples) >= lowest, "no sample is implausibly low", f"{name}: {np.nanmin(samples)}")
        _require(np.nanmax(samples) <= highest, "no sample is implausibly high", f"{name}: {np.nanmax(samples)}")


def raw_counts_give_the_samples(case: Case, folder: Path) -> None:
    """Return counts from which gain and offset make the samples, of a part as of the whole."""
    recording = case.open(folder)
    for header in recording.signals:
        raw = recording.raw(header.name)
        if raw is None:
            continue
        made = raw.gain * raw.counts + raw.offset
        same = made.shape == (header.sample_count,) and np.allclose(made, recording.read(header.name), 1e-12, 0.0)
        _require(same, "counts make the samples", header.name)
        _require(raw.unit == header.unit, "counts have the signal's unit", f"{header.name}: {raw.unit}")
        for start, stop in _parts(header.sample_count):
            part, place = recording.raw(header.name, start, stop), f"{header.name}, {start} to {stop}"
            if part is None:
                raise BrokenRuleError("a part of the counts is there", place)
            scaling = (part.gain, part.offset, part.unit) == (raw.gain, raw.offset, raw.unit)
            _require(scaling, "a part of the counts has the same scaling", place)
            same = np.array_equal(part.counts, raw.counts[start:stop])
            _require(same, "a part of the counts is a cut of the whole", place)


def a_missing_file_is_a_read_error(case: Case, folder: Path) -> None:
    """Refuse a file that does not exist."""
    _require(_refuses(case, folder / "missing"), "a missing file is refused")


def a_cut_file_is_refused_or_shorter_with_a_note(case: Case, folder: Path) -> None:
    """Refuse a file that was cut anywhere, or read its beginning and say that there is less."""
    recording = case.open(folder)
    whole, notes = _samples(recording), set(recording.notes)
    size = len(case.content)
    ends = {*range(min(size, _EVERYWHERE_BYTES)), *range(max(size - _EVERYWHERE_BYTES, 0), size)}
    for at in sorted({*ends, *np.linspace(0, size - 1, _PLACES).astype(int).tolist()}):
        cut = case.content[:at]
        left = _read_damaged(case, folder, cut)
        if left is None:
            continue
        for name, samples in left.samples.items():
            place = f"{name} cut at byte {at}"
            _require(name in whole, "a cut file has no other signals", place)
            same = np.array_equal(samples, whole[name][: len(samples)], equal_nan=True)
            _require(same, "what is left is the beginning", place)
        is_shorter = any(len(left.samples.get(name, ())) < len(samples) for name, samples in whole.items())
        noted = not is_shorter or left.notes - notes or case.cut_is_invisible(cut)
        _require(noted, "fewer samples are noted", f"cut at byte {at}")


def a_statement_too_many_is_used_noted_or_refused(case: Case, folder: Path) -> None:
    """Let no statement beside the samples go by in silence: take its value, say that it is not applied, or refuse."""
    recording = case.open(folder)
    plain, notes = _taken(recording), {str(note) for note in recording.notes}
    for what, spoilt in case.too_many.items():
        _require(what in STATEMENTS, "the statement is one that is known", what)
        if isinstance(spoilt, str):
            _require(spoilt.startswith("cannot "), "it is said why the format cannot carry it", spoilt)
            continue
        with_one = spoilt if isinstance(spoilt, Case) else replace(case, content=spoilt)
        _require(with_one != case, "there is a statement", what)
        try:
            more = with_one.open(folder)
            taken = _taken(more)
        except ReadError:
            continue
        shared = [(own, taken[name]) for name, own in plain.items() if name in taken]
        is_used = any(not _is_same(own, other) for own, other in shared)
        said = {str(note) for note in more.notes} - notes
        if what == "counter":
            steps = [np.diff(times_s) for *_, times_s in taken.values()]
            is_used, said = any(np.ptp(own) > 0.5 * np.median(own) for own in steps if own.size), set()
        _require(is_used or said, "no statement goes by in silence", what)


def flipped_bytes_are_refused_or_read(case: Case, folder: Path, flips: Sequence[Flips] = FLIPS) -> None:
    """Refuse a file with damaged bytes, or read it; nothing else.

    Parameters
    ----------
    flips
        Bytes to write over the file, with their places, one at a time.
    """
    for flip in flips:
        content = bytearray(case.content)
        for place, value in flip:
            content[int(place * (len(content) - 1))] = value
        _read_damaged(case, folder, bytes(content))


RULES: tuple[Callable[[Case, Path], None], ...] = (
    claims_its_own_file,
    headers_come_before_samples,
    samples_have_the_promised_dtype,
    a_part_equals_the_whole_cut,
    what_was_read_is_the_callers_own,
    the_time_base_is_as_long_as_the_samples,
    stamps_increase_strictly,
    an_unknown_name_says_which_exist,
    magnitudes_are_plausible,
    raw_counts_give_the_samples,
    a_missing_file_is_a_read_error,
    a_statement_too_many_is_used_noted_or_refused,
    a_cut_file_is_refused_or_shorter_with_a_note,
    flipped_bytes_are_refused_or_read,
)
"""Rules of the suite, in the order in which they run."""


@dataclass(frozen=True, eq=False)
class Left:
    """Contents that could be read of a damaged file."""

    samples: Mapping[str, NDArray[Any]]
    notes: set[str]


def _samples(recording: Recording) -> dict[str, NDArray[Any]]:
    return {header.name: recording.read(header.name) for header in recording.signals}


def _taken(recording: Recording) -> dict[str, tuple[str, NDArray[Any], NDArray[Any]]]:
    """Return unit, samples and instants of each signal."""
    return {
        one.name: (one.unit, recording.read(one.name), recording.time_base(one.name).times_s)
        for one in recording.signals
    }


def _is_same(one: tuple[str, NDArray[Any], NDArray[Any]], other: tuple[str, NDArray[Any], NDArray[Any]]) -> bool:
    arrays = zip(one[1:], other[1:], strict=True)
    return one[0] == other[0] and all(np.array_equal(a, b, equal_nan=True) for a, b in arrays)


def _parts(count: int) -> Iterator[tuple[int, int | None]]:
    """Yield starts and stops of parts: those that make up the whole, the last sample, and none behind it."""
    yield from pairwise((0, 1, count // 3, count // 2, count))
    yield from ((count - 1, None), (count, None))


def _is_json(metadata: Mapping[str, Any]) -> bool:
    try:
        return bool(json.dumps(dict(metadata)))
    except (TypeError, ValueError):
        return False


def _nearest(ask: Callable[[str], object]) -> set[str] | None:
    """Ask for a signal that is not there; return the names that the error gives, None if there is no such error."""
    try:
        ask("no such signal")
    except MissingChannelError as error:
        return set(error.nearest)
    except Exception:
        return None
    return None


def _refuses(case: Case, path: Path) -> bool:
    try:
        case.reader.open(path, case.declared)
    except ReadError:
        return True
    except Exception:
        return False
    return False


def _read_damaged(case: Case, folder: Path, content: bytes) -> Left | None:
    """Read all of a damaged file, which may take no longer than it should; None if it is refused."""
    results: list[Left] = []
    raised: list[BaseException] = []

    def run() -> None:
        try:
            results.append(read_everything(case.open(folder, content)))
        except ReadError:
            pass
        except BaseException as error:
            raised.append(error)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    thread.join(case.limit_s)
    _require(not thread.is_alive(), "a damaged file is done with in time", f"{case.limit_s} s")
    for error in raised:
        if isinstance(error, BrokenRuleError):
            raise error
        raise BrokenRuleError("a damaged file raises nothing but ReadError", repr(error)) from error
    return results[0] if results else None


def read_everything(recording: Recording) -> Left:
    """Ask a recording for all that it can be asked for, and compare its parts."""
    samples = {}
    for header in recording.signals:
        samples[header.name] = recording.read(header.name)
        count = len(samples[header.name])
        _require(count == header.sample_count, "the header of a damaged file counts the samples", header.name)
        is_timed = recording.time_base(header.name).times_s.shape == (count,)
        _require(is_timed, "each sample of a damaged file has an instant", header.name)
        recording.raw(header.name)
    for track in recording.tracks():
        is_timed = track.time_base.count == len(track.positions)
        _require(is_timed, "each position of a damaged file has an instant", track.name)
    _require(_is_json(recording.metadata), "metadata of a damaged file are JSON")
    _ = recording.absolute_start, recording.incomplete
    return Left(samples, set(recording.notes))
