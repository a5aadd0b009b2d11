"""MemRec, recovery node (F183 to F192), round robin (F193 to F196), guards and the recovery filter (F206 to F208)."""

from types import SimpleNamespace

import pytest
from py_trees.common import Status

from mbf_abstract.drive.robot import RobotStateError
from mbf_abstract.executives.conditions import recovery_would_help
from mbf_abstract.executives.recovering import InOrder, MemRec, OutcomeGuard, PickByOutcome, RecoveryNode, RoundRobin
from mbf_abstract.executives.trees.by_motion import PickByMotion
from mbf_abstract.geometry import Path, Pose
from mbf_abstract.maps.tracking.blocking import Blockage
from mbf_abstract.maps.tracking.objects import Motion
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome


def bind(tree, code=0):
    """Let the tree run in a mission whose last failure has this code."""
    for node in tree.iterate():
        node.setup(mission=SimpleNamespace(failure_code=code))
    return tree


def recovery_node(scripted, task, recovery, retries=1):
    return RecoveryNode("node", [scripted(task), scripted(recovery)], retries)


# ------------------------------------------------------------------------------------------------------ MemRec
def test_memrec_ends_with_a_check_that_passes(scripted, tick):
    tree = MemRec("free", scripted("S"), [scripted("S")])
    assert tick(tree) == "S"
    assert tree.children[1].ticks == 0


def test_memrec_alternates_the_check_with_the_next_recovery(scripted, tick):
    tree = MemRec("free", scripted("FFS"), [scripted("S"), scripted("S"), scripted("S")])
    assert tick(tree) == "S"
    assert [child.ticks for child in tree.children] == [3, 1, 1, 0]


def test_memrec_checks_again_after_a_failed_recovery(scripted, tick):
    tree = MemRec("free", scripted("FS"), [scripted("F")])
    assert tick(tree) == "S"


def test_memrec_fails_when_the_list_is_used_up(scripted, tick):
    tree = MemRec("free", scripted("F"), [scripted("S"), scripted("RS")])
    assert tick(tree, 2) == "RF"
    assert [child.ticks for child in tree.children] == [3, 1, 2]


def test_memrec_remembers_its_place_while_a_recovery_runs(scripted, tick):
    tree = MemRec("free", scripted("FFS"), [scripted("RRS"), scripted("RS")])
    assert tick(tree, 4) == "RRRS"
    assert [child.entries for child in tree.children] == [3, 1, 1]


def test_memrec_starts_its_list_again_when_entered_again(scripted, tick):
    tree = MemRec("free", scripted("FSFS"), [scripted("S"), scripted("S")])
    assert tick(tree, 2) == "SS"
    assert [child.ticks for child in tree.children] == [4, 2, 0]


def test_memrec_gives_up_on_a_code_no_recovery_repairs(scripted, tick):
    tree = bind(MemRec("plan", scripted("F"), [], give_up_on=[53]), code=53)
    tree.add_child(recovery := scripted("S"))
    assert tick(tree) == "F"
    assert recovery.ticks == 0


# ----------------------------------------------------------------------------------------------- recovery node
@pytest.mark.parametrize(
    ("fact", "task", "recovery", "seen"),
    [
        ("F183", "S", "S", "S"),
        ("F184", "FS", "S", "S"),
        ("F185", "F", "F", "F"),
        ("F186", "FF", "S", "F"),
        ("F187", "R", "S", "R"),
        ("F187", "F", "R", "R"),
    ],
)
def test_recovery_node(scripted, tick, fact, task, recovery, seen):
    assert tick(recovery_node(scripted, task, recovery)) == seen


def test_f190_a_recovery_node_refuses_three_children(scripted):
    with pytest.raises(ValueError, match="got 3 children"):
        RecoveryNode("node", [scripted("S"), scripted("S"), scripted("S")])


def test_f191_a_child_without_status_is_an_error(scripted, tick):
    with pytest.raises(RuntimeError, match="returned no status"):
        tick(recovery_node(scripted, "I", "S"))


@pytest.mark.parametrize(("task", "recovery"), [("S", "S"), ("FS", "S"), ("F", "F"), ("FF", "S")])
def test_f192_after_any_end_both_children_are_idle(scripted, tick, task, recovery):
    tree = recovery_node(scripted, task, recovery)
    tick(tree)
    assert [child.status for child in tree.children] == [Status.INVALID] * 2


# ------------------------------------------------------------------------------------------------- round robin
def test_f193_a_success_is_remembered(scripted, tick):
    tree = RoundRobin("turns", [scripted("F"), scripted("S"), scripted("S")])
    assert tick(tree, 2) == "SS"
    assert [child.ticks for child in tree.children] == [1, 1, 1]


def test_f194_all_failures_fail(scripted, tick):
    tree = RoundRobin("turns", [scripted("F"), scripted("F")])
    assert tick(tree) == "F"
    assert [child.ticks for child in tree.children] == [1, 1]


