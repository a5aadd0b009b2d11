"""Heading-aware A*: plans where a slope may be taken straight but not sideways, and where turning has its price.

Strengths: knows the direction of slopes (limits for roll and pitch, per heading) and the turns of the path; with a
``tilt`` layer it uses the footprint settled on the surface, without one the vertex normals. The limits hold all along
the path, at the headings really driven; turns on the spot are looked at every 22.5 degrees. Known failure: drives along
edges and, with a ``tilt`` layer, straight across pairs of faces, so headings are those of the mesh (twelve on regular
grids, six without a layer), and the path zigzags in between; it never drives backward; a cost of turning too high for
the map makes it slow, because the bound that guides the search knows the roll but not the turns. Cost: some ten times
``mesh.astar`` on open terrain, up to 16 x its states around large obstacles, about 500 bytes a vertex while planning;
meant for meshes below 300 k vertices.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import ClassVar

import numpy as np

from mbf_abstract.parameters import parameter
from mbf_abstract.plugins import PlanResult
from mbf_mesh_nav.arrays import BoolArray, Float32Array
from mbf_mesh_nav.kernels.search.heading_astar import HEADINGS
from mbf_mesh_nav.layers.tilt import TiltLayer
from mbf_mesh_nav.mesh.locate import SurfacePoint
from mbf_mesh_nav.plugins import MeshContext
from mbf_mesh_nav.search.end_stretches import EndStretches, headings_within
from mbf_mesh_nav.search.heading_limits import FootprintLimits, HeadingLimits, NormalLimits
from mbf_mesh_nav.search.heading_search import HeadingSearch, PricedHeadings
from mbf_mesh_nav.search.leg_search import Leg, LegQuery, straight_leg
from mbf_mesh_nav.search.straight_line import line_over_ground
from mbf_mesh_nav.search.surface_planner import SurfacePlanner, SurfacePlannerParameters


class HeadingAStarParameters(SurfacePlannerParameters):
    """Parameters of ``mesh.heading_astar``."""

    tilt_layer: str = parameter(
        "tilt",
        "Layer of type tilt to use; empty, or if a map has none of the usual name: normals and the limits below.",
    )
    max_roll: float = parameter(0.35, "Greatest slope across the heading (without a layer).", unit="rad", gt=0.0)
    max_pitch: float = parameter(0.5, "Greatest slope along the heading (without a layer).", unit="rad", gt=0.0)
    roll_cost: float = parameter(1.0, "Extra length per length and rad of roll.", unit="1/rad", ge=0.0)
    turning_cost: float = parameter(0.1, "Extra length per rad of turning.", unit="m/rad", ge=0.0)


class HeadingAStarPlanner(SurfacePlanner):
    """Cheapest path along edges with allowed headings only."""

    Parameters = HeadingAStarParameters
    parameters: HeadingAStarParameters
    knows_headings: ClassVar[bool] = True

    _tilt_at_ends = ""
    _limits: FootprintLimits | NormalLimits | None = None

    def __init__(self, context: MeshContext) -> None:
        super().__init__(context)
        self._refuse_other_layers(self.parameters.tilt_layer)

    @cached_property
    def _search(self) -> HeadingSearch:
        """With what can be driven; made for the first plan, for a fallback may never be asked for one."""
        return HeadingSearch(self.mesh_map)

    def _refuse_other_layers(self, name: str) -> None:
        """A layer that was named on purpose, but is none of tilts, would leave slopes to the defaults unnoticed."""
        layers = self.mesh_map.layers
        usual = HeadingAStarParameters.model_fields["tilt_layer"].default
        if name and not isinstance(layers.get(name), TiltLayer) and (name in layers or name != usual):
            tilts = ", ".join(key for key, layer in layers.items() if isinstance(layer, TiltLayer)) or "none"
            raise ValueError(
                f"tilt_layer: expected the name of a layer of type tilt (of the map: {tilts}), got '{name}'"
            )

    def find_leg(self, query: LegQuery) -> Leg | None:
        """Search from the start's corners, with the robot's heading, to the goal's corners."""
        mesh_map, limits = self.mesh_map, self._current_limits()
        stretches = EndStretches(mesh_map, limits, query, self.parameters.turning_cost, self._search.graph)
        if query.start.face == query.goal.face and stretches.may_drive_straight():
            return straight_leg(mesh_map, query)
        ends = stretches.from_start(), stretches.to_goal()
        found = self._search.cheapest_path(query, limits, self._costs(), *ends)
        if found is None:
            self._tilt_at_ends = self._describe_ends(query, limits)
            return None
        chain, cost = found
        begin, end = query.start, query.goal
        first = line_over_ground(mesh_map.topology, begin.face, begin.point, mesh_map.vertices[chain[0]])
        assert first is not None  # the search begins at corners of the face, or at the ends of such lines
        positions, normals = self._search.graph.along(chain)
        positions = np.concatenate([[begin.point], first.points[1:-1], positions, [end.point]])
        faces = np.array([begin.face, *first.faces[1:]], dtype=np.int32)
        normals = np.concatenate([mesh_map.face_normals[faces], normals, mesh_map.face_normals[[end.face]]])
        return Leg(positions, normals, cost)

    def reach(self, query: LegQuery) -> Float32Array | None:
        """As for every planner; here to where the robot may also turn to a heading asked for at the goal.

        Moves that no search has looked at yet count as drivable.
        """
        limits = self._current_limits()
        from_start = EndStretches(
            self.mesh_map, limits, query, self.parameters.turning_cost, self._search.graph
        ).from_start()
        by_heading = self._search.costs_to_states(query, limits, self._costs(), from_start)
        if by_heading is None:
            return None
        headings = headings_within(query.goal_pose, query.angle_tolerance)
        if not headings:
            return np.asarray(by_heading.min(axis=1))
        may_turn = np.zeros_like(limits.allowed)
        for heading in headings:
            may_turn |= may_turn_to(limits.allowed, heading)
        return np.asarray(np.where(may_turn, by_heading, np.float32(np.inf)).min(axis=1))

    def _costs(self) -> PricedHeadings:
        return PricedHeadings(self.parameters.roll_cost, self.parameters.turning_cost)

    def _no_path(self, start: SurfacePoint, goal: SurfacePoint, blocked: BoolArray) -> PlanResult:
        """Name the tilt where it, and not a blocked vertex, makes the goal unreachable."""
        result = super()._no_path(start, goal, blocked)
        return replace(result, message=result.message + self._tilt_at_ends)

    def _describe_ends(self, query: LegQuery, limits: HeadingLimits) -> str:
        """Which of the two poses the tilt forbids, else that it may block paths in between."""
        asked = query.goal_pose if headings_within(query.goal_pose, query.angle_tolerance) else None
        ends = (("start", query.start, query.start_pose), ("goal", query.goal, asked))
        tilted = [
            f"; tilt forbids the heading {pose.yaw:.2f} rad at the {name}"
            for name, point, pose in ends
            if pose is not None and limits.standing(point, pose.yaw) > 1.0
        ]
        return "".join(tilted) or f"; tilt forbids {1.0 - float(limits.allowed.mean()):.1%} of all headings"

    def _current_limits(self) -> HeadingLimits:
        """Limits of the tilt layer, or of the vertex normals; kept while neither layer nor parameters change."""
        layer = self.mesh_map.layers.get(self.parameters.tilt_layer)
        if isinstance(layer, TiltLayer):
            if not isinstance(self._limits, FootprintLimits) or self._limits.allowed is not layer.allowed:
                self._limits = FootprintLimits(self.mesh_map, layer, self._search.graph)
            return self._limits
        angles = self.parameters.max_roll, self.parameters.max_pitch
        if not isinstance(self._limits, NormalLimits) or self._limits.angles != angles:
            self._limits = NormalLimits(self.mesh_map, *angles, self._search.graph)
        return self._limits


def may_turn_to(allowed: BoolArray, heading: int) -> BoolArray:
    """Headings (V, 16) from which the robot may turn on the spot to ``heading``: all between must be ``allowed``."""
    may_turn = np.ones_like(allowed)
    for away in range(1, HEADINGS // 2 + 1):
        for side in (1, -1):
            passed = (heading + side * (away - 1)) % HEADINGS
            following = allowed[:, passed] & may_turn[:, passed]
            # Half a turn goes left, as in the kernel.
            if away < HEADINGS // 2 or side == -1:
                may_turn[:, (heading + side * away) % HEADINGS] = following
    return may_turn
