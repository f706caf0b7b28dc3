from __future__ import annotations

from typing import Any

import pytest

from recoil_acquisition.errors import FramingError
from recoil_acquisition.frames.declaration import framing_from_table
from tests.builders.vendor_files import FRAMING


def changed(**keys: Any) -> dict[str, Any]:
    return {k: v for k, v in {**FRAMING, **keys}.items() if v is not None}


def test_a_sound_table_becomes_a_framing() -> None:
    framing = framing_from_table(FRAMING)
    assert framing.sync == b"\xaa\x55"
    assert framing.length.fixed == 16
    assert framing.maximum == 64
    assert [f.name for f in framing.fields] == ["counter", "device_time", "gyro", "temperature"]
    assert framing.checksum is not None
    assert framing.checksum.size == 2
    assert framing.device_time is not None
    assert framing.device_time.modulo == 2**32


FIELD = {"name": "a", "at": 2, "type": "u8"}


@pytest.mark.parametrize(
    ("keys", "fault"),
    [
        ({"kind": "cob"}, "framing.kind: must be one of sync, fixed, delimiter, cobs, slip, idle"),
        ({"kind": ["sync"]}, "framing.kind: must be one of sync"),
        ({"sinc": "AA"}, "framing.sinc: unknown key; did you mean `sync`?"),
        ({"sync": "XY"}, "framing.sync: must be bytes in hexadecimal"),
        ({"sync": None}, "framing.sync: must be bytes in hexadecimal"),
        ({"sync": 5}, "framing.sync: must be bytes in hexadecimal"),
        ({"length": None}, "framing.length: is missing"),
        ({"length": 34}, "framing.length: must be a table"),
        ({"length": {"fixed": 0}}, "framing.length.fixed: must be greater than or equal to 1, found 0"),
        ({"length": {"fixed": 16, "add": 1}}, "framing.length.fixed: excludes the other keys"),
        ({"length": {"at": 2, "type": "f32"}}, "framing.length.type: must be one of u8"),
        ({"length": {"type": "u8"}}, "framing.length.at: is missing"),
        ({"length": {"fixed": 3}}, "framing.length.fixed: 3 bytes do not hold the sync bytes"),
        ({"max": 8}, "framing.max: 8 is less than the fixed length 16"),
        ({"max": True}, "framing.max: must be a whole number, found True"),
        ({"endian": "middle"}, "framing.endian: must be one of little, big"),
        ({"checksum": {"algo": "crc9"}}, "framing.checksum.algo: must be one of none, xor8"),
        ({"checksum": {}}, "framing.checksum.algo: is missing"),
        ({"checksum": {"algo": "crc32", "size": 2}}, "framing.checksum.size: crc32 has 4 bytes, found 2"),
        ({"checksum": {"algo": "sum8", "from": 16}}, "framing.checksum.from: byte 16 lies behind"),
        ({"fields": []}, "framing.fields: must be a list of at least one field"),
        ({"fields": "a"}, "framing.fields: must be a list of at least one field"),
        ({"fields": [5]}, "framing.fields[0]: must be a list of at least one field, found 5"),
        ({"fields": [{**FIELD, "name": ""}]}, "framing.fields[0].name: must be a text"),
        ({"fields": [{"at": 2, "type": "u8"}]}, "framing.fields[0].name: is missing"),
        ({"fields": [{"name": "a", "type": "u8"}]}, "framing.fields[0].at: is missing"),
        ({"fields": [{**FIELD, "type": "u9"}]}, "framing.fields[0].type: must be one of u8, i8"),
        ({"fields": [{**FIELD, "scale": "x"}]}, "framing.fields[0].scale: must be a finite number"),
        ({"fields": [{**FIELD, "scale": float("nan")}]}, "framing.fields[0].scale: must be a finite number"),
        ({"fields": [{**FIELD, "at": 14}]}, "framing.fields 'a': its bytes from 14 lie behind"),
        ({"fields": [FIELD, FIELD]}, "framing.fields: 'a' is there 2 times"),
        ({"counter": {"field": "x", "modulo": 4}}, "framing.counter.field: no field 'x'; there are counter"),
        (
            {"counter": {"field": "counter", "modulo": 1}},
            "framing.counter.modulo: must be greater than or equal to 2",
        ),
        ({"device_time": {"field": "gyro"}}, "framing.device_time.tick_s: is missing"),
        (
            {"device_time": {"field": "gyro", "tick_s": -1.0}},
            "framing.device_time.tick_s: must be greater than 0, found -1.0",
        ),
        ({"baudrate": 0}, "framing.baudrate: must be greater than 0, found 0"),
        ({"rate_hz": "fast"}, "framing.rate_hz: must be a finite number, found 'fast'"),
        ({"frames": []}, "framing.frames: must be a list of tables"),
        ({"frames": [{"fields": [FIELD]}]}, "framing.fields: stands in each of `frames`"),
        ({"when": {"at": 2, "equals": 300}}, "framing.when.equals: must be a byte from 0 to 255"),
        ({"when": {"equals": 3}}, "framing.when.at: is missing"),
        ({"when": {"at": 2, "equals": "zz"}}, "framing.when.equals: must be bytes in hexadecimal"),
        ({"when": {"at": 2, "text": "a", "equals": 3}}, "framing.when.text: excludes `equals`"),
        ({"length": {"at": 2, "of": {}}}, "framing.length.of: must be a table such as"),
        ({"length": {"at": 2, "of": {"0G": 3}}}, "framing.length.of: '0G' is no value of 1 bytes in hexadecimal"),
        ({"length": {"at": 2, "of": {"0101": 3}}}, "framing.length.of: '0101' is no value of 1 bytes"),
        ({"length": {"at": 2, "of": {"01": "3"}}}, "framing.length.of: the length for '01' must be a whole number"),
        ({"length": {"at": 2, "of": {"01": 2}}}, "framing.length.of: 2 bytes for 0x1 do not hold the head"),
        ({"length": {"at": 2, "of": {"01": 99}}}, "framing.length.of: 99 bytes for 0x1"),
        ({"length": {"at": 2, "of": {"01": 9}, "add": 1}}, "framing.length.of: excludes `add`"),
        ({"checksum": {"algo": "sum8", "format": "octal"}}, "framing.checksum.format: must be one of binary, hex"),
        ({"look_ahead": 1}, "framing.look_ahead: must be true or false"),
        ({"only_known": "yes"}, "framing.only_known: must be true or false"),
        ({"timeout_s": 0}, "framing.timeout_s: must be greater than 0, found 0"),
        ({"bits_per_byte": 20}, "framing.bits_per_byte: must be less than or equal to 13, found 20"),
        ({"gap_s": 0.1}, "framing.gap_s: unknown key"),
        (
            {"counter": {"field": "counter", "modulo": 9, "step": 5}},
            "framing.counter.step: must be a whole number up to",
        ),
        ({"fields": [{**FIELD, "bits": [0, 9]}]}, "framing.fields[0].bits: must be the lowest bit and the number"),
        ({"fields": [{**FIELD, "bits": 3}]}, "framing.fields[0].bits: must be the lowest bit and the number"),
        ({"fields": [{**FIELD, "bits": [-1, 3]}]}, "framing.fields[0].bits: must be the lowest bit and the number"),
        ({"fields": [{**FIELD, "type": "f32", "bits": [0, 3]}]}, "bits: are those of whole numbers, not of f32"),
        (
            {"fields": [{**FIELD, "plausible": [3, 3]}]},
            "framing.fields[0].plausible: must be the least and the greatest",
        ),
        ({"fields": [{**FIELD, "plausible": [0, float("nan")]}]}, "framing.fields[0].plausible: must be the least"),
        ({"fields": [{**FIELD, "plausible": 7}]}, "framing.fields[0].plausible: must be the least and the greatest"),
        ({"fields": [{**FIELD, "name": []}]}, "framing.fields[0].name: must be a text or a list of texts"),
        ({"fields": [{**FIELD, "name": ["a", ""]}]}, "framing.fields[0].name: must be a text or a list of texts"),
        ({"fields": [{**FIELD, "name": ["a", "b"], "count": 2}]}, "framing.fields[0].count: excludes a list of names"),
        ({"fields": [{**FIELD, "count": 0}]}, "framing.fields[0].count: must be greater than or equal to 1, found 0"),
        (
            {"fields": [{**FIELD, "name": ["b", "c"], "type": "f64"}]},
            "framing.fields 'c': its bytes from 10 lie behind",
        ),
        ({"tlv": {"from": 4, "len": "u8"}}, "framing.tlv.id: is missing"),
        ({"tlv": {"from": 4, "len": "u8", "id": "u8", "id_first": 1}}, "framing.tlv.id_first: must be true or false"),
        ({"tlv": {"from": 4, "len": "u8", "id": "u8"}}, "framing.fields[0].id: is missing"),
    ],
)
def test_each_fault_is_named_by_its_key(keys: dict[str, Any], fault: str) -> None:
    with pytest.raises(FramingError) as caught:
        framing_from_table(changed(**keys))
    assert fault in str(caught.value)


