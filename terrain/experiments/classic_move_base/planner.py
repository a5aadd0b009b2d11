"""The planner thread of the classic ``move_base``, as a slot of ``get_path`` goals that is switched on and off.

While it is switched on it asks for one plan after the other: at once after a failure, or at its frequency. The rules
are those of the ``planThread`` of ROS 1's move_base; they need no separate thread here.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from mbf_abstract.executives.mission import MissionContext
from mbf_abstract.goals.goal_types import GetPathGoal
from mbf_abstract.goals.handle import AnyGoalHandle
from mbf_abstract.goals.result_types import GetPathResult
from mbf_abstract.time.clock import TIME_RESOLUTION

PLANNER_SLOT = 0


class ClassicPlanner:
    """Asks for plans to the mission's target while ``running``.

    Parameters
    ----------
    planner : str
        Empty = the first one loaded.
    frequency : float
        Plans per second [Hz] also while the robot drives; 0 = stop planning with the first plan.
    on_done : callable
        Called with each goal that has ended, on the thread that ended it.

    Attributes
    ----------
    last_valid : float
        When there last was a plan, or a reason to count patience anew [s].
    retries : int
        Failed attempts since then.
    """

    def __init__(
        self, mission: MissionContext, planner: str, frequency: float, on_done: Callable[[AnyGoalHandle], None]
    ) -> None:
        self._mission = mission
        self._planner = planner
        self._frequency = frequency
        self._on_done = on_done
        self._pause = mission.navigator.server.runtime.parameters.planner_retry_delay
        self._handle: AnyGoalHandle | None = None
        self._started = self._next_start = -math.inf
        self.running = False
        self.restart_patience()

    @property
    def due(self) -> float:
        """When the next goal is to be sent [s]; infinite while there is nothing to do."""
        return self._next_start if self.running and self._handle is None else math.inf

    def wake(self) -> None:
        """Switch on; a call under way continues."""
        self.running = True

    def restart_patience(self) -> None:
        """Count patience and retries from now."""
        self.last_valid = self._mission.clock.now()
        self.retries = 0

    def start_if_due(self) -> None:
        """Send the next goal if its time has come."""
        now = self._mission.clock.now()
        if self.due > now + TIME_RESOLUTION:
            return
        self._started = now
        self._handle = self._mission.send(
            GetPathGoal(self._mission.required_target(), planner=self._planner, concurrency_slot=PLANNER_SLOT)
        )
        self._handle.subscribe(self._report_if_done)

    def take_result(self, handle: AnyGoalHandle) -> GetPathResult | None:
        """Return the result of the present goal and arrange the next; None for a goal that no longer counts."""
        if handle is not self._handle:
            return None
        self._handle = None
        now = self._mission.clock.now()
        # The original has no pause; without one, a planner that fails in no time would stop simulated time.
        period = 1.0 / self._frequency if self._frequency > 0.0 else self._pause
        self._next_start = max(now, self._started + period)
        result: GetPathResult | None = handle.result
        if result is not None and result.success:
            self.restart_patience()
            self.running = self.running and self._frequency > 0.0
        return result

    def _report_if_done(self, handle: AnyGoalHandle) -> None:
        if handle.done:
            self._on_done(handle)
