"""NUL bytes behind a sound text, as power that fails leaves them in a file that was allocated beforehand."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pytest

from recoil_acquisition.readers.head import HEAD_BYTES
from recoil_acquisition.readers.reader import Declarations, Reader
from recoil_acquisition.readers.recording import Recording
from recoil_acquisition.readers.table import READERS, TableReader, recognise
from tests.builders import can_logs
from tests.builders import container_files as build
from tests.builders.long_texts import LONG_TEXTS
from tests.builders.shared_data import shared_file
from tests.builders.vendor_files import DBC, asc_log, can_entries, candump_log

DECLARED = Declarations("c", database=DBC, frame_rate_hz=1000.0, scale_mm_per_px=1.0)


def opened(folder: Path, content: bytes, reader: Reader | None = None, declared: Declarations = DECLARED) -> Recording:
    path = folder / "a.csv"
    path.write_bytes(content)
    return (reader or recognise(path, {"dewetron", "camera"})).open(path, declared)


def everything(recording: Recording) -> dict[str, list[float]]:
    return {s.name: recording.read(s.name).tolist() for s in recording.signals}


@pytest.mark.parametrize("name", LONG_TEXTS)
@pytest.mark.parametrize(
    ("size", "nul_bytes"),
    [
        (3_000, 500),
        *(
            pytest.param(size, nul_bytes, marks=pytest.mark.exhaustive)
            for size in (3_000, 3 * HEAD_BYTES)
            for nul_bytes in (1, 500, 2 * HEAD_BYTES)
            if (size, nul_bytes) != (3_000, 500)
        ),
    ],
)
def test_every_text_is_read_up_to_its_nul_bytes_and_told_as_cut(name, size, nul_bytes, tmp_path):
    text = LONG_TEXTS[name]
    content = text.content(size).rstrip(b"\n") + b"\n"
    whole = opened(tmp_path, content, text.reader, text.declared)
    values = everything(whole)
    known = isinstance(text.reader, TableReader) and text.reader in READERS
    recording = opened(tmp_path, content + b"\0" * nul_bytes, None if known else text.reader, text.declared)
    assert recording.reader == text.reader.name
    assert str(everything(recording)) == str(values)
    assert ("" if name == "uff" else f"{nul_bytes} ") + "NUL bytes" in recording.incomplete
    assert any("NUL bytes" in note for note in recording.notes)


@pytest.mark.parametrize("name", LONG_TEXTS)
def test_the_row_in_which_power_failed_is_left_out(name, tmp_path):
    text = LONG_TEXTS[name]
    content = text.content(5_000).rstrip(b"\r\n")
    cut = content[: max(content.rfind(b"\n"), content.rfind(b"\r")) + 4]
    if name == "trc" or name.startswith("uff"):
        pytest.skip("its last line is seen to be whole or not by the bytes that it states")
    values = everything(opened(tmp_path, cut, text.reader, text.declared))
    recording = opened(tmp_path, cut + b"\0" * 77, text.reader, text.declared)
    assert str(everything(recording)) == str(values)
    assert "77 NUL bytes" in recording.incomplete


def test_the_shared_file_gives_its_sixty_rows():
    path = shared_file("reports/nul_csv.csv")
    recording = recognise(path).open(path, Declarations("dewetron"))
    assert recording.read("acc").size == 60
    assert np.isfinite(recording.read("acc")).all()
    assert "cut off" in recording.incomplete


@pytest.mark.parametrize(
    "content",
    [
        asc_log(can_entries(30)),
        candump_log(can_entries(30)),
        can_logs.trc_log(can_entries(30)),
        can_logs.can_csv(can_entries(30)),
        can_logs.canedge_csv(can_entries(30)),
    ],
)
@pytest.mark.parametrize("packed", [False, True])
def test_a_log_of_a_bus_keeps_its_frames(content, packed, tmp_path):
    values = everything(opened(tmp_path, content))
    with_nul = content + b"\0" * 300
    recording = opened(tmp_path, gzip.compress(with_nul) if packed else with_nul)
    assert str(everything(recording)) == str(values)
    assert "300 NUL bytes" in recording.incomplete


def test_utf_16_is_no_exception(tmp_path):
    text = "Time (s);a (V)\r\n" + "".join(f"{1e-3 * i:.3f};{i}.5\r\n" for i in range(40))
    recording = opened(tmp_path, text.encode("utf-16") + b"\0" * 100)
    assert recording.read("a").size == 40
    assert "NUL bytes" in recording.incomplete


def test_a_universal_file_names_them(tmp_path):
    recording = opened(tmp_path, build.uff_text(build.ramp()) + b"\0" * 100)
    assert recording.read(recording.signals[0].name).size == 12
    assert "NUL bytes" in recording.incomplete


def test_nothing_but_nul_bytes_is_no_text(tmp_path):
    path = tmp_path / "a.csv"
    path.write_bytes(b"\0" * 5000)
    with pytest.raises(Exception, match="no reader recognises"):
        recognise(path, {"dewetron", "camera"})
