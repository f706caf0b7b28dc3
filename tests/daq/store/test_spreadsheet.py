"""Tables that spreadsheets wrote: what is understood of them, and that a change keeps every other byte."""

import csv
import io

import pytest
from hypothesis import given
from hypothesis import strategies as st

from recoil_acquisition.errors import ReadError, StoreError
from recoil_acquisition.files.regular_file import read_small
from recoil_acquisition.store.spreadsheet import LARGEST_BYTES, MOST_COLUMNS, Spreadsheet

TEXTS = st.text(st.characters(codec="utf-8", exclude_characters="\0")).map(str.strip)


def sheet_of(content: bytes | str, tmp_path) -> Spreadsheet:
    return Spreadsheet.of(content if isinstance(content, bytes) else content.encode(), tmp_path / "t.csv", "shot")


def texts_of(sheet: Spreadsheet) -> list[list[str]]:
    return [[cell.text for cell in line.cells] for line in (sheet.header, *sheet.lines)]


@given(
    rows=st.lists(st.lists(TEXTS, min_size=2, max_size=2), max_size=5),
    separator=st.sampled_from([",", ";", "\t"]),
    line_end=st.sampled_from(["\n", "\r\n"]),
    encoding=st.sampled_from(["utf-8", "utf-8-sig", "utf-16"]),
    quoting=st.sampled_from([csv.QUOTE_MINIMAL, csv.QUOTE_ALL]),
)
def test_what_a_csv_writer_wrote_is_read_as_it_was(tmp_path_factory, rows, separator, line_end, encoding, quoting):
    written = io.StringIO()
    writer = csv.writer(written, delimiter=separator, lineterminator=line_end, quoting=quoting)
    writer.writerow(["shot", "words"])
    writer.writerows(rows)
    content = written.getvalue().encode(encoding)
    sheet = sheet_of(content, tmp_path_factory.getbasetemp())
    assert sheet.separator == separator
    assert texts_of(sheet) == [["shot", "words"], *(row for row in rows if any(row))]
    assert sheet.content() == content


@given(
    rows=st.lists(st.tuples(st.from_regex(r"[a-z]{1,4}", fullmatch=True), TEXTS), min_size=1, max_size=4),
    at=st.integers(min_value=0),
    text=TEXTS,
    separator=st.sampled_from([",", ";", "\t"]),
)
def test_a_changed_cell_changes_that_cell_alone(tmp_path_factory, rows, at, text, separator):
    written = io.StringIO()
    writer = csv.writer(written, delimiter=separator, quoting=csv.QUOTE_ALL)
    writer.writerow(["shot", "words", "more"])
    writer.writerows([(*row, "end") for row in rows])
    before = sheet_of(written.getvalue(), tmp_path_factory.getbasetemp())
    at %= len(rows)
    cell = before.lines[at].cells[1]
    changed = before.with_cells(at, {1: text})
    assert changed.lines[at].cells[1].text == text
    assert changed.text[: cell.start] == before.text[: cell.start]
    assert changed.text.endswith(before.text[cell.stop :])
    read = list(csv.reader(io.StringIO(changed.text, newline=""), delimiter=separator))
    assert [one[0] for one in read[1:]] == [one[0] for one in rows]
    assert read[1 + at][1].strip() == text


@given(
    content=st.sampled_from(
        [
            "shot,words",
            "shot;words\r\n1;a\r\n",
            'shot\twords\n"1"\t"a"\n\n',
            "shot,words\r1,a\r",
            "shot;words;\n1;;\n;;\n",
        ]
    ),
    texts=st.tuples(st.from_regex(r"[a-z]{1,4}", fullmatch=True), TEXTS),
)
def test_an_added_line_changes_nothing_above_it(tmp_path_factory, content, texts):
    before = sheet_of(content, tmp_path_factory.getbasetemp())
    after = before.with_lines([texts])
    assert after.text.startswith(before.text)
    assert [cell.text for cell in after.lines[-1].cells] == list(texts)
    assert texts_of(after)[:-1] == texts_of(before)


