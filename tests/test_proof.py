"""The README's figures are the proof's: it measures each, prints it beside its peer's, and writes the tables."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.proof.__main__ import MEASURED, main
from tests.proof.row import HEADINGS, Row, rewritten, significant, times

README = Path(__file__).resolve().parents[1] / "README.md"


@pytest.mark.whole_way
@pytest.mark.parametrize("name", MEASURED)
def test_a_little_of_each_measurement_gives_rows_and_leaves_the_page_alone(
    name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    before = README.read_bytes()
    main(["--quick", "--only", name])
    rows = [line for line in capsys.readouterr().out.splitlines() if line.endswith(f"| {name} |")]
    assert rows
    assert all(line.count("|") == 6 for line in rows)
    assert README.read_bytes() == before


def test_every_measurement_has_its_rows_in_the_readme() -> None:
    page = README.read_text(encoding="utf-8")
    tables = "".join(re.findall(r"<!-- proof: \w+ -->(.*?)<!-- end of proof -->", page, re.DOTALL))
    assert set(re.findall(r"^\|.*\| (\w+) \|$", tables, re.MULTILINE)) == set(MEASURED)


def test_no_other_figure_stands_in_the_readme() -> None:
    page = README.read_text(encoding="utf-8")
    for part in (
        r"^```.*?^```",
        r"<!-- proof: .*?<!-- end of proof -->",
        r"<!-- measured -->.*?<!-- end of measured -->",
    ):
        page = re.sub(part, "", page, flags=re.DOTALL | re.MULTILINE)
    figures = re.findall(r"\d[\d.,]*\s?(?:%|×|times|kg|s|ms|µs|MB|GB|MB/s)(?!\w)", page)
    assert set(figures) <= {"95 %"}  # the name of an interval


PAGE = """before
<!-- proof: cost -->
| what it costs | recoil-daq | beside it | ratio | `--only` |
| --- | --- | --- | --- | --- |
| old start | 1 s | 2 s | 2 × | start |
| old size | 1 MB |  |  | size |
<!-- end of proof -->
after
"""


def test_what_was_measured_replaces_its_rows_and_no_others() -> None:
    page = rewritten(PAGE, "cost", [Row("new start", "3 s", "", "", "start")], ["start", "size"])
    assert page == PAGE.replace("| old start | 1 s | 2 s | 2 × |", "| new start | 3 s |  |  |")


def test_an_empty_place_is_filled_and_a_missing_one_is_told() -> None:
    page = rewritten(
        "<!-- proof: cost -->\n<!-- end of proof -->\n", "cost", [Row("a", "b", "c", "d", "start")], ["start"]
    )
    assert page.splitlines()[1:4] == [
        f"| {' | '.join(HEADINGS['cost'])} |",
        "| --- | --- | --- | --- | --- |",
        "| a | b | c | d | start |",
    ]
    with pytest.raises(ValueError, match="no <!-- proof: truth -->"):
        rewritten(PAGE, "truth", [], [])


@pytest.mark.parametrize(
    ("value", "shown"), [(0.0123, "0.012"), (1.55, "1.6"), (12.4, "12"), (1234.0, "1,200"), (4.1e-12, "4.1e-12")]
)
def test_numbers_are_written_with_the_digits_that_tell_something(value: float, shown: str) -> None:
    assert significant(value) == shown


def test_very_large_ratios_are_powers_of_ten() -> None:
    assert times(5.7e9) == "10⁹ ×"
    assert times(41.2) == "41 ×"
