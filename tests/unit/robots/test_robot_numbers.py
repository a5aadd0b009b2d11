"""What is found in a URDF: numbers of robots made by hand, of those that ship, and of some that others made."""

import math
import re

import numpy as np
import pytest

from mbf_abstract.config.findings import ConfigError
from terrain.description.describe import describe
from terrain.description.motors import holds_on
from terrain.description.outline import footprint_radii
from terrain.description.parameters import UrdfRobot
from terrain.description.placeholders import robot_values
from terrain.physics.robot_models import CAR, HUSKY, TURTLEBOT
from tests.unit.robots.conftest import (
    BODY,
    CYLINDER,
    FIXED_AXLE,
    FOUR_WHEELS,
    KIWI,
    SHIPPED,
    joint,
    link,
    package_file,
    robot,
    steered,
    wheel,
)

BALL = '<geometry><sphere radius="0.05"/></geometry>'
RIGHT_ANGLE = math.pi / 2


def test_a_box_on_four_wheels_has_the_numbers_of_its_drawing(described):
    """Wheels of radius 0.2 m at 0.6 x 0.7 m; a box of 1 x 0.4 x 0.2 m whose underside is at the wheels' axles."""
    found = described(robot(BODY, *FOUR_WHEELS))
    assert found.drive == "skid"
    assert (found.wheelbase, found.track, found.wheel_radius) == (0.6, 0.7, 0.2)
    assert (found.height, found.ground_clearance, found.mass) == (0.4, 0.2, 10.0)
    assert found.center_of_mass == (0.0, 0.0, pytest.approx((6.0 * 0.4 + 4.0 * 0.2) / 10.0))
    assert found.footprint == [(-0.5, -0.4), (0.5, -0.4), (0.5, 0.4), (-0.5, 0.4)]


def test_slopes_at_which_a_box_on_wheels_tips_over_are_those_of_its_drawing(described):
    found = described(robot(BODY, *FOUR_WHEELS)).tipping
    assert found.forward == found.backward == pytest.approx(math.atan(0.3 / 0.32))
    assert found.left == found.right == pytest.approx(math.atan(0.35 / 0.32))
    assert found.least == found.forward


def test_a_body_longer_than_its_wheels_limits_the_ramp_before_it(described):
    """Its lower edge is at (0.5, 0.2): 0.2 m ahead of an axle at that height, which a line touching the wheel passes
    at the angle whose cosine is -1 less a right angle, so a right angle; lower it and the angle falls."""
    low = BODY.replace('xyz="0 0 0.1"', 'xyz="0 0 0.0"')
    found = described(robot(low, *FOUR_WHEELS)).edges
    for_hand = math.acos(-0.2 / math.hypot(0.2, -0.1)) - math.atan2(0.2, -0.1)
    assert found.approach == found.departure == pytest.approx(for_hand)


def test_a_flat_belly_limits_the_crest_in_its_middle(described):
    found = described(robot(BODY, *FOUR_WHEELS)).edges
    from_one_axle = math.acos(-0.2 / 0.3) - RIGHT_ANGLE  # of a point 0.3 m away at the height of the axle
    assert found.breakover == pytest.approx(2.0 * from_one_axle)


def test_an_axis_that_points_to_the_right_makes_the_same_wheel(described):
    left = described(robot(BODY, *FOUR_WHEELS))
    right = described(robot(BODY, *[part.replace('axis xyz="0 1 0"', 'axis xyz="0 -1 0"') for part in FOUR_WHEELS]))
    assert (left.wheelbase, left.track, left.drive) == (right.wheelbase, right.track, right.drive)
    assert all(wheel.axis[1] > 0.0 for wheel in right.gear.wheels)


def test_two_wheels_and_a_ball_are_a_differential_drive(described):
    ball = link("ball", 0.1, BALL) + joint("ball_mount", "body", "ball", "-0.3 0 -0.15", "fixed")
    found = described(robot(BODY, ball, wheel("l", "body", "0.1 0.3 0"), wheel("r", "body", "0.1 -0.3 0")))
    assert (found.drive, found.wheelbase) == ("differential", 0.0)
    assert [support.name for support in found.gear.supports] == ["ball"]
    assert found.p_root_base.tolist() == [0.1, 0.0, -0.2]
    assert sorted(map(tuple, np.round(found.contacts, 6).tolist())) == [(-0.4, 0.0), (0.0, -0.3), (0.0, 0.3)]


