"""Executives of a run: the ``move_base`` action, a reference behaviour tree, the classic state machine.

All of them block the thread that calls ``drive`` until the goal has ended and can be canceled from any other thread.
``make_executive`` finds one by what ``mbf run --executive`` takes: a name, or ``module:function`` of a tree.
"""

from __future__ import annotations

import importlib
import traceback
from collections.abc import Callable
from functools import partial
from typing import Protocol, TypeAlias

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Sequence

from mbf_abstract.config.findings import ConfigError, Finding
from mbf_abstract.config.registry import import_problem
from mbf_abstract.drive.robot import RobotStateError
from mbf_abstract.event_values import error_text
from mbf_abstract.executives.reference_trees import REFERENCE_TREES, TreeOptions, control_tree, planning_tree
from mbf_abstract.executives.tree_executive import TreeExecutive, TreeResult
from mbf_abstract.geometry import Pose
from mbf_abstract.goals.goal_types import MoveBaseGoal
from mbf_abstract.goals.handle import AnyGoalHandle
from mbf_abstract.goals.result_types import MoveBaseResult
from mbf_abstract.navigator import Navigator
from mbf_abstract.outcomes import MoveBaseOutcome
from mbf_abstract.plugins import PluginKind
from mbf_abstract.time.program_end import is_for_the_program
from terrain.experiments.classic_move_base.settings import ClassicSettings
from terrain.experiments.classic_move_base.state_machine import ClassicMoveBase

EXECUTIVES = ("move_base", "classic", *REFERENCE_TREES)
TreeMaker: TypeAlias = Callable[[TreeOptions], Behaviour]
"""Makes a tree that drives to one goal, with the plugins of the robot."""


class OneDrive(Protocol):
    """What goes to one goal, once."""

    def run(self, goal: Pose) -> MoveBaseResult:
        """Go to a pose and return when the goal has ended."""

    def cancel(self, reason: str) -> None:
        """End the goal soon, from any thread; never waits."""


class GoalExecutive:
    """Drives to one goal at a time.

    Parameters
    ----------
    make : callable
        Makes what goes to a goal with a planner and a controller; plugins without a name are the first ones loaded.
    arrives : bool
        Whether success means that the robot is there; one that only plans leaves it where it is.
    """

    def __init__(self, make: Callable[[str, str], OneDrive], arrives: bool = True) -> None:
        self.arrives = arrives
        self._make = make
        self._present: OneDrive | None = None

    def drive(self, goal: Pose, planner: str = "", controller: str = "") -> MoveBaseResult:
        """Go to a pose and return when the goal has ended."""
        self._present = self._make(planner, controller)
        return self._present.run(goal)

    def cancel(self, reason: str) -> None:
        """End the present goal soon, from any thread; never waits, does nothing where no goal runs."""
        if self._present is not None:
            self._present.cancel(reason)


def make_executive(executive: str, navigator: Navigator) -> GoalExecutive:
    """Make the executive of a name in ``EXECUTIVES``, or of a tree's ``module:function``; ConfigError for another one.

    The function is a ``TreeMaker``.
    """
    if executive == "move_base":
        return GoalExecutive(partial(MoveBaseDrive, navigator))
    if executive == "classic":
        return GoalExecutive(partial(ClassicMoveBase, navigator, ClassicSettings()))
    if executive in REFERENCE_TREES:
        make_tree = _plan_then_control if executive == "control" else REFERENCE_TREES[executive]
        return GoalExecutive(partial(TreeDrive, navigator, make_tree), arrives=executive != "planning")
    if ":" in executive:
        return GoalExecutive(partial(TreeDrive, navigator, _tree_of(executive)))
    expected = f"one of {', '.join(EXECUTIVES)}, or module:function of a tree"
    raise ConfigError([Finding("--executive", 1, "", expected, repr(executive))])


def _plan_then_control(options: TreeOptions) -> Behaviour:
    """The tree ``control`` follows a path it is given, so planning goes before it."""
    children = [planning_tree(options), control_tree(options)]
    return Sequence("plan, then drive", memory=True, children=children)


