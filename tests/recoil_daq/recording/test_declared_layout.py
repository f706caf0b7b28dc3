"""A source's declared layout chooses the reader of its files, and nothing else's."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from recoil_acquisition.conformance import Case
from recoil_acquisition.errors import ReadError, UnknownFormatError
from recoil_acquisition.readers.head import Claim, Head
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.readers.table import OthersReader, recognise
from recoil_acquisition.readers.text.declared_table import DeclaredTextReader
from recoil_daq.recording.file_summary import open_recording
from recoil_daq.recording.ingest import reader_of
from recoil_rigs.rig import Rig, load_rig
from tests.builders import text_tables as build
from tests.builders import vendor_files
from tests.builders.shared_data import shared_file
from tests.contracts.test_reader_rules import CASES


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
    reader = reader_of(known, rig)
    assert reader.name == "Dewesoft text export"
    with pytest.raises(ReadError, match=r"declares a layout, and the file was recognised without it; .*add `match`"):
        reader.open(known, rig.declarations(next(s for s in rig.sources if s.layout is not None)))


@pytest.mark.parametrize("case", [case for case in CASES if case.declared.framing is None], ids=lambda case: case.name)
def test_no_reader_passes_over_a_layout_that_its_source_declares(case: Case, tmp_path: Path) -> None:
    with pytest.raises(ReadError, match="add `match`"):
        replace(case, declared=replace(case.declared, layout=build.DECLARED_LAYOUT)).open(tmp_path)


def test_readers_of_other_packages_do_not_either(tmp_path: Path) -> None:
    class Other:
        name, kind, suffixes = "other", "dewetron", (".oth",)

        def claims(self, _head: Head) -> Claim:
            return Claim.CERTAIN

        def open(self, path: Path, _declared: Declarations) -> Recording:
            raise AssertionError(path)

    with pytest.raises(ReadError, match="add `match`"):
        OthersReader(Other()).open(tmp_path, Declarations("dewetron", layout=build.DECLARED_LAYOUT))


def test_a_file_of_a_kind_that_no_source_is_goes_to_the_one_with_a_layout(tmp_path: Path) -> None:
    rig = laid_out(None)
    rig = replace(rig, sources=tuple(s for s in rig.sources if s.kind != "camera"))
    path = written(tmp_path, "x.txt", vendor_files.tracks_text())
    assert recognise(path, {"camera"}).kind == "camera"
    assert reader_of(path, rig).name == DeclaredTextReader.name


def test_a_file_beside_the_pattern_is_never_read_by_it(tmp_path: Path) -> None:
    with pytest.raises(UnknownFormatError):
        reader_of(written(tmp_path, "x.tab", build.DECLARED), laid_out("bench_*"))


def test_a_rig_without_a_layout_leaves_the_table_unknown(tmp_path: Path) -> None:
    with pytest.raises(UnknownFormatError):
        reader_of(written(tmp_path, "x.tab", build.DECLARED), load_rig("mixed"))


def test_reported_tables_count_their_layout_or_name_the_pattern(tmp_path: Path) -> None:
    folder = shared_file("reports/layout_missing.csv").parent
    with pytest.raises(ReadError, match="add `match`"):
        open_recording(folder / "layout_missing.csv", load_rig(folder / "layout_missing.toml"))
    rig = (folder / "layout_missing.toml").read_text(encoding="utf-8")
    matched = tmp_path / "rig.toml"
    matched.write_text(rig.replace('kind = "dewetron"', 'kind = "dewetron"\nmatch = "layout_*"'), encoding="utf-8")
    recording = open_recording(folder / "layout_missing.csv", load_rig(matched))
    np.testing.assert_array_equal(recording.read("acc"), [np.nan if i == 3 else i for i in range(60)])
    assert recording.time_base("acc").step_s == pytest.approx(1e-3)
    imu = open_recording(folder / "imu_pairs.txt", load_rig(folder / "imu_pairs.toml"))
    np.testing.assert_allclose(imu.read("Acc_X"), np.sin(0.1 * np.arange(200)), atol=1e-3)
    assert imu.time_base("Acc_X").rate_hz == pytest.approx(100.0)
