"""What every test of an execution ends with."""

import pytest


@pytest.fixture
def make_session(make_session):
    """F286: after whatever end, the robot is commanded to stand."""
    made = []

    def make(*args, **parameters):
        made.append(make_session(*args, **parameters))
        return made[-1]

    yield make
    for session in made:
        session.clock.sleep(1.0)
        assert session.robot.command.is_stopped()
