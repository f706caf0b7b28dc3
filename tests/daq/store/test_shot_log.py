"""The shot log: whose row is whose, what its cells mean, and that other people's writing stays as it is."""

import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from recoil_acquisition.errors import ReadError, StoreError
from recoil_acquisition.store.shot_log import SHOT_LOG, ShotLog
from recoil_acquisition.store.shot_log_row import COLUMNS, NUMBERS, ShotLogRow
from tests.builders.saved_logs import saved

NAMES = st.from_regex(r"[A-Za-z0-9_]{1,6}", fullmatch=True).filter(
    lambda name: (
        name.upper() not in ("CON", "PRN", "AUX", "NUL", *(f"{port}{n}" for port in ("COM", "LPT") for n in range(10)))
    )
)
TEXTS = st.text(st.characters(codec="utf-8", exclude_characters="\0")).map(str.strip)
FLOATS = st.floats(allow_nan=False, allow_infinity=False)
MASSES = st.floats(min_value=0.0, allow_infinity=False)
ANGLES = st.floats(min_value=-90.0, max_value=90.0)
TEMPERATURES = st.floats(min_value=-273.15, allow_infinity=False)
OWN = st.dictionaries(st.sampled_from(["lot", "crew; 2", 'a "b"']), TEXTS.filter(bool), max_size=2)
ROWS = st.builds(
    ShotLogRow, NAMES, TEXTS, TEXTS, FLOATS, MASSES, TEXTS, st.none() | TEMPERATURES, st.none() | ANGLES, TEXTS, TEXTS,
    OWN, muzzle_velocity_m_s=st.none() | st.floats(1.0, 2e4), u_muzzle_velocity_m_s=st.none() | MASSES,
)  # fmt: skip
HEADERS = st.sampled_from(
    [
        ",".join(COLUMNS) + "\n",
        ";".join(reversed(COLUMNS)) + "\r\n",
        "\t".join(COLUMNS) + "\n",
        "\ufeffshot;lot;added_mass_kg\r\n7x;B;12,5\r\n",
        "shot\n",
        "Shot;notes;;\r\n7x;a;;\r\n;;;\r\n",
    ]
)


def log_of(text: str | bytes, folder: Path, *shots: str) -> ShotLog:
    return ShotLog.read(saved(folder / SHOT_LOG, text), shots)


@pytest.mark.exhaustive
@given(header=HEADERS, row=ROWS)
def test_a_row_that_is_written_is_read_as_it_was(tmp_path_factory, header, row):
    before = log_of(header, tmp_path_factory.mktemp("log"))
    before.with_row(row).write()
    again = ShotLog.read(before.path, ())
    found = again.row(row.shot)
    assert found is not None
    assert found.to_json() == row.to_json()
    assert again.rows[: len(before.rows)] == before.rows
    assert again.sha256 != before.sha256


@pytest.mark.exhaustive
@given(row=ROWS.map(lambda row: ShotLogRow(row.shot, row.time, notes=row.notes)))
def test_an_added_row_leaves_the_bytes_above_it(tmp_path_factory, row):
    text = '\ufeffshot;time;notes\r\n7x;früher;"a;b"\r\n\r\n'
    log = log_of(text, tmp_path_factory.mktemp("log"))
    log.with_row(row).write()
    assert log.path.read_bytes().startswith(text.encode())


@pytest.mark.exhaustive
@given(column=st.sampled_from(COLUMNS[1:]), value=TEXTS, number=ANGLES)
def test_a_changed_cell_leaves_all_other_rows_and_cells(tmp_path_factory, column, value, number):
    text = ";".join(COLUMNS) + "\r\n" + "0001;t;A;1,5;0,2;c;21,5;30;;n\r\n" + "2;t;A;;;;;;bad;\r\n"
    log = log_of(text, tmp_path_factory.mktemp("log"), "0001", "0002")
    if column in NUMBERS:
        value = repr(abs(number))
    changed = log.with_cells("0002", {column: value})
    assert changed.rows[0] == log.rows[0]
    kept = [name for name in COLUMNS if name != column]
    assert [getattr(changed.rows[1], name) for name in kept] == [getattr(log.rows[1], name) for name in kept]
    found = getattr(changed.rows[1], column)
    assert found == (abs(number) if column in NUMBERS else value)


