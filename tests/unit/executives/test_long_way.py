"""Where a plan led far around somebody who moved, the short way is asked for once they have gone."""

from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from mbf_abstract.executives.reference_trees import TreeOptions, navigation_tree
from mbf_abstract.executives.tree_executive import TreeExecutive
from mbf_abstract.executives.trees.long_way import MOST, IsLongWay
from mbf_abstract.geometry import Path, Pose
from mbf_abstract.maps.queries import CellState
from mbf_abstract.maps.tracking.objects import Motion
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.plugins import PlanResult
from mbf_abstract.testing.scripted import straight_plan

AROUND = [(0.0, 0.0, 0.0), (0.0, 10.0, 0.0), (5.0, 10.0, 0.0), (5.0, 0.0, 0.0)]
STRAIGHT = [(0.0, 0.0, 0.0), (5.0, 0.0, 0.0)]


class Scene:
    """A mission on a path, and who is known around its robot."""

    def __init__(self, points):
        self.known = ()
        queries = SimpleNamespace(tracked_objects=lambda: self.known)
        navigator = SimpleNamespace(server=SimpleNamespace(queries=queries))
        self.mission = SimpleNamespace(navigator=navigator, target=Pose.planar(5.0, 0.0))
        self.plan(points)
        self.node = IsLongWay()
        self.node.setup(mission=self.mission)

    def plan(self, points):
        self.mission.plan, self.mission.path = object(), Path.from_points(points)

    def sees(self, **motions):
        self.known = [SimpleNamespace(number=int(n[1:]), motion=Motion(motion)) for n, motion in motions.items()]


@pytest.mark.parametrize(("points", "ends"), [(AROUND, "FFS"), (STRAIGHT, "FFF")], ids=["long", "short"])
def test_a_shorter_path_is_asked_for_once_who_moved_near_a_long_one_has_gone(tick, points, ends):
    scene, seen = Scene(points), ""
    for motions in ({"n1": "moving"}, {"n1": "waiting"}, {"n2": "moving"}):
        scene.sees(**motions)
        seen += tick(scene.node)
    assert seen == ends


@pytest.mark.parametrize("motions", [{}, {"n1": "parked"}], ids=["nobody", "parked"])
def test_a_long_way_around_nobody_who_moved_is_one(tick, motions):
    scene = Scene(AROUND)
    scene.sees(**motions)
    assert tick(scene.node) == "F"
    scene.sees()
    assert tick(scene.node, 3) == "FFF"


def test_it_is_asked_for_again_for_who_moved_then_and_only_so_often(tick):
    scene, asked = Scene(AROUND), 0
    for number in range(10):
        scene.sees(**{f"n{number}": "moving"})
        asked += tick(scene.node) == "S"
    assert asked == MOST
    scene.mission.target = Pose.planar(5.0, 0.0)
    scene.plan(AROUND)
    scene.sees(n20="moving")
    assert tick(scene.node) == "F"
    scene.sees()
    assert tick(scene.node) == "S"


def test_where_the_frame_of_the_path_is_another_one_nothing_is_asked_for(tick):
    scene = Scene(AROUND)
    scene.mission.target = Pose.planar(5.0, 0.0, frame_id="odom")
    scene.sees(n1="moving")
    assert tick(scene.node) == "F"
    scene.sees()
    assert tick(scene.node) == "F"


@pytest.mark.parametrize(("again", "takes"), [(straight_plan, True), (None, False)], ids=["shorter", "as long"])
def test_a_tree_turns_back_to_the_short_way_once_who_was_there_has_gone(make_session, monkeypatch, again, takes):
    def around(request):
        corners = [request.start.position[:2], (0.0, 10.0), (6.0, 10.0), (6.0, 0.0)]
        lines = [np.linspace(begin, end, 100, endpoint=False) for begin, end in pairwise(corners)]
        points = np.vstack([*lines, corners[-1:]])
        path = Path.from_points(np.column_stack([points, np.zeros(len(points))]))
        return PlanResult(GetPathOutcome.SUCCESS, "around", path)

    mover, farthest = SimpleNamespace(number=1, motion=Motion.MOVING), [0.0]

    def tracked_objects():
        farthest[0] = max(farthest[0], session.robot.pose.y)
        return (mover,) if farthest[0] < 1.0 else ()

    session = make_session()
    free = SimpleNamespace(state=CellState.FREE)
    queries = SimpleNamespace(tracked_objects=tracked_objects, what_blocks=lambda path, **asked: ())
    queries.check_path = lambda *asked: free
    monkeypatch.setattr(type(session.server), "queries", queries)
    session.planner.play(around, again or around)
    tree = navigation_tree(TreeOptions(check_poses=False, wait="relax", give_way="back_up"))
    assert TreeExecutive(tree, session.navigator).run(Pose.planar(6.0, 0.0)).success
    assert len(session.planner.requests) == 2
    assert (session.clock.now() < 25.0) == takes
