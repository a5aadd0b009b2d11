"""The four conditions of the main run; all drive with ``navigation.yaml``, which tracks what moves."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from mbf_abstract.navigator import Navigator
from terrain.experiments.table1.conditions import (
    MAIN_A,
    MAIN_B,
    Condition,
    Executive,
    TreeShape,
    make_executive,
    make_tree,
    tree_options,
)

ESCALATION = ("wait_longer", "give_way", "out_of_collision", "relax_planner", "give_way", "escape_distance", "give_way")


@dataclass(frozen=True)
class MainCondition:
    """One of the record's conditions, and what is added to it.

    Attributes
    ----------
    base : Condition
        Executive, limits and shape of the tree, and the name.
    asks_what_moves : bool
        Whether its tree waits for what moves on its path, yields to what waits, and plans around what is parked.
    escalation : tuple of str
        Recovery behaviours for a robot that is stuck.
    """

    base: Condition
    asks_what_moves: bool = False
    escalation: tuple[str, ...] = field(default=())

    def executive(self, navigator: Navigator) -> Executive:
        """Make its executive and set the server's parameters."""
        navigator.server.set_parameters(escalation_behaviors=self.escalation)
        if not self.asks_what_moves:
            return make_executive(self.base, navigator)
        options = replace(tree_options(self.base), wait="wait", give_way="give_way")
        return make_tree(self.base, navigator, options)


MOVE_BASE = MainCondition(replace(MAIN_A, name="move_base"))
RECORD_TREE = MainCondition(replace(MAIN_B, name="tree", text="tree of the record"))
FULL_TREE = MainCondition(
    replace(MAIN_B, name="full_tree", text="tree that asks what moves, gives way and escalates"), True, ESCALATION
)
PLAIN_TREE = MainCondition(
    replace(
        MAIN_B,
        name="plain_tree",
        text="the paper's tree: no failing cycle is tolerated, the second planner plans in any case",
        tree=TreeShape(controller_max_retries=0, second_planner_look_ahead=0.0, longest_update=1000.0),
    )
)
CONDITIONS = {condition.base.name: condition for condition in (MOVE_BASE, RECORD_TREE, FULL_TREE, PLAIN_TREE)}
