"""Several commands, one after the other, in one process of their own: what it imports is imported once."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

PROGRAM = """
import io, json, sys
from contextlib import redirect_stdout
from recoil_daq.cli import main

def done(words):
    sys.argv[1:] = words
    with redirect_stdout(io.StringIO()) as out:
        try:
            main()
        except SystemExit as end:
            return end.code or 0, out.getvalue(), list(sys.path)
    return 0, out.getvalue(), list(sys.path)

print(json.dumps([done(words) for words in json.load(sys.stdin)]))
"""


class Done(NamedTuple):
    """What became of a command: its exit code, what it printed, and where Python looked for modules behind it."""

    code: int
    out: str
    path: list[str]


def own_commands(
    *commands: tuple[object, ...], cwd: Path | None = None, env: Mapping[str, str] | None = None
) -> list[Done]:
    """Run command lines in one process of this program's own kind, which looks for no modules in its folder.

    Parameters
    ----------
    cwd
        Its working folder.
    env
        Its environment.
    """
    words = json.dumps([[*map(str, command)] for command in commands])
    done = subprocess.run(
        [sys.executable, "-P", "-c", PROGRAM],
        input=words,
        cwd=cwd,
        env=env,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return [Done(*each) for each in json.loads(done.stdout)]
