"""What a child process does in the tests of it: by its first argument."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

from recoil_acquisition.processes.child_process import put, take


def main(what: str, *rest: str) -> None:
    if what == "turn":
        sys.stdout.write(sys.stdin.read()[::-1])
    elif what == "fail":
        sys.exit("something else\nno such thing")
    elif what == "much":
        sys.stdout.write(3_000_000 * "x")
    elif what == "linger":  # with a process of its own
        with subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"]) as other:
            Path(rest[0]).write_text(str(other.pid), encoding="utf-8")
            time.sleep(60.0)
    elif what == "serve":
        kind, content = take(sys.stdin.buffer)
        put(sys.stdout.buffer, kind, content.upper())
        sys.stdout.buffer.write(b"half")
        sys.stderr.write("it is done\n")


if __name__ == "__main__":
    main(*sys.argv[1:])
