"""Executives of a run: the ``move_base`` action, a reference behaviour tree, the classic state machine.

All of them block the thread that calls ``drive`` until the goal has ended and can be canceled from any other thread.
``make_executive`` finds one by the name that ``mbf run --executive`` takes.
"""

from __future__ import annotations

from abc import ABC, abstractmethod

from py_trees.common import Status
from py_trees.composites import Sequence

from mbf_abstract.config.findings import ConfigError, Finding
from mbf_abstract.drive.robot import RobotStateError
from mbf_abstract.executives.reference_trees import READY_TREES, TreeOptions, planning_tree
from mbf_abstract.executives.tree_executive import TreeExecutive, TreeResult
from mbf_abstract.geometry import Pose
from mbf_abstract.goals.goal_types import MoveBaseGoal, MoveBaseResult
from mbf_abstract.goals.handle import AnyGoalHandle
from mbf_abstract.navigator import Navigator
from mbf_abstract.outcomes import MoveBaseOutcome
from mbf_abstract.plugins import PluginKind
from terrain.experiments.classic_move_base.state_machine import ClassicMoveBase

EXECUTIVES = ("move_base", "classic", *READY_TREES)


class GoalExecutive(ABC):
    """Drives to one goal at a time.

    Attributes
    ----------
    arrives : bool
        Whether success means that the robot is there; one that only plans leaves it where it is.
    """

    arrives = True

    def __init__(self, navigator: Navigator) -> None:
        self.navigator = navigator

    @abstractmethod
    def drive(self, goal: Pose, planner: str = "", controller: str = "") -> MoveBaseResult:
        """Go to a pose and return when the goal has ended; plugins without a name are the first ones loaded."""

    @abstractmethod
    def cancel(self, reason: str) -> None:
        """End the present goal soon, from any thread; never waits, does nothing where no goal runs."""


def make_executive(executive: str, navigator: Navigator) -> GoalExecutive:
    """Make the executive of a name in ``EXECUTIVES``; raises ConfigError for another one."""
    if executive == "move_base":
        return MoveBaseExecutive(navigator)
    if executive == "classic":
        return ClassicExecutive(navigator)
    if executive in READY_TREES:
        return ReferenceTreeExecutive(navigator, executive)
    raise ConfigError([Finding("--executive", 1, "", f"one of {', '.join(EXECUTIVES)}", repr(executive))])


class MoveBaseExecutive(GoalExecutive):
    """The ``move_base`` action of the server."""

    def __init__(self, navigator: Navigator) -> None:
        super().__init__(navigator)
        self._handle: AnyGoalHandle | None = None

    def drive(self, goal: Pose, planner: str = "", controller: str = "") -> MoveBaseResult:
        """Send the goal and wait for its result."""
        handle = self.navigator.send(MoveBaseGoal(goal, planner=planner, controller=controller))
        self._handle = handle
        return handle.wait()

    def cancel(self, reason: str) -> None:
        """Cancel the goal."""
        if self._handle is not None:
            self._handle.cancel(reason)


class ClassicExecutive(GoalExecutive):
    """The fixed state machine of ROS 1's move_base."""

    def __init__(self, navigator: Navigator) -> None:
        super().__init__(navigator)
        self._machine: ClassicMoveBase | None = None

    def drive(self, goal: Pose, planner: str = "", controller: str = "") -> MoveBaseResult:
        """Run a machine made for these plugins."""
        self._machine = ClassicMoveBase(self.navigator, planner=planner, controller=controller)
        return self._machine.run(goal)

    def cancel(self, reason: str) -> None:
        """End the machine's run."""
        if self._machine is not None:
            self._machine.cancel(reason)


class ReferenceTreeExecutive(GoalExecutive):
    """A reference behaviour tree, with those of its recoveries that the server has loaded.

    The tree ``control`` follows a path it is given, so ``planning`` goes before it; ``planning`` alone only plans.
    """

    def __init__(self, navigator: Navigator, tree: str) -> None:
        super().__init__(navigator)
        self.arrives = tree != "planning"
        self._tree = tree
        self._executive: TreeExecutive | None = None

    def drive(self, goal: Pose, planner: str = "", controller: str = "") -> MoveBaseResult:
        """Tick a new tree until it ends."""
        options = self._options(planner, controller)
        tree = READY_TREES[self._tree](options)
        if self._tree == "control":
            tree = Sequence("plan, then drive", memory=True, children=[planning_tree(options), tree])
        self._executive = TreeExecutive(tree, self.navigator)
        return self._as_move_base(self._executive.run(goal), goal)

    def cancel(self, reason: str) -> None:
        """End the tree's run."""
        if self._executive is not None:
            self._executive.cancel(reason)

    def _options(self, planner: str, controller: str) -> TreeOptions:
        loaded = self.navigator.server.plugins.names(PluginKind.RECOVERY)
        clear, back_up, relax, move_away = (
            name if name in loaded else "" for name in ("clear", "back_up", "relax", "move_away")
        )
        return TreeOptions(
            planner=planner,
            controller=controller,
            clear=clear,
            out_of_collision=back_up,
            relax_controller=relax,
            move_away=move_away,
        )

    def _as_move_base(self, result: TreeResult, goal: Pose) -> MoveBaseResult:
        """Return the result of a tree as one of ``move_base``: with the code of the failure it gave up on."""
        if result.status == Status.INVALID:
            outcome = int(MoveBaseOutcome.CANCELED)
        elif result.success:
            outcome = int(MoveBaseOutcome.SUCCESS)
        else:
            outcome = result.mission.failure_code or int(MoveBaseOutcome.FAILURE)
        try:
            pose = self.navigator.robot_pose()
        except RobotStateError:
            return MoveBaseResult(outcome, result.message)
        return MoveBaseResult(outcome, result.message, pose, pose.distance_to(goal), pose.angle_to(goal))
