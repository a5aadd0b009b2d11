"""Runs that somebody steers: what the page would ask for comes at given simulated times, then the run ends."""

import pytest

from terrain.session.bench import Bench
from terrain.session.executives import make_goal_driver
from terrain.session.goal_sequence import GoalTour
from terrain.viewer.live.controls import LiveControls


class SteeredRun:
    """A bench with a tour and the controls of a page; ``at(time, command)`` posts a command when that time has come."""

    def __init__(self, bench, executive):
        self.bench = bench
        self.tour = GoalTour(bench, make_goal_driver(executive, bench.navigator), stay=True)
        self.controls = LiveControls(bench, self.tour)
        self.poses = {}
        self._script = []
        self._last = 0.0
        bench.loop.on_tick.append(self._after_step)

    def at(self, time, *commands):
        self._script.append((time, commands))
        self._last = max(self._last, time)

    def visit_goals(self):
        self.bench.run()
        return self.tour.visit_goals()

    def events(self, *kinds, source=None):
        return [event for event in self.bench.memory.of_kind(*kinds) if source in (None, event.source)]

    def _after_step(self, time):
        for entry in [entry for entry in self._script if entry[0] <= time]:
            self._script.remove(entry)
            for command in entry[1]:
                self.controls.post(command)
        self.controls.work_off()
        if self.tour.is_waiting and not self._script and time > self._last + 0.1:
            self.tour.end("nothing is left to do")
        self.poses[round(time, 2)] = self.bench.simulation.robot.pose()


@pytest.fixture
def steered(meadow):
    """Make steered runs; all are closed at the end of the test."""
    benches = []

    def make(executive="move_base"):
        benches.append(Bench(meadow))
        return SteeredRun(benches[-1], executive)

    yield make
    for bench in benches:
        bench.close()
