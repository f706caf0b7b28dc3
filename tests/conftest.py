"""Settings of the whole test suite."""

import os

import pytest
from hypothesis import settings

LONG_FILES = (
    "recoil_daq/test_live.py", "recoil_daq/test_cli.py", "contracts/test_reader_rules.py",
    "recoil_daq/test_live_crash.py", "recoil_daq/test_bad_input.py",
)  # fmt: skip
"""Files that take longest, as most of them wait for devices: begun first, they do not keep one worker for the end."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the tests of the longest files first."""
    order = {name: i for i, name in enumerate(LONG_FILES)}
    items.sort(key=lambda item: order.get("/".join(item.path.parts[-2:]), len(order)))


if "PYTEST_XDIST_WORKER" in os.environ:
    # several workers, each with threads that spin while they wait for one another, take half as long again
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# the same examples at every run: a failure belongs to the change under test, not to chance; explore before a release
settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.register_profile("explore", deadline=None, max_examples=1000)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "repeatable"))
