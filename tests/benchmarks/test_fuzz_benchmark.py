"""A bounded run of a coverage-guided fuzzer over all readers: no foreign exception, no hang, no growth without bound.

`RECOIL_DAQ_FUZZ_S` sets how long it runs, in seconds (60 by default). Heads of every text format are spoilt at random,
too: `RECOIL_DAQ_SPOILT_HEADS` sets how many of each (100 by default).
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys

import pytest

from tests.benchmarks.spoilt_heads import FORMATS

SECONDS = int(os.environ.get("RECOIL_DAQ_FUZZ_S", "60"))
HANG_S = 5
SPOILT = int(os.environ.get("RECOIL_DAQ_SPOILT_HEADS", "100"))
MOST_MB = 500
"""Memory by which all spoilt heads of a format may make a process grow."""


def test_no_bytes_make_a_reader_fail_otherwise_than_by_its_own_error(tmp_path, capsys):
    pytest.importorskip("atheris", reason="atheris, of the extra bench, is not installed")
    done = subprocess.run(
        [
            sys.executable, "-m", "tests.benchmarks.fuzz_readers", str(tmp_path / "corpus"),
            f"-max_total_time={SECONDS}", f"-timeout={HANG_S}", "-rss_limit_mb=1500", "-max_len=65536",
            f"-artifact_prefix={tmp_path}/",
        ],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    said = done.stderr + done.stdout
    runs = re.findall(r"Done (\d+) runs in (\d+) second", said)
    with capsys.disabled():
        print(f"\n{runs[0][0] if runs else 'no'} files in {SECONDS} s, exit code {done.returncode}")
    assert done.returncode == 0, said[-4000:]
    assert runs


@pytest.mark.parametrize("name", FORMATS)
def test_a_spoilt_head_is_read_or_refused_in_one_line_and_takes_little(name, capsys):
    done = subprocess.run(
        [sys.executable, "-m", "tests.benchmarks.spoilt_heads", name, str(SPOILT)],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-4000:]
    found = json.loads(done.stdout.splitlines()[-1])
    with capsys.disabled():
        print(
            f"\n{name}: {SPOILT} heads, read {found['ends']['0']}, refused {found['ends']['3']}, "
            f"otherwise {len(found['faults'])}; at most {found['longest_s']:.2f} s and {found['grown_mb']:.0f} MB"
        )
    assert not found["faults"], found["faults"][0]
    assert found["longest_s"] < HANG_S
    assert found["grown_mb"] < MOST_MB