def _tree_of(target: str) -> TreeMaker:
    """Import the function ``module:function`` that makes a tree."""
    module, _, name = target.partition(":")
    try:
        make_tree = getattr(importlib.import_module(module), name)
    except (Exception, SystemExit) as error:  # the module is somebody else's
        found = f"{target}: {import_problem(error)}"
        raise ConfigError([Finding("--executive", 1, "", "module:function of a tree", found)]) from error
    if not callable(make_tree):
        raise ConfigError([Finding("--executive", 1, "", "a function that makes a tree", f"{target}: {make_tree!r}")])

    def checked(options: TreeOptions) -> Behaviour:
        try:
            tree = make_tree(options)
        except Exception as error:
            found = f"{target}: {type(error).__name__}: {error_text(error)}"
            raise ConfigError([Finding("--executive", 1, "", "a function that makes a tree", found)]) from error
        if not isinstance(tree, Behaviour):
            raise ConfigError([Finding("--executive", 1, "", "a tree of py_trees", f"{target} made {tree!r}")])
        return tree

    return checked


class MoveBaseDrive:
    """A goal of the server's ``move_base`` action."""

    def __init__(self, navigator: Navigator, planner: str, controller: str) -> None:
        self._navigator = navigator
        self._planner = planner
        self._controller = controller
        self._handle: AnyGoalHandle | None = None

    def run(self, goal: Pose) -> MoveBaseResult:
        """Send the goal and wait for its result."""
        handle = self._handle = self._navigator.send(
            MoveBaseGoal(goal, planner=self._planner, controller=self._controller)
        )
        return handle.wait()

    def cancel(self, reason: str) -> None:
        """Cancel the goal."""
        if self._handle is not None:
            self._handle.cancel(reason)


class TreeDrive:
    """A behaviour tree, with those of its recoveries that the server has loaded.

    They are known by the names of their types; ``relax_planner`` is a ``relax`` for plans.
    """

    def __init__(self, navigator: Navigator, make_tree: TreeMaker, planner: str, controller: str) -> None:
        self._navigator = navigator
        self._executive = TreeExecutive(make_tree(self._options(planner, controller)), navigator)

    def run(self, goal: Pose) -> MoveBaseResult:
        """Tick the tree until it ends; what a node raises is the end of the goal."""
        try:
            return self._as_move_base(self._executive.run(goal), goal)
        except Exception as error:
            if is_for_the_program(error):
                raise
            text = f"tree {self._executive.tree.name!r}: {_raiser(error)}{type(error).__name__}: {error_text(error)}"
            return MoveBaseResult(int(MoveBaseOutcome.INTERNAL_ERROR), text)

    def cancel(self, reason: str) -> None:
        """End the tree's run."""
        self._executive.cancel(reason)

    def _options(self, planner: str, controller: str) -> TreeOptions:
        plugins = self._navigator.server.plugins.names(PluginKind.RECOVERY)

        def loaded(name: str) -> str:
            return name if name in plugins else ""

        return TreeOptions(
            planner=planner,
            controller=controller,
            refiner=self._navigator.server.runtime.parameters.plan_refiner,
            clear=loaded("clear"),
            out_of_collision=loaded("back_up"),
            relax_planner=loaded("relax_planner"),
            relax_controller=loaded("relax"),
            move_away=loaded("move_away"),
            escape=loaded("escape"),
            wait=loaded("wait"),
            give_way=loaded("give_way"),
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
            pose = self._navigator.robot_pose()
        except RobotStateError:
            return MoveBaseResult(outcome, result.message)
        return MoveBaseResult(outcome, result.message, pose, pose.distance_to(goal), pose.angle_to(goal))


def _raiser(error: Exception) -> str:
    """Which node of a tree has raised, for a message; empty if none has."""
    owners = [frame.f_locals.get("self") for frame, _ in traceback.walk_tb(error.__traceback__)]
    names = [node.name for node in owners if isinstance(node, Behaviour)]
    return f"node {names[-1]!r} raised " if names else ""
