"""Regulated pure pursuit in a contact: it turns first and drives straight out, it does not rub along an obstacle."""

import math

import numpy as np
import pytest

from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.plugins import ControlRequest
from mbf_costmap_nav.controllers.regulated_pure_pursuit import RegulatedPurePursuitController
from mbf_costmap_nav.grid.costmap import Costmap
from mbf_costmap_nav.grid.footprint import Footprint

RESOLUTION, ROUND = 0.05, Footprint.circle(0.2)
PILLAR = (2.0, 1.0, 2.8, 1.5)
"""The robot stands 2 cm within its upper face, beside its right end."""
BESIDE = Pose.planar(2.7, 1.675, -0.18)


def map_of(*boxes):
    cells = np.zeros((60, 120), dtype=np.uint8)
    for box in boxes:
        x0, y0, x1, y1 = (round(one / RESOLUTION) for one in box)
        cells[y0:y1, x0:x1] = 254
    return Costmap(cells, RESOLUTION, 0.0, 0.0)


def path_to(heading, start=BESIDE, length=2.5):
    lengths = np.linspace(0.0, length, 51)
    xs, ys = start.x + lengths * math.cos(heading), start.y + lengths * math.sin(heading)
    return Path(np.column_stack([xs, ys, 0.0 * xs]))


@pytest.fixture
def follow(make_plugin):
    """``follow(costmap, path, pose, **parameters)`` -> outcomes, commands and poses of 4 s of a robot that obeys."""

    def follow_it(costmap, path, pose=BESIDE, **parameters):
        controller = make_plugin(RegulatedPurePursuitController, costmap, footprint=ROUND, **parameters)
        assert controller.set_plan(path)
        velocity, outcomes, commands, track = Twist(), [], [], [pose]
        for _ in range(80):
            result = controller.compute_velocity_commands(ControlRequest(pose, velocity))
            controller.clock.time += 0.05
            outcomes.append(result.outcome)
            if not result.success:
                break
            velocity, yaw = result.command, pose.yaw + 0.05 * result.command.wz
            step = 0.05 * velocity.vx
            pose = Pose.planar(pose.x + step * math.cos(yaw), pose.y + step * math.sin(yaw), yaw)
            commands.append(velocity)
            track.append(pose)
        return outcomes, commands, track

    return follow_it


def test_a_robot_that_was_pushed_against_a_pillar_turns_to_its_path_before_it_drives(follow):
    outcomes, commands, track = follow(map_of(PILLAR), path_to(0.24))
    assert set(outcomes) == {ExePathOutcome.SUCCESS}
    first = next(index for index, command in enumerate(commands) if command.vx != 0.0)
    assert first > 0 and all(command.wz > 0.0 for command in commands[:first])
    assert track[first].yaw == pytest.approx(0.2, abs=0.1), "an arc from its heading would press into the face"
    touching = [k for k, pose in enumerate(track[:-1]) if pose.y < 1.69 and pose.x < 2.8]
    assert all(commands[k].vx == 0.0 or commands[k].wz == 0.0 for k in touching), "no arc in the contact"
    assert track[-1].x > 3.2


def test_along_a_path_that_follows_the_face_it_turns_away_from_it_first(follow):
    start = Pose.planar(2.3, 1.675, 0.0)
    outcomes, commands, track = follow(map_of(PILLAR), path_to(0.0, start), start)
    assert set(outcomes) == {ExePathOutcome.SUCCESS}
    assert commands[0].vx == 0.0 and commands[0].wz > 0.0
    assert min(pose.y for pose in track) > 1.67 and track[-1].x > 2.6


def test_between_two_walls_that_both_touch_it_nothing_leads_out(follow):
    corridor, start = map_of((0.0, 1.0, 6.0, 1.5), (0.0, 1.85, 6.0, 2.0)), Pose.planar(2.3, 1.675, 0.0)
    outcomes, _, track = follow(corridor, path_to(0.0, start), start)
    assert outcomes[-1] == ExePathOutcome.COLLISION and track[-1].distance_to(start) < 0.01


def test_a_car_does_not_turn_on_the_spot(follow):
    _, commands, _ = follow(map_of(PILLAR), path_to(0.24), min_turning_radius=0.5)
    assert all(abs(command.wz) <= abs(command.vx) / 0.5 + 1e-9 for command in commands)
