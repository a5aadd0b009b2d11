"""The names of our environments in Gymnasium; importing this module registers them.

``mbf/NAME-v0`` for every shipped scenario with one robot, and ``mbf/bench_indoor-v1``, ``mbf/bench_moving-v1`` and
``mbf/bench_outdoor-v1``, whose version is that of the evaluation.
``gymnasium.make("terrain.learning.ids:mbf/indoor-v0")`` imports it itself.
"""

from __future__ import annotations

import gymnasium

from terrain.scenarios.library import shipped_scenarios

SEVERAL_ROBOTS = frozenset({"two_couriers"})
ENVIRONMENT = "terrain.learning.environment"

for _name in sorted(shipped_scenarios().keys() - SEVERAL_ROBOTS):
    gymnasium.register(f"mbf/{_name}-v0", f"{ENVIRONMENT}:NavigationEnvironment", kwargs={"worlds": _name})
gymnasium.register("mbf/bench_indoor-v1", f"{ENVIRONMENT}:of_bench_indoor")
gymnasium.register("mbf/bench_moving-v1", f"{ENVIRONMENT}:of_bench_moving")
gymnasium.register("mbf/bench_outdoor-v1", f"{ENVIRONMENT}:of_bench_outdoor")
