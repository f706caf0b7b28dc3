"""All that can be done with two shots of a rig, one command after another, as far as the rig lets it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from typer.testing import CliRunner

from recoil_daq.cli import app
from recoil_daq.terminal.session import FAULT, NOT_VALID, OK
from recoil_identification.targets import TARGETS

ADDED = ("added_mass_kg=120", "u_added_mass_kg=0.05")


class Done(NamedTuple):
    """What a command line came to."""

    words: tuple[str, ...]
    exit_code: int
    output: str

    @property
    def fault(self) -> str:
        """Why no command may end so; empty if one may: done, done and not valid, or refused in one line."""
        if self.exit_code not in (OK, NOT_VALID, FAULT):
            return f"exit code {self.exit_code}"
        refusals = [line for line in self.output.splitlines() if line.startswith("error: ")]
        if self.exit_code == FAULT and len(refusals) != 1:
            return "no line says why"
        odd = [word for word in ("Traceback", "NoneType", "TypeError", "KeyError", "ValueError") if word in self.output]
        return f"says {odd[0]}" if odd else ""


def whole_way(rig: Path, files: Sequence[Sequence[Path]], folder: Path, *, all_targets: bool = True) -> Iterator[Done]:
    """Yield what each command came to; the shots but the first carry `ADDED`.

    Parameters
    ----------
    files
        Of each shot.
    folder
        Gets all that is written.
    all_targets
        Whether the targets beside the mass are identified too.
    """
    shots, reports, out = folder / "shots", folder / "reports", ("--out", folder)

    def run(*words: object) -> Done:
        texts = tuple(map(str, words))
        result = CliRunner().invoke(app, texts)
        crash = "" if result.exception is None or isinstance(result.exception, SystemExit) else repr(result.exception)
        return Done(texts, result.exit_code if not crash else -1, result.output + crash)

    yield run("check", rig, *files[0])
    for number, one in enumerate(files, start=1):
        ingested = run("ingest", rig, *one, "--shot", f"{number:04d}", "--out", shots)
        yield ingested
        if ingested.exit_code == FAULT:
            return
        if number > 1:
            yield run("log", f"{number:04d}", *ADDED, "--dir", shots)
    first = shots / "0001.h5"
    yield run("show", first)
    yield run("identify", shots, "--out", reports, "--workers", 1)
    yield run("campaign", shots, "--reports", reports, "--out", folder / "campaign", "--workers", 1)
    yield run("predict", rig, "--from", first)
    if reports.is_dir():
        yield run("explain", "--check", reports, "--workers", 1)
    yield run("identify", first, "--rig", rig, "--out", folder / "with-rig")
    yield run("export", first, "--format", "csv", *out)
    if all_targets:
        yield run("identify", first, "--compare", "--out", folder / "compared")
        for target in TARGETS:
            yield run("identify", first, "--target", target, "--out", folder / target)
