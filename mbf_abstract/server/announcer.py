"""Announces to other robots where the robot of a server is and where it goes.

Example
-------
>>> announcer = Announcer(server, "anna", channel)
>>> announcer.announce()  # twice a second or so, on any thread
"""

from __future__ import annotations

import numpy as np

from mbf_abstract.drive.robot import RobotStateError
from mbf_abstract.geometry import FloatArray
from mbf_abstract.geometry.arithmetic import norm
from mbf_abstract.goals.handle import AnyGoalHandle
from mbf_abstract.server.navigation_server import AbstractNavigationServer
from mbf_abstract.traffic.announcement import Announcement
from mbf_abstract.traffic.traffic import Channel

LENGTH = 12.0
"""How much of its path [m] a robot announces."""
IDLE_TIME = 2.0
"""A robot without a goal for this long [s] goes nowhere; executives send one goal after the other."""
DIGITS = 2
"""Of the length that remains [m], so that small differences decide nothing."""


class Announcer:
    """Publishes for one server; the path is the newest one that its planners have found.

    Parameters
    ----------
    server : AbstractNavigationServer
        Its plugins know the announcements of the other robots from now on.
    name : str
        Of the robot; no other robot has it.
    channel : Channel
    """

    def __init__(self, server: AbstractNavigationServer, name: str, channel: Channel) -> None:
        self._server = server
        self._path: FloatArray = np.zeros((0, 3))
        self._busy = -IDLE_TIME
        server.runtime.traffic.connect(name, channel)
        server.get_path.listeners.append(self._take_plan)

    def announce(self) -> None:
        """Publish the present state; does nothing while the robot does not know where it is."""
        runtime, server = self._server.runtime, self._server
        now = runtime.clock.now()
        if any(action.busy for action in (server.get_path, server.exe_path, server.recovery, server.move_base)):
            self._busy = now
        try:
            place = np.array([runtime.robot.pose().position])
        except RobotStateError:
            return
        path = self._path if now - self._busy < IDLE_TIME else self._path[:0]
        if len(path):
            path = path[int(np.argmin(norm(path - place))) :]
        way = np.concatenate([place, path])
        driven = np.cumsum(np.concatenate([[0.0], norm(np.diff(way, axis=0))]))
        near = way[: int(np.searchsorted(driven, LENGTH, side="right"))]
        runtime.traffic.announce(Announcement("", now, near, round(float(driven[-1]), DIGITS)))

    def _take_plan(self, handle: AnyGoalHandle) -> None:
        path = handle.result.path if handle.result is not None else None
        if path is not None:
            self._path = path.positions.copy()
