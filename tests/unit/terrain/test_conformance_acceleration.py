"""Facts about limited accelerations that the tests of Nav2's velocity smoother publish; the number is in the id.

Nav2 limits speeding up and slowing down apart, in a node of its own. Here it is the robot's model that is limited,
by one acceleration for both, so what upstream expects of braking holds for ours with the limit of speeding up.
"""

from dataclasses import replace

import pytest

from mbf_abstract.geometry import Pose, Twist
from terrain.physics.kinematic_robot import KinematicRobot
from terrain.physics.kinematic_world import KinematicWorld
from terrain.physics.robot_models import HUSKY

PERIOD = 0.05  # s; 20 Hz


def after_one_period(speed: float, wanted: float, acceleration: float) -> float:
    """Speed [m/s] a period after a robot that drives at ``speed`` was sent ``wanted``."""
    spec = replace(HUSKY, max_speed=2.0, max_acceleration=1e6)
    robot = KinematicRobot(KinematicWorld(), spec, Pose.planar(0.0, 0.0), command_timeout=1e9)
    robot.send_command(Twist.planar(speed))
    robot.advance(PERIOD)
    robot.spec = replace(spec, max_acceleration=acceleration)
    robot.send_command(Twist.planar(wanted))
    robot.advance(PERIOD)
    return robot.velocity().vx


@pytest.mark.parametrize(
    ("speed", "wanted"),
    [
        pytest.param(0.5, 0.504, id="F139-faster"),
        pytest.param(0.5, 0.496, id="F139-slower"),
        pytest.param(-0.002, 0.002, id="F139-reversing"),
        pytest.param(0.5, 0.5, id="F139-same"),
    ],
)
def test_a_change_within_the_limit_is_made_at_once(speed: float, wanted: float) -> None:
    assert after_one_period(speed, wanted, 0.1) == pytest.approx(wanted)


@pytest.mark.parametrize(
    ("speed", "wanted"),
    [
        pytest.param(0.5, 1.5, id="F140-forward"),
        pytest.param(0.0, 1.0, id="F140-from-rest"),
        pytest.param(-0.5, -1.5, id="F140-backward"),
        pytest.param(0.0, -1.0, id="F140-from-rest-backward"),
        pytest.param(1.5, 0.5, id="F141-forward"),
        pytest.param(1.0, 0.0, id="F141-to-rest"),
        pytest.param(-1.5, -0.5, id="F141-backward"),
        pytest.param(-1.0, 0.0, id="F141-to-rest-backward"),
        pytest.param(-0.2, 0.8, id="F142-to-forward"),
        pytest.param(0.2, -0.8, id="F142-to-backward"),
    ],
)
def test_of_a_change_beyond_the_limit_one_period_makes_the_limits_share(speed: float, wanted: float) -> None:
    made = after_one_period(speed, wanted, 0.1) - speed
    assert made / (wanted - speed) == pytest.approx(0.005, rel=1e-6)


@pytest.mark.parametrize(
    ("speed", "wanted", "expected"),
    [
        pytest.param(1.0, 1.0, 1.0, id="F143-same"),
        pytest.param(0.5, 0.55, 0.55, id="F143-faster"),
        pytest.param(0.5, 0.45, 0.45, id="F143-slower"),
        pytest.param(1.0, 2.0, 1.075, id="F143-limited"),
    ],
)
def test_the_speed_after_one_period(speed: float, wanted: float, expected: float) -> None:
    assert after_one_period(speed, wanted, 1.5) == pytest.approx(expected)
