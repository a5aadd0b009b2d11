"""Fault table, row 35: a driver or a map's server that blocks while the robot drives, or takes no command."""

import threading

import pytest

from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.goals.goal_types import ExePathGoal, GetPathGoal, RecoveryGoal, RefinePathGoal
from mbf_abstract.outcomes import ExePathOutcome, RecoveryOutcome
from mbf_abstract.plugins import RecoveryResult
from mbf_abstract.testing.scripted_session import ScriptedSession
from mbf_abstract.time.clock import WallClock
from mbf_abstract.time.sim_clock import SimClock
from promises import assert_ended_once, assert_next_goals_work, assert_stops

PLACES = {
    "odometry": "the robot's odometry()",
    "map_problem": "the map's map_problem()",
    "send_command": "the robot's send_command()",
}


# Where the driver blocks, the controller is to hang in it: on a busy machine a watchdog of 0.2 s may be there first.
WATCHDOGS = {"odometry": 0.2, "map_problem": 0.2, "send_command": 10.0}


class ClockBlock:
    """Blocks its caller on the clock, so that simulated time goes on."""

    def __init__(self, clock):
        self._condition, self.on = clock.condition(), False

    def __call__(self):
        with self._condition:
            while self.on:
                self._condition.wait()

    def free(self):
        with self._condition:
            self.on = False
            self._condition.notify_all()


class BusyBlock:
    """Blocks its caller without the clock, so that only the wall-clock guard gets time going again."""

    def __init__(self, clock):
        self._event, self.on = threading.Event(), False

    def __call__(self):
        if self.on:
            self._event.wait()

    def free(self):
        self.on = False
        self._event.set()


class Site:
    """A session whose driver and map block in one place from ``block`` to ``free``."""

    def __init__(self, place, clock, make_block, **parameters):
        self.place, self.block_there = place, make_block(clock)
        parameters = {"cancel_grace": 0.3, "command_timeout": 0.2} | parameters
        self.session = ScriptedSession(clock=clock, robot=self, **parameters)
        self.session.server.map_problem = self.map_problem

    def _pass(self, place):
        if place == self.place and hasattr(self, "session"):
            self.block_there()

    def send_command(self, command):
        self._pass("send_command")
        self.session.robot.send_command(command)

    def odometry(self):
        self._pass("odometry")
        return self.session.robot.odometry() if hasattr(self, "session") else None

    def map_problem(self):
        self._pass("map_problem")
        return ""

    def block(self):
        self.block_there.on = True

    def free(self):
        self.block_there.free()


@pytest.fixture
def drive_into():
    """Drive on the given clock until a place blocks; the site and the goal's handle."""
    sites = []

    def drive(place, clock, make_block=ClockBlock, **parameters):
        site = Site(place, clock, make_block, **parameters)
        sites.append(site)
        handle = site.session.navigator.send(ExePathGoal(site.session.path_to(50.0)))
        clock.sleep(0.4)
        assert not site.session.robot.command.is_stopped()
        site.block()
        return site, handle

    yield drive
    for site in sites:
        site.free()
        site.session.close()


CLOCKS = [pytest.param(SimClock, ClockBlock, id="lockstep"), pytest.param(WallClock, BusyBlock, id="wall")]


@pytest.mark.parametrize(("clock", "make_block"), CLOCKS)
@pytest.mark.parametrize("place", PLACES)
def test_the_goal_ends_after_patience_and_grace_and_the_robot_was_stopped_long_before(
    drive_into, place, clock, make_block
):
    site, handle = drive_into(place, clock(), make_block, controller_patience=0.8, command_timeout=WATCHDOGS[place])
    session, blocked_at = site.session, site.session.clock.now()
    result = handle.wait(10.0)
    assert result.outcome == ExePathOutcome.PAT_EXCEEDED
    assert PLACES[place] in result.message
    assert session.clock.now() < blocked_at + 0.8 + 0.3 + 0.6  # the last figure is for a busy machine
    if place != "send_command":
        assert_stops(session, blocked_at)
    site.free()
    session.clock.sleep(0.5)
    assert session.robot.command.is_stopped()
    assert_ended_once(session, handle)
    assert not session.server.runtime.hanging
    assert_next_goals_work(session)


@pytest.mark.parametrize(("clock", "make_block"), CLOCKS)
@pytest.mark.parametrize("place", PLACES)
def test_a_cancel_ends_the_goal_after_the_grace(drive_into, place, clock, make_block):
    site, handle = drive_into(place, clock(), make_block, controller_patience=0.0, command_timeout=WATCHDOGS[place])
    site.session.clock.sleep(0.2)
    handle.cancel("enough")
    result = handle.wait(5.0)
    assert result.outcome == ExePathOutcome.CANCELED
    assert result.message == f"enough; {PLACES[place]} has not ended yet"


@pytest.mark.parametrize("place", PLACES)
def test_what_keeps_the_processor_busy_in_lockstep_is_found_by_the_wall_clock_guard(drive_into, place):
    site, handle = drive_into(place, SimClock(), BusyBlock, hang_guard=0.2)
    result = handle.wait()
    assert result.outcome == ExePathOutcome.PAT_EXCEEDED
    assert PLACES[place] in result.message
    site.free()
    site.session.clock.sleep(0.5)
    runtime = site.session.server.runtime
    while runtime.hanging or runtime.gate._writer.busy:
        site.session.clock.sleep(0.01)  # the late threads are on the real processor's time
    assert_next_goals_work(site.session)


