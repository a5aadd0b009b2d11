"""Kernels are compiled before a goal: of all plugins on a real clock, of those a goal uses first in a simulation."""

import pytest

from mbf_abstract.geometry import Pose
from mbf_abstract.testing.scripted import ScriptedController, ScriptedPlanner
from mbf_abstract.testing.scripted_session import ScriptedSession

PLUGINS = {"a": ScriptedPlanner, "b": ScriptedPlanner, "c": ScriptedController, "d": ScriptedController}
ALL = ["planner a (1 of 4)", "planner b (2 of 4)", "controller c (3 of 4)", "controller d (4 of 4)"]


@pytest.mark.parametrize(
    ("only_defaults", "expected"), [(False, ALL), (True, ["planner a (1 of 2)", "controller c (2 of 2)"])]
)
def test_all_plugins_are_warmed_up_or_those_that_a_goal_without_names_uses(only_defaults, expected):
    steps = []
    with ScriptedSession(plugins=PLUGINS) as session:
        session.server.warm_up(Pose.planar(0.0, 0.0), Pose.planar(3.0, 0.0), steps.append, only_defaults)
    assert steps == [f"warming up {step}" for step in expected]
