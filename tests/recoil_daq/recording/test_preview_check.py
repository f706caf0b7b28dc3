"""What was read live of a recorder, beside its own file: shots of the virtual rig, and a kind that stands in."""

from __future__ import annotations

import datetime as dt
import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from recoil_acquisition.clocks.timebase import AbsoluteStart, TimeBase
from recoil_acquisition.errors import StoreError
from recoil_acquisition.log.capture import read_capture
from recoil_acquisition.readers.excerpt import span_of
from recoil_acquisition.readers.recording import Recording, SignalHeader, StoredChannel
from recoil_acquisition.readers.table import recognise
from recoil_acquisition.shot.quality_check import Check
from recoil_acquisition.shot.shot import Shot
from recoil_acquisition.store import read_shot
from recoil_daq.recording.ingest import Ingested, ingest_files
from recoil_daq.recording.preview_check import COMPARED, ComparedPreview, compared_preview, compared_previews
from recoil_daq.reports.identify import identify_file
from recoil_identification.shot.analysis import identify_shot
from recoil_identification.shot.identified import Identification, Options
from recoil_rigs.rig import parse_rig
from recoil_rigs.shots.fired_shot import FiredShot
from tests.builders.preview_captures import Faults, PreviewedShot, previewed_shot

pytestmark = pytest.mark.whole_way
DAY = dt.date(2026, 6, 1)
BRAKE = "AI 7/p_brake"
PREVIEWS = (Check.PREVIEW, Check.PREVIEW_COMPARED)
WHY = "0001_dewetron.csv replaces the preview"


@pytest.fixture(scope="module")
def shot() -> Iterator[PreviewedShot]:
    with previewed_shot() as found:
        yield found


def preview_of(shot: PreviewedShot, faults: Faults | None = None, **options: object) -> Ingested:
    capture = shot.preview(faults, **options)  # type: ignore[arg-type]
    out = shot.folder / "shots"
    return ingest_files(shot.rig, [capture, *shot.others], out=out, on=DAY, overwrite=True)


def replaced(shot: PreviewedShot, own: Path, faults: Faults | None = None, **options: object) -> Ingested:
    """Replace a preview of the recorder's file by that file."""
    before = preview_of(shot, faults, of=own, **options)
    files = [shot.folder / "0001.rdlog", own, *shot.others]
    return ingest_files(shot.rig, files, shot="0001", out=before.path.parent, on=DAY, replaces=WHY)


def told(shot: Shot, channel: str = "dewetron") -> tuple[str, str]:
    (check,) = (one for one in shot.quality if one.check in PREVIEWS and one.channel == channel)
    return check.verdict, str(check.detail)


def channels_told(shot: Shot) -> set[str]:
    return {one.channel for one in shot.quality if one.check in PREVIEWS}


def test_a_shot_of_what_was_read_live_is_usable_and_says_that_it_is_a_preview(shot: PreviewedShot) -> None:
    made = preview_of(shot)
    assert made.shot.usable
    verdict, text = told(made.shot)
    assert verdict == "warn"
    assert text.startswith("what was read live is a preview: the instrument's own file takes its place; ")
    assert any(one["code"] == "preview" for one in made.to_json()["findings"])
    assert told(read_shot(made.path)) == (verdict, text)
    assert identified(made).valid


def test_the_file_replaces_the_preview_which_is_proven_equal(shot: PreviewedShot) -> None:
    made = replaced(shot, shot.dmd())
    assert made.shot.usable
    verdict, text = told(made.shot)
    assert verdict == "ok"
    assert text.startswith("the preview is proven equal to 0001_dewetron.dmd: 56000 samples of 8 channels, whole ")
    assert text.endswith("; laid on one another by the time of both")
    assert channels_told(made.shot) == {"dewetron"}
    stored = read_shot(made.path)
    steps = {step.what: step.parameters for step in stored.history}
    assert steps["replace shot file"]["why"] == WHY
    figures = steps[COMPARED]["channels"]["p_brake"]
    assert (figures["compared"], figures["equal"], figures["proven_equal"]) == (7000, 7000, True)
    assert json.loads(json.dumps(figures, allow_nan=False)) == figures
    assert [(one.name, one.source, one.reader) for one in stored.inputs][2:] == [("0001.rdlog", "", "acquisition")]
    assert stored.acquisition is not None
    assert stored.channels["p_brake"].samples.size > 7000


def test_a_text_tells_no_time_and_is_laid_by_what_it_shows(shot: PreviewedShot) -> None:
    verdict, text = told(replaced(shot, shot.own).shot)
    assert verdict == "ok"
    assert text.endswith("single precision; laid on one another by what they show: the times of both do not tell where")


