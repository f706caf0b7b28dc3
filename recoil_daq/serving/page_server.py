"""The server of the pages, in this process or in one beside an armed session."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from recoil_acquisition.errors import ErrorCode, ReadError
from recoil_acquisition.packages.extras import SERVE
from recoil_acquisition.processes.child_process import BELOW_NORMAL
from recoil_daq.serving.access import Access
from recoil_daq.serving.page_app import PageApp
from recoil_daq.serving.served_folder import ServedFolder

LISTEN, PORT = "127.0.0.1", 8750
MOST_CONNECTIONS = 512
"""Connections beyond which a request is answered with 503."""
LONGEST_HEAD_BYTES = 16_384
LAST_LOOKS_S = 2.5
"""Time after the end of a session for which its last state is served, s: pages look at it once a second."""
_CLOSE_WITHIN_S = 6.0


def require_server() -> None:
    """Raise `ReadError` if the library that serves is not installed."""
    if not SERVE.is_installed:
        raise ReadError(
            f"{SERVE.module}, which serves pages, is not installed", code=ErrorCode.NOT_INSTALLED, remedy=SERVE.remedy
        )


def bound(listen: str, port: int) -> socket.socket:
    """Return a socket that listens.

    Raises
    ------
    ReadError
        If the address is none of this computer's, or its port is taken.
    """
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(listen, port, type=socket.SOCK_STREAM)[0]
        opened = socket.socket(family, kind, protocol)
        if sys.platform != "win32":
            opened.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            opened.bind(address)
            opened.listen(128)
        except OSError:
            opened.close()
            raise
    except (OSError, UnicodeError) as error:
        raise ReadError(
            f"no page can be served at {listen}, port {port}: {getattr(error, 'strerror', None) or error}",
            remedy="give another --port (0 takes any that is free), or an address of this computer as --listen",
        ) from error
    return opened


def _bound_beside(listen: str, port: int) -> socket.socket:
    """Return a socket for a session, whose page is wanted at another port, too, where that one is taken."""
    try:
        return bound(listen, port)
    except ReadError:
        return bound(listen, 0)


def address_of(access: Access) -> str:
    """Return the address to open, with its token."""
    host = _outward() if access.listen in ("0.0.0.0", "::") else access.listen  # noqa: S104 - compared, not bound
    host = f"[{host}]" if ":" in host else host
    return f"http://{host}:{access.port}/" + (f"?token={access.token}" if access.token else "")


def _outward() -> str:
    """Return the address of this computer by which others reach it; its name where it has none. Nothing is sent."""
    with suppress(OSError), socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.connect(("192.0.2.1", 9))  # an address of documents, to which nothing goes
        return str(probe.getsockname()[0])
    return socket.gethostname()


def serve_folder(folder: Path, listen: str, port: int, told: Callable[[str], None], *, while_asked: bool) -> None:
    """Serve the pages of a folder until it is interrupted.

    Parameters
    ----------
    told
        Function called with the address, once it is listened at.
    while_asked
        Whether it ends when whoever started it does, and takes any port where that one is taken.

    Raises
    ------
    ReadError
        If there is no such folder, the address cannot be listened at, or the library is not installed.
    """
    require_server()
    if not folder.is_dir():
        raise ReadError("no such folder to serve", path=folder, remedy="give the folder of a day at the range")
    import uvicorn

    with _bound_beside(listen, port) if while_asked else bound(listen, port) as opened:
        access = Access.of(listen, opened.getsockname()[1])
        config = uvicorn.Config(
            PageApp(ServedFolder(folder), access), http="h11", ws="none", lifespan="off", access_log=False,
            log_level="error", server_header=False, proxy_headers=False, limit_concurrency=MOST_CONNECTIONS,
            h11_max_incomplete_event_size=LONGEST_HEAD_BYTES, timeout_graceful_shutdown=1,
        )  # fmt: skip
        server = uvicorn.Server(config)
        if while_asked:

            def watch() -> None:
                sys.stdin.buffer.read()
                time.sleep(LAST_LOOKS_S)
                server.should_exit = True

            threading.Thread(target=watch, name="wait for the session's end", daemon=True).start()
        told(address_of(access))
        server.run(sockets=[opened])


@contextmanager
def served_beside(folder: Path, notice: Callable[[str], None]) -> Iterator[None]:
    """Serve the pages of a folder from another process, which ends with this one; it keeps no recording waiting.

    Parameters
    ----------
    notice
        Function called with the address, or with why nothing is served.
    """
    apart: dict[str, Any] = {"process_group": 0}
    if sys.platform == "win32":
        apart = {"creationflags": subprocess.CREATE_NEW_PROCESS_GROUP | subprocess.BELOW_NORMAL_PRIORITY_CLASS}
    process = subprocess.Popen(  # noqa: S603 - this program itself, without a shell
        [sys.executable, "-P", "-m", "recoil_daq.cli", "serve", "--while-asked", "--", str(folder)],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, encoding="utf-8",
        errors="replace", **apart,
    )  # fmt: skip
    if sys.platform != "win32":
        os.setpriority(os.PRIO_PROCESS, process.pid, BELOW_NORMAL)

    def tell() -> None:
        line = "" if process.stdout is None else process.stdout.readline().strip()
        notice(f"page: {line}" if line.startswith("http") else f"no page is served: {line}")

    threading.Thread(target=tell, name="address of the page", daemon=True).start()
    try:
        yield
    finally:
        if process.stdin is not None:
            process.stdin.close()
        try:
            process.wait(_CLOSE_WITHIN_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        if process.stdout is not None:
            process.stdout.close()
