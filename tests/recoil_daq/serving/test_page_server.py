"""The server of the pages as a process: its address first, then answers to many, and none that hang on one."""

from __future__ import annotations

import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import pytest

from recoil_acquisition.errors import ReadError
from recoil_daq.serving.page_server import bound, require_server
from tests.builders.state_writer import STATE

READERS, VIEWERS = 200, 5


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, Path, subprocess.Popen[str]]]:
    folder = tmp_path_factory.mktemp("served")
    STATE.write_to(folder)
    command = [sys.executable, "-P", "-m", "recoil_daq.cli", "serve", str(folder), "--port", "0"]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, encoding="utf-8"
    ) as process:
        assert process.stdout is not None
        yield process.stdout.readline().strip(), folder, process
        process.terminate()


def read(address: str) -> bytes:
    with urllib.request.urlopen(address, timeout=10) as answer:  # noqa: S310 - of this machine
        return answer.read()


@pytest.mark.real_time
def test_the_address_is_the_first_line_and_leads_to_the_live_page(served) -> None:
    address, _, _ = served
    assert address.startswith("http://127.0.0.1:")
    assert b"<title>Live range</title>" in read(address)
    assert json.loads(read(f"{address}live.js").removeprefix(b"window.live = ").rstrip(b";\n"))["state"] == "armed"


@pytest.mark.real_time
def test_many_who_ask_nothing_or_read_nothing_keep_nobody_waiting(served) -> None:
    address, folder, _ = served
    (folder / "large.js").write_bytes(b"x" * (4 << 20))
    host, port = address.removeprefix("http://").rstrip("/").split(":")
    idle = [socket.create_connection((host, int(port)), timeout=10) for _ in range(READERS)]
    try:
        for number, one in enumerate(idle):
            if number % 2:
                one.sendall(f"GET /large.js HTTP/1.1\r\nHost: {host}:{port}\r\n\r\n".encode())
        began_s = time.monotonic()
        assert read(f"{address}live.js")
        assert time.monotonic() - began_s < 5.0
    finally:
        for one in idle:
            one.close()


@pytest.mark.real_time
@pytest.mark.parametrize(
    "sent",
    [
        b"\x00\xff\r\n\r\n",
        b"GET /live.html\r\n\r\n",
        b"GET /live.html HTTP/1.1\r\nHost: 127.0.0.1\r\nX: " + b"y" * 200_000 + b"\r\n\r\n",
        b"GET /" + b"a" * 200_000 + b" HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n",
        b"GET /%zz%.html HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n",
        b"GET /live.html HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: websocket\r\nOrigin: http://evil.example\r\n\r\n",
    ],
)  # fmt: skip
def test_what_is_no_request_is_refused_and_the_next_one_answered(served, sent: bytes) -> None:
    address, _, _ = served
    host, port = address.removeprefix("http://").rstrip("/").split(":")
    with socket.create_connection((host, int(port)), timeout=10) as one:
        one.sendall(sent)
        answer = one.recv(1 << 16)
    status = int(answer.split()[1]) if answer else 400
    assert 400 <= status < 500
    assert b"Live range" not in answer
    assert read(f"{address}live.js")


@pytest.mark.real_time
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
def test_five_viewers_cost_little(served) -> None:
    address, _, process = served
    began, used = time.monotonic(), _cpu_s(process.pid)
    while time.monotonic() - began < 4.0:
        for _ in range(VIEWERS):
            read(f"{address}live.js?x")
        time.sleep(1.0)
    share = (_cpu_s(process.pid) - used) / (time.monotonic() - began)
    print(f"\nfive viewers: {100 * share:.2f} % of a core")
    assert share < 0.02


def _cpu_s(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


@pytest.mark.real_time
def test_nothing_is_printed_but_the_address(served) -> None:
    address, _, process = served
    with pytest.raises(urllib.error.HTTPError, match="404"):
        read(f"{address}none.html")
    process.send_signal(signal.SIGTERM)
    assert process.wait(10) in (0, -signal.SIGTERM, 143)
    assert process.stderr.read() == ""


def test_a_port_that_is_taken_is_said_in_one_line() -> None:
    with bound("127.0.0.1", 0) as one, pytest.raises(ReadError, match="give another --port"):
        bound("127.0.0.1", one.getsockname()[1])


def test_a_machine_without_the_server_is_told_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "uvicorn", None)
    with pytest.raises(ReadError, match="pip install 'uvicorn"):
        require_server()


@pytest.mark.real_time
def test_a_program_gets_the_address_as_a_document(tmp_path: Path) -> None:
    command = [sys.executable, "-P", "-m", "recoil_daq.cli", "serve", str(tmp_path), "--port", "0", "--json"]
    with subprocess.Popen(
        [*command, "--listen", "0.0.0.0"],  # noqa: S104 - with a token
        stdout=subprocess.PIPE,
        encoding="utf-8",
    ) as process:
        assert process.stdout is not None
        told = json.loads(process.stdout.readline())
        process.terminate()
    assert told["schema"] == "recoil-daq/serve/1"
    assert re.fullmatch(r"http://\S+:\d+/\?token=[\w-]{22}", told["address"])


@pytest.mark.real_time
def test_beside_a_session_it_takes_another_port_and_ends_with_that(tmp_path: Path) -> None:
    with bound("127.0.0.1", 0) as taken:
        port = taken.getsockname()[1]
        command = [sys.executable, "-P", "-m", "recoil_daq.cli", "serve", str(tmp_path), "--port", str(port)]
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "encoding": "utf-8"}
        with subprocess.Popen([*command, "--while-asked"], **pipes) as process:
            assert process.stdout is not None
            assert process.stdin is not None
            assert process.stdout.readline().startswith("http://127.0.0.1:")
            process.stdin.close()
            assert process.wait(10) == 0


def test_a_folder_that_is_not_there_is_refused_in_one_line(run, tmp_path: Path) -> None:
    done = run("serve", tmp_path / "none")
    assert done.exit_code == 3
    assert "no such folder to serve" in done.output
    assert done.output.count("error: ") == 1
