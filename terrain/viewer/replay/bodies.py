"""What moves in a replay, as triangles in its own frame: robots with their wheels, people, doors."""

from __future__ import annotations

from typing import Any

import numpy as np

from mbf_abstract.geometry import FloatArray
from terrain.recording.actor_track import ActorTrack
from terrain.recording.recorded_robot import RobotShape
from terrain.viewer.pictures.colours import ACTORS, OBSTACLE, WHEEL, Colour
from terrain.viewer.pictures.shapes import prism, robot_body
from terrain.viewer.replay.packing import Packer
from terrain.worlds.surface import Surface, cylinder

SPOKE: Colour = (170, 170, 175)
SPOKE_OUTLINE = np.array([(-0.75, -0.15), (0.75, -0.15), (0.75, 0.15), (-0.75, 0.15)])  # of the radius
NO_WHEEL = -1
ARROW = np.array([(0.35, -0.22), (0.85, 0.0), (0.35, 0.22)])  # m; on the floor before a person
EYES = np.array([(0.05, -0.16), (0.27, -0.12), (0.27, 0.12), (0.05, 0.16)])


def robot_parts(packer: Packer, shape: RobotShape, colour: Colour) -> list[dict[str, Any]]:
    """Body, a mark on top that points ahead, and wheels with a light spoke, so that one sees them turn."""
    top = shape.height
    ahead = np.array([0.6 * shape.footprint[:, 0].max(), 0.0])
    nose = prism(shape.footprint * np.array([0.25, 0.5]) + ahead, top, top + 0.03)
    parts = [_part(packer, robot_body(shape), colour), _part(packer, nose, WHEEL)]
    radius, width = shape.wheel_radius, 0.64 * shape.wheel_radius
    drum = cylinder(radius, width, 16)
    spoke = prism(radius * SPOKE_OUTLINE, -0.52 * width, 0.52 * width)
    for number, centre in enumerate(shape.wheels):
        parts.append(_part(packer, _on_axle(drum, centre), WHEEL, number))
        parts.append(_part(packer, _on_axle(spoke, centre), SPOKE, number))
    return parts


def actor_parts(packer: Packer, track: ActorTrack) -> list[dict[str, Any]]:
    """Its recorded surface; a person with a face and an arrow on the floor where it looks."""
    colour = ACTORS.get(track.thing, OBSTACLE)
    parts = [_part(packer, Surface(track.vertices, track.faces), colour)]
    if track.thing == "person" and len(track.vertices):
        foot, head = track.vertices[:, 2].min(), track.vertices[:, 2].max()
        parts.append(_part(packer, prism(ARROW, foot + 0.02, foot + 0.05), colour))
        parts.append(_part(packer, prism(EYES, head - 0.3, head - 0.1), WHEEL))
    return parts


def _on_axle(surface: Surface, centre: FloatArray) -> Surface:
    """A surface about the z axis turned so that it lies about an axle through ``centre`` along y."""
    x, y, z = surface.vertices.T
    return Surface(np.column_stack([x, z, -y]) + centre, surface.faces)


def _part(packer: Packer, surface: Surface, colour: Colour, wheel: int = NO_WHEEL) -> dict[str, Any]:
    corners = surface.vertices[surface.faces].reshape(-1, 3)
    return {"corners": packer.add_milli(corners), "colour": colour, "wheel": wheel}
