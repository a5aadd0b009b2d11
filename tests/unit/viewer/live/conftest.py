"""Runs that somebody steers: what the page would ask for comes at given simulated times, then the run ends."""

import pytest

from terrain.session.executives import make_executive
from terrain.session.goal_sequence import GoalSequence
from terrain.session.session import Session
from terrain.viewer.live.controls import LiveControls


class SteeredRun:
    """A session with a sequence and the controls of a page; ``at(time, command)`` posts a command at that time."""

    def __init__(self, session, executive):
        self.session = session
        self.sequence = GoalSequence(session, make_executive(executive, session.navigator), stay=True)
        self.controls = LiveControls(session, self.sequence)
        self.poses = {}
        self._script = []
        self._last = 0.0
        session.loop.on_tick.append(self._after_step)

    def at(self, time, *commands):
        self._script.append((time, commands))
        self._last = max(self._last, time)

    def visit_goals(self):
        self.session.run()
        return self.sequence.visit_goals()

    def events(self, *kinds, source=None):
        return [event for event in self.session.memory.of_kind(*kinds) if source in (None, event.source)]

    def _after_step(self, time):
        for entry in [entry for entry in self._script if entry[0] <= time]:
            self._script.remove(entry)
            for command in entry[1]:
                self.controls.post(command)
        self.controls.work_off()
        if self.sequence.is_waiting and not self._script and time > self._last + 0.1:
            self.sequence.end("nothing is left to do")
        self.poses[round(time, 2)] = self.session.simulation.robot.pose()


@pytest.fixture
def steered(meadow):
    """Make steered runs; all are closed at the end of the test."""
    sessions = []

    def make(executive="move_base"):
        sessions.append(Session(meadow))
        return SteeredRun(sessions[-1], executive)

    yield make
    for session in sessions:
        session.close()
