"""Leaves that ask the map, on a map that answers what the test says."""

import pytest
from py_trees.common import Status

from mbf_abstract.events import EventKind
from mbf_abstract.executives.map_leaves import CheckPath, CheckPoint, CheckPose, ClearMap, PathBlocked
from mbf_abstract.executives.reference_trees import TreeOptions, navigation_tree
from mbf_abstract.executives.tree_executive import TreeExecutive
from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.transform import TransformError
from mbf_abstract.maps.queries import CellState, PathAnswer, PlaceAnswer
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome
from mbf_abstract.testing.scripted_session import MapFreeServer

GOAL = Pose.planar(1.0, 0.0)


class Map:
    """Answers each question with the next state of a list, the last one for ever."""

    def __init__(self):
        self.states = [CellState.FREE]
        self.cleared = 0
        self.asked = []

    def _state(self, *question):
        self.asked.append(question)
        state = self.states.pop(0) if len(self.states) > 1 else self.states[0]
        if isinstance(state, Exception):
            raise state
        return state

    def check_point(self, point, local=False):
        return PlaceAnswer(self._state("point", point), 1.0)

    def check_pose(self, pose, query):
        return PlaceAnswer(self._state("pose", pose), 1.0)

    def check_path(self, path, query, return_on, skip_poses=0):
        self.path_length = path.length
        return PathAnswer(0, self._state("path", return_on), 1.0)

    def clear_map(self):
        self.cleared += 1


@pytest.fixture
def world(monkeypatch):
    answers = Map()
    monkeypatch.setattr(MapFreeServer, "queries", answers)
    return answers


@pytest.fixture
def run(make_session, world):
    session = make_session()
    return lambda tree, **given: TreeExecutive(tree, session.navigator).run(**given)


@pytest.mark.parametrize(
    ("state", "status"), [(CellState.INSCRIBED, Status.SUCCESS), (CellState.LETHAL, Status.FAILURE)]
)
@pytest.mark.parametrize("leaf", [CheckPoint, CheckPose])
def test_a_place_must_not_be_worse_than_inscribed(run, world, leaf, state, status):
    world.states = [state]
    assert run(leaf("free?"), target=GOAL).status == status


def test_the_code_says_whether_robot_or_goal_is_blocked(run, world):
    world.states = [CellState.LETHAL]
    at_robot = run(CheckPose("robot", at_robot=True))
    assert at_robot.mission.failure_code == GetPathOutcome.BLOCKED_START
    assert world.asked[-1] == ("pose", None)
    assert run(CheckPose("goal"), target=GOAL).mission.failure_code == GetPathOutcome.BLOCKED_GOAL


def test_a_path_is_checked_up_to_its_first_bad_pose(run, world, make_session):
    world.states = [CellState.LETHAL]
    path = make_session().path_to(1.0)
    assert run(CheckPath("path free?"), path=path).mission.failure_code == ExePathOutcome.BLOCKED_PATH
    assert world.asked[-1] == ("path", CellState.LETHAL)


@pytest.mark.parametrize(
    ("state", "status"), [(CellState.LETHAL, Status.SUCCESS), (CellState.INSCRIBED, Status.FAILURE)]
)
def test_a_path_is_blocked_if_its_next_metres_are_and_that_is_no_failure(run, world, make_session, state, status):
    world.states = [state]
    result = run(PathBlocked("blocked?", 0.5), path=make_session().path_to(3.0))
    assert (result.status, result.mission.failure) == (status, None)
    assert 0.0 < world.path_length <= 0.5


def test_where_the_map_cannot_say_no_path_is_blocked(run, world, make_session):
    world.states = [TransformError("no frame 'moon'")]
    result = run(PathBlocked("blocked?", 0.5), path=make_session().path_to(3.0))
    assert (result.status, result.mission.failure) == (Status.FAILURE, None)


def test_without_a_path_nothing_is_blocked(run, world):
    assert run(PathBlocked("blocked?", 0.5)).status == Status.FAILURE
    assert world.asked == []


def test_a_second_planner_of_blocked_paths_is_not_asked_on_a_free_one(make_session, world):
    for state, planned in ((CellState.FREE, 1), (CellState.LETHAL, 3)):
        session, world.states = make_session(), [state]
        options = TreeOptions(check_poses=False, second_planner_pause=0.5, second_planner_look_ahead=1.0)
        assert TreeExecutive(navigation_tree(options), session.navigator).run(Pose.planar(3.0, 0.0)).success
        calls = [e for e in session.recorded(EventKind.PLUGIN_CALL_STARTED) if e.data["method"] == "make_plan"]
        assert len(calls) == planned if planned == 1 else len(calls) >= planned


def test_an_unknown_frame_is_a_failure_not_a_crash(run, world):
    world.states = [TransformError("no frame 'moon'")]
    result = run(CheckPose("goal"), target=GOAL)
    assert (result.mission.failure_code, result.status) == (GetPathOutcome.TF_ERROR, Status.FAILURE)


def test_the_map_is_cleared(run, world):
    assert run(ClearMap()).success
    assert world.cleared == 1


def test_navigation_frees_a_blocked_robot_before_it_plans(make_session, world, recoveries):
    session = make_session()
    world.states = [CellState.LETHAL, CellState.LETHAL, CellState.FREE]
    tree = navigation_tree(TreeOptions(second_planner_pause=0.0))
    assert TreeExecutive(tree, session.navigator).run(GOAL).success
    assert recoveries(session) == ["clear", "back_up"]
