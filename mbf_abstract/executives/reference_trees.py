"""Reference trees after the Move Base Flex paper (Figures 5, 6 and 7): navigation, and its parts planning and control.

- *planning*: plan; where that fails, run the next recovery of a list and plan again.
- *control*: follow the path while a second planner keeps updating it; where driving fails, run a recovery that fits the
  outcome code, then drive on along the **same** path. Only if that does not help does the tree fall back to planning.
- *navigation*: free the robot and the goal if they are blocked, then plan and drive. A robot that is stuck gets the
  server's ``escalation_behaviors``, one that meets others its ``right_of_way_behavior``; see ``executives.escalation``.

Use them as they are, or as a pattern: a tree is an expression of nodes. They need the behaviours named in
``TreeOptions`` to be loaded; a name of "" leaves the behaviour out.
"""

from __future__ import annotations

from collections.abc import Callable

from py_trees.behaviour import Behaviour
from py_trees.behaviours import Failure, Success
from py_trees.common import ParallelPolicy
from py_trees.composites import Parallel, Selector, Sequence

from mbf_abstract.executives.conditions import BEYOND_RECOVERY, Do, recovery_would_help
from mbf_abstract.executives.detours import TAKEN_PAUSE, Detour, UpdatePath
from mbf_abstract.executives.escalation import Escalation
from mbf_abstract.executives.leaves import ExePath, GetPath, Recovery
from mbf_abstract.executives.map_leaves import CheckPose, PathBlocked
from mbf_abstract.executives.mission import MissionContext
from mbf_abstract.executives.pacing import Delay, InBackground
from mbf_abstract.executives.recovering import InOrder, MemRec, OutcomeGuard, PickByOutcome, RecoveryNode, RoundRobin
from mbf_abstract.executives.trees.by_motion import MARGIN, EndDrive, PickByMotion, first_in_the_way
from mbf_abstract.executives.trees.giving_way import give_way
from mbf_abstract.executives.trees.long_way import IsLongWay, ShorterPath
from mbf_abstract.executives.trees.options import TreeOptions
from mbf_abstract.executives.trees.overtaking import IsHeldUp, Overtake
from mbf_abstract.executives.watchdogs import MotorWatchdog, OscillationWatchdog, ProgressWatchdog
from mbf_abstract.maps.tracking.objects import Motion
from mbf_abstract.outcomes import ExePathOutcome

BLOCKED = (ExePathOutcome.BLOCKED_PATH, ExePathOutcome.BLOCKED_GOAL, ExePathOutcome.NO_VALID_CMD)
OFF_THE_PATH = (ExePathOutcome.MISSED_PATH,)
PAST_THE_GOAL = (ExePathOutcome.MISSED_GOAL,)
IN_CONTACT = (ExePathOutcome.COLLISION, ExePathOutcome.ROBOT_STUCK)
SECOND_PLANNER_SLOT = 1
LOOK_PERIOD = 0.3
"""Time [s] between two looks at the path of a tree that asks who is on it."""
STANDING = 1.9
"""Who has been seen to stand for less than this [s] may be about to move, and maps may still predict that they do."""
CREEPING = 0.2
"""A robot slower than this [m/s] before somebody who stands is held up by them."""
NEAR = 1.2
"""Who stands is planned around from this distance [m] ahead on: a robot that has come up to them cannot turn."""


def navigation_tree(options: TreeOptions = TreeOptions()) -> Behaviour:
    """Make the whole tree (Figure 5): checks with recoveries, then plan, then drive, planning anew where needed."""
    steps = [planning_tree(options), _drive_or_plan_anew(options)]
    if options.check_poses:
        steps = [
            MemRec(
                "free the robot",
                CheckPose("robot stands free?", at_robot=True),
                _recoveries(options.clear, options.out_of_collision, options.escape),
            ),
            MemRec("free the goal", CheckPose("goal is free?"), _recoveries(options.clear)),
            *steps,
        ]
    return Escalation("navigation", Sequence("unless stuck", memory=True, children=steps))


def planning_tree(options: TreeOptions = TreeOptions(), name: str = "planning") -> Behaviour:
    """Make the planning tree (Figure 6): plan, with a memory list of recoveries."""
    recoveries = _recoveries(options.clear, options.relax_planner, options.escape, options.move_away)
    return MemRec(
        name, GetPath(planner=options.planner, refiner=options.refiner), recoveries, give_up_on=BEYOND_RECOVERY
    )


