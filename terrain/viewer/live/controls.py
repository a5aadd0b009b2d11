"""The commands of the page to a run: a new goal, an end, a pause, other plugins, a fault.

Threads of the page call ``post`` and nothing else. The simulator's thread calls ``work_off`` between two steps of the
world; everything that is asked for happens there, while no other thread of the run works.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable

import numpy as np

from mbf_abstract.events import EventKind
from mbf_abstract.geometry import FloatArray, Pose
from terrain.scenarios.faults import LocalizationJump, SensorFault
from terrain.sensors.rays import StaticRays
from terrain.session.goal_sequence import AskedGoal, GoalSequence
from terrain.session.session import Session

MAX_WAITING = 100  # commands; a page that sends more between two steps loses the oldest
MAX_RANGE = 1e4  # m from the camera to the ground


class LiveControls:
    """Carries commands from the page to the run.

    Parameters
    ----------
    session : Session
    sequence : GoalSequence
    source, place : str
        What is served: the source of events about what was asked for, and its name in texts.

    Attributes
    ----------
    planner, controller : str
        Plugins for the goals to come; empty = the first ones loaded.
    holding : bool
        Whether goals are paused, those to come as well.
    """

    def __init__(
        self, session: Session, sequence: GoalSequence, source: str = "live_view", place: str = "the live view"
    ) -> None:
        self.planner = ""
        self.controller = ""
        self.holding = False
        self._session = session
        self._sequence = sequence
        self._source, self._place = source, place
        self._server = session.navigator.server
        self._waiting: deque[Callable[[], None]] = deque(maxlen=MAX_WAITING)
        self._ground: StaticRays | None = None

    def post(self, command: Callable[[], None]) -> None:
        """Have ``command`` called between two steps of the world; from any thread, never waits."""
        self._waiting.append(command)

    def work_off(self) -> None:
        """Carry out the commands that have come; on the simulator's thread."""
        while self._waiting:
            command = self._waiting.popleft()
            try:
                command()
            except Exception as error:  # a wrong request of a page must not end the run
                self._log("refused", message=f"{type(error).__name__}: {error}")
        if self.holding:
            self._server.pause_all()  # in every step, for goals that an executive has sent since the last one

    # ------------------------------------------------------------------------------- commands, to be posted
    def go_to(self, origin: FloatArray, direction: FloatArray) -> None:
        """Go to where a ray (3,), (3,) [m] hits the ground, heading away from where the robot is now."""
        place = self._where_it_hits(np.asarray(origin, dtype=np.float64), np.asarray(direction, dtype=np.float64))
        if place is None:
            self._log("there is no ground where the click was")
            return
        x, y, z = place.tolist()
        robot = self._session.simulation.robot.pose()
        self.go_to_pose(Pose.planar(x, y, math.atan2(y - robot.y, x - robot.x), z))

    def go_to_pose(self, goal: Pose) -> None:
        """Go there."""
        self._log("new goal", x=round(goal.x, 3), y=round(goal.y, 3), z=round(goal.z, 3))
        self._sequence.go_to(AskedGoal(goal, self.planner, self.controller))

    def cancel(self) -> None:
        """Cancel the present goal."""
        self._log("cancel")
        self._sequence.cancel(f"canceled in {self._place}")

    def hold(self, holding: bool) -> None:
        """Pause all goals, or let them go on."""
        self._log("pause" if holding else "resume")
        self.holding = holding
        if not holding:
            self._server.resume_all()

    def choose(self, planner: str, controller: str) -> None:
        """Use these plugins for the goals to come."""
        self.planner, self.controller = planner, controller

    def inject(self, fault: SensorFault | LocalizationJump) -> None:
        """Let a fault happen."""
        self._log("fault", **fault.model_dump())
        self._session.faults.add(fault)

    def end(self, reason: str) -> None:
        """End the run."""
        self._log("end", reason=reason)
        self._sequence.end(reason)

    # -----------------------------------------------------------------------------------------------------
    def _where_it_hits(self, origin: FloatArray, direction: FloatArray) -> FloatArray | None:
        if self._ground is None:
            self._ground = StaticRays(*self._session.world.ground)
        direction = direction / np.linalg.norm(direction)
        distance = float(self._ground.distances(origin[None], direction[None], MAX_RANGE)[0])
        return origin + distance * direction if math.isfinite(distance) else None

    def _log(self, what: str, **facts: object) -> None:
        """Log what a visitor has done to the run."""
        self._session.events.emit(EventKind.CUSTOM, self._source, what=what, **facts)
