"""Where visitors look from: freely, following the robot, at the whole route, or straight down at the robot's storey.

Every visitor chooses for himself. Whatever the view, the mouse still turns and zooms it.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from mbf_abstract.geometry import FloatArray
from terrain.recording.recording import Recording
from terrain.sensors.rays import StaticRays
from terrain.viewer.pictures.storeys import HEADROOM, storeys
from terrain.viewer.scene import look_at_route
from terrain.worlds.surface import Surface

FIRST_DISTANCE = 9.0  # m from the robot when the camera begins to follow
LOWEST = 0.5  # least height of the first view over its distance
NEAR = 0.01  # m; viser's own near plane
UPRIGHT = 0.75  # width by height; in a narrower picture the route leads upward
UPRIGHT_FARTHER = 1.25  # than in a replay; panels lie below such a picture
CUTAWAY = 1.5  # m before the robot from where on things are drawn that would hide it
MARGIN = 1.1  # of what must be seen
STEEPEST = np.cos(np.radians(15.0))  # of a camera that looks down, so that a near plane is as good as level
FROM_SOUTH = 0.01  # of the height; straight from above the camera would not know where north is

Camera = Any  # viser.CameraHandle


class Cameras:
    """Moves the cameras of the visitors.

    Parameters
    ----------
    start : Recording
        The run as it begins: what an overview shows.
    ground : Surface
        Of the world.
    rays : StaticRays
        At the ground.
    farther : float
        How much farther away an overview is than in a replay.
    """

    def __init__(
        self, server_page: Any, start: Recording, ground: Surface, rays: StaticRays, farther: float = 1.0
    ) -> None:
        self._server = server_page
        self._start, self._farther = start, farther
        self._rays = rays
        self._lower, self._upper = ground.vertices.min(axis=0), ground.vertices.max(axis=0)
        self._floors = storeys(ground)
        self._views: dict[int, str] = {}
        self._followed: dict[int, FloatArray] = {}  # where the robot was, by visitor
        self._met: set[int] = set()
        look_at_route(server_page.initial_camera, start, farther)

    def choose(self, visitor: int, view: str, robot: FloatArray) -> None:
        """Move the camera of a visitor; ``robot`` (3,) is where the robot is [m]."""
        client = self._server.get_clients().get(visitor)
        if client is None:
            return
        self._followed.pop(visitor, None)
        self._views[visitor] = view
        client.camera.near = NEAR
        if view == "overview":
            self._overlook(client.camera)
        elif view == "storey":
            middle, half = 0.5 * (self._lower + self._upper), 0.5 * MARGIN * (self._upper - self._lower)
            floor = self.floor_below(robot)
            height = max(float(half[1]), float(half[0]) / client.camera.aspect) / np.tan(0.5 * client.camera.fov)
            client.camera.position = (middle[0], middle[1] - FROM_SOUTH * height, floor + height)
            client.camera.look_at = (middle[0], middle[1], floor)

    def leave(self, visitor: int) -> None:
        """Forget a visitor."""
        self._views.pop(visitor, None)
        self._followed.pop(visitor, None)
        self._met.discard(visitor)

    def show(self, robot: FloatArray) -> None:
        """Move the cameras that move with the robot, which is at ``robot`` (3,) [m]."""
        for visitor, client in self._server.get_clients().items():
            if visitor not in self._met:
                self._met.add(visitor)
                if client.camera.aspect < UPRIGHT:  # the page's first view is the same for all, that of a wide picture
                    self._overlook(client.camera)
            view = self._views.get(visitor, "free")
            if view == "follow":
                self._follow(visitor, client.camera, robot)
            elif view == "storey":
                client.camera.near = self._above_ceiling(client.camera, robot)

    def _overlook(self, camera: Camera) -> None:
        """Show all of the route."""
        upright = camera.aspect < UPRIGHT
        look_at_route(camera, self._start, UPRIGHT_FARTHER if upright else self._farther, upright)

    def floor_below(self, robot: FloatArray) -> float:
        """Height [m] of the storey that the robot is on; of the ground below it in a world of one level."""
        below = [floor for floor in self._floors if floor <= float(robot[2]) + 0.5 * HEADROOM]
        return max(below) if below else float(robot[2])

    def _follow(self, visitor: int, camera: Camera, robot: FloatArray) -> None:
        last = self._followed.get(visitor)
        if last is None:
            camera.position = robot + FIRST_DISTANCE * first_direction(camera.position - camera.look_at)
            camera.look_at = robot
        else:
            camera.position = camera.position + robot - last
        self._followed[visitor] = robot
        towards = robot + np.array([0.0, 0.0, 1.0]) - camera.position
        distance = max(float(np.linalg.norm(towards)), 1e-6)
        hit = float(self._rays.distances(np.asarray(camera.position)[None], towards[None] / distance, distance)[0])
        camera.near = distance - CUTAWAY if hit < distance - CUTAWAY else NEAR

    def _above_ceiling(self, camera: Camera, robot: FloatArray) -> float:
        """Near plane [m] that cuts off the storeys above the robot's; only while the camera looks down."""
        look = camera.look_at - camera.position
        if -look[2] < STEEPEST * float(np.linalg.norm(look)) or self.floor_below(robot) == max(self._floors, default=0):
            return NEAR
        return max(float(camera.position[2]) - self.floor_below(robot) - HEADROOM, NEAR)


def first_direction(look: FloatArray) -> FloatArray:
    """Direction (3,) from the robot to the camera: the one it looked from before, but not too low."""
    level = look / max(float(np.linalg.norm(look[:2])), 1e-9)
    direction = np.array([level[0], level[1], max(float(level[2]), LOWEST)])
    return np.asarray(direction / np.linalg.norm(direction))


def ray_through(camera: Camera, u: float, v: float) -> tuple[FloatArray, FloatArray]:
    """Origin and unit direction (3,), (3,) [m] of the ray through a place in a camera's picture, see ``Place``.

    A camera looks along its z axis, x to the right and y downwards; ``fov`` is that from the upper to the lower edge.
    """
    half = float(np.tan(0.5 * camera.fov))
    in_camera = np.array([(2.0 * u - 1.0) * half * camera.aspect, (2.0 * v - 1.0) * half, 1.0])
    w, x, y, z = np.asarray(camera.wxyz, dtype=np.float64)
    axis = np.array([x, y, z])
    turned = 2.0 * np.cross(axis, in_camera)
    direction = in_camera + w * turned + np.cross(axis, turned)
    return np.asarray(camera.position, dtype=np.float64), direction / np.linalg.norm(direction)
