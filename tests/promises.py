"""The promises of the framework as checks: stop (P1), end (P2), stay (P3)."""

from __future__ import annotations

from mbf_abstract.events import EventKind
from mbf_abstract.goals.goal_types import ExePathGoal
from mbf_abstract.goals.handle import AnyGoalHandle
from mbf_abstract.testing.scripted import Scripted, straight_plan
from mbf_abstract.testing.scripted_session import ScriptedSession


def assert_stops(session: ScriptedSession, fault_time: float) -> None:
    """P1: from ``command_timeout`` plus one period after the fault on, the robot receives zero only.

    Parameters
    ----------
    session : ScriptedSession
    fault_time : float
        When the fault happened [s].
    """
    parameters = session.server.runtime.parameters
    limit = fault_time + parameters.command_timeout + 1.0 / parameters.controller_frequency
    late = session.robot.moved_after(limit)
    assert not late, f"commands after the fault at {fault_time:.3f} s: {late[:3]}"
    assert session.robot.command.is_stopped(), f"the robot still does {session.robot.command}"


def assert_ended_once(session: ScriptedSession, handle: AnyGoalHandle) -> None:
    """P2: the goal has exactly one final state, with an outcome and a text."""
    ends = [event for event in session.recorded(EventKind.GOAL_FINISHED) if event.data["goal_id"] == handle.id]
    assert len(ends) == 1, f"goal {handle.id} ended {len(ends)} times"
    assert handle.done
    assert handle.result is not None
    assert handle.result.message


def assert_next_goals_work(session: ScriptedSession) -> None:
    """P3: the scripted plugins, reset to their defaults, serve the next get_path and exe_path goals."""
    for plugin, answer in ((session.planner, straight_plan), (session.controller, session.controller.follow)):
        assert isinstance(plugin, Scripted)
        plugin.play(answer)
    here = session.robot.pose
    goal = session.path_to(here.x + 0.5, here.y)
    plan = session.navigator.get_path(goal[-1])
    assert plan.success, plan.message
    driven = session.navigator.send(ExePathGoal(goal)).wait()
    assert driven.success, driven.message
