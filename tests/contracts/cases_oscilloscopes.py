"""Files of the readers of oscilloscopes' text, for the rules that every reader keeps."""

from __future__ import annotations

from recoil_acquisition.conformance import Case
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.table import READERS
from tests.builders.oscilloscope_texts import WAVEFORMS, WrittenWaveform

BY_NAME = {reader.name: reader for reader in READERS}
WITHOUT_COUNT = {"keysight", "rohde-schwarz", "picoscope", "rigol", "rigol-later", "rigol-memory", "rigol-seconds"}
"""Layouts in which nothing states how many rows there are, so that a file that ends behind a row seems whole."""


def _at_line_end(cut: bytes) -> bool:
    return cut.endswith((b"\n", b"\r"))


def _never(_cut: bytes) -> bool:
    return False


def _case(name: str, written: WrittenWaveform) -> Case:
    magnitudes = dict.fromkeys(written.signals, (-100.0, 110.0))
    cut_is_invisible = _at_line_end if name in WITHOUT_COUNT else _never
    return Case(name, BY_NAME[written.maker], written.content, Declarations("dewetron"), magnitudes, cut_is_invisible)


CASES = tuple(_case(name, write(40)) for name, write in WAVEFORMS.items())
