"""Bad input: one clear line, exit code 3, nothing left behind and nothing overwritten; or a shot that says why not."""

import json
import os
import shutil
import socket
import tempfile
from collections.abc import Iterator
from pathlib import Path

import h5py
import numpy as np
import pytest

from recoil_daq.recording import ingest
from recoil_rigs.rig import load_rig
from recoil_rigs.twin import simulate_shot
from tests.builders.virtual_shots import with_twin


def refused(result, out: Path, *words: str) -> None:
    """One line on stderr with these words, exit code 3, and no file anywhere below `out`."""
    assert result.exit_code == 3, result.output
    lines = result.stderr.strip().splitlines()
    assert len(lines) == 1, lines
    for word in words:
        assert word in lines[0]
    assert "Traceback" not in result.output
    assert not out.exists() or [p for p in out.rglob("*") if p.is_file()] == []


def test_an_empty_file_is_refused(run, files, tmp_path):
    files["dewetron"].write_bytes(b"")
    result = run("ingest", "field-2013", *files.values(), "--out", tmp_path / "out")
    refused(result, tmp_path / "out", files["dewetron"].name, "empty")


@pytest.mark.parametrize("kind", ["dewetron", "camera"])
@pytest.mark.parametrize("share", [0.3, 0.9])
def test_a_truncated_file_is_refused(run, files, tmp_path, kind, share):
    content = files[kind].read_bytes()
    cut = int(share * len(content))
    while content[cut - 1 : cut] in b"\r\n":  # inside a line: a cut between two lines leaves no trace in a text file
        cut -= 1
    files[kind].write_bytes(content[:cut])
    result = run("ingest", "field-2013", *files.values(), "--out", tmp_path / "out")
    refused(result, tmp_path / "out", files[kind].name, "--accept-incomplete")


@pytest.mark.whole_way
def test_a_truncated_file_is_taken_when_asked_and_says_so(run, files, tmp_path):
    content = files["camera"].read_bytes()
    files["camera"].write_bytes(content[: int(0.97 * len(content))].rstrip(b"\r\n"))
    result = run(
        "ingest", "field-2013", *files.values(), "--out", tmp_path, "--shot", "x", "--accept-incomplete", "--json"
    )
    assert result.exit_code == 0, result.output
    checks = json.loads(result.stdout)["quality"]
    assert any(c["channel"] == "camera" and c["check"] == "file" and c["verdict"] == "warn" for c in checks)


def test_the_wrong_rig_is_refused_with_the_names_the_file_has(run, files, tmp_path):
    rig = tmp_path / "rig.toml"
    text = load_rig("field-2013").text
    rig.write_text(text.replace('signal = "AI 1/acc_recoil"', 'signal = "AI 1/acc_rohr"'))
    result = run("ingest", rig, *files.values(), "--out", tmp_path / "out")
    refused(result, tmp_path / "out", "AI 1/acc_rohr", "AI 1/acc_recoil")


def test_a_rig_of_other_sources_is_refused(run, mixed_shot, tmp_path):
    result = run("ingest", "field-2013", *mixed_shot.files, "--out", tmp_path / "out")
    refused(result, tmp_path / "out", "fits no source")


def test_a_swapped_unit_is_refused(run, files, tmp_path):
    text = files["dewetron"].read_text()
    header, rest = text.split("\n", 1)
    assert "(MPa)" in header
    files["dewetron"].write_text(header.replace("(MPa)", "(m/s2)", 1) + "\n" + rest)
    result = run("ingest", "field-2013", *files.values(), "--out", tmp_path / "out")
    refused(result, tmp_path / "out", "p_breech", "m/s2")


def test_a_directory_is_refused(run, files, tmp_path):
    result = run("ingest", "field-2013", tmp_path, files["camera"], "--out", tmp_path / "out")
    refused(result, tmp_path / "out", "directory")


def test_a_missing_file_is_refused(run, files, tmp_path):
    result = run("ingest", "field-2013", tmp_path / "nothing.csv", files["camera"], "--out", tmp_path / "out")
    refused(result, tmp_path / "out", "nothing.csv", "no such file")


def test_a_missing_rig_is_refused_with_the_bundled_ones(run, files, tmp_path):
    result = run("ingest", "field-2031", *files.values(), "--out", tmp_path / "out")
    refused(result, tmp_path / "out", "field-2031", "field-2013, mixed")


