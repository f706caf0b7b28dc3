from __future__ import annotations

import struct
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from recoil_acquisition.errors import FramingError
from recoil_acquisition.frames.declaration import framing_from_table
from recoil_acquisition.frames.frame_set import FrameSet
from recoil_acquisition.frames.framing import Framing
from recoil_acquisition.frames.ready_made import READY_MADE
from recoil_acquisition.frames.scan import find_frames
from recoil_acquisition.frames.values import FieldSeries, decode_fields, gaps
from recoil_acquisition.quantities.quantity import find_unit
from tests.builders.serial_packets import cobs, summed, witmotion_frame
from tests.builders.shared_data import shared_file

G = 9.80665
COLUMNS = ["t_ms", "ax", "ay", "az", "p"]


def made(name: str, **keys: Any) -> Framing:
    return framing_from_table({"ready_made": name, **keys})


def read(framing: Framing, stream: bytes) -> tuple[FrameSet, Mapping[str, FieldSeries]]:
    frames = find_frames(framing, stream)
    return frames, decode_fields(framing, frames)


def vectors(series: Mapping[str, FieldSeries], name: str) -> np.ndarray:
    return np.stack([series[f"{name}_{axis}"].values for axis in "xyz"], axis=1)


@pytest.mark.parametrize("name", READY_MADE)
def test_every_ready_made_framing_is_sound_and_in_units_that_convert_to_si(name: str) -> None:
    framing = made(name, **({"columns": ["a", "b"], "units": ["mm", "m/s^2"]} if name == "csv-lines" else {}))
    assert framing.baudrate > 0
    assert all(find_unit(field.unit) is not None for field in framing.fields)
    assert "Source:" in str(READY_MADE[name].__doc__) or name == "csv-lines"


def test_a_rig_may_replace_keys_give_parameters_and_leave_keys_out() -> None:
    framing = made("xsens-mti", baudrate=921600, precision="fp16.32", without=["device_time"])
    assert framing.baudrate == 921600
    assert framing.device_time is None
    assert framing.counter is not None
    assert {field.type for field in framing.fields} == {"u16", "u32", "fp1632"}


@pytest.mark.parametrize(
    ("keys", "fault"),
    [
        ({"ready_made": "xsens"}, "framing.ready_made: no framing 'xsens'; there are xsens-mti, "),
        ({"ready_made": 5}, "framing.ready_made: no framing 5"),
        ({"ready_made": "xsens-mti", "precision": "f16"}, "precision must be one of f32, fp12.20"),
        ({"ready_made": "xsens-mti", "precision": []}, "precision must be one of f32, fp12.20"),
        ({"ready_made": "xsens-mti", "kind": "slip"}, "framing.kind: is that of the ready-made framing"),
        ({"ready_made": "xsens-mti", "without": ["clock"]}, "framing.without: must be a list of kind, sync"),
        ({"ready_made": "xsens-mti", "adress": 1}, "framing.adress: unknown key"),
        ({"ready_made": "xsens-mti", "without": ["kind"]}, "framing.kind: must be one of sync"),
        ({"ready_made": "keller", "address": 250}, "address must be a whole number from 1 to 249, found 250"),
        ({"ready_made": "keller", "address": "1"}, "address must be a whole number"),
        ({"ready_made": "keller", "channel": 9}, "channel must be a whole number from 1 to 4, found 9"),
        ({"ready_made": "keller", "every_s": 0.0}, "framing.poll[0].every_s: must be greater than 0"),
        ({"ready_made": "witmotion", "acceleration_range_g": 0}, "acceleration_range_g must be a number from 0.1"),
        ({"ready_made": "csv-lines"}, "columns is missing"),
        ({"ready_made": "csv-lines", "columns": "ax"}, "columns must be a list of texts"),
        ({"ready_made": "csv-lines", "columns": ["a"], "units": ["m", "m"]}, "units must be as many as columns, 1"),
        ({"ready_made": "vectornav-vn100-binary", "header": "FA 01 21"}, "header must be FA, a byte of groups"),
        ({"ready_made": "vectornav-vn100-binary", "header": 7}, "header must be FA, a byte of groups"),
        ({"ready_made": "vectornav-vn100-binary", "header": "FA 02 01 00"}, "the size of field 0 of group 2"),
        ({"ready_made": "vectornav-vn100-binary", "header": "FA 01 02 00"}, "announces nothing that is decoded"),
    ],
)
def test_each_fault_of_a_ready_made_framing_is_named(keys: dict[str, Any], fault: str) -> None:
    with pytest.raises(FramingError) as caught:
        framing_from_table(keys)
    assert fault in str(caught.value)
    assert str(caught.value).startswith("1 fault: ")


