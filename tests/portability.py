"""Install this checkout as users do, in empty environments elsewhere, and run it there.

``python -m tests.portability`` builds wheel and sdist. With each of them, with the oldest versions of what it needs and
with every other Python that it finds it makes a virtual environment, installs, and runs the demonstration there. Beside
the wheel each command that needs an extra must say in one line what to install, and must work with all extras. It takes
a package registry, and `uv` for the oldest versions. ``--only NAME`` takes one part (repeatable), ``--python PATH``
names another interpreter.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable
from pathlib import Path

from recoil_acquisition.packages.extras import CLUSTER, DEWESOFT, EXTRAS, MDF, PARQUET, PDF, SERVE, TDMS, XLSX, Extra

ROOT = Path(__file__).resolve().parents[1]
OTHERS = ("python3.11", "python3.12", "python3.13", "python3.14")
BIN, SUFFIX = ("Scripts", ".exe") if os.name == "nt" else ("bin", "")
SHOT = "demo/shots/0001.h5"
NEEDS: tuple[tuple[Extra, tuple[str, ...]], ...] = (
    (MDF, ("export", SHOT, "--format", "mdf4")),
    (TDMS, ("export", SHOT, "--format", "tdms")),
    (PARQUET, ("export", SHOT, "--format", "parquet")),
    (PDF, ("identify", SHOT, "--pdf", "--figures", "--out", "on paper")),
    (XLSX, ("show", "tracks.xlsx")),
    (DEWESOFT, ("show", "shot.dxd")),
    (CLUSTER, ("identify", SHOT, "--cluster", "tcp://127.0.0.1:1", "--out", "elsewhere")),
    (SERVE, ("serve", "none")),
)
"""Commands that need an extra; the last four have nothing to read or to reach, and say that when it is there."""


class Environment:
    """A virtual environment in a folder of its own, and an empty folder to work in."""

    def __init__(self, folder: Path, python: str = sys.executable) -> None:
        self.work, self.python = folder / "work", folder / "venv" / BIN / f"python{SUFFIX}"
        self.work.mkdir(parents=True)
        run(python, "-m", "venv", folder / "venv", cwd=folder)

    def install(self, *words: object) -> None:
        """Install by pip."""
        run(self.python, "-m", "pip", "install", "-q", *words, cwd=self.work)

    def command(self, *words: object, code: int = 0) -> str:
        """Run recoil-daq, expect an exit code, and return what it printed."""
        return run(self.python.with_name(f"recoil-daq{SUFFIX}"), *words, cwd=self.work, code=code)

    def demonstrate(self) -> str:
        """Run the demonstration, and a command whose options may be repeated; return the last line of the former."""
        for written in ("demo", "again"):
            shutil.rmtree(self.work / written, ignore_errors=True)
        last = self.command("demo").splitlines()[-1]
        self.command("identify", SHOT, "--out", "again")
        return last


def run(*words: object, cwd: Path, code: int = 0) -> str:
    """Run a program, without this checkout on its path; return what it printed.

    Raises
    ------
    RuntimeError
        If its exit code is another one than what is expected.
    """
    alone = {key: value for key, value in os.environ.items() if key not in ("PYTHONPATH", "VIRTUAL_ENV")}
    done = subprocess.run(
        [str(word) for word in words], cwd=cwd, env=alone, capture_output=True, text=True, check=False
    )
    if done.returncode != code:
        raise RuntimeError(f"{' '.join(map(str, words))}: exit code {done.returncode}\n{done.stdout}{done.stderr}")
    return done.stdout + done.stderr


def built(folder: Path, kind: str) -> Path:
    """Build the wheel or the sdist of this checkout."""
    run(sys.executable, "-m", "hatchling", "build", "-t", kind, "-d", folder / kind, cwd=ROOT)
    (one,) = (folder / kind).iterdir()
    return one


def of(kind: str) -> Callable[[Path, list[str]], Iterable[str]]:
    """Return what installs a built distribution, and demonstrates it."""

    def part(folder: Path, _: list[str]) -> Iterable[str]:
        environment = Environment(folder)
        environment.install(built(folder, kind))
        yield environment.demonstrate()

    return part


def extras(folder: Path, _: list[str]) -> Iterable[str]:
    """Try each command without what it needs, and with it."""
    environment, wheel = Environment(folder), built(folder, "wheel")
    environment.install(wheel)
    environment.demonstrate()
    (environment.work / "tracks.xlsx").write_bytes(b"PK\x03\x04[Content_Types].xml xl/workbook.xml")
    (environment.work / "shot.dxd").write_bytes(b"MULTI_STREAM_FILE_VER" + bytes(4096))
    for extra, words in NEEDS:
        said = environment.command(*words, code=3).strip()
        if said.count("\n") or extra.remedy not in said:
            raise RuntimeError(f"{' '.join(words)} does not say in one line: {extra.remedy}\n{said}")
        yield f"without {extra.name}: {said}"
    environment.install(f"{wheel}[{','.join(EXTRAS)}]")
    for extra, words in NEEDS[:-4]:
        yield f"with {extra.name}: {environment.command(*words).strip().splitlines()[-1]}"
    for extra, words in NEEDS[-4:]:
        said = environment.command(*words, code=3).strip()
        if extra.remedy in said:
            raise RuntimeError(f"{extra.name} is installed, and {' '.join(words)} still says: {said}")
        yield f"with {extra.name}: {said}"


def oldest(folder: Path, _: list[str]) -> Iterable[str]:
    """Install the oldest versions that pyproject.toml allows."""
    environment = Environment(folder)
    uv = shutil.which("uv") or str(Path(sys.executable).with_name(f"uv{SUFFIX}"))
    if not Path(uv).exists():
        yield "left out: uv, which finds the oldest versions, is not installed (pip install uv)"
        return
    for wanted in (ROOT, f"{ROOT}[{','.join(EXTRAS)}]"):
        run(
            uv, "pip", "install", "-q", "--python", environment.python, "--resolution", "lowest-direct", wanted,
            cwd=environment.work,
        )  # fmt: skip
        yield environment.demonstrate()


def interpreters(folder: Path, more: list[str]) -> Iterable[str]:
    """Install the wheel with every Python that is found."""
    wheel = built(folder, "wheel")
    for name in (*OTHERS, *more):
        found = shutil.which(name)
        try:
            version = run(found or name, "--version", cwd=folder).strip() if found else ""
        except RuntimeError:  # a name that only another tool's set-up would make a Python
            version = ""
        if not version:
            yield f"{name}: not here"
            continue
        environment = Environment(folder / Path(name).name / version, str(found))
        environment.install(wheel)
        yield f"{version}: {environment.demonstrate()}"


PARTS = {"wheel": of("wheel"), "sdist": of("sdist"), "extras": extras, "oldest": oldest, "interpreters": interpreters}


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.portability", description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("--only", action="append", choices=PARTS, metavar="NAME", help=", ".join(PARTS))
    parser.add_argument("--python", action="append", default=[], metavar="PATH", help="another interpreter")
    given = parser.parse_args()
    failed = []
    for name in given.only or PARTS:
        with tempfile.TemporaryDirectory(prefix="recoil-daq ") as folder:
            try:
                for line in PARTS[name](Path(folder), given.python):
                    print(f"{name}: {line}", flush=True)
            except RuntimeError as error:
                failed.append(name)
                print(f"{name}: FAILED: {error}", flush=True)
    if failed:
        raise SystemExit(f"failed: {', '.join(failed)}")


if __name__ == "__main__":
    main()
