"""A cancel at every step of a goal: it ends CANCELED with the client's reason, and the robot stands."""

from __future__ import annotations

from typing import Any

from mbf_abstract.goals.goal_types import ExePathGoal, GetPathGoal, MoveBaseGoal, RecoveryGoal
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome, MoveBaseOutcome, RecoveryOutcome
from mbf_abstract.plugins import PluginKind
from mbf_abstract.testing.conformance.planning import CAGE
from mbf_abstract.testing.conformance.site import Site, situation, somewhere

REASON = "the operator has changed his mind"


def _cancel(site: Site, handle: Any, outcome: int) -> None:
    """Cancel a goal and expect its end within a second, and a robot that stands."""
    handle.cancel(REASON)
    try:
        site.expect_outcome(handle.wait(1.5), outcome, REASON)
    except TimeoutError as error:
        site.expect(False, f"after the cancel: {error}")
        return
    site.expect_stands(0.5, "canceled")


def _slow_planner(site: Site) -> None:
    """Let every plan take a second of simulated time."""
    site.server.plugins.all_of(PluginKind.PLANNER)[0].instance.modelled_compute_time = 1.0


@situation()
def a_cancel_before_the_start(site: Site) -> None:
    """A goal that is canceled before it has begun ends CANCELED, and the robot never moves."""
    _cancel(site, site.navigator.send(MoveBaseGoal(somewhere(6.0, 4.0))), MoveBaseOutcome.CANCELED)
    _cancel(site, site.navigator.send(ExePathGoal(site.path((2.0, 4.0), (5.0, 4.0)))), ExePathOutcome.CANCELED)
    site.expect_near(2.0, 4.0, 0.05, "canceled before the start")


@situation()
def a_cancel_while_planning(site: Site) -> None:
    """A goal that is canceled while its planner works ends CANCELED, and the robot never moves."""
    _slow_planner(site)
    for goal, outcome in (
        (GetPathGoal(somewhere(6.0, 4.0)), GetPathOutcome.CANCELED),
        (MoveBaseGoal(somewhere(6.0, 4.0)), MoveBaseOutcome.CANCELED),
    ):
        handle = site.navigator.send(goal)
        site.rig.clock.sleep(0.5)
        _cancel(site, handle, outcome)
    site.expect_near(2.0, 4.0, 0.05, "canceled while planning")


@situation()
def a_cancel_while_driving(site: Site) -> None:
    """A goal that is canceled while the robot drives ends CANCELED, and the robot stands at once."""
    for goal, outcome in (
        (ExePathGoal(site.path((2.0, 4.0), (8.0, 4.0))), ExePathOutcome.CANCELED),
        (MoveBaseGoal(somewhere(8.0, 4.0)), MoveBaseOutcome.CANCELED),
    ):
        handle = site.navigator.send(goal)
        site.expect_moves(1.5, "before the cancel")
        _cancel(site, handle, outcome)


@situation()
def a_cancel_while_recovering(site: Site) -> None:
    """A recovery that is canceled ends CANCELED, and the robot stands at once."""
    for behavior in ("wait", "rotate", "back_up"):
        handle = site.navigator.send(RecoveryGoal(behavior))
        site.rig.clock.sleep(0.5)
        _cancel(site, handle, RecoveryOutcome.CANCELED)


@situation()
def a_cancel_while_move_base_recovers(site: Site) -> None:
    """move_base that is canceled during a recovery ends CANCELED."""
    site.place(*CAGE)
    handle = site.navigator.send(MoveBaseGoal(somewhere(8.0, 4.0), recovery_behaviors=("wait",)))
    site.rig.clock.sleep(1.0)
    site.expect(not handle.done, "move_base did not recover from a goal that it cannot reach")
    _cancel(site, handle, MoveBaseOutcome.CANCELED)


@situation()
def a_cancel_while_waiting(site: Site) -> None:
    """A goal that is canceled while another one uses its plugin ends CANCELED, and the other one goes on."""
    _slow_planner(site)
    first = site.navigator.send(GetPathGoal(somewhere(6.0, 4.0)))
    second = site.navigator.send(GetPathGoal(somewhere(7.0, 4.0), concurrency_slot=1))
    site.rig.clock.sleep(0.2)
    second.cancel(REASON)
    site.expect_outcome(second.wait(1.5), GetPathOutcome.CANCELED, REASON)
    site.expect_outcome(first.wait(3.0), GetPathOutcome.SUCCESS)
