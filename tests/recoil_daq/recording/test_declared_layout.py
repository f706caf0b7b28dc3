"""A source's declared layout chooses the reader of its files, and nothing else's."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from recoil_acquisition.errors import UnknownFormatError
from recoil_acquisition.readers.text.declared_table import DeclaredTextReader
from recoil_daq.recording.ingest import reader_of
from recoil_rigs.rig import Rig, load_rig
from tests.builders import text_tables as build
from tests.builders import vendor_files


def laid_out(match: str | None) -> Rig:
    """Return a bundled rig whose recorder declares the layout of its tables."""
    rig = load_rig("mixed")
    sources = tuple(
        s.model_copy(update={"layout": build.DECLARED_LAYOUT, "match": match}) if s.kind == "dewetron" else s
        for s in rig.sources
    )
    assert sum(s.layout is not None for s in sources) == 1
    return replace(rig, sources=sources)


def written(folder: Path, name: str, content: bytes) -> Path:
    path = folder / name
    path.write_bytes(content)
    return path


def test_a_file_of_the_pattern_is_read_by_the_declared_layout_whatever_is_in_it(tmp_path: Path) -> None:
    for content in (build.DECLARED, vendor_files.dewesoft_text(vendor_files.motion_rows())):
        assert reader_of(written(tmp_path, "bench_7.tab", content), laid_out("bench_*")).name == DeclaredTextReader.name


def test_without_a_pattern_only_what_no_reader_recognises_is_read_by_it(tmp_path: Path) -> None:
    rig = laid_out(None)
    assert reader_of(written(tmp_path, "x.tab", build.DECLARED), rig).name == DeclaredTextReader.name
    known = written(tmp_path, "y.tab", vendor_files.dewesoft_text(vendor_files.motion_rows()))
    assert reader_of(known, rig).name == "Dewesoft text export"


def test_a_file_beside_the_pattern_is_never_read_by_it(tmp_path: Path) -> None:
    with pytest.raises(UnknownFormatError):
        reader_of(written(tmp_path, "x.tab", build.DECLARED), laid_out("bench_*"))


def test_a_rig_without_a_layout_leaves_the_table_unknown(tmp_path: Path) -> None:
    with pytest.raises(UnknownFormatError):
        reader_of(written(tmp_path, "x.tab", build.DECLARED), load_rig("mixed"))
