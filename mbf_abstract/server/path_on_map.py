"""Whether a path stays on the map: its poses, and the lines between them; and whether it is blocked."""

from __future__ import annotations

from collections.abc import Iterable

from mbf_abstract.geometry import FloatArray, Path
from mbf_abstract.geometry.transform import TransformError
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.maps.navigation_map import NavigationMap
from mbf_abstract.maps.queries import PADDED, CellState


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


def obstacle_along(maps: Iterable[NavigationMap], transforms: TransformBuffer, path: Path) -> str:
    """Where the robot would touch something on a path, on any map, or why a map cannot be asked; empty if nowhere."""
    for navigation_map in maps:
        try:
            there = transforms.transform_path(path, navigation_map.frame_id)
        except TransformError as error:
            return str(error)
        check = navigation_map.path_check(PADDED)
        for index, answer in enumerate(map(check, there)):
            if answer.state is not CellState.OUTSIDE and answer.is_blocked():
                return f"pose {index} of the path {_place(path, index)} is blocked"
    return ""


def _place(path: Path, index: int) -> str:
    x, y, z = path.positions[index].tolist()
    return f"({x:.2f}, {y:.2f}, {z:.2f})"
