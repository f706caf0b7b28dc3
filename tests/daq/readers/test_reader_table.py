from __future__ import annotations

from pathlib import Path

import pytest

from daq.errors import ReadError, UnknownFormatError
from daq.readers import table
from daq.readers.table import READERS, read_head, recognise
from tests.builders import vendor_files as build
from tests.builders.shared_data import shared_file


@pytest.mark.parametrize(
    ("content", "name"),
    [
        (build.dewesoft_text(build.motion_rows()), "Dewesoft text export"),
        (build.tracks_text(), "ProAnalyst text"),
        (build.asc_log(build.can_entries()), "Vector ASC log"),
        (build.blf_log(build.can_entries()), "Vector BLF log"),
        (build.candump_log(build.can_entries()), "candump log"),
        (build.serial_capture(build.serial_frames()), "serial capture"),
    ],
)
def test_a_file_finds_its_reader_by_content_under_any_name(content: bytes, name: str, tmp_path: Path) -> None:
    path = tmp_path / "misleading.blf"
    path.write_bytes(content)
    assert recognise(path).name == name


@pytest.mark.parametrize(
    "content", [b"hello\n", b"\0" * 200, b'{"a": 1}', b'schema = "x"\n', b"\xff\xfe", b"a,b\n1,2\n"]
)
def test_a_file_that_no_reader_claims_says_where_the_formats_are_listed(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_bytes(content)
    with pytest.raises(UnknownFormatError, match=r"recoil-daq formats. lists.*`layout` of its source") as caught:
        recognise(path)
    assert caught.value.candidates == ()


def test_two_claims_name_the_candidates(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.blf"
    path.write_bytes(build.blf_log(build.can_entries()))
    monkeypatch.setattr(table, "READERS", (*READERS, next(r for r in READERS if r.name == "Vector BLF log")))
    with pytest.raises(UnknownFormatError) as caught:
        recognise(path)
    assert caught.value.candidates == ("Vector BLF log", "Vector BLF log")


def test_missing_empty_and_directory_are_named(tmp_path: Path) -> None:
    (tmp_path / "empty").write_bytes(b"")
    for name, problem in (("none", "no such file"), ("empty", "is empty"), (".", "is a directory")):
        with pytest.raises(ReadError, match=problem):
            read_head(tmp_path / name)


def test_names_of_readers_are_unique_and_kinds_are_those_of_sources() -> None:
    assert len({reader.name for reader in READERS}) == len(READERS)
    assert {reader.kind for reader in READERS} == {"dewetron", "can", "serial", "camera"}


@pytest.mark.parametrize(
    ("name", "reader"),
    [
        ("tracks/SYNTHETIC_accel_20kHz.csv", "Dewesoft text export"),
        ("tracks/SYNTHETIC_deeplabcut.csv", "DeepLabCut"),
        ("tracks/SYNTHETIC_truth.json", None),
        ("tracks/tracker_export_brocku_snippets.txt", None),
        ("dewetron/simple.dmd", "DEWETRON OXYGEN recording"),
        ("dewetron/Example_Drive01.d7d", "Dewesoft recording"),
        ("can/test_CanMessage.trc", "PEAK TRC trace"),
        ("can/rig_shot/rig_shot.csv", "python-can CSV log"),
        ("can/rig_shot/rig_shot.mf4", "MDF4 bus logging"),
        ("can/vehicle.dbc", None),
        ("containers/raw1.tdms", "TDMS"),
        ("serial/mip_data.bin", None),
        ("shots/plain/rig.toml", None),
    ],
)
def test_real_files_find_their_reader_and_other_formats_none(name: str, reader: str | None) -> None:
    path = shared_file(name)
    if reader is None:
        with pytest.raises(UnknownFormatError):
            recognise(path)
    else:
        assert recognise(path).name == reader
