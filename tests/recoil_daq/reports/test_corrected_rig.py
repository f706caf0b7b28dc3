"""A corrected rig file at work: the oracle is the ingest of the same recorded files with that rig from the start."""

from __future__ import annotations

import datetime as dt
import hashlib
import json
import shutil
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest

from recoil_acquisition.errors import ReadError, RigError
from recoil_acquisition.shot.quality_check import Check, QualityCheck
from recoil_acquisition.store import read_shot, write_shot
from recoil_daq.campaigns.campaign import Combined, campaign
from recoil_daq.recording.ingest import ingest_files
from recoil_daq.reports.identify import identify_file
from recoil_daq.reports.stored_shot import read_stored
from recoil_identification.shot.identified import Options
from recoil_rigs.rig import find_rig, load_rig
from recoil_rigs.twin import simulate_shot
from tests.builders.other_firings import fired_again
from tests.builders.tracked_rigs import tracked_rig
from tests.builders.virtual_shots import SHORTER, with_twin

ON = dt.date(2026, 6, 1)
CUT_OFF = Options(cutoff_hz=400.0)
"""As asked for: what chooses it by the spectra is not what is tested here."""


@dataclass(frozen=True)
class Range:
    """A shot's recorded files, its shot file, and the text of the rig that it was ingested with."""

    folder: Path
    files: tuple[Path, ...]
    shot_file: Path
    text: str

    def rig_file(self, folder: Path, *pairs: tuple[str, str]) -> Path:
        """Write the rig file with pieces of its text replaced, each where it stands first."""
        text = self.text
        for old, new in pairs:
            assert old in text
            text = text.replace(old, new, 1)
        shutil.copy(find_rig("mixed").parent / "mixed.dbc", folder)
        (folder / "corrected.toml").write_text(text, encoding="utf-8")
        return folder / "corrected.toml"

    def ingested(self, rig_file: Path, out: Path) -> Path:
        """Ingest the recorded files with another rig file from the start."""
        return ingest_files(load_rig(rig_file), self.files, shot="0001", out=out, on=ON).path


def a_range(folder: Path, text: str, seed: int) -> Range:
    shutil.copy(find_rig("mixed").parent / "mixed.dbc", folder)
    (folder / "rig.toml").write_text(text, encoding="utf-8")
    rig = load_rig(folder / "rig.toml")
    files = simulate_shot(rig, folder / "files", seed=seed, shot="0001").files
    path = ingest_files(rig, files, shot="0001", out=folder / "shots", on=ON).path
    return Range(folder, tuple(files), path, text)


@pytest.fixture(scope="module")
def mixed(tmp_path_factory: pytest.TempPathFactory) -> Range:
    return a_range(tmp_path_factory.mktemp("mixed"), with_twin("mixed", **SHORTER).text, 3)


@pytest.fixture(scope="module")
def tracked(tmp_path_factory: pytest.TempPathFactory) -> Range:
    """A shot without a recoil accelerometer, whose camera is aligned by the forces."""
    return a_range(tmp_path_factory.mktemp("tracked"), tracked_rig("field-2013", **SHORTER).text, 7)


def gauge(**keys: Any) -> tuple[str, str]:
    """Replace what the sensor of the breech gauge says."""
    more = "".join(f"{key} = {value}, " for key, value in keys.items())
    return 'serial = "V301", ', f'serial = "V301", {more}'


BREECH = gauge(gain=1.01, offset=0.1)
ACCELEROMETER = ('serial = "V101", ', 'serial = "V101", gain = 0.99, offset = 2.0, ')
CAMERA = ('serial = "V401", ', 'serial = "V401", gain = 1.002, ')
SURER = (
    'serial = "V101", calibrated = 2026-01-15, due = 2099-12-31, u_rel = 0.005',
    'serial = "V101", calibrated = 2026-09-15, due = 2099-12-31, u_rel = 0.003',
)
WEIGHED = (
    ("friction = 1500.0 ", "friction = 1600.0 "),
    ("m3 = 782.0 ", "m3 = 790.0 "),
    ("phi20 = 0.17 ", "phi20 = 0.172 "),
)


def _apart(quality: list[dict[str, Any]]) -> tuple[list[dict[str, Any]], list[float]]:
    """Return checks without the figures of their sentences, and these."""
    figures = [figure["value"] for one in quality for figure in one.get("figures", ())]
    return [{key: value for key, value in one.items() if key != "figures"} for one in quality], figures


