"""Dictionaries become messages of the distribution that is installed."""

from array import array

from mbf_ros.ros2.conversion import fill, to_dict


class HumbleResult:
    """FollowWaypoints_Result of Humble, whose missed waypoints are ``int32[]``."""

    def __init__(self):
        self.missed_waypoints = array("i")


def test_missed_waypoints_are_indices_where_a_distribution_has_numbers():
    missed = [{"index": 1, "waypoint_index": 1}, {"index": 3, "waypoint_index": 3}]
    assert fill(HumbleResult(), {"missed_waypoints": missed, "error_code": 600}).missed_waypoints == array("i", [1, 3])
    assert fill(HumbleResult(), {"missed_waypoints": []}).missed_waypoints in ([], array("i"))


class Status:
    """DiagnosticStatus as rclpy has it: a byte is of the type bytes."""

    def __init__(self):
        self.level = b"\x00"

    def get_fields_and_field_types(self):
        return {"level": "octet"}


def test_a_byte_of_rclpy_is_a_number_here():
    assert fill(Status(), {"level": 3}).level == b"\x03"
    assert to_dict(fill(Status(), {"level": 2})) == {"level": 2}
