from __future__ import annotations

import re
import subprocess
import sys
import time
from itertools import permutations
from pathlib import Path

import grimp
import h5py
import numpy as np
import pytest

from recoil_acquisition.errors import ReadError, UnknownFormatError
from recoil_acquisition.readers import table
from recoil_acquisition.readers.head import HEAD_BYTES, Head
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.table import BY_LAYOUT, READERS, TableReader, recognise, surest_claim
from tests.builders import container_files, exported_files, track_files
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
        (build.serial_capture(build.serial_frames()), "recoil-daq capture"),
    ],
)
def test_a_file_finds_its_reader_by_content_under_any_name(content: bytes, name: str, tmp_path: Path) -> None:
    path = tmp_path / "misleading.blf"
    path.write_bytes(content)
    assert recognise(path).name == name


@pytest.mark.parametrize("content", [b"hello\n", b"\0" * 200, b'schema = "x"\n', b"\xff\xfe", b"a,b\n1,2\n"])
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
        with pytest.raises(UnknownFormatError, match=rf'say in a rig whose it is.*`kind = "{kind}"`') as caught:
            recognise(path, kinds)
        assert re.search(r"found a table of text of [2-9] columns, which does not say what program", str(caught.value))
        assert not another_maker(str(caught.value).partition("found")[2])
    assert recognise(path, (kind,)).name == name
    assert recognise(path, ("camera", "can", "dewetron")).name == name


def another_maker(text: str) -> re.Match[str] | None:
    """Return the name of a maker in a message, but for the rig's own word for a recorder."""
    return re.search(r"(?i)oxygen|proanalyst|dewe|\.dxd", text.replace('kind = "dewetron"', ""))


@pytest.mark.parametrize("name", ["pico", "rigol", "tek_mso"])
def test_a_table_of_an_oscilloscope_is_not_said_to_be_of_another_maker(name: str) -> None:
    path = shared_file(f"reports/notread_{name}.csv")
    assert recognise(path).name.casefold().startswith(name[:4].strip("_"))


def test_units_in_a_row_of_their_own_over_a_blank_line_are_read() -> None:
    path = shared_file("reports/notread_pico.csv")
    recording = recognise(path, ("dewetron",)).open(path, Declarations("dewetron"))
    assert [(s.name, s.unit) for s in recording.signals] == [("Channel A", "V"), ("Channel B", "mV")]
    np.testing.assert_allclose(recording.read("Channel A"), np.sin(0.1 * np.arange(200)), atol=6e-6)
    np.testing.assert_allclose(recording.time_base("Channel B").times_s, 1e-6 * np.arange(200), rtol=1e-12)


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
        with pytest.raises(UnknownFormatError, match=r"this is a COMTRADE record.*export it as a table") as caught:
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