@pytest.mark.whole_way
@pytest.mark.parametrize(
    "pairs", [(BREECH, ACCELEROMETER, CAMERA), (SURER, *WEIGHED)], ids=["gains", "certificate and mechanism"]
)  # fmt: skip
def test_the_mass_and_the_verdict_are_those_of_an_ingest_with_the_corrected_rig(
    mixed: Range, tmp_path: Path, pairs: tuple[tuple[str, str], ...]
) -> None:
    rig_file = mixed.rig_file(tmp_path, *pairs)
    fresh_file = mixed.ingested(rig_file, tmp_path / "fresh")
    corrected = identify_file(mixed.shot_file, out=tmp_path / "one", rig=rig_file)
    fresh = identify_file(fresh_file, out=tmp_path / "other")
    assert corrected.mass_kg == pytest.approx(fresh.mass_kg, rel=1e-12)
    assert corrected.u_kg == pytest.approx(fresh.u_kg, rel=1e-10)
    assert corrected.specification_kg == fresh.specification_kg
    for key in ("valid", "reasons", "assumptions"):
        assert corrected.document[key] == fresh.document[key], key
    told, figures = zip(*(_apart(one.document["quality"]) for one in (corrected, fresh)), strict=True)
    assert told[0] == told[1]
    assert figures[0] == pytest.approx(figures[1], rel=1e-2)
    # certificate and pulse are known alike, so that their rows are as large to the last digits
    ours, theirs = (sorted(row["source"] for row in one.document["budget"]) for one in (corrected, fresh))
    assert ours == theirs
    influences = [
        [parameter["influences"] for parameter in one.document["campaign"]["parameters"]] for one in (corrected, fresh)
    ]
    assert influences[0] == influences[1]


@pytest.mark.whole_way
def test_a_camera_that_is_aligned_by_the_forces_is_aligned_anew(tracked: Range, tmp_path: Path) -> None:
    assert tracked.text.count('name = "p_breech"') == 1
    rig_file = tracked.rig_file(tmp_path)
    head, mark, tail = tracked.text.partition('name = "p_breech"')
    rig_file.write_text(head + mark + tail.replace("u_rel", "gain = 1.01, u_rel", 1), encoding="utf-8")
    fresh = read_shot(tracked.ingested(rig_file, tmp_path / "fresh"))
    (was,), (now,) = read_shot(tracked.shot_file).alignments, fresh.alignments
    assert abs(now.offset_s - was.offset_s) > 0.1 * was.u_offset_s
    fired = read_stored(tracked.shot_file, rig_file)
    assert fired.shot.alignments[0].offset_s == pytest.approx(now.offset_s, abs=1e-12)
    assert "aligned anew with what was corrected: camera" in fired.notes
    assert fired.shot.quality == fresh.quality


@pytest.mark.indispensable("corrected rig")
def test_the_gain_moves_the_mass_as_the_force_and_the_report_says_why(
    mixed: Range, tmp_path: Path, run: Callable[..., Any]
) -> None:
    rig_file = mixed.rig_file(tmp_path, gauge(gain=1.01))
    before = hashlib.sha256(mixed.shot_file.read_bytes()).hexdigest()
    plain = run("identify", "--verbose", mixed.shot_file, "--out", tmp_path / "plain", "--method", "reverse")
    result = run(
        "identify", "--verbose", mixed.shot_file, "--rig", rig_file, "--out", tmp_path / "out", "--method", "reverse"
    )
    assert (plain.exit_code, result.exit_code) == (0, 0), result.output
    assert hashlib.sha256(mixed.shot_file.read_bytes()).hexdigest() == before
    report, as_was = (
        json.loads((tmp_path / folder / "0001" / "report.json").read_text("utf-8")) for folder in ("out", "plain")
    )
    assert report["mass"]["value"] / as_was["mass"]["value"] == pytest.approx(1.01, abs=1e-3)
    assert as_was["corrections"] == []
    assert report["corrections"] == [{"key": "channel 'p_breech'.sensor.gain", "was": 1.0, "is": 1.01}]
    content = rig_file.read_bytes()
    assert {
        "file": "corrected.toml", "sha256": hashlib.sha256(content).hexdigest(), "size": len(content),
        "source": "rig file", "reader": "TOML",
    } in report["provenance"]["inputs"]  # fmt: skip
    line = "corrected by corrected.toml: channel 'p_breech'.sensor.gain 1 -> 1.01"
    assert f"note: {line}\n" in result.output
    page = (tmp_path / "out" / "0001" / "report.html").read_text("utf-8")
    assert page.count(line.replace("'", "&#39;").replace(">", "&gt;")) == 1


