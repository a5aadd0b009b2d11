"""Jobs on a Dask cluster: many machines instead of many processes or threads of one.

Use it where one machine takes too long; needs the extra ``cluster`` here, and this package and the files of the jobs on
every worker. Start workers with one thread each (``dask worker ADDRESS --nthreads 1``): PyBullet allows no second
thread. A worker that dies costs nothing but time, Dask gives its jobs to another one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, TypeVar

J = TypeVar("J")
R = TypeVar("R")

CONNECTION_TIMEOUT = 20.0  # s


class ClusterError(Exception):
    """The cluster cannot be used; the text names the remedy."""


def run_on_cluster(
    do: Callable[[J], R], jobs: Sequence[J], address: str, wanted: Callable[[J], bool] = lambda job: True
) -> Iterator[tuple[J, R]]:
    """Do all jobs on the workers of a scheduler and yield each with its result as it finishes.

    Parameters
    ----------
    do : callable
        Of a module, so that a worker can import it.
    jobs : sequence
        Each can be pickled.
    address : str
        Of the scheduler, such as ``tcp://10.0.0.1:8786``.
    wanted : callable
        Whether a job is to be done, asked again with each result; jobs that are no longer wanted are cancelled.

    Raises
    ------
    ClusterError
        Dask is not installed, no scheduler answers at the address, or a worker has several threads.
    distributed.KilledWorker
        A job took several workers down with it.
    """
    try:
        from distributed import Client, as_completed
        from distributed.comm.addressing import parse_address, parse_host_port
    except ImportError as error:
        raise ClusterError("a cluster needs Dask: pip install 'mbf-flex[cluster]'") from error
    try:
        if (parsed := parse_address(address))[0] == "tcp":
            parse_host_port(parsed[1])  # the client, which a wrong address leaves half made, would end with a traceback
        client = Client(address, timeout=CONNECTION_TIMEOUT, set_as_default=False)
    except (OSError, ValueError) as error:
        raise ClusterError(f"no scheduler answers at {address}: {error}") from error
    with client:
        _refuse_threads(client)
        running = {client.submit(do, job, pure=False): job for job in filter(wanted, jobs)}
        for finished in as_completed(running, loop=client.loop):
            job = running.pop(finished)
            if finished.status != "cancelled":
                yield job, finished.result()
                client.cancel([future for future, other in running.items() if not wanted(other)])


def _refuse_threads(client: Any) -> None:
    """A second job in a process would share its simulator; workers that come later are not looked at."""
    workers = client.scheduler_info(n_workers=-1)["workers"]
    shared = [name for name, worker in workers.items() if worker["nthreads"] > 1]
    if shared:
        raise ClusterError(f"workers must have one thread (--nthreads 1), these have more: {', '.join(shared)}")
