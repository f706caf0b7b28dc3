"""Checksums, commands and the poll script, as a framing declares them; the device layer sends what they say."""

from __future__ import annotations

from typing import Any

from recoil_acquisition.frames.checksum import CHECKSUMS
from recoil_acquisition.frames.declared_table import Table
from recoil_acquisition.frames.framing import ChecksumField, Command, Poll

_CHECKSUM_KEYS = {"algo", "from", "size", "order", "format", "mark"}
_REQUEST_KEYS = {"hex", "text", "checksum"}


def checksum_of(within: Table, *, lines: bool) -> ChecksumField | None:
    """Read ``checksum``; of a line it is text, behind an asterisk unless another ``mark`` is declared."""
    if "checksum" not in within.values:
        return None
    table = within.table("checksum", _CHECKSUM_KEYS)
    name = table.choice("algo", ("none", *CHECKSUMS))
    start, order = table.whole("from", 0), table.choice("order", ("little", "big"), "little")
    form = table.choice("format", ("binary", "hex"), "hex" if lines else "binary")
    mark = table.text("mark", "*" if lines else "").encode()
    if name == "none":
        return None
    if lines and form == "binary":
        table.fault("format", "must be hex: a binary checksum may hold the delimiter of lines")
    if (size := table.whole("size", CHECKSUMS[name].size)) != CHECKSUMS[name].size:
        table.fault("size", f"{name} has {CHECKSUMS[name].size} bytes, found {size}")
    return ChecksumField(CHECKSUMS[name], start, order == "big", form == "hex", mark)


def _request(table: Table) -> bytes:
    """Read ``hex`` or ``text``, and append the checksum if one is declared."""
    if ("hex" in table.values) == ("text" in table.values):
        table.fault("hex", 'or `text` is needed, such as hex = "01 49 01" or text = "$VNRRG,08"')
        return b""
    as_text = "text" in table.values
    data = table.text("text").encode() if as_text else table.hex_bytes("hex")
    checksum = checksum_of(table, lines=as_text)
    if checksum is not None and checksum.start >= len(data):
        table.fault("checksum.from", f"byte {checksum.start} lies behind the request")
        return data
    if checksum is not None:
        data += checksum.of(data)
    return data + table.text("end", "").encode() if as_text else data


def _tables(top: Table, key: str, known: set[str]) -> list[Table]:
    rows: Any = top.values.get(key, [])
    rows = [rows] if not isinstance(rows, list | tuple) else rows
    return [
        Table({"hex": row} if isinstance(row, str) else row, f"{top.where}.{key}[{i}]", known, top.faults)
        for i, row in enumerate(rows)
    ]


def commands_of(top: Table, key: str) -> tuple[Command, ...]:
    """Read a list of commands: bytes in hexadecimal, or tables with ``wait_s`` to wait behind each."""
    return tuple(
        Command(_request(table), table.number("wait_s", 0.0, positive=True))
        for table in _tables(top, key, _REQUEST_KEYS | {"end", "wait_s"})
    )


def polls_of(top: Table) -> tuple[Poll, ...]:
    """Read ``poll``, one request or a list of them."""
    polls = []
    for table in _tables(top, "poll", _REQUEST_KEYS | {"end", "every_s", "timeout_s"}):
        every_s, timeout_s = table.number("every_s", positive=True), table.number("timeout_s", positive=True)
        polls.append(Poll(_request(table), every_s, timeout_s))
    return tuple(polls)