def test_a_file_that_is_no_recording_is_refused(run, files, field_shot, tmp_path):
    result = run("ingest", "field-2013", *files.values(), field_shot.truth_file, "--out", tmp_path / "out")
    refused(result, tmp_path / "out", "truth.json", "which is not read")


def test_the_same_file_twice_is_refused(run, files, tmp_path):
    result = run(
        "ingest", "field-2013", files["dewetron"], files["dewetron"], files["camera"], "--out", tmp_path / "out"
    )
    refused(result, tmp_path / "out", "already has")


def test_no_file_of_the_reference_clock_is_refused(run, files, tmp_path):
    result = run("ingest", "field-2013", files["camera"], "--out", tmp_path / "out")
    refused(result, tmp_path / "out", "reference source 'dewetron'")


@pytest.mark.parametrize("name", ["../x", "a/b", "", ".hidden", "x y", "-rf", "con", "COM1.x", "x.", "x" * 251])
def test_a_shot_name_that_is_no_file_name_is_refused(run, files, tmp_path, name):
    result = run("ingest", "field-2013", *files.values(), "--out", tmp_path / "out", f"--shot={name}")
    refused(result, tmp_path / "out", "the shot's name")


@pytest.mark.whole_way
def test_a_folder_that_cannot_be_made_is_refused(run, files, tmp_path):
    (tmp_path / "file").write_text("")
    result = run("ingest", "field-2013", *files.values(), "--out", tmp_path / "file" / "out")
    refused(result, tmp_path / "out", "file")
    assert (tmp_path / "file").read_text() == ""


@pytest.fixture
def ordinary_user(identified) -> Iterator[Path]:
    """Be an ordinary user, whom permissions bind, for the test; gives a folder that every user can reach."""
    # everything that the commands import was imported for that: the interpreter may lie where only the superuser reads
    assert identified.report["valid"]
    folder = Path(tempfile.mkdtemp(prefix="recoil-daq-"))
    folder.chmod(0o755)
    superuser = os.geteuid() == 0
    try:
        yield folder
    finally:
        if superuser:
            os.seteuid(0)
        for path in folder.rglob("*"):
            path.chmod(0o700)
        shutil.rmtree(folder)


def become_ordinary() -> None:
    if os.geteuid() == 0:
        os.seteuid(65534)


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="Windows has other permissions than these")
def test_no_permission_to_write_is_refused(run, files, stored, ordinary_user):
    copies = [shutil.copy(f, ordinary_user) for f in (*files.values(), stored)]
    closed = ordinary_user / "closed"
    closed.mkdir(mode=0o555)
    become_ordinary()
    refused(run("ingest", "field-2013", *copies[:2], "--out", closed), closed, "closed", "Permission denied")
    refused(run("identify", copies[2], "--out", closed), closed, "closed", "Permission denied")


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="Windows has other permissions than these")
def test_no_permission_to_read_is_refused(run, files, ordinary_user):
    copies = [Path(shutil.copy(f, ordinary_user)) for f in files.values()]
    copies[0].chmod(0)
    out = ordinary_user / "out"
    become_ordinary()
    refused(run("ingest", "field-2013", *copies, "--out", out), out, copies[0].name, "Permission denied")


@pytest.mark.parametrize("targets", [(), ("--target", "resistance")])
def test_a_report_folder_that_cannot_be_made_is_refused_before_the_work(run, stored, tmp_path, monkeypatch, targets):
    monkeypatch.setattr("recoil_daq.reports.identify.identify_shot", lambda *_: pytest.fail("it was identified"))
    monkeypatch.setattr("recoil_daq.reports.targets.target_function", lambda *_: pytest.fail("it was looked for"))
    (tmp_path / "file").write_text("")
    result = run("identify", stored, "--out", tmp_path / "file" / "reports", *targets)
    refused(result, tmp_path / "out", "cannot write", "Not a directory")


