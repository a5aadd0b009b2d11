"""What all views of a run draw alike: walls and obstacles, start and goals, and a robot's body."""

from __future__ import annotations

import numpy as np

from mbf_abstract.geometry import FloatArray, Pose
from terrain.recording.recorded_robot import RobotShape
from terrain.recording.recording import Recording
from terrain.viewer.pictures.colours import GOAL, OBSTACLE, START, WALL, Colour
from terrain.viewer.pictures.storeys import storeys
from terrain.worlds.surface import Surface

WALL_CUT = 0.9  # m above the lowest point of the walls


def standing_things(recording: Recording) -> list[tuple[str, Surface, Colour]]:
    """Names, surfaces and colours of walls and obstacles, where there are any; walls of one storey are cut low."""
    walls = recording.walls
    if walls is not None and not storeys(recording.ground):
        walls = cut_walls(walls)
    things = [("walls", walls, WALL), ("obstacles", recording.obstacles, OBSTACLE)]
    return [(name, surface, colour) for name, surface, colour in things if surface is not None]


def marks(recording: Recording, robot: str = "") -> list[tuple[str, Pose, Colour]]:
    """Names, poses and colours of start and goals; several goals are numbered, and the robot's name goes before."""
    names = ["goal"] if len(recording.goals) == 1 else [f"goal {k}" for k in range(1, len(recording.goals) + 1)]
    goals = [(name, goal, GOAL) for name, goal in zip(names, recording.goals, strict=True)]
    return [
        (f"{robot} {name}".lstrip(), pose, colour) for name, pose, colour in [("start", recording.start, START), *goals]
    ]


def robot_body(shape: RobotShape) -> Surface:
    """A robot's body in base_link, a little narrower than its footprint so that its wheels can be seen."""
    return prism(shape.footprint * np.array([0.98, 0.78]), 0.6 * shape.wheel_radius, shape.height)


def cut_walls(walls: Surface) -> Surface:
    """Cut walls low, so that rooms can be seen from above."""
    vertices = walls.vertices.copy()
    vertices[:, 2] = np.minimum(vertices[:, 2], vertices[:, 2].min(initial=0.0) + WALL_CUT)
    return Surface(vertices, walls.faces)


def prism(outline: FloatArray, z_min: float, z_max: float) -> Surface:
    """An upright prism over a convex outline (n, 2), counter-clockwise."""
    count = len(outline)
    bottom = np.column_stack([outline, np.full(count, z_min)])
    top = np.column_stack([outline, np.full(count, z_max)])
    near = np.arange(count)
    far = (near + 1) % count
    sides = np.concatenate([np.stack([near, far, far + count], 1), np.stack([near, far + count, near + count], 1)])
    fan = np.stack([np.zeros(count - 2, int), near[1:-1], near[2:]], axis=1)
    faces = np.concatenate([sides, fan + count, fan[:, ::-1]])
    return Surface(np.concatenate([bottom, top]), faces.astype(np.int32))
