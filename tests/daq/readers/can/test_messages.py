"""CAN databases in every format, and decoding checked against cantools."""

from __future__ import annotations

import random
from pathlib import Path

import cantools
import numpy as np
import pytest
from cantools.database.can import Message, Signal
from cantools.database.conversion import BaseConversion
from hypothesis import given, settings
from hypothesis import strategies as st

from recoil_acquisition.errors import MissingChannelError, ReadError
from recoil_acquisition.readers.can.counters import declared_counters
from recoil_acquisition.readers.can.decoding import bit_runs_of, present
from recoil_acquisition.readers.can.frames import EXTENDED, CanFrames
from recoil_acquisition.readers.can.log import CANDUMP
from recoil_acquisition.readers.can.messages import database_format, load_database, messages_of
from recoil_acquisition.readers.reader import Declarations
from recoil_rigs.rig import _database_text
from tests.builders.shared_data import shared_file
from tests.builders.vendor_files import DBC, can_entries, candump_log

KCD = """<?xml version="1.0" encoding="UTF-8"?>
<NetworkDefinition xmlns="http://kayak.2codeornot2code.org/1.0">
  <Document/>
  <Bus name="bus">
    <Message id="0x100" name="ACC" length="8">
      <Signal name="ax" offset="0" length="16"><Value type="signed" slope="0.01" unit="m/s^2"/></Signal>
    </Message>
  </Bus>
</NetworkDefinition>
"""
SYM = """FormatVersion=6.0 // Do not edit this line!
Title="rig"

{SENDRECEIVE}

[ACC]
ID=100h
Len=8
Var=ax signed 0,16 /u:m/s^2 /f:0.01
"""
ARXML = """<?xml version="1.0" encoding="UTF-8"?>
<AUTOSAR xmlns="http://autosar.org/schema/r4.0"
  xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance"
  xsi:schemaLocation="http://autosar.org/schema/r4.0 AUTOSAR_4-2-2.xsd">
  <AR-PACKAGES/>
</AUTOSAR>
"""


@pytest.mark.parametrize(("text", "kind"), [(DBC, "dbc"), (KCD, "kcd"), (SYM, "sym"), (ARXML, "arxml")])
def test_the_format_of_a_database_is_found_from_its_content(text: str, kind: str) -> None:
    assert database_format(text) == database_format("\ufeff" + text) == database_format("\r\n" + text) == kind
    messages = load_database(text, Path("a.log")).messages
    if kind == "arxml":
        assert not messages
    else:
        signal = messages[0].signals[0]
        assert (messages[0].name, signal.name, float(signal.scale), signal.unit) == ("ACC", "ax", 0.01, "m/s^2")


TWO_IN_KCD = KCD.replace(
    "  </Bus>",
    """<Message id="0x200" name="ACC" length="8"><Signal name="ax" offset="0" length="16"><Value slope="0.5"/></Signal>
    </Message></Bus><Bus name="other"><Message id="0x100" name="ACC" length="8" format="extended">
    <Signal name="ax" offset="0" length="16"/><Signal name="ax" offset="16" length="16"/></Message></Bus>""",
)
TWO_IN_SYM = (
    SYM
    + """
[ACC]
ID=200h
Len=8
Var=ax unsigned 0,16 /f:0.5

[ACC]
ID=100h
Type=Extended
Len=8
Var=ax unsigned 0,16
Var=ax unsigned 16,16
"""
)
TWO_IN_DBC = """VERSION ""
BO_ 256 ACC: 8 X
 SG_ ax : 0|16@1- (0.01,0) [0|0] "m/s^2" X
BO_ 512 ACC: 8 X
 SG_ ax : 0|16@1+ (0.5,0) [0|0] "" X
BO_ 2147483904 ACC: 8 X
 SG_ ax : 0|16@1+ (1,0) [0|0] "" X
 SG_ ax : 16|16@1+ (1,0) [0|0] "" X
"""


@pytest.mark.parametrize("text", [TWO_IN_DBC, TWO_IN_KCD, TWO_IN_SYM], ids=["dbc", "kcd", "sym"])
def test_messages_and_signals_of_one_name_are_told_apart(text: str, tmp_path: Path) -> None:
    path = tmp_path / "a.log"
    path.write_text("(1.000000) x 100#0100\n(1.100000) x 200#0200\n(1.200000) x 00000100#03000400\n")
    recording = CANDUMP.open(path, Declarations("can", database=text))
    names = [header.name for header in recording.signals]
    assert names == ["ACC#0x100.ax", "ACC#0x200.ax", "ACC#0x00000100.ax", "ACC#0x00000100.ax#2"]
    assert [recording.read(name).tolist() for name in names] == [[0.01], [1.0], [3.0], [4.0]]
    assert any("messages of one name in the database" in note for note in recording.notes)
    assert any("signals of one name in one message, told apart by numbers: ACC.ax#2" in note
               for note in recording.notes)  # fmt: skip
    with pytest.raises(ReadError, match=r"'ACC.ax' is of several messages; found 'ACC#0x100.ax', 'ACC#0x200.ax'"):
        recording.read("ACC.ax")
    path.write_text("(1.100000) x 200#0200\n")
    alone = CANDUMP.open(path, Declarations("can", database=text))
    assert [header.name for header in alone.signals] == ["ACC.ax"]  # no other of them came
    assert alone.read("ACC.ax").tolist() == alone.read("ACC#0x200.ax").tolist() == [1.0]


