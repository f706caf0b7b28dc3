"""Who may read: requests are refused by their method, host, origin and token before anything of them is looked for."""

from __future__ import annotations

import ipaddress
import re
import secrets
import socket
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from urllib.parse import parse_qs

from recoil_daq.serving.served_folder import LONGEST_PATH

LONGEST_QUESTION = 256
_HOST = re.compile(r"(?:\[(?P<six>[0-9A-Fa-f:.]{2,45})\]|(?P<name>[A-Za-z0-9._-]{1,253}))(?::\d{1,5})?")
_LOCAL = ("localhost", "127.0.0.1", "::1")


@dataclass(frozen=True)
class Refusal:
    """Reason why a request is not answered."""

    status: int
    why: str


@dataclass(frozen=True)
class Access:
    """Rule by which requests are answered.

    Attributes
    ----------
    listen
        Address that is listened at.
    port
        Port that is listened at; the cookie of a token bears it, since browsers keep one for all ports of a host.
    token
        Word without which nothing is answered; None where nobody but this computer can ask.
    """

    listen: str
    port: int
    token: str | None

    @classmethod
    def of(cls, listen: str, port: int) -> Access:
        """Return the rule for an address: beyond this computer a token is asked for."""
        return cls(listen, port, None if is_local(listen) else secrets.token_urlsafe(16))

    @property
    def cookie(self) -> str:
        """Name of the cookie that keeps the token."""
        return f"recoil_daq_{self.port}"

    @cached_property
    def _own_names(self) -> frozenset[str]:
        name = socket.gethostname().lower()
        return frozenset({name, f"{name}.local"})

    def refusal(
        self, method: str, path: bytes, question: bytes, headers: Mapping[str, Sequence[str]]
    ) -> Refusal | None:
        """Return why a request is refused; None if it is answered.

        Parameters
        ----------
        headers
            Values of each header, its name in lower case.
        """
        if method not in ("GET", "HEAD"):
            return Refusal(405, "nothing but GET is answered: these pages are read")
        if len(path) > LONGEST_PATH or len(question) > LONGEST_QUESTION:
            return Refusal(414, "the address is too long")
        hosts = headers.get("host", ())
        if len(hosts) != 1 or not self._is_own(hosts[0]):
            return Refusal(403, "the request names another host: ask by the address that was printed")
        origins = headers.get("origin", ())
        if any(one not in (f"http://{hosts[0]}", f"https://{hosts[0]}") for one in origins):
            return Refusal(403, "another page asks for this one")
        # a script of another page's may be read by that page, and bears no origin
        sites = headers.get("sec-fetch-site", ())
        walked = headers.get("sec-fetch-mode", ()) == ["navigate"] and headers.get("sec-fetch-dest") == ["document"]
        if any(one not in ("same-origin", "none") for one in sites) and not walked:
            return Refusal(403, "another page asks for this one")
        if self.token is not None and not self.knows(question) and not self._keeps(headers.get("cookie", ())):
            return Refusal(403, "the token is missing: open the address that was printed, with its token")
        return None

    def knows(self, question: bytes) -> bool:
        """Return whether a request states the token in its address."""
        if self.token is None:
            return False
        given = parse_qs(question.decode("latin-1")).get("token", [])
        return len(given) == 1 and self._is_token(given[0])

    def _keeps(self, cookies: Sequence[str]) -> bool:
        pairs = (pair.strip().partition("=") for line in cookies for pair in line.split(";"))
        return any(name == self.cookie and self._is_token(value) for name, _, value in pairs)

    def _is_token(self, given: str) -> bool:
        return self.token is not None and secrets.compare_digest(
            given.encode("latin-1", "replace"), self.token.encode()
        )

    def _is_own(self, host: str) -> bool:
        """Return whether a host is this computer: a name that somebody else gave to its address is none."""
        found = _HOST.fullmatch(host)
        if found is None:
            return False
        name = (found["six"] or found["name"]).lower()
        if is_local(self.listen):
            return name in _LOCAL
        return name in _LOCAL or name in self._own_names or _is_address(name)


def is_local(listen: str) -> bool:
    """Return whether nobody but this computer can ask at an address."""
    return listen == "localhost" or (_is_address(listen) and ipaddress.ip_address(listen).is_loopback)


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True