@pytest.mark.parametrize("place", ["odometry", "map_problem"])
def test_the_controller_is_free_for_the_next_goal_while_driver_or_map_still_hang(drive_into, place):
    site, handle = drive_into(place, SimClock(), controller_patience=0.5)
    handle.wait()
    again = site.session.navigator.send(ExePathGoal(site.session.path_to(1.0))).wait()
    assert again.outcome == ExePathOutcome.PAT_EXCEEDED
    assert PLACES[place] in again.message  # the controller is not to blame
    assert len(site.session.server.runtime.hanging) == 2


def test_a_goal_whose_driver_hangs_from_an_earlier_one_says_so(drive_into):
    site, handle = drive_into("send_command", SimClock(), controller_patience=1.0)
    handle.wait()
    again = site.session.navigator.send(ExePathGoal(site.session.path_to(60.0))).wait()
    assert again.outcome == ExePathOutcome.PAT_EXCEEDED
    assert "the robot's send_command() has not returned from an earlier command" in again.message


def test_a_server_closes_although_its_driver_blocks(drive_into):
    site, _ = drive_into("send_command", WallClock(), BusyBlock)
    site.session.clock.sleep(0.1)
    began = site.session.clock.now()
    site.session.server.close()
    assert site.session.clock.now() < began + 2.0


@pytest.mark.parametrize("error", [OSError("unplugged"), SystemExit(1)], ids=repr)
def test_a_goal_none_of_whose_commands_arrives_ends_with_the_drivers_words(error):
    class Robot:
        def send_command(self, command):
            if command != Twist():
                raise error

        def odometry(self):
            return None

    with ScriptedSession(robot=Robot(), controller_patience=1.0) as session:
        handle = session.navigator.send(ExePathGoal(session.path_to(5.0)))
        result = handle.wait(5.0)
        assert result.outcome == ExePathOutcome.PAT_EXCEEDED
        assert f"send_command raised {type(error).__name__}: {error}" in result.message
        assert_ended_once(session, handle)


def test_retries_count_commands_that_do_not_arrive():
    class Robot:
        def send_command(self, command):
            raise OSError("unplugged")

        def odometry(self):
            return None

    with ScriptedSession(robot=Robot(), controller_max_retries=3) as session:
        result = session.navigator.send(ExePathGoal(session.path_to(5.0))).wait(5.0)
        assert result.outcome == ExePathOutcome.FAILURE
        assert "unplugged" in result.message


def test_a_map_that_raises_when_asked_counts_as_not_current():
    with ScriptedSession(controller_patience=0.5) as session:

        def map_problem():
            raise RuntimeError("no lock")

        session.server.map_problem = map_problem
        result = session.navigator.send(ExePathGoal(session.path_to(5.0))).wait()
        assert result.outcome == ExePathOutcome.MAP_ERROR
        assert result.message == "map_problem raised RuntimeError: no lock"


def test_a_recovery_whose_command_blocks_ends_too(drive_into):
    site = Site("send_command", SimClock(), ClockBlock, recovery_patience=0.8)
    session = site.session

    def back_up(request):
        request.motion.send(Twist.planar(-0.2))
        return RecoveryResult(RecoveryOutcome.SUCCESS, "backed up")

    session.recovery.play(back_up)
    site.block()
    result = session.navigator.send(RecoveryGoal()).wait(5.0)
    assert result.outcome == RecoveryOutcome.PAT_EXCEEDED
    site.free()
    session.clock.sleep(0.5)
    assert session.robot.command.is_stopped()
    session.close()


class BlockingKeeper:
    """What ``using_map`` gives: blocks at its start or at its end."""

    def __init__(self, block, place):
        self._block, self._place, self.depth = block, place, 0

    def __enter__(self):
        self.depth += 1
        if self._place == "start":
            self._block()

    def __exit__(self, *exc):
        self.depth -= 1
        if self._place == "end":
            self._block()


@pytest.mark.parametrize("place", ["start", "end"])
@pytest.mark.parametrize(
    "make_goal",
    [
        lambda session: GetPathGoal(Pose.planar(2.0, 0.0)),
        lambda session: ExePathGoal(session.path_to(1.0)),
        lambda session: RecoveryGoal(),
        lambda session: RefinePathGoal(session.path_to(1.0)),
    ],
    ids=["get_path", "exe_path", "recovery", "refine_path"],
)
def test_a_map_that_blocks_while_it_is_kept_alive_holds_no_goal_up(make_goal, place):
    patience = {"planner_patience": 1.0, "controller_patience": 1.0, "recovery_patience": 1.0}
    with ScriptedSession(cancel_grace=0.3, **patience) as session:
        block = ClockBlock(session.clock)
        block.on = True
        keeper = BlockingKeeper(block, place)
        using_map, session.server.using_map = session.server.using_map, lambda kind: keeper
        handle = session.navigator.send(make_goal(session))
        assert not handle.wait(10.0).success
        assert_ended_once(session, handle)
        block.free()
        session.clock.sleep(0.1)
        assert keeper.depth == 0 and not session.server.runtime.hanging
        session.server.using_map = using_map
        assert_next_goals_work(session)
