"""One shot and one campaign wherever they are handed over: document, page, paper, tables, workbook and Python agree."""

from __future__ import annotations

import csv
import io
import json
import math
import re
from collections.abc import Iterator
from decimal import ROUND_HALF_EVEN, Decimal
from html import unescape
from pathlib import Path
from typing import Any, NamedTuple

import openpyxl
import pytest
from pypdf import PdfReader

from recoil_acquisition.store import write_shot
from recoil_daq import read_report
from recoil_daq.campaigns.campaign import campaign
from recoil_daq.reports.identify import identify_file
from recoil_daq.reports.shot_index import index_shots
from recoil_identification.report.page.packing import unpacked
from tests.builders.campaign_reports import write_reports
from tests.builders.campaign_summaries import campaign_of
from tests.builders.virtual_shots import virtual_shot

SIXTEEN_DIGITS = 1e-15
"""What a workbook keeps of a number."""
TAGS = re.compile(r"<[^>]+>")


class HandedOver(NamedTuple):
    """A document with its page, as text, and its paper copy."""

    folder: Path
    name: str

    @property
    def document(self) -> dict[str, Any]:
        return dict(json.loads((self.folder / f"{self.name}.json").read_text("utf-8")))

    @property
    def page(self) -> str:
        return (self.folder / f"{self.name}.html").read_text("utf-8")

    @property
    def paper(self) -> PdfReader:
        return PdfReader(self.folder / f"{self.name}.pdf")


@pytest.fixture(scope="module")
def shot(tmp_path_factory: pytest.TempPathFactory) -> HandedOver:
    folder, header = tmp_path_factory.mktemp("digits"), "tolerance_kg = [-4.0, 4.0]\n"
    (folder / "header.toml").write_text(header, encoding="utf-8")
    write_shot(virtual_shot("mixed").shot, folder / "s1.h5")
    identify_file(folder / "s1.h5", out=folder / "reports", pdf=True, header=folder / "header.toml")
    return HandedOver(folder / "reports" / "s1", "report")


@pytest.fixture(scope="module")
def combined(tmp_path_factory: pytest.TempPathFactory) -> HandedOver:
    folder = tmp_path_factory.mktemp("digits-of-shots")
    write_reports(folder / "reports", campaign_of((0.0, 120.0) * 3, seed=4).shots)
    campaign(folder / "reports", out=folder / "campaign", pdf=True)
    return HandedOver(folder / "campaign", "campaign")


@pytest.fixture(params=["shot", "combined"])
def handed_over(request: pytest.FixtureRequest) -> HandedOver:
    found: HandedOver = request.getfixturevalue(request.param)
    return found


def two_digits(value: float, of: float | None = None) -> str:
    """A number to the place of the second digit of what it is uncertain by: with decimals, so that no float rounds."""
    exact = Decimal(repr(abs(of if of is not None else value)))
    place = exact.adjusted() - 1
    if round(exact.scaleb(-place)) == 100:
        place += 1
    written = Decimal(repr(value)).quantize(Decimal(1).scaleb(place), ROUND_HALF_EVEN)
    return f"{float(written):.{max(-place, 0)}f}".replace("-", "\N{MINUS SIGN}")


def number(text: str) -> float:
    return float(text.replace("\N{MINUS SIGN}", "-"))


def text_of(html: str) -> str:
    return " ".join(unescape(TAGS.sub("", html)).split())


def tight(text: str) -> str:
    """A text as it reads wherever its lines end, and its groups of digits."""
    return re.sub(r"[-\s\u00ad\u202f]", "", text)


def rows_of(page: str, section: str) -> Iterator[dict[str, str]]:
    """The rows of a page's table, by the headings of its columns."""
    table = re.search(rf'<section id="{section}".*?</section>', page, re.DOTALL)
    assert table is not None
    # the rows that are folded have the same headings again
    first = table[0].partition("</thead>")[0]
    heads = [text_of(one) for one in re.findall(r"<th[ >].*?</th>", first, re.DOTALL)]
    for row in re.findall(r"<tr.*?</tr>", table[0], re.DOTALL):
        cells = [text_of(one) for one in re.findall(r"<td.*?</td>", row, re.DOTALL)]
        if cells:
            yield dict(zip(heads, cells, strict=True))


