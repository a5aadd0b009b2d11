"""Goals of the recovery action with parameters of their own, and questions about one map of a server."""

import math

import pytest

from mbf_abstract.geometry import Pose
from mbf_abstract.goals.goal_status import GoalStatus
from mbf_abstract.goals.goal_types import RecoveryGoal
from mbf_abstract.outcomes import RecoveryOutcome
from mbf_abstract.plugins import PluginKind
from mbf_abstract.testing.conformance.site import site


@pytest.fixture(params=["costmap", "mesh"])
def made(request, backends):
    with site(backends[request.param]) as made:
        yield made


def behavior(made, name):
    return made.server.plugins.find(PluginKind.RECOVERY, name).instance


def test_parameters_of_a_goal_hold_for_its_run_only(made):
    usual = behavior(made, "rotate").parameters
    start = made.rig.robot.pose
    assert made.navigator.recover("rotate", parameters={"angle": 1.0}).success
    assert math.remainder(made.rig.robot.pose.yaw - start.yaw, math.tau) == pytest.approx(1.0, abs=0.15)
    assert behavior(made, "rotate").parameters is usual


def test_the_usual_parameters_come_back_after_a_failure_too(made):
    usual = behavior(made, "back_up").parameters
    result = made.navigator.recover("back_up", parameters={"distance": 5.0, "time_limit": 0.2})
    assert result.outcome == RecoveryOutcome.PAT_EXCEEDED and "not done after 0.2 s" in result.message
    assert behavior(made, "back_up").parameters is usual


@pytest.mark.parametrize(
    ("parameters", "text"),
    [
        ({"angle": 100.0}, "rotate': angle: expected a number >= -31.5 and <= 31.5 rad, got 100.0"),
        ({"angel": 1.0}, "angel: expected a known key, got 'angel' (did you mean 'angle'?)"),
        ({"angle": math.nan}, "'rotate': angle: expected a finite number >= -31.5 and <= 31.5 rad, got nan"),
    ],
)
def test_parameters_that_are_not_legal_are_refused_before_anything_moves(made, parameters, text):
    handle = made.navigator.send(RecoveryGoal("rotate", parameters=parameters))
    assert handle.status is GoalStatus.REJECTED and handle.result.outcome == RecoveryOutcome.FAILURE
    assert "parameters of recovery 'rotate'" in handle.result.message and text in handle.result.message


def test_a_behavior_that_reads_its_parameters_once_hears_of_both_changes(made):
    heard = []
    wait = behavior(made, "wait")
    wait.parameters_changed = lambda: heard.append(wait.parameters.duration)
    assert made.navigator.recover("wait", parameters={"duration": 0.25}).message == "waited 0.25 s"
    assert heard == [0.25, 3.0]


def test_each_pose_of_a_path_is_asked_about_as_the_whole_path_is(made):
    queries, path = made.server.queries, made.path((2.0, 4.0), (3.0, 4.0), (3.0, 9.5))
    places = queries.check_poses(path)
    whole = queries.check_path(path)
    assert len(places) == len(path)
    assert max(place.state for place in places) == whole.state
    assert sum(place.cost for place in places) == pytest.approx(whole.cost)
    assert [place.state for place in places] == [queries.check_pose(pose).state for pose in path]


@pytest.mark.parametrize("local", [True, False])
@pytest.mark.parametrize("size", [None, 3.0])
def test_one_map_of_a_server_is_cleared_and_the_other_keeps_what_it_knows(made, local, size):
    seen = Pose.planar(3.0, 4.0)
    made.sees(made.ray(2.0, 3.0, hit=True))
    before = {which: made.server.queries.check_point(seen, which).state for which in (True, False)}
    made.rig.sensing = False
    made.server.queries.clear_map(local) if size is None else made.server.queries.clear_area(size, local)
    after = {which: made.server.queries.check_point(seen, which).state for which in (True, False)}
    assert after[local] < before[local]
    assert (after[not local] == before[not local]) == (made.server.backend == "costmap")


def test_an_area_without_a_size_is_refused(made):
    with pytest.raises(ValueError, match="a finite size above 0 m, got 0"):
        made.server.queries.clear_area(0.0)
