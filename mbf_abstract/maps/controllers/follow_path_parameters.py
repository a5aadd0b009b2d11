"""Parameters of ``follow_path``, on any map."""

from __future__ import annotations

import math

from mbf_abstract.maps.controllers.inertia import InertiaParameters
from mbf_abstract.parameters import parameter


class FollowPathParameters(InertiaParameters):
    """Parameters of ``follow_path``."""

    max_vel_x: float = parameter(0.5, "Speed on a straight path.", unit="m/s", gt=0.0, le=20.0)
    max_vel_theta: float = parameter(1.0, "Largest yaw rate.", unit="rad/s", gt=0.0, le=20.0)
    decel_lim_x: float = parameter(0.5, "Deceleration planned before the goal.", unit="m/s^2", gt=0.0, le=100.0)
    look_ahead_dist: float = parameter(
        0.5, "Distance along the path of the point that is steered to.", unit="m", gt=0.0, le=20.0
    )
    rotate_to_heading_min_angle: float = parameter(
        0.8, "The robot turns on the spot to a point farther off its heading.", unit="rad", gt=0.0, le=math.pi
    )
    turn_gain: float = parameter(2.0, "Yaw rate per heading error when turning on the spot.", unit="1/s", gt=0.0)
    check_ahead_time: float = parameter(1.0, "How far ahead the motion must be free.", unit="s", gt=0.0, le=10.0)
    make_room_dist: float = parameter(
        0.5,
        "How far it may drive on in a wider curve where turning would touch something; 0 = it stops.",
        unit="m",
        ge=0.0,
        le=10.0,
    )
    allow_reversing: bool = parameter(True, "Drive backward where the poses of the path look against its direction.")
    max_path_distance: float = parameter(
        1.0, "Farther from the path than this the path is missed.", unit="m", gt=0.0, le=100.0
    )
