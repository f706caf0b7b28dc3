"""Settings of the whole test suite."""

import os

from hypothesis import settings

if "PYTEST_XDIST_WORKER" in os.environ:
    # several workers, each with threads that spin while they wait for one another, take half as long again
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# the same examples at every run: a failure belongs to the change under test, not to chance; explore before a release
settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.register_profile("explore", deadline=None, max_examples=1000)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "repeatable"))
