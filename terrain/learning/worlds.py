"""Which world an environment builds for a seed: always one scenario, or those of an evaluation of ``mbf bench``.

The evaluations drive the seeds 0 and 1 of each level unless other ones are asked for: leave the first ones out of a
training (``seeds`` of the environment), and a comparison is on worlds that the policy has never seen.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from mbf_abstract.config.findings import ConfigError, Finding
from terrain.experiments.evaluation import indoor, moving, outdoor
from terrain.scenarios.scenario import Scenario, load_scenario
from terrain.worlds.occupancy import read_occupancy

Worlds = Callable[[int], tuple[Scenario, int]]
"""Scenario and seed of its run, for a seed of the environment."""


def one_world(scenario: Scenario | str) -> Worlds:
    """Return a scenario, the name of a shipped one or a file; a seed is the one of ``mbf run --seed``.

    Raises
    ------
    ConfigError
        There is no such scenario, it has several robots, or the file is wrong; all findings.
    """
    loaded = load_scenario(scenario) if isinstance(scenario, str) else scenario
    if loaded.robots:
        raise ConfigError([Finding(loaded.name, 1, "robots", "one robot, for an environment", "several")])
    return lambda seed: (loaded, seed)


def bench_indoor(levels: Sequence[int] = range(indoor.LEVELS)) -> Worlds:
    """Return the rooms of ``mbf bench indoor``: the seed counts through the levels, then through the rooms' seeds.

    Raises
    ------
    ValueError
        There are no levels, or one that the evaluation does not have.
    """
    _check(levels, indoor.LEVELS)
    return lambda seed: (indoor.room(levels[seed % len(levels)], seed // len(levels)), seed // len(levels))


def bench_outdoor(levels: Sequence[int] = range(outdoor.LEVELS)) -> Worlds:
    """Return the generated terrains of ``mbf bench outdoor``, counted likewise."""
    _check(levels, outdoor.LEVELS)
    return lambda seed: (outdoor.generated(levels[seed % len(levels)]), seed // len(levels))


def bench_moving(levels: Sequence[int] = range(moving.LEVELS), people: str = moving.PARTS[0]) -> Worlds:
    """Return the halls of ``mbf bench moving``, counted likewise; ``people`` are "yielding" or "blind" ones.

    Raises
    ------
    ValueError
        As for ``bench_indoor``, or there are no such people.
    """
    _check(levels, moving.LEVELS)
    if people not in moving.PARTS:
        raise ValueError(f"people: expected one of {', '.join(moving.PARTS)}, got {people!r}")
    grid = read_occupancy(moving.HALL)
    return lambda seed: (
        moving.hall(levels[seed % len(levels)], seed // len(levels), people, grid),
        seed // len(levels),
    )


def _check(levels: Sequence[int], count: int) -> None:
    if not levels or not all(isinstance(level, int | np.integer) and 0 <= level < count for level in levels):
        raise ValueError(f"levels: expected at least one from 0 to {count - 1}, got {list(levels)}")
