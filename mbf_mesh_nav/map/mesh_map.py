"""The map of the mesh server: a surface, the layers on it, and frozen snapshots for planners and controllers.

Everything a plugin needs is an attribute here, as flat read-only arrays (``topology.MeshTopology`` describes
them), in internal numbering. The surface never changes; costs do. A plugin takes one ``snapshot()`` at the start of a
call and works on that.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.survey import Survey
from mbf_abstract.maps.avoided_places import AvoidedPlace
from mbf_mesh_nav.arrays import BoolArray, Float32Array, FloatArray, IntArray
from mbf_mesh_nav.kernels.mesh.surface_disc import vertices_in_disc
from mbf_mesh_nav.map.layer import NOTHING_CHANGED, LayerParameters, MeshLayer
from mbf_mesh_nav.map.layer_graph import LayerGraph
from mbf_mesh_nav.map.snapshot import MeshSnapshot, SnapshotSeries
from mbf_mesh_nav.map.snapshot_answers import SnapshotAnswers
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh
from mbf_mesh_nav.mesh.locate import SurfaceLocator
from mbf_mesh_nav.mesh.mesh_report import MeshReport
from mbf_mesh_nav.mesh.repair import checked_mesh
from mbf_mesh_nav.mesh.topology import MeshTopology, build_topology


class MeshMap(SnapshotAnswers):
    """A triangle mesh with layers. Construct it with ``from_arrays``, ``from_heights`` or ``map_builder``.

    Attributes
    ----------
    layers : LayerGraph
        The layers by name: ``mesh_map.layers["inflation"].costs``.
    report : MeshReport
        What was found in, and done to, the mesh when it was loaded.
    frame_id : str
        Frame of all coordinates.
    height_errors : (V,) float64, optional
        Standard errors of the heights of the vertices [m]; None if the map's file does not state them one by one.
    place_errors : (V,) float64, optional
        Those of places on the faces around the vertices [m].
    survey : Survey, optional
        Where it lies in the coordinates of its survey; None if its file does not state it.
    """

    layers: LayerGraph
    height_errors: FloatArray | None = None
    place_errors: FloatArray | None = None
    survey: Survey | None = None

    def __init__(
        self,
        topology: MeshTopology,
        frame_id: str = "map",
        report: MeshReport | None = None,
        inscribed_radius: float = 0.0,
        locator: SurfaceLocator | None = None,
    ) -> None:
        super().__init__(topology, SurfaceLocator(topology) if locator is None else locator)
        self.frame_id = frame_id
        self.inscribed_radius = inscribed_radius
        self.report = report if report is not None else MeshReport()
        self._snapshots = SnapshotSeries(topology)
        self.set_layers(LayerGraph(), None)

    @classmethod
    def from_arrays(
        cls, vertices: ArrayLike, faces: ArrayLike, frame_id: str = "map", repair: Sequence[str] = ()
    ) -> MeshMap:
        """Check a mesh and build its map, without layers (all costs 0).

        Parameters
        ----------
        vertices : (V, 3) float
            Positions [m].
        faces : (F, 3) int
            Corners, counter-clockwise seen from above.
        repair : sequence of str
            Names of the repairs that may be applied, see ``repair.REPAIRS``.

        Raises
        ------
        MeshError
            The mesh has defects no listed repair removes; lists all of them.
        """
        mesh, report = checked_mesh(vertices, faces, repair)
        return cls(build_topology(mesh), frame_id, report)

    @classmethod
    def from_heights(
        cls,
        heights: ArrayLike,
        dx: float,
        dy: float,
        x0: float = 0.0,
        y0: float = 0.0,
        frame_id: str = "map",
        repair: Sequence[str] = (),
    ) -> MeshMap:
        """Build the map of a heightfield; the surface equals that of Bullet's heightfield shape.

        Parameters
        ----------
        heights : (ny, nx) float
            z [m] at ``(x0 + ix * dx, y0 + iy * dy)``; NaN leaves a hole. Sample [iy, ix] is the caller's vertex
            ``iy * nx + ix``, with -1 in ``input_to_internal`` for holes.
        dx, dy : float
            Spacing [m].
        x0, y0 : float
            Position of ``heights[0, 0]`` [m].
        repair : sequence of str
            As in ``from_arrays``; ``non_manifold_vertices`` parts regions that touch in a sample only.

        Raises
        ------
        ValueError
            Fewer than 2 x 2 samples, or a spacing that is not positive.
        MeshError
            No three samples that make a face, see ``from_arrays``.
        """
        return cls.from_arrays(*heightfield_mesh(heights, dx, dy, x0, y0, keep_grid=True), frame_id, repair)

    # ------------------------------------------------------------------------------------------------- queries
    def snapshot(self) -> MeshSnapshot:
        """Return the current state; cheap, call it once per plan or control cycle."""
        return self._snapshot

    def changes_between(self, old_version: int, new_version: int) -> IntArray | None:
        """Vertices (k,) int32 whose cost or flag may differ between two snapshots; None if that is not remembered.

        Nor is it if the first is the newer one. The last ``snapshot.REMEMBERED_CHANGES`` changes of the layers are;
        new layers or a new edge cost factor begin anew.
        """
        if old_version > new_version:
            return None
        with self._lock:
            return self._snapshots.changes_between(old_version, new_version)

    # -------------------------------------------------------------------------------------------------- layers
    def set_layers(self, layers: LayerGraph, default_layer: str | None, edge_cost_factor: float = 0.0) -> None:
        """Put computed layers on the map.

        Parameters
        ----------
        default_layer : str or None
            The layer whose costs and flags planners see; None = free everywhere.
        edge_cost_factor : float
            How much a cost of 1 lengthens an edge, in lengths.

        Raises
        ------
        KeyError
            There is no such layer.
        """
        with self._lock:
            shown = self._shown(layers, default_layer)
            self.layers = layers
            self.default_layer = default_layer
            self.edge_cost_factor = edge_cost_factor
            self._snapshot = self._snapshots.begin(*shown, edge_cost_factor)

    def set_edge_cost_factor(self, edge_cost_factor: float) -> None:
        """Change how much costs lengthen edges, at run time.

        Raises
        ------
        ValueError
            It is negative or not finite.
        """
        if not (np.isfinite(edge_cost_factor) and edge_cost_factor >= 0.0):
            raise ValueError(f"edge_cost_factor must be a finite number of at least 0, got {edge_cost_factor}")
        self.set_layers(self.layers, self.default_layer, edge_cost_factor)

    def _replace_parameters(self, name: str, parameters: LayerParameters) -> None:
        """Give a layer its parameters; everything that depends on them follows. Raises as ``LayerGraph``'s."""
        self._publish(self.layers.set_parameters(name, parameters))

    def update(self, robot_pose: Pose | None, now: float) -> None:
        """Take in what sensors have seen since the last update, forget what is too old at ``now`` [s].

        Overrides of parameters that are over end.
        """
        self.end_overrides(now)
        self.apply(lambda layer: layer.update(now) if layer.parameters.enabled else NOTHING_CHANGED)

    def clear(self, layer_names: Iterable[str] | None = None) -> list[str]:
        """Forget all sensed obstacles, or those in some layers, at once; return the names of the layers."""
        chosen = [layer.name for layer in self.layers.forgetting(layer_names)]
        self.apply(lambda layer: layer.clear() if layer.name in chosen else NOTHING_CHANGED)
        return chosen

    def clear_area(
        self, center: Pose, size: float, layer_names: Iterable[str] | None = None, *, inside: bool = True
    ) -> list[str]:
        """Forget obstacles sensed inside, or outside, a square of side ``size`` [m] around a pose, as ``clear``."""
        chosen, middle = [layer.name for layer in self.layers.forgetting(layer_names)], np.asarray(center.position)

        def forget(layer: MeshLayer) -> IntArray:
            return layer.clear_area(middle, size, inside) if layer.name in chosen else NOTHING_CHANGED

        self.apply(forget)
        return chosen

    def take_parameters(self, parameters: Any) -> None:
        """Take over ``edge_cost_factor`` and what is known of the robot of ``MeshMapParameters``."""
        self.fit_layers(parameters.inscribed_radius)
        if parameters.edge_cost_factor != self.edge_cost_factor:
            self.set_edge_cost_factor(parameters.edge_cost_factor)
        self.inscribed_radius, self.footprint = parameters.inscribed_radius, parameters.footprint
        self.check_footprint = parameters.check_footprint

    def apply(self, event: Callable[[MeshLayer], IntArray]) -> None:
        """Give an event to every layer, see ``LayerGraph.apply``, and show plugins the map that follows."""
        with self._lock:
            self._publish(self.layers.apply(event))

    def avoid(self, places: Sequence[AvoidedPlace]) -> None:
        """Make the vertices of these discs lethal, and of no others; each disc lies on the storey of its centre."""
        closed = np.zeros(self.topology.vertex_count, dtype=np.bool_)
        for place in places:
            spot = self.locate_one(place.centre.position, place.radius)
            if spot is not None:
                graph = (self.vertices, self.neighbour_offsets, self.neighbours)
                nearest = int(self.faces[spot.face, np.argmax(spot.barycentric)])
                closed[vertices_in_disc(*graph, nearest, spot.point, float(place.radius))] = True
        with self._lock:
            changed = self._snapshots.close(closed)
            if len(changed):
                self._snapshot = self._snapshots.follow(*self._shown(self.layers, self.default_layer), changed)

    def _publish(self, changed: dict[str, IntArray]) -> None:
        """Make the snapshot that follows a change of the default layer; only edges at changed vertices are touched."""
        if self.default_layer not in changed:
            return
        self._snapshot = self._snapshots.follow(
            *self._shown(self.layers, self.default_layer), changed[self.default_layer]
        )

    def _shown(self, layers: LayerGraph, default_layer: str | None) -> tuple[Float32Array, BoolArray]:
        """Costs and lethal flags (V,) of the default layer; without one every vertex is free."""
        if default_layer is not None:
            return layers[default_layer].costs, layers[default_layer].lethal
        costs, lethal = np.zeros(self.topology.vertex_count, np.float32), np.zeros(self.topology.vertex_count, np.bool_)
        costs.flags.writeable = lethal.flags.writeable = False  # as those of a layer: kernels know one type
        return costs, lethal
