"""Tallies, event logs and rows made by hand, for what judges them."""

import pytest

from mbf_abstract.events import Event, EventKind
from terrain.experiments.table1.counting import Leg, Tally


@pytest.fixture
def tally():
    """Make a tally of six legs; what is not given is as in a run without traffic."""

    def make(planner=6, controller=6, clear=0, other=0, time=240.0, contacts=0, lost=0):
        recoveries = {name: number for name, number in (("clear_costmaps", clear), ("relax_planner", other)) if number}
        legs = [Leg("reached" if leg >= lost else "aborted", time / 6.0, 20.0) for leg in range(6)]
        touched = {"robot/we": contacts} if contacts else {}
        return Tally({"main_ok": planner}, controller, 100, recoveries, 0, touched, legs)

    return make


@pytest.fixture
def log():
    """Collect events by short calls."""

    class Log(list):
        def add(self, time, kind, source, **data):
            self.append(Event(time, kind, source, data))

        def own(self, time, what, **data):
            self.add(time, EventKind.CUSTOM, "table1", what=what, **data)

        def call(self, begin, end, plugin, method, outcome=0):
            self.add(begin, EventKind.PLUGIN_CALL_STARTED, plugin, method=method)
            self.add(end, EventKind.PLUGIN_CALL_ENDED, plugin, method=method, outcome=outcome)

    return Log()