def test_all_faults_are_reported_at_once() -> None:
    with pytest.raises(FramingError, match=r"^4 faults: .*\| .*\| .*\| ") as caught:
        framing_from_table(changed(sinc="AA", max=-1, baudrate=0, rate_hz="x"))
    assert "\n" not in str(caught.value)


def test_lines_have_keys_of_their_own() -> None:
    with pytest.raises(FramingError, match=r"framing.sync: unknown key"):
        framing_from_table({"kind": "delimiter", "sync": "AA", "fields": [{"name": "a", "at": 0}]})
    with pytest.raises(FramingError, match=r"fields\[0\].type: unknown key"):
        framing_from_table({"kind": "delimiter", "fields": [{"name": "a", "at": 0, "type": "u8"}]})
    with pytest.raises(FramingError, match="separator: must not be empty"):
        framing_from_table({"kind": "delimiter", "separator": "", "fields": [{"name": "a", "at": 0}]})


def test_a_checksum_may_be_declared_as_none() -> None:
    assert framing_from_table(changed(checksum={"algo": "none"})).checksum is None


ONE = [{"name": "a", "at": 0, "type": "u8"}]


@pytest.mark.parametrize("kind", ["cobs", "slip"])
def test_stuffed_packets_have_neither_sync_nor_length(kind: str) -> None:
    assert framing_from_table({"kind": kind, "fields": ONE, "timeout_s": 0.5}).silence_s == 0.5
    for key, value in (("sync", "AA"), ("length", {"fixed": 3}), ("look_ahead", True)):
        with pytest.raises(FramingError, match=f"framing.{key}: unknown key"):
            framing_from_table({"kind": kind, "fields": ONE, key: value})


