"""Where a map lies in the coordinates of the survey it was made of: those of a national grid, or degrees on the earth.

A map has metres and an origin of its own, because coordinates of a national grid are too large for the numbers of a
robot. Goals of a survey are taken to the map by this, and paths back; no coordinate system is changed into another.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Survey:
    """The coordinates of a survey, along whose axes those of the map lie.

    Attributes
    ----------
    origin : tuple of float
        Where the map's (0, 0, 0) lies: x, y in units of the survey, z [m].
    units : tuple of float
        Length [m] of its unit of x and of y, on this map: 1 for metres, some 100 km for degrees.
    crs : str
        Its coordinate system, such as "EPSG:25832"; "" = unknown.
    """

    origin: tuple[float, float, float]
    units: tuple[float, float] = (1.0, 1.0)
    crs: str = ""

    def to_map(self, x: float, y: float) -> tuple[float, float]:
        """Return the place on the map [m] of a place of the survey; longitude is x, latitude y."""
        return (x - self.origin[0]) * self.units[0], (y - self.origin[1]) * self.units[1]

    def from_map(self, x: float, y: float) -> tuple[float, float]:
        """Return the place of the survey of a place on the map [m]."""
        return self.origin[0] + x / self.units[0], self.origin[1] + y / self.units[1]

    def __str__(self) -> str:
        """Say where the map lies, for notes."""
        x, y, z = self.origin
        return f"({x:.10g}, {y:.10g}, {z:.10g}) of its survey ({self.crs or 'coordinate system unknown'})"
