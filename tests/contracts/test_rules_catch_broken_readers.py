"""Each rule for readers is broken by a reader made for it, and must say so."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from recoil_acquisition.channel import RawCounts
from recoil_acquisition.errors import MissingChannelError
from recoil_acquisition.readers.head import Claim, Head
from recoil_acquisition.readers.reader import Declarations, SignalHeader
from recoil_acquisition.readers.serial.capture import SerialCaptureReader, SerialRecording
from recoil_acquisition.readers.table import READERS
from recoil_acquisition.timebase import TimeBase
from tests.builders import vendor_files as build
from tests.contracts import reader_rules as rules
from tests.contracts.reader_rules import Case


class Broken:
    """A recording that does what another does, until a subclass breaks it."""

    def __init__(self, whole: SerialRecording) -> None:
        self.whole = whole

    def __getattr__(self, name: str) -> Any:
        return getattr(self.whole, name)


class WholeReader(SerialCaptureReader):
    """A reader of serial captures with all that the table says of it."""

    suffixes = (".rdsc",)

    def claims(self, head: Head) -> Claim:
        return next(reader for reader in READERS if reader.kind == "serial").claims(head)


class BrokenReader(WholeReader):
    def __init__(self, recording: type[Broken]) -> None:
        self._recording = recording

    def open(self, path: Path, declared: Declarations) -> Any:
        return self._recording(super().open(path, declared))


class ForgetsCounts(Broken):
    @property
    def signals(self) -> tuple[SignalHeader, ...]:
        return tuple(replace(header, sample_count=0) for header in self.whole.signals)


class ReadsSinglePrecision(Broken):
    def read(self, name: str, start: int = 0, stop: int | None = None) -> Any:
        return self.whole.read(name, start, stop).astype(np.float32)


class CutsOneShort(Broken):
    def read(self, name: str, start: int = 0, stop: int | None = None) -> Any:
        return self.whole.read(name, start, None if stop is None else max(stop - 1, 0))


class FiltersEachPart(Broken):
    def read(self, name: str, start: int = 0, stop: int | None = None) -> Any:
        part = self.whole.read(name, start, stop)
        return part - part.mean()


class HandsOutItsOwn(Broken):
    def __init__(self, whole: SerialRecording) -> None:
        super().__init__(whole)
        self.kept = {header.name: whole.read(header.name) for header in whole.signals}

    def read(self, name: str, start: int = 0, stop: int | None = None) -> Any:
        return self.kept[name][start:stop] if name in self.kept else self.whole.read(name)


class CountsOneInstantTooMany(Broken):
    def time_base(self, name: str) -> TimeBase:
        base = self.whole.time_base(name)
        return TimeBase.uniform(base.clock, 0.0, 1e-3, base.count + 1)


class RunsBackwards(Broken):
    def time_base(self, name: str) -> Any:
        base = self.whole.time_base(name)
        object.__setattr__(base, "stamps_s", base.times_s[::-1].copy())
        base.__dict__.pop("times_s", None)
        return base


class RaisesKeyError(Broken):
    def read(self, name: str, start: int = 0, stop: int | None = None) -> Any:
        try:
            return self.whole.read(name, start, stop)
        except MissingChannelError:
            raise KeyError(name) from None


class NamesNothing(Broken):
    def read(self, name: str, start: int = 0, stop: int | None = None) -> Any:
        try:
            return self.whole.read(name, start, stop)
        except MissingChannelError:
            raise MissingChannelError(name, ()) from None


class ReadsInTheWrongOrder(Broken):
    def read(self, name: str, start: int = 0, stop: int | None = None) -> Any:
        return self.whole.read(name, start, stop).astype(np.float32).view(np.uint32).byteswap().astype(np.float64)


class ForgetsTheOffset(Broken):
    def raw(self, name: str, start: int = 0, stop: int | None = None) -> RawCounts | None:
        raw = self.whole.raw(name, start, stop)
        return None if raw is None else replace(raw, offset=raw.offset + 1.0)


class SaysNothingOfLosses(Broken):
    notes = ()


class FillsUp(Broken):
    """Repeats the last sample to the number of samples of the whole file."""

    def read(self, name: str, start: int = 0, stop: int | None = None) -> Any:
        samples = self.whole.read(name)
        return np.pad(samples, (0, max(0, 40 - samples.size)), mode="edge")[start:stop]


class Greedy(WholeReader):
    def claims(self, head: Head) -> Claim:  # noqa: ARG002  it claims every file
        return Claim.CERTAIN


class LetsForeignErrorsOut(WholeReader):
    def open(self, path: Path, declared: Declarations) -> SerialRecording:
        if len(path.read_bytes()) < 700:
            raise IndexError("index out of range")
        return super().open(path, declared)


class Hangs(WholeReader):
    def open(self, path: Path, declared: Declarations) -> SerialRecording:
        if len(path.read_bytes()) < 700:
            time.sleep(1.0)
        return super().open(path, declared)


class OpensAnything(WholeReader):
    def open(self, path: Path, declared: Declarations) -> Any:
        return path, declared


def case_of(reader: WholeReader) -> Case:
    return Case(
        "broken",
        reader,
        build.serial_capture(build.serial_frames()),
        Declarations("imu", framing=build.FRAMING),
        {"gyro": (0.0, 1.0), "temperature": (15.0, 30.0)},
        limit_s=0.2 if isinstance(reader, Hangs) else 20.0,
    )


BROKEN: list[tuple[Callable[[Case, Path], None], WholeReader]] = [
    (rules.claims_its_own_file, Greedy()),
    (rules.headers_come_before_samples, BrokenReader(ForgetsCounts)),
    (rules.samples_have_the_promised_dtype, BrokenReader(ReadsSinglePrecision)),
    (rules.a_part_equals_the_whole_cut, BrokenReader(CutsOneShort)),
    (rules.parts_concatenate, BrokenReader(FiltersEachPart)),
    (rules.what_was_read_is_the_callers_own, BrokenReader(HandsOutItsOwn)),
    (rules.the_time_base_is_as_long_as_the_samples, BrokenReader(CountsOneInstantTooMany)),
    (rules.stamps_increase_strictly, BrokenReader(RunsBackwards)),
    (rules.an_unknown_name_says_which_exist, BrokenReader(RaisesKeyError)),
    (rules.an_unknown_name_says_which_exist, BrokenReader(NamesNothing)),
    (rules.magnitudes_are_plausible, BrokenReader(ReadsInTheWrongOrder)),
    (rules.raw_counts_give_the_samples, BrokenReader(ForgetsTheOffset)),
    (rules.a_missing_file_is_a_read_error, OpensAnything()),
    (rules.a_cut_file_is_refused_or_shorter_with_a_note, BrokenReader(SaysNothingOfLosses)),
    (rules.a_cut_file_is_refused_or_shorter_with_a_note, BrokenReader(FillsUp)),
    (rules.a_cut_file_is_refused_or_shorter_with_a_note, LetsForeignErrorsOut()),
    (rules.a_cut_file_is_refused_or_shorter_with_a_note, Hangs()),
]


@pytest.mark.parametrize(("rule", "reader"), BROKEN)
def test_a_rule_catches_the_reader_that_breaks_it(
    rule: Callable[[Case, Path], None], reader: WholeReader, tmp_path: Path
) -> None:
    with pytest.raises((AssertionError, KeyError, pytest.fail.Exception)):
        rule(case_of(reader), tmp_path)


def test_every_rule_has_a_reader_that_breaks_it() -> None:
    assert {rule for rule, _ in BROKEN} == set(rules.RULES)


@pytest.mark.parametrize("reader", [LetsForeignErrorsOut(), Hangs()])
def test_flipped_bytes_catch_foreign_errors_and_hangs(reader: WholeReader, tmp_path: Path) -> None:
    short = replace(case_of(reader), content=build.serial_capture(build.serial_frames(5)))
    with pytest.raises(AssertionError):
        rules.flipped_bytes_are_refused_or_read(short, tmp_path, [(0.5, 0)])


@pytest.mark.parametrize("rule", rules.RULES)
def test_the_whole_reader_passes(rule: Callable[[Case, Path], None], tmp_path: Path) -> None:
    case = case_of(WholeReader())
    starts = [build.serial_capture(build.serial_frames()[:n]) for n in range(0, 41, 3)]
    rule(replace(case, cut_is_invisible=lambda cut: cut in starts), tmp_path)
