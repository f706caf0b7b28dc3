"""Pieces of work that worker processes are given, where a shot would take too long."""

from __future__ import annotations

import os
import signal
import sys
import time
from pathlib import Path

from recoil_acquisition.errors import MissingChannelError, ReadError


def square(number: int) -> int:
    return number * number


def slow_first(number: int) -> int:
    """The first takes longest."""
    time.sleep(0.3 if number == 0 else 0.0)
    return number


def process(_: int) -> tuple[int, str, bool]:
    """Its process, the threads of its linear algebra, and whether it has loaded that without being asked."""
    time.sleep(0.1)
    return os.getpid(), os.environ.get("OPENBLAS_NUM_THREADS", ""), "numpy" in sys.modules


def refuse_odd(number: int) -> int:
    if number % 2:
        raise MissingChannelError(f"acc_{number}", ["acc_0"], path=Path(f"{number}.csv"))
    return number


def fail(number: int) -> int:
    raise ZeroDivisionError(number)


def crash_on_three(number: int) -> int:
    if number == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def crash_once(path: Path) -> str:
    """End the process that does it the first time, as what takes memory that another process wanted too."""
    if not path.exists():
        path.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return path.name


def crash_where_asked(folder: Path) -> str:
    """Say which process is at work, wait until somebody ended one, and be done."""
    (folder / f"{os.getpid()}.begun").touch()
    while not (folder / "go on").exists():
        time.sleep(0.01)
    return "done"


def half_written(folder: Path) -> None:
    """Write for a minute, and take away what is half written if interrupted."""
    half = folder / f"{os.getpid()}.partial"
    half.touch()
    try:
        time.sleep(60.0)
    finally:
        half.unlink()


def refuse_all(path: Path) -> None:
    raise ReadError("this is no file", path=path)


def told(task: tuple[Path, str, float]) -> None:
    """Say in a file that it is begun and done, with so many seconds between."""
    log, name, lasting_s = task
    with log.open("a") as file:
        file.write(f"{name} begun\n")
    time.sleep(lasting_s)
    with log.open("a") as file:
        file.write(f"{name} done\n")


def ending(_: None) -> None:
    """End the process, whichever does it."""
    os.kill(os.getpid(), signal.SIGKILL)
