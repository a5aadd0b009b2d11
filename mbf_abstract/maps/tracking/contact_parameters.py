"""Parameters of the guard that stops a robot before contacts, of every layer that tracks objects."""

from __future__ import annotations

from mbf_abstract.parameters import ParameterModel, parameter


class ContactParameters(ParameterModel):
    """How the robot stops before moving objects."""

    stop_before_contact: bool = parameter(
        True, "Slow down and stop in time before moving objects, whatever the controller."
    )
    contact_margin: float = parameter(0.1, "Distance kept to moving objects.", unit="m", ge=0.0, le=5.0)
    reaction_time: float = parameter(0.3, "Time until the robot begins to brake.", unit="s", ge=0.0, le=5.0)
    turning_time: float = parameter(
        0.5,
        "Time until the robot notices that an object has turned; until then it may be wherever it gets at its speed. "
        "0 = objects do not turn.",
        unit="s",
        ge=0.0,
        le=5.0,
    )
    decel_lim_x: float = parameter(0.5, "Deceleration of the robot.", unit="m/s^2", gt=0.0, le=100.0)
    decel_lim_theta: float = parameter(1.0, "Deceleration of its turns.", unit="rad/s^2", gt=0.0, le=100.0)
    passing_speed: float = parameter(
        0.3,
        "Speed at which the robot passes somebody who waits where it could not stand if they set off; slower commands "
        "are followed as they are.",
        unit="m/s",
        gt=0.0,
        le=100.0,
    )
    lost_contact_time: float = parameter(
        3.0,
        "How long the robot stands for somebody who came within the margin and is out of sight since, as what touches "
        "it is. 0 = not at all.",
        unit="s",
        ge=0.0,
        le=60.0,
    )
    max_wait: float = parameter(
        10.0, "The path is blocked once the robot has waited for moving objects for this long.", unit="s", ge=0.0
    )
