"""Short cuts of the questions what a footprint touches, against the same answers found the long way."""

import math

import numpy as np
import pytest

from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.maps.controllers.end_of_path import swept_poses
from mbf_costmap_nav.grid import motion_check
from mbf_costmap_nav.grid.costmap import LETHAL, UNKNOWN, Costmap
from mbf_costmap_nav.grid.footprint import Footprint
from mbf_costmap_nav.grid.footprint_check import FootprintCheck

OUTLINES = [
    [[0.3, 0.2], [-0.3, 0.2], [-0.3, -0.2], [0.3, -0.2]],
    [[0.4, 0.1], [-0.1, 0.2], [-0.2, -0.3]],
    [[0.02, 0.02], [-0.02, 0.02], [0.0, -0.03]],
    [],
]


def scattered_map(rng, share):
    """3 m x 3 m with lethal and unknown cells here and there."""
    cells = np.where(rng.random((60, 60)) < share, LETHAL, 0).astype(np.uint8)
    cells[rng.random((60, 60)) < 0.02] = UNKNOWN
    return Costmap(cells, 0.05, -1.5 + rng.random(), -1.5)


@pytest.mark.parametrize("outline", OUTLINES)
@pytest.mark.parametrize("share", [0.0, 0.003, 0.02])
def test_samples_that_pass_no_obstacle_on_their_circle_change_no_answer(outline, share):
    rng = np.random.default_rng(7)
    check = FootprintCheck(Footprint(outline), 0.05)
    hits = []
    for _ in range(40):
        costmap, pose = scattered_map(rng, share), Pose.planar(*rng.uniform(-1.8, 1.8, 2), rng.uniform(-3.0, 3.0))
        poses = swept_poses(pose, rng.uniform(-2.0 * math.pi, 2.0 * math.pi), 0.01)
        hits.append(check.first_collision(costmap, poses))
        assert check.first_collision_of_turn(costmap, poses) == hits[-1]
    if share > 0.01 and len(outline) == 4:
        assert min(hits) < 0 < max(hits), "some turns are free, and some are blocked on their way"


@pytest.mark.parametrize("outline", OUTLINES)
@pytest.mark.parametrize("options", [{}, {"may_overhang": True}, {"leaves_collisions": True}])
def test_looking_at_all_poses_at_once_first_changes_no_text(monkeypatch, outline, options):
    """Where the footprint leaves the map, and where it touches something, each pose is looked at by itself anyway."""
    rng, footprint, asked = np.random.default_rng(8), Footprint(outline), []
    for share in (0.0, 0.003, 0.02) * 30:
        pose = Pose.planar(*rng.uniform(-1.6, 1.6, 2), rng.uniform(-3.0, 3.0))
        command = Twist.planar(rng.choice([0.0, 0.0, 0.4, -0.3]), wz=rng.choice([0.0, 0.7, -1.0]))
        asked.append((scattered_map(rng, share), footprint, pose, command, rng.uniform(0.05, 3.0)))
    texts = [motion_check.obstacle_ahead(*one, **options) for one in asked]

    monkeypatch.setattr(motion_check, "_stays_inside", lambda *_: False)

    assert texts == [motion_check.obstacle_ahead(*one, **options) for one in asked]
    assert "" in texts and len(set(texts)) > 5
