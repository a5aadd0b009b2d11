"""Drive a scenario with a behaviour tree: the ready one with one branch of your own, on either map.

The tree plans, drives while a second planner updates the path, recovers by outcome code, and, our addition, gives up
when it takes too long::

    python examples/navigation_tree.py indoor costmap
    python examples/navigation_tree.py outdoor mesh
"""

import argparse
import sys

from mbf_abstract.config.findings import ConfigError
from mbf_abstract.executives.pacing import TimeLimit
from mbf_abstract.executives.reference_trees import TreeOptions, navigation_tree
from mbf_abstract.executives.tree_drawing import as_text
from mbf_abstract.executives.tree_executive import TreeExecutive
from mbf_abstract.time.program_end import interruptible
from terrain.session.session import Session, SessionOptions


def main(scenario: str, backend: str, time_limit: float = 600.0) -> bool:
    tree = TimeLimit("in time", navigation_tree(TreeOptions(second_planner_pause=1.0)), time_limit)
    print(as_text(tree))
    with Session(scenario, SessionOptions(backend=backend)) as session:
        result = TreeExecutive(tree, session.navigator).run(session.goals[0])
        print(f"{result.message}; at {session.clock.now():.1f} s the robot is at {session.navigator.robot_pose()}")
    return result.success


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenario", help="name of a shipped one, or a file")
    parser.add_argument("backend", help="map to drive on: mesh or costmap")
    given = parser.parse_args()
    with interruptible():  # Ctrl-C stops the robot first
        try:
            sys.exit(0 if main(given.scenario, given.backend) else 1)
        except ConfigError as error:
            parser.exit(2, f"{error}\n")
