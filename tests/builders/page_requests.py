"""Requests to the pages' application, as a server hands them over, and what it answers."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from recoil_daq.serving.access import Access
from recoil_daq.serving.page_app import PageApp
from recoil_daq.serving.served_folder import ServedFolder

HOST = "127.0.0.1:8750"


@dataclass(frozen=True)
class Answer:
    """Answer of the application."""

    status: int
    headers: dict[str, str]
    body: bytes


def asked(
    folder: Path,
    target: str | bytes,
    *,
    method: str = "GET",
    headers: Sequence[tuple[str, str]] = (("host", HOST),),
    access: Access | None = None,
) -> Answer:
    """Ask the application for a target: a path as it stands in a request, with what is asked behind it."""
    path, _, question = (target if isinstance(target, bytes) else target.encode("latin-1")).partition(b"?")
    scope = {
        "type": "http", "method": method, "raw_path": path, "query_string": question,
        "headers": [(name.encode("latin-1"), value.encode("latin-1")) for name, value in headers],
    }  # fmt: skip
    sent: list[dict[str, Any]] = []

    async def send(message: dict[str, Any]) -> None:
        sent.append(message)

    app = PageApp(ServedFolder(folder), access or Access("127.0.0.1", 8750, None))
    asyncio.run(app(scope, None, send))
    start, *pieces = sent
    assert start["type"] == "http.response.start"
    assert [piece.get("more_body", False) for piece in pieces][-1] is False
    told = {name.decode(): value.decode("latin-1") for name, value in start["headers"]}
    return Answer(start["status"], told, b"".join(piece["body"] for piece in pieces))