def test_f196_without_wrap_around_a_turn_ends_with_the_last_child(scripted, tick):
    tree = RoundRobin("turns", [scripted("SF"), scripted("F"), scripted("F")], wrap_around=False)
    assert tick(tree, 2) == "SF"
    assert [child.ticks for child in tree.children] == [1, 1, 1]


def test_an_idle_round_robin_begins_with_its_first_child(scripted, tick):
    tree = RoundRobin("turns", [scripted("S"), scripted("S")])
    tick(tree)
    tree.stop(Status.INVALID)
    tick(tree)
    assert [child.ticks for child in tree.children] == [2, 0]


# ------------------------------------------------------------------------------------------------------ guards
def test_a_guard_opens_for_its_codes_only(scripted, tick):
    child = scripted("S")
    tree = OutcomeGuard("contact", child, [ExePathOutcome.COLLISION])
    assert tick(bind(tree, ExePathOutcome.BLOCKED_PATH)) == "F"
    assert child.ticks == 0
    assert tick(bind(tree, ExePathOutcome.COLLISION)) == "S"


def test_a_guard_decides_once_and_lets_its_child_finish(scripted, tick):
    tree = bind(OutcomeGuard("contact", scripted("RS"), [104]), 104)
    assert tick(tree) == "R"
    tree.mission.failure_code = 0
    assert tick(tree) == "S"


def test_the_first_guard_that_fits_is_picked(scripted, tick):
    children = [scripted("S"), scripted("S"), scripted("S")]
    codes = [[1], [2, 3], [3]]
    tree = PickByOutcome("pick", [OutcomeGuard(str(c), child, c) for c, child in zip(codes, children, strict=True)])
    assert tick(bind(tree, 3)) == "S"
    assert [child.ticks for child in children] == [0, 1, 0]


def test_where_no_guard_fits_the_pick_fails(scripted, tick):
    assert tick(bind(PickByOutcome("pick", [OutcomeGuard("g", scripted("S"), [1])]), 2)) == "F"


def test_turns_are_remembered_across_picks_of_other_codes(scripted, tick):
    ran = []
    first, second, other = (scripted("S", name) for name in ("first", "second", "other"))
    for node in (first, second, other):
        node.terminate = lambda status, node=node: ran.append(node.name) if status == Status.SUCCESS else None
    blocked = OutcomeGuard("blocked", RoundRobin("turns", [first, second]), [110])
    tree = InOrder("recover", [PickByOutcome("pick", [OutcomeGuard("contact", other, [104]), blocked])])
    for code in (110, 104, 110):
        tick(bind(tree, code))
    assert ran == ["first", "other", "second"]


@pytest.mark.parametrize(
    ("nodes", "seen"),
    [
        pytest.param("-S", "S", id="F195-one-succeeds"),
        pytest.param("--F", "F", id="F195-the-last-fails"),
        pytest.param("--", "F", id="F195-all-closed"),
    ],
)
def test_turns_pass_over_closed_guards(scripted, tick, nodes, seen):
    # Nav2 skips a child; all skipped is a status of its own there. py_trees has none: a closed guard fails.
    children = [OutcomeGuard(str(i), scripted("S"), [1]) if n == "-" else scripted(n) for i, n in enumerate(nodes)]
    assert tick(bind(RoundRobin("turns", children), 2)) == seen


@pytest.mark.parametrize(
    ("task_is_closed", "ran"), [pytest.param(True, [0, 1], id="F188"), pytest.param(False, [1, 0], id="F189")]
)
def test_a_recovery_node_takes_a_closed_guard_for_a_failure(scripted, tick, task_is_closed, ran):
    # Nav2 passes on that its task was skipped. Ours tries the recovery, and fails where the task stays closed.
    children = [scripted("F"), scripted("S")]
    guarded = children.copy()
    closed = 0 if task_is_closed else 1
    guarded[closed] = OutcomeGuard("closed", children[closed], [1])
    assert tick(bind(RecoveryNode("node", guarded), 2)) == "F"
    assert [child.ticks for child in children] == ran


# ------------------------------------------------------------------------------------------------ recovery filter
@pytest.mark.parametrize(
    ("fact", "outcome", "helps"),
    [
        ("F206", ExePathOutcome.SUCCESS, False),
        ("F206", ExePathOutcome.INVALID_PLUGIN, False),
        ("F206", ExePathOutcome.TF_ERROR, False),
        ("F206", ExePathOutcome.INVALID_PATH, False),
        ("F207", ExePathOutcome.FAILURE, True),
        ("F207", ExePathOutcome.PAT_EXCEEDED, True),
        ("F207", ExePathOutcome.ROBOT_STUCK, True),
        ("F207", ExePathOutcome.NO_VALID_CMD, True),
        ("F208", GetPathOutcome.FAILURE, True),
        ("F208", GetPathOutcome.NO_PATH_FOUND, True),
        ("F208", GetPathOutcome.SUCCESS, False),
    ],
)
def test_whether_a_recovery_would_help(fact, outcome, helps):
    assert recovery_would_help(outcome) is helps


# ------------------------------------------------------------------------------------------------ pick by motion
AHEAD = Path.from_poses([Pose.planar(0.0, 0.0), Pose.planar(9.0, 0.0)])