def test_a_counter_is_that_of_its_own_message_of_one_name() -> None:
    database = load_database(TWO_IN_DBC, Path("a.log"))
    named = declared_counters(["ACC#0x200.ax"], database, Path("a.log"))
    assert [(one.name, one.key) for one in named] == [("ACC#0x200.ax", 0x200)]
    both = declared_counters(["ACC.ax"], database, Path("a.log"))
    assert [one.key for one in both] == [0x100, 0x200, 0x100 | EXTENDED]


FAULTY = (
    DBC.replace("48|16@1+ (0.1,-5)", "8|16@1+ (0.1,-5)"),
    DBC.replace("48|16@1+ (0.1,-5)", "56|16@1+ (0.1,-5)"),
    KCD.replace("  </Bus>", '<Message id="0x101" name="GYR" length="8"><Signal name="gx" offset="0"/></Message></Bus>')
    .replace('offset="0" length="16"', 'offset="60" length="16"'),
)  # fmt: skip


@pytest.mark.parametrize("text", FAULTY)
def test_a_faulty_message_leaves_the_others_readable_and_is_refused_where_it_is_used(text: str, tmp_path: Path) -> None:
    database = load_database(text, Path("a.log"))
    assert [one.name for one in database.faulty] == ["ACC"]
    assert next(message.name for message in database.messages) == "GYR"
    path = tmp_path / "a.log"
    path.write_bytes(candump_log([*can_entries(9), (10**9, 0x101, bytes(8))]))
    recording = CANDUMP.open(path, Declarations("bus", database=text))
    assert "ACC.ax" not in [header.name for header in recording.signals]
    assert recording.read("GYR.gx").size
    told = [note for note in recording.notes if "messages of the database, 1, were left out: ACC (" in note]
    assert len(told) == 1
    assert "0x100" not in " ".join(recording.notes)
    for use in (lambda: recording.read("ACC.ax"), lambda: declared_counters(["ACC.ax"], database, path)):
        with pytest.raises(ReadError, match=r"message 'ACC' of the CAN database is faulty.*'ACC.ax' is used"):
            use()
    with pytest.raises(MissingChannelError):
        recording.read("GYR.gy")


def test_a_database_of_faulty_messages_alone_is_refused() -> None:
    text = KCD.replace('offset="0" length="16"', 'offset="60" length="16"')
    with pytest.raises(ReadError, match="cannot be read: The signal ax does not fit in message ACC"):
        load_database(text, Path("a.log"))


@pytest.mark.parametrize("text", ["", "A letter.", "<html></html>", "<!-- NetworkDefinition -->", "timestamp,id"])
def test_what_is_no_database_is_refused(text: str) -> None:
    assert database_format(text) == ""
    with pytest.raises(ReadError, match="no CAN database"):
        load_database(text, Path("a.log"))


@pytest.mark.parametrize("text", [KCD, ARXML])
@pytest.mark.parametrize("head", ['<!DOCTYPE a [<!ENTITY b "b">]>', '<!ENTITY b "b">', "<! doctype x>"])
def test_entities_are_refused_before_anything_expands_them(text: str, head: str) -> None:
    declaration, rest = text.split("\n", 1)
    with pytest.raises(ReadError, match="defines entities"):
        load_database(f"{declaration}\n{head}\n{rest}", Path("a.log"))


@pytest.mark.parametrize(
    "text",
    [
        DBC.replace(": 8 ", ": 650000 "),
        DBC.replace("0|16@", "0 |\n 6500000 @"),
        DBC.replace("0|16@", "6500000|16@"),
        DBC + "".join(f"BO_ {i + 5} M{i}: 8000 Vector__XXX\n" for i in range(50)),
        KCD.replace('length="8"', "length = ' +6_5000'"),
        KCD.replace('length="16"', 'length="6500000"'),
        KCD.replace('offset="0"', 'offset="6500000"'),
        SYM.replace("Len=8", "DLC=650000"),
        SYM.replace("0,16", "0,6500000"),
        SYM.replace("0,16", "6500000,16"),
        ARXML.replace("<AR-PACKAGES/>", "<AR-PACKAGES><FRAME-LENGTH>650000</FRAME-LENGTH></AR-PACKAGES>"),
    ],
)
def test_a_length_that_no_bus_has_is_refused_before_its_bits_are_listed(text: str) -> None:
    assert text not in (DBC, KCD, SYM, ARXML)
    with pytest.raises(ReadError, match="messages and signals as long as"):
        load_database(text, Path("a.log"))