def test_a_wheel_that_trails_behind_a_free_upright_axis_is_a_caster(described):
    swivel = link("fork", 0.1) + joint("swivel", "body", "fork", "-0.4 0 0", axis="0 0 1")
    caster = link("caster", 0.1, CYLINDER.format(r=0.08)) + joint("roll", "fork", "caster", "-0.05 0 -0.12")
    found = described(robot(BODY, swivel, caster, wheel("l", "body", "0 0.3 0"), wheel("r", "body", "0 -0.3 0")))
    assert found.drive == "differential"
    assert [support.name for support in found.gear.supports] == ["roll"]


def car():
    """The box with front wheels that turn by 0.6 rad."""
    limits = '<limit lower="-0.6" upper="0.6" effort="1" velocity="1"/>'
    hinges = [
        link(f"{side}_hinge")
        + joint(f"{side}_steer", "body", f"{side}_hinge", f"0.3 {y} 0", "revolute", "0 0 1", limits)
        for side, y in (("left", 0.35), ("right", -0.35))
    ]
    front = [wheel(f"front_{side}", f"{side}_hinge", "0 0 0") for side in ("left", "right")]
    return robot(BODY, *hinges, *front, *FOUR_WHEELS[2:])


def test_the_footprint_of_a_car_holds_its_wheels_however_they_are_steered(described):
    """A wheel of radius 0.2 m that is 0.1 m wide: its corner is 0.2 m ahead of, and 0.05 m beside, its hinge."""
    found = described(car())
    aside = max(y for _, y in found.footprint)
    assert aside == pytest.approx(0.35 + 0.05 * math.cos(0.6) + 0.2 * math.sin(0.6), abs=1e-3)
    assert max(y for x, y in found.footprint if x < 0.1) == pytest.approx(0.4, abs=1e-3)
    less = described(car(), max_steering_angle=0.1)
    assert 0.4 < max(y for _, y in less.footprint) < 0.43
    assert described(robot(BODY, *FOUR_WHEELS)).footprint[0][1] == pytest.approx(-0.4)


def test_the_inner_wheel_of_a_car_limits_its_circle(described):
    """Wheels that turn by 0.6 rad: the circle of the rear axle's middle has radius L cot(0.6) + T / 2."""
    found = described(car())
    assert found.drive == "ackermann"
    assert found.p_root_base[0] == -0.3
    assert found.min_turning_radius == pytest.approx(0.6 / math.tan(0.6) + 0.35, abs=1e-5)


def test_motors_limits_of_the_file_become_speed_and_torque(described):
    limits = '<limit effort="7" velocity="4"/>'
    wheels = [part.replace("<axis", f"{limits}<axis") for part in FOUR_WHEELS]
    found = described(robot(BODY, *wheels))
    assert (found.max_speed, found.motor_torque) == (pytest.approx(0.8), 7.0)
    assert not any("assumed" in note for note in found.notes)


def test_a_limit_of_zero_is_no_limit_and_that_is_said(described):
    wheels = [part.replace("<axis", '<limit effort="0" velocity="0"/><axis') for part in FOUR_WHEELS]
    found = described(robot(BODY, *wheels))
    assert found.max_speed == 1.0 and found.motor_torque > 0.0
    for name in ("velocity", "effort"):
        assert any(note.startswith(f"{name}: a limit of 0") for note in found.notes)


@pytest.mark.parametrize(("torque", "held"), [(1.0, 0.2), (3.0, None)])
def test_motors_too_weak_for_the_slopes_of_the_plans_are_noted(described, torque, held):
    """Four wheels of 0.2 m pull 4 torque / 0.2; the slope is that of which gravity pulls as much."""
    found = described(robot(BODY, *FOUR_WHEELS), motor_torque=torque, mass=10.0)
    notes = [note for note in found.notes if "motors hold" in note]
    assert found.wheel_radius == 0.2 and (len(notes) == 1) == (held is not None)
    if held is not None:
        assert holds_on(found) == pytest.approx(math.asin(4.0 * torque / 0.2 / (10.0 * 9.81)))
        assert "up to 12 degrees (1 N m on each of 4 wheels of 0.2 m, 10 kg)" in notes[0] and "26 degrees" in notes[0]
    assert not any("motors hold" in note for note in described(robot(BODY, *FOUR_WHEELS), max_slope=0.1).notes)


