"""What every reader keeps to, one function per rule.

A rule takes a `Case`, a reader with one of its files, and a folder to write in. It raises
`AssertionError` if the reader breaks it.
"""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from recoil_acquisition.errors import MissingChannelError, ReadError
from recoil_acquisition.readers.head import HEAD_BYTES, Head
from recoil_acquisition.readers.reader import Declarations, Reader, Recording

LIMIT_S = 20.0
"""A reader that takes longer over a small file hangs."""


@dataclass(frozen=True)
class Case:
    """A reader with one of its files.

    Attributes
    ----------
    name : str
    reader : Reader
    content : bytes
    declared : Declarations
    magnitudes : mapping of str to (lowest, highest)
        Physically plausible range of a signal's samples.
    cut_is_invisible : callable
        Whether the beginning of the file, up to a byte, is a whole file by its format.
    limit_s : float
    """

    name: str
    reader: Reader
    content: bytes
    declared: Declarations
    magnitudes: Mapping[str, tuple[float, float]]
    cut_is_invisible: Callable[[bytes], bool] = lambda _: False
    limit_s: float = field(default=LIMIT_S)

    def open(self, folder: Path, content: bytes | None = None) -> Recording:
        path = folder / f"case{self.reader.suffixes[0]}"
        path.write_bytes(self.content if content is None else content)
        return self.reader.open(path, self.declared)


@dataclass(frozen=True, eq=False)
class Everything:
    """All that a recording can be asked for."""

    samples: Mapping[str, np.ndarray[Any, Any]]
    notes: tuple[str, ...]


def read_everything(recording: Recording) -> Everything:
    samples = {}
    for header in recording.signals:
        samples[header.name] = recording.read(header.name)
        base = recording.time_base(header.name)
        assert base.count == len(samples[header.name]) == header.sample_count
        assert base.times_s.shape == (base.count,)
        recording.raw(header.name)
    for track in recording.tracks():
        assert track.positions.shape[0] == track.time_base.count
    json.dumps(dict(recording.metadata))
    _ = recording.absolute_start
    return Everything(samples, tuple(recording.notes))


def within(limit_s: float, work: Callable[[], Everything | None]) -> Everything | None:
    """Run something that may hang; AssertionError if it does, its own exception if it raises."""
    results: list[Everything | None] = []
    raised: list[BaseException] = []

    def run() -> None:
        try:
            results.append(work())
        except BaseException as error:
            raised.append(error)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    thread.join(limit_s)
    assert not thread.is_alive(), f"still reading after {limit_s} s"
    if raised:
        raise raised[0]
    return results[0]


def outcome(case: Case, folder: Path, content: bytes) -> Everything | None:
    """Read a damaged file; None if it was refused as it should be."""

    def work() -> Everything | None:
        try:
            return read_everything(case.open(folder, content))
        except ReadError:
            return None

    try:
        return within(case.limit_s, work)
    except AssertionError:
        raise
    except Exception as error:
        raise AssertionError(f"a damaged file gave {type(error).__name__}: {error}") from error


def claims_its_own_file(case: Case, folder: Path) -> None:  # noqa: ARG001  every rule is called alike
    assert case.reader.claims(Head(case.content[:HEAD_BYTES]))
    assert not case.reader.claims(Head(b""))
    assert not case.reader.claims(Head(bytes(range(256)) * 4))
    assert not case.reader.claims(Head(b"A letter.\n\nDear all,\nthe tests went well.\n"))


def headers_come_before_samples(case: Case, folder: Path) -> None:
    recording = case.open(folder)
    before = tuple(recording.signals)
    names = [header.name for header in before]
    assert names
    assert len(set(names)) == len(names)
    assert recording.reader == case.reader.name
    assert recording.path.name.startswith("case")
    for header in before:
        assert len(recording.read(header.name)) == header.sample_count > 0
    assert tuple(recording.signals) == before
    json.dumps([dict(header.metadata) for header in before] + [dict(recording.metadata)])


def samples_have_the_promised_dtype(case: Case, folder: Path) -> None:
    recording = case.open(folder)
    for header in recording.signals:
        assert recording.read(header.name).dtype == np.dtype(header.dtype)


