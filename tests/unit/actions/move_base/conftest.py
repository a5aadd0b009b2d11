"""The session of every test of move_base: scripted plugins, three recovery behaviours, and how a goal is sent."""

from contextlib import ExitStack

import pytest

from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Pose
from mbf_abstract.goals.goal_types import MoveBaseGoal
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.plugins import PlanResult
from mbf_abstract.testing.scripted import ScriptedController, ScriptedPlanner, ScriptedRecovery
from mbf_abstract.testing.scripted_session import ScriptedSession

PLUGINS = {
    "planner": ScriptedPlanner,
    "controller": ScriptedController,
    "first": ScriptedRecovery,
    "second": ScriptedRecovery,
    "third": ScriptedRecovery,
}


class MoveBaseSession(ScriptedSession):
    no_path = PlanResult(GetPathOutcome.NO_PATH_FOUND, "walled in")

    def send(self, x=2.0, y=0.0, **fields):
        return self.navigator.send(MoveBaseGoal(Pose.planar(x, y), **fields))

    @property
    def recoveries(self):
        """Names of the recovery behaviours that have run, oldest first."""
        return [event.data["plugin"] for event in self.recorded(EventKind.RECOVERY)]

    @property
    def plans(self):
        """How many plans the planner was asked for."""
        return len(self.planner.requests)


@pytest.fixture
def make_session():
    """Make any number of sessions; ``retries`` holds for planner and controller, the server's defaults without it."""
    with ExitStack() as stack:

        def make(retries=None, plugins=PLUGINS, **parameters):
            if retries is not None:
                parameters |= {"planner_max_retries": retries, "controller_max_retries": retries}
            return stack.enter_context(MoveBaseSession(plugins, **parameters))

        yield make