def control_tree(options: TreeOptions = TreeOptions()) -> Behaviour:
    """Make the control tree (Figure 7): follow and update the path, recover by outcome code, drive on."""
    return RecoveryNode("control", [_drive(options), _recovery(options)], options.control_retries)


def _drive_or_plan_anew(options: TreeOptions) -> Behaviour:
    """Fall back to planning where control gives up, or, without reuse of the path, after each recovery."""
    plan_anew = planning_tree(options, "plan anew")
    if options.reuse_path:
        return RecoveryNode("drive, else plan anew", [control_tree(options), plan_anew], options.replans)
    recovery = InOrder("recover and plan", [_recovery(options), plan_anew])
    drives = (options.control_retries + 1) * (options.replans + 1)
    return RecoveryNode("drive, else recover and plan", [_drive(options), recovery], drives - 1)


def _drive(options: TreeOptions) -> Behaviour:
    """Drive, watched, and with a second planner beside it."""
    follow = ExePath("follow path", options.controller)
    drive: Behaviour = follow
    if options.second_planner_pause > 0.0:
        looks = bool(options.wait) and options.second_planner_look_ahead > 0.0
        pause = LOOK_PERIOD if looks else options.second_planner_pause
        second = Delay(f"every {pause:g} s", _second_planner(options), pause)
        background = InBackground("in the background", second)
        policy = ParallelPolicy.SuccessOnSelected(children=[follow], synchronise=False)
        drive = Parallel("drive and update", policy, [follow, background])
    if options.progress_timeout > 0.0:
        drive = ProgressWatchdog("progress?", drive, options.progress_timeout)
    if options.oscillation_timeout > 0.0:
        drive = OscillationWatchdog("oscillation?", drive, options.oscillation_timeout)
    if options.motor_timeout > 0.0:
        drive = MotorWatchdog("motors?", drive, options.motor_timeout)
    return drive


def _second_planner(options: TreeOptions) -> Behaviour:
    planner = options.second_planner or options.planner
    update = UpdatePath("update path", planner, SECOND_PLANNER_SLOT, options.longest_update, options.refiner)
    if options.second_planner_look_ahead <= 0.0:
        return update
    if not options.wait:
        return _if_blocked(options, update)
    # Who comes or crosses is waited for: a path around where they are now would lead through where they go.
    around = _detour("update path", options, planner, SECOND_PLANNER_SLOT)
    comes_up = Do("robot comes up to it?", _comes_up_to_somebody)
    passing = _detour("pass it", options, planner, SECOND_PLANNER_SLOT)
    nearby = Sequence("near it", memory=True, children=[comes_up, passing])
    for_standing: dict[Motion, Behaviour] = {Motion.WAITING: nearby, Motion.PARKED: around}
    by_motion = PickByMotion("who blocks it?", for_standing, nobody=around, standing=STANDING)
    past = Overtake("path past it", planner, SECOND_PLANNER_SLOT, options.longest_update, options.refiner)
    overtake = Sequence("overtake", memory=True, children=[IsHeldUp(), past])
    shorter = ShorterPath("shorter path", planner, SECOND_PLANNER_SLOT, refiner=options.refiner, once=True)
    back = Sequence("back to the short way", memory=True, children=[IsLongWay(), shorter])
    nodes = [_if_blocked(options, by_motion), overtake, _beside(options, planner), back]
    return Selector("update", memory=True, children=nodes)


def _is_held(mission: MissionContext) -> bool:
    """Whether the robot creeps, or soon will, as its controller refuses."""
    return mission.robot_is_slower_than(CREEPING) or mission.controller_has_refused_within(LOOK_PERIOD)


def _comes_up_to_somebody(mission: MissionContext) -> bool:
    """Whether somebody holds the robot up, or is so near that it is about to brake for them."""
    return _is_held(mission) or first_in_the_way(mission, NEAR, MARGIN) is not None


def _if_blocked(options: TreeOptions, update: Behaviour) -> Behaviour:
    blocked = PathBlocked("path blocked?", options.second_planner_look_ahead)
    return Sequence("update a blocked path", memory=True, children=[blocked, update])