@pytest.mark.whole_way
def test_a_target_is_found_with_the_corrected_rig(mixed: Range, tmp_path: Path, run: Callable[..., Any]) -> None:
    rig_file = mixed.rig_file(tmp_path, gauge(gain=1.01))
    words = ["identify", mixed.shot_file, "--target", "breech-force", "--out", tmp_path / "out", "--rig", rig_file]
    result = run(*words)
    assert result.exit_code in (0, 1), result.output
    document = json.loads((tmp_path / "out" / "0001" / "breech-force.json").read_text("utf-8"))
    assert [one["is"] for one in document["corrections"]] == [1.01]
    assert "rig file" in [one["source"] for one in document["provenance"]["inputs"]]


@pytest.mark.whole_way
def test_a_rig_file_that_corrects_nothing_says_so(mixed: Range, tmp_path: Path) -> None:
    rig_file = mixed.rig_file(tmp_path)
    fired, plain = read_stored(mixed.shot_file, rig_file), read_stored(mixed.shot_file)
    assert fired.corrections == ()
    assert fired.notes == ("corrected.toml says nothing but what the shot file's rig says: nothing was corrected",)
    assert fired.shot.quality == plain.shot.quality
    assert fired.rig_file is not None


@pytest.mark.whole_way
def test_other_sensors_are_refused_each_on_its_line_and_nothing_is_written(
    mixed: Range, tmp_path: Path, run: Callable[..., Any]
) -> None:
    rig_file = mixed.rig_file(tmp_path, ('"V301"', '"V901"'), ("position = [-0.30,", "position = [-0.31,"))
    result = run("identify", mixed.shot_file, "--rig", rig_file, "--out", tmp_path / "out")
    assert result.exit_code == 3
    first, *faults = result.stderr.strip().splitlines()
    assert first.endswith("corrected.toml: 2 faults")
    assert [fault.partition(" when this shot")[0].strip() for fault in faults] == [
        "channel 'acc_recoil'.sensor.position: was [-0.3, 0.06]",
        "channel 'p_breech'.sensor.serial: was V301",
    ]
    assert not (tmp_path / "out").exists()
    missing = run("identify", mixed.shot_file, "--rig", tmp_path / "none.toml", "--out", tmp_path / "out")
    assert missing.exit_code == 3
    assert "no such rig file" in missing.stderr


@pytest.mark.whole_way
def test_the_added_mass_of_the_shot_log_is_added_to_the_corrected_specification(mixed: Range, tmp_path: Path) -> None:
    shot_file = Path(shutil.copy(mixed.shot_file, tmp_path))
    (tmp_path / "shotlog.csv").write_text("shot,added_mass_kg,u_added_mass_kg\n0001,100.0,0.05\n", encoding="utf-8")
    fired = read_stored(shot_file, mixed.rig_file(tmp_path, ("m3 = 782.0 ", "m3 = 783.0 ")))
    assert fired.rig.mechanism.m3 == 883.0
    plain = read_stored(shot_file)
    differing = {one.check for one in fired.shot.quality} & {"impulse", "braking"}
    assert differing == {"impulse", "braking"}
    assert fired.shot.quality != plain.shot.quality


@pytest.mark.whole_way
def test_a_verdict_that_only_the_recorded_files_tell_is_kept_and_named(mixed: Range, tmp_path: Path) -> None:
    shot = read_shot(mixed.shot_file)
    told = tuple(
        replace(one, verdict="warn", detail="found by what no longer is") if one.check == "impulse" else one
        for one in shot.quality
    )
    cut = QualityCheck("can", Check.FILE, "warn", "was cut off: in the last frame")
    write_shot(replace(shot, quality=(cut, *told)), tmp_path / "0001.h5")
    fired = read_stored(tmp_path / "0001.h5", mixed.rig_file(tmp_path, BREECH))
    assert fired.shot.quality[0] == cut
    assert any(one.detail == "found by what no longer is" for one in fired.shot.quality)
    assert "of the verdict these are kept as ingest found them, with the rig as it was: shot impulse" in fired.notes