def test_a_folder_without_a_log_has_an_empty_one(tmp_path):
    log = ShotLog.read(tmp_path / SHOT_LOG)
    assert (log.rows, log.sha256, log.row("0001")) == ((), None, None)
    written = log.with_row(ShotLogRow("0001", "2026-11-20T09:12:44+01:00")).write()
    assert written.path.read_text(encoding="utf-8") == (
        "shot,time,configuration,added_mass_kg,u_added_mass_kg,charge,charge_temperature_c,elevation_deg,exclude,notes\n"
        "0001,2026-11-20T09:12:44+01:00,,,,,,,,\n"
    )
    assert ShotLog.read(written.path).sha256 == written.sha256


def test_a_decimal_comma_is_understood_and_kept(tmp_path):
    log = log_of("shot;added_mass_kg;u_added_mass_kg;Los\r\n1;120,250;0,05;Ä7\r\n".encode("cp1252"), tmp_path, "0001")
    row = log.row("0001")
    assert row == ShotLogRow(
        "0001", added_mass_kg=120.25, u_added_mass_kg=0.05, own={"Los": "Ä7"}, u_added_mass_stated=True
    )
    log.with_cells("0001", {"added_mass_kg": "80.5"}).write()
    expected = "shot;added_mass_kg;u_added_mass_kg;Los\r\n1;80,5;0,05;Ä7\r\n"
    assert log.path.read_bytes() == expected.encode("cp1252")


@pytest.mark.parametrize(
    ("text", "mass_kg"),
    [
        ("shot,added_mass_kg\na,1.234\n", 1.234),
        ('shot,added_mass_kg\na,"12,5"\n', 12.5),
        ('shot,added_mass_kg\na,"1,234"\n', None),
        ("shot;added_mass_kg\na;1,234\n", 1.234),
        ("shot;added_mass_kg\na;1.234\n", None),
        ("shot;added_mass_kg\na;1.234\nb;2.5\n", 1.234),
        ("shot;added_mass_kg\na;1,234\nb;2.5\n", None),
        ("shot\tadded_mass_kg\na\t1,234\n", None),
        ("shot\tadded_mass_kg\na\t1,234\nb\t2,5\n", 1.234),
        ("shot\tadded_mass_kg\na\t1.234\nb\t2,5\n", None),
        ("shot;added_mass_kg\na;0.125\n", 0.125),
        ("shot;added_mass_kg\na;-.5e1\n", -5.0),
    ],
)
def test_three_decimals_are_never_taken_for_thousands_nor_thousands_for_them(tmp_path, text, mass_kg):
    if mass_kg is None:
        with pytest.raises(ReadError, match="line 2, column added_mass_kg: may be thousands or decimals"):
            log_of(text, tmp_path)
    else:
        row = log_of(text, tmp_path).row("a")
        assert row is not None
        assert row.added_mass_kg == mass_kg


def test_a_number_without_zeros_is_the_one_shot_that_can_be_meant(tmp_path):
    text = "shot,notes\n1,one\n"
    assert log_of(text, tmp_path, "0001", "0002").row("0001") == ShotLogRow("0001", notes="one")
    assert log_of(text, tmp_path, "1", "0001").row("0001") is None
    assert log_of(text, tmp_path, "1", "0001").row("1") == ShotLogRow("1", notes="one")
    ambiguous = log_of(text, tmp_path, "001", "0001")
    assert (ambiguous.row("0001"), ambiguous.row("001"), ambiguous.without_shot()) == (None, None, ("1",))
    # a shot whose file is elsewhere
    assert log_of(text, tmp_path).row("0001") == ShotLogRow("0001", notes="one")
    assert log_of("shot\n0\n01\n", tmp_path, "0000", "0001").without_shot() == ("01",)