def test_xsens_commands_carry_their_checksum() -> None:
    framing = made("xsens-mti")
    assert framing.start_commands[0].data.hex() == "faff1000f1"
    assert framing.stop_commands[0].data.hex() == "faff3000d1"


@pytest.mark.parametrize(("number", "precision"), [(1, "f32"), (2, "fp12.20"), (3, "fp16.32")])
def test_every_real_xbus_message_is_found_and_read_in_its_number_format(number: int, precision: str) -> None:
    golden = shared_file(f"serial/messages{number}.golden").read_text().split()
    frames, series = read(
        made("xsens-mti", precision=precision), shared_file(f"serial/output{number}.bin").read_bytes()
    )
    assert [frames.frame(i).hex() for i in range(frames.begins.size)] == golden
    assert (len(golden), frames.counters.skipped_bytes) == (100, 0)
    assert gaps(series["packet_counter"].raw, 65536) == (0, 0)
    assert vectors(series, "acceleration").shape == vectors(series, "rate_of_turn").shape == (96, 3)
    # the first message after start-up has not settled
    assert np.linalg.norm(vectors(series, "acceleration")[1:], axis=1) == pytest.approx(G, abs=0.03)


@pytest.mark.parametrize("precision", ["f32", "fp12.20", "fp16.32", "f64"])
def test_each_number_format_of_xsens_is_read(precision: str) -> None:
    code = ["f32", "fp12.20", "fp16.32", "f64"].index(precision)
    value = [-1.5, 9.75, 0.25]
    stored = {
        "f32": struct.pack(">3f", *value),
        "fp12.20": struct.pack(">3i", *(round(v * 2**20) for v in value)),
        "fp16.32": b"".join(struct.pack(">Ih", int((v % 1) * 2**32), int(v // 1)) for v in value),
        "f64": struct.pack(">3d", *value),
    }[precision]
    data = struct.pack(">HBHHB", 0x1020, 2, 7, 0x4020 | code, len(stored)) + stored
    message = bytes([0xFF, 0x36, len(data)]) + data
    stream = b"\xfa" + message + bytes([-sum(message) & 0xFF])
    frames, series = read(made("xsens-mti", precision=precision), stream)
    assert frames.counters.received == 1
    assert vectors(series, "acceleration").tolist() == [value]
    assert series["rate_of_turn_x"].raw.size == 0


def test_every_valid_real_vectornav_frame_among_foreign_text_is_found() -> None:
    framing = made("vectornav-vn100-binary", header="FA 14 3E 00 3A 00")
    assert framing.length.fixed == 124
    stream = shared_file("serial/vn100_F00379.bin").read_bytes()
    frames, series = read(framing, stream)
    assert stream.count(framing.sync) == 8897
    assert (frames.counters.received, frames.counters.bad_checksum) == (8895, 2)
    assert frames.counters.skipped_bytes == len(stream) - 8895 * 124
    assert np.median(np.linalg.norm(vectors(series, "uncompensated_acceleration"), axis=1)) == pytest.approx(G, abs=0.1)
    assert np.median(series["pressure"].values) == pytest.approx(101.3, abs=4.0)
    cosine = np.stack([series[f"direction_cosine_{i}"].values for i in range(9)], axis=1).reshape(-1, 3, 3)
    np.testing.assert_allclose(cosine @ cosine.swapaxes(1, 2), np.broadcast_to(np.eye(3), cosine.shape), atol=1e-5)


def test_a_configured_vectornav_message_is_read() -> None:
    body = bytes.fromhex("01 21 01") + struct.pack("<Q6f", 2_500_000_000, 0.1, 0.2, 0.3, 1.0, 2.0, 3.0)
    framing = made("vectornav-vn100-binary")
    frames, series = read(framing, b"\xfa" + summed(body, "crc16-xmodem", "big"))
    assert frames.counters.received == 1
    assert framing.device_time is not None
    assert series["time_startup"].raw.tolist() == [2_500_000_000]
    np.testing.assert_allclose(vectors(series, "angular_rate"), [[0.1, 0.2, 0.3]], rtol=1e-6)
    assert vectors(series, "acceleration").tolist() == [[1.0, 2.0, 3.0]]


def test_every_real_mip_packet_is_found() -> None:
    framing = made("microstrain-mip", device_time={"field": "reference_time", "tick_s": 1e-9})
    frames, series = read(framing, shared_file("serial/mip_data.bin").read_bytes())
    assert (frames.counters.received, frames.counters.bad_checksum, frames.counters.skipped_bytes) == (8384, 0, 0)
    assert series["acceleration_x"].raw.size == 3579 + 894
    assert np.median(np.linalg.norm(vectors(series, "acceleration"), axis=1)) == pytest.approx(G, abs=0.2)
    steps_ns = np.diff(series["reference_time"].raw)
    assert steps_ns.min() > 0


def test_generated_mip_packets_hold_the_truth() -> None:
    truth = np.load(shared_file("serial/generated/serial_truth.npz"))
    stream = shared_file("serial/generated/mip_0x80_04_05.bin").read_bytes()
    frames, series = read(made("microstrain-mip"), stream)
    assert (frames.counters.received, frames.counters.skipped_bytes) == (1500, 0)
    for axis in "xyz":
        np.testing.assert_allclose(series[f"acceleration_{axis}"].values, truth[f"a{axis}"], atol=2e-6 * G)
        np.testing.assert_allclose(series[f"angular_rate_{axis}"].values, np.radians(truth[f"g{axis}"]), atol=1e-7)


def test_a_witmotion_stream_with_dropped_bytes_gives_no_false_frame() -> None:
    truth = np.load(shared_file("serial/generated/witmotion_truth.npy"))
    stream = shared_file("serial/generated/witmotion_8_dropped_bytes.bin").read_bytes()
    framing = made("witmotion")
    frames, series = read(framing, stream)
    found = [struct.unpack("<B4h", frames.frame(i)[1:10]) for i in range(frames.begins.size)]
    left = iter(truth.tolist())
    assert all(any(list(frame) == row for row in left) for frame in found), "a frame that is not in the truth"
    assert len(truth) - len(found) <= 16  # each dropped byte costs its frame and, by look-ahead, the one before
    assert series["acceleration_x"].raw.tolist() == [x for kind, x, *_ in found if kind == 0x51]
    rates = [x for kind, x, *_ in found if kind == 0x52]
    np.testing.assert_allclose(series["angular_rate_x"].values, np.array(rates) * 2000 / 32768)


def test_witmotion_scales_are_those_of_its_ranges() -> None:
    stream = witmotion_frame(0x51, 16384, -16384, 0, 2150) + witmotion_frame(0x52, 16384, 0, 0, 0)
    stream += (
        witmotion_frame(0x53, -16384, 0, 0, 0) + witmotion_frame(0x54, 1, 2, 3, 4) + witmotion_frame(0x61, 1, 2, 3, 4)
    )
    frames, series = read(made("witmotion", acceleration_range_g=8), stream)
    assert series["acceleration_x"].values == pytest.approx(4 * G)
    assert series["temperature"].values == pytest.approx(21.5)
    assert series["angular_rate_x"].values == pytest.approx(1000.0)
    assert series["angle_x"].values == pytest.approx(-90.0)
    assert (frames.counters.received, frames.counters.unknown_types) == (4, 1)


def test_vectornav_lines_hold_the_truth_but_for_two_damaged() -> None:
    truth = np.load(shared_file("serial/generated/serial_truth.npz"))
    stream = shared_file("serial/generated/vn100_ascii_VNIMU.txt").read_bytes()
    frames, series = read(made("vectornav-vn100-ascii"), stream)
    assert (frames.counters.received, frames.counters.bad_checksum, frames.counters.unknown_types) == (298, 2, 0)
    good = np.searchsorted(np.cumsum([len(line) + 1 for line in stream.split(b"\n")]), frames.ends)
    for axis in "xyz":
        # the generated lines state every fifth sample, of ax a tenth
        np.testing.assert_allclose(
            series[f"acceleration_{axis}"].values,
            truth[f"a{axis}"][5 * good] / (10 if axis == "x" else 1),
            atol=5.01e-4,
        )
        np.testing.assert_allclose(
            series[f"angular_rate_{axis}"].values, np.radians(truth[f"g{axis}"][5 * good]), atol=5.01e-7
        )


def test_a_vectornav_line_may_have_a_checksum_of_four_digits() -> None:
    body = b"$VNIMU,0,0,0,1,2,3,4,5,6,21,101"
    framing = made("vectornav-vn100-ascii", checksum={"algo": "crc16-xmodem", "from": 1})
    assert framing.checksum is not None
    frames, series = read(framing, body + framing.checksum.of(body) + b"\r\n")
    assert frames.counters.received == 1
    assert vectors(series, "angular_rate").tolist() == [[4.0, 5.0, 6.0]]


def test_generated_cobs_packets_hold_the_truth_but_for_one() -> None:
    truth = np.load(shared_file("serial/generated/serial_truth.npz"))
    framing = framing_from_table(
        {
            "kind": "cobs",
            "checksum": {"algo": "crc16-xmodem"},
            "fields": [
                {"name": "number", "at": 0, "type": "u32"},
                {"name": ["ax", "ay", "az", "gx", "gy", "gz"], "at": 4, "type": "f32"},
            ],
            "counter": {"field": "number", "modulo": 2**32},
        }
    )
    stream = shared_file("serial/generated/cobs_crc16_u32_6f.bin").read_bytes()
    frames, series = read(framing, stream)
    assert (frames.counters.received, frames.counters.bad_checksum + frames.counters.bad_length) == (1498, 1)
    numbers = series["number"].raw
    assert gaps(numbers, 2**32)[1] == 2
    for name in ("ax", "ay", "az", "gx", "gy", "gz"):
        np.testing.assert_allclose(series[name].values, truth[name][numbers], rtol=1e-6, atol=1e-9)
    assert cobs(frames.frame(0)) == stream[: frames.ends[0]]


def test_csv_lines_with_a_comment_and_a_cut_end_hold_the_truth() -> None:
    truth = np.load(shared_file("serial/generated/serial_truth.npz"))
    stream = shared_file("serial/generated/csv_lines.txt").read_bytes()
    framing = made("csv-lines", columns=COLUMNS, units=["ms", "m/s^2", "m/s^2", "m/s^2", "bar"])
    frames, series = read(framing, stream)
    lines = stream.split(b"\n")
    assert frames.counters.received == len(lines) - 2
    assert frames.counters.skipped_bytes == len(lines[0]) + 1 + len(lines[-1])
    samples = series["t_ms"].values.astype(int)
    for name, digits in (("ax", 3), ("ay", 3), ("az", 3), ("p", 2)):
        np.testing.assert_allclose(series[name].values, truth[name][samples], atol=0.5001 * 10.0**-digits)


def test_a_keller_exchange_is_read_and_its_requests_are_the_scripts() -> None:
    text = shared_file("serial/generated/keller_f73_exchange.txt").read_text()
    lines = [line.split(maxsplit=1) for line in text.splitlines() if not line.startswith("#")]
    sent = [bytes.fromhex(rest) for who, rest in lines if who.startswith("host")]
    replies = [bytes.fromhex(rest) for who, rest in lines if who.startswith("dev")]
    framing = made("keller")
    assert framing.start_commands[0].data == sent[0]
    assert {framing.poll[0].request} == set(sent[1:])
    truth = np.load(shared_file("serial/generated/serial_truth.npz"))
    for echoed in (False, True):
        stream = b"".join(q + r if echoed else r for q, r in zip(sent, replies, strict=True))
        frames, series = read(framing, stream)
        assert frames.counters.received == len(replies)
        values = series["pressure_1"].values
        assert values.size == len(replies) - 1
        best = min(
            (float(np.abs(values - truth["p"][: step * values.size : step]).max()) for step in (1, 5, 10, 20, 30)),
        )
        assert best < 1e-5


def test_a_keller_error_is_told_from_a_value() -> None:
    error = summed(b"\x07\xc9\x20", "crc16-modbus", "big")
    value = summed(b"\x07\x49" + struct.pack(">fB", -0.5, 0), "crc16-modbus", "big")
    frames, series = read(made("keller", address=7, channel=3), error + value)
    assert series["error"].raw.tolist() == [32]
    assert series["temperature"].values.tolist() == [-0.5]
    assert frames.counters.unknown_types == 0
