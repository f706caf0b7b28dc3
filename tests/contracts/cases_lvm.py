"""Files of the reader of LabVIEW measurement files, for the rules that every reader keeps."""

from __future__ import annotations

from dataclasses import replace

from recoil_acquisition.conformance import Case
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.table import READERS
from tests.builders.lvm_files import Lvm, columns, seconds

READER = next(reader for reader in READERS if reader.name == "LabVIEW measurement")
MAGNITUDES = {"acc": (100.0, 200.0), "p": (-10.0, 0.0)}


def _case(name: str, file: Lvm) -> Case:
    return Case(name, READER, file.content(), Declarations("recorder"), MAGNITUDES)


CASES = (
    _case("lvm", Lvm([columns()])),
    _case("lvm-comments-one-x", Lvm([columns()], "One", [seconds()], {0: "begin", 7: "OK"})),
    _case("lvm-multi-comma", Lvm([columns()], "Multi", [seconds()], decimal=",", line_end="\n")),
    _case(
        "lvm-segments",
        Lvm([columns(20), [replace(one, time="12:23:06.757") for one in columns(20, 20.0)]], states_decimal=False),
    ),
)