def a_part_equals_the_whole_cut(case: Case, folder: Path) -> None:
    whole = read_everything(case.open(folder)).samples
    recording = case.open(folder)
    for name, samples in whole.items():
        count = len(samples)
        for start, stop in ((0, None), (0, 1), (1, count), (count // 3, count // 2), (count - 1, count), (count, None)):
            np.testing.assert_array_equal(recording.read(name, start, stop), samples[start:stop])


def parts_concatenate(case: Case, folder: Path) -> None:
    recording = case.open(folder)
    for header in recording.signals:
        cuts = [0, 1, header.sample_count // 2, header.sample_count]
        parts = [recording.read(header.name, a, b) for a, b in pairwise(cuts)]
        np.testing.assert_array_equal(np.concatenate(parts), recording.read(header.name))


def what_was_read_is_the_callers_own(case: Case, folder: Path) -> None:
    recording = case.open(folder)
    for header in recording.signals:
        first = recording.read(header.name)
        kept = first.copy()
        first[:] = -12345.0
        np.testing.assert_array_equal(recording.read(header.name), kept)


def the_time_base_is_as_long_as_the_samples(case: Case, folder: Path) -> None:
    recording = case.open(folder)
    for header in recording.signals:
        base = recording.time_base(header.name)
        assert base.count == header.sample_count == len(recording.read(header.name))
        assert base.clock == case.declared.clock
    for track in recording.tracks():
        assert track.time_base.count == len(track.positions) == len(track.frame_numbers)


def stamps_increase_strictly(case: Case, folder: Path) -> None:
    recording = case.open(folder)
    for header in recording.signals:
        times_s = recording.time_base(header.name).times_s
        assert np.isfinite(times_s).all()
        assert (np.diff(times_s) > 0).all()


def an_unknown_name_says_which_exist(case: Case, folder: Path) -> None:
    recording = case.open(folder)
    names = {header.name for header in recording.signals}
    for ask in (recording.read, recording.time_base, recording.raw):
        with pytest.raises(MissingChannelError) as caught:
            ask("no such signal")
        assert set(caught.value.nearest) == names


def magnitudes_are_plausible(case: Case, folder: Path) -> None:
    recording = case.open(folder)
    names = {header.name for header in recording.signals}
    assert set(case.magnitudes) <= names
    for name, (lowest, highest) in case.magnitudes.items():
        samples = recording.read(name)
        assert np.nanmin(samples) >= lowest
        assert np.nanmax(samples) <= highest
        assert np.isfinite(samples).any()


def raw_counts_give_the_samples(case: Case, folder: Path) -> None:
    recording = case.open(folder)
    for header in recording.signals:
        raw = recording.raw(header.name)
        if raw is not None:
            np.testing.assert_allclose(raw.gain * raw.counts + raw.offset, recording.read(header.name), rtol=1e-12)
            assert raw.unit == header.unit
            count = raw.counts.size
            for start, stop in ((0, count // 2), (count // 3, None), (count, None), (1, min(2, count))):
                part = recording.raw(header.name, start, stop)
                assert part is not None
                assert (part.gain, part.offset, part.unit) == (raw.gain, raw.offset, raw.unit)
                np.testing.assert_array_equal(part.counts, raw.counts[start:stop])


def a_missing_file_is_a_read_error(case: Case, folder: Path) -> None:
    with pytest.raises(ReadError):
        case.reader.open(folder / "missing", case.declared)


def a_cut_file_is_refused_or_shorter_with_a_note(case: Case, folder: Path) -> None:
    whole = read_everything(case.open(folder))
    size = len(case.content)
    places = sorted(
        {*range(min(size, 25)), *np.linspace(0, size - 1, 70).astype(int).tolist(), *range(size - 25, size)}
    )
    for at in places:
        cut = case.content[: max(at, 0)]
        left = outcome(case, folder, cut)
        if left is None:
            continue
        shorter = any(len(left.samples.get(name, ())) < len(samples) for name, samples in whole.samples.items())
        for name, samples in left.samples.items():
            np.testing.assert_array_equal(samples, whole.samples[name][: len(samples)], f"{name} cut at byte {at}")
        if shorter and not case.cut_is_invisible(cut):
            assert set(left.notes) - set(whole.notes), f"cut at byte {at}: fewer samples without a note"


def flipped_bytes_are_refused_or_read(case: Case, folder: Path, flips: list[tuple[float, int]]) -> None:
    """Overwrite bytes at places given as a share of the file."""
    content = bytearray(case.content)
    for place, value in flips:
        content[int(place * (len(content) - 1))] = value
    outcome(case, folder, bytes(content))


RULES = (
    claims_its_own_file,
    headers_come_before_samples,
    samples_have_the_promised_dtype,
    a_part_equals_the_whole_cut,
    parts_concatenate,
    what_was_read_is_the_callers_own,
    the_time_base_is_as_long_as_the_samples,
    stamps_increase_strictly,
    an_unknown_name_says_which_exist,
    magnitudes_are_plausible,
    raw_counts_give_the_samples,
    a_missing_file_is_a_read_error,
    a_cut_file_is_refused_or_shorter_with_a_note,
)
"""The rules that need nothing but a case."""