@pytest.mark.whole_way
def test_an_existing_shot_file_is_kept(run, files, tmp_path):
    assert run("ingest", "field-2013", *files.values(), "--out", tmp_path, "--shot", "1").exit_code == 0
    before = (tmp_path / "1.h5").read_bytes()
    again = run("ingest", "field-2013", *files.values(), "--out", tmp_path, "--shot", "1")
    assert again.exit_code == 3
    assert "--overwrite" in again.stderr
    assert (tmp_path / "1.h5").read_bytes() == before
    assert run("ingest", "field-2013", *files.values(), "--out", tmp_path, "--shot", "1", "--overwrite").exit_code == 0


NAME_OF_NO_FILE = "x" * 5000


@pytest.mark.skipif(os.name == "nt", reason="a name of Windows is refused before a command sees it")
@pytest.mark.parametrize(
    "words",
    [
        "check NAME", "check mixed NAME", "show NAME", "identify NAME", "identify SHOT --rig NAME",
        "identify SHOT --header NAME", "identify SHOT --beside NAME", "identify SHOT --out NAME", "explain NAME",
        "campaign NAME", "index NAME", "predict NAME", "simulate NAME", "init NAME", "recover NAME", "log NAME notes=x",
        "export NAME --format csv", "ingest mixed NAME", "campaign SHOT SHOT --log NAME", "ingest mixed NAME --batch",
    ],
)  # fmt: skip
def test_a_path_that_the_system_refuses_is_one_line(run, stored, tmp_path, monkeypatch, words):
    monkeypatch.chdir(tmp_path)
    given = {"NAME": NAME_OF_NO_FILE, "SHOT": str(stored)}
    result = run(*(given.get(word, word) for word in words.split()))
    refused(result, tmp_path)


@pytest.mark.parametrize("content", [b"", b"Time (s)\n0\n", b"\x89HDF\r\n\x1a\n" + bytes(200)])
def test_identify_refuses_what_is_no_shot_file(run, tmp_path, content):
    path = tmp_path / "x.h5"
    path.write_bytes(content)
    refused(run("identify", path, "--out", tmp_path / "out"), tmp_path / "out", "x.h5")


def test_identify_refuses_a_folder_without_shots(run, tmp_path):
    (tmp_path / "empty").mkdir()
    refused(run("identify", tmp_path / "empty", "--out", tmp_path / "out"), tmp_path / "out", "no shot file")


