"""The ticking executive: cancel at any tick of any tree or state machine, faults of nodes, drawing, repeatability."""

import re
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from py_trees.behaviours import Running
from py_trees.common import Status
from typer.testing import CliRunner

from mbf_abstract.events import EventKind
from mbf_abstract.executives.conditions import Do
from mbf_abstract.executives.leaves import ExePath, GetPath, MoveBase, Recovery
from mbf_abstract.executives.reference_trees import REFERENCE_TREES, TreeOptions, navigation_tree
from mbf_abstract.executives.state_machine import State, StateMachine
from mbf_abstract.executives.tree_command import register
from mbf_abstract.executives.tree_drawing import as_dot, as_svg, as_text, draw_tree
from mbf_abstract.executives.tree_executive import TreeExecutive
from mbf_abstract.geometry import Pose
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome, RecoveryOutcome
from mbf_abstract.plugins import ControlResult, PlanResult, RecoveryResult
from mbf_abstract.testing.faulty import drive
from mbf_abstract.testing.scripted import straight_plan
from mbf_abstract.time.clock import Priority
from mbf_abstract.time.sim_clock import SimClock
from terrain.experiments.classic_move_base.state_machine import ClassicMoveBase

GOAL = Pose.planar(1.5, 0.0)
NO_PATH = PlanResult(GetPathOutcome.NO_PATH_FOUND, "walled in")
COLLISION = ControlResult(ExePathOutcome.COLLISION, "a wall")
S, F = Status.SUCCESS, Status.FAILURE


def make_tree(name):
    if name == "navigation":
        return navigation_tree(
            TreeOptions(
                check_poses=False, second_planner_pause=0.3, second_planner_look_ahead=0.0, progress_timeout=1.0
            )
        )
    if name == "move base":
        return MoveBase()
    states = {
        "plan": State(GetPath(), {S: "drive", F: "recover"}),
        "drive": State(ExePath(), {S: S, F: "recover"}),
        "recover": State(Recovery("clear"), {S: "plan", F: F}),
    }
    return StateMachine("fetch", states)


def back_off(request):
    """A recovery that drives backwards for a second."""
    for _ in range(10):
        if not (request.motion.send(drive(-0.1).command) and request.motion.sleep(0.1)):
            return RecoveryResult(RecoveryOutcome.CANCELED, "canceled")
    return RecoveryResult(RecoveryOutcome.SUCCESS, "backed off")


def eventful(session):
    """Plans that take time and fail, collisions, and recoveries that move: every kind of node gets its turn."""
    session.planner.modelled_compute_time = 0.2
    session.planner.play(NO_PATH, straight_plan)
    for name in ("clear", "back_up"):
        session.plugin(name, object).play(back_off)
    session.controller.play(*[drive(0.3)] * 10, COLLISION, *[drive(0.3)] * 5, COLLISION, session.controller.follow)


def assert_at_rest(session):
    assert session.robot.command.is_stopped()
    ids = [
        {e.data["goal_id"] for e in session.recorded(kind)}
        for kind in (EventKind.GOAL_ACCEPTED, EventKind.GOAL_FINISHED)
    ]
    assert ids[0] == ids[1]
    now = session.clock.now()
    session.clock.sleep(2.0)
    assert session.robot.moved_after(now) == []


