"""Bus logging in MDF 4, of every way to store it; asammdf reads the same."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from recoil_acquisition.errors import CorruptFileError, ReadError
from recoil_acquisition.readers.can.frames import CanFrames
from recoil_acquisition.readers.can.mdf import read_mdf
from recoil_acquisition.readers.mdf.file_header import is_bus_logging
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.table import recognise
from tests.builders import mdf_logs
from tests.builders.shared_data import shared_file
from tests.builders.vendor_files import EXT, CanEntry, can_entries

ENTRIES = can_entries(30)
VARIED = [(1000 * i, (0x100 + i) | (EXT if i % 3 == 0 else 0), bytes(range(i % 9))) for i in range(40)]
KEYS = st.integers(0, 0x7FF) | st.integers(EXT, EXT + 2**29 - 1)
COUNTS, LAST_LENGTH, OFFSETS = mdf_logs.COUNTS, mdf_logs.LAST_LENGTH, mdf_logs.OFFSETS


def as_entries(frames: CanFrames) -> list[CanEntry]:
    rows = zip(frames.time_s, frames.key, frames.data, frames.length, strict=True)
    return [(round(t * 1e9), int(key), bytes(data[:n])) for t, key, data, n in rows]


def written(folder: Path, content: bytes) -> Path:
    path = folder / "a.mf4"
    path.write_bytes(content)
    return path


@pytest.mark.parametrize("unwritten", [0, COUNTS, COUNTS | LAST_LENGTH, COUNTS | LAST_LENGTH | OFFSETS])
def test_what_a_logger_stored_together_is_told_apart(unwritten: int, tmp_path: Path) -> None:
    log = read_mdf(written(tmp_path, mdf_logs.logger_file(VARIED, unwritten=unwritten)))
    assert as_entries(log.frames) == VARIED
    assert log.metadata["error_frames"] == 2
    assert any("did not close" in note for note in log.notes) == bool(unwritten)
    assert log.absolute_start is not None
    assert log.absolute_start.text == "2023-11-14T22:13:20.250000"


OF_FD = [
    (1000 * i, (0x100 + i) | (EXT if i % 3 == 0 else 0), bytes(range(n)))
    for i, n in enumerate([*mdf_logs.LENGTH_CODES, 8, 64])
]


def test_what_all_frames_share_is_the_constant_of_a_virtual_channel(tmp_path: Path) -> None:
    path = written(tmp_path, mdf_logs.virtual_log(OF_FD))
    log = read_mdf(path)
    assert as_entries(log.frames) == OF_FD
    assert set(log.frames.channel.tolist()) == {9}
    assert log.notes == ()
    assert as_asammdf_reads_them(path) == as_read_here(path)


def test_times_may_be_the_numbers_of_the_records(tmp_path: Path) -> None:
    plain = [entry for entry in OF_FD if not entry[1] & EXT]
    path = written(tmp_path, mdf_logs.virtual_log(plain, computed_times=True))
    assert [entry[0] for entry in as_entries(read_mdf(path).frames)] == [1_000_000 * i for i in range(len(plain))]
    assert as_asammdf_reads_them(path) == as_read_here(path)


@pytest.mark.parametrize(
    ("before", "after", "problem"),
    [
        (struct.pack("<dd", 9.0, 0.0), struct.pack("<dd", 9.5, 0.0), "not whole"),
        (struct.pack("<dd", 9.0, 0.0), struct.pack("<dd", float("nan"), 0.0), "has the numbers"),
        (struct.pack("<dd", 3.0, 3.0), struct.pack("<dd", 99.0, 3.0), "has the number 3, which its conversion has not"),
        (
            struct.pack("<BBHHH", 5, 0, 0, 0, 32),
            struct.pack("<BBHHH", 3, 0, 0, 0, 32),
            "has a conversion that is not linear",
        ),
    ],
)
def test_a_conversion_that_gives_no_whole_numbers_is_refused(
    before: bytes, after: bytes, problem: str, tmp_path: Path
) -> None:
    content = mdf_logs.virtual_log(OF_FD)
    assert before in content
    with pytest.raises(ReadError, match=problem):
        read_mdf(written(tmp_path, content.replace(before, after)))


@pytest.mark.parametrize("transposed", [False, True])
def test_lists_of_packed_and_plain_blocks_are_put_together(transposed: bool, tmp_path: Path) -> None:
    log = read_mdf(written(tmp_path, mdf_logs.listed_log(VARIED, transposed=transposed)))
    assert as_entries(log.frames) == VARIED
    assert log.notes == ()


def test_a_logger_stopped_within_a_frame_keeps_those_before_it(tmp_path: Path) -> None:
    content = mdf_logs.logger_file(VARIED[:10], unwritten=COUNTS | LAST_LENGTH)
    errors, last = 2 * 9, 1 + 4 + len(VARIED[9][2])
    log = read_mdf(written(tmp_path, content[: -errors - last - 3]))
    assert as_entries(log.frames) == VARIED[:9]


@pytest.mark.exhaustive
@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    entries=st.lists(
        st.tuples(st.integers(0, 10**12), KEYS, st.binary(max_size=64)),
        min_size=1, max_size=20,
    )
)  # fmt: skip
def test_asammdf_reads_the_same_frames(entries: list[CanEntry], tmp_path: Path) -> None:
    path = written(tmp_path, mdf_logs.listed_log(sorted(entries, key=lambda one: one[0])))
    assert as_asammdf_reads_them(path) == as_read_here(path)


def test_asammdf_reads_the_same_frames_of_a_logger(tmp_path: Path) -> None:
    path = written(tmp_path, mdf_logs.logger_file(VARIED))
    assert as_asammdf_reads_them(path) == as_read_here(path)


@pytest.mark.parametrize("name", ["00000170.MF4", "rig_shot/rig_shot.mf4", "63BEFDF9.MF4"])
def test_asammdf_reads_the_same_frames_of_real_logs(name: str) -> None:
    path = shared_file(f"can/{name}")
    assert as_asammdf_reads_them(path) == as_read_here(path)


def test_a_log_of_virtual_channels_is_read_whole_and_decoded() -> None:
    """All of its records, 17 bytes each, are frames; the signals are those that cantools decodes."""
    path, database = shared_file("can/63BEFDF9.MF4"), shared_file("can/gnss.dbc").read_text()
    log = read_mdf(path)
    assert log.metadata["data_frames"] == (path.stat().st_size - 106_776 - 24) / 17
    assert set(log.frames.channel.tolist()) == {1, 2}
    recording = recognise(path).open(path, Declarations(clock="bus", database=database))
    import cantools

    message = cantools.database.load_string(database, "dbc").get_message_by_frame_id(0x19)
    expected = [
        message.decode(bytes(data[:n]), decode_choices=False)
        for key, data, n in zip(log.frames.key, log.frames.data, log.frames.length, strict=True)
        if key == 0x19
    ]
    for signal in message.signals:
        found = recording.read(f"{message.name}.{signal.name}")
        np.testing.assert_allclose(found, [one[signal.name] for one in expected], rtol=1e-12)


def as_read_here(path: Path) -> list[tuple[int, int, int, bytes]]:
    frames = read_mdf(path).frames
    return [
        (round(t * 1e6), int(key) & 0x1FFFFFFF, int(channel), bytes(data[:n]))
        for t, key, channel, data, n in zip(
            frames.time_s, frames.key, frames.channel, frames.data, frames.length, strict=True
        )
    ]


def as_asammdf_reads_them(path: Path) -> list[tuple[int, int, int, bytes]]:
    from io import BytesIO

    from asammdf import MDF

    found: list[tuple[float, int, int, bytes]] = []
    with MDF(BytesIO(path.read_bytes())) as file:
        for number, group in enumerate(file.groups):
            names = {channel.name for channel in group.channels}
            if "CAN_DataFrame.ID" not in names or not group.channel_group.cycles_nr:
                continue

            def column(name: str, number: int = number) -> np.ndarray:
                return np.asarray(file.get(f"CAN_DataFrame.{name}", group=number, samples_only=True)[0])

            times_s = file.get_master(number)
            buses = column("BusChannel") if "CAN_DataFrame.BusChannel" in names else np.zeros(len(times_s))
            rows = zip(times_s, column("ID"), buses, column("DataBytes"), column("DataLength"), strict=True)
            found += [(t, int(key) & 0x1FFFFFFF, int(bus), bytes(data)[: int(n)]) for t, key, bus, data, n in rows]
    found.sort(key=lambda one: one[0])
    return [(round((t - found[0][0]) * 1e6), *rest) for t, *rest in found]


def test_stamps_of_whole_nanoseconds_are_kept_exactly(tmp_path: Path) -> None:
    late = 2**53 + 1
    log = read_mdf(written(tmp_path, mdf_logs.logger_file([(0, 0x100, b""), (1, 0x100, b"")], first_ns=late)))
    assert as_entries(log.frames) == [(0, 0x100, b""), (1, 0x100, b"")]


def test_data_that_are_not_where_a_frame_says_make_it_a_damaged_one(tmp_path: Path) -> None:
    content = bytearray(mdf_logs.logger_file(VARIED))
    first = content.find(b"##DT") + 24
    struct.pack_into("<Q", content, first + 15, 3)  # into the middle of a sample
    log = read_mdf(written(tmp_path, bytes(content)))
    assert as_entries(log.frames) == [(t - 1000, key, data) for t, key, data in VARIED[1:]]
    assert log.metadata["damaged_entries"] == 1


@pytest.mark.parametrize(
    ("kind", "at", "value", "problem"),
    [
        (b"##CG", 24 + 48 + 8, struct.pack("<Q", 2**40), "more than the file can hold"),
        (b"##CG", 24 + 48 + 24, struct.pack("<I", 4), "in a record"),
        (b"##CN", 24 + 64 + 4, struct.pack("<I", 2**30), "in a record"),
        (b"##CN", 24 + 64 + 12, struct.pack("<II", 2, 9), "invalidation bit beyond"),
        (b"##CN", 24 + 64, struct.pack("<BB", 0, 0), "has no times"),
        (b"##DG", 24 + 32, struct.pack("<B", 3), "have 3 bytes"),
        (b"##DG", 24 + 32, struct.pack("<B", 0), "without numbers before their records"),
        (b"##DG", 24 + 32, struct.pack("<B", 2), "a record is of no group"),
        (b"##HD", 24, struct.pack("<Q", 0), ""),
    ],
)  # fmt: skip
def test_groups_that_cannot_be_are_refused(kind: bytes, at: int, value: bytes, problem: str, tmp_path: Path) -> None:
    content = bytearray(mdf_logs.logger_file(VARIED))
    # the times' channel is the last one written, and the group of frames behind it
    place = content.rfind(kind) + at
    content[place : place + len(value)] = value
    path = written(tmp_path, bytes(content))
    if problem:
        with pytest.raises(CorruptFileError, match=problem):
            read_mdf(path)
    else:
        assert read_mdf(path).metadata["data_frames"] == 0


def channel_at(content: bytes, name: str) -> int:
    """Where the block of a channel of a name begins."""
    text_at = content.index(b"##TX" + struct.pack("<4xQQ", 24 + len(name) + 8 - len(name) % 8, 0) + name.encode())
    return content.index(b"##CN", content.index(struct.pack("<Q", text_at)) - 48)


def with_number(content: bytes, at: int, layout: str, *numbers: int) -> bytes:
    changed = bytearray(content)
    struct.pack_into(layout, changed, at, *numbers)
    return bytes(changed)


LOGGED = mdf_logs.logger_file(VARIED)
DATA_AT = channel_at(LOGGED, "CAN_DataFrame.DataBytes")
FIELDS, DATA_LINK, NAME_LINK = 24 + 64, 24 + 40, 24 + 16
FRAMES_AT = LOGGED.rindex(b"##CG")


@pytest.mark.parametrize("kind", [0, 5, 9])
def test_places_of_data_are_never_taken_for_the_data(kind: int, tmp_path: Path) -> None:
    content = with_number(LOGGED, DATA_AT + FIELDS, "<B", kind)
    with pytest.raises(ReadError, match="DataBytes is of type"):
        read_mdf(written(tmp_path, content))


def test_data_of_a_largest_length_lie_in_the_record(tmp_path: Path) -> None:
    content = mdf_logs.bus_log(VARIED)
    data, lengths = (channel_at(content, f"CAN_DataFrame.{name}") for name in ("DataBytes", "DataLength"))
    content = with_number(with_number(content, data + FIELDS, "<B", 5), data + DATA_LINK, "<Q", lengths)
    assert as_entries(read_mdf(written(tmp_path, content)).frames) == VARIED


def test_data_that_are_said_to_be_other_records_are_refused(tmp_path: Path) -> None:
    content = with_number(LOGGED, DATA_AT + DATA_LINK, "<Q", FRAMES_AT)
    with pytest.raises(CorruptFileError, match="said to be the records"):
        read_mdf(written(tmp_path, content))


def test_a_channel_that_has_a_columns_short_name_is_another_one(tmp_path: Path) -> None:
    long = b"CAN_DataFrame.BusChannel"
    content = mdf_logs.bus_log(VARIED).replace(long, b"ID".ljust(len(long), b"\0"))
    assert as_entries(read_mdf(written(tmp_path, content)).frames) == VARIED


def test_a_frame_of_a_negative_channel_is_damaged(tmp_path: Path) -> None:
    content = mdf_logs.bus_log([(0, 0x100, b"\x01"), (1000, 0x101, b"\xff")])
    fields = channel_at(content, "CAN_DataFrame.BusChannel") + FIELDS
    signed = with_number(content, fields, "<BBBBI", 0, 0, 2, 0, 15)  # the first byte of the data
    log = read_mdf(written(tmp_path, signed))
    assert log.frames.channel.tolist() == [1]
    assert log.metadata["damaged_entries"] == 1


def test_a_damaged_name_is_refused_and_no_column_vanishes(tmp_path: Path) -> None:
    content = with_number(LOGGED, channel_at(LOGGED, "CAN_DataFrame.IDE") + NAME_LINK, "<Q", DATA_AT)
    with pytest.raises(CorruptFileError, match="leads to no text"):
        read_mdf(written(tmp_path, content))


def test_frames_of_variable_length_themselves_are_refused(tmp_path: Path) -> None:
    content = with_number(LOGGED, FRAMES_AT + 24 + 48 + 16, "<H", 7)
    with pytest.raises(CorruptFileError, match="of variable length and has channels"):
        read_mdf(written(tmp_path, content))


def test_groups_of_one_number_are_refused(tmp_path: Path) -> None:
    content = with_number(LOGGED, FRAMES_AT + 24 + 48, "<Q", 3)
    with pytest.raises(CorruptFileError, match="no numbers of their own"):
        read_mdf(written(tmp_path, content))


def test_records_behind_those_that_a_group_states_are_told(tmp_path: Path) -> None:
    content = mdf_logs.bus_log(VARIED)
    group = content.rindex(b"##CG") + 24 + 48
    fewer = read_mdf(written(tmp_path, with_number(content, group + 8, "<Q", 8)))
    assert fewer.metadata["data_frames"] == 8
    assert fewer.incomplete == f"{32 * 23} bytes behind the 8 records that a group states were not read"
    with pytest.raises(CorruptFileError, match="more than records of 31"):
        read_mdf(written(tmp_path, with_number(content, group + 24, "<I", 31)))


def test_damage_in_the_middle_of_an_unclosed_file_is_more_than_its_last_frames(tmp_path: Path) -> None:
    content = mdf_logs.logger_file(VARIED, unwritten=COUNTS | LAST_LENGTH)
    at = content.index(b"##DT") + 24 + 3 * 23 + 5 + 6 + 1  # the length of the third frame's data, after 0 and 1 bytes
    log = read_mdf(written(tmp_path, with_number(content, at, "<I", 1 << 30)))
    assert log.metadata["data_frames"] == 2
    assert "bytes behind the last whole record could not be read" in log.incomplete


def test_data_that_two_groups_use_are_refused_if_their_places_were_not_written(tmp_path: Path) -> None:
    content = mdf_logs.logger_file(VARIED, unwritten=COUNTS | LAST_LENGTH | OFFSETS)
    values = struct.unpack_from("<Q", content, channel_at(content, "CAN_DataFrame.DataBytes") + DATA_LINK)[0]
    other = channel_at(content, "CAN_ErrorFrame")
    with pytest.raises(CorruptFileError, match="which data are whose"):
        read_mdf(written(tmp_path, with_number(content, other + DATA_LINK, "<Q", values)))


def test_a_missing_sample_gives_no_frame_another_ones_data(tmp_path: Path) -> None:
    entries = [(1000 * i, 0x100 + i, bytes([i]) * 8) for i in range(9)]
    content = mdf_logs.logger_file(entries, unwritten=COUNTS | LAST_LENGTH | OFFSETS)
    errors, sample = 2 * 9, 1 + 4 + 8
    stopped = read_mdf(written(tmp_path, content[: -errors - sample]))
    assert as_entries(stopped.frames) == entries[:8]
    first = content.index(b"##DT") + 24 + 23
    with pytest.raises(CorruptFileError, match="which data are whose"):
        read_mdf(written(tmp_path, content[:first] + content[first + sample :]))


def test_samples_that_share_bytes_make_their_frames_damaged_ones(tmp_path: Path) -> None:
    content = mdf_logs.listed_log([(0, 0x100, bytes([0, 1, 0, 0, 0, 9])), (1000, 0x101, b"abc"), (2000, 0x102, b"d")])
    rows = content.index(b"##DT", content.rindex(b"##DZ")) if b"##DT" in content[content.rindex(b"##DZ") :] else -1
    rows = content.rindex(b"##DT") if rows < 0 else rows
    log = read_mdf(written(tmp_path, with_number(content, rows + 24 + 14, "<Q", 5)))
    assert 0x101 not in log.frames.key.tolist()
    assert log.metadata["damaged_entries"] == 2


def test_links_beyond_a_blocks_length_are_refused(tmp_path: Path) -> None:
    for mark, links in ((b"##CC", 5), (b"##CN", 72)):
        at = LOGGED.index(mark)
        with pytest.raises(CorruptFileError, match=r"has not the 5 links|has no 72 links"):
            read_mdf(written(tmp_path, with_number(LOGGED, at + 16, "<Q", links)))


def test_the_last_block_of_a_list_reaches_to_the_next_one_if_its_length_was_not_written(tmp_path: Path) -> None:
    content = bytearray(mdf_logs.listed_log(VARIED))
    content[:8] = b"UnFinMF "
    struct.pack_into("<H", content, 60, LAST_LENGTH)
    struct.pack_into("<Q", content, content.rindex(b"##DT") + 8, 24)
    assert as_entries(read_mdf(written(tmp_path, bytes(content))).frames) == VARIED


def test_lengths_are_told_by_the_codes_where_there_are_no_others(tmp_path: Path) -> None:
    long = b"CAN_DataFrame.DataLength"
    content = mdf_logs.bus_log(VARIED).replace(long, b"CAN_DataFrame.DLC".ljust(len(long), b"\0"))
    assert as_entries(read_mdf(written(tmp_path, content)).frames) == VARIED


def test_a_list_that_goes_on_with_no_list_is_refused(tmp_path: Path) -> None:
    content = mdf_logs.listed_log(VARIED)
    with pytest.raises(CorruptFileError, match="to no list of data"):
        read_mdf(written(tmp_path, with_number(content, content.rindex(b"##DL") + 24, "<Q", content.rindex(b"##DT"))))


def test_the_beginning_of_a_file_alone_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CorruptFileError):
        read_mdf(written(tmp_path, b"UnFinMF 4.10"))


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(ReadError, match="cannot be read"):
        read_mdf(tmp_path / "none.mf4")


def test_bus_logging_that_was_not_closed_is_told() -> None:
    path = shared_file("can/00000170.MF4")
    log = read_mdf(path)
    assert log.metadata["data_frames"] == 2010
    assert any("did not close the file" in note for note in log.notes)
    assert log.absolute_start is not None
    assert (log.absolute_start.text[:19], log.absolute_start.zone) == ("2020-12-15T14:14:59", "UTC")
    np.testing.assert_array_equal(np.unique(log.frames.key), [0x7BB, 0x7EC])


def test_bus_logging_is_told_from_measurements() -> None:
    assert is_bus_logging(mdf_logs.bus_log(ENTRIES)[:65536])
    assert not is_bus_logging(b"MDF     3.30 CAN_DataFrame")


@pytest.mark.parametrize(
    ("kind", "link", "problem"),
    [
        (b"##CN", 0, "leads back"),
        (b"##DG", 0, "leads back"),
        (b"##CG", 1, "not to a block"),
        (b"##DG", 2, "the file is cut"),
    ],
)
def test_blocks_that_lead_astray_are_refused(kind: bytes, link: int, problem: str, tmp_path: Path) -> None:
    content = bytearray(mdf_logs.bus_log(ENTRIES))
    at = content.rfind(kind)
    target = {"leads back": at, "not to a block": 70, "the file is cut": 1 << 60}[problem]
    struct.pack_into("<Q", content, at + 24 + 8 * link, target)
    with pytest.raises(CorruptFileError, match=problem):
        read_mdf(written(tmp_path, bytes(content)))


def packed_samples(content: bytes, stated: int, method: int = 0) -> bytes:
    """Replace the samples of a file by a compressed block of them."""
    at = content.rfind(b"##DT")
    size = struct.unpack_from("<Q", content, at + 8)[0]
    packed = zlib.compress(content[at + 24 : at + size])
    block = struct.pack("<4s4xQQ2sBxLQQ", b"##DZ", 48 + len(packed), 0, b"DT", method, 0, stated, len(packed))
    return content[:at] + (block + packed).ljust(size + 8, b"\0") + content[at + size + (-size) % 8 :]


def test_compressed_bus_logging_is_read_and_one_that_grows_beyond_its_size_refused(tmp_path: Path) -> None:
    content = mdf_logs.bus_log(ENTRIES)
    size = 23 * len(ENTRIES)
    dg = content.rfind(b"##DG")
    whole = packed_samples(content, size)
    whole = whole[: whole.rfind(b"##DG")] + content[dg:]
    moved = bytearray(whole)
    struct.pack_into("<Q", moved, 64 + 24, whole.rfind(b"##DG"))
    log = read_mdf(written(tmp_path, bytes(moved)))
    assert [e[1:] for e in as_entries(log.frames)] == [e[1:] for e in ENTRIES]
    at = moved.rfind(b"##DZ") + 24
    for stated in (size - 1, size + 1, 1 << 50):
        struct.pack_into("<Q", moved, at + 8, stated)
        with pytest.raises(CorruptFileError, match="stated size"):
            read_mdf(written(tmp_path, bytes(moved)))
