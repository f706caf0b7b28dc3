"""Each single check of the rules is broken by a reader made for it, which breaks nothing else."""

from __future__ import annotations

import ast
import inspect
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pytest

from recoil_acquisition import conformance
from recoil_acquisition.channel import RawCounts
from recoil_acquisition.clocks.timebase import TimeBase
from recoil_acquisition.conformance import BrokenRuleError, Case
from recoil_acquisition.errors import CorruptFileError, MissingChannelError, ReadError
from recoil_acquisition.readers.head import Claim, Head
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import SignalHeader

ROWS = 40
CONTENT = b"toy\n" + b"".join(b"%d\n" % (i * i % 97) for i in range(ROWS)) + b"# the end of it\n"


class Sound:
    """A recording of whole numbers, one a line: `a` has counts, `b` is computed, and there is a track."""

    def __init__(self, path: Path, clock: str, content: bytes) -> None:
        *lines, self.cut = content.split(b"\n")[1:]
        try:
            self.counts = np.array([int(line) for line in lines if not line.startswith(b"#")])
        except ValueError as error:
            raise CorruptFileError("no number", path=path) from error
        if not self.counts.size:
            raise CorruptFileError("no numbers", path=path)
        self.file, self.clock, self.kept = path, clock, {}
        self.is_whole, self.is_cut = content == CONTENT, len(content) < len(CONTENT)

    path = property(lambda self: self.file)
    reader = property(lambda _: "toy")
    metadata = property(lambda _: {"kind": "toy"})
    incomplete = property(lambda _: "")
    absolute_start = property(lambda _: None)
    notes = property(lambda self: ("the last line was left out",) if self.cut[:1].isdigit() else ())
    signals = property(lambda self: tuple(SignalHeader(n, u, self.counts.size) for n, u in (("a", "V"), ("b", ""))))

    def check(self, name: str) -> None:
        if name not in (names := [header.name for header in self.signals]):
            raise MissingChannelError(name, names)

    def read(self, name: str, start: int = 0, stop: int | None = None) -> Any:
        self.check(name)
        return (0.5 * self.counts + 1.0 if name == "a" else 2.0 * self.counts)[start:stop]

    def raw(self, name: str, start: int = 0, stop: int | None = None) -> Any:
        self.check(name)
        return RawCounts(self.counts[start:stop], 0.5, 1.0, "V") if name == "a" else None

    def time_base(self, name: str) -> Any:
        self.check(name)
        return TimeBase.uniform(self.clock, 0.0, 1e-3, self.counts.size)

    def tracks(self) -> Any:
        base = TimeBase.uniform(self.clock, 0.0, 1e-3, self.counts.size)
        positions = np.zeros((self.counts.size, 1))
        return (SimpleNamespace(name="t", positions=positions, time_base=base, frame_numbers=self.counts),)


class SoundReader:
    """A reader of such files; a recording of another class, or something to do before opening, breaks it."""

    name, kind, suffixes = "toy", "dewetron", (".toy",)

    def __init__(
        self, recording: type[Sound] = Sound, *, also: bytes | None = None, before: Callable[[bytes], Any] = len
    ) -> None:
        self.recording, self.also, self.before = recording, also, before

    def claims(self, head: Head) -> Claim:
        is_own = head.path.exists() and head.content.startswith(b"toy\n")
        return Claim.CERTAIN if is_own or (self.also is not None and head.content[:4] == self.also) else Claim.NO

    def open(self, path: Path, declared: Declarations) -> Any:
        try:
            content = path.read_bytes()
        except OSError as error:
            raise ReadError("cannot be read", path=path) from error
        self.before(content)
        if not content.startswith(b"toy\n"):
            raise CorruptFileError("no toy", path=path)
        return self.recording(path, declared.clock, content)


class ClaimsNothing(SoundReader):
    def claims(self, head: Head) -> Claim:  # noqa: ARG002
        return Claim.NO


class LetsTheSystemsErrorOut(SoundReader):
    def open(self, path: Path, declared: Declarations) -> Any:
        return Sound(path, declared.clock, path.read_bytes()) if not path.exists() else super().open(path, declared)


class OpensWhatIsNot(SoundReader):
    def open(self, path: Path, declared: Declarations) -> Any:
        return super().open(path, declared) if path.exists() else Sound(path, declared.clock, CONTENT)


