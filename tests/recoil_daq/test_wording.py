"""The wording of every message may change: what is decided, counted and written beside the words stays the same."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from recoil_acquisition.errors import Fault, RecoilDaqError
from recoil_acquisition.measured import figures_of, measured, worded
from recoil_acquisition.remark import Remark
from recoil_acquisition.shot.quality_check import QualityCheck
from recoil_daq import Simulated, load_rig, simulate
from recoil_daq.cli import app
from tests.builders.virtual_shots import SHORTER, with_twin

WORDED_ANEW = "\u2020"
"""Stands in every text that was worded anew."""
OF_TEXTS = ("digest", "sha256", "seal", "size", "elapsed_s", "time_s", "at")
"""Keys of what texts, or the moment of a run, change; "at" is where a figure stands in its text."""
WORDS = ("problem", "expected", "found", "remedy", "detail", "text")
"""Keys of texts that may be of one word."""


def anew(text: str) -> str:
    """Word a text in a way in which no part of it is found again; what was worded anew before stays so.

    Its figures are said again behind it, each in its own words: what a message measured is not its wording.
    """
    if WORDED_ANEW in text:
        return text
    figures = [(one, text[one.start : one.end]) for one in figures_of(text)]
    said = [measured(one.value, one.unit, lambda _, words=words: words, unit_follows=True) for one, words in figures]
    return worded(WORDED_ANEW + text[::-1].swapcase(), *said)


@pytest.fixture
def other_words(monkeypatch: pytest.MonkeyPatch) -> None:
    """Word anew what every error, fault, check, reason, caution and note says."""
    made, faulty, checked, remarked = RecoilDaqError.__init__, Fault.__init__, QualityCheck.__init__, Remark.__new__

    def error(self: RecoilDaqError, problem: str, **where: Any) -> None:
        said = {key: anew(where[key]) for key in ("expected", "found", "remedy") if where.get(key)}
        made(self, anew(problem), **{**where, **said})

    def fault(self: Fault, key: Any, problem: str, *more: Any, **further: Any) -> None:
        faulty(self, key, anew(problem), *more, **further)

    def check(
        self: QualityCheck, channel: str, name: Any, verdict: Any, detail: str, *more: Any, **further: Any
    ) -> None:
        checked(self, channel, name, verdict, anew(detail), *more, **further)

    def remark(cls: type[Remark], code: Any, about: str | None, text: str) -> Remark:
        return remarked(cls, code, about, anew(text))

    monkeypatch.setattr(RecoilDaqError, "__init__", error)
    monkeypatch.setattr(Fault, "__init__", fault)
    monkeypatch.setattr(QualityCheck, "__init__", check)
    monkeypatch.setattr(Remark, "__new__", remark)


@pytest.fixture(scope="module")
def range_day(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Simulated]:
    """Files of two shots, one beside a file of no source; a file that was cut off; a rig with faults."""
    folder = tmp_path_factory.mktemp("day")
    (folder / "rig.toml").write_text(with_twin("field-2013", kind=False, **SHORTER).text, "utf-8")
    made = simulate(load_rig(folder / "rig.toml"), seed=3, shots=2, out=folder / "sim")
    (folder / "faulty.toml").write_text('schema = "recoil-daq/rig/1"\nname = "x"\n[mechanism]\nm3 = -1\n', "utf-8")
    recorded = made.shots[1].files[0]
    (folder / "cut.csv").write_bytes(recorded.read_bytes()[: recorded.stat().st_size // 3])
    (recorded.parent / "0002_foreign.csv").write_text("a,b\n1,2\n", "utf-8")
    return folder, made


def outcomes(range_day: tuple[Path, Simulated], out: Path) -> list[tuple[str, int, Any]]:
    """Return name, exit code and document of each command of a day, and the documents that they wrote."""
    folder, made = range_day
    shots, reports = out / "shots", out / "reports"
    rig = folder / "rig.toml"
    found: list[tuple[str, int, Any]] = []

    def run(*words: object) -> None:
        result = CliRunner().invoke(app, [*map(str, words), "--json"])
        assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
        found.append((str(words[0]), result.exit_code, json.loads(result.stdout)))

    run("check", folder / "faulty.toml")
    run("check", rig, *made.shots[0].files)
    run("ingest", rig, *made.shots[0].files, "--shot", "0001", "--out", shots)
    run("ingest", rig, folder / "cut.csv", "--shot", "0003", "--out", shots)
    run("ingest", rig, "--batch", folder / "sim" / "0002", "--out", shots, "--workers", 1)
    run("log", "0002", "added_mass_kg=120", "u_added_mass_kg=0.05", "--dir", shots)
    run("identify", shots, "--out", reports, "--workers", 1)
    run("identify", shots / "0001.h5", "--method", "paper", "--out", out / "paper")
    run("identify", shots / "0001.h5", "--target", "resistance", "--out", out / "resistance")
    run("campaign", shots, "--reports", reports, "--out", out / "campaign", "--workers", 1)
    run("explain", "--check", reports / "0001")
    found += [
        (file.relative_to(out).as_posix(), 0, json.loads(file.read_text())) for file in sorted(out.rglob("*.json"))
    ]
    found += [(file.relative_to(out).as_posix(), 0, file.read_text()) for file in sorted(out.rglob("*/mass.csv"))]
    return found


def without_words(value: Any, out: Path) -> Any:
    """Leave of a document what is no text: numbers, codes, names, states."""
    if isinstance(value, dict):
        kept = {key: one for key, one in value.items() if key not in OF_TEXTS}
        return {
            key: "words" if key in WORDS and isinstance(one, str) else without_words(one, out)
            for key, one in kept.items()
        }
    if isinstance(value, list):
        return [without_words(one, out) for one in value]
    if isinstance(value, str):
        value = value.replace(str(out), "OUT")
        return "words" if " " in value or WORDED_ANEW in value else value
    return value


@pytest.mark.whole_way
def test_nothing_but_the_words_changes_with_the_wording(
    range_day: tuple[Path, Simulated], tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    plain, other = tmp_path / "plain", tmp_path / "other"
    before = outcomes(range_day, plain)
    request.getfixturevalue("other_words")
    after = outcomes(range_day, other)
    assert json.dumps([one[2] for one in after], ensure_ascii=False).count(WORDED_ANEW) > 100
    assert [one[:2] for one in after] == [one[:2] for one in before]
    for (name, _, document), (_, _, again) in zip(before, after, strict=True):
        assert without_words(again, other) == without_words(document, plain), name
