"""Giving way beside a path that is kept: ``give_way``, a part of the reference trees.

When to use: in a tree that drives on along the same path after a recovery. When not: in one that plans after each.
"""

from __future__ import annotations

from py_trees.behaviour import Behaviour
from py_trees.behaviours import Success
from py_trees.composites import Selector, Sequence

from mbf_abstract.executives.conditions import Do
from mbf_abstract.executives.detours import UpdatePath
from mbf_abstract.executives.leaves import Recovery
from mbf_abstract.executives.trees.options import TreeOptions

OFF_PATH = 0.3
"""A robot farther from its path [m] after it gave way plans anew, instead of driving back to that."""


def give_way(options: TreeOptions) -> Behaviour:
    """Let somebody pass; where that led off the path, plan anew, as the path may lead around who has left since."""
    o = options
    on_path = Do("still on its path?", lambda mission: mission.robot_is_near_path(OFF_PATH))
    anew = UpdatePath("plan from there", o.planner, longest=o.longest_update, refiner=o.refiner, once=True)
    path = Selector("path from there", memory=True, children=[on_path, anew, Success("keeps its path")])
    return Sequence("give way", memory=True, children=[Recovery(o.give_way), path])
