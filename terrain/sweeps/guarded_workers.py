"""Jobs in worker processes that may hang, crash or leave threads behind: each costs its own job, never the others.

When to use: for jobs that run code of strangers, such as the plugins that an evaluation judges. When not: where a job
that lost its worker should be done again; see ``terrain.sweeps.worker_pool``.

A worker that dies is replaced, and its job has no result but the reason; one that it had not begun, because it died
after its last job, is done by another worker. A job that takes longer than ``time_limit``
ends its worker from a thread of the interpreter's own, which needs no lock of Python: also in a compiled loop without
an end. A worker in which a job left a thread at work is replaced after it, because that thread would slow down the
next ones. Jobs may start processes of their own, which end with their worker.
"""

from __future__ import annotations

import faulthandler
import os
import signal
import threading
from collections.abc import Callable, Generator, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Any, Generic, TypeVar

from mbf_abstract.time.clock import wall_seconds
from terrain.sweeps.starting_workers import interrupts_wait
from terrain.sweeps.worker_pool import end_with_the_parent

J = TypeVar("J")
R = TypeVar("R")

CHECK = 1.0  # s between two looks whether the workers still live
ENDED_BY_WATCHDOG = 1  # the exit code that faulthandler gives a process


@dataclass(frozen=True)
class Lost:
    """A job that has no result: why its worker ended."""

    reason: str


@dataclass(frozen=True)
class _Begun:
    """What a worker says before it does a job."""


@dataclass
class _Worker(Generic[J]):
    """A process, the end of the pipe to it, and what it is at."""

    process: BaseProcess
    pipe: Connection
    job: J | None = None
    began: float = 0.0
    is_used: bool = False
    has_begun: bool = False

    def take(self, job: J) -> bool:
        """Begin a job; False if the process has died since its last one."""
        self.job, self.began, self.has_begun = job, wall_seconds(), False
        try:
            self.pipe.send(job)
        except OSError:
            return not self.is_used  # one that dies before its first job would do so again: that job is lost
        return True

    def end_children(self) -> None:
        """End the processes that it started, also after its own end."""
        if hasattr(os, "killpg") and self.process.pid is not None:
            with suppress(ProcessLookupError, PermissionError):  # no group yet, or nobody in it
                os.killpg(self.process.pid, signal.SIGKILL)

    def end(self) -> None:
        """End the process and those that it started, whatever they do."""
        self.end_children()
        self.process.kill()
        self.process.join()
        self.pipe.close()


def run_guarded(
    do: Callable[[J], R],
    jobs: Sequence[J],
    workers: int,
    time_limit: float,
    leaves_traces: Callable[[J], bool] = lambda job: False,
) -> Generator[tuple[J, R | Lost], None, None]:
    """Do all jobs in ``workers`` processes; yield each with its result, or with why it has none, as it finishes.

    Parameters
    ----------
    do : callable
        Of a module, so that a worker can import it. It runs on the worker's main thread and raises nothing.
    jobs : sequence
        Each can be pickled.
    time_limit : float
        Wall time [s] that a job may take.
    leaves_traces : callable
        Whether a job may change its process, such as by the state of a module; no other job follows it there.
    """
    left = list(reversed(jobs))
    with ExitStack() as at_end:
        team: list[_Worker[J]] = []
        at_end.callback(_end_all, team)
        while left or any(worker.job is not None for worker in team):
            while left and len(team) < workers:
                team.append(_start(do, time_limit))
            for worker in [worker for worker in team if worker.job is None][: len(left)]:
                job = left.pop()
                if not worker.take(job):
                    left.append(job)
                    team.remove(worker)
                    worker.end()
            busy = [worker for worker in team if worker.job is not None]
            ready = wait([worker.pipe for worker in busy], CHECK)
            for worker in [worker for worker in busy if worker.pipe in ready or not worker.process.is_alive()]:
                result, is_fit = _answer(worker, time_limit)
                if isinstance(result, _Begun):
                    worker.has_begun = True
                    continue
                done, died_before = worker.job, worker.is_used and not worker.has_begun
                worker.job, worker.is_used = None, True
                assert done is not None
                if not is_fit or leaves_traces(done):
                    team.remove(worker)
                    worker.end()
                if died_before:
                    left.append(done)
                else:
                    yield done, result


def _end_all(team: Sequence[_Worker[Any]]) -> None:
    for worker in team:
        worker.end()


def _start(do: Callable[[J], R], time_limit: float) -> _Worker[J]:
    context = get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=_work, args=(do, theirs, time_limit), daemon=False)  # may have children
    with interrupts_wait():
        process.start()
    theirs.close()
    return _Worker(process, ours)


def _answer(worker: _Worker[J], time_limit: float) -> tuple[Any, bool]:
    """A worker's result, or why there is none; and whether the worker can take another job."""
    try:
        if not worker.process.is_alive():
            worker.end_children()  # which hold its end of the pipe open
            if not worker.pipe.poll(CHECK):
                raise EOFError
        result, is_fit = worker.pipe.recv()
        return result, bool(is_fit)
    except (EOFError, OSError):
        worker.process.join(CHECK)
        if worker.process.exitcode == ENDED_BY_WATCHDOG and wall_seconds() - worker.began >= time_limit:
            return Lost(f"hung: the run did not end within {time_limit:g} s"), False
        return Lost(f"crashed: the process of the run ended with code {worker.process.exitcode}"), False


def _work(do: Callable[[J], R], pipe: Connection, time_limit: float) -> None:
    """Do jobs until the pipe is closed."""
    end_with_the_parent(_parent_id())
    if hasattr(os, "setpgrp"):
        os.setpgrp()  # so that it can be ended together with its children
    while True:
        try:
            job = pipe.recv()
        except EOFError:
            return
        pipe.send((_Begun(), True))
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