def test_a_preview_that_is_scaled_1_percent_off_is_named(shot: PreviewedShot) -> None:
    made = replaced(shot, shot.dmd(), Faults(scale={BRAKE: 1.01}))
    assert channels_told(made.shot) == {"dewetron", "p_brake"}
    assert told(made.shot)[1].startswith("of 56000 samples of 8 channels compared with the preview 490")
    assert "; 7 of 8 channels are proven equal; " in told(made.shot)[1]
    verdict, text = told(made.shot, "p_brake")
    assert verdict == "warn"
    assert "; the preview is 1.01 times the file; the first difference is at 0.036000 s (sample 900): " in text
    assert made.shot.usable


def test_a_preview_that_is_shifted_by_one_sample_is_named(shot: PreviewedShot) -> None:
    verdict, text = told(replaced(shot, shot.dmd(), Faults(shift=1)).shot)
    assert verdict == "warn"
    assert (
        "none of 8 channels is proven equal; in each channel the preview is shifted by 1 sample, 40 us early; " in text
    )
    assert text.endswith("by what they show, where the time of both does not put them")


@pytest.mark.parametrize("zero_s", [0, 3, -2])
def test_a_preview_counts_from_any_whole_second_of_the_recorders_clock(shot: PreviewedShot, zero_s: int) -> None:
    assert told(replaced(shot, shot.dmd(), zero_s=zero_s).shot)[1].endswith("; laid on one another by the time of both")
    shifted = replaced(shot, shot.dmd(), Faults(shift=1), zero_s=zero_s).shot
    assert "the preview is shifted by 1 sample, 40 us early" in told(shifted)[1]


def test_a_preview_with_a_hole_is_named_whether_its_ticks_show_it_or_not(shot: PreviewedShot) -> None:
    verdict, text = told(replaced(shot, shot.dmd(), Faults(hole=(3000, 3064))).shot)
    assert verdict == "warn"
    assert "55488 are equal; none of 8 channels is proven equal; in each channel 64 samples missing in " in text
    assert "missing in the preview, the first one at 0.156000 s (sample 3900); " in text
    hidden = replaced(shot, shot.own, Faults(hole=(3000, 3064), hidden=True)).shot
    assert (
        "; in each channel 64 samples fell out without a gap in its time at 0.156000 s (sample 3900); "
        in told(hidden)[1]
    )


def test_a_preview_in_another_unit_is_compared_in_the_files(shot: PreviewedShot) -> None:
    text = shot.rig.text.replace(f'signal = "{BRAKE}"', f"# {BRAKE}", 1)
    before, _, after = text.partition(f"# {BRAKE}")
    head, _, tail = after.partition('unit = "MPa"')
    rig = parse_rig(f'{before}signal = "{BRAKE}"{head}{tail}', shot.rig.path)
    kilo = shot.preview(Faults(scale={BRAKE: 1e3}), units={BRAKE: "kPa"})
    one = replace(shot, rig=rig)
    made = ingest_files(rig, [kilo, one.own, *one.others], shot="0003", out=shot.folder / "units", on=DAY)
    assert told(made.shot)[0] == "ok"
    mega = shot.preview(Faults(scale={BRAKE: 1e3}), units={BRAKE: "MPa"})
    again = ingest_files(
        rig, [mega, one.own, *one.others], shot="0003", out=shot.folder / "units", on=DAY, replaces=WHY
    )
    assert "the preview is 1000 times the file" in told(again.shot, "p_brake")[1]


