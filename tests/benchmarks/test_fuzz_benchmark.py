"""A bounded run of a coverage-guided fuzzer over all readers: no foreign exception, no hang, no growth without bound.

`RECOIL_DAQ_FUZZ_S` sets how long it runs, in seconds (60 by default).
"""

from __future__ import annotations

import os
import re
import subprocess
import sys

import pytest

SECONDS = int(os.environ.get("RECOIL_DAQ_FUZZ_S", "60"))
HANG_S = 5


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
