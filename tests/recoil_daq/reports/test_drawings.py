"""`explain` looks at what a reader holds: page, paper copy, figures and their script, byte by byte."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from pypdf import PdfReader

from recoil_acquisition.numerics.linear_algebra import on_one_thread
from recoil_acquisition.packages.extras import Extra
from recoil_daq import identify_file
from recoil_daq.reports import drawings
from recoil_daq.reports.forms import Forms
from recoil_daq.reports.output import Pages
from recoil_daq.reports.reproduction.kept_report import Kept
from recoil_daq.reports.reproduction.recomputed import Recomputed, recompute
from recoil_identification.report.document.report_files import sealed
from recoil_identification.report.document.reproduction import Comparison
from recoil_identification.report.paper.typeset import png_bytes

HEADER = 'number = "TR-7"\nunits = ["bar", "g"]\n'
FIGURE = "figures/mass"


@pytest.fixture(scope="module")
def home(stored: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A shot, and its report in all forms, with an identity of its own; not to be changed."""
    folder = tmp_path_factory.mktemp("drawn")
    (folder / "shots").mkdir()
    shutil.copy(stored, folder / "shots")
    (folder / "header.toml").write_text(HEADER, encoding="utf-8")
    identify_file(
        folder / "shots" / "0001.h5", out=folder / "reports", pdf=True, figures=True, header=folder / "header.toml"
    )
    return folder


@pytest.fixture(scope="module")
def done(home: Path) -> Recomputed:
    """The report made again, whose drawings are drawn once for each of its forms."""
    found = on_one_thread(recompute)(Kept.read(home / "reports" / "0001"))
    pages: dict[tuple[Forms, str], Pages] = {}

    def draw_once(document: Mapping[str, Any], forms: Forms) -> Pages:
        asked = forms, document["provenance"]["digest"]
        if asked not in pages:
            pages[asked] = found.again.draw(document, forms)
        return pages[asked]

    return replace(found, again=replace(found.again, draw=draw_once))


@pytest.fixture
def folder(home: Path, tmp_path: Path) -> Path:
    """The folder of the report, to be changed."""
    shutil.copytree(home / "reports", tmp_path / "reports")
    return tmp_path / "reports" / "0001"


@pytest.fixture(scope="module")
def pictures() -> Callable[[tuple[str, ...]], list[bytes]]:
    return cache(lambda svg: png_bytes(list(svg)))


@pytest.fixture(autouse=True)
def _pictures_once(monkeypatch: pytest.MonkeyPatch, pictures: Callable[[tuple[str, ...]], list[bytes]]) -> None:
    """Draw the same pictures once: typst takes a second for them."""
    monkeypatch.setattr(drawings, "png_bytes", lambda svg: pictures(tuple(svg)))


@on_one_thread
def checked(done: Recomputed, folder: Path, *shots: Path) -> Comparison:
    return replace(done, kept=Kept.read(folder)).whole(shots)


@pytest.mark.whole_way
def test_all_that_was_written_comes_again_to_the_byte(done: Recomputed, home: Path) -> None:
    found = checked(done, home / "reports" / "0001")
    assert found.again
    assert not found.not_compared
    kinds = (".html", ".pdf", ".svg", ".png")
    written = [path for path in (home / "reports" / "0001").rglob("*") if path.suffix in kinds]
    assert len(found.drawings) == len(written) + 1
    assert {"report.html", "report.pdf", "plotly.min.js", f"{FIGURE}.svg", f"{FIGURE}.png"} <= set(found.drawings)


@pytest.mark.whole_way
@pytest.mark.parametrize("name", ["report.html", "report.pdf", f"{FIGURE}.svg", f"{FIGURE}.png", "../plotly.min.js"])
@pytest.mark.parametrize("change", ["digit", "longer", "gone"])
def test_a_file_that_was_changed_or_taken_away_is_one_line(
    done: Recomputed, folder: Path, name: str, change: str
) -> None:
    path = folder / name
    content = path.read_bytes()
    if change == "gone":
        path.unlink()
    else:
        place = len(content) // 2
        other = bytes([content[place] ^ 1])
        path.write_bytes(content[:place] + other + content[place + 1 :] if change == "digit" else content + b" ")
    found = checked(done, folder)
    if (name, change) == ("../plotly.min.js", "gone"):
        assert found.again  # the page shows its drawings then
        return
    (difference,) = found.differences
    assert path.name in str(difference)
    assert not found.again