@pytest.mark.parametrize("unit", [b" ", b"\n", b" \n", b'"', b"#", b"1,", b"time ", b"t\n", b"\t-1\n"])
def test_what_repeats_itself_is_recognised_at_once(unit: bytes) -> None:
    begin = time.process_time()
    surest_claim(Head(unit * (HEAD_BYTES // len(unit))))
    assert time.process_time() - begin < 2.0


def test_missing_empty_and_directory_are_named(tmp_path: Path) -> None:
    (tmp_path / "empty").write_bytes(b"")
    for name, problem in (("none", "no such file"), ("empty", "is empty"), (".", "is a directory")):
        with pytest.raises(ReadError, match=problem):
            Head.of(tmp_path / name)


def hdf5_behind(block_bytes: int) -> bytes:
    def fill(file: h5py.File) -> None:
        file.create_dataset("acc", data=range(20)).attrs["sample_rate"] = 1e3

    return container_files.hdf5_file(fill, userblock_size=block_bytes)


@pytest.mark.parametrize("block_bytes", [0, 512, 1024, 2048, 4096, 8192, 16384, 32768])
def test_hdf5_is_recognised_behind_what_a_user_put_before_it(block_bytes: int, tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(hdf5_behind(block_bytes))
    assert recognise(tmp_path / "a").name == "HDF5"


@pytest.mark.parametrize("more_bytes", [1, 511, 1024])
def test_hdf5_at_any_other_place_is_none(more_bytes: int, tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(bytes(more_bytes) + hdf5_behind(512))
    with pytest.raises(UnknownFormatError):
        recognise(tmp_path / "a")


CONTAINED = {
    "Dewesoft recording": b"MULTI_STREAM_FILE_VER0200".ljust(8192),
    "TDMS": container_files.small_tdms(),
    "recoil-daq Parquet": exported_files.parquet_file(),
    "ProAnalyst workbook": track_files.workbook({"Tracks": track_files.workbook_rows()}),
}


@pytest.mark.parametrize(
    "reader", [r for r in READERS if isinstance(r, TableReader) and r.extra is not None], ids=lambda reader: reader.name
)
def test_a_format_whose_library_is_missing_is_recognised_and_says_what_to_install(
    reader: TableReader, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert reader.extra is not None
    (tmp_path / "a").write_bytes(CONTAINED[reader.name])
    monkeypatch.setitem(sys.modules, reader.extra.module, None)
    assert recognise(tmp_path / "a") == reader
    with pytest.raises(ReadError, match=f"{reader.extra.module}.*pip install '{reader.extra.requirement}'"):
        reader.open(tmp_path / "a", Declarations("a"))


def test_what_is_recognised_is_read_by_its_reader(tmp_path: Path) -> None:
    rows = build.motion_rows()
    (tmp_path / "a").write_bytes(build.dewesoft_text(rows))
    recording = recognise(tmp_path / "a").open(tmp_path / "a", Declarations("a"))
    assert recording.read(recording.signals[0].name).tolist() == pytest.approx([acc for _, acc, _ in rows])


@pytest.mark.exhaustive
def test_a_text_is_recognised_without_the_modules_of_other_formats(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_bytes(build.dewesoft_text(build.motion_rows()))
    program = (
        "import sys; from pathlib import Path; from recoil_acquisition.readers.table import recognise;"
        "print(recognise(Path(sys.argv[1])).name, *sys.modules, sep='\\n')"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, str(tmp_path / "a.csv")], capture_output=True, text=True, check=True
    )
    name, *modules = done.stdout.split("\n")
    assert name == "Dewesoft text export"
    heavy = {"h5py", "scipy", "cantools", "can", "pandas", "asammdf", "nptdms", "pyarrow", "openpyxl", "numba"}
    assert not heavy & set(modules)
    families = {m.split(".")[2] for m in modules if m.startswith("recoil_acquisition.readers.") and m.count(".") > 2}
    assert families == {"hdf5", "text", "time", "tracks"}
    assert {m for m in modules if m.startswith("recoil_acquisition.readers.hdf5.")} == {
        "recoil_acquisition.readers.hdf5.kind", "recoil_acquisition.readers.hdf5.rehearsal",
    }  # fmt: skip


def test_every_row_of_the_table_names_a_reader_of_its_name() -> None:
    for reader in (*READERS, *BY_LAYOUT.values()):
        assert isinstance(reader, TableReader)
        assert reader._loaded.name == reader.name


def test_readers_do_not_know_each_other() -> None:
    graph = grimp.build_graph("recoil_acquisition")
    rows = [reader for reader in (*READERS, *BY_LAYOUT.values()) if isinstance(reader, TableReader)]
    modules = {f"recoil_acquisition.readers.{reader.path.partition(':')[0]}" for reader in rows}
    assert len(modules) > 20
    assert modules <= graph.modules
    chains = [(a, b) for a, b in permutations(sorted(modules), 2) if graph.chain_exists(importer=a, imported=b)]
    assert chains == []


def test_the_page_of_formats_names_every_format() -> None:
    page = (Path(__file__).parents[3] / "docs" / "formats.md").read_text(encoding="utf-8").casefold()
    names = [reader.name for reader in (*READERS, *BY_LAYOUT.values())]
    unnamed = [name for name in names if not all(word in page for word in name.casefold().split())]
    assert not unnamed, f"formats that docs/formats.md does not name: {unnamed}"


def test_names_of_readers_are_unique_and_kinds_are_those_of_sources() -> None:
    assert len({reader.name for reader in READERS}) == len(READERS)
    assert {reader.kind for reader in READERS} == {"dewetron", "can", "camera", "live"}


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
