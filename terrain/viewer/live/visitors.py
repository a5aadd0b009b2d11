"""What visitors do with pointer, drags and stick, on its way from the server's event loop to the run."""

from __future__ import annotations

from typing import Any

import numpy as np

from mbf_abstract.geometry import FloatArray
from terrain.viewer.live.cameras import Cameras, ray_through
from terrain.viewer.live.controls import LiveControls, Ray
from terrain.viewer.live.readout import Readout
from terrain.viewer.live.stick import Stick
from terrain.viewer.server.visitor_channel import VisitorChannel
from terrain.viewer.server.visitor_messages import Place


class Visitors:
    """Turns places in pictures into rays, and posts what visitors ask for; see ``VisitorActions``."""

    def __init__(
        self,
        server_page: Any,
        channel: VisitorChannel,
        controls: LiveControls,
        stick: Stick,
        cameras: Cameras,
        readout: Readout,
    ) -> None:
        self._server = server_page
        self._channel = channel
        self._controls = controls
        self._stick = stick
        self._cameras = cameras
        self._readout = readout
        self._pointers: dict[int, Place] = {}
        self._robot = np.zeros(3)
        channel.actions = self

    def show(self, robot: FloatArray) -> None:
        """Send visitors the values under their pointers and what a click places, and move the cameras.

        ``robot`` (3,) is where it is [m].
        """
        self._robot = robot
        self._cameras.show(robot)
        self._channel.broadcast("placing", self._controls.placing.value)
        pointers = dict(self._pointers)
        if pointers:
            self._readout.begin_frame()
        for visitor, place in pointers.items():
            ray = self._ray(visitor, place)
            hit = None if ray is None else self._controls.ground_at(*ray)
            self._channel.send(visitor, "values", [] if hit is None else self._readout.rows(hit))
        if (holder := self._stick.holder) is not None:
            self._channel.send(holder, "stick", self._stick.status(self._controls.holding))

    def show_tree(self, svg: str) -> None:
        """Send everybody the running tree; empty where none runs."""
        self._channel.broadcast("tree", svg)

    # ------------------------------------------------------------------------------- on the server's event loop
    def point(self, visitor: int, place: Place | None) -> None:
        """Note where a pointer is."""
        if place is None:
            self._pointers.pop(visitor, None)
            self._channel.send(visitor, "values", [])
        else:
            self._pointers[visitor] = place

    def place_goal(self, visitor: int, start: Place, end: Place) -> None:
        """Post what a drag places; a click with Shift has no length, so its goal faces away from the robot."""
        first, last = self._ray(visitor, start), self._ray(visitor, end)
        if first is not None and last is not None:
            facing = None if start == end else last
            self._controls.post(lambda: self._controls.place(first, facing))

    def hold_stick(self, visitor: int, turn: float, forward: float, beat: float) -> None:
        """Note where the stick is held."""
        if problem := self._stick.hold(visitor, turn, forward, beat):
            self._channel.send(visitor, "stick", problem)

    def release_stick(self, visitor: int) -> None:
        """Note that the stick was released."""
        self._stick.release(visitor)
        self._channel.send(visitor, "stick", "")

    def look(self, visitor: int, view: str) -> None:
        """Move a camera."""
        self._cameras.choose(visitor, view, self._robot)

    def leave(self, visitor: int) -> None:
        """Forget a visitor."""
        self._pointers.pop(visitor, None)
        self._stick.release(visitor)
        self._cameras.leave(visitor)

    def _ray(self, visitor: int, place: Place) -> Ray | None:
        """The ray through a place in a visitor's picture; None once the visitor has left."""
        client = self._server.get_clients().get(visitor)
        return None if client is None else ray_through(client.camera, *place)
