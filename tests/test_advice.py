"""What the program advises it also takes: every key and every command in its texts is one.

A key in backticks that no table of a rig file has, or a command that the command line does not take, is advice that
nobody tried. What else stands in backticks is listed here; a new one is listed, too, or is a fault.
"""

from __future__ import annotations

import re
import shlex
import tomllib
from functools import cache
from typing import Any

import pytest
import typer

from recoil_acquisition.store.shot_log_row import COLUMNS as COLUMNS_OF_LOG
from recoil_rigs.mechanism.model import Mechanism
from recoil_rigs.tables.certificate_table import COLUMNS as COLUMNS_OF_SENSORS
from tests.builders.all_commands import all_commands
from tests.builders.program_texts import program_texts
from tests.rig_keys import page

COMMANDS = all_commands()
REFUSAL = typer.BadParameter.__mro__[1]
"""What Click raises, be it typer's copy of it, of words that a command does not take."""
SAMPLES = {
    "SECONDS": "1.5",
    "KEY=VALUE": "added_mass_kg=120",
    "KEY=LO:HI:STEP": "m3=780:790:5",
    "0001_*": "0001_daq.csv",
}
"""What stands for a number or a pair in a command."""
OF_NO_COMMAND = ("capture", "itself", "Parquet", "CSV")
"""Words behind the program's name that are none of its commands."""
OF_OTHERS = frozenset((
    # fields and lines of other programs' files
    "$STARTTIME", "***End_of_Header***", ";$COLUMNS", ";$FILEVERSION", "Date", "Delta", "Delta_X", "End TriggerBlock",
    "MDF     3.", "MDF     4.", "Measurement time[...]", "Measurement time[s]", "[hh:mm:ss]", "Recording date",
    "Sample_rate", "Time", "Time (ms)", "Time (s)", "Time [s]", "X_Value", "base dec", "base hex", "date", "t",
    "name (unit)", "sample_rate", "time", "recoil_daq", "recoil_daq_names",
    # characters and words of names, and groups of users
    "*", "+", "-", ".", "_", "[[...]]", "all", "any", "can", "fixed", "dialout", "uucp", "journal", "u_<name>",
    "paper", "pdf", "xlsx", "sign", "gtc", "inputs", "virtual", "trigger", "redundant", "ready_made", "check_reports",
    "free",
    # other programs
    "-ta", "-tz", "candump -L", "dask scheduler", "dask worker --nthreads 1 ADDRESS", "deeplabcut.convert_h5_to_csv",
    "save_as_csv=True", "ip link set can0 up type can bitrate 1000000", "nccopy -k nc4",
    "save('x.mat', '-struct', '{name}')", "ulimit -v", "ulimit -v unlimited",
))  # fmt: skip
"""What stands in backticks and is neither a key nor a command."""
PUT_IN = frozenset((
    "{SHOT_PLACE}", "{TABLE}", "{column}", "{command}", "{first}", "{key}", "{known}", "{lacking}", "{name[0]}",
    "{OPENDAQ.name}", "{one.key}", "{order}", "{recover}", "{self}", "{source.device}", "mixed",
))  # fmt: skip
"""What is put in: keys of the tables that are at fault, commands that are texts of their own, and the name of a rig."""
QUOTED_BEFORE = frozenset(("rig", "capture", "file", "files", "out"))
"""Words that were made so before, of a command with several."""


@cache
def keys() -> frozenset[str]:
    """Return all keys that a rig file, a shot log or a table of sensors may have."""
    of_rig = re.findall(r"^\| `([^`]+)` \|", page(), re.MULTILINE)
    tables = re.findall(r"^## `\[+([a-z.]+)\]+`", page(), re.MULTILINE)
    uncertain = (f"u_{symbol}" for symbol in Mechanism.symbols())
    return frozenset((
        *of_rig, *(f"[{table}]" for table in tables), *uncertain, *COLUMNS_OF_LOG, *COLUMNS_OF_SENSORS,
    ))  # fmt: skip


def in_backticks() -> list[tuple[str, str]]:
    """Return place and text of each piece in backticks."""
    texts = ((place, text) for place, text in program_texts() if "``" not in text)
    return [(place, span) for place, text in texts for span in text.split("`")[1::2] if "quote='" not in text]


