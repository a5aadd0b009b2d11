"""Recordings of real robots go through our layers."""

import numpy as np
import pytest

from mbf_abstract.commands.coordinates import Place
from mbf_abstract.geometry.transform import Transform

HOKUYO = """\
backend: costmap
planners: [{name: straight, type: straight_line}]
global_costmap:
  {width: 20.0, height: 20.0, resolution: 0.1, origin_x: -10.0, origin_y: -10.0, robot_radius: 0.2,
   layers: [{name: obstacles, type: obstacle}], obstacles: {sources: {scan: {obstacle_max_range: 8.0}}}}
local_costmap: {rolling_window: true, width: 2.0, height: 2.0, robot_radius: 0.2, layers: []}
"""
JACKAL = """\
backend: costmap
global_frame: odom
planners: [{name: straight, type: straight_line}]
planner_max_retries: 0
global_costmap:
  {frame_id: odom, width: 80.0, height: 80.0, resolution: 0.5, origin_x: -40.0, origin_y: -40.0, robot_radius: 0.3,
   layers: []}
local_costmap: {frame_id: odom, rolling_window: true, width: 2.0, height: 2.0, robot_radius: 0.3, layers: []}
"""


def test_all_scans_of_a_real_lidar_are_taken(shared_data, replayed):
    places = (
        Transform((0.0, 0.0, 0.0), static=True),
        Transform((0.1, 0.0, 0.2), (0, 0, 0, 1), "base_link", "laser", 0, True),
    )
    result = replayed(shared_data / "bags/hokuyo_scans.bag", HOKUYO, transforms=places)
    scans = result.topics["/scan"]
    assert scans.recorded.count == 360 and not scans.dropped and scans.recorded.largest_gap < 0.11
    forbidden = result.log.maps[-1][1].costs >= 1.0
    assert 50 < np.count_nonzero(forbidden) < 2000 and not forbidden[98:103, 98:103].any()


def test_a_real_drive_is_replayed_from_its_odometry(shared_data, replayed):
    bag = shared_data / "bags/jackal_odom_imu_gps.bag"
    result = replayed(bag, JACKAL, odometry_as_transform=True, goal=Place(3.0, 1.0), at=20.0)
    assert result.plan["outcome_name"] == "SUCCESS" and result.topics["/imu/data"].recorded.count == 3061
    assert result.frames["base_link"].stamps.count == 3060 and result.poses_unknown <= 1
    steps = np.linalg.norm(np.diff(result.log.poses[:, :2], axis=0), axis=1)
    assert steps.sum() == pytest.approx(np.abs(result.log.twists[:, 0]).sum() * 0.1, rel=0.05)
