"""Words among numbers of MDF files: each is a lost sample, named; asammdf gives the same numbers."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from recoil_acquisition.errors import ReadError
from recoil_acquisition.readers.mdf.reader import MdfReader
from recoil_acquisition.readers.mdf3.reader import OldMdfReader
from tests.builders.container_files import mdf_file, ramp
from tests.builders.mdf3_files import UNSIGNED, OldFile, one_channel
from tests.builders.mdf_logs import Blocks, identification_block
from tests.builders.opened_files import open_bytes

asammdf = pytest.importorskip("asammdf")

opened = partial(open_bytes, MdfReader(), "a.mf4")
opened_old = partial(open_bytes, OldMdfReader(), "a.mdf")
BY_VALUE, BY_RANGE, LINEAR, FORMULA = 7, 8, 1, 3
_FORMAT = {8: "B", 16: "H", 32: "I", 64: "Q"}


def coded_file(
    kind: int, keys: Sequence[float], links: Sequence[str | tuple[float, float, str] | None], stored: Sequence[float],
    *, bits: int = 16, unit: str = "", own_unit: str = "", data_type: int = 0,
) -> bytes:  # fmt: skip
    """A file of a channel ``a`` over seconds; a link is a text, an offset with a factor and a unit, or none."""
    blocks = Blocks(identification_block(b"MDF     "))
    led = [0 if one is None else blocks.text(one) if isinstance(one, str) else blocks.linear(*one) for one in links]
    body = struct.pack(f"<BBHHHdd{len(keys)}d", kind, 0, 0, len(links), len(keys), 0.0, 0.0, *keys)
    conversion = blocks.add("##CC", (0, blocks.text(unit) if unit else 0, 0, 0, *led), body)
    value = blocks.column("a", 0, data_type, 8, bits, 0, conversion=conversion)
    if own_unit:
        struct.pack_into("<Q", blocks.content, value + 24 + 6 * 8, blocks.text(own_unit))
    time = blocks.column("t", 2, 4, 0, 64, value)
    layout = f"<d{'d' if data_type == 4 else _FORMAT[bits]}"
    rows = b"".join(struct.pack(layout, float(n), one) for n, one in enumerate(stored))
    sizes = struct.pack("<QQHHLLL", 0, len(stored), 0, 0, 0, 8 + bits // 8, 0)
    group = blocks.add("##CG", (0, time, 0, 0, 0, 0), sizes)
    return blocks.closed(blocks.add("##DG", (0, group, blocks.add("##DT", (), rows), 0), bytes(8)))


def as_asammdf_reads(path: Path) -> np.ndarray[Any, Any]:
    with asammdf.MDF(path) as mdf:
        return np.asarray(mdf.get("a").samples, np.float64)


def test_a_word_by_value_among_scaled_numbers_is_a_lost_sample_that_is_named(tmp_path: Path) -> None:
    stored = [100, 65534, 200, 65535, 300, 65535]
    links = ["error", "not available", (-10.0, 0.5, "MPa")]
    recording = opened(tmp_path, coded_file(BY_VALUE, [65534, 65535], links, stored))
    np.testing.assert_array_equal(recording.read("a"), [40.0, np.nan, 90.0, np.nan, 140.0, np.nan])
    np.testing.assert_array_equal(recording.read("a"), as_asammdf_reads(tmp_path / "a.mf4"))
    np.testing.assert_array_equal(recording.read("a", 1, 3), [np.nan, 90.0])
    assert recording.header("a").unit == "MPa"
    assert recording.raw("a") is None
    (note,) = recording.notes
    codes = "65534 'error' x1, 65535 'not available' x2"
    assert note == f"a: 3 of 6 samples hold a code that is no measurement ({codes}): lost samples"


def test_words_and_scales_by_range_are_those_of_asammdf(tmp_path: Path) -> None:
    links = [(0.0, 0.5, "V"), (-50.0, 1.0, "V"), "reserved"]
    keys = [0, 100, 101, 249, 250, 255]
    stored = [0, 7, 100, 101, 249, 250, 251, 255]
    for default, bits in (("spare", 8), ((1000.0, 0.0, ""), 8), (None, 16)):
        content = coded_file(
            BY_RANGE, keys, [*links[:3], default], [*stored, *([300] if bits == 16 else [])], bits=bits
        )
        recording = opened(tmp_path, content)
        np.testing.assert_array_equal(recording.read("a"), as_asammdf_reads(tmp_path / "a.mf4"))
        assert "250 to 255 'reserved' x3" in recording.notes[0]


def test_an_upper_key_is_no_part_of_a_range_of_floats(tmp_path: Path) -> None:
    content = coded_file(
        BY_RANGE, [0.0, 10.0, 10.0, 20.0], [(0.0, 2.0, ""), "too much", "other"], [0.0, 9.75, 10.0, 20.0, -1.0],
        bits=64, data_type=4,
    )  # fmt: skip
    recording = opened(tmp_path, content)
    np.testing.assert_array_equal(recording.read("a"), [0.0, 19.5, np.nan, np.nan, np.nan])
    np.testing.assert_array_equal(recording.read("a"), as_asammdf_reads(tmp_path / "a.mf4"))
    assert "10 to 20 'too much' x1, any other number 'other' x2" in recording.notes[0]


def test_a_word_stands_for_a_float_that_is_its_key(tmp_path: Path) -> None:
    links = ["not measured", (0.0, 2.0, "")]
    content = coded_file(BY_VALUE, [-999.0], links, [1.5, -999.0, -999.5], bits=64, data_type=4)
    recording = opened(tmp_path, content)
    np.testing.assert_array_equal(recording.read("a"), [3.0, np.nan, -1999.0])
    np.testing.assert_array_equal(recording.read("a"), as_asammdf_reads(tmp_path / "a.mf4"))


def test_names_of_the_largest_numbers_alone_are_codes_where_others_stay_what_they_are(tmp_path: Path) -> None:
    recording = opened(tmp_path, coded_file(BY_VALUE, [65535], ["not available", None], [1, 65535, 3]))
    np.testing.assert_array_equal(recording.read("a"), [1.0, np.nan, 3.0])


@pytest.mark.parametrize(
    ("keys", "links", "stored"),
    [
        ([0, 1], ["off", "on", None], [0, 1, 1]),
        ([0, 1], ["off", "on", ""], [0, 1, 2]),
        ([0, 1], ["off", "on", (0.0, 1.0, "")], [0, 1, 1]),
    ],
    ids=["no default", "empty default", "words alone"],
)
def test_what_is_words_alone_is_an_enumeration_and_left_out(
    keys: list[float], links: list[Any], stored: list[int], tmp_path: Path
) -> None:
    with pytest.raises(ReadError, match="an enumeration"):
        opened(tmp_path, coded_file(BY_VALUE, keys, links, stored))


def test_without_a_code_the_stored_numbers_are_kept(tmp_path: Path) -> None:
    recording = opened(tmp_path, coded_file(BY_VALUE, [65535], ["none", (-10.0, 0.5, "V")], [100, 200]))
    raw = recording.raw("a")
    assert raw is not None
    assert (raw.counts.tolist(), raw.gain, raw.offset, raw.unit) == ([100, 200], 0.5, -10.0, "V")
    assert not recording.notes


def test_scales_of_several_units_are_left_out(tmp_path: Path) -> None:
    links = [(0.0, 0.5, "V"), (-50.0, 1.0, "mV"), "spare"]
    with pytest.raises(ReadError, match="its ranges have the units V, mV"):
        opened(tmp_path, coded_file(BY_RANGE, [0, 100, 101, 249], links, [1, 2]))
    with pytest.raises(ReadError, match="its ranges have the units g, V"):
        opened(tmp_path, coded_file(BY_VALUE, [9], ["spare", (0.0, 0.5, "V")], [1, 2], own_unit="g"))


@pytest.mark.parametrize(
    ("keys", "links"),
    [([0, 10, 5, 20], ["a", "b", (0.0, 1.0, "")]), ([float("nan"), 10], ["a", (0.0, 1.0, "")]), ([0, 1], ["a"])],
    ids=["over one another", "no number", "a link missing"],
)
def test_ranges_that_cannot_be_are_damage(keys: list[float], links: list[Any], tmp_path: Path) -> None:
    with pytest.raises(ReadError, match="damaged"):
        opened(tmp_path, coded_file(BY_RANGE, keys, links, [1, 2]))


def test_a_link_that_leads_back_or_to_a_formula_leaves_its_channel_out(tmp_path: Path) -> None:
    formula = {"lower_0": 0, "upper_0": 9, "text_0": b"low", "default_addr": b'"2*{X}+1"'}
    signals = [asammdf.Signal(np.arange(12, dtype="u1"), ramp(), name="a", conversion=formula)]
    with pytest.raises(ReadError, match="a formula as text"):
        opened(tmp_path, mdf_file(signals))
    content = bytearray(coded_file(BY_VALUE, [9], ["spare", (0.0, 0.5, "V")], [1, 2]))
    table = content.index(struct.pack("<BBHHHdd", BY_VALUE, 0, 0, 2, 1, 0.0, 0.0)) - 24 - 6 * 8
    struct.pack_into("<Q", content, table + 24 + 5 * 8, table)
    with pytest.raises(ReadError, match="an enumeration"):
        opened(tmp_path, bytes(content))


def old_range_table(file: OldFile, default: str, *rows: tuple[float, float, str]) -> int:
    """A conversion of type 12: the text of other numbers, and of each range from and to and its text."""
    layout, fields = "H2d20s2H2dI", [0, 0.0, 0.0, b"V", 12, 1 + len(rows), 0.0, 0.0, file.text(default)]
    for low, high, text in rows:
        layout, fields = layout + "2dI", [*fields, low, high, file.text(text)]
    return file.add("CC", layout, *fields)


@pytest.mark.parametrize("order", ["<", ">"])
def test_words_by_range_of_mdf_3_with_a_scale_for_all_other_numbers_are_those_of_asammdf(
    order: str, tmp_path: Path
) -> None:
    file = OldFile(order=order)
    at = old_range_table(file, '"0.5*{X}+3"', (250, 253, "reserved"), (254, 255, "not available"))
    recording = opened_old(tmp_path, one_channel(bytes([1, 250, 9, 255]), 1, UNSIGNED, 8, file=file, conversion_at=at))
    np.testing.assert_array_equal(recording.read("a"), [3.5, np.nan, 7.5, np.nan])
    assert "250 to 253 'reserved' x1, 254 to 255 'not available' x1" in recording.notes[0]
    if order == "<":
        np.testing.assert_array_equal(recording.read("a"), as_asammdf_reads(tmp_path / "a.mdf"))


@pytest.mark.parametrize("default", ["", "other", "{X}*{X}"])
def test_words_by_range_of_mdf_3_without_a_scale_are_an_enumeration(default: str, tmp_path: Path) -> None:
    file = OldFile()
    at = old_range_table(file, default, (250, 253, "reserved"))
    with pytest.raises(ReadError, match=r"an enumeration \(range to text\)"):
        opened_old(tmp_path, one_channel(bytes([1, 250]), 1, UNSIGNED, 8, file=file, conversion_at=at))


def test_a_cut_table_of_ranges_of_mdf_3_is_damage(tmp_path: Path) -> None:
    file = OldFile()
    at = old_range_table(file, '"0.5*{X}+3"', (250, 253, "reserved"))
    struct.pack_into("<H", file.content, at + 44, 3)
    with pytest.raises(ReadError, match="damaged"):
        opened_old(tmp_path, one_channel(bytes([1, 250]), 1, UNSIGNED, 8, file=file, conversion_at=at))
