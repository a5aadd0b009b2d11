"""Fault table, row 15 in breadth: 10,000 seeded schedules of start, cancel, preempt, finish, pause and resume.

Each schedule draws its own interleaving of the threads (``SimClock(schedule=...)``) and its own order of client calls.
"""

import numpy as np
import pytest

from mbf_abstract.actions.goals import GetPathGoal, RecoveryGoal
from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.plugins import RecoveryResult
from mbf_abstract.sim_clock import SimClock
from mbf_abstract.testing.bench import Bench
from mbf_abstract.testing.faulty import slow
from mbf_abstract.testing.promises import assert_ended_once
from mbf_abstract.testing.scripted import ScriptedPlanner, ScriptedRecovery, straight_plan

SCHEDULES = 10_000
BLOCKS = 10
PLUGINS = {"planner": ScriptedPlanner, "recovery": ScriptedRecovery}
GOAL = Pose.planar(1.0, 0.0)


def back_up(request):
    request.motion.send(Twist.planar(-0.1))
    request.motion.sleep(0.01)
    return RecoveryResult(0, "backed up")


def run_schedule(seed):
    rng = np.random.default_rng(seed)
    with Bench(PLUGINS, clock=SimClock(schedule=rng)) as bench:
        bench.planner.play(straight_plan, slow(bench.clock, 0.01, straight_plan))
        bench.recovery.play(back_up)
        handles = []
        for _ in range(4):
            step = rng.integers(8) if handles else 0
            if step <= 2:
                handles.append(bench.navigator.send(GetPathGoal(GOAL, concurrency_slot=int(rng.integers(2)))))
            elif step == 3:
                handles.append(bench.navigator.send(RecoveryGoal()))
            elif step == 7:
                bench.clock.sleep(0.005 * int(rng.integers(3)))
            else:
                chosen = handles[rng.integers(len(handles))]
                (chosen.cancel, chosen.pause, chosen.resume)[step - 4]()
        for handle in handles:
            handle.resume()
        for handle in handles:
            handle.wait(10.0)
        for handle in handles:
            assert_ended_once(bench, handle)
        assert bench.robot.command.is_stopped()


@pytest.mark.parametrize("block", range(BLOCKS))
def test_no_goal_without_exactly_one_final_state(block):
    size = SCHEDULES // BLOCKS
    for seed in range(block * size, (block + 1) * size):
        run_schedule(seed)
