"""Dijkstra's field from the goal, and the path down its gradient (navfn's job).

When to use: where a smooth path is wanted without a smoother. When not: one far goal on a huge map, where
``costmap.astar`` settles far fewer cells.

The field is exact for the eight neighbours, so it is up to 8 % above the Euclidean distance in open space, and the
descent of its interpolated gradient takes most of that back. ``interpolated_potential`` fills it by navfn's quadratic
update instead, which is within 5 % of the Euclidean distance, the closer the farther away.
``gradient_path: false`` gives the exact 8-connected path.

Cost: about 15 ns per cell of the whole free space nearer than the start.

Formula: Dijkstra 1959; gradient descent as in navfn (Brock and Khatib 1999) with bilinear interpolation; the quadratic
update in ``kernels.search.relaxing``.
"""

from __future__ import annotations

from typing import ClassVar

from pydantic import model_validator

from mbf_abstract.geometry import Pose
from mbf_abstract.parameters import PluginParameters, parameter
from mbf_costmap_nav.planning.grid_planning import GridPlanner, Leg
from mbf_costmap_nav.planning.potential_planning import plan_down_potential
from mbf_costmap_nav.planning.search_grid import GridPlannerParameters, SearchGrid


class DijkstraParameters(GridPlannerParameters):
    """Parameters of ``costmap.dijkstra``."""

    gradient_path: bool = parameter(True, "Follow the interpolated gradient instead of the eight directions.")
    interpolated_potential: bool = parameter(False, "Fill the field by navfn's quadratic update.")

    @model_validator(mode="after")
    def _cell_path_needs_steps(self) -> DijkstraParameters:
        if self.interpolated_potential and not self.gradient_path:
            raise ValueError("interpolated_potential needs gradient_path: its field is not made of steps")
        return self


class DijkstraPlanner(GridPlanner):
    """Full-width search with a gradient path."""

    Parameters: ClassVar[type[PluginParameters]] = DijkstraParameters
    parameters: DijkstraParameters

    def search(self, grid: SearchGrid, start: Pose, goal: Pose, tolerance: float) -> Leg:
        """Propagate from the goal to the start and descend the field."""
        p = self.parameters
        potential, gradient = p.interpolated_potential, p.gradient_path
        return plan_down_potential(grid, start, goal, tolerance, interpolated=potential, gradient_path=gradient)