def test_the_shots_are_those_with_a_file_beside_the_log(tmp_path):
    for name in ("0001.h5", "0002.h5", "notes.txt", ".0003.h5"):
        (tmp_path / name).touch()
    saved(tmp_path / SHOT_LOG, "shot\n1\n3\n")
    log = ShotLog.beside(tmp_path / "0001.h5")
    assert log.shots == {"0001", "0002"}
    assert [row.shot for row in log.rows] == ["0001", "3"]
    assert log.without_shot() == ("3",)
    assert log.without_shot(["0003"]) == ("0001",)


def test_an_added_mass_without_its_uncertainty_is_taken_as_exact(tmp_path):
    log = log_of("shot,added_mass_kg,u_added_mass_kg\na,12,\nb,12,0\nc,12,0.1\nd,,\n", tmp_path)
    assert [row.shot for row in log.rows if row.added_mass_is_exact] == ["a"]
    assert [row.to_json() for row in log.rows] == [
        {"shot": "a", "added_mass_kg": 12.0},
        {"shot": "b", "added_mass_kg": 12.0, "u_added_mass_kg": 0.0},
        {"shot": "c", "added_mass_kg": 12.0, "u_added_mass_kg": 0.1},
        {"shot": "d"},
    ]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("shot,notes\n1,a\n0001,b\n", "line 3, column shot: a second row of shot 0001; expected one, as in line 2"),
        (
            "shot,added_mass_kg\na,heavy\n",
            "line 2, column added_mass_kg: no number; expected a number, or nothing, found",
        ),
        ("shot,elevation_deg\na,1e999\n", "line 2, column elevation_deg: no number"),
        ("shot,elevation_deg\na,nan\n", "line 2, column elevation_deg: no number"),
        ("shot,u_added_mass_kg\na,-0.1\n", "line 2, column u_added_mass_kg: a standard uncertainty is not negative"),
        ("shot,notes,notes\na,b,c\n", "line 1, column notes: a second column of this name"),
        ("shot,notes\n,b\n", "line 2, column shot: names no shot"),
        ("shot,Added mass (kg)\na,12\n", "is this column `added_mass_kg`?; expected 'added_mass_kg'"),
        ("shot,excluded\na,12\n", "is this column `exclude`?"),
    ],
)
def test_a_fault_names_line_and_column(tmp_path, text, said):
    with pytest.raises(ReadError) as raised:
        log_of(text, tmp_path, "0001")
    assert said in str(raised.value)
    assert str(raised.value).startswith(f"{tmp_path / SHOT_LOG}: line ")


def test_own_columns_that_resemble_one_that_is_there_are_own(tmp_path):
    log = log_of("shot,charge,charge_lot,charge_temperature_c,charge_temperature_f,crew\na,c,7,20,68,\n", tmp_path)
    assert log.rows[0].own == {"charge_lot": "7", "charge_temperature_f": "68"}
    assert log.columns[-1] == "crew"


@pytest.mark.parametrize(
    ("column", "text"),
    [("added_mass_kg", "heavy"), ("u_added_mass_kg", "-1"), ("elevation_deg", "inf"), ("added_mass_kg", "1,234")],
)
def test_no_cell_is_set_that_could_not_be_read(tmp_path, column, text):
    log = ShotLog.read(tmp_path / SHOT_LOG)
    with pytest.raises(StoreError, match=f"shot 0001, column {column}"):
        log.with_cells("0001", {column: text})


@pytest.mark.parametrize(
    ("column", "text", "expected"),
    [
        ("elevation_deg", "900", "a number from -90 to 90"),
        ("elevation_deg", "-90,5", "a number from -90 to 90"),
        ("charge_temperature_c", " -300", "-273.15 and more"),
    ],
)
def test_no_cell_is_set_that_nothing_can_be(tmp_path, column, text, expected):
    log = ShotLog.read(tmp_path / SHOT_LOG)
    with pytest.raises(StoreError, match=f"shot 0001, column {column}: no such value is possible; expected {expected}"):
        log.with_cells("0001", {column: text})


