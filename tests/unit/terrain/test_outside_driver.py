"""A robot of a scenario that somebody outside drives: arrival, limits of time, lockstep and the verdict."""

import pytest

from mbf_abstract.config.findings import ConfigError
from mbf_abstract.geometry import Twist
from mbf_abstract.outcomes import MoveBaseOutcome
from mbf_abstract.time.clock import WallClock
from terrain.outside.driver import OutsideOptions, outside_executive
from terrain.provenance.rerun import rerun
from terrain.scenarios.scenario import PlanarPose, load_scenario
from terrain.session.runner import RunOptions, run_scenario

GOAL = 4.0  # m
AHEAD, STOP = Twist.planar(0.3), Twist()


class SteppedTime(WallClock):
    """Real time that passes by being waited for."""

    def __init__(self):
        self.time = 0.0

    def now(self):
        return self.time

    def sleep(self, seconds):
        self.time += max(seconds, 0.0)


class Stack:
    """Who drives: ``decide`` makes a command of the robot's x, or None; in lockstep only when it is waited for."""

    def __init__(self, session, wall, decide, only_if_waited_for=False):
        self._wall = wall
        self._session, self._decide, self._only_if_waited_for = session, decide, only_if_waited_for
        self.closed, self.waited_for, self.repeated = False, False, 0
        self.goals, self.commanded = [], []

    def publish(self):
        pass

    def repeat(self):
        self.repeated += 1

    def show_goal(self, goal):
        self.goals.append(goal)

    def wait(self, seconds):
        self.waited_for = self._decide(self._session.loop.true_pose.x) is not None
        if not self.waited_for:
            self._wall.sleep(seconds)
        return self.waited_for

    def take(self):
        command = self._decide(self._session.loop.true_pose.x) if self.goals else None
        if self._only_if_waited_for and self.commanded and not self.waited_for:
            return None
        self.waited_for = False
        if command is not None:
            self.commanded.append(self._session.simulation.time)
        return command

    def close(self):
        self.closed = True


@pytest.fixture
def corridor():
    """The shipped corridor without people and without physics, two metres of it."""
    scenario = load_scenario("crowded_corridor")
    changes = {"physics": "kinematic", "actors": (), "time_limit": 20.0}
    ends = {"start": PlanarPose(x=2.0, y=9.7), "goals": (PlanarPose(x=GOAL, y=9.7),)}
    return scenario.model_copy(update={**changes, **ends})


def driven(scenario, folder, decide, lockstep=False, patience=60.0):
    """Run a scenario that a stack drives, in real time that nobody waits for; returns the result and the stack."""
    stacks, wall = [], SteppedTime()

    def connect(session):
        stacks.append(Stack(session, wall, decide, lockstep))
        return stacks[0]

    options = OutsideOptions(connect, lockstep, patience, wall)
    result = run_scenario(
        scenario, RunOptions(folder, executive="test", outside=lambda one: outside_executive(one, options))
    )
    assert stacks[0].closed
    return result, stacks[0]


def to_the_goal(x):
    return AHEAD if x < GOAL - 0.05 else STOP


def test_a_run_succeeds_when_the_robot_stands_at_the_goal_that_was_shown(corridor, tmp_path):
    result, stack = driven(corridor, tmp_path, to_the_goal, lockstep=True, patience=1.0)  # less than it must stand
    assert result.success and result.verdict.outcome == MoveBaseOutcome.SUCCESS
    assert [goal.x for goal in stack.goals] == [GOAL]
    assert result.metrics["arrivals"][0]["distance_m"] < 0.15
    with pytest.raises(ConfigError, match="cannot be repeated"):
        rerun(tmp_path, RunOptions(tmp_path / "again"))


def test_in_lockstep_no_more_time_passes_between_two_commands_than_a_period_and_a_step(corridor, tmp_path):
    _, stack = driven(corridor, tmp_path, to_the_goal, lockstep=True)
    passed = [later - earlier for earlier, later in zip(stack.commanded, stack.commanded[1:], strict=False)]
    assert passed and all(time == pytest.approx(1 / 20 + 1 / 60, abs=1e-6) for time in passed)


def test_a_stack_that_falls_silent_in_lockstep_ends_the_run(corridor, tmp_path):
    result, stack = driven(corridor, tmp_path, lambda x: AHEAD if x < 2.5 else None, lockstep=True, patience=0.5)
    assert result.verdict.outcome == MoveBaseOutcome.FAILURE
    assert "no command to move has come for 0.5 s, and the robot is 1.4" in result.verdict.message
    assert stack.repeated > 0


def test_patience_begins_anew_with_each_goal(corridor, tmp_path):
    ends = tuple(PlanarPose(x=x, y=9.7) for x in (2.5, 3.0))
    scenario, looks = corridor.model_copy(update={"goals": ends}), []

    def hesitant(x):
        if x < 2.45:
            return AHEAD
        looks.append(x)  # 60 a second; it stands for 3 s at the first goal
        return AHEAD if len(looks) > 60 * 4.5 and x < 2.95 else STOP

    result, stack = driven(scenario, tmp_path, hesitant, patience=2.0)
    assert result.success and [goal.x for goal in stack.goals] == [2.5, 3.0]


def test_without_lockstep_a_robot_that_gets_no_more_commands_is_stopped_and_waits_until_the_time_limit(
    corridor, tmp_path
):
    scenario = corridor.model_copy(update={"time_limit": 2.0})
    result, _ = driven(scenario, tmp_path, lambda x: AHEAD if x < 2.1 else None)
    assert result.metrics["gate_stops"] == 1
    assert result.verdict.outcome == MoveBaseOutcome.CANCELED
    assert "time limit" in result.verdict.message


def test_a_run_of_others_has_failed_where_the_robot_touched_something(corridor, tmp_path):
    scenario = corridor.model_copy(update={"start": PlanarPose(x=2.0, y=9.7, yaw=1.5708), "time_limit": 7.0})
    result, _ = driven(scenario, tmp_path, lambda x: AHEAD, lockstep=True)
    assert result.verdict.outcome == MoveBaseOutcome.CANCELED
    assert any("contacts while the robot moved" in failure for failure in result.verdict.failures)
