"""Trajectory critics, one a file: each adds one term to the cost of every sampled trajectory.

``costmap.mppi`` and ``costmap.dwa`` score with the same critics; their weights differ. To add one, derive
``critics.base.Critic`` in a file of its own and list it in ``ALL_CRITICS``.
"""

from mbf_costmap_nav.critics.base import Critic, CriticParameters, Rollouts
from mbf_costmap_nav.critics.goal import GoalCritic
from mbf_costmap_nav.critics.goal_angle import GoalAngleCritic
from mbf_costmap_nav.critics.obstacle import ObstacleCritic
from mbf_costmap_nav.critics.path_align import PathAlignCritic
from mbf_costmap_nav.critics.path_angle import PathAngleCritic
from mbf_costmap_nav.critics.path_follow import PathFollowCritic
from mbf_costmap_nav.critics.prefer_forward import PreferForwardCritic
from mbf_costmap_nav.critics.twirling import TwirlingCritic

ALL_CRITICS: dict[str, type[Critic]] = {
    "obstacle": ObstacleCritic,
    "goal": GoalCritic,
    "goal_angle": GoalAngleCritic,
    "path_align": PathAlignCritic,
    "path_follow": PathFollowCritic,
    "path_angle": PathAngleCritic,
    "prefer_forward": PreferForwardCritic,
    "twirling": TwirlingCritic,
}

__all__ = ["ALL_CRITICS", "Critic", "CriticParameters", "Rollouts"]
