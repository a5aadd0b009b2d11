"""Fault table, row 37: a plugin whose kernels are compiled at their first use, on a machine that is slow at it."""

import numpy as np
import pytest
from numba import njit

from mbf_abstract.compiling import kernel_cache
from mbf_abstract.compiling.compilation import record_compilations
from mbf_abstract.geometry import Pose
from mbf_abstract.goals.goal_types import ExePathGoal, GetPathGoal
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.testing.faulty import BusyHang, drive
from mbf_abstract.testing.scripted import straight_plan
from mbf_abstract.testing.scripted_session import ScriptedSession
from mbf_abstract.time.clock import WallClock
from mbf_abstract.time.sim_clock import SimClock
from promises import assert_ended_once, assert_stops

assert kernel_cache  # a map backend imports it with its kernels


def cold_kernel():
    """Make a kernel that takes well over a tenth of a second to compile, and nothing to run."""

    @njit
    def spread(values):
        for _ in range(3):
            values = np.sort(values[::-1]) + np.cumsum(values) * np.median(values)
        return values.sum()

    return lambda: spread(np.zeros(4))


CLOCKS = [
    pytest.param(lambda: SimClock(), {"hang_guard": 0.1}, id="lockstep"),
    pytest.param(
        lambda: WallClock(), {"planner_patience": 0.1, "controller_patience": 0.1, "cancel_grace": 0.05}, id="wall"
    ),
]


@pytest.mark.parametrize(("make_clock", "limits"), CLOCKS)
def test_the_compilers_time_counts_neither_for_the_planners_patience_nor_for_the_guard(make_clock, limits):
    with ScriptedSession(clock=make_clock(), **limits) as session, record_compilations(lambda name: None) as compiled:
        kernel = cold_kernel()

        def plan(request):
            kernel()
            return straight_plan(request)

        session.planner.play(plan)
        handle = session.navigator.send(GetPathGoal(Pose.planar(2.0, 0.0)))
        assert handle.wait(60.0).success, handle.result
        assert any(name.endswith("spread") for name in compiled.kernels)
        assert compiled.seconds > 0.1
        assert_ended_once(session, handle)


@pytest.mark.parametrize(("make_clock", "limits"), CLOCKS)
def test_a_controller_that_compiles_while_the_robot_drives_stops_it_and_drives_on(make_clock, limits):
    with ScriptedSession(clock=make_clock(), **limits) as session:
        kernel = cold_kernel()

        def compile_first(request):
            kernel()
            return session.controller.follow(request)

        session.controller.play(drive(0.2), compile_first)
        assert session.navigator.send(ExePathGoal(session.path_to(0.3))).wait(60.0).success


def test_a_hang_after_the_compilation_is_found_as_ever():
    with ScriptedSession(hang_guard=0.1) as session:
        kernel, hang = cold_kernel(), BusyHang()

        def compile_and_hang(request):
            kernel()
            hang(request)

        session.planner.play(compile_and_hang)
        began = session.clock.now()
        assert session.navigator.send(GetPathGoal(Pose.planar(2.0, 0.0))).wait().outcome == GetPathOutcome.PAT_EXCEEDED
        hang.release.cancel()
        assert_stops(session, began)


def test_a_cancel_during_the_compilation_ends_the_goal_after_the_grace():
    with ScriptedSession(clock=WallClock(), cancel_grace=0.0) as session:
        kernel = cold_kernel()
        compiling = []

        def plan(request):
            with record_compilations(compiling.append):
                kernel()
            return straight_plan(request)

        session.planner.play(plan)
        handle = session.navigator.send(GetPathGoal(Pose.planar(2.0, 0.0)))
        while not compiling:
            session.clock.sleep(0.001)
        handle.cancel("enough")
        assert handle.wait(10.0).outcome == GetPathOutcome.CANCELED