@pytest.mark.whole_way
def test_mass_u_interval_and_e_n_are_those_of_the_document(handed_over: HandedOver) -> None:
    document, page = handed_over.document, text_of(handed_over.page)
    paper = tight(" ".join(sheet.extract_text() for sheet in handed_over.paper.pages))
    mass, low_high = document["mass"], document["mass"]["U95"]
    half = (low_high[1] - low_high[0]) / 2
    e_n = document["E_n"] if "E_n" in document else mass["E_n"]
    said = [
        f"{two_digits(mass['value'], half)} ± {two_digits(half)}",
        f"{two_digits(mass['u'])} kg",
        f"{two_digits(low_high[1], half)} kg",
        f"{e_n:.2f}".replace("-", "\N{MINUS SIGN}"),
    ]
    ends = [re.escape(two_digits(limit, half)) for limit in low_high]
    assert re.search("( kg)? to ".join(ends), page)
    for text in said:
        assert text in page, text
        assert tight(text) in paper, text


@pytest.mark.whole_way
def test_each_row_of_the_budget_is_that_of_the_document(handed_over: HandedOver) -> None:
    budget = handed_over.document["budget"]
    every = list(rows_of(handed_over.page, "budget"))
    rows = [row for row in every if row["Source"] in {one["source"] for one in budget}]
    # what is folded is summed, and so is all of it
    *_, whole = [row for row in every if row not in rows]
    paper = tight(" ".join(sheet.extract_text() for sheet in handed_over.paper.pages))
    paper = paper[paper.index(tight("Uncertainty budget")) :]
    assert [row["Source"] for row in rows] == [row["source"] for row in budget]
    for stated, row in zip(budget, rows, strict=True):
        assert number(row["u / kg"]) == number(two_digits(stated["u_kg"])), stated["source"]
        if "ν" in row:
            freedom = stated["degrees_of_freedom"]
            assert tight(row["ν"]) == ("∞" if freedom is None else f"{freedom:.0f}")
        at = paper.index(tight(stated["source"]))
        assert tight(row["u / kg"]) in paper[at : at + 240], stated["source"]
    total = math.sqrt(sum(row["u_kg"] ** 2 for row in budget))
    assert total == pytest.approx(handed_over.document["mass"]["u"], rel=1e-9)
    assert whole["u / kg"] == two_digits(total)


@pytest.mark.whole_way
def test_the_document_in_the_paper_is_the_file_to_the_last_byte(handed_over: HandedOver) -> None:
    content = (handed_over.folder / f"{handed_over.name}.json").read_bytes()
    assert handed_over.paper.attachments[f"{handed_over.name}.json"] == [content]


@pytest.mark.whole_way
def test_the_document_in_a_shot_s_page_is_the_file(shot: HandedOver) -> None:
    packed = re.search(r'<script type="text/plain" id="packed">(.*?)</script>', shot.page, re.DOTALL)
    assert packed is not None
    assert unpacked(packed[1].strip())["report"] == shot.document


@pytest.mark.whole_way
def test_python_and_the_workbook_have_every_digit(shot: HandedOver, tmp_path: Path) -> None:
    document, read = shot.document, read_report(shot.folder)
    assert (read.mass_kg, read.u_kg) == (document["mass"]["value"], document["mass"]["u"])
    assert list(read.interval_kg) == document["mass"]["U95"]
    assert read.document["E_n"] == document["E_n"]
    assert dict(zip(read.budget["source"], read.budget["u_kg"], strict=True)) == {
        row["source"]: row["u_kg"] for row in document["budget"]
    }
    book = openpyxl.load_workbook(read.to_excel(tmp_path / "report.xlsx"), data_only=True)
    head = dict(book["mass"].iter_rows(min_row=2, max_col=2, values_only=True))
    written = [head[key] for key in ("value", "u", "U95 low", "U95 high")]
    assert written == pytest.approx([read.mass_kg, read.u_kg, *document["mass"]["U95"]], rel=SIXTEEN_DIGITS, abs=0)
    columns, *rows = book["budget"].iter_rows(values_only=True)
    source, u_kg = columns.index("source"), columns.index("u_kg")
    assert [row[source] for row in rows] == [row["source"] for row in document["budget"]]
    in_kg = [row["u_kg"] for row in document["budget"]]
    assert [row[u_kg] for row in rows] == pytest.approx(in_kg, rel=SIXTEEN_DIGITS, abs=0)