def commands() -> list[tuple[str, str]]:
    """Return place and words of each command, behind the program's name."""
    found = [(place, span) for place, span in in_backticks() if span.split(" ")[0] in COMMANDS]
    for place, text in program_texts():
        for said in re.findall(r"\brecoil-daq ([a-z][^`;]*)", filled(text)):
            before, _, _ = said.partition(" recoil-daq ")
            found.append((place, re.split(r"[,:](?: |$)", before, maxsplit=1)[0].strip()))
    return found


def filled(text: str) -> str:
    """Put something in place of what is put in."""
    return re.sub(r"\{[^{}]*\}|<[^<>]*>", "PLACE", text)


def refusal_of(line: str) -> str:
    """Return what the command line has against a command, with something in place of what a person puts in."""
    words = shlex.split(filled(line).replace("[", "").replace("]", ""))
    name, *words = (SAMPLES.get(word, word.removesuffix("...")) for word in words)
    try:
        COMMANDS[name].make_context(name, words)
    except REFUSAL as error:
        return str(error.format_message())  # type: ignore[attr-defined]
    return ""


@pytest.mark.indispensable("law")
def test_every_command_in_a_text_is_one_that_the_command_line_takes() -> None:
    seen, refused = 0, []
    for place, line in commands():
        name, *words = line.split()
        if name in OF_NO_COMMAND:
            continue
        if name not in COMMANDS:
            refused.append(f"{place}: no command {name!r} in {line!r}")
            continue
        if not words or not any(re.match(r"-|[A-Z\[{<]|\S+[./]", word) for word in words):
            continue  # a sentence about the command
        if refusal := refusal_of(line):
            refused.append(f"{place}: {line!r}: {refusal}")
        seen += 1
    assert refused == []
    assert seen > 40


def test_every_place_in_a_command_is_one_word_of_a_shell() -> None:
    """A path with a space is pasted as it is printed."""
    said = [(place, text) for place, text in program_texts() if re.search(r"\brecoil-daq [a-z]+ \S*[{]", text)]
    taken_apart = [
        f"{place}: {{{put_in}}}"
        for place, text in said
        if re.search(r"\brecoil-daq (\w+)", text)[1] in COMMANDS  # type: ignore[index]
        for put_in in re.findall(r"\{([^{}]+)\}", re.split(r"\brecoil-daq (?=[a-z])", text)[1].partition("`")[0])
        if not put_in.startswith("quoted(") and put_in not in QUOTED_BEFORE
    ]
    assert said
    assert taken_apart == []


def is_key(span: str) -> bool:
    """Return whether a piece is a key, or a key with a value, that some table has."""
    if span in keys():
        return True
    if span.count(".") == 1 and all(part in keys() for part in span.split(".")):
        return True
    key, equals, _ = span.partition(" = ")
    if not equals or key not in keys():
        return False
    toml = re.sub(r"\{ \.\.\. \}", "{}", span)
    toml = re.sub(r"\{[^{}=]+\}", "1", re.sub(r'"\{[^{}]*\}"', '"x"', toml))
    if " | " in toml:  # one of several
        toml = re.sub(r" \| [^,}]*", "", toml).replace(", ...", "")
    return set(_keys_of(tomllib.loads(toml))) <= keys()


def _keys_of(table: dict[str, Any]) -> list[str]:
    return [one for key, value in table.items() for one in (key, *(_keys_of(value) if isinstance(value, dict) else ()))]


@pytest.mark.whole_way
def test_every_key_in_a_text_is_one_that_some_table_has() -> None:
    options = {name for command in COMMANDS.values() for parameter in command.params for name in parameter.opts}
    unknown = [
        f"{place}: {span!r}"
        for place, span in in_backticks()
        if span
        and not (is_key(span) or span in OF_OTHERS | PUT_IN | options)
        and span.split(" ")[0] not in {*COMMANDS, "recoil-daq"}
    ]
    assert unknown == []


def test_no_list_of_other_things_has_what_no_text_says() -> None:
    said = {span for _, span in in_backticks()}
    assert sorted((OF_OTHERS | PUT_IN) - said) == []