@pytest.mark.whole_way
def test_a_paper_copy_that_was_put_beside_a_report_without_one_is_a_difference(done: Recomputed, folder: Path) -> None:
    document = json.loads((folder / "report.json").read_text("utf-8"))
    document["provenance"]["drawn"]["pdf"] = False
    (folder / "report.json").write_text(json.dumps(sealed(document)), encoding="utf-8")
    keys = [one.key for one in checked(done, folder).differences]
    assert "report.pdf" in keys


@pytest.mark.whole_way
def test_what_cannot_be_typeset_is_said_and_does_not_come_again(
    done: Recomputed, home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Extra, "is_installed", property(lambda self: self.name != "pdf"))
    found = checked(done, home / "reports" / "0001")
    assert not found.differences
    assert not found.again
    (line,) = [str(one) for one in found.not_compared if one.file == "report.pdf"]
    assert line.startswith("report.pdf was not compared: typst, which typesets it, is not installed: pip install")
    assert "report.html" in found.drawings
    assert f"{FIGURE}.svg" in found.drawings


@pytest.mark.whole_way
def test_a_file_of_somebody_else_is_named_as_not_compared(done: Recomputed, folder: Path) -> None:
    (folder / "beside.html").write_text("x", encoding="utf-8")
    found = checked(done, folder)
    assert found.again
    assert [one.file for one in found.not_compared] == ["beside.html"]


@pytest.mark.whole_way
def test_a_changed_shot_file_in_the_folder_that_was_named_is_always_told(
    done: Recomputed, home: Path, tmp_path: Path, run: Callable[..., Any]
) -> None:
    other = tmp_path / "0001.h5"
    content = bytearray((home / "shots" / "0001.h5").read_bytes())
    content[len(content) // 2] ^= 1
    other.write_bytes(content)
    (difference,) = checked(done, home / "reports" / "0001", tmp_path).differences
    assert str(other) in str(difference)
    assert checked(done, home / "reports" / "0001", home / "shots").again
    result = run("explain", home / "reports" / "0001", "--check", "--shots", tmp_path, "--workers", 1)
    assert result.exit_code == 1
    assert "0 of 1 documents come again" in result.output


@pytest.mark.whole_way
def test_a_report_of_an_earlier_version_is_explained_and_its_page_named(
    folder: Path, home: Path, run: Callable[..., Any]
) -> None:
    document = json.loads((folder / "report.json").read_text("utf-8"))
    del document["provenance"]["drawn"]
    (folder / "report.json").write_text(json.dumps(sealed(document)), encoding="utf-8")
    result = run("explain", folder, "mass.value", "--shots", home / "shots")
    assert result.exit_code == 0, result.output
    said = " ".join(result.output.split())
    for name in ("report.html", "report.pdf"):
        assert f"{name} was not compared: its document was written before" in said


@pytest.mark.whole_way
@pytest.mark.parametrize("drawn", [7, {}, {"pdf": 1, "figures": False, "standalone": False, "script": "", "typst": ""}])
def test_something_else_in_the_place_of_the_forms_is_one_line(
    folder: Path, drawn: Any, home: Path, run: Callable[..., Any]
) -> None:
    document = json.loads((folder / "report.json").read_text("utf-8"))
    document["provenance"]["drawn"] = drawn
    (folder / "report.json").write_text(json.dumps(sealed(document)), encoding="utf-8")
    result = run("explain", folder, "mass", "--shots", home / "shots")
    assert result.exit_code == 3
    assert "this is no report of a shot that can be made again" in result.stderr


@pytest.mark.whole_way
def test_page_and_paper_bear_the_documents_own_digest(home: Path) -> None:
    folder = home / "reports" / "0001"
    digest = json.loads((folder / "report.json").read_text("utf-8"))["provenance"]["digest"]
    assert digest in (folder / "report.html").read_text("utf-8")
    text = "".join(page.extract_text() for page in PdfReader(folder / "report.pdf").pages)
    assert digest in "".join(text.split())
