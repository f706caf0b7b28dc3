"""Where a number of a report comes from, and whether it comes again from the shot file."""

from __future__ import annotations

import contextlib
import copy
import hashlib
import json
import re
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import recoil_daq
from recoil_acquisition.errors import ReadError
from recoil_acquisition.remark import NoteCode
from recoil_acquisition.store import read_shot, write_shot
from recoil_daq import Options, check_reports, explain, identify_file, identify_folder, load_rig
from recoil_daq.reports.reproduction import kept_document, kept_report
from recoil_daq.reports.reproduction.kept_document import other_digits
from recoil_daq.reports.reproduction.kept_report import Kept
from recoil_daq.reports.reproduction.recomputed import recompute
from recoil_daq.reports.stored_shot import StoredShot
from recoil_daq.terminal.console import shown
from recoil_daq.terminal.explanation import print_checked, print_explained
from recoil_identification.report.document.report_files import sealed
from recoil_identification.report.document.reproduction import leaves_of
from recoil_identification.shot.identified import Identification
from recoil_processing.spectra.cutoff import CutoffChoice
from recoil_rigs.rig import find_rig
from tests.builders.other_firings import fired_again

LOG = (
    "shot,configuration,added_mass_kg,u_added_mass_kg,elevation_deg,crew\n"
    "0001,ring,12.5,0.05,10.25,7\n"
)  # fmt: skip
DOUBTED = CutoffChoice(523.7, 4, 612.25, 841.5, 7.125, 0.0625, "doubtful", "a shallow gap")
"""Of several shots; the figures are made up, and the fixed cut-off stands in for it."""


