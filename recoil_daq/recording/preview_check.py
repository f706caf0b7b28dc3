"""Comparison of what was read live of an instrument with the file that the instrument wrote itself.

What is read live is a preview: it may have lost samples, or be scaled or dated otherwise. The instrument's own file
takes its place, and says what of the preview was right. The arithmetic is
`recoil_processing.alignment.sample_comparison`; here both are read, laid on one beat, and what is found is worded.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from recoil_acquisition.channel import Step
from recoil_acquisition.clocks.timebase import TimeBase
from recoil_acquisition.errors import Fault, RecoilDaqError
from recoil_acquisition.log.capture import Capture
from recoil_acquisition.quantities.quantity import Unit
from recoil_acquisition.readers.captured import sources_of
from recoil_acquisition.readers.reader import Reader
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.shot.quality_check import Check, QualityCheck
from recoil_processing.alignment.sample_comparison import (
    EXPECTED,
    SampleComparison,
    Sampled,
    beat_numbers,
    compare_records,
    printed_step,
)
from recoil_rigs.rig import ChannelSpec, Rig
from recoil_rigs.shots.assemble import find_signal, si_line, unit_of

COMPARED = "compare with the preview"
"""Operation in a shot's history, whose parameters are the figures of the comparison."""
MOST_COMPARED = 1 << 24
"""Samples of a file that are compared as a whole; of more the part about the shot is, where it was cut out."""
FINE_NS = 10**6
"""Digits of a start, ns, to which two that agree are one, and not two of the same second."""
OTHER_RATE = 1e-3
"""Share by which the rates of preview and file may differ: they are one instrument's."""


@dataclass(frozen=True)
class ComparedPreview:
    """Comparison of the preview of one source with its file.

    Attributes
    ----------
    channels
        Figures by channel.
    checks
        Check of each channel, or of the source where nothing can be compared.
    """

    source: str
    capture: str
    file: str
    channels: Mapping[str, SampleComparison]
    checks: tuple[QualityCheck, ...]

    def step(self, version: str) -> Step:
        """Return the line of the shot's history."""
        channels = {name: one.to_json() for name, one in self.channels.items()}
        said = {check.channel: check.detail for check in self.checks if check.channel not in channels}
        parameters = {"source": self.source, "capture": self.capture, "file": self.file, "channels": channels}
        return Step(COMPARED, version, parameters | ({"not_compared": said} if said else {}))


def marked_previews(captures: Mapping[Path, Capture], matched: Mapping[str, Path]) -> tuple[QualityCheck, ...]:
    """Say of each source of which there is only what was read live that it is a preview.

    Parameters
    ----------
    captures
        Captures among a shot's files.
    matched
        File of each source of the shot.
    """
    text = "what was read live is a preview: the instrument's own file takes its place; drop that into the watched "
    text += "folder, or ingest capture and file again with --overwrite"
    live = [
        source for path, capture in captures.items() for source in _previewed(capture) if matched.get(source) == path
    ]
    return tuple(QualityCheck(source, Check.PREVIEW, "warn", text) for source in live)


def replaced_previews(captures: Mapping[Path, Capture], matched: Mapping[str, Path]) -> frozenset[str]:
    """Return the sources whose instruments' own files took the place of what was read live."""
    sources = [(path, source) for path, capture in captures.items() for source in _previewed(capture)]
    return frozenset(source for path, source in sources if matched.get(source, path) != path)


def _previewed(capture: Capture) -> list[str]:
    """Return the sources of a capture whose instruments write files of their own."""
    sources = [source for source in sources_of(capture) if source.delivered]
    return [one.name for one in sources if one.live_kind is not None and one.live_kind.is_preview]


def compared_previews(
    rig: Rig,
    captures: Mapping[Path, Capture],
    readers: Mapping[Path, Reader],
    matched: Mapping[str, Path],
    opened: Mapping[str, Recording],
    cut: Mapping[str, Recording],
) -> tuple[ComparedPreview, ...]:
    """Compare what was read live with the instruments' own files, of each source of which both were given.

    Parameters
    ----------
    captures
        Captures among a shot's files.
    readers
        Reader of each file.
    matched
        File of each source of the shot.
    opened, cut
        Recording of each source as its file has it, and the part of it about the shot.
    """
    found = []
    for path, capture in captures.items():
        for source in _previewed(capture):
            own = matched.get(source, path)
            if own == path or source not in opened:
                continue
            whole = opened[source]
            if sum(header.sample_count for header in whole.signals) > MOST_COMPARED:
                whole = cut.get(source, whole)
            printed = str(getattr(readers[own], "path", "")).startswith("text.")
            try:
                preview = readers[path].open(path, rig.declarations(rig.source(source)))
                found.append(compared_preview(rig, source, preview, whole, printed=printed))
            except RecoilDaqError as error:
                told = _not_compared(source, str(error))
                found.append(ComparedPreview(source, path.name, own.name, {}, (told,)))
    return tuple(found)


