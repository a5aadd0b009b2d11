"""A camera that follows the robot; the visitor still chooses the view."""

from __future__ import annotations

from typing import Any

import numpy as np

from mbf_abstract.geometry import FloatArray

FIRST_DISTANCE = 9.0  # m from the robot when the camera begins to follow
LOWEST = 0.5  # least height of the first view over its distance


class FollowCamera:
    """A check box; while it is on, every visitor's camera moves as the robot does."""

    def __init__(self, server_page: Any) -> None:
        self._server = server_page
        self._box = server_page.gui.add_checkbox("follow the robot", False)
        self._followed: dict[int, FloatArray] = {}  # where the robot was, by visitor

    def show(self, robot: FloatArray) -> None:
        """Move the cameras; ``robot`` (3,) is where the robot is [m]."""
        if not self._box.value:
            self._followed.clear()
            return
        for visitor, client in self._server.get_clients().items():
            camera, last = client.camera, self._followed.get(visitor)
            if last is None:
                camera.position = robot + FIRST_DISTANCE * first_direction(camera.position - camera.look_at)
                camera.look_at = robot
            else:
                camera.position = camera.position + robot - last
            self._followed[visitor] = robot


def first_direction(look: FloatArray) -> FloatArray:
    """Direction (3,) from the robot to the camera: the one it looked from before, but not too low."""
    level = look / max(float(np.linalg.norm(look[:2])), 1e-9)
    direction = np.array([level[0], level[1], max(float(level[2]), LOWEST)])
    return np.asarray(direction / np.linalg.norm(direction))