@pytest.mark.whole_way
def test_a_due_date_that_was_wrong_no_longer_warns(mixed: Range, tmp_path: Path) -> None:
    late = mixed.rig_file(tmp_path, ("due = 2099-12-31", "due = 2026-02-01"))
    overdue = mixed.ingested(late, tmp_path / "overdue")
    assert [one.channel for one in read_shot(overdue).quality if one.check == "calibration"] == ["acc_recoil"]
    fired = read_stored(overdue, mixed.rig_file(tmp_path))
    there = [one for one in fired.shot.quality if one.check == "calibration"]
    assert there == []


@pytest.mark.whole_way
def test_a_shot_that_was_judged_by_the_day_of_its_ingest_is_judged_by_that_of_its_start(
    mixed: Range, tmp_path: Path
) -> None:
    shot = read_shot(mixed.shot_file)
    earlier = [
        replace(step, parameters={key: value for key, value in step.parameters.items() if key != "day_of"})
        for step in shot.history
    ]
    false = QualityCheck("acc_recoil", Check.CALIBRATION, "warn", "calibration was due 2026-03-20, 251 days ago")
    write_shot(replace(shot, history=tuple(earlier), quality=(*shot.quality, false)), tmp_path / "0001.h5")
    assert all(one.check != "calibration" for one in read_stored(tmp_path / "0001.h5").shot.quality)


# ---- campaigns


def prior_u_of_v101(done: Combined) -> float:
    (u,) = (row["prior_u"] for row in done.document["common"] if row["influence"].endswith("sensor V101"))
    return float(u)


@pytest.fixture(scope="module")
def two(mixed: Range, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of two shots that differ in their files alone."""
    folder = tmp_path_factory.mktemp("two")
    for name in ("0001", "0002"):
        write_shot(fired_again(read_shot(mixed.shot_file), name), folder / f"{name}.h5")
    return folder


@pytest.fixture(scope="module")
def plain_reports(two: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("plain")
    for shot_file in sorted(two.glob("*.h5")):
        identify_file(shot_file, out=out, options=CUT_OFF)
    return out


@pytest.mark.whole_way
def test_a_campaign_identifies_anew_what_was_made_without_the_corrected_rig(
    mixed: Range, two: Path, tmp_path: Path, plain_reports: Path
) -> None:
    rig_file = mixed.rig_file(tmp_path, SURER)
    done = campaign(two, reports=plain_reports, rig=rig_file, out=tmp_path / "campaign")
    assert any(note.endswith("was made without this corrected rig file: the shot was identified anew")
               for note in done.document["notes"])  # fmt: skip
    assert prior_u_of_v101(done) == pytest.approx(0.003)
    digest = hashlib.sha256(rig_file.read_bytes()).hexdigest()
    assert digest in [one["sha256"] for one in done.document["provenance"]["inputs"]]
    report = tmp_path / "campaign" / "reports" / "0001" / "report.json"
    made = report.stat().st_mtime_ns
    again = campaign(two, reports=plain_reports, rig=rig_file, out=tmp_path / "campaign", overwrite=True)
    assert again.document["mass"] == done.document["mass"]
    assert report.stat().st_mtime_ns == made


@pytest.mark.whole_way
def test_a_campaign_does_not_drop_a_correction_silently(mixed: Range, two: Path, tmp_path: Path) -> None:
    rig_file = mixed.rig_file(tmp_path, SURER)
    for shot_file in sorted(two.glob("*.h5")):
        identify_file(shot_file, out=tmp_path / "reports", options=CUT_OFF, rig=rig_file)
    taken = campaign(two, reports=tmp_path / "reports", out=tmp_path / "taken")
    assert prior_u_of_v101(taken) == pytest.approx(0.003)
    with pytest.raises(ReadError, match="was made with a corrected rig file; give that rig file with --rig"):
        campaign(two, reports=tmp_path / "reports", out=tmp_path / "other", cutoff_hz=300.0)


@pytest.mark.whole_way
def test_a_report_alone_cannot_be_corrected(mixed: Range, tmp_path: Path, plain_reports: Path) -> None:
    rig_file = mixed.rig_file(tmp_path, SURER)
    with pytest.raises(ReadError, match="made without this corrected rig file, and its shot file is not given"):
        campaign(plain_reports, reports=plain_reports, rig=rig_file, out=tmp_path / "campaign")
    with pytest.raises(RigError):
        identify_file(mixed.shot_file, out=tmp_path / "x", rig=mixed.rig_file(tmp_path, ('"V301"', '"V901"')))