@pytest.mark.parametrize(
    ("row", "doubt"),
    [
        (ShotLogRow("a", added_mass_kg=-120.0), "added_mass_kg -120 says that 120 kg were taken off"),
        (ShotLogRow("a", added_mass_kg=1e9), "added_mass_kg 1e+09 is not between 0 and 5000: a wrong unit"),
        (ShotLogRow("a", added_mass_kg=12.0, u_added_mass_kg=50.0), "u_added_mass_kg 50 is more than the added mass"),
        (ShotLogRow("a", u_added_mass_kg=900.0), "u_added_mass_kg 900 is not between 0 and 100"),
        (ShotLogRow("a", elevation_deg=900.0), "elevation_deg 900 is not between -90 and 90"),
        (ShotLogRow("a", charge_temperature_c=294.0), "charge_temperature_c 294 is not between -80 and 150"),
        (ShotLogRow("a", muzzle_velocity_m_s=2.0), "muzzle_velocity_m_s 2 is not between 20 and 3000"),
        (ShotLogRow("a", added_mass_kg=120.0, u_added_mass_kg=0.05, elevation_deg=45.0), None),
    ],
)
def test_a_number_that_is_rather_a_mistake_is_doubted(row, doubt):
    assert [one.startswith(doubt) for one in row.doubts] == ([True] if doubt else [])


def test_names_that_no_row_can_have_are_a_callers_mistake(tmp_path):
    log = ShotLog.read(tmp_path / SHOT_LOG)
    for shot, cells in (
        ("a/b", {}),
        ("a", {"shot": "b"}),
        ("a", {"": "b"}),
        ("a", {"x\ny": "b"}),
        ("a", {"notes": "\0"}),
    ):
        with pytest.raises(ValueError, match=r"shot|column|zero"):
            log.with_cells(shot, cells)
    with pytest.raises(ValueError, match="a row of '1' would be that of shot '0001'"):
        ShotLog.read(log.path, ["0001"]).with_row(ShotLogRow("1"))
    with pytest.raises(ValueError, match="has a row"):
        log.with_row(ShotLogRow("a")).with_row(ShotLogRow("a"))


def test_a_log_that_somebody_wrote_meanwhile_is_left_to_them(tmp_path):
    first = ShotLog.read(tmp_path / SHOT_LOG)
    first.with_cells("a", {"notes": "mine"}).write()
    with pytest.raises(StoreError, match="changed since it was read"):
        first.with_cells("b", {"notes": "too late"}).write()
    second = ShotLog.read(first.path)
    theirs = first.path.read_text(encoding="utf-8").replace("mine", "theirs")
    saved(first.path, theirs)
    with pytest.raises(StoreError, match="changed since it was read"):
        second.with_cells("a", {"notes": "too late"}).write()
    assert first.path.read_text(encoding="utf-8") == theirs
    assert not [path for path in tmp_path.iterdir() if path.name.endswith(".partial")]


def test_a_log_that_cannot_be_written_is_named(tmp_path):
    log = ShotLog.read(tmp_path / "missing" / SHOT_LOG).with_cells("a", {})
    with pytest.raises(StoreError, match="cannot be written: No such file or directory"):
        log.write()


@pytest.mark.skipif(os.name == "nt", reason="links and modes are those of POSIX")
def test_a_link_and_the_files_permissions_stay(tmp_path):
    real = tmp_path / "elsewhere.csv"
    saved(real, "shot\n")
    real.chmod(0o640)
    (tmp_path / SHOT_LOG).symlink_to(real)
    ShotLog.read(tmp_path / SHOT_LOG).with_cells("a", {}).write()
    assert (tmp_path / SHOT_LOG).is_symlink()
    assert real.read_text(encoding="utf-8") == "shot\na\n"
    assert real.stat().st_mode & 0o777 == 0o640


def test_a_log_that_is_as_it_should_be_is_not_written_again(tmp_path):
    log = log_of("shot,notes\na,b\n", tmp_path)
    before = log.path.stat()
    assert log.with_cells("a", {"notes": "b"}).write().sha256 == log.sha256
    assert log.path.stat() == before
