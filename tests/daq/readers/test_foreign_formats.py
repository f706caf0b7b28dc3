"""Files of formats that are not read are named, with what to do, by every command alike."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from recoil_acquisition.errors import UnknownFormatError
from recoil_acquisition.readers.foreign_formats import foreign_format, foreign_formats
from recoil_acquisition.readers.head import Claim, Head
from recoil_acquisition.readers.reader import Declarations
from recoil_acquisition.readers.table import BY_LAYOUT, recognise, surest_claim
from recoil_acquisition.readers.text.layout import TextLayout
from recoil_acquisition.readers.text.proposed_layout import propose_layout
from tests.builders.foreign_files import FOREIGN_FILES
from tests.contracts.test_reader_rules import CASES

EXAMPLES = [(name, content) for name, contents in FOREIGN_FILES.items() for content in contents]
IDS = [f"{name} {i}" for i, (name, _) in enumerate(EXAMPLES)]
MAKERS = re.compile(
    r"(?i)\b(imc|famos|hbm|catman|somat|diadem|endaq|gantner|mts|campbell|igor|origin|tektronix|keysight|agilent|lecroy|"
    r"rigol|yokogawa|savvycan|ovms|busmaster|microchip|carbus|ixxat|kvaser|css|photron|phantom|kinovea|pico|siglent|"
    r"dewetron|oxygen|dewesoft|proanalyst|dasylab|excel)\b"
)
NOISE = np.random.default_rng(3).integers(0, 256, 5000, dtype=np.uint8).tobytes()


def test_every_format_has_an_example_and_there_are_enough() -> None:
    names = [one.name for one in foreign_formats()]
    assert names == list(FOREIGN_FILES)
    assert len(names) == len(set(names)) >= 25
    assert all(one.remedy and one.source and one.signs for one in foreign_formats())


SPOKEN_AS_WORDS = ("SEG-2", "CARBUS", "ROS", "COMTRADE", "RIFX")
"""Names in capitals that are not said letter by letter."""


@pytest.mark.parametrize("name", FOREIGN_FILES)
def test_the_sentence_on_a_format_is_grammatical(name: str) -> None:
    article, _, rest = name.partition(" ")
    word = rest.split()[0]
    by_letters = word[:2].isupper() and word not in SPOKEN_AS_WORDS
    vowel = word[0] in "AEFHILMNORSX" if by_letters else word[0].casefold() in "aeiou"
    assert article == ("an" if vowel else "a"), name
    error = str(UnknownFormatError(Path("x"), [], [], foreign=name, remedy="export it"))
    assert error == f"x: this is {name}, which is not read; export it; or leave it out"
    assert not re.search(r"[,.;:]", name.partition("(")[0]), "a comma before `which` would stand twice"


@pytest.mark.parametrize(("name", "content"), EXAMPLES, ids=IDS)
def test_a_file_is_named_by_its_own_bytes(name: str, content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "measured.dat"
    path.write_bytes(content)
    head = Head.of(path)
    assert surest_claim(head)[0] <= Claim.SHAPE, "a reader would take it"
    found = foreign_format(head)
    assert found is not None
    assert found.name == name
    with pytest.raises(UnknownFormatError) as caught:
        recognise(path, ("dewetron", "camera", "can"))
    assert caught.value.foreign == name


@pytest.mark.parametrize(
    "content",
    [
        NOISE, bytes(3000), b"\xff" * 3000, b"CI", b"II", b"AG", b"CDF", b"\x05\x00" + NOISE, b"\x02\x50" + NOISE,
        b"\x25\xeb" + NOISE, b"\x94\x13" + b"\xff" * 50, b"0       " + b"x" * 300, b"hello\n", b"a;b\n1;2\n3;4\n",
        b"[section]\nkey = 1\n", b"Excel saved this\n", b"the RIGOL was on\n1,2\n3,4\n", b"PK\n1\n",
    ],
)  # fmt: skip
def test_no_name_is_given_that_the_bytes_do_not_tell(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "a.dat"
    path.write_bytes(content)
    assert foreign_format(Head.of(path)) is None
    with pytest.raises(UnknownFormatError) as caught:
        recognise(path)
    assert MAKERS.search(str(caught.value).replace('kind = "dewetron"', "")) is None


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_a_file_that_is_read_is_not_named_as_one_that_is_not(case, tmp_path: Path) -> None:
    path = tmp_path / "own"
    path.write_bytes(case.content)
    named = foreign_format(Head.of(path))
    claimed = surest_claim(Head.of(path))[0]
    # a general name, such as that of an archive, is none where a reader knows better
    assert named is None or claimed > Claim.SHAPE


def test_a_table_of_text_is_proposed_with_its_rows(tmp_path: Path) -> None:
    path = tmp_path / "stand.csv"
    rows = "".join(f"{i},0;{i / 8:.3f};{-i},5\n".replace(".", ",") for i in range(20))
    path.write_text(f"Prüfstand 3\n\nZeit;p;F\nms;bar;kN\n{rows}", encoding="cp1252")
    with pytest.raises(UnknownFormatError) as caught:
        recognise(path)
    text = str(caught.value)
    assert 'separator = ";", decimal = ",", header_row = 3, unit_row = 4, first_row = 5, time_column = "Zeit"' in text
    assert 'time_unit = "ms"' in text
    proposed = propose_layout(Head.of(path).lines)
    assert proposed is not None
    recording = BY_LAYOUT["dewetron"].open(path, Declarations("stand", layout=proposed.table))
    assert [(header.name, header.unit) for header in recording.signals] == [("p", "bar"), ("F", "kN")]
    assert recording.read("p").tolist() == [float(f"{i / 8:.3f}") for i in range(20)]
    assert recording.time_base("F").step_s == pytest.approx(1e-3)


@pytest.mark.parametrize(
    ("lines", "table", "lacking"),
    [
        ("t [s],p [bar]\n0,1\n1,2\n", {"separator": ",", "header_row": 1, "first_row": 2, "time_column": "t"}, ()),
        (
            "Time;p\n0,5;1\n1,5;2\n",
            {"separator": ";", "decimal": ",", "header_row": 1, "first_row": 2, "time_column": "Time"},
            ("`time_unit`",),
        ),
        (
            "1\t2\n3\t4\n",
            {"separator": "\t", "names": ["column_1", "column_2"], "first_row": 1},
            ("`time_column` or `rate_hz`",),
        ),
        (
            "n,acc,\n,g,\n0,1,\n1,2,\n2,3,\n",
            {"separator": ",", "header_row": 1, "unit_row": 2, "first_row": 3},
            ("`time_column` or `rate_hz`",),
        ),
        (
            "X,acc\ns,g\n0,1\n1,2\n",
            {"separator": ",", "header_row": 1, "unit_row": 2, "first_row": 3, "time_column": "X", "time_unit": "s"},
            (),
        ),
        (
            "X (s),gap (ms)\n0,1\n1,2\n",
            {"separator": ",", "header_row": 1, "first_row": 2},
            ("`time_column` or `rate_hz`",),
        ),
        (
            "time,acc\n10:00:00.5,1\n10:00:01.0,2\n",
            {"separator": ",", "header_row": 1, "first_row": 2, "time_column": "time"},
            (),
        ),
    ],
)
def test_the_layout_that_a_table_seems_to_have(lines: str, table: dict, lacking: tuple[str, ...]) -> None:
    proposed = propose_layout(lines.split("\n"))
    assert proposed is not None
    assert (dict(proposed.table), proposed.lacking) == (table, lacking)
    layout = TextLayout.model_validate(dict(proposed.table))
    faults = [fault.key for fault in layout.contradictions()]
    assert faults == (["time_column"] if "`time_column` or `rate_hz`" in lacking else [])


@pytest.mark.parametrize("text", ["", "hello\nworld\n", "1\n2\n3\n", "a,b\nc,d\n", "note: 3, 4 and 5\n"])
def test_what_is_no_table_gets_no_layout(text: str) -> None:
    assert propose_layout(text.split("\n")) is None