def test_a_fixed_frame_has_a_fixed_length() -> None:
    with pytest.raises(FramingError, match=r"length.fixed: is missing: nothing marks"):
        framing_from_table({"kind": "fixed", "fields": ONE, "length": {"at": 0, "type": "u8"}})
    with pytest.raises(FramingError, match=r"lie behind the frame's data"):
        framing_from_table({"kind": "fixed", "fields": [{**ONE[0], "at": 3}], "length": {"fixed": 3}})


def test_silence_needs_a_gap_or_a_baud_rate() -> None:
    with pytest.raises(FramingError, match=r"framing.gap_s: is missing"):
        framing_from_table({"kind": "idle", "fields": ONE})


def test_the_checksum_of_a_line_is_text() -> None:
    table = {"kind": "delimiter", "fields": [{"name": "a", "at": 0}], "checksum": {"algo": "sum8", "mark": ";"}}
    checksum = framing_from_table(table).checksum
    assert checksum is not None
    assert checksum.of(b"12") == b";63"
    with pytest.raises(FramingError, match=r"checksum.format: must be hex"):
        framing_from_table({**table, "checksum": {"algo": "sum8", "format": "binary"}})


def test_a_known_frame_without_fields_is_one_of_several() -> None:
    frames = [{"when": {"at": 0, "equals": 1}}, {"when": {"at": 0, "equals": 2}, "fields": ONE}]
    assert framing_from_table({"kind": "cobs", "frames": frames}).types[0].fields == ()
    with pytest.raises(FramingError, match=r"framing.fields: must be a list of at least one field"):
        framing_from_table({"kind": "cobs", "when": {"at": 0, "equals": 1}})
    with pytest.raises(FramingError, match=r"framing.frames\[0\].fields: must be a list of at least one field"):
        framing_from_table({"kind": "cobs", "frames": [{}]})
