"""The application that an ASGI server asks: it answers with files of one folder, and keeps nothing of anybody."""

from __future__ import annotations

import asyncio
import base64
import functools
import hashlib
import html
from collections import defaultdict
from collections.abc import Awaitable, Callable, Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from urllib.parse import quote

from recoil_acquisition.errors import visible
from recoil_daq.serving.access import Access
from recoil_daq.serving.served_folder import ServedFile, ServedFolder

_CHUNK_BYTES = 1 << 18
_NEVER_KEPT = "no-store"
_ASKED_ANEW = "no-cache"
_LIVE = b"/live."
"""Beginning of the paths of what is written anew all the time."""
Send = Callable[[dict[str, Any]], Awaitable[None]]


class PageApp:
    """Answers requests for the pages of a folder."""

    def __init__(self, folder: ServedFolder, access: Access) -> None:
        self._folder, self._access = folder, access
        policy = (
            f"default-src 'none'; script-src 'self' {_report_script()}; style-src 'self' 'unsafe-inline'; "
            "img-src 'self' data: blob:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
        )
        self._always = {
            "content-security-policy": policy, "x-content-type-options": "nosniff", "referrer-policy": "no-referrer",
            "cross-origin-resource-policy": "same-origin", "x-frame-options": "DENY",
        }  # fmt: skip

    async def __call__(self, scope: Mapping[str, Any], _receive: object, send: Send) -> None:
        """Answer one request."""
        if scope["type"] != "http":
            return
        headers: dict[str, list[str]] = defaultdict(list)
        for name, value in scope["headers"]:
            headers[name.decode("latin-1").lower()].append(value.decode("latin-1"))
        path, question = scope["raw_path"].partition(b"?")[0], scope["query_string"]
        refused = self._access.refusal(scope["method"], path, question, headers)
        if refused is not None:
            more = {"allow": "GET, HEAD"} if refused.status == 405 else {}
            await self._text(send, refused.status, refused.why, more)
        elif self._access.knows(question):
            await self._remember(send, path)
        elif path == b"/":
            await self._home(send)
        else:
            await self._file(send, path, headers.get("if-none-match", ()))

    async def _file(self, send: Send, path: bytes, known: Sequence[str]) -> None:
        found = await asyncio.to_thread(self._folder.open, path)
        if found is None:
            await self._text(send, 404, "no page of this name is here")
            return
        with found.file:
            kept = {"etag": found.tag, "cache-control": _NEVER_KEPT if path.startswith(_LIVE) else _ASKED_ANEW}
            if found.tag in known:
                await self._send(send, 304, kept, b"")
                return
            await self._begin(send, 200, {**kept, "content-type": found.type, "content-length": str(found.size)})
            await _pour(send, found)

    async def _remember(self, send: Send, path: bytes) -> None:
        """Have the browser keep the token, and take it out of the address.

        A redirection would not do: a browser that came by another page's link sends no strict cookie with it.
        """
        cookie = f"{self._access.cookie}={self._access.token}; Path=/; HttpOnly; SameSite=Strict"
        onward = html.escape("/" + path.decode("latin-1").lstrip("/"))
        page = f'<!doctype html><meta http-equiv="refresh" content="0;url={onward}"><title>recoil-daq</title>'
        await self._page(send, page, {"set-cookie": cookie})

    async def _home(self, send: Send) -> None:
        """Show the first page of the folder, or a list of those below it."""
        home = await asyncio.to_thread(self._folder.home)
        if home is not None:
            await self._send(send, 307, {"location": f"/{home}", "cache-control": _NEVER_KEPT}, b"")
            return
        pages = await asyncio.to_thread(self._folder.reports)
        rows = "".join(f'<li><a href="/{quote(page)}">{html.escape(visible(page))}</a></li>' for page in pages)
        title = html.escape(visible(self._folder.root.name))
        await self._page(
            send,
            '<!doctype html><html lang="en"><meta charset="utf-8">'
            '<meta name="viewport" content="width=device-width, initial-scale=1"><link rel="icon" href="data:,">'
            f"<style>body{{font:16px/1.6 system-ui,sans-serif;margin:2em;color-scheme:light dark}}</style>"
            f"<title>{title}</title><h1>{title}</h1><ul>{rows or '<li>no page is here yet</li>'}</ul>"
            "<p>Not a safety device.</p>",
        )

    async def _page(self, send: Send, page: str, more: Mapping[str, str] | None = None) -> None:
        told = {"content-type": "text/html; charset=utf-8", "cache-control": _NEVER_KEPT}
        await self._send(send, 200, {**told, **(more or {})}, page.encode())

    async def _text(self, send: Send, status: int, text: str, more: Mapping[str, str] | None = None) -> None:
        told = {"content-type": "text/plain; charset=utf-8", "cache-control": _NEVER_KEPT}
        await self._send(send, status, {**told, **(more or {})}, f"{text}\n".encode())

    async def _send(self, send: Send, status: int, headers: Mapping[str, str], body: bytes) -> None:
        await self._begin(send, status, {**headers, "content-length": str(len(body))} if status != 304 else headers)
        await send({"type": "http.response.body", "body": body})

    async def _begin(self, send: Send, status: int, headers: Mapping[str, str]) -> None:
        listed = [(name.encode(), value.encode("latin-1")) for name, value in {**self._always, **headers}.items()]
        await send({"type": "http.response.start", "status": status, "headers": listed})


async def _pour(send: Send, found: ServedFile) -> None:
    """Send a file piece by piece, as fast as it is taken; of one that grows no more than was promised."""
    left = found.size
    while left > 0:
        piece = await asyncio.to_thread(found.file.read, min(left, _CHUNK_BYTES))
        if not piece:
            break
        left -= len(piece)
        await send({"type": "http.response.body", "body": piece, "more_body": left > 0})
    if left > 0 or found.size == 0:
        await send({"type": "http.response.body", "body": b""})


@functools.cache
def _report_script() -> str:
    """Return the digest of the script that stands in the pages of reports: no other text of a page is run."""
    spec = find_spec("recoil_identification")
    places = (spec.submodule_search_locations if spec is not None else None) or []
    texts = ((Path(place) / "report/page/figures.js").read_text(encoding="utf-8") for place in places)
    digests = (hashlib.sha256(f"\n{text}\n".encode()).digest() for text in texts)
    return " ".join(f"'sha256-{base64.b64encode(digest).decode('ascii')}'" for digest in digests)
