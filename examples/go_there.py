"""One script for both maps: plan, look at the cost, drive, and on failure recover by the outcome code.

Run it twice and change nothing but the configuration::

    python examples/go_there.py outdoor mesh
    python examples/go_there.py indoor costmap
"""

import argparse
import sys

from mbf_abstract.config.findings import ConfigError
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.time.program_end import interruptible
from terrain.session.session import Session, SessionOptions

RECOVERY_FOR = {ExePathOutcome.COLLISION: "back_up", ExePathOutcome.ROBOT_STUCK: "back_up"}


def main(scenario: str, backend: str) -> bool:
    with Session(scenario, SessionOptions(backend=backend)) as session:
        navigator, goal = session.navigator, session.goals[0]
        for attempt in range(5):
            plan = navigator.get_path(goal)
            print(f"{plan.outcome_name}: {plan.message}; cost {plan.cost:.1f}, path {plan.path}")
            if plan.path is None:
                return False
            drive = navigator.exe_path(plan.path)
            print(f"{drive.outcome_name}: {drive.message}; {drive.dist_to_goal:.2f} m from the goal")
            if drive.success:
                return True
            recovery = navigator.recover(RECOVERY_FOR.get(drive.outcome, "wait"))
            print(f"attempt {attempt + 1}, recovery {recovery.used_plugin}: {recovery.message}")
    return False


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
