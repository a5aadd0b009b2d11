"""Moving obstacles: where people and robots will be in the next seconds, and no longer where they were.

When to use: a robot among people or other robots. Let it read the obstacle layer, inflate it, and join all three::

    - {name: obstacles, type: obstacle}
    - {name: moving, type: moving_obstacles, inputs: [obstacles]}
    - {name: obstacle_inflation, type: inflation, inputs: [moving]}
    - {name: safe, type: max_combination, inputs: [inflation, obstacle_inflation, moving]}

Then what the obstacle layer keeps where a moving object was is free. When not: alone, as it marks no obstacle that
stands, nor the place where a moving one is now.
Cost: about 2 microseconds a point, and the vertices around predicted places. Known failure: what comes out behind a
corner has no velocity in its first three scans.

Points near the mesh are part of it, walls too. The others are followed on the surface below them, so people on other
storeys are other people.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry.arithmetic import norm
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.maps.tracking.moving_obstacles import (
    MovingObstacles,
    MovingObstaclesParameters,
    TrackingLayer,
)
from mbf_abstract.maps.tracking.prediction import Prediction
from mbf_abstract.parameters import parameter, with_changes
from mbf_mesh_nav.arrays import FloatArray, IntArray, sorted_once
from mbf_mesh_nav.kernels.mesh.surface_disc import vertices_in_disc
from mbf_mesh_nav.map.layer import (
    NOTHING_CHANGED,
    CostArray,
    LayerContext,
    LayerParameters,
    LethalArray,
    MeshLayer,
    in_square,
)
from mbf_mesh_nav.map.layer_graph import union_of

DOWN = np.array([0.0, 0.0, -1.0])
SURFACE_DISTANCE = 1.0
"""How far [m] a predicted place may be off the surface; farther on there is none."""
AT_VERTEX = 1e-6
"""How far [m] a vertex may be from itself on the surface: rounding."""


class MovingObstaclesLayerParameters(LayerParameters, MovingObstaclesParameters):
    """Parameters of ``moving_obstacles``."""

    robot_height: float = parameter(1.0, "Points higher above the surface are ignored.", unit="m", gt=0.0, le=100.0)
    inscribed_radius: float = parameter(
        0.3, "Added to the radius of objects: that of the robot's inner circle.", unit="m", ge=0.0, le=10.0
    )

    def for_radius(self, old: float, new: float) -> MovingObstaclesLayerParameters:
        """The radius grows or shrinks by as much as the robot."""
        return with_changes(self, {"inscribed_radius": self.inscribed_radius + new - (old or self.inscribed_radius)})


class MovingObstaclesLayer(TrackingLayer, MeshLayer):
    """Predicted places of tracked objects; what an obstacle layer has marked, without their trails."""

    Parameters = MovingObstaclesLayerParameters
    inputs_allowed = (0, 1)
    parameters: MovingObstaclesLayerParameters

    def __init__(self, context: LayerContext) -> None:
        super().__init__(context)
        self._objects = MovingObstacles(self.parameters, context.frame_id)
        self._trail = np.zeros(context.topology.vertex_count, dtype=np.bool_)
        self._prediction = np.zeros(context.topology.vertex_count, dtype=np.float32)
        self._predicted: IntArray = NOTHING_CHANGED  # vertices with a prediction
        self._left: IntArray = NOTHING_CHANGED  # vertices below moving objects in the last scan
        self._faces: IntArray = NOTHING_CHANGED  # below the points of the scan that is being taken in

    def take_over(self, old: MeshLayer) -> None:
        """Take over the objects with their sensors, and the trails on this part of the surface."""
        assert isinstance(old, MovingObstaclesLayer)
        self._objects = old._objects
        self._trail[self._same_vertices(old.topology.vertices[old._trail])] = True
        self._left = self._same_vertices(old.topology.vertices[old._left])

    def _same_vertices(self, places: FloatArray) -> IntArray:
        """Vertices, ascending, that lie at places (n, 3) of vertices of another part of the surface."""
        spots = self.locator.locate(places, AT_VERTEX)
        known = spots.faces >= 0
        corners = np.argmax(spots.barycentric[known], axis=1)
        return sorted_once(self.topology.faces[spots.faces[known], corners])

    @classmethod
    def reach(cls, parameters: Any) -> float:
        """0: without scans it predicts nothing."""
        return 0.0

    def compute(self) -> tuple[CostArray, LethalArray]:
        """The input without the trails, and the predictions."""
        if not self.parameters.clear_trails:
            self._trail.fill(False)
        return self._values(np.arange(self.topology.vertex_count, dtype=np.int32))

    def update_from_inputs(self, changed: IntArray) -> IntArray:
        """Take over the changed vertices of the input."""
        return self._renew(changed)

    def update(self, now: float) -> IntArray:
        """Follow the objects through new scans; predict where they will be, note where they were."""
        touched = [self._predicted]
        for seen in self._objects.take_in(self.parameters, self._obstacle_points):
            if self.parameters.clear_trails:
                touched.append(self._note_trail(seen.of_moving))
        self._predict(now)
        return self._renew(union_of([*touched, self._predicted]))

    def clear(self) -> IntArray:
        """Forget all objects and trails; the map is stale until every source has sent a new scan."""
        return self._forget(np.ones(self.topology.vertex_count, dtype=np.bool_), None)

    def clear_area(self, center: FloatArray, size: float, inside: bool) -> IntArray:
        """Forget objects and trails inside, or outside, a square, see ``in_square``; the map is then stale, too."""

        def within(places: FloatArray) -> NDArray[np.bool_]:
            return np.asarray(in_square(places, center, size, self.parameters.robot_height) == inside)

        return self._forget(within(self.topology.vertices), within)

    def _forget(self, area: LethalArray, within: Callable[[FloatArray], NDArray[np.bool_]] | None) -> IntArray:
        self._objects.clear(within)
        self._left = NOTHING_CHANGED
        touched = np.flatnonzero(area & (self._trail | (self._prediction > 0.0))).astype(np.int32)
        self._trail[touched], self._prediction[touched] = False, 0.0
        return self._renew(touched)

    def _values(self, vertices: IntArray) -> tuple[CostArray, LethalArray]:
        """Costs and flags (k,) of some vertices."""
        costs, lethal = self._prediction[vertices], np.zeros(len(vertices), dtype=np.bool_)
        for read in self.inputs:
            kept = ~self._trail[vertices]
            costs = np.maximum(costs, np.where(kept, read.costs[vertices], np.float32(0.0)))
            lethal = read.lethal[vertices] & kept
        return costs.astype(np.float32), lethal

    def _renew(self, vertices: IntArray) -> IntArray:
        """Bring some vertices up to date; return those that changed."""
        if not self.parameters.enabled or len(vertices) == 0:
            return NOTHING_CHANGED
        costs, lethal = self._values(vertices)
        differs = (costs != self._costs[vertices]) | (lethal != self._lethal[vertices])
        changed: IntArray = vertices[differs]
        self._costs[changed], self._lethal[changed] = costs[differs], lethal[differs]
        return changed

    def _obstacle_points(self, scan: RangeScan) -> tuple[FloatArray, NDArray[np.int64]]:
        """Places (n, 3) [m] on the surface below the points that the mesh does not explain, and the rays of these."""
        p = self.parameters
        off = np.flatnonzero(self.locator.locate(scan.ends, p.static_distance).faces < 0)
        faces, heights = self.locator.cast_rays(scan.ends[off], DOWN, p.robot_height)
        stands = faces >= 0
        rays, self._faces = off[stands], faces[stands]
        return np.asarray(scan.ends[rays] + heights[stands, None] * DOWN), rays

    def _note_trail(self, of_moving: NDArray[np.bool_]) -> IntArray:
        """Add what moving objects have left to the trail, take out what is seen now; return what may change."""
        left, here = self._left, self._corners(self._faces)
        self._left = self._corners(self._faces[of_moving])
        before = here[self._trail[here]]
        self._trail[left] = True
        self._trail[here] = False
        return union_of([left, before])

    def _corners(self, faces: IntArray) -> IntArray:
        return sorted_once(self.topology.faces[faces])

    def _predict(self, now: float) -> None:
        """Replace the predictions by those of ``now`` [s]."""
        self._prediction[self._predicted] = 0.0
        predictions = self._objects.predictions(self.parameters, self.parameters.inscribed_radius, now)
        self._predicted = union_of([self._raise_along(prediction) for prediction in predictions])

    def _raise_along(self, prediction: Prediction) -> IntArray:
        """Raise the predictions around the places where an object will be; return the vertices."""
        middles, radius, costs = prediction
        on_surface = self.locator.locate(middles, SURFACE_DISTANCE)
        if on_surface.faces[0] < 0:
            return NOTHING_CHANGED
        mesh, points = self.topology, on_surface.points
        reach = float(norm(middles[-1] - middles[0])) + radius
        start = int(mesh.faces[on_surface.faces[0], np.argmax(on_surface.barycentric[0])])
        near = vertices_in_disc(mesh.vertices, mesh.neighbour_offsets, mesh.neighbours, start, points[0], reach)
        for cost, middle in zip(costs.astype(np.float32), points, strict=True):  # NaN off the surface
            inside = near[norm(mesh.vertices[near] - middle) <= radius]
            self._prediction[inside] = np.maximum(self._prediction[inside], cost)
        return sorted_once(near[self._prediction[near] > 0.0])
