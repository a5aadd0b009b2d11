"""The terms of a trajectory's cost that MPPI and DWA share.

A critic is a function from ``Rollouts`` to one cost a sample, (samples,) float32 without the weight, or None where it
does not apply, e.g. that of the goal far from it. To add one, write the function, list it in ``CRITICS``, and add its
weight to ``CriticParameters`` under the same name.
"""

from collections.abc import Callable

from mbf_costmap_nav.critics.obstacle_critic import obstacle
from mbf_costmap_nav.critics.rollouts import CriticParameters, Float32Array, Rollouts
from mbf_costmap_nav.critics.terms import (
    goal,
    goal_angle,
    path_align,
    path_angle,
    path_follow,
    prefer_forward,
    twirling,
)

Critic = Callable[[Rollouts], Float32Array | None]

CRITICS: dict[str, Critic] = {
    critic.__name__: critic
    for critic in (obstacle, goal, goal_angle, path_align, path_follow, path_angle, prefer_forward, twirling)
}
"""The critics in the order in which their costs are summed up, by the names of their weights."""

__all__ = ["CRITICS", "Critic", "CriticParameters", "Rollouts"]