def test_a_cut_shot_file_is_refused(run, stored, tmp_path):
    path = tmp_path / "cut.h5"
    content = stored.read_bytes()
    path.write_bytes(content[: len(content) // 2])
    refused(run("identify", path, "--out", tmp_path / "out"), tmp_path / "out", "cut.h5")


@pytest.mark.whole_way
def test_another_shots_camera_file_keeps_the_shot_and_says_why_it_is_not_usable(run, files, tmp_path):
    other = simulate_shot(with_twin("field-2013"), tmp_path / "other", seed=2, shot="0001")
    camera = next(f for f in other.files if "camera" in f.name)
    result = run("ingest", "field-2013", files["dewetron"], camera, "--out", tmp_path, "--shot", "x", "--json")
    assert result.exit_code == 1
    document = json.loads(result.stdout)
    assert document["usable"] is False
    assert "another shot" in " ".join(document["reasons"])
    assert (tmp_path / "x.h5").exists()


@pytest.mark.whole_way
def test_a_track_without_motion_is_set_aside_and_named(run, files, tmp_path):
    header, *rows = files["camera"].read_text().splitlines()
    noise = np.random.default_rng(1).normal(0, 0.05, len(rows))
    still = []
    for row, value in zip(rows, noise, strict=True):
        frame, seconds, _, *others = row.split(",")
        still.append(",".join([frame, seconds, f"{value:.4f}", *others]))
    files["camera"].write_text("\n".join([header, *still]) + "\n")
    result = run("ingest", "field-2013", *files.values(), "--out", tmp_path, "--shot", "x", "--json")
    assert result.exit_code == 0
    (aside,) = (one for one in json.loads(result.stdout)["findings"] if one["code"] == "set aside")
    assert "the mass is found without it" in aside["text"]
    report = run("identify", tmp_path / "x.h5", "--out", tmp_path / "reports", "--json")
    assert report.exit_code == 0
    assert "set aside" in {one["code"] for one in json.loads(report.stdout)["reports"][0]["findings"]}


def test_a_recorder_that_missed_the_shot_keeps_the_record_and_says_so(run, files, tmp_path):
    lines = files["dewetron"].read_text().splitlines()
    files["dewetron"].write_text("\n".join(lines[:1000]) + "\n")
    result = run("ingest", "field-2013", *files.values(), "--out", tmp_path, "--shot", "x", "--json")
    assert result.exit_code == 1
    assert "no shot" in " ".join(json.loads(result.stdout)["reasons"])


@pytest.mark.whole_way
def test_a_missing_source_keeps_the_shot_and_names_the_file_to_add(run, mixed_shot, tmp_path):
    some = [f for f in mixed_shot.files if f.suffix != ".blf"]
    result = run("ingest", "mixed", *some, "--out", tmp_path, "--shot", "x", "--json")
    assert result.exit_code == 1
    reasons = " ".join(json.loads(result.stdout)["reasons"])
    assert "no file of source can" in reasons
    assert "p_brake" in reasons


@pytest.mark.parametrize("command", ["identify", "show", "export"])
def test_a_shot_file_whose_name_is_a_path_writes_nothing_elsewhere(run, stored, tmp_path, monkeypatch, command):
    folder = tmp_path / "a" / "b"
    folder.mkdir(parents=True)
    monkeypatch.chdir(folder)
    evil = Path(shutil.copy(stored, folder / "0001.h5"))
    with h5py.File(evil, "r+") as file:
        file["entry/entry_identifier"][()] = "../../x"
    before = sorted(tmp_path.rglob("*"))
    done = run(command, evil, *(("--format", "csv") if command == "export" else ()))
    assert done.exit_code == 3
    assert "the shot's name '../../x' holds '/'" in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert sorted(tmp_path.rglob("*")) == before


def test_a_file_that_is_written_while_it_is_read_is_refused(run, files, tmp_path, monkeypatch):
    check = ingest.check_shot

    def while_it_is_checked(*given):
        with files["camera"].open("ab") as file:
            file.write(b"\n")
        return check(*given)

    monkeypatch.setattr(ingest, "check_shot", while_it_is_checked)
    result = run("ingest", "field-2013", *files.values(), "--out", tmp_path / "out")
    refused(result, tmp_path / "out", files["camera"].name, "was written while it was read")


def special(kind: str, path: Path) -> None:
    """Put what is no file in a file's place."""
    path.parent.mkdir(exist_ok=True)
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "device":
        path.symlink_to("/dev/zero")
    elif kind == "directory":
        path.mkdir()
    else:
        with socket.socket(socket.AF_UNIX) as bound:
            home = Path.cwd()
            os.chdir(path.parent)  # the name of a socket is short
            try:
                bound.bind(path.name)
            finally:
                os.chdir(home)


@pytest.mark.skipif(os.name == "nt", reason="such files are those of POSIX")
@pytest.mark.parametrize("kind", ["pipe", "device", "directory", "socket"])
@pytest.mark.parametrize(
    "words",
    [
        "campaign shots", "campaign shots/0006.h5 shots/0006.h5", "campaign report.json", "identify shots",
        "identify shots/0006.h5", "explain report.json", "show shots/0006.h5", "show daq.csv", "check rig.toml",
        "ingest field-2013 daq.csv", "ingest rig.toml daq.csv", "ingest field-2013 shots --batch",
        "export shots/0006.h5 --format csv", "predict mixed --from shots/0006.h5", "predict rig.toml",
        "log 0006 --dir shots", "log 0006 notes=x --dir shots", "log shots/0006.h5 notes=x", "log 0001 --dir logged",
        "log 0001 notes=x --dir logged", "simulate rig.toml",
        "identify shots --rig rig.toml",
    ],
)  # fmt: skip
def test_what_is_no_file_is_never_opened(run, tmp_path, monkeypatch, kind, words):
    for name in ("shots/0006.h5", "rig.toml", "daq.csv", "report.json", "logged/shotlog.csv"):
        special(kind, tmp_path / name)
    (tmp_path / "logged" / "0001.h5").touch()
    monkeypatch.chdir(tmp_path)
    result = run(
        *words.split(),
        *(["--out", "out"] if words.split()[0] not in ("log", "check", "show", "explain", "predict") else []),
    )
    refused(result, tmp_path / "out")
    assert not (tmp_path / "shots" / "shotlog.csv").exists()
