"""One table of a declared framing, read strictly."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

from recoil_acquisition.errors import nearest_first


class Table:
    """One table of a framing: takes values out and gathers what is wrong with them."""

    def __init__(self, value: Any, where: str, known: Sequence[str] | set[str], faults: list[str]) -> None:
        self.faults, self.where = faults, where
        self.values: Mapping[str, Any] = value if isinstance(value, Mapping) else {}
        if not isinstance(value, Mapping):
            self.fault("", f"must be a table, found {value!r}")
        for key in self.values:
            if key not in known:
                self.fault(key, f"unknown key; did you mean `{nearest_first(str(key), sorted(known))[0]}`?")

    def fault(self, key: str, problem: str) -> None:
        """Note a fault."""
        self.faults.append(f"{'.'.join(part for part in (self.where, key) if part)}: {problem}")

    def table(self, key: str, known: set[str]) -> Table:
        """Take a table within this one."""
        return Table(self.values[key], f"{self.where}.{key}", known, self.faults)

    def whole(self, key: str, default: int | None = None, lowest: int = 0, highest: int = 2**31 - 1) -> int:
        """Take a whole number; required if there is no default."""
        value = self.values.get(key, default)
        if isinstance(value, bool) or not isinstance(value, int) or not lowest <= value <= highest:
            too_large = isinstance(value, int) and value > highest
            limit = f"up to {highest}" if too_large else f"from {lowest}"
            self.fault(key, "is missing" if value is None else f"must be a whole number {limit}, found {value!r}")
            return lowest if default is None else max(default, lowest)
        return value

    def whole_by_hex(self, key: str, size: int) -> Mapping[int, int]:
        """Take a table of whole numbers by values of ``size`` bytes, written in hexadecimal; empty if missing."""
        if key not in self.values:
            return MappingProxyType({})
        numbers = self.values[key]
        found = {}
        if not isinstance(numbers, Mapping) or not numbers:
            self.fault(key, f'must be a table such as {{ "49" = 9 }}, found {numbers!r}')
            return MappingProxyType({})
        for text, number in numbers.items():
            try:
                value = int.from_bytes(bytes.fromhex(str(text)), "big")
            except ValueError:
                value = -1
            if not 0 <= value < 256**size:
                self.fault(key, f"{text!r} is no value of {size} bytes in hexadecimal")
            elif isinstance(number, bool) or not isinstance(number, int) or number < 1:
                self.fault(key, f"the length for {text!r} must be a whole number from 1, found {number!r}")
            else:
                found[value] = number
        return MappingProxyType(found)

    def number(self, key: str, default: float | None = None, *, positive: bool = False) -> float:
        """Take a finite number; required if there is no default."""
        value = self.values.get(key, default)
        if (
            isinstance(value, bool)
            or not isinstance(value, int | float)
            or not math.isfinite(value)
            or (positive and key in self.values and value <= 0)
        ):
            self.fault(
                key,
                "is missing"
                if value is None
                else f"must be a {'positive' if positive else 'finite'} number, found {value!r}",
            )
            return 1.0 if default is None else default
        return float(value)

    def choice(self, key: str, known: Sequence[str], default: str | None = None) -> str:
        """Take one of some words; required if there is no default."""
        value = self.values.get(key, default)
        if value not in known:
            self.fault(key, "is missing" if value is None else f"must be one of {', '.join(known)}, found {value!r}")
            return known[0]
        return str(value)

    def text(self, key: str, default: str | None = None) -> str:
        """Take a text that is not empty; required if there is no default."""
        value = self.values.get(key, default)
        if not isinstance(value, str) or (not value and key in self.values) or value is None:
            self.fault(key, "is missing" if value is None else f"must be a text, found {value!r}")
            return "?"
        return value

    def flag(self, key: str) -> bool:
        """Take true or false; false if it is missing."""
        value = self.values.get(key, False)
        if not isinstance(value, bool):
            self.fault(key, f"must be true or false, found {value!r}")
        return value is True

    def hex_bytes(self, key: str) -> bytes:
        """Take bytes written in hexadecimal, such as ``AA 55``."""
        try:
            value = bytes.fromhex(self.values.get(key, ""))
        except (ValueError, TypeError):
            value = b""
        if not value:
            self.fault(key, f'must be bytes in hexadecimal, such as "AA 55", found {self.values.get(key)!r}')
        return value or b"\0"
