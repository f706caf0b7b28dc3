"""Which physical value a stored number stands for, by a conversion block from bytes."""

from __future__ import annotations

import numpy as np
import pytest

from recoil_acquisition.readers.mdf.channel_groups import MdfChannel
from recoil_acquisition.readers.mdf.number_conversion import INTERPOLATED, NEAREST, NumberConversion, number_conversion
from tests.builders.mdf_logs import Blocks


def table(kind: int, *pairs: tuple[float, float]) -> NumberConversion | str:
    blocks = Blocks(bytes(64))
    at = blocks.table(pairs, kind)
    return number_conversion(bytes(blocks.content), MdfChannel(0, "n", 0, 0, 0, 0, 0, 8, 0, 0, at, 0))


@pytest.mark.parametrize("kind", [INTERPOLATED, NEAREST])
def test_a_table_of_one_key_gives_its_value_everywhere(kind: int) -> None:
    conversion = table(kind, (5.0, 1.5))
    assert isinstance(conversion, NumberConversion)
    assert conversion.applied(np.array([0, 5, 9])).tolist() == [1.5, 1.5, 1.5]


@pytest.mark.parametrize("kind", [INTERPOLATED, NEAREST])
def test_a_table_without_keys_is_damaged(kind: int) -> None:
    assert table(kind) == f"damaged: a conversion of type {kind} with the numbers "
