"""What every test of an execution ends with."""

import pytest


@pytest.fixture
def make_bench(make_bench):
    """F286: after whatever end, the robot is told to stand."""
    made = []

    def make(*args, **parameters):
        made.append(make_bench(*args, **parameters))
        return made[-1]

    yield make
    for bench in made:
        bench.clock.sleep(1.0)
        assert bench.robot.command.is_stopped()
