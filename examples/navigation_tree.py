"""Drive a scenario with a behaviour tree: the ready one with one branch of your own, on either map.

The tree plans, drives while a second planner updates the path, recovers by outcome code, and, our addition, gives up
when it takes too long::

    python examples/navigation_tree.py indoor costmap
    python examples/navigation_tree.py outdoor mesh
"""

import sys

from mbf_abstract.executives.pacing import TimeLimit
from mbf_abstract.executives.reference_trees import TreeOptions, navigation_tree
from mbf_abstract.executives.tree_drawing import as_text
from mbf_abstract.executives.tree_executive import TreeExecutive
from terrain.session.session import Session, SessionOptions


def main(scenario: str, backend: str, time_limit: float = 600.0) -> bool:
    tree = TimeLimit("in time", navigation_tree(TreeOptions(second_planner_pause=1.0)), time_limit)
    print(as_text(tree))
    with Session(scenario, SessionOptions(backend=backend)) as session:
        result = TreeExecutive(tree, session.navigator).run(session.goals[0])
        print(f"{result.message}; at {session.clock.now():.1f} s the robot is at {session.navigator.robot_pose()}")
    return result.success


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    sys.exit(0 if main(sys.argv[1], sys.argv[2]) else 1)
