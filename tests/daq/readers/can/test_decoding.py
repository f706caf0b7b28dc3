from __future__ import annotations

import random
from dataclasses import replace
from typing import Literal

import cantools
import numpy as np
import pytest
from cantools.database.can import Message, Signal
from cantools.database.conversion import BaseConversion
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_acquisition.readers.can.decoding import bit_runs_of, layout_of, present
from tests.builders.shared_data import shared_file


def random_signal(rng: random.Random, size: int) -> Signal:
    """A signal of random place, length, byte order and meaning that lies inside a frame."""
    while True:
        kind = rng.choice(["unsigned", "signed", "float"])
        length = rng.choice([16, 32, 64]) if kind == "float" else rng.randint(1, 64)
        order = rng.choice(["little_endian", "big_endian"])
        start = rng.randrange(8 * size)
        places = [
            p for piece in bit_runs_of(start, length, little_endian=order == "little_endian") for p in [piece.byte]
        ]
        if all(0 <= place < size for place in places):
            scale, offset = rng.choice([(1, 0), (0.01, -5), (2.5, 100), (-0.125, 0.5)])
            conversion = BaseConversion.factory(scale=scale, offset=offset, is_float=kind == "float")
            return Signal("s", start, length, order, is_signed=kind == "signed", conversion=conversion)


@pytest.mark.exhaustive
@settings(max_examples=150, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), size=st.sampled_from([8, 64]))
def test_any_layout_decodes_as_cantools_does(seed: int, size: int) -> None:
    rng = random.Random(seed)  # noqa: S311  test data, no secret
    signal = random_signal(rng, size)
    message = Message(1, "m", size, [signal], is_fd=size > 8, strict=True)
    frames = [rng.randbytes(size) for _ in range(20)]
    layout = layout_of(message.signals[0])
    assert layout is not None
    data = np.frombuffer(b"".join(frames), dtype=np.uint8).reshape(-1, size)
    with np.errstate(all="ignore"):
        found = layout.decode(data)
    expected = np.array([message.decode(frame, decode_choices=False)["s"] for frame in frames], dtype=np.float64)
    np.testing.assert_allclose(found, expected, rtol=1e-15, equal_nan=True)


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    "name", ["vehicle.dbc", "signed.dbc", "floating_point.dbc", "multiplex.dbc", "variable_dlc.dbc", "rig_shot/rig.dbc"]
)
def test_every_message_of_real_databases_decodes_as_cantools_does(name: str) -> None:
    database = cantools.database.load_string(shared_file(f"can/{name}").read_text("cp1252"), "dbc", strict=False)
    rng = random.Random(7)  # noqa: S311  test data, no secret
    compared = 0
    for message in database.messages:
        frames = [rng.randbytes(message.length) for _ in range(150 if name == "multiplex.dbc" else 12)]
        layouts = {s.name: layout for s in message.signals if (layout := layout_of(s)) is not None}
        assert len(layouts) == len(message.signals)
        data = np.frombuffer(b"".join(frames), dtype=np.uint8).reshape(len(frames), -1)
        length = np.full(len(frames), message.length)
        for i, frame in enumerate(frames):
            try:
                expected = message.decode(frame, decode_choices=False)
            except cantools.database.DecodeError:
                continue
            for signal_name, layout in layouts.items():
                held = bool(present(layout, layouts, data[i : i + 1], length[i : i + 1])[0])
                assert held == (signal_name in expected)
                if held:
                    with np.errstate(all="ignore"):
                        found = layout.decode(data[i : i + 1])[0]
                    value, of = float(expected[signal_name]), message.get_signal_by_name(signal_name)
                    if np.isnan(found) and not np.isnan(value):  # a code: named, or beyond the range
                        beyond = of.minimum is not None and not of.minimum <= value <= of.maximum
                        assert beyond or of.choices
                        continue
                    np.testing.assert_allclose(found, value, rtol=1e-15, equal_nan=True)
                    compared += 1
    assert compared >= 12


