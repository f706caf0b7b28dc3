"""A shot whose recorder and camera write their headings in another language is the same shot."""

from __future__ import annotations

from pathlib import Path

import pytest

from recoil_daq import identify_file, ingest_files, load_rig, simulate
from recoil_daq.reports.identify import Reported

HEADINGS = {
    "de": ("Bild", "Zeit"), "fr": ("Image", "Temps"), "es": ("Fotograma", "Tiempo"), "zh": ("帧", "时间"),
    "ru": ("Кадр", "Время"),
}  # fmt: skip
pytestmark = pytest.mark.whole_way


@pytest.fixture(scope="module")
def fired(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("fired")
    simulate(load_rig("mixed"), out=out)
    return out / "0001"


def identified(fired: Path, frame: str, time: str, out: Path) -> Reported:
    files = [fired / f"0001_{name}" for name in ("can.blf", "imu.rdlog")]
    for name in ("camera", "dewetron"):
        head, _, rows = (fired / f"0001_{name}.csv").read_text("utf-8").partition("\n")
        files.append(out / f"0001_{name}.csv")
        files[-1].write_text(f"{head.replace('Frame', frame).replace('Time', time)}\n{rows}", "utf-8")
    ingested = ingest_files(load_rig(fired / "rig.toml"), files, shot="0001", out=out / "shots")
    return identify_file(ingested.path, out=out / "reports")


@pytest.fixture(scope="module")
def in_english(fired: Path, tmp_path_factory: pytest.TempPathFactory) -> Reported:
    return identified(fired, "Frame", "Time", tmp_path_factory.mktemp("en"))


@pytest.mark.parametrize("language", HEADINGS)
def test_the_mass_is_the_same(language: str, fired: Path, in_english: Reported, tmp_path: Path) -> None:
    found = identified(fired, *HEADINGS[language], tmp_path)
    assert found.valid
    assert found.mass_kg == pytest.approx(in_english.mass_kg, rel=1e-9)
    assert found.u_kg == pytest.approx(in_english.u_kg, rel=1e-9)
