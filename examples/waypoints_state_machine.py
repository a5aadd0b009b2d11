"""Plan all legs of a route first, choose the cheapest order, then drive the stored paths (Figure 4 of the MBF paper).

Only separate planning and driving make this possible: every pair of waypoints is planned before the robot moves, the
order follows from the costs the map gives, and while driving nothing is planned unless a leg fails. The same script
runs on both maps::

    python examples/waypoints_state_machine.py indoor costmap
    python examples/waypoints_state_machine.py indoor mesh
"""

import argparse
import sys
from dataclasses import dataclass, field
from itertools import permutations

from py_trees.common import Status

from mbf_abstract.config.findings import ConfigError
from mbf_abstract.executives.conditions import Do
from mbf_abstract.executives.leaves import ExePath, GetPath, Recovery
from mbf_abstract.executives.state_machine import State, StateMachine
from mbf_abstract.executives.tree_executive import TreeExecutive
from mbf_abstract.geometry import Path, Pose
from mbf_abstract.goals.goal_types import GetPathGoal
from mbf_abstract.goals.result_types import GetPathResult
from mbf_abstract.time.program_end import interruptible
from terrain.session.session import Session, SessionOptions

WAYPOINTS = [(7.5, 1.5), (1.5, 5.0), (6.0, 5.5), (3.5, 1.5)]  # x, y [m], all in the reception


@dataclass
class WaypointSequence:
    """Places to visit; place 0 is where the robot starts. ``paths`` and ``costs`` are stored by (from, to)."""

    places: list[Pose]
    paths: dict[tuple[int, int], Path] = field(default_factory=dict)
    costs: dict[tuple[int, int], float] = field(default_factory=dict)
    order: list[int] = field(default_factory=list)
    driven: list[int] = field(default_factory=list)

    def __post_init__(self) -> None:
        numbers = range(len(self.places))
        self.unplanned = [(i, j) for i in numbers for j in numbers if i != j and j != 0]

    def choose_order(self, mission) -> bool:
        """Take the order with the lowest sum of costs; legs without a path cannot be part of it."""

        def cost(order: tuple[int, ...]) -> float:
            return sum(self.costs.get(leg, float("inf")) for leg in zip((0, *order), order, strict=False))

        best = min(permutations(range(1, len(self.places))), key=cost)
        self.order = list(best)
        print(f"order {self.order}, cost {cost(best):.1f}")
        return cost(best) < float("inf")

    def take_stored_path(self, mission) -> bool:
        """Hand the stored path of the next leg to the mission; False when the sequence is over."""
        if not self.order:
            return False
        here = self.driven[-1] if self.driven else 0
        mission.path, mission.feedback = self.paths[here, self.order[0]], None
        mission.target = self.places[self.order[0]]
        return True

    def leg_is_done(self, mission) -> bool:
        """Note the place the robot has reached."""
        self.driven.append(self.order.pop(0))
        print(f"at waypoint {self.driven[-1]}, {mission.drive.dist_to_goal:.2f} m from it")
        return True


class PlanLeg(GetPath):
    """Plan the next leg without a path, between two waypoints."""

    def __init__(self, sequence: WaypointSequence) -> None:
        super().__init__("plan leg")
        self.sequence = sequence

    def make_goal(self) -> GetPathGoal:
        """Plan from one place to another."""
        self.leg = self.sequence.unplanned.pop()
        start, end = (self.sequence.places[i] for i in self.leg)
        return GetPathGoal(end, start_pose=start)

    def take_result(self, result: GetPathResult) -> None:
        """Store the path; a leg without one is left out of the sequence."""
        if result.path is not None:
            self.sequence.paths[self.leg], self.sequence.costs[self.leg] = result.path, result.cost


def waypoint_machine(sequence: WaypointSequence) -> StateMachine:
    """Plan all legs - choose an order - drive leg by leg; a leg that fails is recovered and planned anew."""
    success, failure = Status.SUCCESS, Status.FAILURE
    return StateMachine(
        "waypoints",
        {
            "legs left?": State(
                Do("legs left?", lambda mission: bool(sequence.unplanned)),
                {success: "plan leg", failure: "choose order"},
            ),
            "plan leg": State(PlanLeg(sequence), {success: "legs left?", failure: "legs left?"}),
            "choose order": State(Do("choose order", sequence.choose_order), {success: "next leg", failure: failure}),
            "next leg": State(Do("next leg", sequence.take_stored_path), {success: "drive", failure: success}),
            "drive": State(ExePath(), {success: "arrived", failure: "recover"}),
            "arrived": State(Do("arrived", sequence.leg_is_done), {success: "next leg", failure: failure}),
            "recover": State(Recovery("clear"), {success: "plan anew", failure: "back up"}),
            "back up": State(Recovery("back_up"), {success: "plan anew", failure: "plan anew"}),
            "plan anew": State(GetPath("plan anew"), {success: "drive", failure: failure}),
        },
    )


def main(scenario: str, backend: str) -> bool:
    with Session(scenario, SessionOptions(backend=backend)) as session:
        start = session.navigator.robot_pose()
        poses = [Pose.planar(x, y, 0.0, session.world.height_at(x, y)) for x, y in WAYPOINTS]
        sequence = WaypointSequence([start, *poses])
        result = TreeExecutive(waypoint_machine(sequence), session.navigator).run()
        print(f"{result.message}; visited {sequence.driven} in {session.clock.now():.0f} s")
        return result.success and len(sequence.driven) == len(poses)


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
