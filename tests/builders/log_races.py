"""Races on a shot log: commands, a program that saves in place, kills; and what of them is lost."""

from __future__ import annotations

import csv
import io
import os
import random
import subprocess
import sys
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from recoil_acquisition.store.shot_log import SHOT_LOG
from recoil_acquisition.store.shot_log_row import COLUMNS
from tests.builders.saved_logs import saved

_COMMAND = """
import sys
from pathlib import Path
from recoil_daq.recording.shot_log_rows import add_row, log_row

folder, shot, started, *cells = sys.argv[1:]
print("ready", flush=True)
sys.stdin.readline()
if started:
    sys.exit(add_row(Path(folder) / f"{shot}.h5", shot, started) or 0)
log_row(shot, dict(cell.split("=", 1) for cell in cells), folder=Path(folder))
"""
SHOTS = tuple(f"{k:04d}" for k in range(1, 9))
KINDS = ("commands at once", "a slow save in place", "a kill")


class Command:
    """A process that changes a shot's row, as `recoil-daq log` does, or adds it as `ingest` does; it waits for `go`."""

    def __init__(self, folder: Path, shot: str, cells: Mapping[str, str], started: str = "") -> None:
        self.shot = shot
        self.cells = {"time": started} if started else dict(cells)
        words = [str(folder), shot, started, *(f"{key}={text}" for key, text in cells.items())]
        self._process = subprocess.Popen(
            [sys.executable, "-c", _COMMAND, *words], cwd=Path(__file__).resolve().parents[2],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        assert self._process.stdout is not None
        assert self._process.stdout.readline() == "ready\n", self._process.communicate()[1]

    def go(self) -> None:
        """Let it begin."""
        assert self._process.stdin is not None
        self._process.stdin.write("\n")
        self._process.stdin.flush()

    def kill(self) -> None:
        """End it as a power cut or an impatient person does."""
        self._process.kill()

    def done(self) -> bool:
        """Wait for its end, and return whether it said that its row is changed."""
        _, said = self._process.communicate(timeout=300)
        self.said = said
        return self._process.returncode == 0


@dataclass
class Race:
    """What was said done and what a person wrote, by shot and column, and what of it is not in the log."""

    kind: str
    written: dict[tuple[str, str], str] = field(default_factory=dict)
    refused: list[str] = field(default_factory=list)
    lost: list[str] = field(default_factory=list)

    @property
    def rows(self) -> int:
        """How many rows were written."""
        return len({shot for shot, _ in self.written})


def run_race(folder: Path, number: int) -> Race:
    """Run one race in a new folder; its kind and all its chances hang on its number."""
    chance = random.Random(number)  # noqa: S311 - the same races at every run
    race = Race(KINDS[number % len(KINDS)])
    folder.mkdir(parents=True)
    for shot in SHOTS:
        (folder / f"{shot}.h5").touch()
    rows = {shot: {"notes": f"old {shot}", "charge": "full"} for shot in SHOTS[: chance.randint(2, 6)]}
    saved(folder / SHOT_LOG, _table(rows))
    _remember(race, rows)
    {KINDS[0]: _commands, KINDS[1]: _slow_save, KINDS[2]: _kill}[race.kind](folder, race, rows, chance)
    _judge(folder, race)
    return race


def _commands(folder: Path, race: Race, _: dict[str, dict[str, str]], chance: random.Random) -> None:
    """Start two or three commands at once, of one shot or of several."""
    crew = [_command(folder, k, chance) for k in range(chance.choice((2, 3)))]
    for one in crew:
        one.go()
    for one in crew:
        _take(race, one)


def _slow_save(folder: Path, race: Race, rows: dict[str, dict[str, str]], chance: random.Random) -> None:
    """Save the log in place with rows of a person, in two parts, while a command or two come."""
    crew = [_command(folder, k, chance) for k in range(chance.choice((1, 1, 2)))]
    rows |= {SHOTS[6]: {"exclude": "misfire"}, SHOTS[1]: {**rows.get(SHOTS[1], {}), "added_mass_kg": "120"}}
    content = _table(rows).encode()
    cut = chance.randrange(len(content))
    if chance.random() < 0.5:
        cut = content.rfind(b"\n", 0, cut) + 1  # the half ends on a whole line
    begun = threading.Event()

    def save() -> None:
        with (folder / SHOT_LOG).open("wb", buffering=0) as stream:
            stream.write(content[:cut])
            begun.set()
            time.sleep(pause_s)
            stream.write(content[cut:])

    pause_s = chance.uniform(0.05, 1.5)
    saving = threading.Thread(target=save)
    saving.start()
    begun.wait()
    time.sleep(chance.uniform(0.0, pause_s))
    for one in crew:
        one.go()
    saving.join()
    _remember(race, rows)
    for one in crew:
        _take(race, one)


def _kill(folder: Path, race: Race, _: dict[str, dict[str, str]], chance: random.Random) -> None:
    """Kill a command somewhere in its work, with another one at its heels."""
    killed, heir = _command(folder, 0, chance), _command(folder, 1, chance)
    killed.go()
    time.sleep(chance.uniform(0.0, 0.05))
    if chance.random() < 0.5:
        heir.go()
        killed.kill()
    else:
        killed.kill()
        heir.go()
    if killed.done():  # it was faster
        race.written |= {(killed.shot, column): text for column, text in killed.cells.items()}
    _take(race, heir)


def _command(folder: Path, k: int, chance: random.Random) -> Command:
    """Return a command whose cells no other one sets."""
    if k == 2:
        return Command(folder, SHOTS[7], {}, "2026-11-20T09:12:44+01:00")
    shot = chance.choice(SHOTS[:4])
    return Command(folder, shot, {("configuration", "elevation_deg")[k]: ("ring", "30")[k]})


def _take(race: Race, command: Command) -> None:
    """Take what a command said."""
    if command.done():
        race.written |= {(command.shot, column): text for column, text in command.cells.items()}
    else:
        race.refused.append(command.said.strip().splitlines()[-1] if command.said.strip() else "without a word")


def _remember(race: Race, rows: Mapping[str, Mapping[str, str]]) -> None:
    race.written |= {(shot, column): text for shot, cells in rows.items() for column, text in cells.items()}


def _judge(folder: Path, race: Race) -> None:
    """Compare the log, read with the standard library, with what must be in it, and look for what must not."""
    with io.StringIO((folder / SHOT_LOG).read_text(encoding="utf-8"), newline="") as text:
        table = list(csv.DictReader(text))
    found = {row["shot"]: row for row in table}
    if len(found) != len(table):
        race.lost.append("a shot has two rows")
    for (shot, column), cell in race.written.items():
        if (there := found.get(shot, {}).get(column)) != cell:
            race.lost.append(f"{shot} {column}: {cell!r}, found {there!r}")
    known = {shot for shot, _ in race.written}
    strangers = [shot for shot, row in found.items() if shot not in known and not any(list(row.values())[1:])]
    race.lost += [f"an empty row of {shot}" for shot in strangers]
    left = [path.name for path in folder.iterdir() if path.name.endswith(".partial")]
    if race.kind != KINDS[2] and left:
        race.lost.append(f"left behind: {', '.join(left)}")


def _table(rows: Mapping[str, Mapping[str, str]]) -> str:
    lines = [",".join((shot, *(cells.get(name, "") for name in COLUMNS[1:]))) for shot, cells in rows.items()]
    return os.linesep.join((",".join(COLUMNS), *lines, ""))