def compared_preview(
    rig: Rig, source: str, preview: Recording, file: Recording, *, printed: bool = False
) -> ComparedPreview:
    """Compare what was read live of a source with its file.

    Parameters
    ----------
    printed
        Whether the file is a text, whose numbers may be rounded to some digits.
    """
    names = preview.path.name, file.path.name
    pairs: dict[str, tuple[Sampled, Sampled]] = {}
    digits: dict[str, float] = {}
    checks: list[QualityCheck] = []
    bases: dict[str, tuple[TimeBase, TimeBase, str]] = {}
    for spec in rig.channels_of(source):
        try:
            pair, base = _pair(rig, spec, preview, file)
        except (RecoilDaqError, ValueError) as error:
            checks.append(_not_compared(spec.name, str(error)))
            continue
        pairs[spec.name], bases[spec.name] = pair, base
        digits[spec.name] = printed_step(pair[1].samples) if printed and not pair[1].count_size else 0.0
    ought, within = _ought(next(iter(bases.values()), None))
    found = compare_records(pairs, expected=ought, within=within, printed=digits)
    checks += _checks(source, found, bases, names[1], timed=ought is not None)
    return ComparedPreview(source, *names, found, tuple(checks))


def _not_compared(about: str, why: str) -> QualityCheck:
    return QualityCheck(about, Check.PREVIEW_COMPARED, "warn", f"not compared with the preview: {why}")


def _pair(
    rig: Rig, spec: ChannelSpec, preview: Recording, file: Recording
) -> tuple[tuple[Sampled, Sampled], tuple[TimeBase, TimeBase, str]]:
    """Read a channel of both, in the file's unit; ValueError where they cannot be laid on one beat."""
    headers = [find_signal(one, spec.signal) for one in (preview, file)]
    faults: list[Fault] = []
    units = [
        unit_of(spec, header, rig.source(spec.source), one.path, faults)
        for header, one in zip(headers, (preview, file), strict=True)
    ]
    ours, whole = (one.time_base(header.name) for one, header in zip((preview, file), headers, strict=True))
    if None in units:
        raise ValueError("; ".join(fault.problem for fault in faults))
    if not whole.count > 1 or not ours.count > 1:
        raise ValueError(f"{ours.count} samples were read live, and {whole.count} are in the file")
    if abs(ours.rate_hz / whole.rate_hz - 1.0) > OTHER_RATE:
        raise ValueError(f"it was read live at {ours.rate_hz:.6g} Hz, and the file has {whole.rate_hz:.6g} Hz")
    step_s = 1.0 / whole.rate_hz
    numbers = [beat_numbers(base.times_s, step_s) for base in (ours, whole)]
    if numbers[0] is None or numbers[1] is None:
        raise ValueError("the stamps of its samples lie on no even beat")
    factor, zero = _to_the_file(spec, units)
    values = preview.read(headers[0].name)
    counted = [one.raw(header.name) for one, header in zip((preview, file), headers, strict=True)]
    sizes = [0.0 if raw is None else abs(raw.gain) for raw in counted]
    samples = values if (factor, zero) == (1.0, 0.0) else factor * values + zero
    pair = (
        Sampled(np.asarray(samples, dtype=np.float64), numbers[0], abs(factor) * sizes[0]),
        Sampled(np.asarray(file.read(headers[1].name), dtype=np.float64), numbers[1], sizes[1]),
    )
    return pair, (ours, whole, headers[1].unit or spec.unit or "")


def _to_the_file(spec: ChannelSpec, units: list[Unit | None]) -> tuple[float, float]:
    """Return factor and offset from the preview's unit to the file's."""
    if units[0] == units[1] or units[0] is None or units[1] is None:
        return 1.0, 0.0
    (factor, zero), (other_factor, other_zero) = (si_line(spec, unit) for unit in units if unit is not None)
    return factor / other_factor, (zero - other_zero) / other_factor


def _ought(bases: tuple[TimeBase, TimeBase, str] | None) -> tuple[int | None, int]:
    """Return at which sample of the file the preview should begin, and by how many that may be off.

    Both count from the instrument's start, or from whole seconds after it, if what they state is apart by whole seconds
    within their digits: a file may state it to the millisecond. Else they lie where they state it.
    """
    if bases is None:
        return None, 0
    starts = [None if base.absolute_start is None else base.absolute_start.exact_ns for base in bases[:2]]
    if starts[0] is None or starts[1] is None:
        return None, 0
    zones = [base.absolute_start.zone == "unknown" for base in bases[:2] if base.absolute_start is not None]
    if zones[0] != zones[1]:
        return None, 0
    apart_ns, digits_ns = starts[0][0] - starts[1][0], max(starts[0][1], starts[1][1])
    seconds = round(apart_ns / 1e9)
    same = abs(apart_ns - seconds * 10**9) < digits_ns <= FINE_NS
    rate_hz = bases[1].rate_hz
    later_s = (float(seconds) if same else apart_ns / 1e9) + bases[0].start_s - bases[1].start_s
    return round(later_s * rate_hz), 0 if same else int(0.5e-9 * digits_ns * rate_hz)


