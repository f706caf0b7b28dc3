"""The conversions of MDF 3 channels beside those that asammdf makes of the same bytes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from recoil_acquisition.readers.mdf3.reader import OldMdfReader
from recoil_acquisition.readers.reader import Declarations
from tests.builders.mdf3_files import (
    INTERPOLATED,
    LINEAR,
    NEAREST,
    NO_CONVERSION,
    POLYNOMIAL,
    RATIONAL,
    UNSIGNED,
    one_channel,
)

CONVERSIONS = [
    (NO_CONVERSION,), (LINEAR, 3.0, -0.25), (INTERPOLATED, 2.0, 5.0, 90.0, -1.0, 200.0, 7.0),
    (NEAREST, 2.0, 5.0, 90.0, -1.0, 200.0, 7.0), (POLYNOMIAL, 3.0, 0.0, 0.0, 2.0, 0.0, 0.0),
    (POLYNOMIAL, 3.0, 7.0, 0.25, 2.0, 1.0, 0.5), (RATIONAL, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0),
    (RATIONAL, 0.0, 4.0, 8.0, 0.0, 0.0, 2.0),
]  # fmt: skip
STORED = bytes([0, 1, 2, 3, 45, 46, 47, 145, 146, 199, 200, 255])


@pytest.mark.parametrize("conversion", CONVERSIONS, ids=str)
def test_conversions_are_those_of_asammdf(conversion: tuple[float, ...], tmp_path: Path) -> None:
    asammdf = pytest.importorskip("asammdf")
    path = tmp_path / "a.mdf"
    path.write_bytes(one_channel(STORED, 1, UNSIGNED, 8, conversion=conversion))
    recording = OldMdfReader().open(path, Declarations("c"))
    with asammdf.MDF(path) as mdf:
        expected = mdf.get("a")
    np.testing.assert_allclose(recording.read("a"), expected.samples, rtol=1e-14, atol=1e-14)
    np.testing.assert_array_equal(recording.time_base("a").times_s, expected.timestamps)
    assert recording.signals[0].unit == expected.unit == "V"


def test_a_table_of_more_pairs_than_the_length_of_a_block_can_say_is_read(tmp_path: Path) -> None:
    keys = np.arange(6000.0)
    pairs = np.column_stack([keys, keys % 7]).ravel().tolist()
    path = tmp_path / "a.mdf"
    stored = np.array([0, 5, 3000, 5999], "<u2").tobytes()
    path.write_bytes(one_channel(stored, 2, UNSIGNED, 16, conversion=(NEAREST, *pairs)))
    recording = OldMdfReader().open(path, Declarations("c"))
    np.testing.assert_array_equal(recording.read("a"), [0, 5, 3000 % 7, 5999 % 7])