@pytest.mark.parametrize("radius", [0.12, 0.25])
def test_the_ground_is_a_stated_radius_below_the_wheels(described, radius):
    ball = link("ball", 0.1, BALL) + joint("ball_mount", "body", "ball", "-0.3 0 -0.15", "fixed")
    text = robot(BODY, ball, wheel("l", "body", "0.1 0.3 0"), wheel("r", "body", "0.1 -0.3 0"))
    found = described(text, wheel_radius=radius)
    assert found.p_root_base.tolist() == [0.1, 0.0, -radius]
    assert (found.wheel_radius, found.height, found.ground_clearance) == (radius, 0.2 + radius, radius)
    assert [support.name for support in found.gear.supports] == ["ball"]


def test_what_is_assumed_is_said(described):
    notes = described(robot(BODY, *FOUR_WHEELS)).notes
    assert any("max_speed: 1 m/s is assumed" in note for note in notes)
    assert any("motor_torque" in note for note in notes)


def test_what_is_stated_goes_before_what_is_found(described):
    stated = {
        "drive": "tracked",
        "footprint": ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0)),
        "height": 2.0,
        "mass": 99.0,
        "center_of_mass": (0.1, 0.0, 0.5),
        "wheel_radius": 0.3,
        "wheelbase": 0.5,
        "track": 0.6,
        "track_multiplier": 2.0,
        "ground_clearance": 0.05,
        "max_speed": 3.0,
        "max_yaw_rate": 0.7,
        "motor_torque": 12.0,
    }
    found = described(robot(BODY, *FOUR_WHEELS), **stated)
    assert {key: getattr(found, key) if key != "footprint" else tuple(found.footprint) for key in stated} == stated


def test_shapes_above_the_heights_of_the_footprint_do_not_count(described):
    wing = link("wing", 0.1, '<geometry><box size="3 3 0.1"/></geometry>') + joint(
        "w", "body", "wing", "0 0 2", "fixed"
    )
    text = robot(BODY, wing, *FOUR_WHEELS)
    assert max(x for x, _ in described(text).footprint) == 1.5
    assert max(x for x, _ in described(text, footprint_heights=(0.0, 1.0)).footprint) == 0.5


def test_named_wheels_are_the_only_ones(described):
    middle = [wheel(f"middle_{side}", "body", f"0 {y} 0") for side, y in (("left", 0.35), ("right", -0.35))]
    text = robot(BODY, *FOUR_WHEELS, *middle)
    assert len(described(text).gear.wheels) == 6
    found = described(text, wheels=("middle_left", "middle_right"))
    assert [part.joint for part in found.gear.wheels] == ["middle_left", "middle_right"]
    assert found.drive == "differential"


def test_a_heavy_top_makes_a_robot_that_tips_over_on_level_ground(described):
    aside = link("arm", 50.0, '<geometry><box size="0.1 0.1 0.1"/></geometry>') + joint(
        "a", "body", "arm", "2 0 0.3", "fixed"
    )
    found = described(robot(BODY, aside, *FOUR_WHEELS))
    assert found.tipping.forward < 0.0
    assert any("tips over on level ground" in note for note in found.notes)


@pytest.mark.parametrize("spec", [HUSKY, TURTLEBOT, CAR], ids=lambda spec: spec.name)
def test_the_robots_that_ship_are_described_as_their_models_say(spec):
    found = describe(UrdfRobot(urdf=str(SHIPPED / f"{spec.name}.urdf")))
    for key in ("height", "mass", "wheel_radius", "track", "wheelbase"):
        assert getattr(found, key) == pytest.approx(getattr(spec, key), abs=1e-6), key
    assert found.track_multiplier == pytest.approx(spec.track_multiplier, abs=0.01)
    assert found.drive == {"skid_steer": "skid"}.get(spec.drive.value, spec.drive.value)
    assert footprint_radii(found.footprint)[1] < spec.circumscribed_radius + 0.005  # which some have rounded up
    assert not any("tips over" in note for note in found.notes)


def test_a_husky_of_others_is_a_skid_steered_robot_that_is_heavy_behind():
    found = describe(package_file("husky/husky.urdf"))
    assert (found.drive, found.wheelbase, found.track) == ("skid", 0.512, 0.5708)
    assert found.mass == pytest.approx(33.455 + 4 * 2.637, abs=1e-6)
    assert found.center_of_mass[0] < -0.05
    assert found.tipping.backward < found.tipping.forward
    assert found.edges.approach == pytest.approx(math.radians(35.5), abs=0.01)


