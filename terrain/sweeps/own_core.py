"""A processor core for each worker, also among workers of other sweeps on this machine.

When to use: in a worker that drives in simulated time. Its threads work by turns, and a turn that is handed to another
core costs about twice as much. When not: for work on several cores.

A core is taken by a socket of its name, which the system gives back when the process ends, however it ends.
"""

from __future__ import annotations

import os
import socket
from collections.abc import Sequence


def keep_to_one_core(number: int, workers: int) -> None:
    """Give worker ``number`` of so many a core of its own.

    Where they need all cores, its number says which. Where they leave some, it takes one that no worker of another
    sweep has. Does nothing where there are fewer cores than workers, or no way to choose.
    """
    if not hasattr(os, "sched_setaffinity"):
        return
    cores = sorted(os.sched_getaffinity(0))
    if workers <= len(cores):
        first = number % len(cores)
        core = take_one_of(cores[first:] + cores[:first]) if workers < len(cores) else cores[first]
        os.sched_setaffinity(0, {core})


def take_one_of(cores: Sequence[int]) -> int:
    """Take the first that nobody has taken, for as long as this process lives; the first if all are taken."""
    for core in cores:
        name = socket.socket(socket.AF_UNIX)
        try:
            name.bind(f"\0mbf_worker_on_core_{core}")
        except OSError:
            name.close()
            continue
        name.detach()  # it stays open for as long as this process lives
        return core
    return cores[0]
