"""Plans of many pairs at once are the plans that ``get_path`` makes of them one by one, on both maps."""

from contextlib import ExitStack
from dataclasses import replace
from threading import Barrier

import numpy as np
import pytest
import trimesh

from mbf_abstract.config.registry import PluginRegistry
from mbf_abstract.geometry import Pose
from mbf_abstract.goals.goal_types import GetPathGoal
from mbf_abstract.navigator import Navigator
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.plugins import PluginKind
from mbf_abstract.server.batch_planner import BatchPlanner
from mbf_abstract.server.plugin_host import ServerError
from mbf_abstract.server.standing_server import read_config_text, standing_server
from mbf_abstract.testing.scripted import ScriptedPlanner, straight_plan
from mbf_abstract.testing.scripted_session import ScriptedSession
from mbf_abstract.time.cancel import CancelToken
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh

PLANNERS = {backend: PluginRegistry(backend).names(PluginKind.PLANNER) for backend in ("costmap", "mesh")}
CONFIGURATIONS = {
    "costmap": """
backend: costmap
global_costmap: {width: 12.0, height: 8.0, resolution: 0.1, robot_radius: 0.3}
""",
    "mesh": """
backend: mesh
mesh_map:
  mesh_file: MESH
  inscribed_radius: 0.3
  default_layer: steepness
  layers: [{name: steepness, type: steepness}]
""",
}


def configuration(backend, folder):
    """A configuration with every planner that the backend has, by its type as its name."""
    entries = ", ".join(f"{{name: {name}, type: {name}}}" for name in PLANNERS[backend])
    text = CONFIGURATIONS[backend] + f"planner_max_retries: 0\nplanners: [{entries}]\ncontrollers: []\n"
    if backend == "mesh":
        y, x = np.mgrid[0:81, 0:121] * 0.1
        hills = 0.3 * np.sin(0.9 * x) * np.cos(1.1 * y)
        trimesh.Trimesh(*heightfield_mesh(hills, 0.1, 0.1), process=False).export(folder / "hills.ply")
        text = text.replace("MESH", str(folder / "hills.ply"))
    return read_config_text(text)


@pytest.fixture(scope="module")
def servers(tmp_path_factory):
    folder = tmp_path_factory.mktemp("maps")
    with ExitStack() as stack:
        yield {
            backend: stack.enter_context(standing_server(*configuration(backend, folder))) for backend in CONFIGURATIONS
        }


def pairs(server, count=8):
    """Starts and goals all over the map, one of them outside it."""
    places = np.random.default_rng(5).uniform((0.7, 0.7), (11.3, 7.3), (2, count, 2))
    places[1, 3] = 30.0, 30.0
    return [[server.ground_pose(x, y) for x, y in side] for side in places]


def substance(result):
    path = None if result.path is None else [(*pose.position, *pose.orientation) for pose in result.path]
    return result.outcome, result.message, result.cost, result.planner, path


def every_planner():
    return [pytest.param(backend, name, id=f"{backend}.{name}") for backend in PLANNERS for name in PLANNERS[backend]]


@pytest.mark.parametrize(("backend", "planner"), every_planner())
def test_they_are_those_of_get_path(servers, backend, planner):
    server = servers[backend]
    starts, goals = pairs(server)
    navigator = Navigator(server)
    one_by_one = [
        navigator.send(GetPathGoal(goal, start_pose=start, planner=planner)).wait()
        for start, goal in zip(starts, goals, strict=True)
    ]
    many = BatchPlanner(server, planner, workers=3).plan_many(starts, goals)
    assert {GetPathOutcome.SUCCESS, GetPathOutcome.OUT_OF_MAP} <= {result.outcome for result in many}
    assert [substance(result) for result in many] == [substance(result) for result in one_by_one]


HERE, AWAY = Pose.planar(0.0, 0.0), Pose.planar(5.0, 0.0)


@pytest.fixture
def session():
    with ScriptedSession() as made:
        yield made


