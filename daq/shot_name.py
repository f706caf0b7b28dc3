"""Which names a shot may bear: files and folders are named after it, on every system that they are copied to."""

from __future__ import annotations

import re

LONGEST_BYTES = 128
"""File systems take names of 255 bytes; sources' names, endings and those of temporary files are put round a shot's."""

_RESERVED = re.compile(r"(CON|PRN|AUX|NUL|(COM|LPT)[0-9¹²³])(\..*)?", re.IGNORECASE)


def shot_name_fault(name: str) -> str | None:
    """Say why a shot cannot bear a name.

    Parameters
    ----------
    name : str
        From a command line, a record of an acquisition or a shot file: from anywhere.

    Returns
    -------
    str or None
        The problem in words that follow the name; None if there is none.
    """
    if not name:
        return "is empty"
    if len(name.encode(errors="surrogatepass")) > LONGEST_BYTES:
        return f"is longer than {LONGEST_BYTES} bytes: the files that are named after it would not all have room"
    if unsafe := re.search(r"[^\w.+-]", name):
        return f"holds {unsafe.group()!r}: letters, digits, `_`, `-`, `+` and `.` are safe in file names everywhere"
    if name[0] in "-.":
        return f"begins with `{name[0]}`: it would be taken for {'an option' if name[0] == '-' else 'a hidden file'}"
    if name[-1] == ".":
        return "ends with `.`: Windows takes such an ending away"
    if _RESERVED.fullmatch(name):
        return "is a word that Windows reserves for a device"
    return None


def check_shot_name(name: str) -> None:
    """Raise ValueError where a shot cannot bear a name."""
    if fault := shot_name_fault(name):
        raise ValueError(f"the shot's name {name!r} {fault}")