def _checks(
    source: str,
    found: Mapping[str, SampleComparison],
    bases: Mapping[str, tuple[TimeBase, TimeBase, str]],
    file: str,
    *,
    timed: bool,
) -> list[QualityCheck]:
    """Say of a source what all its channels share, and of each channel what is its own."""
    compared = {name: one for name, one in found.items() if one.compared}
    checks = [_not_compared(name, f"nothing of it can be laid on {file}") for name in found if name not in compared]
    if not compared:
        return checks
    equal = [name for name, one in compared.items() if one.proven_equal]
    gaps = {name: _gaps(one, bases[name][1]) for name, one in compared.items()}
    shared = Counter(gaps.values()).most_common(1)[0][0]
    where = "in each channel" if len({*gaps.values()}) == 1 else "in most channels"
    alike = f"; {where} {shared.removeprefix('; ')}" if shared else ""
    own = {name: _values(one, *bases[name][1:]) for name, one in compared.items()}
    own |= {name: own[name] + (mine or "; nothing of it is missing") for name, mine in gaps.items() if mine != shared}
    samples, same = (sum(getattr(one, key) for one in compared.values()) for key in ("compared", "equal"))
    channels = _count(len(compared), "channel")
    if len(equal) == len(found):
        rules = " and ".join(dict.fromkeys(one.rule for one in compared.values()))
        told = f"the preview is proven equal to {file}: {samples} samples of {channels}, {rules}{alike}"
        return [*checks, QualityCheck(source, Check.PREVIEW_COMPARED, "ok", f"{told}; {_laid(compared, timed)}")]
    told = f"of {samples} samples of {channels} compared with the preview {same} are equal"
    proven = f"{len(equal) or 'none'} of {channels} {'is' if len(equal) < 2 else 'are'} proven equal"
    told += f"; {proven}{alike}; {file} counts; {_laid(compared, timed)}"
    checks.append(QualityCheck(source, Check.PREVIEW_COMPARED, "warn", told))
    for name, text in own.items():
        if text:
            one = compared[name]
            counts = f"of {one.compared} samples compared with the preview {one.different} are different"
            checks.append(QualityCheck(name, Check.PREVIEW_COMPARED, "warn", counts + text))
    return checks


def _laid(compared: Mapping[str, SampleComparison], timed: bool) -> str:
    """Say by what the samples were laid on one another."""
    if any(one.aligned_by == EXPECTED for one in compared.values()):
        return "laid on one another by the time of both"
    if timed:
        return "laid on one another by what they show, where the time of both does not put them"
    return "laid on one another by what they show: the times of both do not tell where"


def _gaps(one: SampleComparison, base: TimeBase) -> str:
    """Say where samples are missing, or lie elsewhere; empty if all are there."""
    parts = []
    if one.shift:
        way = "late" if one.shift < 0 else "early"
        samples = _count(abs(one.shift), "sample")
        parts.append(f"the preview is shifted by {samples}, {1e6 * abs(one.shift) / base.rate_hz:.4g} us {way}")
    if one.slip_at is not None:
        fell = "fell out" if one.slip > 0 else "came twice"
        parts.append(f"{_count(abs(one.slip), 'sample')} {fell} without a gap in its time {_place(one.slip_at, base)}")
    if one.missing_in_preview and one.first_missing is not None:
        missing = _count(one.missing_in_preview, "sample")
        parts.append(f"{missing} missing in the preview, the first one {_place(one.first_missing, base)}")
    if one.missing_in_file:
        parts.append(f"{_count(one.missing_in_file, 'sample')} of the preview missing in the file")
    if one.beyond:
        parts.append(f"{_count(one.beyond, 'sample')} beyond the ends of the file")
    return "".join(f"; {part}" for part in parts)


def _values(one: SampleComparison, base: TimeBase, unit: str) -> str:
    """Say by what the values differ; empty if they do not, or only since samples lie elsewhere."""
    if one.first_difference is None or one.values is None or one.slip_at is not None:
        return ""
    parts = []
    if one.scale != 1.0:
        parts.append(f"the preview is {one.scale:.6g} times the file")
    if one.offset:
        parts.append(f"the preview is {one.offset:+.4g} {unit} off the file")
    live, stored = one.values
    parts.append(
        f"the first difference is {_place(one.first_difference, base)}: {live:.9g} {unit}, {stored:.9g} {unit} in "
        f"the file; the largest is {one.largest:.4g} {unit}, beyond {one.rule}"
    )
    return "".join(f"; {part}" for part in parts)


def _place(number: int, base: TimeBase) -> str:
    return f"at {base.start_s + number / base.rate_hz:.6f} s (sample {number})"


def _count(number: int, one: str) -> str:
    return f"{number} {one}{'' if number == 1 else 's'}"
