"""Fault table, row 8: commands after a cancel or after the end of a goal."""

from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Twist
from mbf_abstract.goals.goal_types import ExePathGoal, RecoveryGoal
from mbf_abstract.plugins import RecoveryResult
from mbf_abstract.testing.faulty import drive, slow
from mbf_abstract.testing.scripted_session import ScriptedSession
from promises import assert_next_goals_work, assert_stops


def test_a_command_computed_during_the_cancel_does_not_reach_the_robot():
    with ScriptedSession(cancel_grace=1.0) as session:
        session.controller.play(drive(), slow(session.clock, 0.4, drive(3.0)))
        handle = session.navigator.send(ExePathGoal(session.path_to(50.0)))
        session.clock.sleep(0.1)
        handle.cancel()
        handle.wait()
        session.clock.sleep(2.0)
        assert len(session.controller.requests) == 2
        assert all(command.vx < 3.0 for _, command in session.robot.commands)
        assert_stops(session, 0.1)
        assert_next_goals_work(session)


def test_a_recovery_that_keeps_its_motion_cannot_drive_after_its_end():
    kept = []

    def keep_motion(request):
        kept.append(request.motion)
        assert request.motion.send(Twist.planar(0.2))
        return RecoveryResult(0, "done")

    with ScriptedSession() as session:
        session.recovery.play(keep_motion)
        session.navigator.send(RecoveryGoal()).wait()
        end = session.clock.now()
        assert not kept[0].send(Twist.planar(0.7))
        assert not session.robot.moved_after(end)
        dropped = session.recorded(EventKind.COMMAND_DROPPED)
        assert [event.data["command"] for event in dropped] == [[0.7, 0.0, 0.0]]
        assert_next_goals_work(session)
