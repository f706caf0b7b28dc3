"""A file of any format that is still being written says by a code that its end is missing, or that it may be."""

from __future__ import annotations

import json
import zlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from recoil_acquisition.conformance import Case
from recoil_acquisition.errors import CorruptFileError, FileEnd, MissingChannelError, ReadError, UnknownFormatError
from recoil_acquisition.readers.table import recognise
from recoil_daq.cli import app
from recoil_rigs.twin import simulate_shot
from tests.builders.virtual_shots import SHORTER, with_twin
from tests.contracts.test_reader_rules import CASES, DECLARED_CASES, damaged

PLACES = 24


def cuts(content: bytes) -> Iterator[bytes]:
    """Beginnings of a file as a copy leaves them: at even places, and at others that its content draws."""
    drawn = np.random.default_rng(zlib.crc32(content)).integers(1, len(content), PLACES)
    for at in sorted({*np.linspace(1, len(content) - 1, PLACES).astype(int).tolist(), *drawn.tolist()}):
        yield content[:at]


def _refusal(case: Case, path: Path, content: bytes) -> ReadError | str | None:
    """Why a file is not taken as whole: an error, or how it shows that it was cut off; None if nothing is."""
    path.write_bytes(content)
    try:
        if case not in DECLARED_CASES:
            recognise(path)
        recording = case.reader.open(path, case.declared)
        for header in recording.signals:
            recording.read(header.name)
    except ReadError as error:
        return error
    return recording.incomplete or None


@pytest.mark.parametrize("case", damaged([*CASES, *DECLARED_CASES]))
def test_a_file_that_is_cut_anywhere_may_be_waited_for(case: Case, tmp_path: Path) -> None:
    told = 0
    for cut in cuts(case.content):
        error = _refusal(case, tmp_path / "file", cut)
        if isinstance(error, ReadError):
            assert error.file_end != FileEnd.THERE, f"{len(cut)} bytes: {error}"
        told += error is not None
    # but for formats whose rows or entries end as a file does, every cut is told
    visible = [cut for cut in cuts(case.content) if not case.cut_is_invisible(cut)]
    assert told >= len(visible) - 4


@pytest.mark.parametrize("case", [*CASES, *DECLARED_CASES], ids=lambda case: case.name)
def test_what_a_whole_file_is_refused_for_is_not_its_end(case: Case, tmp_path: Path) -> None:
    recording = case.open(tmp_path)
    assert not recording.incomplete or case.name in ("mdf3-unfinished", "oxygen-unfinished")
    with pytest.raises(MissingChannelError) as caught:
        recording.read("no such signal")
    assert caught.value.file_end == FileEnd.THERE


def test_an_error_says_whether_the_end_of_its_file_may_be_missing() -> None:
    assert CorruptFileError("x").file_end == UnknownFormatError(Path("a"), (), ("b",)).file_end == FileEnd.UNCLEAR
    assert ReadError("x").file_end == MissingChannelError("a", ("b",)).file_end == FileEnd.THERE
    assert CorruptFileError("x", file_end=FileEnd.MISSING).file_end == FileEnd.MISSING


def test_the_document_of_a_refused_file_holds_the_code(tmp_path: Path) -> None:
    shot = simulate_shot(with_twin("field-2013", **SHORTER), tmp_path / "0001", seed=1, shot="0001")
    recorder = next(file for file in shot.files if "dewetron" in file.name)
    content = recorder.read_bytes()
    recorder.write_bytes(content[: len(content) // 2 + 3])
    words = ["ingest", str(tmp_path / "0001" / "rig.toml"), *map(str, shot.files), "--out", str(tmp_path), "--json"]
    document = json.loads(CliRunner().invoke(app, words).stdout)
    assert (document["error"], document["file_end"], document["path"]) == ("CorruptFileError", "missing", str(recorder))