def wrong(**changes: Callable[..., Any]) -> SoundReader:
    """Return a reader some parts of whose recordings are changed: of recording, what is right, and what was asked."""

    def changed(part: str, change: Callable[..., Any]) -> Any:
        sound = Sound.__dict__[part]
        if isinstance(sound, property):
            return property(lambda self: change(self, sound.fget(self)))
        return lambda self, *asked: change(self, sound(self, *asked), *asked)

    return SoundReader(type("Wrong", (Sound,), {part: changed(part, change) for part, change in changes.items()}))


def of_b(change: Callable[..., Any]) -> Callable[..., Any]:
    """Change the samples of `b` alone."""
    return lambda recording, samples, name, *part: change(recording, samples, *part) if name == "b" else samples


def of_counts(change: Callable[..., Any]) -> Callable[..., Any]:
    """Change counts where there are some."""
    return lambda recording, counts, _, *part: None if counts is None else change(recording, counts, *part)


def of_the_whole(change: Callable[..., Any]) -> Callable[..., Any]:
    """Change what is right of a whole file alone."""
    return lambda recording, right, *asked: change(recording, right, *asked) if recording.is_whole else right


def of_what_is_left(change: Callable[..., Any]) -> Callable[..., Any]:
    """Change what is right of a cut file alone."""
    return lambda recording, right, *asked: change(recording, right, *asked) if recording.is_cut else right


def answering(part: str, answer: Callable[[str], Any]) -> SoundReader:
    """Return a reader one part of whose recordings answers an unknown name in its own way."""
    sound = Sound.__dict__[part]
    own = lambda self, name, *asked: sound(self, name, *asked) if name in ("a", "b") else answer(name)  # noqa: E731
    return SoundReader(type("Answering", (Sound,), {part: own}))


def refuse(error: BaseException) -> Any:
    raise error


def differs(_: Sound, samples: Any, *__: Any) -> Any:
    return samples + 1.0


def differs_before_the_whole_was_read(recording: Sound, samples: Any, start: int = 0, stop: int | None = None) -> Any:
    recording.kept.setdefault("whole", (start, stop) == (0, None))
    return samples if recording.kept["whole"] else samples + 1.0


def read_only(_: Sound, samples: Any, *__: Any) -> Any:
    samples.setflags(write=False)
    return samples


def kept(recording: Sound, samples: Any, start: int = 0, stop: int | None = None) -> Any:
    return recording.kept.setdefault("b", samples if (start, stop) == (0, None) else 2.0 * recording.counts)[start:stop]


def longer(base: TimeBase) -> TimeBase:
    return TimeBase.uniform(base.clock, 0.0, 1e-3, base.count + 1)


def at(times_s: Any, base: TimeBase) -> Any:
    return SimpleNamespace(clock=base.clock, count=base.count, times_s=times_s)


def track_with(**parts: Callable[[Any], Any]) -> Callable[..., Any]:
    def change(_: Sound, tracks: Any) -> Any:
        return (SimpleNamespace(**{**vars(tracks[0]), **{name: part(tracks[0]) for name, part in parts.items()}}),)

    return change


def headed(change: Callable[[SignalHeader], SignalHeader]) -> Callable[..., Any]:
    return lambda _, headers: (headers[0], change(headers[1]))


MORE = headed(lambda header: replace(header, sample_count=header.sample_count + 1))
WITHOUT_JSON = {"kind": object()}
UNKNOWN = "of an unknown name are refused, the known are named"
FOREIGN = "a damaged file raises nothing but ReadError"
LAST = len(CONTENT) - 1


class Broken(NamedTuple):
    """A reader, the check that it breaks, and what else its case expects."""

    check: str
    reader: SoundReader
    magnitudes: dict[str, tuple[float, float]] = {"a": (1.0, 49.0), "b": (0.0, 192.0)}  # noqa: RUF012
    limit_s: float = 20.0
    too_many: dict[str, Any] = {}  # noqa: RUF012


