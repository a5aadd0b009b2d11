"""Whether the robot that a configuration describes is as large as the one that a scenario simulates.

A configuration that is made for a smaller robot plans paths that its robot does not fit through.
"""

from __future__ import annotations

from collections.abc import Iterator

from mbf_abstract.geometry.arithmetic import norm
from mbf_abstract.maps.navigation_map import NavigationMap
from mbf_abstract.server.map_server import MapServer
from mbf_abstract.server.navigation_server import AbstractNavigationServer
from terrain.description.outline import footprint_radii
from terrain.urdf_robots.robot_choice import RobotChoice, spec_of

SMALLER = 0.01
"""A radius [m] that is smaller by so much is meant to be that of the robot, rounded."""


def notes_on_fit(server: AbstractNavigationServer, robot: RobotChoice) -> Iterator[str]:
    """Yield a note for each map of the server whose footprint does not hold the robot."""
    if not isinstance(server, MapServer):
        return
    spec = spec_of(robot)
    inscribed, circumscribed = footprint_radii(list(spec.footprint))
    for name, served in server.served.items():
        footprint = f"{name}: the footprint does not hold the robot {spec.name!r}: its"
        inner, outer = served.map.inscribed_radius, _circumscribed_radius(served.map)
        if 0.0 < inner < inscribed - SMALLER:
            yield f"{footprint} inscribed radius is {inner:.2f} m, that of the robot {inscribed:.2f} m"
        elif 0.0 < outer < circumscribed - SMALLER:
            yield f"{footprint} circumscribed radius is {outer:.2f} m, that of the robot {circumscribed:.2f} m"


def _circumscribed_radius(navigation_map: NavigationMap) -> float:
    """Of the outline [m]; 0 = unknown, as on a map that takes the robot for its inscribed circle."""
    return float(norm(navigation_map.robot_outline).max(initial=0.0)) if navigation_map.knows_outline else 0.0