def test_signals_that_are_no_number_have_no_layout() -> None:
    assert layout_of(Signal("wide", 0, 65)) is None
    odd = Signal("odd", 0, 24, conversion=BaseConversion.factory(is_float=True))
    assert layout_of(odd) is None


def test_a_motorola_signal_runs_from_its_most_significant_bit() -> None:
    pieces = bit_runs_of(3, 12, little_endian=False)
    assert [(p.byte, p.shift, p.count, p.place) for p in pieces] == [(1, 0, 8, 0), (0, 0, 4, 8)]


@pytest.mark.parametrize("order", ["little_endian", "big_endian"])
def test_an_unsigned_number_of_64_bits_may_have_its_highest_bit_set(
    order: Literal["little_endian", "big_endian"],
) -> None:
    layout = layout_of(Signal("s", 0 if order == "little_endian" else 7, 64, order))
    assert layout is not None
    numbers = [0, 2**63 - 1, 2**63, 2**64 - 1]
    data = b"".join(n.to_bytes(8, "little" if order == "little_endian" else "big") for n in numbers)
    rows = np.frombuffer(data, dtype=np.uint8).reshape(-1, 8)
    assert layout.raw(rows).tolist() == numbers
    assert layout.decode(rows).tolist() == [float(n) for n in numbers]


def test_a_signal_whose_multiplexer_is_not_in_the_frame_is_not_in_it_either() -> None:
    """Whether the data end before the multiplexer, or only a frame does."""
    low, selector = Signal("low", 0, 8), Signal("kind", 64, 8, is_multiplexer=True)
    layouts = {s.name: layout for s in (low, selector) if (layout := layout_of(s)) is not None}
    layouts["low"] = replace(layouts["low"], multiplexer="kind", multiplexer_ranges=(range(1),))
    narrow = np.zeros((2, 8), np.uint8)
    assert present(layouts["low"], layouts, narrow, np.array([8, 8])).tolist() == [False, False]
    wide = np.zeros((3, 12), np.uint8)
    assert present(layouts["low"], layouts, wide, np.array([8, 9, 12])).tolist() == [False, True, True]
    exact = np.zeros((2, 9), np.uint8)
    assert present(layouts["low"], layouts, exact, np.array([8, 9])).tolist() == [False, True]
    assert present(layouts["kind"], layouts, wide, np.array([8, 9, 12])).all()
    assert present(replace(layouts["low"], multiplexer="none"), layouts, narrow, np.array([8, 8])).all()


def signal_with(
    *,
    length: int,
    signed: bool = False,
    limits: tuple[float, float] | None = None,
    choices: dict[int, str] | None = None,
) -> Signal:
    low, high = limits or (None, None)
    conversion = BaseConversion.factory(0.5, -3.0, choices=choices)  # type: ignore[arg-type]
    return Signal("s", 0, length, is_signed=signed, conversion=conversion, minimum=low, maximum=high)


def decoded(signal: Signal, raws: list[int]) -> list[float]:
    layout = layout_of(signal)
    assert layout is not None
    data = np.array([(raw & ((1 << signal.length) - 1)) for raw in raws], dtype="<u8").view(np.uint8).reshape(-1, 8)
    return layout.decode(data).tolist()


