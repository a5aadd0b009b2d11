"""Jobs in worker processes that may hang, crash or leave threads behind: each costs its own job, never the others.

When to use: for jobs that run code of strangers, such as the plugins that an evaluation judges. When not: where a job
that lost its worker should be done again; see ``terrain.sweeps.worker_pool``.

A worker that dies is replaced, and its job has no result but the reason. A job that takes longer than ``time_limit``
ends its worker from a thread of the interpreter's own, which needs no lock of Python: also in a compiled loop without
an end. A worker in which a job left a thread at work is replaced after it, because that thread would slow down the
next ones.
"""

from __future__ import annotations

import faulthandler
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Any, Generic, TypeVar

from mbf_abstract.time.clock import wall_seconds
from terrain.sweeps.worker_pool import end_with_the_parent

J = TypeVar("J")
R = TypeVar("R")

ENDED_BY_WATCHDOG = 1  # the exit code that faulthandler gives a process


@dataclass(frozen=True)
class Lost:
    """A job that has no result: why its worker ended."""

    reason: str


@dataclass
class _Worker(Generic[J]):
    """A process, the end of the pipe to it, and what it is at."""

    process: BaseProcess
    pipe: Connection
    job: J | None = None
    began: float = 0.0

    def end(self) -> None:
        """End the process, whatever it does."""
        self.process.kill()
        self.process.join()
        self.pipe.close()


def run_guarded(
    do: Callable[[J], R], jobs: Sequence[J], workers: int, time_limit: float
) -> Iterator[tuple[J, R | Lost]]:
    """Do all jobs in ``workers`` processes; yield each with its result, or with why it has none, as it finishes.

    Parameters
    ----------
    do : callable
        Of a module, so that a worker can import it. It runs on the worker's main thread and raises nothing.
    jobs : sequence
        Each can be pickled.
    workers : int
    time_limit : float
        Wall time [s] that a job may take.
    """
    left = list(reversed(jobs))
    with ExitStack() as at_end:
        team: list[_Worker[J]] = []
        at_end.callback(_end_all, team)
        while left or any(worker.job is not None for worker in team):
            while left and len(team) < workers:
                team.append(_start(do, time_limit))
            for worker in team:
                if worker.job is None and left:
                    worker.job, worker.began = left.pop(), wall_seconds()
                    worker.pipe.send(worker.job)
            ready = wait([worker.pipe for worker in team if worker.job is not None])
            for worker in [worker for worker in team if worker.pipe in ready]:
                job, worker.job = worker.job, None
                result, is_fit = _answer(worker, time_limit)
                if not is_fit:
                    team.remove(worker)
                    worker.end()
                assert job is not None
                yield job, result


def _end_all(team: Sequence[_Worker[Any]]) -> None:
    for worker in team:
        worker.end()


def _start(do: Callable[[J], R], time_limit: float) -> _Worker[J]:
    context = get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=_work, args=(do, theirs, time_limit), daemon=True)
    process.start()
    theirs.close()
    return _Worker(process, ours)


def _answer(worker: _Worker[J], time_limit: float) -> tuple[Any, bool]:
    """A worker's result, or why there is none; and whether the worker can take another job."""
    try:
        result, is_fit = worker.pipe.recv()
        return result, bool(is_fit)
    except (EOFError, OSError):
        worker.process.join()
        if worker.process.exitcode == ENDED_BY_WATCHDOG and wall_seconds() - worker.began >= time_limit:
            return Lost(f"hung: the run did not end within {time_limit:g} s"), False
        return Lost(f"crashed: the process of the run ended with code {worker.process.exitcode}"), False


def _work(do: Callable[[J], R], pipe: Connection, time_limit: float) -> None:
    """Do jobs until the pipe is closed."""
    end_with_the_parent(_parent_id())
    while True:
        try:
            job = pipe.recv()
        except EOFError:
            return
        faulthandler.dump_traceback_later(time_limit, exit=True)
        before = set(threading.enumerate())
        result = do(job)
        faulthandler.cancel_dump_traceback_later()
        pipe.send((result, not set(threading.enumerate()) - before))


def _parent_id() -> int:
    from multiprocessing import parent_process

    parent = parent_process()
    assert parent is not None and parent.pid is not None
    return parent.pid
