"""A demonstrated range day says what became of it, whatever becomes of one shot."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import pytest

from recoil_acquisition.errors import IdentificationError
from recoil_daq import demo


def test_a_shot_without_a_mass_does_not_cost_the_day_its_other_masses(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    names = ("0001", "0002", "0003")
    shots = [SimpleNamespace(name=name, document={"file": str(tmp_path / f"{name}.h5")}, mass=None) for name in names]
    day = SimpleNamespace(
        shots=[SimpleNamespace(folder=tmp_path / name, truth={"m3": 782.0}) for name in names],
        player=SimpleNamespace(truth=dict),
    )

    def run(*_: object, watch_day, **__: object) -> SimpleNamespace:
        watch_day(day)
        return SimpleNamespace(shots=shots, usable=True)

    def identify(path: Path, **_: object) -> SimpleNamespace:
        if path.stem == "0002":
            raise IdentificationError("only 0 independent rows in the identification interval")
        return SimpleNamespace(document={"shot": path.stem, "valid": True})

    monkeypatch.setattr(demo, "run_live", run)
    monkeypatch.setattr(demo, "identify_file", identify)
    notices: list[str] = []
    done = demo.run_live_demo(tmp_path / "out", SimpleNamespace(notice=notices.append))
    assert [report.document["shot"] for report in done.reports] == ["0001", "0003"]
    assert any("shot 0002 has no mass: only 0 independent rows" in notice for notice in notices)
    assert not done.valid


def test_a_report_that_a_shot_got_while_armed_is_taken_and_set_beside_the_truth(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    report = {"shot": "0001", "mass": {"value": 789.82}, "valid": True}
    (tmp_path / "report.json").write_text(json.dumps(report), encoding="utf-8")
    shot = SimpleNamespace(name="0001", document={"file": "0001.h5"}, mass={"report": str(tmp_path)})
    day = SimpleNamespace(
        shots=[SimpleNamespace(folder=Path("0001"), truth={"m3": 782.0})], player=SimpleNamespace(truth=dict)
    )

    def run(*_: object, watch_day, **__: object) -> SimpleNamespace:
        watch_day(day)
        return SimpleNamespace(shots=[shot], usable=True)

    monkeypatch.setattr(demo, "run_live", run)
    done = demo.run_live_demo(tmp_path / "out", SimpleNamespace(notice=lambda _: pytest.fail("identified again")))
    assert done.reports[0].folder == tmp_path
    assert done.reports[0].document["truth"] == {"mass_kg": 782.0, "error_percent": pytest.approx(1.0)}