BROKEN = (
    Broken("its own file is claimed", ClaimsNothing()),
    Broken("no bytes are not claimed", SoundReader(also=b"")),
    Broken("bytes without meaning are not claimed", SoundReader(also=b"\0\1\2\3")),
    Broken("a letter is not claimed", SoundReader(also=b"A le")),
    Broken("there are signals", wrong(signals=lambda *_: ()), {}),
    Broken("names of signals are unique", wrong(signals=lambda _, headers: headers + headers)),
    Broken("the recording names its reader", wrong(reader=lambda *_: "another")),
    Broken("the recording names its file", wrong(path=lambda _, path: path.with_name("another"))),
    Broken(
        "signals have samples",
        wrong(
            signals=lambda _, headers: tuple(replace(header, sample_count=0) for header in headers),
            read=lambda _, samples, *__: samples[:0], time_base=lambda _, base, __: replace(base, count=0),
            raw=lambda *_: None,
        ),
        {},
    ),
    Broken("the header counts the samples", wrong(signals=of_the_whole(MORE), time_base=of_the_whole(
        lambda _, base, name: longer(base) if name == "b" else base))),
    Broken("metadata of a signal are JSON", wrong(
        signals=headed(lambda header: replace(header, metadata=WITHOUT_JSON)))),
    Broken("headers stay as they are", wrong(
        read=lambda self, samples, *_: (self.kept.update(read=True), samples)[1],
        signals=lambda self, headers: tuple(replace(h, metadata=dict(self.kept)) for h in headers))),
    Broken("metadata of the file are JSON", wrong(metadata=of_the_whole(lambda *_: WITHOUT_JSON))),
    Broken("samples are of the promised type", wrong(read=of_b(lambda _, samples, *__: samples.astype(">f8")))),
    *(
        Broken("a part is a cut of the whole", wrong(read=of_b(
            lambda _, samples, *part, wrong_at=wrong_at: np.append(samples, 0.0) if part == wrong_at else samples)))
        for wrong_at in ((0, 1), (1, 13), (13, 20), (20, 40), (39, None), (40, None))
    ),
    Broken("a part is a cut of the whole", wrong(read=of_b(differs_before_the_whole_was_read))),
    Broken("samples can be written to", wrong(read=of_b(read_only))),
    Broken("samples are nobody else's", wrong(read=of_b(kept))),
    Broken("each sample has an instant", wrong(time_base=of_the_whole(lambda _, base, __: longer(base)))),
    Broken("instants are on the declared clock", wrong(time_base=lambda _, base, __: replace(base, clock="another"))),
    Broken("each position has an instant", wrong(
        tracks=of_the_whole(track_with(time_base=lambda track: longer(track.time_base))))),
    Broken("tracks are on the declared clock", wrong(
        tracks=track_with(time_base=lambda track: replace(track.time_base, clock="another")))),
    Broken("each position has a frame", wrong(tracks=track_with(frame_numbers=lambda track: track.frame_numbers[1:]))),
    Broken("instants are finite", wrong(
        time_base=lambda _, base, __: at(np.append(base.times_s[:-1], np.inf), base))),
    Broken("instants increase", wrong(time_base=lambda _, base, __: at(base.times_s[::-1], base))),
    *(
        Broken(f"{of} {UNKNOWN}", answering(part, answer))
        for part, of in (("read", "samples"), ("time_base", "instants"), ("raw", "counts"))
        for answer in (
            lambda _: None, lambda name: refuse(KeyError(name)), lambda name: refuse(MissingChannelError(name, ())),
        )
    ),
    Broken("the signal exists", SoundReader(), {"c": (0.0, 1.0)}),
    Broken("not all samples are lost", wrong(read=of_b(lambda _, samples, *__: samples * np.nan))),
    Broken("no sample is implausibly low", wrong(read=of_b(lambda _, samples, *__: samples - 1.0))),
    Broken("no sample is implausibly high", wrong(read=of_b(lambda _, samples, *__: samples + 100.0))),
    Broken("counts make the samples", wrong(raw=of_counts(lambda _, raw, *__: replace(raw, offset=2.0)))),
    Broken("counts make the samples", wrong(raw=of_counts(
        lambda self, raw, start=0, stop=None: replace(raw, counts=self.counts[:-1][start:stop])))),
    Broken("counts have the signal's unit", wrong(raw=of_counts(lambda _, raw, *__: replace(raw, unit="A")))),
    Broken("a part of the counts is there", wrong(raw=of_counts(lambda _, raw, *part: None if part else raw))),
    Broken("a part of the counts has the same scaling", wrong(
        raw=of_counts(lambda _, raw, *part: replace(raw, gain=1.0) if part else raw))),
    Broken("a part of the counts is a cut of the whole", wrong(
        raw=of_counts(lambda _, raw, *part: replace(raw, counts=raw.counts + 1) if part else raw))),
    Broken("a missing file is refused", LetsTheSystemsErrorOut()),
    Broken("a missing file is refused", OpensWhatIsNot()),
    Broken("the statement is one that is known", SoundReader(), too_many={"smell": CONTENT + b"# roses\n"}),
    Broken("it is said why the format cannot carry it", SoundReader(), too_many={"scale": "perhaps"}),
    Broken("there is a statement", SoundReader(), too_many={"scale": CONTENT}),
    Broken("no statement goes by in silence", SoundReader(), too_many={"scale": CONTENT + b"# factor 0.5\n"}),
    Broken("no statement goes by in silence", SoundReader(), too_many={"counter": CONTENT + b"# row 30 of 40\n"}),
    Broken("a cut file has no other signals", wrong(
        signals=of_what_is_left(lambda _, headers: (*headers, replace(headers[1], name="c"))))),
    Broken("what is left is the beginning", wrong(read=of_b(of_what_is_left(differs)))),
    Broken("fewer samples are noted", wrong(notes=lambda *_: ())),
    Broken("a damaged file is done with in time", SoundReader(
        before=lambda content: time.sleep(1.0) if len(content) == LAST else None), limit_s=0.3),
    *(
        Broken(FOREIGN, SoundReader(
            before=lambda content, size=size: refuse(IndexError("index")) if len(content) == size else None))
        for size in (0, 24, int(np.linspace(0, LAST, 70)[35]), LAST - 24, LAST)
    ),
    *(
        Broken(FOREIGN, wrong(**{part: of_what_is_left(lambda *_: refuse(IndexError("index")))}))
        for part in ("raw", "absolute_start", "incomplete", "notes")
    ),
    Broken(FOREIGN, SoundReader(before=lambda content: refuse(IndexError("index"))
                                if len(content) == len(CONTENT) and content != CONTENT else None)),
    Broken("the header of a damaged file counts the samples", wrong(signals=of_what_is_left(MORE))),
    Broken("each sample of a damaged file has an instant", wrong(
        time_base=of_what_is_left(lambda _, base, __: longer(base)))),
    Broken("each position of a damaged file has an instant", wrong(
        tracks=of_what_is_left(track_with(time_base=lambda track: longer(track.time_base))))),
    Broken("metadata of a damaged file are JSON", wrong(metadata=of_what_is_left(lambda *_: WITHOUT_JSON))),
)  # fmt: skip


