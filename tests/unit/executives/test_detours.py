"""What a tree that asks who is in its way does while it drives, on a map that answers what the test says."""

import math
from dataclasses import replace
from types import SimpleNamespace

import pytest

from mbf_abstract.executives.reference_trees import TreeOptions, navigation_tree
from mbf_abstract.executives.tree_executive import TreeExecutive
from mbf_abstract.executives.trees.by_motion import EndDrive
from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.transform import Transform
from mbf_abstract.maps.queries import CellState
from mbf_abstract.maps.tracking.blocking import Blockage
from mbf_abstract.maps.tracking.objects import Motion
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome, RecoveryOutcome
from mbf_abstract.plugins import ControlResult, PlanResult, RecoveryResult
from mbf_abstract.testing.faulty import drive
from mbf_abstract.testing.scripted import ScriptedRecovery, straight_plan

OPTIONS = TreeOptions(check_poses=False, wait="relax", give_way="back_up")
GOAL = Pose.planar(6.0, 0.0)
NO_PATH = PlanResult(GetPathOutcome.NO_PATH_FOUND, "walled in")
BLOCKED = ControlResult(ExePathOutcome.BLOCKED_PATH, "somebody")


@pytest.fixture
def on_the_path(monkeypatch):
    """Let a session's map know these objects, how bad its path is, and up to where [m] poses are free."""

    def know(session, *blockages, state=CellState.LETHAL, free_to=math.inf):
        answer = SimpleNamespace(state=state)

        def check_poses(path):
            return [SimpleNamespace(state=CellState.FREE if pose.x < free_to else CellState.LETHAL) for pose in path]

        queries = SimpleNamespace(what_blocks=lambda path, margin: blockages, check_path=lambda *asked: answer)
        queries.check_poses = check_poses
        monkeypatch.setattr(type(session.server), "queries", queries)

    return know


def somebody(motion=Motion.WAITING, standing=3.0, distance=1.0, along=0.0, ahead=1.0):
    known = SimpleNamespace(motion=motion, standing=standing, number=7, course=(along, 0.0))
    return Blockage(known, 0, distance, along, ahead)


def creep(session, cycles=80):
    session.controller.play(*[drive(0.1)] * cycles, session.controller.follow)


def run(session, options=OPTIONS):
    return TreeExecutive(navigation_tree(options), session.navigator).run(GOAL)


@pytest.mark.parametrize(("motion", "plans"), [(Motion.WAITING, 2), (Motion.PARKED, 2), (Motion.MOVING, 1)])
def test_a_robot_that_creeps_past_somebody_who_stands_asks_for_more_room(make_session, on_the_path, motion, plans):
    session = make_session()
    on_the_path(session, somebody(motion), state=CellState.INSCRIBED)
    creep(session, 30)
    assert run(session).success
    assert len([request for request in session.planner.requests if request.start.x < 1.0]) == plans


def test_a_detour_that_fails_is_not_asked_for_until_the_patience_is_over(make_session, on_the_path):
    session = make_session(planner_max_retries=-1, planner_patience=2.0)
    on_the_path(session, somebody())
    creep(session)
    session.planner.play(straight_plan, NO_PATH)
    assert run(session).success
    assert len([request for request in session.planner.requests if request.start.x < 0.6]) == 2


@pytest.mark.parametrize(
    ("along", "standing", "yields"),
    [(-1.0, 5.5, []), (-1.0, 6.5, ["back_up"]), (1.0, 9.5, []), (1.0, 10.5, ["back_up"])],
)
def test_before_one_that_stands_for_too_long_the_drive_ends(
    make_session, recoveries, on_the_path, along, standing, yields
):
    """One that came along the path; and one that went along it, and may have stood in a queue until then."""
    session = make_session()
    on_the_path(session, somebody(standing=standing, along=along))
    creep(session, 40)
    session.planner.play(straight_plan, NO_PATH)
    assert run(session).success
    assert recoveries(session)[:1] == yields


def test_the_drive_goes_on_past_one_that_the_robot_is_more_than_half_past(make_session, recoveries, on_the_path):
    session = make_session()
    on_the_path(session, somebody(standing=20.0, along=-1.0, ahead=-0.1))
    creep(session, 40)
    session.planner.play(straight_plan, NO_PATH)
    assert run(session).success
    assert recoveries(session) == []


def test_a_controller_that_refuses_beside_somebody_asks_for_more_room_before_the_robot_creeps(
    make_session, recoveries, on_the_path
):
    session = make_session(controller_max_retries=3)
    on_the_path(session, somebody(), state=CellState.INSCRIBED)
    session.controller.play(*[drive(0.5)] * 10, BLOCKED, *[drive(0.5)] * 20, session.controller.follow)
    assert run(session).success
    assert len(session.planner.requests) == 2 and recoveries(session) == []


def test_one_that_stopped_when_the_robot_crept_already_stopped_for_it(make_session, recoveries, on_the_path):
    """It came along the path; another one that stood before may only load, and gets 6 s."""
    for first_seen, yields in ((2.0, ["back_up"]), (2.6, [])):
        session, seen = make_session(), []

        def what_blocks(path, margin, session=session, seen=seen, first_seen=first_seen):
            seen.append(session.clock.now())
            return (somebody(standing=first_seen + seen[-1] - seen[0], along=-1.0),)

        on_the_path(session)
        session.server.queries.what_blocks = what_blocks
        creep(session, 70)
        session.planner.play(straight_plan, NO_PATH)
        assert run(session).success
        assert recoveries(session)[:1] == yields