def _beside(options: TreeOptions, planner: str) -> Behaviour:
    """Where the robot creeps past somebody who stands: a path with more room, or the end of the drive."""
    creeps = Do("robot creeps?", _is_held)
    roomier = _detour("with more room", options, planner, SECOND_PLANNER_SLOT, once=True)
    known: dict[Motion, Behaviour] = {Motion.WAITING: roomier, Motion.PARKED: roomier}
    came: Behaviour | None = None
    if options.give_way:
        again = _detour("with more room for both", options, planner, SECOND_PLANNER_SLOT, once=True)
        came = Selector("go around or give way", memory=True, children=[again, EndDrive("drive is over?")])
    beside = PickByMotion("who is beside it?", known, Failure("nobody"), came, standing=STANDING)
    return Sequence("update a narrow path", memory=True, children=[creeps, beside])


def _detour(name: str, options: TreeOptions, planner: str, slot: int = 0, once: bool = False) -> Behaviour:
    """A detour; ``once``: a robot that creeps on one that was taken asks for no other one at this place."""
    pause = options.second_planner_pause or TreeOptions.second_planner_pause
    taken_pause = pause if once else TAKEN_PAUSE
    return Detour(name, planner, slot, options.longest_update, options.refiner, pause, taken_pause)


def _recovery(options: TreeOptions) -> Behaviour:
    o = options
    if not o.by_outcome:
        names = (o.clear, o.relax_planner, o.out_of_collision, o.relax_controller, o.move_away)
        return OutcomeGuard("any failure", _in_turn("fixed order", *names), recovery_would_help)
    guards = [
        OutcomeGuard("in contact", _in_turn("free", o.out_of_collision, o.move_away, o.clear), IN_CONTACT),
        OutcomeGuard("blocked", _unblock(options), BLOCKED),
        OutcomeGuard("past the goal", _plan_at_once(o, "plan back to it"), PAST_THE_GOAL),
        OutcomeGuard("off the path", _in_turn("loosen", o.relax_controller, o.clear), OFF_THE_PATH),
        OutcomeGuard("other", _in_turn("others", o.clear, o.relax_controller, o.move_away), recovery_would_help),
    ]
    return PickByOutcome("recover by outcome", guards)


def _plan_at_once(options: TreeOptions, name: str) -> Behaviour:
    """No recovery: the next thing is a plan. Every recovery that succeeds is followed by one, or one that fails is."""
    return Failure(name) if options.reuse_path else Success(name)


def _unblock(options: TreeOptions) -> Behaviour:
    """Clear, loosen and back up in turn; but where somebody is in the way, what fits how that one moves."""
    o = options
    usual = _in_turn("unblock", o.clear, o.relax_controller, o.out_of_collision)
    if not (o.wait and o.give_way):
        return usual
    usual = _in_turn("unblock", o.clear, o.relax_controller, o.out_of_collision, o.move_away)
    by_motion: dict[Motion, Behaviour] = {
        Motion.MOVING: Recovery(o.wait),
        Motion.WAITING: _patient("yield", o, 2),
    }
    if not o.reuse_path:  # every recovery that succeeds is followed by a plan; otherwise one that fails is
        by_motion[Motion.PARKED] = Success("plan around it at once")
    return PickByMotion("who is in the way?", by_motion, usual, _patient("yield at once", o, 0), standing=STANDING)


def _patient(name: str, options: TreeOptions, waits: int) -> Behaviour:
    """Around one that stands, else wait so often, then give way."""
    o = options
    nodes: list[Behaviour] = [Recovery(o.wait, f"wait {number + 1}") for number in range(waits)]
    if not o.reuse_path:  # every recovery that succeeds is followed by a plan
        return RoundRobin(name, [*nodes, Recovery(o.give_way)])
    return RoundRobin(name, [_detour("plan around it", o, o.planner), *nodes, give_way(o)])


def _in_turn(name: str, *behaviors: str) -> RoundRobin:
    return RoundRobin(name, _recoveries(*behaviors))


def _recoveries(*behaviors: str) -> list[Behaviour]:
    return [Recovery(behavior) for behavior in behaviors if behavior]


__all__ = ["REFERENCE_TREES", "TreeOptions", "control_tree", "navigation_tree", "planning_tree"]

REFERENCE_TREES: dict[str, Callable[..., Behaviour]] = {
    "control": control_tree,
    "navigation": navigation_tree,
    "planning": planning_tree,
}