def test_a_racecar_of_others_is_a_car_though_one_hinge_is_called_continuous():
    found = describe(package_file("racecar/racecar.urdf"))
    assert found.drive == "ackermann"
    assert (found.wheelbase, found.wheel_radius) == (0.325, 0.05)
    assert {part.joint for part in found.gear.driven} == {"left_rear_wheel_joint", "right_rear_wheel_joint"}
    assert found.motor_torque == 10.0


@pytest.mark.parametrize("name", ["a1/a1.urdf", "quadruped/minitaur.urdf"])
def test_robots_without_wheels_and_many_joints_are_on_legs(name):
    found = describe(package_file(name))
    assert found.drive == "legged"
    assert "max_speed: 1 m/s is assumed, because joints do not say how fast legs carry it" in found.notes
    assert 0.1 < footprint_radii(found.footprint)[0] < footprint_radii(found.footprint)[1] < 0.7


@pytest.mark.parametrize("name", ["laikago/laikago.urdf", "laikago/laikago_toes.urdf"])
def test_a_robot_whose_file_has_y_up_is_said_to_lie_on_its_side(name):
    (note,) = (note for note in describe(package_file(name)).notes if "lies on its side" in note)
    assert note.endswith("Expected z up (REP 103); in this file y is up")


@pytest.mark.parametrize("name", ["laikago/laikago_toes_zup.urdf", "a1/a1.urdf", "mini_cheetah/mini_cheetah.urdf"])
def test_a_robot_whose_legs_hang_below_it_does_not_lie_on_its_side(name):
    assert not any("lies on its side" in note for note in describe(package_file(name)).notes)


def test_three_wheels_in_a_star_move_any_way():
    found = describe(UrdfRobot(urdf=str(KIWI)))
    assert found.drive == "omni"
    assert found.p_root_base.tolist() == pytest.approx([0.0, 0.0, -0.15], abs=1e-4)
    assert found.max_speed == pytest.approx(15.0 * 0.06)


def test_wheels_that_roll_sideways_are_an_error_that_names_them():
    with pytest.raises(ConfigError, match=r"right_front_wheel_joint: axis: expected an axis along y"):
        describe(package_file("r2d2.urdf"))


@pytest.mark.parametrize("x", [0.6, -0.6])
def test_a_single_steered_wheel_makes_a_car_that_turns_as_far_as_its_wheel(described, x):
    found = described(robot(BODY, *FIXED_AXLE, *steered("tiller", x, 0.0)))
    assert (found.drive, found.gear.steered[0].steering) == ("ackermann", "tiller_steer")
    assert found.max_steering_angle == pytest.approx(0.6)
    assert found.min_turning_radius == pytest.approx(0.6 / math.tan(0.6))


def test_a_robot_that_hardly_stands_is_told_and_no_limit_of_it_is_below_zero(described):
    found = described(robot(BODY, *FOUR_WHEELS), center_of_mass=(-0.298, 0.0, 0.2))
    assert any("it tips over at 1 degrees, which is less than tip_over_margin, 9 degrees" in one for one in found.notes)
    values = robot_values(found)
    assert float(values["$ROBOT_MAX_PITCH_UP"]) == 0.0
    assert 0.0 < float(values["$ROBOT_MAX_TILT"]) < found.tipping.least


@pytest.mark.parametrize(
    ("footprint", "text"),
    [
        ([[1, 1], [1, -1], [2, 0]], "an outline around base_link, (0, 0), which lies outside of it"),
        ([[0, 1], [-0.6, -0.8], [1, 0.3], [-1, 0.3], [0.6, -0.8]], "three corners of a convex outline"),  # a star
    ],
)
def test_an_outline_that_a_costmap_refuses_is_refused(described, footprint, text):
    with pytest.raises(ValueError, match=re.escape(text)):
        described(robot(BODY, *FOUR_WHEELS), footprint=footprint)


def test_a_body_beside_its_base_link_is_told(described):
    aside = '<origin xyz="2 0 0.1"/><geometry><box size="1 0.4 0.8"/></geometry>'
    notes = described(robot(link("body", 6.0, aside), *FOUR_WHEELS), footprint_heights=(0.45, 1.0)).notes
    assert any("base_link lies outside of its footprint" in note for note in notes)