@pytest.mark.parametrize("name", ["navigation", "move base", "machine"])
@given(tick=st.integers(1, 130))
@settings(max_examples=12, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_cancel_at_any_tick_stops_the_robot_and_leaves_no_goal(make_session, name, tick):
    session = make_session()
    eventful(session)
    executive = TreeExecutive(make_tree(name), session.navigator)
    executive.on_tick.append(lambda count: executive.cancel("enough") if count == tick else None)
    result = executive.run(GOAL)
    assert result.status == Status.INVALID or result.success
    assert_at_rest(session)


@pytest.mark.parametrize("name", ["navigation", "move base", "machine"])
@given(seconds=st.floats(0.0, 6.0))
@settings(max_examples=8, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_cancel_from_another_thread_does_the_same(make_session, name, seconds):
    session = make_session()
    eventful(session)
    executive = TreeExecutive(make_tree(name), session.navigator)

    def cancel_later():
        session.clock.sleep(seconds)
        executive.cancel("enough")

    session.clock.spawn(cancel_later, "client", Priority.CLIENT)
    executive.run(GOAL)
    assert_at_rest(session)


@pytest.mark.parametrize("seed", range(12))
def test_cancel_holds_for_any_interleaving_of_the_threads(make_session, seed):
    rng = np.random.default_rng(seed)
    session = make_session(clock=SimClock(schedule=rng))
    eventful(session)
    tree = TreeExecutive(make_tree(["navigation", "move base", "machine"][seed % 3]), session.navigator)
    executive = ClassicMoveBase(session.navigator) if seed % 4 == 3 else tree
    seconds = float(rng.uniform(0.0, 5.0))

    def cancel_later():
        session.clock.sleep(seconds)
        executive.cancel("enough")

    session.clock.spawn(cancel_later, "client", Priority.CLIENT)
    executive.run(GOAL)
    assert_at_rest(session)


def test_a_canceled_run_says_why(make_session):
    session = make_session()
    executive = TreeExecutive(Running("for ever"), session.navigator)
    executive.on_tick.append(lambda count: executive.cancel("lunch"))
    result = executive.run()
    assert (result.status, result.message) == (Status.INVALID, "lunch")


def test_a_node_that_raises_stops_the_robot_before_the_error_is_seen(make_session):
    session = make_session()
    tree = navigation_tree(TreeOptions(check_poses=False))
    executive = TreeExecutive(tree, session.navigator)

    def fail(count):
        if count == 20:
            raise RuntimeError("boom")

    executive.on_tick.append(fail)
    with pytest.raises(RuntimeError, match="boom"):
        executive.run(GOAL)
    assert_at_rest(session)


def test_the_same_executive_runs_again(make_session):
    session = make_session()
    executive = TreeExecutive(navigation_tree(TreeOptions(check_poses=False)), session.navigator)
    assert executive.run(GOAL).success
    assert executive.run(Pose.planar(0.0, 1.0)).success


def test_two_runs_of_a_tree_write_one_log(make_session):
    logs = []
    for _ in range(2):
        session = make_session()
        eventful(session)
        TreeExecutive(make_tree("navigation"), session.navigator).run(GOAL)
        logs.append([event.to_json() for event in session.recorded(*EventKind)])
    assert logs[0] == logs[1]


def test_ticks_come_at_the_period_of_the_clock(make_session):
    session = make_session()
    executive = TreeExecutive(Do("never", lambda mission: False), session.navigator, period=0.2)
    executive.tree = Running("for ever")
    times = []
    executive.on_tick.append(lambda count: times.append(session.clock.now()))
    executive.on_tick.append(lambda count: executive.cancel() if count == 4 else None)
    executive.run()
    assert times == pytest.approx([0.0, 0.2, 0.4, 0.6])


def test_a_period_must_be_positive(make_session):
    with pytest.raises(ValueError, match="period must be positive"):
        TreeExecutive(Running("r"), make_session().navigator, period=0.0)


# ----------------------------------------------------------------------------------------------------- drawing
@pytest.mark.parametrize("name", sorted(REFERENCE_TREES))
def test_every_drawing_shows_every_node(name):
    tree = REFERENCE_TREES[name]()
    names = sorted(node.name for node in tree.iterate())
    svg = ElementTree.fromstring(as_svg(tree))
    boxes = [text.text.rsplit(" (", 1)[0] for text in svg.iter("{http://www.w3.org/2000/svg}text")]
    assert sorted(boxes) == names
    assert sorted(re.findall(r'label="(.*) \(\w+\)"', as_dot(tree))) == names
    assert all(node_name in as_text(tree) for node_name in names)


def test_boxes_of_a_drawing_do_not_overlap():
    svg = ElementTree.fromstring(as_svg(navigation_tree()))
    boxes = [
        tuple(float(r.get(k)) for k in ("x", "y", "width", "height")) for r in svg.iter() if r.tag.endswith("rect")
    ]
    for i, (x, y, width, height) in enumerate(boxes):
        for u, v, w, h in boxes[:i]:
            assert x >= u + w or u >= x + width or y >= v + h or v >= y + height


def test_an_unknown_form_is_refused():
    with pytest.raises(ValueError, match="text, dot, svg"):
        draw_tree(navigation_tree(), "png")


@pytest.fixture
def app():
    import typer

    application = typer.Typer()
    register(application)
    return application


def test_mbf_tree_shows_and_lists(app, tmp_path):
    shown = CliRunner().invoke(app, ["tree", "show", "planning"])
    assert (shown.exit_code, "get path" in shown.stdout) == (0, True)
    file = tmp_path / "tree.svg"
    assert CliRunner().invoke(app, ["tree", "show", "control", "--format", "svg", "--out", str(file)]).exit_code == 0
    assert file.read_text().startswith("<svg")
    assert all(name in CliRunner().invoke(app, ["tree", "list"]).stdout for name in REFERENCE_TREES)


@pytest.mark.parametrize("arguments", [["show", "nothing"], ["show", "control", "--format", "png"]])
def test_mbf_tree_refuses_what_it_does_not_know(app, arguments):
    assert CliRunner().invoke(app, ["tree", *arguments]).exit_code == 2
