"""The parameters of MBF (mbf.md 4.1) with their defaults and ranges, and what can be changed at run time."""

import math

import pytest

from mbf_abstract.config.navigation_parameters import NavigationParameters
from mbf_abstract.events import EventKind

MBF_DEFAULTS = {
    "planner_frequency": 0.0,
    "planner_patience": 5.0,
    "planner_max_retries": -1,
    "controller_frequency": 20.0,
    "controller_patience": 5.0,
    "controller_max_retries": -1,
    "recovery_enabled": True,
    "recovery_patience": 15.0,
    "oscillation_timeout": 0.0,
    "oscillation_distance": 0.5,
    "oscillation_angle": 3.14,
    "restore_defaults": False,
    "shutdown_costmaps": False,
    "shutdown_costmaps_delay": 1.0,
    "clear_on_shutdown": False,
    "force_stop_on_retry": True,
    "mbf_tolerance_check": False,
    "dist_tolerance": 0.1,
    "angle_tolerance": math.pi / 18.0,
    "cmd_vel_ignored_tolerance": 5.0,
    "tf_timeout": 3.0,
    "global_frame": "map",
    "robot_frame": "base_link",
    "tf_cache_time": 10.0,
}
OURS_ARE_SAFER = {"force_stop_at_goal": True, "force_stop_on_cancel": True}
DYNAMIC = {
    "planner_frequency", "planner_patience", "planner_max_retries", "controller_frequency", "controller_patience",
    "controller_max_retries", "recovery_enabled", "recovery_patience", "oscillation_timeout", "oscillation_distance",
    "oscillation_angle", "restore_defaults", "shutdown_costmaps", "shutdown_costmaps_delay",
}  # fmt: skip


@pytest.mark.parametrize(("name", "default"), [*MBF_DEFAULTS.items(), *OURS_ARE_SAFER.items()])
def test_a_parameter_has_mbfs_default(name, default):
    assert getattr(NavigationParameters(), name) == default


@pytest.mark.parametrize("name", [*MBF_DEFAULTS, *OURS_ARE_SAFER])
def test_a_parameter_is_dynamic_as_in_mbf(name):
    extra = NavigationParameters.model_fields[name].json_schema_extra
    assert extra["dynamic"] is (name in DYNAMIC)


@pytest.mark.parametrize(
    "bad",
    [
        {"planner_patience": -1.0},
        {"planner_patience": 101.0},
        {"planner_max_retries": -2},
        {"controller_frequency": 0.0},
        {"controller_frequency": 101.0},
        {"oscillation_timeout": 61.0},
        {"oscillation_angle": 7.0},
        {"recovery_patience": math.nan},
        {"no_such_parameter": 1},
        {"controller_frequency": 1.0, "command_timeout": 0.5},
    ],
)
def test_a_value_out_of_range_is_refused_and_nothing_changes(make_session, bad):
    session = make_session()
    before = session.server.runtime.parameters
    with pytest.raises(ValueError, match="|".join(bad)):
        session.server.set_parameters(**bad)
    assert session.server.runtime.parameters is before


def test_a_change_is_recorded_and_restore_defaults_brings_the_configured_values_back(make_session):
    session = make_session(planner_patience=7.0)
    session.server.set_parameters(planner_patience=1.0, max_vel_x=0.3)
    assert session.server.runtime.parameters.planner_patience == 1.0
    assert session.server.runtime.gate.limits.max_vel_x == 0.3
    assert session.recorded(EventKind.PARAMETER_CHANGED)[0].data == {"planner_patience": 1.0, "max_vel_x": 0.3}
    session.server.set_parameters(restore_defaults=True)
    assert session.server.runtime.parameters.planner_patience == 7.0
    assert session.server.runtime.gate.limits.max_vel_x == math.inf


def test_parameters_that_a_part_keeps_reach_it(make_session):
    session = make_session()
    session.server.set_parameters(command_timeout=0.2, tf_timeout=0.7, hang_guard=9.0, max_vel_z=0.1)
    runtime = session.server.runtime
    assert (runtime.gate.command_timeout, runtime.robot.max_pose_age, runtime.robot.max_velocity_age) == (0.2, 0.7, 0.7)
    assert (session.clock.hang_guard, runtime.gate.limits.max_vel_z) == (9.0, 0.1)


@pytest.mark.parametrize("name", ["global_frame", "robot_frame", "use_odometry", "tf_cache_time"])
def test_a_parameter_that_is_read_once_is_not_accepted_without_effect(make_session, name):
    session = make_session()
    before = session.server.runtime.parameters
    with pytest.raises(ValueError, match=f"{name}: read once, at the start"):
        session.server.set_parameters(
            **{name: {"use_odometry": False, "tf_cache_time": 3.0}.get(name, "other")}, planner_patience=1.0
        )
    assert session.server.runtime.parameters is before


def test_a_robot_without_odometry_counts_as_standing(make_session):
    session = make_session(use_odometry=False)
    assert not session.server.runtime.robot.has_odometry


@pytest.mark.parametrize(
    ("field", "value", "bound"), [("dist_tolerance", 1e30, "1000"), ("plan_end_tolerance", 1e30, "1000")]
)
def test_a_tolerance_in_which_every_place_is_the_goal_is_refused_by_name(field, value, bound):
    with pytest.raises(ValueError, match=rf"{field}\n.*less than or equal to {bound}"):
        NavigationParameters(**{field: value})
