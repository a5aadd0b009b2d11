"""Tours over waypoints, one move_base goal after the other."""

import pytest

from mbf_abstract.geometry import Pose
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.plugins import PlanResult
from mbf_abstract.testing.scripted import straight_plan

NO_PATH = PlanResult(GetPathOutcome.NO_PATH_FOUND, "walled in")


def test_waypoints_are_visited_in_order_with_a_task_at_each(make_bench):
    bench = make_bench()
    visited = []

    def task(index, pose):
        visited.append((index, round(bench.navigator.robot_pose().distance_to(pose), 1)))

    tour = bench.navigator.follow_waypoints([Pose.planar(0.5, 0), Pose.planar(0.5, 0.5)], loops=2, task=task)
    assert tour.success
    assert [index for index, _ in visited] == [0, 1, 0, 1]
    assert max(distance for _, distance in visited) <= 0.1


@pytest.mark.parametrize(("stop", "visits"), [(True, 2), (False, 3)])
def test_a_failed_waypoint_ends_the_tour_or_not(make_bench, stop, visits):
    bench = make_bench(recovery_enabled=False, planner_max_retries=0)
    bench.planner.play(straight_plan, NO_PATH, straight_plan)
    tour = bench.navigator.follow_waypoints([Pose.planar(x, 0.0) for x in (0.3, 0.6, 0.9)], stop_on_failure=stop)
    assert len(tour.results) == visits
    assert tour.failed == (1,)
    assert not tour.success


def test_a_tour_of_no_loops_is_refused(make_bench):
    with pytest.raises(ValueError, match="loops"):
        make_bench().navigator.follow_waypoints([], loops=0)