def played(*answers):
    """A class of planners that play these answers, whichever instance is asked."""

    class Player(ScriptedPlanner):
        def __init__(self, context):
            super().__init__(context)
            self.play(*answers)

    return Player


@pytest.mark.parametrize(
    ("answer", "text"),
    [
        (RuntimeError("no luck"), "raised RuntimeError in make_plan: no luck"),
        (SystemExit(3), "raised SystemExit in make_plan: 3"),
        ("done", "returned str from make_plan"),
    ],
)
def test_a_fault_of_the_planner_is_the_outcome_of_its_pair(answer, text):
    def only_far(request):
        return answer if request.goal.x > 4.0 else straight_plan(request)

    with ScriptedSession({"planner": played(only_far)}) as session:
        near, far = BatchPlanner(session.server, workers=1).plan_many([HERE] * 2, [Pose.planar(1.0, 0.0), AWAY])
    assert near.success
    assert far.outcome == GetPathOutcome.INTERNAL_ERROR
    assert text in far.message


def test_a_path_that_ends_elsewhere_is_no_success():
    def short(request):
        return straight_plan(replace(request, goal=Pose.planar(1.0, 0.0)))

    with ScriptedSession({"planner": played(short)}) as session:
        (result,) = BatchPlanner(session.server).plan_many([HERE], [AWAY])
    assert result.outcome == GetPathOutcome.INTERNAL_ERROR
    assert "from the goal" in result.message


def test_the_tolerances_are_the_servers_unless_given():
    seen = []

    def noted(request):
        seen.append((request.dist_tolerance, request.angle_tolerance))
        return straight_plan(request)

    with ScriptedSession({"planner": played(noted)}, dist_tolerance=0.3) as other:
        batch = BatchPlanner(other.server)
        batch.plan_many([HERE], [AWAY])
        batch.plan_many([HERE], [AWAY], dist_tolerance=0.1, angle_tolerance=0.2)
        usual = other.server.runtime.parameters
    assert seen == [(usual.dist_tolerance, usual.angle_tolerance), (0.1, 0.2)]


def test_far_pairs_are_planned_first_and_a_near_one_after_every_two_but_results_are_in_the_order_of_the_pairs():
    asked = []

    def noted(request):
        asked.append(request.goal.x)
        return straight_plan(request)

    given = [2.0, 4.0, 7.0, 1.0, 6.0, 3.0, 5.0]
    with ScriptedSession({"planner": played(noted)}) as session:
        results = BatchPlanner(session.server, workers=1).plan_many([HERE] * 7, [Pose.planar(x, 0.0) for x in given])
    assert asked == [7.0, 6.0, 2.0, 5.0, 4.0, 1.0, 3.0]
    assert [result.path[-1].x for result in results] == given


def test_what_is_left_after_a_cancel_is_canceled():
    token = CancelToken()

    def cancels(request):
        token.cancel("enough")
        return straight_plan(request)

    with ScriptedSession({"planner": played(cancels)}) as session:
        batch = BatchPlanner(session.server, workers=1)
        first, *rest = batch.plan_many([HERE] * 3, [AWAY] * 3, cancel_token=token)
    assert first.success
    assert [(result.outcome, result.message) for result in rest] == [(GetPathOutcome.CANCELED, "enough")] * 2


@pytest.mark.parametrize("backend", CONFIGURATIONS)
def test_one_bad_pair_is_an_outcome_and_leaves_the_others_as_they_are(servers, backend):
    server = servers[backend]
    starts, goals = pairs(server)
    batch = BatchPlanner(server, "astar", workers=2)
    alone = batch.plan_many(starts, goals)
    lost = [Pose.planar(1.0, 1.0, frame_id="moon"), *goals[1:]]
    mixed = batch.plan_many([*starts, starts[0]], [*goals, lost[0]])
    assert mixed[-1].outcome == GetPathOutcome.TF_ERROR and "moon" in mixed[-1].message
    assert (mixed[-1].path, mixed[-1].planner) == (None, "astar")
    assert [substance(result) for result in mixed[:-1]] == [substance(result) for result in alone]


