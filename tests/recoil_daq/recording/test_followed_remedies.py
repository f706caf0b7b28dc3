"""What a verdict says is to be done is done, and the verdict says it no more."""

from __future__ import annotations

import csv
import io
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from typer.testing import Result

from recoil_rigs.rig import find_rig

Run = Callable[..., Result]
OTHER_WAY_ROUND = 'polarity = -1\nsensor = {{ model = "virtual pressure gauge", serial = "{}"'
GAUGE = 'polarity = 1\nsensor = {{ model = "virtual pressure gauge", serial = "{}"'


class Ingested:
    """One shot, ingested with a rig that is edited as the verdict says."""

    def __init__(self, run: Run, files: dict[str, Path], folder: Path) -> None:
        self._run, self._files, self._folder, self._made = run, files, folder, 0
        self.rig = find_rig("field-2013").read_text(encoding="utf-8")

    def edit(self, old: str, new: str) -> None:
        assert self.rig.count(old) == 1, old
        self.rig = self.rig.replace(old, new)

    def said(self) -> list[str]:
        """Return what speaks against the shot, or warns."""
        self._made += 1
        path, out = self._folder / "rig.toml", self._folder / f"shots {self._made}"
        path.write_text(self.rig, encoding="utf-8")
        result = self._run("ingest", path, *self._files.values(), "--shot", "0001", "--out", out, "--json")
        assert result.exit_code in (0, 1), result.output
        document: dict[str, Any] = json.loads(result.stdout)
        return [one["text"] for one in document["findings"] if one["severity"] != "note"]


@pytest.fixture
def ingested(run: Run, files: dict[str, Path], tmp_path: Path) -> Ingested:
    return Ingested(run, files, tmp_path)


def turned(path: Path, signal: str) -> None:
    """Write a recorder's file with one signal upside down."""
    rows = list(csv.reader(io.StringIO(path.read_text(encoding="utf-8"))))
    (at, place) = next((i, row.index(cell)) for i, row in enumerate(rows) for cell in row if signal in cell)
    for row in rows[at + 1 :]:
        if len(row) > place and re.fullmatch(r"-?[0-9.eE+-]+", row[place]):
            row[place] = str(-float(row[place]))
    with path.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows(rows)


def every_way_out(said: list[str], word: str) -> bool:
    """Return whether something is said, and all that fails by it speaks of one and the same key."""
    of_breech = [text for text in said if "breech" in text or "camera" in text]
    return bool(of_breech) and all(word in text for text in of_breech)


@pytest.mark.whole_way
def test_a_sensor_that_is_declared_to_be_turned_and_is_not(ingested: Ingested) -> None:
    before = ingested.said()
    ingested.edit(GAUGE.format("V301"), OTHER_WAY_ROUND.format("V301"))
    assert every_way_out(ingested.said(), "`polarity`")
    ingested.edit(OTHER_WAY_ROUND.format("V301"), GAUGE.format("V301"))  # as it says
    assert ingested.said() == before


@pytest.mark.whole_way
def test_a_sensor_that_is_turned_and_not_declared_to_be(ingested: Ingested, files: dict[str, Path]) -> None:
    before = ingested.said()
    turned(files["dewetron"], "p_breech")
    assert every_way_out(ingested.said(), "`polarity`")
    ingested.edit(GAUGE.format("V301"), OTHER_WAY_ROUND.format("V301"))  # as it says
    assert ingested.said() == before


@pytest.mark.indispensable("a followed remedy")
def test_a_range_that_is_declared_too_small(ingested: Ingested) -> None:
    before = ingested.said()
    ingested.edit("range = [-25.0, 250.0]", "range = [-2.5, 120.0]")
    (beyond,) = re.findall(r"raise the range beyond (\S+) MPa", " ".join(ingested.said()))
    ingested.edit("range = [-2.5, 120.0]", f"range = [-2.5, {float(beyond)}]")  # as it says
    assert ingested.said() == before
