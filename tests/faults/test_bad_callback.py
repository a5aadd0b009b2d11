"""Fault table, row 20: callbacks of the user that raise or block."""

from mbf_abstract.actions.goals import ExePathGoal, GetPathGoal
from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Pose
from mbf_abstract.testing.bench import Bench
from mbf_abstract.testing.faulty import Hang


def test_a_raising_callback_harms_neither_the_goal_nor_the_others():
    def bad(*arguments):
        raise RuntimeError("user code")

    with Bench() as bench:
        seen = []
        handle = bench.navigator.send(ExePathGoal(bench.path_to(1.0)))
        handle.add_feedback_callback(bad)
        handle.add_feedback_callback(seen.append)
        handle.add_done_callback(bad)
        assert handle.wait().success
        bench.clock.sleep(0.1)
        faults = [event for event in bench.events(EventKind.FAULT) if "user callback raised" in event.data["message"]]
        assert len(faults) > 10
        assert len(seen) > 10


def test_a_blocking_callback_is_left_alone_and_the_others_are_served():
    with Bench() as bench:
        hang, seen = Hang(bench.clock), []
        handle = bench.navigator.send(ExePathGoal(bench.path_to(5.0)))
        handle.add_feedback_callback(seen.append)
        first = bench.navigator.send(GetPathGoal(Pose.planar(1.0, 0.0)))
        first.add_done_callback(hang)
        bench.clock.sleep(4.0)
        assert hang.entered == 1
        served_before = len(seen)
        assert handle.wait().success
        bench.clock.sleep(6.0)
        assert len(seen) > served_before
        assert any("blocked" in event.data["message"] for event in bench.events(EventKind.FAULT))
        hang.release()


def test_the_queue_of_callbacks_is_bounded():
    with Bench() as bench:
        hang = Hang(bench.clock)
        handle = bench.navigator.send(GetPathGoal(Pose.planar(1.0, 0.0)))
        handle.add_done_callback(hang)
        handle.wait()
        bench.clock.sleep(0.1)
        for _ in range(1500):
            handle.add_done_callback(lambda handle: None)
        lost = [event for event in bench.events(EventKind.FAULT) if "oldest lost" in event.data["message"]]
        assert (hang.entered, len(lost)) == (1, 500)
        hang.release()
