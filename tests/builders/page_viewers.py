"""Viewers of a day's page: `serve` in a process of its own, some who ask once a second, and many who ask nothing."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import threading
import urllib.request
from pathlib import Path
from types import TracebackType


class PageViewers:
    """Viewers of a folder's live page, as long as the context lasts.

    Attributes
    ----------
    answers, failures
        Number of states that were read, and of requests that were not answered.
    """

    def __init__(self, folder: Path, viewers: int, idle: int = 0) -> None:
        self._folder, self._viewers, self._idle = folder, viewers, idle
        self.answers = self.failures = 0
        self._ended = threading.Event()

    def __enter__(self) -> PageViewers:
        command = [sys.executable, "-P", "-m", "recoil_daq.cli", "serve", str(self._folder), "--port", "0"]
        self._process = subprocess.Popen(command, stdout=subprocess.PIPE, encoding="utf-8")
        assert self._process.stdout is not None
        self.address = self._process.stdout.readline().strip()
        host, port = self.address.removeprefix("http://").rstrip("/").split(":")
        self._sockets = [socket.create_connection((host, int(port)), timeout=10) for _ in range(self._idle)]
        self._threads = [threading.Thread(target=self._look, daemon=True) for _ in range(self._viewers)]
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._ended.set()
        for thread in self._threads:
            thread.join(10)
        for one in self._sockets:
            one.close()
        self._process.terminate()
        self._process.wait(10)
        if self._process.stdout is not None:
            self._process.stdout.close()

    @property
    def cpu_s(self) -> float:
        """Time of processor that the server took so far, s."""
        stat = Path(f"/proc/{self._process.pid}/stat").read_text(encoding="ascii")
        fields = stat.rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def _look(self) -> None:
        while not self._ended.wait(1.0):
            try:
                with urllib.request.urlopen(f"{self.address}live.js?x", timeout=10) as answer:  # noqa: S310
                    self.answers += answer.read().startswith(b"window.live = ")
            except OSError:
                self.failures += 1