def case_of(broken: Broken) -> Case:
    return Case(
        "toy",
        broken.reader,
        CONTENT,
        Declarations("clock"),
        broken.magnitudes,
        lambda cut: cut.endswith(b"\n"),
        broken.limit_s,
        broken.too_many,
    )


def failed_checks(case: Case, folder: Path) -> list[str]:
    failed = []
    for rule in conformance.RULES:
        try:
            rule(case, folder)
        except BrokenRuleError as error:
            failed.append(error.check)
    return failed


@pytest.mark.parametrize(
    "number",
    [
        pytest.param(number, id=f"{number}-{one.check}", marks=() if number % 9 == 0 else pytest.mark.exhaustive)
        for number, one in enumerate(BROKEN)
    ],
)
def test_a_reader_that_breaks_one_check_fails_that_check_alone(number: int, tmp_path: Path) -> None:
    assert failed_checks(case_of(BROKEN[number]), tmp_path) == [BROKEN[number].check]


def test_the_sound_reader_keeps_every_rule(tmp_path: Path) -> None:
    assert failed_checks(case_of(Broken("none", SoundReader())), tmp_path) == []


def test_every_check_of_the_rules_has_a_reader_that_breaks_it() -> None:
    """So a check that is taken out leaves a reader that no longer fails, or a check that nobody breaks."""
    tree = ast.parse(inspect.getsource(conformance))
    calls = [node for node in ast.walk(tree) if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)]
    places = {"_require": 1, "BrokenRuleError": 0}
    made = [ast.unparse(call.args[places[call.func.id]]) for call in calls if call.func.id in places]
    made.remove("check")  # of `_require` itself
    assert len(set(made)) == len(made), "each check has a name of its own"
    assert set(made) == {repr(broken.check) for broken in BROKEN}


def test_given_flips_are_what_is_written_over_the_file(tmp_path: Path) -> None:
    seen: list[bytes] = []
    case = case_of(Broken("none", SoundReader(before=seen.append)))
    conformance.flipped_bytes_are_refused_or_read(case, tmp_path, [[(0.0, 65), (1.0, 66)], [(0.5, 0)]])
    assert seen == [b"A" + CONTENT[1:-1] + b"B", CONTENT[: LAST // 2] + b"\0" + CONTENT[LAST // 2 + 1 :]]
