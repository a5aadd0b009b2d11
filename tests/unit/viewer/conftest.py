"""Synthetic recordings: a drive over a hill and a drive through an office, no simulator needed."""

import base64
import json
import math
import re
import zlib
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mbf_abstract.events import Event, EventKind
from mbf_abstract.geometry import Pose, Twist
from terrain.physics.robot_models import HUSKY, TURTLEBOT
from terrain.recording.actor_track import ActorTrack
from terrain.recording.joint_recording import JointRecording
from terrain.recording.recorded_robot import RobotShape
from terrain.recording.recorder import Recorder
from terrain.recording.recording import Recording
from terrain.recording.verdict import Verdict
from terrain.scenarios.scenario import PlanarPose, Scenario, Sensor, load_scenario
from terrain.scenarios.world_types import GeneratedWorld
from terrain.worlds.generate import fractal_terrain
from terrain.worlds.heightfield import Heightfield
from terrain.worlds.multi_level import parking_garage
from terrain.worlds.occupancy import OccupancyGrid, wall_surface
from terrain.worlds.surface import Surface, box

RATE = 10.0


def drive(recorder: Recorder, poses: list[Pose], speed: float) -> None:
    """Record standing still for half a second, then one pose per sample."""
    for index, pose in enumerate([poses[0]] * 5 + poses):
        moving = speed if index >= 5 else 0.0
        recorder.sample(index / RATE, pose, Twist.planar(moving), Twist.planar(moving, wz=0.1))


def life_of_a_goal(duration: float, outcome: int, message: str) -> list[Event]:
    return [
        Event(0.0, EventKind.GOAL_ACCEPTED, "move_base", {"goal_id": 1}),
        Event(0.0, EventKind.GOAL_ACCEPTED, "get_path", {"goal_id": 2}),
        Event(0.0, EventKind.PLUGIN_CALL_STARTED, "dijkstra", {"goal_id": 2, "method": "make_plan"}),
        Event(0.4, EventKind.PLUGIN_CALL_ENDED, "dijkstra", {"goal_id": 2, "method": "make_plan", "outcome": 0}),
        Event(0.4, EventKind.PLAN, "get_path", {"goal_id": 2, "plugin": "dijkstra", "cost": 30.0, "length": 29.0}),
        Event(0.4, EventKind.GOAL_FINISHED, "get_path", {"goal_id": 2, "outcome": 0, "message": "plan found"}),
        Event(0.4, EventKind.GOAL_ACCEPTED, "exe_path", {"goal_id": 3}),
        Event(3.0, EventKind.ROBOT_STOPPED, "velocity_gate", {"reason": "no command for 0.5 s"}),
        Event(duration, EventKind.CONTROL_LOOP, "follower", {"goal_id": 3, "began": 0.4, "cycles": 500, "failed": 12}),
        Event(duration, EventKind.GOAL_FINISHED, "exe_path", {"goal_id": 3, "outcome": outcome, "message": message}),
        Event(duration, EventKind.GOAL_FINISHED, "move_base", {"goal_id": 1, "outcome": outcome, "message": message}),
    ]


def make_hill_recording() -> Recording:
    """Thirty metres over hills, planned and driven, arrived."""
    x, y = np.meshgrid(np.linspace(0.0, 40.0, 81), np.linspace(0.0, 30.0, 61))
    heights = 1.5 * np.sin(x / 6.0) * np.cos(y / 5.0) + 0.02 * x
    field = Heightfield(heights.astype(np.float32), 0.5, 0.5)
    along = np.linspace(0.0, 1.0, 300)
    xs, ys = 4.0 + 30.0 * along, 5.0 + 18.0 * along + 3.0 * np.sin(6.0 * along)
    yaws = np.arctan2(np.gradient(ys), np.gradient(xs))
    poses = [field.pose_at(px, py, yaw) for px, py, yaw in zip(xs, ys, yaws, strict=True)]
    recorder = Recorder("hill", "mesh", RobotShape.of(HUSKY), poses[0], [poses[-1]], ground=field.surface())
    recorder.path(0.4, np.column_stack([xs, ys + 0.3 * np.sin(20 * along), field.height_at(xs, ys)]))
    drive(recorder, poses, speed=1.2)
    events = life_of_a_goal(30.4, 0, "goal reached")
    return recorder.finish(Verdict(0, "goal reached"), events)


