"""The conditions of the experiment: which executive drives, with which limits, and what around it is changed.

Both main conditions get the same patience and retries. The main result compares ``S1`` with ``B``; ``S0`` and ``S2``
are the other readings of move_base's parameters (benchmarks section 6.3). ``ABLATIONS`` are the changes of section 6.4.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Literal

from mbf_abstract.executives.reference_trees import TreeOptions, navigation_tree
from mbf_abstract.executives.tree_executive import TreeExecutive
from mbf_abstract.navigator import Navigator
from terrain.experiments.classic_move_base.settings import ClassicSettings
from terrain.experiments.classic_move_base.state_machine import ClassicMoveBase
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
    """What can be taken away from the tree, and how its second planner works: by default as it ships."""

    reuse_path: bool = TreeOptions.reuse_path
    by_outcome: bool = TreeOptions.by_outcome
    second_planner_pause: float = TreeOptions.second_planner_pause
    second_planner_look_ahead: float = TreeOptions.second_planner_look_ahead
    longest_update: float = TreeOptions.longest_update
    controller_max_retries: int = 15
    control_retries: int = TreeOptions.control_retries
    replans: int = TreeOptions.replans


@dataclass(frozen=True)
class Surroundings:
    """What surrounds the executive: modelled planner time [s], number of other robots, whether these stop."""

    planner_latency: float = 0.4
    robots: int = 5
    polite: bool = True


@dataclass(frozen=True)
class Condition:
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
    surroundings: Surroundings = Surroundings()


MAIN_A = Condition("S1", "move_base, patience 2 s / 2 s, watchdog off", "move_base")
MAIN_B = Condition("B", "tree", "tree")
READINGS = (
    Condition("S0", "move_base as it starts: 5 s / 15 s, watchdog off", "move_base", Limits(5.0, 15.0)),
    Condition("S2", "move_base, 5 s / 5 s, watchdog 10 s", "move_base", Limits(5.0, 5.0, oscillation_timeout=10.0)),
)
NO_LATENCY, BLIND = Surroundings(planner_latency=0.0), Surroundings(polite=False)
TWO, TEN = Surroundings(robots=2), Surroundings(robots=10)
ABLATIONS = (
    Condition("A0", "move_base, planner takes no time", "move_base", surroundings=NO_LATENCY),
    Condition("B0", "tree, planner takes no time", "tree", surroundings=NO_LATENCY),
    Condition("A1", "move_base, planner_frequency 0.5 Hz", "move_base", Limits(planner_frequency=0.5)),
    Condition("A2", "move_base, patience 1 s", "move_base", Limits(1.0, 1.0)),
    Condition("A3", "move_base, max_planning_retries 0", "move_base", Limits(max_planning_retries=0)),
    Condition("A4", "move_base, recoveries filtered by outcome code", "filtered_move_base"),
    Condition("B1", "tree without path reuse", "tree", tree=TreeShape(reuse_path=False)),
    Condition("B2", "tree that ignores outcome codes", "tree", tree=TreeShape(by_outcome=False)),
    Condition("B3", "tree without second planner", "tree", tree=TreeShape(second_planner_pause=0.0)),
    Condition("T1A", "move_base, blind traffic", "move_base", surroundings=BLIND),
    Condition("T1B", "tree, blind traffic", "tree", surroundings=BLIND),
    Condition("T2A", "move_base, two robots", "move_base", surroundings=TWO),
    Condition("T2B", "tree, two robots", "tree", surroundings=TWO),
    Condition("T3A", "move_base, ten robots", "move_base", surroundings=TEN),
    Condition("T3B", "tree, ten robots", "tree", surroundings=TEN),
)
CONDITIONS = {condition.name: condition for condition in (MAIN_A, MAIN_B, *READINGS, *ABLATIONS)}


def outdoors(condition: Condition) -> Condition:
    """Return the condition for the outdoor table; nothing moves there, so its tree waits less."""
    return replace(condition, tree=replace(condition.tree, controller_max_retries=3, control_retries=1))


def without_traffic(condition: Condition) -> Condition:
    """Return the condition in an empty world, for the first acceptance check."""
    return replace(condition, name=f"{condition.name}/empty", surroundings=replace(condition.surroundings, robots=0))


Executive = ClassicMoveBase | TreeExecutive


def make_executive(condition: Condition, navigator: Navigator) -> Executive:
    """Make the condition's executive and give the server the condition's limits."""
    if condition.executive == "tree":
        return make_tree(condition, navigator, tree_options(condition))
    settings = ClassicSettings(recovery_behaviors=RECOVERIES, **asdict(condition.limits))
    kind = FilteredMoveBase if condition.executive == "filtered_move_base" else ClassicMoveBase
    return kind(navigator, settings, planner="main", controller="follow")


def make_tree(condition: Condition, navigator: Navigator, options: TreeOptions) -> TreeExecutive:
    """Give the server the condition's limits and make the navigation tree of these options."""
    limits = condition.limits
    navigator.server.set_parameters(
        planner_patience=limits.planner_patience,
        planner_max_retries=limits.max_planning_retries,
        controller_patience=limits.controller_patience,
        controller_max_retries=condition.tree.controller_max_retries,
        oscillation_timeout=limits.oscillation_timeout,
    )
    return TreeExecutive(navigation_tree(options), navigator, CONTROL_PERIOD)


def tree_options(condition: Condition) -> TreeOptions:
    """Return the options of the condition's tree."""
    shape = asdict(condition.tree)
    del shape["controller_max_retries"]
    clear, relax_planner, out_of_collision, relax_controller, escape_distance = RECOVERIES
    return TreeOptions(
        planner="main",
        second_planner="second",
        controller="follow",
        clear=clear,
        out_of_collision=out_of_collision,
        relax_planner=relax_planner,
        relax_controller=relax_controller,
        move_away=escape_distance,
        progress_timeout=0.0,
        **shape,
    )
