"""Jobs in worker processes of this machine, each done exactly once, also when a worker dies.

When to use: for runs of seconds to minutes, as those of sweeps and experiments. When not: for many short jobs, the
hand-over costs more than they do.

Each worker keeps to one processor core, if there are enough (``own_core.py``).
"""

from __future__ import annotations

import itertools
import os
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import current_process, get_context
from types import FrameType
from typing import TypeVar

from terrain.sweeps.own_core import keep_to_one_core
from terrain.sweeps.starting_workers import interrupts_arrive, interrupts_wait

J = TypeVar("J")
R = TypeVar("R")

PARENT_CHECK = 1.0  # s between two looks of a worker whether the process that feeds it still lives
MAX_POOLS = 5  # pools that are started anew after a worker died, before it is given up


def run_in_workers(
    do: Callable[[J], R], jobs: Sequence[J], workers: int, wanted: Callable[[J], bool] = lambda job: True
) -> Iterator[tuple[J, R]]:
    """Do all jobs in ``workers`` processes and yield each with its result as it finishes.

    Parameters
    ----------
    do : callable
        Of a module, so that a worker can import it. It runs on the worker's main thread.
    jobs : sequence
        Each can be pickled.
    wanted : callable
        Whether a job is to be done, asked when its turn comes, so that results may decide it.

    Raises
    ------
    BrokenProcessPool
        Workers died more than ``MAX_POOLS`` times.
    """
    left = list(jobs)
    for attempt in range(MAX_POOLS):
        try:
            for job, result in _run_in_pool(do, filter(wanted, tuple(left)), workers):
                left.remove(job)
                yield job, result
            return
        except BrokenProcessPool:
            if attempt == MAX_POOLS - 1:
                raise


def _run_in_pool(do: Callable[[J], R], waiting: Iterator[J], workers: int) -> Iterator[tuple[J, R]]:
    """Keep a pool busy; no more jobs are handed out than it can work on, so that a stop is quick."""
    running = dict[Future[R], J]()
    pool = ProcessPoolExecutor(workers, get_context("spawn"), _begin_worker, (os.getpid(), workers))
    try:
        with interrupts_wait():  # the first job starts all workers
            for job in itertools.islice(waiting, workers):
                running[pool.submit(do, job)] = job
        while running:
            for done in wait(running, return_when=FIRST_COMPLETED).done:
                yield running.pop(done), done.result()
                for job in itertools.islice(waiting, 1):
                    running[pool.submit(do, job)] = job
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _begin_worker(parent: int, workers: int) -> None:
    end_with_the_parent(parent)
    number = current_process().name.rpartition("-")[2]  # workers that live at the same time have numbers in a row
    if number.isdigit():
        keep_to_one_core(int(number), workers)


def end_with_the_parent(parent: int) -> None:
    """Let a worker end soon after its parent was killed; it would wait for work without end.

    It also ends at once on a signal, so that its job is given to another one: what a navigation server would do
    first, stop its robot, is of no use to a simulated one. A worker that outlived a Ctrl-C would wait for work while
    its parent, interrupted once more, waits for it.
    """

    def check(number: int, frame: FrameType | None) -> None:
        if os.getppid() != parent:
            os._exit(1)

    for ending in (signal.SIGTERM, signal.SIGINT):
        signal.signal(ending, lambda number, frame: os._exit(128 + number))
    interrupts_arrive()
    if hasattr(signal, "setitimer"):
        signal.signal(signal.SIGALRM, check)
        signal.setitimer(signal.ITIMER_REAL, PARENT_CHECK, PARENT_CHECK)
