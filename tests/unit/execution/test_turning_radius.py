"""A car's tightest curve: given by its driver once, enforced by the gate and known to every plugin."""

import pytest

from mbf_abstract.geometry import Twist
from mbf_abstract.testing.scripted import ScriptedController, ScriptedPlanner
from mbf_abstract.testing.scripted_session import ScriptedSession


class Car:
    """A driver that keeps its commands."""

    min_turning_radius = 1.5

    def __init__(self):
        self.sent = []

    def send_command(self, command):
        self.sent.append(command)

    def odometry(self):
        return None


class Spinner(ScriptedController):
    turns_on_the_spot = True


@pytest.mark.parametrize(("given", "radius"), [({}, 1.5), ({"min_turning_radius": 3.0}, 3.0)])
def test_the_gate_widens_curves_to_the_limit_of_the_driver_or_the_configuration(given, radius):
    with ScriptedSession(robot=Car(), **given) as session:
        assert session.server.runtime.gate.limits.apply(Twist.planar(1.0, wz=2.0)) == Twist.planar(1.0, wz=1.0 / radius)
        assert session.planner.min_turning_radius == session.controller.min_turning_radius == radius
        session.server.set_parameters(max_vel_x=0.5)
        assert session.server.runtime.gate.limits.min_turning_radius == radius


def test_a_configured_zero_lets_a_car_turn_on_the_spot():
    with ScriptedSession(robot=Car(), min_turning_radius=0.0) as session:
        assert session.server.runtime.gate.limits.apply(Twist.planar(wz=1.0)) == Twist.planar(wz=1.0)


def test_a_controller_that_turns_on_the_spot_is_reported_for_a_car_only():
    plugins = {"planner": ScriptedPlanner, "spinner": Spinner}
    with ScriptedSession(plugins, robot=Car()) as session:
        reported = "controller 'spinner' turns on the spot, which the robot cannot: its tightest curve is 1.50 m"
        assert session.server.notes == (reported,)
    with ScriptedSession(plugins) as session:
        assert session.server.notes == ()
