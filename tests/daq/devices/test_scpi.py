"""Commands as lines of text: a reply in time or an error in one line, and replies taken apart as they are written."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from recoil_acquisition.devices import scpi
from recoil_acquisition.devices.scpi import ScpiClient, ScpiError, parse_reply, quoted_text

Answers = Callable[[bytes], Sequence[bytes]]


@contextmanager
def instrument(answers: Answers, *, closes_after: int | None = None, pause_s: float = 0.0) -> Iterator[tuple[str, int]]:
    """An instrument that answers each line by some pieces, and closes the connection after so many lines."""
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        listener.listen()

        def serve() -> None:
            try:
                one, _ = listener.accept()
            except OSError:
                return
            with one, suppress(OSError):  # whoever asked may be gone
                for number, line in enumerate(one.makefile("rb"), start=1):
                    for piece in answers(line.strip()):
                        time.sleep(pause_s)
                        one.sendall(piece)
                    if number == closes_after:
                        return

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        yield listener.getsockname()
        listener.close()
        thread.join(2.0)


def asked(answers: Answers, query: str = "*IDN?", *, timeout_s: float = 1.0, closes_after: int | None = None) -> str:
    with instrument(answers, closes_after=closes_after) as address:
        client = ScpiClient(*address, timeout_s=timeout_s)
        try:
            return client.ask(query)
        finally:
            client.close()


def test_a_reply_is_one_line_however_it_is_cut() -> None:
    assert asked(lambda _: [b"DEWETRON", b",OXYGEN,", b"1\r\n"]) == "DEWETRON,OXYGEN,1"


def test_what_came_unasked_is_no_reply_to_the_next_query() -> None:
    with instrument(lambda line: [b"one\nand more\n"] if line == b"A?" else [b"two\n"]) as address:
        client = ScpiClient(*address, timeout_s=1.0)
        assert [client.ask("A?"), client.ask("B?")] == ["one", "two"]
        client.close()


@pytest.mark.parametrize(
    ("answers", "closes_after", "said"),
    [
        (lambda _: [], None, "no answer to"),
        (lambda _: [b"half a line"], None, "no answer to"),
        (lambda _: [b"half a line"], 1, "closed the connection instead of answering"),
        (lambda _: [b"x" * 600_000] * 2, None, "has more than 1048576 bytes"),
    ],
)
def test_without_a_reply_there_is_one_line_and_the_connection_is_not_used_again(
    answers: Answers, closes_after: int | None, said: str
) -> None:
    with instrument(answers, closes_after=closes_after) as address:
        client = ScpiClient(*address, timeout_s=0.3)
        began_s = time.monotonic()
        with pytest.raises(ScpiError, match=said):
            client.ask("*IDN?")
        assert time.monotonic() - began_s < 2.0
        with pytest.raises(ScpiError, match="the connection is closed"):
            client.ask("*IDN?")


def test_a_reply_that_trickles_in_for_ever_ends_in_time() -> None:
    with instrument(lambda _: [b"x"] * 1000, pause_s=0.01) as address:
        client = ScpiClient(*address, timeout_s=0.3)
        began_s = time.monotonic()
        with pytest.raises(ScpiError, match="no answer to"):
            client.ask("*IDN?")
        assert time.monotonic() - began_s < 1.0
        client.close()


def test_a_command_is_done_when_the_queue_of_errors_says_so() -> None:
    heard: list[tuple[str, bytes]] = []
    replies = iter([b'0,"No error"\n', b'-108,"Parameter not allowed"\n'])
    with instrument(lambda line: [next(replies)] if line.startswith(b":SYST") else []) as address:
        client = ScpiClient(*address, timeout_s=1.0, heard=lambda who, line: heard.append((who, line)))
        client.do(":DST:INIT 1")
        with pytest.raises(ScpiError, match="it answers to ':DST:START 1': -108"):
            client.do(":DST:START 1")
        client.close()
    assert heard[:3] == [("host", b":DST:INIT 1"), ("host", b":SYST:ERR:ALL?"), ("recorder", b'0,"No error"')]


def test_nobody_there_is_an_error_and_a_command_is_one_line() -> None:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    with pytest.raises(OSError, match="refused"):
        ScpiClient("127.0.0.1", port)
    with instrument(lambda _: []) as address:
        client = ScpiClient(*address)
        with pytest.raises(ValueError, match="one line"):
            client.do(":STOR:FILE:NAME x\n:STOR:STOP")
        client.close()


@pytest.mark.parametrize(
    ("reply", "values"),
    [
        ("", ()), ("NONE", ("NONE",)), ("Started", ("Started",)), ('"a","b"', ("a", "b")), ("1,,2", ("1", "", "2")),
        ('("1","P (brl), muzzle"),("2","b")', (("1", "P (brl), muzzle"), ("2", "b"))),
        ('(SCALAR,200000.0,"Hz")', (("SCALAR", "200000.0", "Hz"),)), ('"say ""x"""', ('say "x"',)),
        ("()", ((),)), ('SCPI,"1999.0",RC_SCPI,"1.10"', ("SCPI", "1999.0", "RC_SCPI", "1.10")), ('""', ("",)),
    ],
)  # fmt: skip
def test_replies_are_taken_apart_as_they_are_written(reply: str, values: tuple[object, ...]) -> None:
    assert parse_reply(reply) == values


@pytest.mark.parametrize("reply", ['"open', "(a", "a)", "(" * 12 + ")" * 12])
def test_what_does_not_close_is_refused(reply: str) -> None:
    with pytest.raises(ValueError, match=r"close|too many|within"):
        parse_reply(reply)


@given(st.text(max_size=60))
def test_any_reply_is_values_or_a_value_error(reply: str) -> None:
    with suppress(ValueError):
        assert isinstance(parse_reply(reply), tuple)


@given(st.lists(st.text(st.characters(exclude_characters="\n\r"), max_size=12), min_size=1, max_size=4))
def test_texts_in_quotes_come_back_as_they_were(texts: list[str]) -> None:
    assert parse_reply(",".join(map(quoted_text, texts))) == tuple(texts)


def test_the_longest_reply_is_a_megabyte() -> None:
    assert scpi.LONGEST_REPLY == 1 << 20