@pytest.mark.parametrize(("second", "ends"), [((12.5, 3.5), "FS"), ((11.0, 4.0), "FF")], ids=["same stop", "earlier"])
def test_one_that_stopped_earlier_than_it_seemed_did_not_stop_for_the_robot(tick, second, ends):
    """It is seen to have stood for 1 s at 10 s, then for longer."""
    seen, failures = [(10.0, 1.0), second], []

    def what_blocks(path, margin):
        return (somebody(standing=seen[0][1], along=-1.0),)

    server = SimpleNamespace(queries=SimpleNamespace(what_blocks=what_blocks))
    clock = SimpleNamespace(now=lambda: seen.pop(0)[0])
    drive_over = EndDrive("drive is over?")
    drive_over.setup(
        mission=SimpleNamespace(
            clock=clock,
            navigator=SimpleNamespace(server=server),
            path=(),
            path_to_follow=tuple,
            detour_taken=None,
            fail=failures.append,
        )
    )
    assert tick(drive_over) + tick(drive_over) == ends
    assert len(failures) == ends.count("S")


@pytest.mark.parametrize(("along", "recovery"), [(-1.0, ["back_up"]), (1.0, ["relax"])], ids=["came", "went"])
def test_before_one_that_came_along_the_path_giving_way_is_the_first_recovery(
    make_session, recoveries, on_the_path, along, recovery
):
    session = make_session()
    on_the_path(session, somebody(along=along))
    session.controller.play(BLOCKED, session.controller.follow)
    session.planner.play(straight_plan, NO_PATH)
    assert run(session, replace(OPTIONS, second_planner_pause=0.0)).success
    assert recoveries(session) == recovery


@pytest.mark.parametrize(
    ("beside", "answer", "plans"),
    [(1.0, straight_plan, 3), (1.0, NO_PATH, 3), (0.2, straight_plan, 2)],
    ids=["off the path", "no path from there", "on the path"],
)
def test_who_gave_way_beside_its_path_plans_anew_and_keeps_its_path_where_there_is_none(
    make_session, recoveries, on_the_path, beside, answer, plans
):
    session = make_session(planner_max_retries=-1, planner_patience=2.0)
    on_the_path(session, somebody(along=-1.0))

    def give_way(request):
        session.robot.T_map_odom = Transform((0.0, beside, 0.0), parent="map", child="odom")
        return RecoveryResult(RecoveryOutcome.SUCCESS, "gave way")

    session.plugin("back_up", ScriptedRecovery).play(give_way)
    session.controller.play(BLOCKED, session.controller.follow)
    session.planner.play(straight_plan, NO_PATH, answer)  # there is no detour
    assert run(session, replace(OPTIONS, second_planner_pause=0.0)).success
    assert recoveries(session) == ["back_up"]
    assert len(session.planner.requests) == plans
    assert session.robot.pose.distance_to(GOAL) < 0.15


def test_a_drive_on_a_detour_goes_on_although_another_one_was_asked_for_and_not_taken(
    make_session, recoveries, on_the_path
):
    session = make_session()
    on_the_path(session, somebody(standing=8.0, along=-1.0))
    creep(session, 60)
    session.planner.play(straight_plan, straight_plan, NO_PATH)
    assert run(session).success
    assert len(session.planner.requests) > 2 and recoveries(session) == []


@pytest.mark.parametrize(("moves", "back"), [(5.0, 3.0), (2.4, 2.4), (1.3, 1.8)], ids=["far", "near", "too near"])
def test_around_one_that_stands_before_one_that_moves_a_detour_leads_back_to_the_path_between_both(
    make_session, on_the_path, moves, back
):
    session = make_session()
    on_the_path(session, somebody(), somebody(Motion.MOVING, 0.0, moves))
    creep(session)
    assert run(session).success
    _, around, *_ = session.planner.requests
    assert around.goal.x == pytest.approx(around.start.x + back, abs=0.15) and around.dist_tolerance == 0.0
    assert session.robot.pose.distance_to(GOAL) < 0.15


def test_a_detour_leads_back_to_where_the_robot_fits_and_nowhere_between_both_if_it_does_not(make_session, on_the_path):
    for free_to, goal in ((2.0, 2.0), (1.0, GOAL.x)):
        session = make_session()
        on_the_path(session, somebody(), somebody(Motion.MOVING, 0.0, 5.0), free_to=free_to)
        creep(session)
        assert run(session).success
        assert session.planner.requests[1].goal.x == pytest.approx(goal, abs=0.11)


def test_without_a_way_between_both_it_is_planned_to_the_goal(make_session, on_the_path):
    session = make_session()
    on_the_path(session, somebody(), somebody(Motion.MOVING, 0.0, 5.0))
    creep(session)
    session.planner.play(straight_plan, NO_PATH, straight_plan)
    assert run(session).success
    assert [request.goal.x for request in session.planner.requests[:3]] == pytest.approx([6.0, 3.0, 6.0], abs=0.7)


@pytest.mark.parametrize(("speed", "recovered"), [(0.02, ["clear"]), (0.5, [])], ids=["at one place", "on the way"])
def test_a_robot_between_two_ways_recovers_instead_of_changing_its_mind_for_ever(
    make_session, recoveries, speed, recovered
):
    def by_the_side(request):
        return straight_plan(replace(request, via=(Pose.planar(1.0, 2.5),)))

    session = make_session()
    session.planner.play(*[straight_plan, by_the_side] * 3, straight_plan)
    session.controller.play(*[drive(speed)] * 60, session.controller.follow)
    options = TreeOptions(
        check_poses=False, second_planner_pause=0.5, second_planner_look_ahead=0.0, longest_update=2.0
    )
    assert run(session, options).success
    assert recoveries(session) == recovered
