"""A cluster of machines as workers: dask.distributed, which an extra brings."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager

from recoil_acquisition.errors import WorkerError
from recoil_acquisition.extras import CLUSTER
from recoil_daq.workers import Workers

CONNECT_S = 10.0
"""A scheduler that has not answered by then does not."""


@contextmanager
def workers_at(address: str) -> Iterator[Workers]:
    """Let the workers of a cluster do the work, which read and write the same files under the same names.

    What a worker was at that is lost is done again by another one.

    Parameters
    ----------
    address
        Of the scheduler, such as ``tcp://192.0.2.1:8786``.

    Raises
    ------
    WorkerError
        If the extra is not installed, the scheduler does not answer, or it has no workers.
    """
    if not CLUSTER.is_installed:
        raise WorkerError(f"{CLUSTER.module}, which --cluster needs, is not installed", remedy=CLUSTER.remedy)
    from distributed import Client, KilledWorker
    from distributed.comm.core import CommClosedError

    # that a lost result is worked out again is what this promises, and no warning
    logging.getLogger("distributed.client").setLevel(logging.ERROR)
    try:
        client = Client(address, timeout=CONNECT_S, set_as_default=False)
    except (OSError, ValueError) as error:
        raise WorkerError(
            f"no scheduler answers at {address}",
            found=" ".join(str(error).split()) or type(error).__name__,
            remedy="start `dask scheduler` there, and name it as tcp://HOST:PORT",
        ) from error
    with client:
        if not client.nthreads():
            raise WorkerError(
                f"the scheduler at {address} has no workers",
                remedy="start `dask worker --nthreads 1 ADDRESS` on each machine",
            )
        # unlike a process pool's, its futures do not end with it
        with (
            client.get_executor(pure=False) as executor,
            Workers(executor=executor, lost=(KilledWorker, CommClosedError)) as workers,
        ):
            yield workers
