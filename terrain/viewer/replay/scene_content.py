"""What a replay's page draws, as JSON and packed arrays: world, robots and actors with their poses, plans, scans."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.event_values import well_formed
from mbf_abstract.geometry import FloatArray
from terrain.recording.recorded_objects import IS_MOVING, VX, VY, RecordedObjects, X, Y, Z
from terrain.recording.recording import Recording, StampedPoints
from terrain.viewer.pictures.colours import (
    BODY,
    DRIVEN,
    FLOOR,
    LIT_WALL,
    OBSTACLE,
    PLANNED,
    SCAN,
    SLOPE_COLOURS,
    SLOPE_STOPS,
    TRACKED,
    Colour,
)
from terrain.viewer.pictures.shading import LIGHT
from terrain.viewer.pictures.shapes import marks
from terrain.viewer.pictures.storeys import storeys
from terrain.viewer.replay.bodies import actor_parts, robot_parts
from terrain.viewer.replay.cost_layers import packed_layers
from terrain.viewer.replay.packing import Packer
from terrain.viewer.replay.world_mesh import WorldMesh, world_mesh
from terrain.viewer.scene import route_of, scan_hold, wheel_angles

FRAME_RATE = 10.0  # Hz of recorded time
MAX_FRAMES = 3000  # longer runs get fewer frames a second, so that the file stays small
MAX_SCANS = 300
MAX_SCAN_POINTS = 180
MAX_PLAN_POINTS = 200_000  # of all plans of a robot; they take 16 bytes each in the browser
LEAST_STEP = 0.1  # m between two points of a plan; larger where the plans have too many
LEAST_RELIEF = 2.0  # m; lower ground has no contour lines
CONTOURS = 12  # about so many on all of the relief
ARROW_HEIGHT = 1.8  # m above the ground, over the heads of people; of velocities of tracked objects
BARB = 0.3  # of the arrow's length
CONTOUR_STEPS = (0.25, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)  # m


class Looks(NamedTuple):
    """Name and colour of a robot among several; a robot that is alone has no name."""

    name: str
    colour: Colour


PLAIN = Looks("", DRIVEN)


def duration(robots: Iterable[Recording]) -> float:
    """Length [s] of the shortest recording: what can be played of all of them."""
    return min(recording.duration for recording in robots)


def scene_content(packer: Packer, world: Recording, robots: Mapping[Looks, Recording]) -> dict[str, Any]:
    """Return what the page draws; arrays go to ``packer``.

    Parameters
    ----------
    world : Recording
        For what does not belong to one robot.
    robots : mapping of Looks to Recording
        Sampled at the same times.
    """
    mesh = world_mesh(world)
    times = min((recording.times for recording in robots.values()), key=len)
    frames = frame_indices(times)
    begin = float(times[0]) if len(times) else 0.0
    several = len(robots) > 1
    return {
        "ending": well_formed(world.verdict.title),
        "size": mesh.size.tolist(),
        "world": _packed_world(packer, mesh),
        "layers": packed_layers(packer, world),
        "storeys": [round(floor - float(mesh.origin[2]), 3) for floor in storeys(world.ground)],
        **_route(world, mesh),
        **_looks(mesh),
        "times": packer.add_milli(times[frames] - begin),
        "actors": [_actor(packer, track, frames, mesh.origin) for track in world.actors],
        "robots": [_robot(packer, recording, looks, frames, mesh.origin, begin) for looks, recording in robots.items()],
        "marks": [
            {"name": well_formed(name), "position": np.round(pose.position - mesh.origin, 3).tolist(), "colour": colour}
            for looks, recording in robots.items()
            for name, pose, colour in marks(recording, looks.name if several else "")
        ],
    }


def frame_indices(times: FloatArray) -> NDArray[np.intp]:
    """Indices of the samples to show: at ``FRAME_RATE``, at most ``MAX_FRAMES``, first and last always."""
    if not len(times):
        return np.zeros(0, np.intp)
    length = float(times[-1] - times[0])
    period = max(1.0 / FRAME_RATE, length / MAX_FRAMES)
    wanted = times[0] + period * np.arange(int(length / period) + 1)
    found = np.minimum(np.searchsorted(times, wanted - 1e-9), len(times) - 1)
    return np.unique(np.concatenate([found, [len(times) - 1]]))


def contour_step(relief: float) -> float:
    """Height [m] between two contour lines of ground with this relief [m]; 0 for none."""
    if relief < LEAST_RELIEF:
        return 0.0
    return next((step for step in CONTOUR_STEPS if relief / step <= CONTOURS), CONTOUR_STEPS[-1])


def _packed_world(packer: Packer, mesh: WorldMesh) -> dict[str, Any]:
    return {
        "vertices": packer.add(mesh.vertices),
        "paints": packer.add(mesh.paints),
        "levels": [[cell, packer.add(faces)] for cell, faces in mesh.levels],
    }


def _route(world: Recording, mesh: WorldMesh) -> dict[str, Any]:
    """What the first views look at: the route from one side, all of the world from above."""
    ends, lower, upper = route_of(world)
    along = ends[-1, :2] - ends[0, :2]
    middle, length = (lower + upper) / 2.0 - mesh.origin, float(np.linalg.norm(upper - lower))
    yaw = float(np.arctan2(-along[0], along[1])) if along.any() else -np.pi / 2.0
    route = {"middle": middle.tolist(), "yaw": yaw}
    box = {"middle": (0.5 * mesh.size).tolist(), "size": mesh.size.tolist()}
    return {"route": route, "box": box, "ring": max(0.4, 0.008 * length)}


def _looks(mesh: WorldMesh) -> dict[str, Any]:
    paints = [SLOPE_COLOURS[0].tolist(), FLOOR, LIT_WALL, OBSTACLE]
    return {
        "light": LIGHT.tolist(),
        "paints": (np.array(paints) / 255.0).round(4).tolist(),
        "slopes": (SLOPE_COLOURS / 255.0).round(4).tolist(),
        "stops": SLOPE_STOPS.tolist(),
        "contour": contour_step(float(mesh.size[2])),
        "scan": SCAN,
        "tracked": TRACKED,
    }


def _robot(
    packer: Packer, recording: Recording, looks: Looks, frames: NDArray[np.intp], origin: FloatArray, begin: float
) -> dict[str, Any]:
    shape, twists = recording.robot, recording.twists
    angles = wheel_angles(shape, recording.times, twists)
    scans = recording.scans[:: -(-len(recording.scans) // MAX_SCANS)] if recording.scans else []
    scans = [(time, points[:: max(1, len(points) // MAX_SCAN_POINTS)]) for time, points in scans]
    plans = thinned_plans(seen_plans(recording.paths, recording.times[frames]))
    return {
        "name": well_formed(looks.name),
        "ring": looks.colour,
        "plan": looks.colour if looks.name else PLANNED,
        "height": shape.height,
        "wheels": shape.wheels.tolist(),
        "parts": robot_parts(packer, shape, looks.colour if looks.name else BODY),
        **_poses(packer, recording.poses[frames], origin),
        "angles": packer.add_milli(angles[frames]),
        "speeds": packer.add_milli(np.hypot(twists[frames, 0], twists[frames, 1])),
        "tilts": packer.add_milli(np.degrees(recording.tilt[frames])),
        "plans": _sets(packer, plans, origin, begin),
        "scans": _sets(packer, scans, origin, begin),
        "scanHold": scan_hold([time for time, _ in scans]),
        "objects": _sets(
            packer, [(one.time, velocity_arrows(one.rows)) for one in thinned_looks(recording.objects)], origin, begin
        ),
    }


def thinned_looks(looks: Sequence[RecordedObjects]) -> list[RecordedObjects]:
    """About ``MAX_FRAMES`` of the looks, and all that see nothing: arrows stay until the next look."""
    stride = -(-len(looks) // MAX_FRAMES) or 1
    return [look for index, look in enumerate(looks) if index % stride == 0 or not len(look.rows)]


def velocity_arrows(rows: FloatArray) -> FloatArray:
    """Ends (6 k, 3) [m] of three lines for each of k moving objects: to where it will be in a second, and two barbs.

    ``rows`` are those of ``RecordedObjects``; those that stand have no arrow.
    """
    moving = rows[rows[:, IS_MOVING] > 0.0]
    ahead = np.column_stack([moving[:, [VX, VY]], np.zeros(len(moving))])
    aside = np.column_stack([-ahead[:, 1], ahead[:, 0], ahead[:, 2]])
    middle = moving[:, [X, Y, Z]] + (0.0, 0.0, ARROW_HEIGHT)
    tip = middle + ahead
    barbs = [tip - BARB * ahead + side * 0.5 * BARB * aside for side in (1.0, -1.0)]
    return np.asarray(np.stack([middle, tip, barbs[0], tip, barbs[1], tip], axis=1).reshape(-1, 3))


def _actor(packer: Packer, track: Any, frames: NDArray[np.intp], origin: FloatArray) -> dict[str, Any]:
    return {
        "thing": track.thing,
        "parts": actor_parts(packer, track),
        **_poses(packer, track.poses[frames[frames < len(track.poses)]], origin),
    }


def _poses(packer: Packer, poses: FloatArray, origin: FloatArray) -> dict[str, Any]:
    return {"positions": packer.add_milli(poses[:, :3] - origin), "orientations": packer.add_unit(poses[:, 3:])}


def _sets(packer: Packer, sets: Sequence[StampedPoints], origin: FloatArray, begin: float) -> dict[str, int]:
    """Sets of points, each shown from its time on until the next one."""
    points = np.concatenate([np.zeros((0, 3)), *(points - origin for _, points in sets)])
    return {
        "times": packer.add_milli(np.array([time - begin for time, _ in sets])),
        "counts": packer.add(np.array([len(points) for _, points in sets], np.int32)),
        "points": packer.add_milli(points),
    }


def seen_plans(plans: Sequence[StampedPoints], times: FloatArray) -> list[StampedPoints]:
    """Plans that are the newest one at some of the times (n,) [s], and the last one; at most n + 1."""
    begins = np.array([time for time, _ in plans])
    newest = np.append(np.searchsorted(begins, times, side="right") - 1, len(plans) - 1)
    return [plans[index] for index in np.unique(newest[newest >= 0])]


def thinned_plans(plans: Sequence[StampedPoints], most: int = MAX_PLAN_POINTS) -> list[StampedPoints]:
    """Plans with one point for each ``LEAST_STEP`` of the path, or for each larger step that leaves ``most`` in all."""
    along = [_along(points) for _, points in plans]
    step, longest = LEAST_STEP, max((float(one[-1]) for one in along if len(one)), default=0.0)
    keep = [_one_for_each(step, one) for one in along]
    while sum(map(np.count_nonzero, keep)) > most and step < longest:
        step *= 2.0
        keep = [_one_for_each(step, one) for one in along]
    return [(time, points[kept]) for (time, points), kept in zip(plans, keep, strict=True)]


def _along(points: FloatArray) -> FloatArray:
    """Length (n,) [m] until each point, each piece of it measured along its longest axis."""
    return np.cumsum(np.abs(np.diff(points, axis=0, prepend=points[:1])).max(axis=1, initial=0.0))


def _one_for_each(step: float, along: FloatArray) -> NDArray[np.bool_]:
    """Mask (n,) of the first point in each step [m] of the path, and of both ends."""
    keep = np.diff(np.floor(along / step + 1e-6), prepend=-1.0) > 0.0  # points at the step's own distance all stay
    keep[-1:] = True
    return keep
