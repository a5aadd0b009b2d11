"""A session that closes itself, and the states an execution went through."""

import pytest

from mbf_abstract.events import EventKind
from mbf_abstract.testing.scripted_session import ScriptedSession


@pytest.fixture
def make_session():
    """Make any number of sessions in a test; all are closed at its end."""
    sessions = []

    def make(*args, **parameters):
        sessions.append(ScriptedSession(*args, **parameters))
        return sessions[-1]

    yield make
    for session in sessions:
        session.close()


@pytest.fixture
def states():
    """Return the states that ``source`` entered, e.g. ``planner_execution``, oldest first."""

    def read(session, source):
        return [e.data["new"] for e in session.recorded(EventKind.STATE_CHANGED) if e.source == source]

    return read