def make_office_recording() -> Recording:
    """Two rooms and a door, a box in the way, a lidar; ends before the goal."""
    occupied = np.zeros((120, 160), dtype=bool)
    occupied[[0, 1, -1, -2], :] = occupied[:, [0, 1, -1, -2]] = True
    occupied[:50, 78:82] = occupied[70:, 78:82] = True
    grid = OccupancyGrid(occupied, ~occupied, 0.1)
    floor = Surface(
        np.array([[0, 0, 0], [16, 0, 0], [16, 12, 0], [0, 12, 0]], float), np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    )
    poses = [Pose.planar(2.0 + 8.0 * t, 3.0 + 3.0 * math.sin(1.5 * t), 0.4) for t in np.linspace(0.0, 1.0, 150)]
    recorder = Recorder(
        "office", "costmap", RobotShape.of(TURTLEBOT), poses[0], [Pose.planar(14.0, 9.0)],
        ground=floor, walls=wall_surface(grid, 2.0), obstacles=box([0.6, 0.6, 1.0]).at(Pose.planar(11.0, 6.5, z=0.5)),
    )  # fmt: skip
    recorder.path(0.4, [[2, 3, 0], [8, 6, 0], [14, 9, 0]])
    angles = np.linspace(-2.0, 2.0, 180)
    for index in range(0, 150, 5):
        pose = poses[index]
        ring = np.column_stack([pose.x + 2 * np.cos(angles), pose.y + 2 * np.sin(angles), np.full(180, 0.3)])
        recorder.scan(index / RATE, ring, ring.mean(axis=0))
    drive(recorder, poses, speed=0.5)
    return recorder.finish(Verdict(110, "a box stands on the path"), life_of_a_goal(15.4, 110, "blocked"))


@pytest.fixture
def hill_recording() -> Recording:
    return make_hill_recording()


@pytest.fixture
def office_recording() -> Recording:
    return make_office_recording()


@pytest.fixture(scope="session")
def garage_recording() -> Recording:
    """A robot on the ground floor of a garage of two storeys."""
    garage = parking_garage(2)
    poses = [Pose.planar(14.0 + 0.05 * step, 7.0) for step in range(50)]
    recorder = Recorder(
        "garage",
        "mesh",
        RobotShape.of(HUSKY),
        poses[0],
        [garage.places["roof"]],
        ground=garage.ground,
        walls=garage.walls,
    )
    recorder.path(0.0, [[14, 7, 0], [20, 7, 0]])
    drive(recorder, poses, speed=0.5)
    return recorder.finish(Verdict(0, "goal reached"))


@pytest.fixture
def two_robots(hill_recording: Recording) -> JointRecording:
    """Two robots on the hills, the second one 3 m north of the first."""
    beside = replace(hill_recording, poses=hill_recording.poses + np.array([0.0, 3.0, 0.0, 0.0, 0.0, 0.0, 0.0]))
    track = [ActorTrack("robot", np.zeros((0, 3)), np.zeros((0, 3), np.int32), beside.poses)]
    robots = {"a": replace(hill_recording, actors=track), "b": replace(beside, actors=track)}
    return JointRecording(robots, Verdict(0, "goal reached"))


@pytest.fixture(scope="session")
def large_recording() -> Recording:
    """A short drive over more than 300,000 triangles."""
    hills = fractal_terrain(195.0, 195.0, 0.5, np.random.default_rng(1), roughness=0.03)
    poses = [hills.pose_at(40.0 + 0.3 * step, 90.0, 0.0) for step in range(200)]
    recorder = Recorder("large", "mesh", RobotShape.of(HUSKY), poses[0], [poses[-1]], ground=hills.surface())
    recorder.path(0.0, [pose.position for pose in poses])
    for step in range(0, 200, 10):
        recorder.scan(step / RATE, np.array(poses[step].position) + np.eye(3), poses[step].position)
    drive(recorder, poses, speed=3.0)
    return recorder.finish(Verdict(0, "goal reached"))


@pytest.fixture
def contents_of():
    """What the page of a replay draws, and its arrays, row after row; the reverse of ``packing``, step by step."""

    def contents(page: str) -> tuple[dict[str, Any], list[np.ndarray]]:
        scene = json.loads(re.search(r'id="scene-data">(.*?)</script>', page, re.S)[1])
        raw = zlib.decompress(base64.b64decode(re.search(r'id="scene-arrays">(.*?)</script>', page, re.S)[1]))
        arrays, at = [], 0
        for entry in scene["arrays"]:
            kind, count = np.dtype(entry["type"]), entry["columns"] * entry["rows"]
            planes = np.frombuffer(raw, np.uint8, count * kind.itemsize, at).reshape(kind.itemsize, count)
            at += planes.size
            columns = np.ascontiguousarray(planes.T).view(kind).reshape(entry["columns"], entry["rows"])
            arrays.append(np.cumsum(columns, axis=1, dtype=kind).T)
        assert at == len(raw)
        return scene, arrays

    return contents


@pytest.fixture(scope="session")
def meadow() -> Scenario:
    """Gentle open ground, six metres to go, for runs that are watched."""
    world = GeneratedWorld(type="generated", size=(12.0, 10.0), spacing=0.25, median_slope=5.0)
    places = {"start": PlanarPose(x=3.0, y=5.0), "goals": (PlanarPose(x=9.0, y=5.0),)}
    return load_scenario("outdoor").model_copy(update={"world": world, "sensors": (Sensor(rays=90),), **places})
