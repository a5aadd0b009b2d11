"""Fault table, row 31: clocks that stand still, and long pauses."""

from mbf_abstract.goals.goal_types import ExePathGoal
from mbf_abstract.testing.faulty import drive
from mbf_abstract.testing.scripted_session import ScriptedSession
from mbf_abstract.time.clock import WallClock
from mbf_abstract.time.sim_clock import SimClock
from promises import assert_ended_once, assert_stops


def test_the_clocks_never_run_backwards():
    clock, wall = SimClock(), WallClock()
    clock.sleep(1.0)
    clock.sleep_until(0.5)
    assert clock.now() == 1.0
    stamps = [wall.now() for _ in range(1000)]
    assert stamps == sorted(stamps)


def test_after_a_huge_pause_nothing_is_commanded_on_the_old_pose():
    """A laptop that sleeps: for an hour nothing runs, then everything is due at once."""
    with ScriptedSession(tf_timeout=0.5, controller_patience=2.0) as session:

        def sleep_for_an_hour(request):
            session.robot.publishes_pose = False
            session.clock.sleep(3600.0)
            return drive(3.0)

        session.controller.play(drive(), drive(), sleep_for_an_hour)
        handle = session.navigator.send(ExePathGoal(session.path_to(50.0)))
        result = handle.wait()
        assert not result.success
        session.clock.sleep(4000.0)
        assert_stops(session, 0.1)
        assert all(command.vx < 3.0 for _, command in session.robot.commands)
        assert_ended_once(session, handle)
