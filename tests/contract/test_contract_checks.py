"""The contract checks themselves: an honest plugin passes, and every kind of misbehaviour is found."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome, RecoveryOutcome, RefinePathOutcome
from mbf_abstract.plugins import ControlResult, PlanResult, RecoveryResult, RefineResult
from mbf_abstract.testing.contract import (
    ContractBroken,
    check_controller,
    check_planner,
    check_recovery,
    check_refiner,
)
from mbf_abstract.testing.scripted import (
    ScriptedController,
    ScriptedPlanner,
    ScriptedRecovery,
    ScriptedRefiner,
    straight_plan,
)

START, GOAL, WALLED = Pose.planar(0.0, 0.0), Pose.planar(3.0, 1.0), Pose.planar(99.0, 0.0)
PATH = Path.from_points([[0.1 * i, 0.02 * i, 0.0] for i in range(40)])
counter = itertools.count()


# ------------------------------------------------------------------------------------------------------------ planner
class HonestPlanner(ScriptedPlanner):
    map_array = np.zeros(10)

    def make_plan(self, request):
        if request.cancel_token.cancelled:
            return PlanResult(GetPathOutcome.CANCELED, "canceled")
        if request.goal == WALLED:
            return PlanResult(GetPathOutcome.NO_PATH_FOUND, "walled in")
        return self.plan(request)

    def plan(self, request):
        return straight_plan(request)


def check_a_planner(plan=HonestPlanner.plan, **members):
    planner_class = type("Planner", (HonestPlanner,), {"plan": plan, **members})
    check_planner(planner_class, [(START, GOAL)], unreachable=[(START, WALLED)], watched=[HonestPlanner.map_array])


def test_an_honest_planner_passes():
    check_a_planner()


def spoil_the_map(self, request):
    self.map_array[3] += 1.0
    return straight_plan(request)


def raise_error(self, *arguments):
    raise ValueError("boom")


def another_frame(self, request):
    return PlanResult(0, "", Path.from_points(straight_plan(request).path.positions, frame_id="odom"))


def random_detour(self, request):
    points = np.add(straight_plan(request).path.positions, 0.001 * next(counter))
    return PlanResult(0, "", Path.from_points(points))


def skip_the_via_poses(self, request):
    return straight_plan(replace(request, via=()))


@pytest.mark.parametrize(
    ("plan", "text"),
    [
        (skip_the_via_poses, "via (3, 1, 0) and back: the path passes the via pose at 3.16 m"),
        (raise_error, "raised ValueError: boom"),
        (lambda self, request: None, "returned NoneType, not PlanResult"),
        (lambda self, request: (0, "found"), "returned tuple, not PlanResult"),
        (lambda self, request: PlanResult(0, "found"), "no path"),
        (lambda self, request: PlanResult(-3, ""), "outcome -3 is not one of GetPathOutcome"),
        (lambda self, request: PlanResult(103, "no"), "outcome 103 is not one of GetPathOutcome"),
        (lambda self, request: PlanResult(56, ""), "failed with 56 but without a message"),
        (lambda self, request: PlanResult(0, "", straight_plan(request).path, float("nan")), "cost nan"),
        (lambda self, request: PlanResult(0, "", PATH), "from the goal"),
        (another_frame, "path in frame 'odom'"),
        (random_detour, "two instances with the same seed gave different answers"),
        (spoil_the_map, "changed an array it was only shown"),
    ],
)
def test_a_planner_that_breaks_the_contract_is_found(plan, text):
    with pytest.raises(ContractBroken, match="Planner breaks the plugin contract") as error:
        check_a_planner(plan)
    assert text in str(error.value)


@pytest.mark.parametrize(
    ("members", "text"),
    [
        ({"make_plan": lambda self, request: straight_plan(request)}, "outcome 0, expected CANCELED (51)"),
        ({"make_plan": lambda self, request: straight_plan(request)}, "claimed success"),
        ({"cancel": raise_error}, "cancel() while idle gave ValueError('boom')"),
        ({"cancel": lambda self: None}, "cancel() while idle gave None, not a bool"),
        ({"__init__": raise_error}, "construction: raised ValueError: boom"),
    ],
)
def test_a_planner_that_mishandles_a_cancel_or_its_construction_is_found(members, text):
    with pytest.raises(ContractBroken) as error:
        check_a_planner(**members)
    assert text in str(error.value)


def work(self, request):
    """Count for some ten milliseconds after a cancel, or after as long if none comes."""
    for _ in range(400):
        if request.cancel_token.cancelled:
            break
        sum(range(20_000))
    for _ in range(60):
        sum(range(20_000))
    return straight_plan(request)


def test_a_planner_that_works_on_after_a_cancel_is_found():
    planner_class = type("Planner", (HonestPlanner,), {"plan": work})
    with pytest.raises(ContractBroken, match="canceled while planning: returned"):
        check_planner(planner_class, [(START, GOAL)], cancel_within=0.001)


# --------------------------------------------------------------------------------------------------------- controller
def test_an_honest_controller_passes_also_if_it_stops_by_itself():
    check_controller(ScriptedController, PATH)

    class Smooth(ScriptedController):
        def __init__(self, context):
            super().__init__(context)
            self.stops_itself = True

    check_controller(Smooth, PATH)


class NeverStops(ScriptedController):
    def cancel(self):
        return True


class RemembersCancel(ScriptedController):
    canceled = False

    def cancel(self):
        self.canceled = True
        return False

    def compute_velocity_commands(self, request):
        if self.canceled:
            return ControlResult(ExePathOutcome.CANCELED, "canceled")
        return self.follow(request)


@pytest.mark.parametrize(
    ("controller_class", "members", "text"),
    [
        (ScriptedController, {"set_plan": lambda self, path: None}, "set_plan of a good path gave None"),
        (ScriptedController, {"set_plan": raise_error}, "set_plan of a good path: raised ValueError"),
        (ScriptedController, {"is_goal_reached": lambda self, *a: True}, "claims arrival at the start"),
        (ScriptedController, {"is_goal_reached": raise_error}, "is_goal_reached: raised ValueError"),
        (ScriptedController, {"follow": raise_error}, "driving: raised ValueError"),
        (ScriptedController, {"follow": lambda self, r: ControlResult(0, "")}, "success without a command"),
        (ScriptedController, {"follow": lambda self, r: ControlResult(56, "no")}, "outcome 56 is not one of ExePath"),
        (ScriptedController, {"follow": lambda self, r: ControlResult(0, "", Twist())}, "did not arrive in 60 s"),
        (
            ScriptedController,
            {"follow": lambda self, r: ControlResult(0, "", Twist.planar(1e-9 * next(counter)))},
            "two instances with the same seed gave different commands",
        ),
        (NeverStops, {}, "it has not returned CANCELED (101)"),
        (RemembersCancel, {}, "an idle cancel is remembered"),
        (RemembersCancel, {}, "set_plan does not end a cancel"),
    ],
)
def test_a_controller_that_breaks_the_contract_is_found(controller_class, members, text):
    with pytest.raises(ContractBroken) as error:
        check_controller(type("Controller", (controller_class,), members), PATH)
    assert text in str(error.value)


# ----------------------------------------------------------------------------------------------------------- recovery
class BackUp(ScriptedRecovery):
    """Drives back for a second and stops, as an honest behaviour does."""

    def run_behavior(self, request):
        for _ in range(20):
            if request.cancel_token.cancelled or not request.motion.send(Twist.planar(-0.2)):
                break
            request.motion.sleep(0.05)
        request.motion.send(Twist())
        if request.cancel_token.cancelled:
            return RecoveryResult(RecoveryOutcome.CANCELED, "canceled")
        return RecoveryResult(0, "backed up")


def drive_off(self, request):
    request.motion.send(Twist.planar(0.3))
    return RecoveryResult(0, "whatever")


def ignore_cancel(self, request):
    for _ in range(20):
        self.clock.sleep(0.1)
    return RecoveryResult(0, "done")


def need_the_pose(self, request):
    request.motion.pose()
    return RecoveryResult(0, "done")


def never_end(self, request):
    while request.motion.sleep(1.0):
        pass
    return RecoveryResult(RecoveryOutcome.CANCELED, "canceled")


def test_an_honest_recovery_passes():
    check_recovery(BackUp)
    check_recovery(ScriptedRecovery)


@pytest.mark.parametrize(
    ("run_behavior", "text"),
    [
        (raise_error, "a whole run: raised ValueError"),
        (drive_off, "left the robot driving with"),
        (drive_off, "canceled before: sent"),
        (ignore_cancel, "canceled midway: ended"),
        (need_the_pose, "with the robot lost: raised RobotStateError"),
        (never_end, "a whole run: not over after 120 s"),
        (lambda self, r: RecoveryResult(99, "no"), "outcome 99 is not one of RecoveryOutcome"),
        (lambda self, r: RecoveryResult(next(counter) % 10, "done"), "did different things"),
    ],
)
def test_a_recovery_that_breaks_the_contract_is_found(run_behavior, text):
    with pytest.raises(ContractBroken) as error:
        check_recovery(type("Recovery", (BackUp,), {"run_behavior": run_behavior}))
    assert text in str(error.value)


# ------------------------------------------------------------------------------------------------------------ refiner
class Polite(ScriptedRefiner):
    def apply_refinement(self, path, cancel_token):
        if cancel_token.cancelled:
            return RefineResult(RefinePathOutcome.CANCELED, "canceled")
        return self.refine(path)

    def refine(self, path):
        return RefineResult(0, "", Path.from_points(path.positions[[0, -1]]))


def test_an_honest_refiner_passes():
    check_refiner(Polite, PATH)


@pytest.mark.parametrize(
    ("members", "text"),
    [
        ({"refine": raise_error}, "a whole path: raised ValueError"),
        ({"refine": lambda self, path: RefineResult(0, "")}, "no refined path"),
        ({"refine": lambda self, path: RefineResult(0, "", path[:3])}, "m from the goal"),
        ({"refine": lambda self, path: RefineResult(0, "", Path(path.positions, frame_id="x"))}, "in frame 'x'"),
        ({"refine": lambda self, path: RefineResult(0, "", Path(path.positions + 1e-9 * next(counter)))}, "different"),
        ({"apply_refinement": lambda self, path, token: self.refine(path)}, "expected CANCELED (202)"),
    ],
)
def test_a_refiner_that_breaks_the_contract_is_found(members, text):
    with pytest.raises(ContractBroken) as error:
        check_refiner(type("Refiner", (Polite,), members), PATH)
    assert text in str(error.value)
