"""A session for executives, and tree nodes that a test scripts."""

from types import MappingProxyType

import pytest
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from mbf_abstract.testing.scripted import ScriptedController, ScriptedPlanner, ScriptedRecovery
from mbf_abstract.testing.scripted_session import ScriptedSession

PLUGINS = {
    "planner": ScriptedPlanner,
    "controller": ScriptedController,
    "clear": ScriptedRecovery,
    "back_up": ScriptedRecovery,
    "relax": ScriptedRecovery,
}
STATUSES = {"S": Status.SUCCESS, "F": Status.FAILURE, "R": Status.RUNNING, "I": Status.INVALID}


@pytest.fixture
def make_session():
    """Make sessions with three recoveries; all are closed at the end of the test."""
    sessions = []

    def make(plugins=MappingProxyType({}), **parameters):
        sessions.append(
            ScriptedSession(
                {**PLUGINS, **plugins}, **{"planner_max_retries": 0, "controller_max_retries": 0, **parameters}
            )
        )
        return sessions[-1]

    yield make
    for session in sessions:
        session.close()


class Scripted(Behaviour):
    """Returns one status of a text like ``RRS`` per tick; the last one for ever. Starts over when it was idle."""

    def __init__(self, script, name="scripted"):
        super().__init__(name)
        self.script = script
        self.ticks = 0
        self.entries = 0

    def initialise(self):
        self.entries += 1

    def update(self):
        status = self.script[min(self.ticks, len(self.script) - 1)]
        self.ticks += 1
        return STATUSES[status]


@pytest.fixture
def scripted():
    """Make a scripted node."""
    return Scripted


@pytest.fixture
def tick():
    """Tick a tree a number of times and return the statuses as a text."""

    def run(tree, times=1):
        letters = {status: letter for letter, status in STATUSES.items()}
        seen = ""
        for _ in range(times):
            tree.tick_once()
            seen += letters[tree.status]
        return seen

    return run


@pytest.fixture
def recoveries():
    """Return the names of the behaviours that ran, in order."""
    from mbf_abstract.events import EventKind

    return lambda session: [event.data["plugin"] for event in session.recorded(EventKind.RECOVERY)]
