"""Output of the commands ``day`` and ``pack``, and of ``explain --check`` of an archive."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from recoil_acquisition.errors import quoted
from recoil_daq.terminal.report import print_index
from recoil_daq.terminal.tables import print_table, say


def print_day(document: Mapping[str, Any]) -> None:
    """Print the document of ``day --json``: a row a shot, their campaign, what was lost, what to copy."""
    if document["campaign"]["text"]:
        say(document["campaign"]["text"])
    if document["lost"]:
        print_table("What was lost", ("of", "what"), [(one["of"], one["text"]) for one in document["lost"]])
    rows = [(one["path"], str(one["files"]), f"{one['bytes'] / 1e6:.1f}", one["what"]) for one in document["copy"]]
    print_table("What to copy", ("path", "files", "MB", "what it is"), rows, numeric=(1, 2))
    command = document["archive"]
    say(f"or all of it as one archive: `{command}`")
    print_index(document)


def print_packed(document: Mapping[str, Any]) -> None:
    """Print the document of ``pack --json``: what is in the archive, and how it is checked."""
    for name in document["left_out"]:
        say(f"not in it, since it is no regular file: {name}")
    say(f"{document['files']} files, {document['size_bytes'] / 1e6:.1f} MB -> {document['archive']}")
    say(f"SHA-256 {document['sha256']}")
    say(f"check it where it was copied to with `recoil-daq explain {quoted(document['archive'])} --check`")


def print_checked_archive(document: Mapping[str, Any]) -> None:
    """Print the document of ``explain --check --json`` of an archive: what is not as it was packed."""
    files = document["files"]
    bad = [(one["file"], "fail", one["fault"]) for one in files if one["fault"]]
    if bad:
        print_table(f"Not as packed in {document['archive']}", ("file", "verdict", "what"), bad)
    say(f"{len(files) - len(bad)} of {len(files)} files are as they were packed")