def test_of_a_file_that_is_too_long_the_part_about_the_shot_is_compared(
    shot: PreviewedShot, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("recoil_daq.recording.preview_check.MOST_COMPARED", 10_000)
    capture = shot.preview()
    (one,) = read_previews(shot, capture, part=2000)
    assert one.channels["p_brake"].compared == 2000
    monkeypatch.setattr("recoil_daq.recording.preview_check.MOST_COMPARED", 1 << 24)
    (one,) = read_previews(shot, capture, part=2000)
    assert one.channels["p_brake"].compared == 7000


def read_previews(shot: PreviewedShot, capture: Path, part: int) -> tuple[ComparedPreview, ...]:
    """Compare a preview with the recorder's file, of which a part was cut out."""
    readers = {path: recognise(path) for path in (capture, shot.own)}
    whole = readers[shot.own].open(shot.own, shot.rig.declarations(shot.rig.source("dewetron")))
    base = whole.time_base(BRAKE)
    cut = span_of(whole, base.times_s[3000], base.times_s[3000 + part], "cut")
    captures, matched = {capture: read_capture(capture)}, {"dewetron": shot.own}
    return compared_previews(shot.rig, captures, readers, matched, {"dewetron": whole}, {"dewetron": cut})


@pytest.mark.parametrize(
    ("start", "shift"),
    [("12:00:00.000000000", 1), ("12:00:00.000", 1), ("12:00:02.000", 1), ("12:00:00", 0), ("12:00:00.00", 0)],
)
def test_a_shift_is_told_as_finely_as_both_say_when_they_began(shot: PreviewedShot, start: str, shift: int) -> None:
    values, late = np.random.default_rng(2).normal(size=5000), 2 * start.startswith("12:00:02")
    live = recorded(values[1000:3000], "12:00:00.000000000", (1000 - 1) / 25e3)
    own = recorded(values, start, -float(late))
    found = compared_preview(shot.rig, "dewetron", live, own).channels["p_brake"]
    assert (found.shift, found.equal) == (shift, 2000)


def recorded(samples: np.ndarray, start: str, first_s: float) -> Recording:
    """Record the brake's pressure at 25 kHz."""
    begun = AbsoluteStart(f"2026-06-01T{start}", "UTC", "header")
    base = TimeBase.uniform("dewetron", first_s, 1 / 25e3, samples.size, begun)
    channel = StoredChannel(SignalHeader(BRAKE, "MPa", samples.size), base, lambda low, high: samples[low:high].copy())
    return Recording(Path("x"), "x", [channel], metadata={}, absolute_start=begun)


def test_a_file_of_another_rate_is_compared_with_nothing_and_says_so(shot: PreviewedShot) -> None:
    with previewed_shot(sample_rate_hz=20e3) as other:
        capture = shot.preview()
        made = ingest_files(other.rig, [capture, other.own, *other.others], out=shot.folder / "other", on=DAY)
        texts = {one.detail for one in made.shot.quality if one.check in PREVIEWS}
    assert texts == {"not compared with the preview: it was read live at 25000 Hz, and the file has 20000 Hz"}


def test_the_file_that_took_the_place_of_a_capture_is_not_doubted_for_its_name(shot: PreviewedShot) -> None:
    assert Check.FILE_NAMES not in {one.check for one in replaced(shot, shot.dmd()).shot.quality}


def test_a_preview_and_its_file_are_one_shot(shot: PreviewedShot) -> None:
    made = replaced(shot, shot.dmd())
    assert [path.name for path in made.path.parent.glob("*.h5")] == ["0001.h5"]
    with pytest.raises(StoreError, match=r"these files are in .*0001\.h5 already; found 0001\.rdlog"):
        ingest_files(shot.rig, [shot.folder / "0001.rdlog", *shot.others], shot="0002", out=made.path.parent, on=DAY)


def test_the_report_says_that_it_is_of_a_preview_and_then_how_that_stood_beside_the_file(shot: PreviewedShot) -> None:
    made = preview_of(shot, of=shot.dmd())
    before = identify_file(made.path, out=shot.folder / "reports")
    said = "dewetron: what was read live is a preview: "
    assert before.document["notes"][0].startswith(said)
    page = (shot.folder / "reports" / "0001" / "report.html").read_text("utf-8")
    assert "By a preview: what was read live of dewetron." in page
    after = identify_file(replaced(shot, shot.dmd()).path, out=shot.folder / "reports", overwrite=True)
    assert after.document["notes"][0].startswith("dewetron: the preview is proven equal to 0001_dewetron.dmd: ")
    (finding,) = (one for one in after.document["findings"] if one["code"] == "preview compared")
    assert finding["severity"] == "note"
    assert "By a preview" not in (shot.folder / "reports" / "0001" / "report.html").read_text("utf-8")
    assert after.document["mass"]["value"] == pytest.approx(before.document["mass"]["value"], rel=0.01)


def identified(made: Ingested) -> Identification:
    return identify_shot(FiredShot(made.shot, made.rig), Options())


@pytest.mark.exhaustive
@pytest.mark.parametrize("seed", range(1, 21))
def test_the_mass_by_the_file_is_that_of_the_preview(seed: int) -> None:
    with previewed_shot(seed) as one:
        before = identified(preview_of(one, first=0, count=8700))
        made = replaced(one, one.own, first=0, count=8700)
        after = identified(made)
        assert told(made.shot)[0] == "ok"
        assert len([*made.path.parent.glob("*.h5")]) == 1
    apart_kg = after.chosen.estimate.mass_kg - before.chosen.estimate.mass_kg
    assert abs(apart_kg) < 0.05 * after.chosen.estimate.u_kg
    assert after.valid == before.valid
