"""Steps of our environments per second of one core, beside Gymnasium's own CartPole.

    python benchmarks/environment_speed.py

CPU time of this process counts, so that other work on the machine hardly matters; kernels are compiled and worlds are
built once before the clock starts. CartPole integrates four numbers: it shows what Gymnasium itself costs.
"""

from __future__ import annotations

import argparse
import time

import gymnasium
import numpy as np

import terrain.learning.ids  # noqa: F401 - registers the names
from mbf_abstract.time.program_end import interruptible
from terrain.learning.environment import NavigationEnvironment

STEPS, RESETS = 200, 5
CASES = {
    "CartPole-v1": {},
    "mbf/bench_indoor-v1, level 0": {"levels": [0]},
    "mbf/bench_indoor-v1, level 9": {"levels": [9]},
    "mbf/bench_indoor-v1, level 0, mesh": {"levels": [0], "backend": "mesh"},
    "mbf/bench_indoor-v1, level 0, no plan": {"levels": [0], "observation": {"waypoints": 0}},
    "mbf/indoor-v0 (Bullet)": {},
    "mbf/bench_outdoor-v1, level 0 (Bullet)": {"levels": [0]},
    "mbf/bench_outdoor-v1, level 0, patch": {"levels": [0], "observation": {"scan_sectors": 0, "patch_cells": 15}},
}


def measure(name: str, arguments: dict) -> tuple[float, float]:
    """Return steps per second of CPU time, and CPU seconds of a reset."""
    environment = gymnasium.make(name, disable_env_checker=True, **arguments)
    rng = np.random.default_rng(0)
    environment.reset(seed=0)
    resets = steps = done = 0.0
    over, number = True, 1
    while done < STEPS or number <= RESETS:
        began = time.process_time()
        if over:
            environment.reset(seed=number % RESETS)
            number, over = number + 1, False
            resets += time.process_time() - began
            continue
        if isinstance(environment.unwrapped, NavigationEnvironment):
            action = np.array([0.3, rng.uniform(-0.3, 0.3)], np.float32)
        else:
            action = int(rng.integers(2))
        *_, terminated, truncated, _ = environment.step(action)
        steps, done = steps + time.process_time() - began, done + 1
        over = terminated or truncated or done % (STEPS / RESETS) == 0
    environment.close()
    return done / steps, resets / (number - 1)


def main() -> None:
    """Measure all cases."""
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    print(f"{'environment':42} {'steps/s':>9} {'reset [ms]':>11}")
    for case, arguments in CASES.items():
        rate, reset = measure(case.split(",")[0].split(" ")[0], arguments)
        print(f"{case:42} {rate:9.0f} {1000.0 * reset:11.1f}", flush=True)


if __name__ == "__main__":
    with interruptible():
        main()
