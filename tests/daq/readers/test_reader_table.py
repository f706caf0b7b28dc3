from __future__ import annotations

from pathlib import Path

import pytest

from recoil_acquisition.errors import ReadError, UnknownFormatError
from recoil_acquisition.readers import table
from recoil_acquisition.readers.table import READERS, read_head, recognise
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


BARE = build.tracks_text(header=None)
WHOLE = "".join(f"{i},{72500 + 833 * i},{-83 + 60 * i},{i % 7},0,0\n" for i in range(1, 41)).encode()
TEMA = b"Time [s]\tPoint#1 X [mm]\tPoint#1 Y [mm]\n" + b"0.0\t1.5\t2.5\n0.1\t1.6\t2.5\n"
CATMAN = b"HBM catman data\nZeit\tKraft\tWeg\ns\tkN\tmm\n" + b"0,0\t1,5\t2,5\n0,1\t1,6\t2,5\n"


@pytest.mark.parametrize(
    ("content", "kind", "name"),
    [
        (BARE, "camera", "ProAnalyst text"),
        (WHOLE, "camera", "ProAnalyst text"),
        (TEMA, "dewetron", "OXYGEN text export"),
        (CATMAN, "dewetron", "OXYGEN text export"),
    ],
)
def test_a_table_that_only_its_shape_speaks_for_is_what_a_rig_says(
    content: bytes, kind: str, name: str, tmp_path: Path
) -> None:
    path = tmp_path / "a.csv"
    path.write_bytes(content)
    for kinds in ((), ("can", "serial"), ("camera",) if kind == "dewetron" else ("dewetron",)):
        with pytest.raises(UnknownFormatError, match=rf'say in a rig whose it is.*`kind = "{kind}"`'):
            recognise(path, kinds)
    assert recognise(path, (kind,)).name == name
    assert recognise(path, ("camera", "can", "dewetron")).name == name


OWN_WORDS = ("Time [s],AI 1/1 [V]", "Time [s],AI 2/I3 Sim_AVG [A]", "Recorded by DEWETRON OXYGEN\nTime [s],a [V]")


@pytest.mark.parametrize("header", OWN_WORDS)
def test_oxygens_own_words_are_enough(header: str, tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text(f"{header}\n0.0,1.5\n0.1,1.6\n")
    assert recognise(path).name == "OXYGEN text export"


COMTRADE = "STATION,DEVICE,2013\r\n6, 4A,2D\r\n1,IA ,,Line, A,0.1,0.05,0,-32768,32767,933,1,s\r\n"


@pytest.mark.parametrize("suffix", [".cfg", ".CFG"])
def test_a_record_of_a_protection_relay_is_named_whatever_a_rig_says(suffix: str, tmp_path: Path) -> None:
    (tmp_path / f"a{suffix}").write_text(COMTRADE)
    (tmp_path / "a.dat").write_bytes(WHOLE)
    for name in ("a.dat", f"a{suffix}"):
        with pytest.raises(UnknownFormatError, match=r"found COMTRADE.*export it as a table of text") as caught:
            recognise(tmp_path / name, ("camera", "dewetron"))
        assert "\n" not in str(caught.value)


def test_a_real_record_of_a_protection_relay_is_named() -> None:
    for name in ("sample_ascii.dat", "sample_ascii.cfg"):
        with pytest.raises(UnknownFormatError, match="COMTRADE"):
            recognise(shared_file(f"other/{name}"), ("camera",))


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
