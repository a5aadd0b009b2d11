"""The fixed state machine with one thing changed: its recoveries are picked by the outcome code (ablation A4).

It measures what outcome codes alone bring to move_base. The groups are those of the reference trees.
"""

from __future__ import annotations

from mbf_abstract.executives.reference_trees import BLOCKED, IN_CONTACT, OFF_THE_PATH
from mbf_abstract.goals.handle import AnyGoalHandle
from terrain.experiments.classic_move_base.settings import Trigger
from terrain.experiments.classic_move_base.state_machine import ClassicMoveBase

UNABLE_TO_PLAN = ("clear_costmaps", "relax_planner", "escape_distance")
FITTING = (
    (IN_CONTACT, ("out_of_collision", "escape_distance", "clear_costmaps")),
    (BLOCKED, ("clear_costmaps", "relax_controller", "out_of_collision")),
    (OFF_THE_PATH, ("relax_controller", "clear_costmaps")),
)
OTHERS = ("clear_costmaps", "relax_controller", "escape_distance")


class FilteredMoveBase(ClassicMoveBase):
    """``ClassicMoveBase`` whose list holds only what fits the last failure."""

    _failure = 0

    def _post(self, handle: AnyGoalHandle) -> None:
        result = handle.result
        if handle.action == "exe_path" and result is not None and not result.success:
            self._failure = result.outcome
        super()._post(handle)

    def _clear(self, trigger: Trigger) -> None:
        """Choose the list, then stop and recover."""
        if trigger is Trigger.PLANNING:
            self._behaviors = list(UNABLE_TO_PLAN)
        else:
            self._behaviors = next((list(names) for codes, names in FITTING if self._failure in codes), list(OTHERS))
        super()._clear(trigger)