def test_an_added_column_changes_the_header_alone(tmp_path):
    before = sheet_of("shot;words\r\n1;a\r\n2\r\n", tmp_path)
    after = before.with_column("lot; no").with_cells(1, {2: "7"})
    assert after.text == 'shot;words;"lot; no"\r\n1;a\r\n2;;7\r\n'


def test_a_declared_separator_and_old_code_pages_are_understood(tmp_path):
    content = "sep=;\r\nshot;notes\r\n1;Käfig, 20 °C €\r\n".encode("cp1252")
    sheet = sheet_of(content, tmp_path)
    assert (sheet.encoding, sheet.separator) == ("cp1252", ";")
    assert sheet.lines[0].cells[1].text == "Käfig, 20 °C €"
    assert sheet.content() == content
    with pytest.raises(StoreError, match=r"its encoding has no .速.; expected cp1252"):
        sheet.with_cells(0, {1: "速度"}).content()


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "has no column `shot`; expected the names of the columns in its first line, found no text"),
        (b"time,notes\n1,a\n", "line 1: has no column `shot`"),
        (b"sep=,\nshot;notes\n", "line 2: has no column `shot`"),
        (b'shot,notes\n1,"a\n2,b\n', "line 2, cell 2: a quote is never closed"),
        (b"shot,notes\n1,12,5\n", "line 2: has more cells than there are columns; expected at most 2, found 3"),
        (b"shot,notes\n1,a\n2,\x81\n", "line 3: byte 0x81 is no character"),
        (b"\xff\xfes\0h\0o\0t\0\n\0\xd8", "line 2: byte 0xd8 is no character; expected text in utf-16-le"),
        (b"shot,notes\n1,\0\n", "line 2: holds a zero byte"),
        (b"PK\3\4\0\0shot", "found a workbook"),
        (b"shot" + 1000 * b",", "line 1: has too many columns; expected at most 1000, found 1001"),
        (b"shot\n" + LARGEST_BYTES * b"1", "too large"),
        (b"shot" + 500_000 * b'"', "has no column `shot`"),
        (b"shot,notes\n1," + 600_001 * b'"', "line 2, cell 2: a quote is never closed"),
    ],
)
def test_a_fault_is_one_line_with_its_place(tmp_path, content, said):
    path = tmp_path / "t.csv"
    path.write_bytes(content)
    with pytest.raises(ReadError) as raised:
        Spreadsheet.of(read_small(path, LARGEST_BYTES, "a table"), path, "shot")
    assert said in str(raised.value)
    assert str(raised.value).startswith(f"{path}: ")


@pytest.mark.parametrize("line_end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize(("declared", "first"), [("", 1), ("sep=,", 2)])
def test_a_line_has_the_number_that_an_editor_shows_for_it(tmp_path, line_end, declared, first):
    lines = [*([declared] if declared else []), "shot,words", '1,"a', "", 'b"', "", "2,c", '3,"d""e', 'f"', "4,g"]
    sheet = sheet_of(line_end.join(lines), tmp_path)
    assert [sheet.header.number] == [first]
    assert [line.number - first for line in sheet.lines] == [1, 5, 6, 8]


def test_a_table_may_have_as_many_columns_as_are_allowed(tmp_path):
    names = ",".join(f"c{k}" for k in range(MOST_COLUMNS - 1))
    assert len(sheet_of(f"shot,{names}\n", tmp_path).names()) == MOST_COLUMNS


@given(content=st.binary(max_size=60).map(lambda tail: b"shot,notes\n" + tail))
def test_any_bytes_are_a_table_or_a_fault(tmp_path_factory, content):
    try:
        sheet = sheet_of(content, tmp_path_factory.getbasetemp())
    except ReadError:
        return
    assert sheet.content() == content