@pytest.mark.parametrize("backend", CONFIGURATIONS)
def test_a_map_that_raises_is_the_outcome_of_the_pairs_it_raises_for(servers, backend, monkeypatch):
    server, calls = servers[backend], []

    def raises_once():
        calls.append(None)
        if len(calls) == 2:
            raise OSError("no tile")
        return ""

    monkeypatch.setattr(server, "missing_floor", raises_once)
    starts, goals = ([pose] * 4 for pose in (server.ground_pose(1.0, 1.0), server.ground_pose(2.0, 1.0)))
    results = BatchPlanner(server, "astar", workers=1).plan_many(starts, goals)
    assert [result.success for result in results] == [True, False, True, True]
    assert results[1].outcome == GetPathOutcome.INTERNAL_ERROR
    assert results[1].message == "planning this pair raised OSError: no tile"


@pytest.mark.parametrize("backend", CONFIGURATIONS)
def test_a_cancel_ends_all_that_is_left_and_the_next_batch_plans_as_before(servers, backend):
    server = servers[backend]
    starts, goals = pairs(server)
    batch, token = BatchPlanner(server, "astar", workers=2), CancelToken()
    before = batch.plan_many(starts, goals)
    token.cancel("enough")
    canceled = batch.plan_many(starts, goals, cancel_token=token)
    assert [(one.outcome, one.message, one.path) for one in canceled] == [(GetPathOutcome.CANCELED, "enough", None)] * 8
    assert batch.plan_many([], [], cancel_token=token) == []
    assert [substance(one) for one in batch.plan_many(starts, goals)] == [substance(one) for one in before]


def test_two_pairs_are_planned_at_the_same_time():
    both = Barrier(2, timeout=60.0)

    def together(request):
        both.wait()
        return straight_plan(request)

    with ScriptedSession({"planner": played(together)}) as session:
        results = BatchPlanner(session.server, workers=2).plan_many([HERE] * 2, [AWAY] * 2)
    assert all(result.success for result in results)


def test_a_second_thread_is_refused():
    batches = []

    def asks_again(request):
        batches[0].plan_many([HERE], [AWAY])

    with ScriptedSession({"planner": played(asks_again)}) as session:
        batches.append(BatchPlanner(session.server))
        (result,) = batches[0].plan_many([HERE], [AWAY])
    assert "raised ServerError in make_plan: this batch planner is in use by another thread" in result.message


def test_no_pairs_give_no_plans(session):
    assert BatchPlanner(session.server).plan_many([], []) == []


@pytest.mark.parametrize(
    ("arguments", "error", "text"),
    [
        ({"goals": []}, ValueError, "as many starts as goals are needed, got 1 and 0"),
        ({"dist_tolerance": float("nan")}, ValueError, "tolerances must not be negative"),
        ({"dist_tolerance": 1e30}, ValueError, "dist_tolerance must be at most 1000 m"),
        ({"goals": [None]}, TypeError, r"goals\[0\] must be a Pose, got NoneType"),
    ],
)
def test_misuse_is_one_clear_error(session, arguments, error, text):
    with pytest.raises(error, match=text):
        BatchPlanner(session.server).plan_many(**{"starts": [HERE], "goals": [AWAY], **arguments})


def test_an_unknown_planner_is_refused_with_those_that_are_loaded(session):
    with pytest.raises(ServerError, match="no planner named 'other'; loaded: planner"):
        BatchPlanner(session.server, "other")


def test_no_worker_is_refused(session):
    with pytest.raises(ValueError, match="at least one worker is needed, got 0"):
        BatchPlanner(session.server, workers=0)


def test_a_planner_in_use_is_refused_with_its_name(session):
    plugin = session.server.plugins.get(PluginKind.PLANNER, "planner")
    assert plugin.acquire("a goal", lambda: True)
    with pytest.raises(ServerError, match="planner 'planner' is in use"):
        BatchPlanner(session.server)
