"""What a simulated run compiles before its robot may drive."""

import pytest

from terrain.session.session import Session, SessionOptions


@pytest.mark.timeout(600)  # kernels are compiled on a machine that has none
def test_a_simulated_run_compiles_only_the_planner_and_the_controller_that_it_begins_with():
    steps = []
    Session("indoor", SessionOptions(backend="mesh", on_step=steps.append)).close()
    assert [step for step in steps if "warming" in step] == [
        "warming up planner astar (1 of 2)",
        "warming up controller follower (2 of 2)",
    ]
