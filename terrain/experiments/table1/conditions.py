"""The arms of the experiment: which executive drives, with which limits, and what around it is changed.

Both arms get the same patience and retries. The main result compares ``S1`` with ``B``; ``S0`` and ``S2`` are the other
readings of move_base's parameters (benchmarks section 6.3). ``ABLATIONS`` are the changes of section 6.4.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from mbf_abstract.executives.reference_trees import TreeOptions, navigation_tree
from mbf_abstract.executives.tree_executive import TreeExecutive
from mbf_abstract.navigator import Navigator
from terrain.experiments.classic_move_base.state_machine import ClassicMoveBase, ClassicSettings
from terrain.experiments.table1.filtered_move_base import FilteredMoveBase

RECOVERIES = ("clear_costmaps", "relax_planner", "out_of_collision", "relax_controller", "escape_distance")
"""Names of the five plugins, in the order of move_base's list."""

CONTROL_PERIOD = 0.05  # s between two ticks of the tree; move_base's control loop has the same rate


@dataclass(frozen=True)
class Limits:
    """What both executives are allowed: times [s], and plans a second while driving (move_base only)."""

    planner_patience: float = 2.0
    controller_patience: float = 2.0
    max_planning_retries: int = -1
    oscillation_timeout: float = 0.0
    planner_frequency: float = 0.0


@dataclass(frozen=True)
class TreeShape:
    """What can be taken away from the tree, and how its second planner works."""

    reuse_path: bool = True
    by_outcome: bool = True
    second_planner_pause: float = 8.0
    second_planner_look_ahead: float = 3.0
    longest_update: float = 1.5
    controller_max_retries: int = 15
    control_retries: int = 8
    replans: int = 3


@dataclass(frozen=True)
class Conditions:
    """What is around the executive: modelled planner time [s], number of other robots, whether these stop."""

    planner_latency: float = 0.4
    robots: int = 5
    polite: bool = True


@dataclass(frozen=True)
class Arm:
    """One row of the tables.

    Attributes
    ----------
    name : str
        Short name, e.g. ``B1``.
    text : str
        What is special about it.
    executive : str
        ``move_base``, ``filtered_move_base`` (recoveries picked by outcome code) or ``tree``.
    """

    name: str
    text: str
    executive: Literal["move_base", "filtered_move_base", "tree"]
    limits: Limits = Limits()
    tree: TreeShape = TreeShape()
    conditions: Conditions = Conditions()


MAIN_A = Arm("S1", "move_base, patience 2 s / 2 s, watchdog off", "move_base")
MAIN_B = Arm("B", "tree", "tree")
READINGS = (
    Arm("S0", "move_base as it starts: 5 s / 15 s, watchdog off", "move_base", Limits(5.0, 15.0)),
    Arm("S2", "move_base, 5 s / 5 s, watchdog 10 s", "move_base", Limits(5.0, 5.0, oscillation_timeout=10.0)),
)
NO_LATENCY, BLIND = Conditions(planner_latency=0.0), Conditions(polite=False)
TWO, TEN = Conditions(robots=2), Conditions(robots=10)
ABLATIONS = (
    Arm("A0", "move_base, planner takes no time", "move_base", conditions=NO_LATENCY),
    Arm("B0", "tree, planner takes no time", "tree", conditions=NO_LATENCY),
    Arm("A1", "move_base, planner_frequency 0.5 Hz", "move_base", Limits(planner_frequency=0.5)),
    Arm("A2", "move_base, patience 1 s", "move_base", Limits(1.0, 1.0)),
    Arm("A3", "move_base, max_planning_retries 0", "move_base", Limits(max_planning_retries=0)),
    Arm("A4", "move_base, recoveries filtered by outcome code", "filtered_move_base"),
    Arm("B1", "tree without path reuse", "tree", tree=TreeShape(reuse_path=False)),
    Arm("B2", "tree that ignores outcome codes", "tree", tree=TreeShape(by_outcome=False)),
    Arm("B3", "tree without second planner", "tree", tree=TreeShape(second_planner_pause=0.0)),
    Arm("T1A", "move_base, blind traffic", "move_base", conditions=BLIND),
    Arm("T1B", "tree, blind traffic", "tree", conditions=BLIND),
    Arm("T2A", "move_base, two robots", "move_base", conditions=TWO),
    Arm("T2B", "tree, two robots", "tree", conditions=TWO),
    Arm("T3A", "move_base, ten robots", "move_base", conditions=TEN),
    Arm("T3B", "tree, ten robots", "tree", conditions=TEN),
)
ARMS = {arm.name: arm for arm in (MAIN_A, MAIN_B, *READINGS, *ABLATIONS)}


def outdoors(arm: Arm) -> Arm:
    """Return the arm for the outdoor table, where nothing moves: what blocks the way stays, so its tree waits less."""
    return replace(arm, tree=replace(arm.tree, controller_max_retries=3, control_retries=1))


def without_traffic(arm: Arm) -> Arm:
    """Return the arm in an empty world, for the first sanity gate."""
    return replace(arm, name=f"{arm.name}/empty", conditions=replace(arm.conditions, robots=0))


Executive = ClassicMoveBase | TreeExecutive


def make_executive(arm: Arm, navigator: Navigator) -> Executive:
    """Make the arm's executive and give the server the arm's limits."""
    if arm.executive == "tree":
        return _make_tree(arm, navigator)
    limits = arm.limits
    settings = ClassicSettings(
        planner_frequency=limits.planner_frequency,
        planner_patience=limits.planner_patience,
        controller_patience=limits.controller_patience,
        max_planning_retries=limits.max_planning_retries,
        recovery_behaviors=RECOVERIES,
        oscillation_timeout=limits.oscillation_timeout,
    )
    kind = FilteredMoveBase if arm.executive == "filtered_move_base" else ClassicMoveBase
    return kind(navigator, settings, planner="main", controller="follow")


def _make_tree(arm: Arm, navigator: Navigator) -> TreeExecutive:
    limits, shape = arm.limits, arm.tree
    navigator.server.set_parameters(
        planner_patience=limits.planner_patience,
        planner_max_retries=limits.max_planning_retries,
        controller_patience=limits.controller_patience,
        controller_max_retries=shape.controller_max_retries,
        oscillation_timeout=limits.oscillation_timeout,
    )
    clear, relax_planner, out_of_collision, relax_controller, escape_distance = RECOVERIES
    options = TreeOptions(
        planner="main",
        second_planner="second",
        controller="follow",
        clear=clear,
        out_of_collision=out_of_collision,
        relax_planner=relax_planner,
        relax_controller=relax_controller,
        move_away=escape_distance,
        second_planner_pause=shape.second_planner_pause,
        second_planner_look_ahead=shape.second_planner_look_ahead,
        longest_update=shape.longest_update,
        control_retries=shape.control_retries,
        replans=shape.replans,
        reuse_path=shape.reuse_path,
        by_outcome=shape.by_outcome,
        progress_timeout=0.0,
    )
    return TreeExecutive(navigation_tree(options), navigator, CONTROL_PERIOD)
