"""A bench that closes itself, and the states an execution went through."""

import pytest

from mbf_abstract.events import EventKind
from mbf_abstract.testing.bench import Bench


@pytest.fixture
def make_bench():
    """Make any number of benches in a test; all are closed at its end."""
    benches = []

    def make(*args, **parameters):
        benches.append(Bench(*args, **parameters))
        return benches[-1]

    yield make
    for bench in benches:
        bench.close()


@pytest.fixture
def states():
    """Return the states that ``source`` entered, e.g. ``planner_execution``, oldest first."""

    def read(bench, source):
        return [e.data["new"] for e in bench.events(EventKind.STATE_CHANGED) if e.source == source]

    return read
