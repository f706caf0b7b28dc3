"""Drafts of files of other makers: nothing is asserted that they do not show, and the draft can be filled in."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from recoil_acquisition.errors import FaultCode, ReadError, RigError
from recoil_daq.drafting.init import draft_rig
from recoil_daq.recording.file_summary import is_database
from recoil_rigs.rig import load_rig
from tests.builders.shared_data import shared_file


def check_draft(files: list[Path], databases: list[Path], out: Path) -> bool:
    """Draft a rig and check it; return whether there is one, or only an error of one line."""
    try:
        drafted = draft_rig(files, databases=databases, out=out)
    except ReadError as error:
        lines = str(error).count("\n") + 1
    else:
        lines = 0
    if lines:
        assert lines == 1
        return False
    out.write_text(drafted.draft.text(), encoding="utf-8")
    with pytest.raises(RigError) as refused:
        load_rig(out)
    wrong = [str(fault) for fault in refused.value.faults if fault.code is not FaultCode.OPEN]
    assert wrong == [], files
    if drafted.roles.model is None:
        rows = tomllib.loads(drafted.draft.text())["channel"]
        asserted = [row for row in rows if not str(row.get("role", "TODO")).startswith("TODO")]
        assert [row for row in asserted if row["role"] != "trigger"] == [], files
    return True


@pytest.mark.whole_way
def test_every_file_of_other_makers_is_drafted_or_refused_in_one_line(tmp_path: Path) -> None:
    root = shared_file("README.md").parent
    drafted = 0
    for path in sorted(root.rglob("*")):
        if not path.is_file() or is_database(path) or path.suffix in (".toml", ".py", ".md", ".json"):
            continue
        beside = sorted(path.parent.glob("*.dbc")) if path.parent.name != "reports" else []
        for databases in ([], beside[:1]) if beside else ([],):
            drafted += check_draft([path], databases, tmp_path / "rig.toml")
    assert drafted > 60


@pytest.mark.whole_way
@pytest.mark.parametrize("folder", ["can/rig_shot", "containers", "dewetron", "famos", "reports", "serial", "tracks"])
def test_files_of_a_folder_together_are_drafted_and_the_unread_named(folder: str, tmp_path: Path) -> None:
    root = shared_file("README.md").parent / folder
    files = [one for one in sorted(root.iterdir()) if one.is_file() and not is_database(one)]
    files = [one for one in files if one.suffix not in (".md", ".json", ".toml")]
    # of one folder nothing is read
    assert check_draft(files, [], tmp_path / "rig.toml") == (folder != "famos")


@pytest.mark.whole_way
@pytest.mark.parametrize(
    "name",
    ["dewetron/simple.dmd", "containers/raw1.tdms", "can/rig_shot/rig_shot.blf", "shots/plain/dewetron.csv",
     "serial/mip_data.bin", "tracks/SYNTHETIC_proanalyst_like_2000fps.csv", "real/emps/DATA_EMPS.mat"],
)  # fmt: skip
@pytest.mark.parametrize("kept", [0.03, 0.4, 0.97])
def test_a_damaged_copy_is_drafted_or_one_line(name: str, kept: float, tmp_path: Path) -> None:
    content = shared_file(name).read_bytes()
    cut = tmp_path / Path(name).name
    flipped = bytearray(content[: int(kept * len(content))])
    flipped[len(flipped) // 2] ^= 0x55
    cut.write_bytes(bytes(flipped))
    if check_draft([cut], [], tmp_path / "rig.toml"):
        assert cut.name in (tmp_path / "rig.toml").read_text(encoding="utf-8")
