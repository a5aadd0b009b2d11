"""Whether a path stays on the map: its poses, and the lines between them."""

from __future__ import annotations

from mbf_abstract.geometry import FloatArray, Path
from mbf_abstract.maps.navigation_map import NavigationMap


def path_problem(navigation_map: NavigationMap, path: Path, positions: FloatArray) -> str:
    """Where a path leaves the map that plans are made on; empty if it does not, or the map does not know.

    ``positions`` (n, 3) [m] are those of the path in the frame of the map.
    """
    index = navigation_map.first_outside(positions)
    if index >= 0:
        return f"pose {index} of the path {_place(path, index)} is outside the map"
    index = navigation_map.first_line_outside(positions)
    if index < 0:
        return ""
    before, after = (f"{i} {_place(path, i)}" for i in (index, index + 1))
    return f"the path leaves the map between its poses {before} and {after}"


def _place(path: Path, index: int) -> str:
    x, y, z = path.positions[index].tolist()
    return f"({x:.2f}, {y:.2f}, {z:.2f})"
