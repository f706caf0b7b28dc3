"""What a customer holds, changed in one place: `explain --check` finds each change and names the file it is in."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import pytest

from recoil_acquisition.store import write_shot
from recoil_daq.campaigns.campaign import campaign
from recoil_daq.campaigns.reproduction import check_reports
from recoil_daq.reports.identify_folder import identify_folder
from recoil_identification.report.document.report_files import sealed
from tests.builders.virtual_shots import virtual_shot

pytestmark = pytest.mark.exhaustive
SHOTS = (3, 4)


@pytest.fixture(scope="module")
def issued(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A day of two shots with reports and a campaign, on paper too; not to be changed."""
    day = tmp_path_factory.mktemp("issued")
    for seed in SHOTS:
        virtual = virtual_shot(seed=seed, sample_rate_hz=1e4, duration_s=0.4)
        write_shot(replace(virtual.shot, name=f"000{seed}"), day / "shots" / f"000{seed}.h5")
    identify_folder(day / "shots", out=day / "reports", pdf=True, figures=True)
    campaign(day / "shots", reports=day / "reports", out=day / "campaign", pdf=True)
    return day


@pytest.fixture
def day(issued: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(issued, tmp_path / "day"))


def digit(name: str, pattern: str) -> Callable[[Path], str]:
    """Change the first digit behind a pattern of a text."""

    def forge(day: Path) -> str:
        path = day / name
        text = path.read_text("utf-8")
        changed, count = re.subn(
            rf"({pattern}\D*)(\d)", lambda found: f"{found[1]}{(int(found[2]) + 1) % 10}", text, count=1
        )
        assert count
        path.write_text(changed, "utf-8")
        return path.name

    return forge


def byte(name: str, place: float) -> Callable[[Path], str]:
    """Change a byte of a file, so far behind its beginning."""

    def forge(day: Path) -> str:
        path = day / name
        content = bytearray(path.read_bytes())
        content[int(place * len(content))] ^= 1
        path.write_bytes(content)
        return path.name

    return forge


def resealed(name: str, change: Callable[[dict[str, Any]], None]) -> Callable[[Path], str]:
    """Change a document, and give it the digest of its new content."""

    def forge(day: Path) -> str:
        path = day / name
        document = json.loads(path.read_text("utf-8"))
        change(document)
        del document["provenance"]["digest"]
        path.write_text(json.dumps(sealed(document)), "utf-8")
        return path.name

    return forge


def swapped(one: str, other: str) -> Callable[[Path], str]:
    def forge(day: Path) -> str:
        (day / one).rename(day / "aside")
        (day / other).rename(day / one)
        (day / "aside").rename(day / other)
        return Path(one).name

    return forge


def removed(name: str) -> Callable[[Path], str]:
    def forge(day: Path) -> str:
        (day / name).unlink()
        return Path(name).name

    return forge


def written(name: str) -> Callable[[Path], str]:
    """Write to a shot file by the library that wrote it."""

    def forge(day: Path) -> str:
        with h5py.File(day / name, "r+") as file:
            file["entry"].attrs["default"] = "other"
        return Path(name).name

    return forge


def set_at(*keys: str | int, to: object) -> Callable[[dict[str, Any]], None]:
    def change(document: dict[str, Any]) -> None:
        inside: Any = document
        for key in keys[:-1]:
            inside = inside[key]
        assert inside[keys[-1]] != to
        inside[keys[-1]] = to

    return change


REPORT, CAMPAIGN = "reports/0003/report.json", "campaign/campaign.json"
FORGERIES: dict[str, Callable[[Path], str]] = {
    "a digit of the page": digit("reports/0003/report.html", "95 % coverage interval"),
    "a word of the page": digit("reports/0003/report.html", "u 0"),
    "a byte of the paper": byte("reports/0003/report.pdf", 0.3),
    "a byte at the paper's end": byte("reports/0003/report.pdf", 0.999),
    "a digit of the report": digit(REPORT, '"value"'),
    "a digit of a peak": digit(REPORT, '"impulse_n_s"'),
    "a mass with a new seal": resealed(REPORT, set_at("mass", "value", to=784.0)),
    "a verdict with a new seal": resealed(REPORT, set_at("valid", to=False)),
    "a specification with a new seal": resealed(REPORT, set_at("mass", "specification", to=790.0)),
    "a peak with a new seal": resealed(REPORT, set_at("peaks", "impulse_n_s", to=7000.0)),
    "an uncertainty of a peak with a new seal": resealed(REPORT, set_at("peaks_u", "impulse_n_s", to=1.0)),
    "a number of the report with a new seal": resealed(REPORT, set_at("issued", to={"number": "Z-1"})),
    "a digest of the shot file with a new seal": resealed(
        REPORT, set_at("provenance", "inputs", 0, "sha256", to="0" * 64)
    ),
    "the seal of the shot file with a new seal": resealed(
        REPORT, set_at("provenance", "inputs", 0, "seal", to="0" * 64)
    ),
    "a digit of the trace": digit("reports/0003/mass.csv", "\n"),
    "a digit of the curves": digit("reports/0003/curves.csv", "\n"),
    "a byte of a figure": byte("reports/0003/figures/mass.svg", 0.5),
    "pages exchanged": swapped("reports/0003/report.html", "reports/0004/report.html"),
    "papers exchanged": swapped("reports/0003/report.pdf", "reports/0004/report.pdf"),
    "reports exchanged": swapped(REPORT, "reports/0004/report.json"),
    "shot files exchanged": swapped("shots/0003.h5", "shots/0004.h5"),
    "a byte of the shot file": byte("shots/0003.h5", 0.6),
    "an attribute of the shot file": written("shots/0003.h5"),
    "a page that is gone": removed("reports/0003/report.html"),
    "a trace that is gone": removed("reports/0003/mass.csv"),
    "a script": byte("reports/plotly.min.js", 0.5),
    "a digit of the campaign's page": digit("campaign/campaign.html", "95 %"),
    "a byte of the campaign's paper": byte("campaign/campaign.pdf", 0.3),
    "a digit of the campaign": digit(CAMPAIGN, '"value"'),
    "a mass of the campaign with a new seal": resealed(CAMPAIGN, set_at("mass", "value", to=784.0)),
    "a peak of the campaign with a new seal": resealed(CAMPAIGN, set_at("peaks", 0, "value", to=1.0)),
    "a digit of the campaign's table": digit("campaign/campaign.csv", "\n"),
}


def test_what_nobody_changed_comes_again(issued: Path) -> None:
    found = check_reports(issued, workers=1)
    assert found.again, str(found)
    assert len(found.reports) == 3


@pytest.mark.parametrize("name", FORGERIES)
def test_a_forgery_is_found_and_named(day: Path, name: str) -> None:
    forged = FORGERIES[name](day)
    found = check_reports(day, workers=1)
    assert not found.again
    assert forged in str(found), str(found)