@pytest.fixture(scope="module")
def home(stored: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a shot that was logged, and its report with options of all kinds; not to be changed."""
    folder = tmp_path_factory.mktemp("home")
    (folder / "shots").mkdir()
    shutil.copy(stored, folder / "shots")
    (folder / "shots" / "shotlog.csv").write_text(LOG, encoding="utf-8")
    options = Options(window_s=0.015, campaign=DOUBTED, mass_cutoff_hz=283.0)
    identify_file(folder / "shots" / "0001.h5", out=folder / "reports", options=options, truth={"m3": 794.5})
    return folder


@pytest.fixture
def copied(home: Path, tmp_path: Path) -> Path:
    """The same, to be changed."""
    return Path(shutil.copytree(home, tmp_path / "home"))


@pytest.fixture(scope="module")
def done(home: Path) -> recoil_daq.Explained:
    return explain(home / "reports" / "0001")


@pytest.fixture(scope="module")
def known() -> dict[Any, Any]:
    return {}


@pytest.fixture(autouse=True)
def _once(monkeypatch: pytest.MonkeyPatch, known: dict[Any, Any]) -> None:
    """Read and identify a shot only once with the same row, rig and options: it takes long, and gives the same."""
    read, identify = kept_report.read_stored_again, kept_report.identify_shot

    def read_once(path: Path, *given: Any) -> StoredShot:
        asked = hashlib.sha256(path.read_bytes()).digest(), repr(given)
        if asked not in known:
            known[asked] = read(path, *given)
        return known[asked]

    def identify_once(fired: StoredShot, options: Options) -> Identification:
        # both are kept above, so that no other shot or rig can have their place
        asked = id(fired.shot), id(fired.rig), repr(options)
        if asked not in known:
            known[asked] = identify(fired, options)
        return known[asked]

    monkeypatch.setattr(kept_report, "read_stored_again", read_once)
    monkeypatch.setattr(kept_report, "identify_shot", identify_once)


def rewritten(home: Path, document: dict[str, Any]) -> None:
    (home / "reports" / "0001" / "report.json").write_text(json.dumps(document), encoding="utf-8")


@pytest.mark.indispensable("explain")
def test_every_number_of_an_untouched_report_comes_again_to_the_last_bit(done: recoil_daq.Explained) -> None:
    assert done.exact
    assert done.again
    assert done.comparison.numbers > 20_000
    assert done.comparison.largest == 0.0
    assert {one["state"] for one in done.files[:2]} == {"as it was"}


def test_a_result_is_one_line_or_a_tree(done: recoil_daq.Explained) -> None:
    assert "\n" not in repr(done)
    text = str(done)
    for words in (
        "m = m0 e^mu", "equation (36) of the paper", "equation (37) of the paper", "JCGM 100:2008 (GUM), equation (10)",
        "[mechanism] friction: 1500.0 N, u 150.0", "window_s: 0.015", "mass_cutoff_hz: 283.0", "numpy: ",
        "numbers of the document and of the tables beside it come again to the last bit",
    ):  # fmt: skip
        assert words in text, words
    document = json.loads(json.dumps(done.to_json()))
    assert shown(lambda: print_explained(document)).export_text().rstrip("\n") == text
    value = done.to_json()["explained"][0]["parts"][0]
    assert (value["key"], value["unit"]) == ("mass.value", "kg")
    assert f"value: {value['value']!r} kg" in text
    assert done._repr_html_().startswith("<pre")


@pytest.mark.whole_way
@pytest.mark.parametrize(
    ("key", "path", "unit", "formula"),
    [
        ("mass.u", "mass.u", "kg", "u = sqrt(sum of u_i^2 over the budget)"),
        ("rpe.value", "rpe_percent.value", "%", "RPE = sum"),
        ("peaks.breech_pressure_pa", "peaks.breech_pressure_pa", "Pa", "largest value"),
        ('budget."packing friction".u_source', 'budget."packing friction".u_source', "N", "u_friction"),
        ("budget.packing friction.sensitivity_kg", 'budget."packing friction".sensitivity_kg', "kg per N", "change"),
        ("alignment.camera.offset_s", "alignment.camera.offset_s", "s", "t_ref = (1 + drift) t_source + offset_s"),
        ("interval_s[1]", "interval_s[1]", "s", "from the onset of force"),
    ],
)  # fmt: skip
def test_any_key_of_the_report_is_explained(home: Path, key: str, path: str, unit: str, formula: str) -> None:
    (entry,) = explain(home / "reports", key).entries
    assert (entry.key, entry.unit) == (path, unit)
    assert entry.formula is not None
    assert entry.formula.text.startswith(formula)
    stored = json.loads((home / "reports" / "0001" / "report.json").read_text("utf-8"))
    assert entry.value == leaves_of(stored)[path].value


@pytest.mark.whole_way
def test_the_beginning_of_a_name_is_enough_and_an_unknown_one_is_answered_with_the_nearest(
    home: Path, run: Callable[..., Any]
) -> None:
    result = run("explain", home / "reports" / "0001", "budget.packing", "--json")
    assert result.exit_code == 0
    assert json.loads(result.stdout)["explained"][0]["key"] == 'budget."packing friction"'
    result = run("explain", home / "reports" / "0001", "mass.vlaue")
    assert result.exit_code == 3
    assert "no key 'mass.vlaue'; nearest names mass.value" in result.stderr
    assert result.stderr.count("\n") == 1
    result = run("explain", home / "reports" / "0001", "budget.recoil")
    assert result.exit_code == 3
    assert "may be budget.recoil_acceleration sensitivity, " in result.stderr


@pytest.mark.whole_way
def test_in_a_pipe_the_tree_is_indented_and_without_branches(home: Path, run: Callable[..., Any]) -> None:
    lines = run("explain", home / "reports", "mass").output.split("\n")
    assert lines[1].startswith("  mass")
    assert lines[2].startswith("    value: ")
    assert not any(branch in "".join(lines) for branch in "├└│")


@dataclass(frozen=True)
class Numbers:
    """All numbers in the text of a report, each with where it stands."""

    text: str
    places: list[tuple[str, int, int]]

    @classmethod
    def of(cls, document: dict[str, Any]) -> Numbers:
        marks: list[str] = []

        def marked(value: Any, key: str) -> Any:
            if isinstance(value, dict):
                return {name: marked(one, f"{key}.{name}" if key else name) for name, one in value.items()}
            if isinstance(value, list):
                return [marked(one, f"{key}[{k}]") for k, one in enumerate(value)]
            if isinstance(value, int | float) and not isinstance(value, bool):
                marks.append(key)
                return f"@{len(marks) - 1}@{json.dumps(value)}@"
            return value

        found, text, last = [], "", 0
        whole = json.dumps(marked(document, ""))
        for match in re.finditer(r'"@(\d+)@([^@"]+)@"', whole):
            text += whole[last : match.start()]
            found.append((marks[int(match[1])], len(text), len(text) + len(match[2])))
            text, last = text + match[2], match.end()
        return cls(text + whole[last:], found)

    def changes(self) -> Iterator[tuple[str, str]]:
        """Yield, for every digit of every number, its key and the text with another digit in its place."""
        for key, start, stop in self.places:
            yield from ((key, one) for k in range(start, stop) if (one := self.changed(k)) is not None)

    def changed(self, place: int) -> str | None:
        """Return the text with another digit at a place; None where there is none, or the text is no report then."""
        digit = self.text[place]
        if not digit.isdigit():
            return None
        text = f"{self.text[:place]}{(int(digit) + 1) % 10 or 1}{self.text[place + 1 :]}"
        try:
            json.loads(text)
        except ValueError:
            return None
        return text


@pytest.fixture(scope="module")
def numbers(home: Path) -> Numbers:
    return Numbers.of(json.loads((home / "reports" / "0001" / "report.json").read_text("utf-8")))


GIVEN = ("shot_log.elevation_deg", "provenance.inputs[1]", "provenance.parameters.options.campaign.")
"""What nothing but the report's digest tells: no number of the report hangs on it."""


@pytest.mark.whole_way
@settings(
    max_examples=25, deadline=None, derandomize=True, database=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)  # fmt: skip
@given(number=st.integers(0, 2**32 - 1), digit=st.integers(0, 2**32 - 1))
def test_one_digit_changed_anywhere_in_a_reports_numbers_is_found(
    home: Path, numbers: Numbers, tmp_path: Path, number: int, digit: int
) -> None:
    key, start, stop = numbers.places[number % len(numbers.places)]
    text = numbers.changed(start + digit % (stop - start))
    if text is None:
        return
    folder = tmp_path / "changed"
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(home / "reports" / "0001", folder, ignore=shutil.ignore_patterns("*.js", "*.html"))
    assert found(folder, home, text), f"{key} was changed and nothing differs"
    if not key.startswith(GIVEN) and json.loads(text) != json.loads(numbers.text):
        # also by whoever computes the digest anew, if it is another number at all
        assert found(folder, home, json.dumps(sealed(json.loads(text)))), key


def found(folder: Path, home: Path, text: str) -> bool:
    """Whether a changed report is refused, or differs from what comes of the shot file."""
    (folder / "report.json").write_text(text, encoding="utf-8")
    try:
        return bool(recompute(Kept.read(folder), [home / "shots"]).comparison.differences)
    except recoil_daq.RecoilDaqError:
        return True


@pytest.mark.whole_way
def test_a_number_that_was_changed_is_named_with_what_it_should_be(copied: Path, run: Callable[..., Any]) -> None:
    document = json.loads((copied / "reports" / "0001" / "report.json").read_text("utf-8"))
    true = document["mass"]["value"]
    document["mass"]["value"] = round(true, 1)
    rewritten(copied, document)
    result = run("explain", copied / "reports" / "0001", "mass.value")
    assert result.exit_code == 1
    assert f"mass.value: {round(true, 1)!r} in the report, {true!r} again, relative " in result.output


@pytest.mark.parametrize("place", [0, 1])
@pytest.mark.parametrize("name", ["../shots/0001.h5", "/etc/hostname", "x" * 300, 7, None])
def test_a_report_makes_nobody_read_a_file_elsewhere(copied: Path, place: int, name: Any) -> None:
    document = json.loads((copied / "reports" / "0001" / "report.json").read_text("utf-8"))
    document["provenance"]["inputs"][place]["file"] = name
    rewritten(copied, sealed(document))
    with pytest.raises(ReadError, match="this is no report of a shot that can be made again"):
        explain(copied / "reports")


@pytest.mark.parametrize(
    ("key", "value"),
    [("notes", 7), ("notes", [7]), ("truth", {"mass_kg": "x"}), ("shot_log", {"shot": "0001", "added_mass_kg": "x"})],
)
def test_what_a_report_cannot_be_made_again_from_is_said(copied: Path, key: str, value: Any) -> None:
    document = json.loads((copied / "reports" / "0001" / "report.json").read_text("utf-8"))
    rewritten(copied, sealed({**document, key: value}))
    with pytest.raises(ReadError, match="this is no report of a shot that can be made again"):
        explain(copied / "reports")


@pytest.mark.whole_way
@pytest.mark.parametrize("path", [("alignment", 0, "method"), ("mass", "method")], ids=str)
@pytest.mark.parametrize("value", [[], 7, None], ids=str)
def test_a_report_with_something_else_where_a_name_belongs_is_no_traceback(
    copied: Path, path: tuple[str | int, ...], value: Any
) -> None:
    document = json.loads((copied / "reports" / "0001" / "report.json").read_text("utf-8"))
    part = document
    for key in path[:-1]:
        part = part[key]
    part[path[-1]] = value
    if path[0] == "alignment":
        document["alignment"].append(value)
    rewritten(copied, sealed(document))
    with contextlib.suppress(ReadError):
        assert not explain(copied / "reports").again
    assert not check_reports(copied / "reports", workers=1).again


@pytest.mark.whole_way
def test_a_shot_log_that_has_become_faulty_is_no_hindrance(copied: Path) -> None:
    (copied / "shots" / "shotlog.csv").write_text("shot,added_mass_kg\n0001,heavy\n", encoding="utf-8")
    done = explain(copied / "reports")
    assert done.again
    (state,) = [one["state"] for one in done.files if one["file"] == "shotlog.csv"]
    assert state.startswith("changed since, and at fault now: ")


@pytest.mark.whole_way
def test_a_digit_beyond_the_last_one_that_counts_is_found(copied: Path) -> None:
    path = copied / "reports" / "0001" / "report.json"
    value = repr(json.loads(path.read_text("utf-8"))["mass"]["value"])
    path.write_text(path.read_text("utf-8").replace(f'"value": {value}', f'"value": {value}001', 1), encoding="utf-8")
    (difference,) = explain(path).differences
    assert str(difference) == f"a number of report.json: {value}001 in the report, {value} again"
    assert other_digits(b"[0.5, 1e3, 0e99999999999999999999]") == ("0e99999999999999999999",)


@pytest.mark.whole_way
@pytest.mark.parametrize("name", ["mass.csv", "curves.csv"])
def test_a_digit_changed_in_a_table_beside_the_report_is_found(copied: Path, name: str) -> None:
    path = copied / "reports" / "0001" / name
    lines = path.read_text("utf-8").split("\n")
    place = next(i for i in range(100, len(lines)) if "1" in lines[i])
    lines[place] = lines[place][::-1].replace("1", "2", 1)[::-1]
    path.write_text("\n".join(lines), encoding="utf-8")
    (difference,) = explain(copied / "reports").differences
    assert difference.key.startswith(f"{name}[{place - 1}].")
    path.unlink()
    (difference,) = explain(copied / "reports").differences
    assert (difference.key, difference.stored) == (name, None)


@pytest.mark.whole_way
def test_a_table_with_other_bytes_and_the_same_numbers_is_found(copied: Path) -> None:
    path = copied / "reports" / "0001" / "mass.csv"
    document = json.loads((copied / "reports" / "0001" / "report.json").read_text("utf-8"))
    document["provenance"]["outputs"][0]["sha256"] = "0" * 64
    rewritten(copied, sealed(document))
    # the page bears the digest of the true report
    assert [one.key for one in explain(copied / "reports").differences] == [
        "SHA-256 of mass.csv", "SHA-256 of report.html",
    ]  # fmt: skip
    assert path.exists()


@pytest.mark.whole_way
def test_a_table_of_another_size_is_not_read(copied: Path) -> None:
    path = copied / "reports" / "0001" / "mass.csv"
    path.write_bytes(3 * path.read_bytes())
    differences = recoil_daq.explain(copied / "reports" / "0001").comparison.differences
    assert [one.key for one in differences] == ["size of mass.csv"]
    assert str(differences[0].stored).startswith("over ")


@pytest.mark.whole_way
def test_a_program_that_writes_the_report_anew_changes_nothing(copied: Path) -> None:
    path = copied / "reports" / "0001" / "report.json"
    document = json.loads(
        path.read_text("utf-8"), parse_float=lambda text: int(float(text)) if float(text).is_integer() else float(text)
    )
    path.write_text(json.dumps(document, sort_keys=True), encoding="utf-8")
    assert explain(copied / "reports").again


@pytest.mark.whole_way
def test_the_log_may_go_on_without_the_shot(copied: Path) -> None:
    log = copied / "shots" / "shotlog.csv"
    log.write_text(LOG + "0002,,,,,\n", encoding="utf-8")
    done = explain(copied / "reports")
    assert done.again
    assert done.files[1]["state"] == "changed since, its row of this shot is the same"
    log.write_text(LOG.replace("12.5", "13"), encoding="utf-8")
    done = explain(copied / "reports")
    assert done.again
    assert done.files[1]["state"] == "changed since, and so is its row of this shot"
    log.unlink()
    done = explain(copied / "reports")
    assert done.again
    assert done.files[1]["state"] == "not here: what it said is in the report"


@pytest.mark.whole_way
def test_a_report_without_a_row_of_the_log_comes_again_with_its_findings_and_without(
    stored: Path, tmp_path: Path
) -> None:
    shutil.copy(stored, tmp_path)
    (tmp_path / "shotlog.csv").write_text(LOG.replace("0001", "01"), encoding="utf-8")
    report = identify_file(tmp_path / "0001.h5", out=tmp_path / "reports")
    assert report.findings
    (told,) = [one for one in report.findings if one["code"] == NoteCode.NO_LOG_ROW]
    assert told["about"] == "shotlog.csv"
    assert told["text"] in report.document["notes"]
    path = tmp_path / "reports" / "0001" / "report.json"
    assert explain(path).again
    # an earlier version wrote none, and did not state how its page is drawn
    earlier = {key: value for key, value in report.document.items() if key != "findings"}
    earlier["provenance"] = {key: value for key, value in earlier["provenance"].items() if key != "drawn"}
    path.write_text(json.dumps(sealed(earlier)), encoding="utf-8")
    assert explain(path).again
    told["about"] = "another.csv"
    path.write_text(json.dumps(sealed(report.document)), encoding="utf-8")
    assert not explain(path).again


@pytest.mark.whole_way
def test_the_shot_file_is_found_under_another_name_and_in_a_folder_that_is_given(
    copied: Path, tmp_path: Path, run: Callable[..., Any]
) -> None:
    (copied / "shots" / "0001.h5").rename(copied / "shots" / "first.h5")
    assert explain(copied / "reports").again
    elsewhere = tmp_path / "elsewhere"
    (copied / "shots").rename(elsewhere)
    result = run("explain", copied / "reports", "mass")
    assert result.exit_code == 3
    assert "the shot file of this report is not found; expected 0001.h5 with SHA-256" in result.stderr
    assert result.stderr.count("\n") == 1
    assert run("explain", copied / "reports", "mass", "--shots", elsewhere).exit_code == 0


def test_a_shot_file_that_has_changed_is_one_line(copied: Path, run: Callable[..., Any]) -> None:
    with (copied / "shots" / "0001.h5").open("ab") as file:
        file.write(b"\0")
    result = run("explain", copied / "reports")
    assert result.exit_code == 3
    assert "the shot file is not the one that this report was made of; expected SHA-256" in result.stderr
    assert result.stderr.count("\n") == 1


@pytest.mark.whole_way
def test_a_folder_of_reports_is_checked_each_on_its_line(copied: Path, run: Callable[..., Any]) -> None:
    shutil.copytree(copied / "reports" / "0001", copied / "reports" / "0002")
    result = run("explain", copied / "reports", "--check", "--workers", 1)
    assert result.exit_code == 0, result.output
    assert "2 of 2 documents come again" in result.output
    assert "comes again to the last bit" in result.output
    table = copied / "reports" / "0002" / "mass.csv"
    table.write_text(table.read_text("utf-8").replace("7", "8", 1), encoding="utf-8")
    result = run("explain", copied / "reports", "--check", "--workers", 1, "--json")
    assert result.exit_code == 1
    rows = json.loads(result.stdout)["reports"]
    assert [(one["again"], one["differing"]) for one in rows] == [(True, 0), (False, 1)]
    (copied / "reports" / "0001" / "report.json").write_text("{}", encoding="utf-8")
    result = run("explain", copied / "reports", "--check", "--workers", 1)
    assert result.exit_code == 3
    assert "could not be made again" in result.output
    assert "does not come again to the last bit" in result.output


@pytest.mark.whole_way
def test_elsewhere_numbers_come_again_within_their_rounding(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kept_document, "computer", lambda: {"system": "another"})
    checked = check_reports(home / "reports", workers=1)
    assert checked.again
    assert not checked.reports[0].exact
    assert "comes again within 1e-09" in str(checked)
    document = json.loads(json.dumps(checked.to_json()))
    assert shown(lambda: print_checked(document)).export_text().rstrip("\n") == str(checked)
    assert repr(checked) == "CheckedReports(1 of 1 reports come again)"


def test_what_is_no_report_is_said_in_a_line(copied: Path, tmp_path: Path, run: Callable[..., Any]) -> None:
    document = json.loads((copied / "reports" / "0001" / "report.json").read_text("utf-8"))
    older = copy.deepcopy(document)
    del older["provenance"]["parameters"]["options"]
    rewritten(copied, older)
    result = run("explain", copied / "reports")
    assert result.exit_code == 3
    assert "this is no report of a shot that can be made again" in result.stderr
    assert "found no 'options'; identify the shot anew" in result.stderr
    (copied / "campaign.json").write_text("{}", encoding="utf-8")
    result = run("explain", copied / "campaign.json", "--check")
    assert result.exit_code == 3
    assert "this is no answer of a campaign that can be made again" in result.output
    assert run("explain", tmp_path / "nowhere").exit_code == 3
    assert run("explain", copied / "shots").exit_code == 3
    assert run("explain", copied / "reports", "mass", "--check").exit_code == 2
    assert run("explain", copied / "reports", "--workers", 2).exit_code == 2
    shutil.copytree(copied / "reports" / "0001", copied / "reports" / "0002")
    with pytest.raises(ReadError, match="2 reports in this folder; expected one"):
        explain(copied / "reports")


@pytest.mark.whole_way
def test_a_report_with_a_corrected_rig_comes_again_without_its_file(stored: Path, tmp_path: Path) -> None:
    rig = tmp_path / "corrected.toml"
    text = find_rig("field-2013").read_text("utf-8")
    assert text.count("\nfriction = ") == 1
    rig.write_text(re.sub(r"\nfriction = \d+\.\d", "\nfriction = 1650.0", text), encoding="utf-8")
    assert load_rig(rig).mechanism.friction == 1650.0
    report = identify_file(stored, out=tmp_path / "reports", rig=rig)
    assert report.document["corrections"]
    rig.unlink()
    done = explain(report.folder, "mass", shots=stored.parent)
    assert done.again
    assert "[mechanism] friction: 1650.0 N, u 150.0" in str(done)


@pytest.mark.whole_way
def test_reports_of_several_shots_come_again_with_the_cut_off_that_they_share(
    stored: Path, tmp_path: Path, run: Callable[..., Any]
) -> None:
    shots = tmp_path / "shots"
    shots.mkdir()
    for name in ("0001", "0002"):
        write_shot(fired_again(read_shot(stored), name), shots / f"{name}.h5")
    reports = identify_folder(shots, out=tmp_path / "reports", workers=1)
    assert {one.document["filter"]["basis"] for one in reports} == {"campaign"}
    result = run("explain", tmp_path / "reports", "--check", "--workers", 1)
    assert result.exit_code == 0, result.output