@pytest.mark.whole_way
def test_peaks_are_the_same_in_document_page_paper_terminal_index_workbook_and_python(
    shot: HandedOver, tmp_path: Path
) -> None:
    document, read = shot.document, read_report(shot.folder)
    known, u, page = document["peaks"], document["peaks_u"], text_of(shot.page)
    paper = tight(" ".join(sheet.extract_text() for sheet in shot.paper.pages))
    assert len(known) == 8
    for scale, name, unit in (
        (1e-6, "breech_pressure_pa", "MPa"), (1.0, "recoil_velocity_m_s", "m/s"), (1e-3, "impulse_n_s", "kN s"),
    ):  # fmt: skip
        half = scale * (document["peaks_U95"][name][1] - known[name])
        said = f"{two_digits(scale * known[name], half)} ± {two_digits(half)} {unit}"
        assert said in page
        assert tight(said) in paper
        assert tight(said.replace("\N{MINUS SIGN}", "-")) in tight(str(read)), str(read)
    table = read.peaks.set_index("quantity")
    assert (table["value"].to_dict(), table["u"].to_dict()) == (known, u)
    index_shots([shot.folder.parent], out=tmp_path / "index", xlsx=True)
    (row,) = csv.DictReader(io.StringIO((tmp_path / "index" / "index.csv").read_text("utf-8")))
    assert {name: float(row[name]) for name in known} == known
    assert {name: float(row[f"u_{name}"]) for name in u} == u
    for path, sheet in ((tmp_path / "index" / "index.xlsx", "shots"), (read.to_excel(tmp_path / "r.xlsx"), "peaks")):
        columns, *rows = openpyxl.load_workbook(path, data_only=True)[sheet].iter_rows(values_only=True)
        cells = [dict(zip(columns, one, strict=True)) for one in rows]
        values = cells[0] if sheet == "shots" else {one["quantity"]: one["value"] for one in cells}
        assert [values[name] for name in known] == pytest.approx(list(known.values()), rel=SIXTEEN_DIGITS, abs=0)


@pytest.mark.whole_way
def test_the_table_over_time_has_the_digits_that_its_document_vouches_for(shot: HandedOver) -> None:
    read = read_report(shot.folder)
    rows = list(csv.DictReader(io.StringIO((shot.folder / "mass.csv").read_text("utf-8"))))
    assert len(rows) == len(read.trace)
    written = [float(row["mass_kg"]) for row in rows if row["identified"] == "1"]
    assert written == read.trace.loc[read.trace["identified"], "mass_kg"].tolist()


@pytest.mark.whole_way
def test_the_table_of_a_campaign_has_its_shots_to_every_digit(combined: HandedOver) -> None:
    rows = list(csv.DictReader(io.StringIO((combined.folder / "campaign.csv").read_text("utf-8"))))
    shots = combined.document["shots"]
    assert [row["shot"] for row in rows] == [one["shot"] for one in shots]
    for row, one in zip(rows, shots, strict=True):
        assert (float(row["mass_kg"]), float(row["u_kg"])) == (one["mass"]["value"], one["mass"]["u"])
        report = json.loads((combined.folder.parent / "reports" / one["shot"] / "report.json").read_text("utf-8"))
        assert (one["mass"]["value"], one["mass"]["u"]) == (report["mass"]["value"], report["mass"]["u"])