@pytest.mark.exhaustive
def test_a_database_that_would_be_parsed_for_minutes_is_refused_at_once() -> None:
    text = DBC + "".join(f'VAL_ 291 s {k} "";\n' for k in range(270_000))
    with pytest.raises(ReadError, match=r"1[67].{5} names, numbers and signs, where 1600000 are the most"):
        load_database(text, Path("a.log"))


@pytest.mark.parametrize("text", [KCD[:-30], SYM.replace("Len=8", "Len=?"), ARXML[:-20]])
def test_a_damaged_database_is_refused_with_its_format(text: str) -> None:
    with pytest.raises(ReadError, match=f"cannot be read.*{database_format(text).upper()} file"):
        load_database(text, Path("a.log"))


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "iso-8859-1", "cp1252"])
def test_a_database_is_decoded_as_it_declares(encoding: str) -> None:
    declared = KCD.replace("UTF-8", encoding.removesuffix("-sig")).replace("m/s^2", "m/s²")
    text = _database_text(declared.encode(encoding))
    assert text.removeprefix("\ufeff") == declared
    assert load_database(text, Path("a")).messages[0].signals[0].unit == "m/s²"


def test_a_real_database_says_the_same_in_two_formats() -> None:
    dbc = load_database(_database_text(shared_file("can/vehicle.dbc").read_bytes()), Path("a"))
    kcd = load_database(_database_text(shared_file("can/vehicle.kcd").read_bytes()), Path("a"))
    theirs = {m.name: m for m in kcd.messages}
    compared = 0
    for message in dbc.messages:
        other = theirs[message.name]
        for signal in message.signals:
            same = other.get_signal_by_name(signal.name)
            assert (same.start, same.length, same.byte_order) == (signal.start, signal.length, signal.byte_order)
            compared += 1
    assert compared == 462


def random_message(rng: random.Random, frame_id: int) -> Message:
    """Signals of random place that do not overlap, some of them multiplexed."""
    size = rng.choice([1, 3, 8, 8, 8, 24, 64])
    free = {(byte, bit) for byte in range(size) for bit in range(8)}
    signals: list[Signal] = []
    selects = rng.random() < 0.5 and size > 1
    if selects:
        signals.append(Signal("mux", 0, 3, "little_endian", is_multiplexer=True))
        free -= {(0, bit) for bit in range(3)}
    for number in range(rng.randint(1, 8)):
        kind = rng.choice(["unsigned", "signed", "float"])
        length = rng.choice([16, 32, 64]) if kind == "float" else rng.randint(1, 64)
        order = rng.choice(["little_endian", "big_endian"])
        start = rng.randrange(8 * size)
        bits = {
            (piece.byte, piece.shift + k)
            for piece in bit_runs_of(start, length, little_endian=order == "little_endian")
            for k in range(piece.count)
        }
        if not bits <= free:
            continue
        free -= bits
        conversion = BaseConversion.factory(
            scale=rng.choice([1, 0.01, -2.5]), offset=rng.choice([0, -40, 0.5]), is_float=kind == "float"
        )
        multiplexed = selects and rng.random() < 0.5
        signals.append(
            Signal(
                f"s{number}", start, length, order, is_signed=kind == "signed", conversion=conversion,
                multiplexer_ids=rng.sample(range(8), 2) if multiplexed else None,
                multiplexer_signal="mux" if multiplexed else None,
            )
        )  # fmt: skip
    return Message(frame_id, f"m{frame_id}", size, signals, is_fd=size > 8, is_extended_frame=rng.random() < 0.5)


@pytest.mark.exhaustive
@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_random_databases_decode_as_cantools_does_whole_and_cut_frames_alike(seed: int) -> None:
    rng = random.Random(seed)  # noqa: S311  test data, no secret
    database = cantools.database.Database([random_message(rng, 0x100 + k) for k in range(3)], strict=True)
    for message in database.messages:
        frames = [rng.randbytes(rng.choice([message.length, rng.randint(0, message.length)])) for _ in range(12)]
        width = max(8, message.length)
        key = message.frame_id | (EXTENDED if message.is_extended_frame else 0)
        log = CanFrames(
            np.arange(12.0),
            np.full(12, key, dtype=np.uint32),
            np.zeros(12, dtype=np.int64),
            np.array([len(frame) for frame in frames]),
            np.frombuffer(b"".join(f.ljust(width, b"\0") for f in frames), dtype=np.uint8).reshape(12, width),
        )
        ours = messages_of(message, log, np.arange(12), [])
        for i, frame in enumerate(frames):
            try:
                expected = message.decode(frame, decode_choices=False, allow_truncated=True)
            except cantools.database.DecodeError:  # the multiplexer is cut off, or has a value of no signal
                continue
            for name, layout in ours.layouts.items():
                row = ours.data[i : i + 1]
                held = present(layout, ours.layouts, row, ours.length[i : i + 1])[0]
                decoded = held and len(frame) >= layout.bytes_needed
                assert decoded == (name in expected)
                if decoded:
                    with np.errstate(all="ignore"):
                        found = layout.decode(row)[0]
                    np.testing.assert_allclose(found, float(expected[name]), rtol=1e-15, equal_nan=True)