def among(tree, *blockages, path=AHEAD, lost=False):
    """Let the tree run in a mission whose map knows these objects on its path: (motion, metres ahead)."""

    def what_blocks(of_path, margin):
        assert of_path is path
        if lost:
            raise RobotStateError("where am I?")
        return tuple(Blockage(somebody(motion), 0, distance) for motion, distance in blockages)

    def somebody(motion):
        return SimpleNamespace(motion=motion, standing=0.0 if motion is Motion.MOVING else 1.4, course=(0.0, 0.0))

    navigator = SimpleNamespace(server=SimpleNamespace(queries=SimpleNamespace(what_blocks=what_blocks)))
    mission = SimpleNamespace(navigator=navigator, path=path, path_to_follow=lambda: path)
    for node in tree.iterate():
        node.setup(mission=mission)
    return tree


@pytest.mark.parametrize(
    ("blockages", "chosen"),
    [
        ([(Motion.MOVING, 1.0)], 0),
        ([(Motion.WAITING, 2.9), (Motion.MOVING, 3.0)], 1),
        ([], 2),
        ([(Motion.MOVING, 3.1)], 2),
    ],
)
def test_the_child_runs_that_fits_how_the_first_object_on_the_path_moves(scripted, tick, blockages, chosen):
    children = [scripted("S"), scripted("S"), scripted("S")]
    tree = PickByMotion("who?", {Motion.MOVING: children[0], Motion.WAITING: children[1]}, children[2])
    assert tick(among(tree, *blockages)) == "S"
    assert [child.ticks for child in children] == [int(number == chosen) for number in range(3)]


def test_an_object_of_a_motion_without_a_child_is_left_to_whoever_plans(scripted, tick):
    tree = PickByMotion("who?", {Motion.MOVING: scripted("S")}, nobody := scripted("S"))
    assert tick(among(tree, (Motion.PARKED, 1.0))) == "F"
    assert nobody.ticks == 0


@pytest.mark.parametrize("unknown", [{"path": None}, {"lost": True}])
def test_nobody_is_in_the_way_where_the_map_cannot_say_it(scripted, tick, unknown):
    tree = PickByMotion("who?", {Motion.MOVING: scripted("F")}, scripted("S"))
    assert tick(among(tree, (Motion.MOVING, 1.0), **unknown)) == "S"


def test_what_was_tried_against_one_that_waits_is_remembered_while_others_pass(scripted, tick):
    waits = RoundRobin("yield", [wait := scripted("S"), give_way := scripted("S")])
    tree = PickByMotion("who?", {Motion.MOVING: scripted("S"), Motion.WAITING: waits}, scripted("S"))
    for motion in (Motion.WAITING, Motion.MOVING, Motion.WAITING):
        assert tick(among(tree, (motion, 1.0))) == "S"
    assert (wait.ticks, give_way.ticks) == (1, 1)


def test_who_stands_for_too_short_a_time_to_know_counts_as_moving(scripted, tick):
    for standing, chosen in ((1.4, "S"), (1.5, "F")):
        tree = PickByMotion("who?", {Motion.WAITING: scripted("S")}, scripted("S"), standing=standing)
        assert tick(among(tree, (Motion.WAITING, 1.0))) == chosen


def test_one_node_may_stand_for_several_motions_and_for_nobody(scripted, tick):
    tree = PickByMotion("who?", dict.fromkeys((Motion.WAITING, Motion.PARKED), plan := scripted("S")), nobody=plan)
    for blockages in ([(Motion.WAITING, 1.0)], [(Motion.PARKED, 1.0)], []):
        assert tick(among(tree, *blockages)) == "S"
    assert tick(among(tree, (Motion.MOVING, 1.0))) == "F"
    assert plan.ticks == 3


@pytest.mark.parametrize(
    ("along", "course", "standing", "chosen"),
    [
        (-1.0, (-0.2, 0.0), 1.5, "came"),
        (-0.5, (-0.1, 0.2), 1.5, "other"),
        (-0.5, (-0.1, 0.2), 6.0, "came"),
        (1.0, (0.2, 0.0), 9.9, "other"),
        (1.0, (0.2, 0.0), 10.0, "came"),
        (0.0, (0.0, 0.0), 6.0, "other"),
    ],
)
def test_who_waits_for_the_robot_has_a_child_of_its_own(scripted, tick, along, course, standing, chosen):
    """One that came along the path, or that was seen to move and stands too long to load, or to queue where it goes."""
    nodes = {name: scripted("S") for name in ("other", "came")}
    tree = PickByMotion("who?", {Motion.WAITING: nodes["other"]}, scripted("F"), nodes["came"])
    among(tree)
    waits = SimpleNamespace(motion=Motion.WAITING, standing=standing, course=course)
    tree.mission.navigator.server.queries.what_blocks = lambda path, margin: (Blockage(waits, 0, 1.0, along),)
    assert tick(tree) == "S"
    assert [name for name, node in nodes.items() if node.ticks] == [chosen]
