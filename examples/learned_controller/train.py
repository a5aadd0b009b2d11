"""Train the policy by the cross-entropy method: five minutes of CPU time on each of two cores, with numpy alone.

    pip install '.[sim,gym]'
    python examples/learned_controller/train.py

A training that was stopped goes on after its last generation, with the same numbers as without the stop.

Each generation draws policies around the present mean, drives each in the same rooms, and moves mean and spread to the
best quarter (Rubinstein 1999). The rooms are those of ``mbf bench indoor``, but of other seeds than an evaluation has.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import signal
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from policy import COMMANDS, OBSERVED, WEIGHTS, action, start

from mbf_abstract.time.program_end import INTERRUPTED
from mbf_abstract.whole_files import write_whole
from terrain.learning.environment import of_bench_indoor

Numbers = NDArray[np.float64]
Job = tuple[Numbers, int]

STATE = Path(__file__).with_name("training.json")
GENERATIONS, POLICIES, ELITE, ROOMS = 6, 20, 5, 4
SPREAD, LEAST_SPREAD = 0.35, 0.05
LEVELS = (1, 3, 5, 7, 9)
FIRST_ROOM = 1000  # seed 200 of every level; an evaluation begins at seed 0
TIME_LIMIT = 45.0  # s of simulated time
SEED = 1


def drive(job: Job) -> float:
    """Return the sum of rewards of one policy in one room."""
    weights, room = job
    environment = of_bench_indoor(LEVELS, observation=OBSERVED, commands=COMMANDS, time_limit=TIME_LIMIT)
    try:
        seen, _ = environment.reset(seed=room)
        total, over = 0.0, False
        while not over:
            seen, reward, terminated, truncated, _ = environment.step(action(weights, seen))
            total, over = total + reward, terminated or truncated
        return total
    finally:
        environment.close()


def generation(
    number: int, mean: Numbers, spread: Numbers, drive_all: Callable[[Sequence[Job]], Sequence[float]]
) -> tuple[Numbers, Numbers, Numbers]:
    """Return mean and spread of the next generation, and the mean return of each policy of this one."""
    rng = np.random.default_rng([SEED, number])
    policies = mean + spread * rng.normal(size=(POLICIES, len(mean)))
    draws = len(LEVELS) * rng.integers(1000, size=ROOMS) + rng.permutation(len(LEVELS))[:ROOMS]
    jobs = [(policy, FIRST_ROOM + room) for policy in policies for room in draws.tolist()]
    returns = np.array(drive_all(jobs)).reshape(POLICIES, ROOMS).mean(axis=1)
    best = policies[np.argsort(-returns, kind="stable")[:ELITE]]
    return best.mean(axis=0), np.maximum(best.std(axis=0), LEAST_SPREAD), returns


def read_state() -> tuple[int, Numbers, Numbers]:
    """Return how many generations are done, mean and spread; ValueError where the file is none of ours."""
    if not STATE.is_file():
        return 0, start(), np.full(len(start()), SPREAD)
    try:
        state = json.loads(STATE.read_text())
        return state["generation"], np.array(state["mean"]), np.array(state["spread"])
    except (ValueError, TypeError, KeyError) as error:
        raise ValueError(f"{STATE}: expected the state of a training ({error}); without it one begins anew") from None


def write_state(done: int, mean: Numbers, spread: Numbers) -> None:
    """Keep what the next generation needs, and the weights for the controller."""
    state = {"generation": done, "mean": mean.tolist(), "spread": spread.tolist()}
    write_whole(STATE, json.dumps(state))
    write_whole(WEIGHTS, json.dumps(mean.tolist(), indent=2) + "\n")


def positive(text: str) -> int:
    """Read a whole number of at least 1."""
    if not (text.isdecimal() and int(text) > 0):
        raise argparse.ArgumentTypeError(f"expected a whole number of at least 1, got {text!r}")
    return int(text)


def main() -> None:
    """Train from where the last call has stopped."""
    parser = argparse.ArgumentParser(description="Train the policy.")
    parser.add_argument("--workers", type=positive, default=2)
    parser.add_argument("--generations", type=positive, default=GENERATIONS)
    asked = parser.parse_args()
    try:
        train(asked.workers, asked.generations)
    except ValueError as error:
        parser.exit(2, f"{error}\n")
    except KeyboardInterrupt:
        parser.exit(INTERRUPTED, "stopped; the next call goes on after the last generation\n")


def train(workers: int, generations: int) -> None:
    """Train up to a generation; Ctrl-C is left to this process."""
    done, mean, spread = read_state()
    with multiprocessing.Pool(workers, signal.signal, (signal.SIGINT, signal.SIG_IGN)) as pool:
        for number in range(done, generations):
            began = time.monotonic()
            mean, spread, returns = generation(number, mean, spread, lambda jobs: pool.map(drive, jobs, chunksize=2))
            write_state(number + 1, mean, spread)
            print(f"generation {number + 1}: returns {returns.mean():6.2f} mean, {returns.max():6.2f} best, ", end="")
            print(f"{time.monotonic() - began:4.0f} s", flush=True)


if __name__ == "__main__":
    main()