@pytest.mark.parametrize(
    ("signal", "measured", "codes"),
    [
        # named beyond the range, and within it: a gear is measured
        (signal_with(length=11, limits=(-3, 1000), choices={2: "N", 2046: "a", 2047: "b"}), [0, 2, 2006], [2046, 2047]),
        # SAE J1939-71, section 5.1.4: what is beyond FA in the highest byte
        (signal_with(length=16, limits=(-3, 32124.5)), [0, 0xFAFF], [0xFB00, 0xFE12, 0xFFFF]),
        (signal_with(length=8, limits=(-3, 122)), [0, 250], [251, 254, 255]),
        (signal_with(length=2, limits=(-3, -2.5)), [0, 1, 2], [3]),
        # NMEA 2000: the three largest of a signed number
        (signal_with(length=16, signed=True, limits=(-100, 100)), [-194, 206, 0x7FFC], [0x7FFD, 0x7FFE, 0x7FFF]),
        # without a range the names of the last numbers of all, where they are few
        (signal_with(length=12, choices={4094: "error", 4095: "not there"}), [0, 4093], [4094, 4095]),
        (signal_with(length=2, choices={0: "off", 1: "on", 2: "error", 3: "not there"}), [0, 1, 2, 3], []),
        (signal_with(length=12, choices={0: "zero", 4095: "full"}), [0, 4095], []),
        (signal_with(length=16), [0, 0xFFFF], []),
        # the smallest below 0, which some tools write as it stands in the frame
        (signal_with(length=16, signed=True, choices={-32768: "error"}), [-32767, 32767], [-32768]),
        (signal_with(length=16, signed=True, choices={32768: "error", 32767: "none"}), [-32767, 0], [-32768, 32767]),
        # a range that goes to the end has nothing beyond it
        (signal_with(length=16, limits=(-3, 32764.5)), [0, 0xFFFF], []),
    ],
)
def test_a_code_is_no_measurement_and_what_a_range_does_not_hold_is_one(
    signal: Signal, measured: list[int], codes: list[int]
) -> None:
    assert decoded(signal, measured) == [0.5 * raw - 3.0 for raw in measured]
    assert np.isnan(decoded(signal, codes)).all()


def test_codes_and_what_is_outside_of_a_range_are_counted() -> None:
    layout = layout_of(signal_with(length=16, limits=(-3, 997), choices={0xFFFF: "SNA"}))
    assert layout is not None
    data = np.array([0, 2000, 2001, 3000, 0xFE00, 0xFFFF, 0xFFFF], dtype="<u8").view(np.uint8).reshape(-1, 8)
    assert layout.remarkable(data) == ({"65535 'SNA'": 2, "0xFB00 and above": 1}, 2)


@pytest.mark.parametrize(
    ("sign", "stated", "raw"), [("+", "0x3E8", 1000), ("+", "65535", 65535), ("-", "0x8000", -32768), ("-", "-5", -5)]
)
def test_an_attribute_names_a_code_wherever_the_range_has_it(sign: str, stated: str, raw: int) -> None:
    text = f"""VERSION ""
BS_:
BU_: ECU
BO_ 256 m: 8 ECU
 SG_ s : 0|16@1{sign} (0.5,-3) [-20000|32764] "" ECU
BA_DEF_ SG_ "GenSigSNA" STRING ;
BA_DEF_DEF_ "GenSigSNA" "";
BA_ "GenSigSNA" SG_ 256 s "{stated}";
"""
    database = cantools.database.load_string(text, "dbc")
    layout = layout_of(database.messages[0].signals[0])
    assert layout is not None
    data = np.array([10, raw & 0xFFFF, raw & 0xFFFF], dtype="<u8").view(np.uint8).reshape(-1, 8)
    assert np.isnan(layout.decode(data)).tolist() == [False, True, True]
    assert layout.remarkable(data) == ({f"{raw} 'GenSigSNA'": 2}, 0)


@pytest.mark.parametrize("stated", ["", "none", "0x1FFFFFFFFFFFFFFFFF", "70000"])
def test_an_attribute_that_is_no_number_of_the_signal_names_nothing(stated: str) -> None:
    text = f"""VERSION ""
BS_:
BU_: ECU
BO_ 256 m: 8 ECU
 SG_ s : 0|16@1+ (0.5,-3) [0|32764] "" ECU
BA_DEF_ SG_ "GenSigSNA" STRING ;
BA_DEF_DEF_ "GenSigSNA" "";
BA_ "GenSigSNA" SG_ 256 s "{stated}";
"""
    layout = layout_of(cantools.database.load_string(text, "dbc").messages[0].signals[0])
    assert layout is not None
    assert not any("GenSigSNA" in called for _, _, called in layout.codes)
