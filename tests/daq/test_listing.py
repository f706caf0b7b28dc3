"""Tests of values that list their parts."""

from dataclasses import replace
from pathlib import Path

from recoil_acquisition.listing import Listed, Listing
from recoil_acquisition.shot.quality_check import Check, QualityCheck
from recoil_daq import load_rig, open_recording
from tests.builders.shots import make_shot


class _Drawer(Listed):
    def listing(self) -> Listing:
        return Listing("a <drawer>", ("what", "number", "kg"), (("bolts & nuts", 12_000, 0.25), ("tube", 1, None)))


def test_numbers_stand_at_the_right_and_what_is_missing_is_a_dash() -> None:
    assert str(_Drawer()).splitlines() == [
        "a <drawer>",
        "  what          number    kg",
        "  bolts & nuts  12,000  0.25",
        "  tube               1     -",
    ]


def test_a_notebook_shows_the_same_as_text_that_is_no_markup() -> None:
    assert "a &lt;drawer&gt;" in _Drawer()._repr_html_()
    assert "bolts &amp; nuts  12,000" in _Drawer()._repr_html_()


def test_what_a_terminal_would_obey_is_spelled() -> None:
    assert str(Listing("\x1b[31m", ("name",), (("a\nb",),))).splitlines() == ["\\x1b[31m", "  name", "  a\\nb"]


def test_a_listing_without_rows_has_its_columns() -> None:
    assert str(Listing("empty", ("name", "unit"), ())).splitlines() == ["empty", "  name  unit"]


def test_a_shot_lists_its_channels_with_the_worst_verdict_of_each() -> None:
    shot = make_shot()
    name = next(iter(shot.channels))
    verdicts = ("ok", "fail", "warn")
    shot = replace(shot, quality=tuple(QualityCheck(name, Check.HUM, verdict, "") for verdict in verdicts))
    lines = str(shot).splitlines()
    assert lines[0] == repr(shot)
    assert lines[2].split()[0] == name
    assert lines[2].split()[-1] == "fail"
    assert len(lines) == 2 + len(shot.channels)


def test_a_rig_lists_its_channels_with_their_sensors() -> None:
    rig = load_rig("field-2013")
    lines = str(rig).splitlines()
    assert [line.split()[0] for line in lines[2:]] == [channel.name for channel in rig.channels]
    assert str(rig.channels[0].sensor.u_rel) in lines[2]


def test_a_recording_lists_its_signals(tmp_path: Path) -> None:
    (tmp_path / "daq.csv").write_text("Time (s),force (N)\n0.0,1\n0.1,2\n0.2,3\n", encoding="utf-8")
    assert str(open_recording(tmp_path / "daq.csv")).splitlines()[1:] == [
        "  signal  unit  samples",
        "  force   N           3",
    ]
