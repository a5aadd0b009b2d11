"""The list of waypoints: pins and headings in the scene, buttons to remove, clear and drive them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from mbf_abstract.geometry import Pose
from terrain.session.goal_sequence import GoalSequence
from terrain.viewer.live.controls import MAX_WAYPOINTS, LiveControls
from terrain.viewer.live.status_html import SMALL
from terrain.viewer.pictures.colours import Colour
from terrain.viewer.scene import add_path, add_pin

WAYPOINT: Colour = (120, 50, 170)
NODE = "/waypoints"
ONE, ALL = "one", "all"
HEADING = 1.2  # m; length of the line that shows a heading
NO_WAYPOINTS = "None yet: choose “a click is a waypoint”, then click or drag on the ground."


class WaypointList:
    """What was placed, and what can be done with it.

    Parameters
    ----------
    sequence : GoalSequence
        Has the waypoint that the robot goes to.
    pin_height : float
        Height [m] of markers.
    """

    def __init__(self, server_page: Any, controls: LiveControls, sequence: GoalSequence, pin_height: float) -> None:
        gui, self._scene = server_page.gui, server_page.scene
        self._controls, self._sequence, self._pin_height = controls, sequence, pin_height
        self._shown: tuple[Pose, ...] = ()
        self._nodes: list[Any] = []
        with gui.add_folder("Waypoints"):
            self._list = gui.add_html("")
            self._number = gui.add_number("number", 1, min=1, max=MAX_WAYPOINTS, step=1)
            remove = gui.add_button_group("remove", (ONE, ALL), hint="The one of that number, or all of them")
            remove.on_click(lambda event: self._remove(event.target.value))
            self._loops = gui.add_number("times", 1, min=1, max=100, step=1)
            drive = gui.add_button("Drive the waypoints", color="green", hint="Visit them in their order")
            drive.on_click(lambda _: self._drive())

    def show(self) -> None:
        """Draw what has changed."""
        waypoints = self._controls.waypoints
        if waypoints != self._shown:
            self._draw(waypoints)
        content = waypoints_html(waypoints, self._sequence.target)
        if self._list.content != content:
            self._list.content = content

    def _remove(self, which: str) -> None:
        number = int(self._number.value)
        one = which == ONE
        self._controls.post(lambda: self._controls.remove_waypoint(number) if one else self._controls.clear_waypoints())

    def _drive(self) -> None:
        loops = int(self._loops.value)
        self._controls.post(lambda: self._controls.drive_waypoints(loops))

    def _draw(self, waypoints: tuple[Pose, ...]) -> None:
        for node in self._nodes:
            node.remove()
        self._shown, self._nodes = waypoints, []
        for number, waypoint in enumerate(waypoints, 1):
            pin = add_pin(self._scene, f"{NODE}_{number}", waypoint, WAYPOINT, str(number), 0.6 * self._pin_height)
            heading = np.array([math.cos(waypoint.yaw), math.sin(waypoint.yaw), 0.0])
            ends = np.array([waypoint.position, waypoint.position + HEADING * heading])
            add_path(self._scene, f"{NODE}_{number}/heading", ends, WAYPOINT)
            self._nodes.append(pin)
        route = add_path(self._scene, f"{NODE}_route", np.array([one.position for one in waypoints]), WAYPOINT)
        if route is not None:
            self._nodes.append(route)


def waypoints_html(waypoints: tuple[Pose, ...], target: Pose | None) -> str:
    """One line for each waypoint; the one that the robot goes to is marked."""
    rows = [
        f'<div style="{"font-weight:600" if one is target else ""}">{"▶" if one is target else "·"} {number}: '
        f"{one.x:.1f}, {one.y:.1f}, {one.z:.1f} m, {math.degrees(one.yaw):.0f}°</div>"
        for number, one in enumerate(waypoints, 1)
    ]
    return f'<div style="{SMALL}">{"".join(rows) or NO_WAYPOINTS}</div>'
