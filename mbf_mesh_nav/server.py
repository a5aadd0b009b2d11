"""The mesh server: the actions of Move Base Flex on a 3D triangle mesh.

One map for everything: planners, controllers and recoveries share it and work on its snapshots. The configuration has
one section, ``mesh_map`` (see ``map_builder``); plugin types are looked for with the prefix ``mesh.``.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar, cast

import numpy as np

from mbf_abstract.config.bounded_files import configured_file
from mbf_abstract.config.configuration import Config
from mbf_abstract.event_values import error_text
from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Path as PlannedPath
from mbf_abstract.geometry.survey import Survey
from mbf_abstract.maps.layers.layer_list import LayerListError
from mbf_abstract.maps.served_map import ServedMap
from mbf_abstract.maps.view import FieldView, MeshView
from mbf_abstract.parameters import ParameterModel
from mbf_abstract.plugins import PluginContext, PluginKind
from mbf_abstract.server.map_server import MapServer
from mbf_abstract.server.plugin_host import ServerError
from mbf_mesh_nav.files.mesh_io import known_endings, read_mesh, require_packages
from mbf_mesh_nav.map.ground import ground_heights
from mbf_mesh_nav.map.map_builder import build_mesh_map
from mbf_mesh_nav.map.map_parameters import MeshMapParameters
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.map.robot_outline import changes_of_radius
from mbf_mesh_nav.mesh.mesh_report import SHOWN_INDICES
from mbf_mesh_nav.motion.vector_field import VectorField
from mbf_mesh_nav.plugins import MeshContext

BARE_MESH = """\
backend: mesh
planner_max_retries: 0
planner_patience: 60.0
planners:
  - {{name: dijkstra, type: dijkstra}}
  - {{name: astar, type: astar}}
  - {{name: cvp, type: cvp}}
refiners:
  - {{name: string_pulling, type: string_pulling}}
plan_refiner: string_pulling
mesh_map:
  mesh_file: {file}
  repair: [duplicate_vertices, zero_area, duplicate_faces, non_manifold, non_manifold_vertices, unreferenced]
  inscribed_radius: 0.3
  edge_cost_factor: 1.5
  default_layer: safe
  layers:
    - {{name: border, type: border}}
    - {{name: steepness, type: steepness}}
    - {{name: height_diff, type: height_diff}}
    - {{name: lethal, type: max_combination, inputs: [border, steepness, height_diff]}}
    - {{name: inflation, type: inflation, inputs: [lethal]}}
    - {{name: roughness, type: roughness}}
    - {{name: effort, type: weighted_sum, inputs: [steepness, roughness, height_diff]}}
    - {{name: safe, type: max_combination, inputs: [inflation, effort]}}
  border: {{threshold: 0.5}}
  steepness: {{threshold: 0.7, combination_weight: 0.6}}
  height_diff: {{threshold: 0.2, height_limit: 1.0, combination_weight: 0.25}}
  roughness: {{threshold: 3.0, combination_weight: 0.4}}
  inflation: {{inscribed_radius: 0.3, inflation_radius: 0.6, lethal_value: .inf}}
"""


class MeshNavigationServer(MapServer):
    """Navigation on one triangle mesh."""

    backend: ClassVar[str] = "mesh"
    map_type = MeshMap
    config_sections: ClassVar[Mapping[str, type[ParameterModel]]] = {"mesh_map": MeshMapParameters}
    car_controllers: ClassVar[Sequence[str]] = ("mesh.mppi with motion_model: ackermann",)

    read_mesh = staticmethod(read_mesh)
    """The reader of mesh files, for packages that know this one by its server only."""

    @property
    def mesh_map(self) -> MeshMap:
        """The map of the moment."""
        mesh_map: MeshMap = self.served["mesh_map"].map
        return mesh_map

    def serve_maps(self, config: Config) -> Iterator[ServedMap[Any]]:
        """Read the mesh and compute its layers."""
        parameters = cast(MeshMapParameters, config.sections["mesh_map"].parameters)
        mesh_map = self._build_map(config, mesh_file=None)
        yield ServedMap(mesh_map, self.runtime, "mesh_map", parameters, parameters.update_frequency)
        self._report_findings()

    def footprint_changes(self, footprint: str | Sequence[Sequence[float]] | float) -> Mapping[str, Any]:
        """The radius of the disc that stands for the robot; the radii of layers change by as much."""
        return {**changes_of_radius(footprint), "check_footprint": False}

    def swap_mesh(self, mesh_file: Path | str) -> None:
        """Drive on another mesh from now on, e.g. after the lift; its layers are those of the configuration.

        Sensed obstacles and changes of parameters of map and layers at run time are gone with the old map; plugins keep
        theirs.

        Parameters
        ----------
        mesh_file : path
            Absolute, or relative to the configuration.

        Raises
        ------
        MeshError
            The mesh cannot be read or has defects that may not be repaired; the old map stays.
        ServerError
            A goal is using a plugin, or a plugin does not take the new map; the old map stays.
        """
        served, new_map = self.served["mesh_map"], self._build_map(self.config, mesh_file)
        old_map = served.map
        loaded = [(kind, plugin) for kind in PluginKind for plugin in self.plugins.all_of(kind)]
        held = [plugin for _, plugin in loaded if plugin.acquire(self, lambda: True)]
        try:
            if busy := [plugin.name for _, plugin in loaded if plugin not in held]:
                raise ServerError(f"the mesh cannot be swapped while {', '.join(busy)} is in use")
            served.map = new_map
            try:
                specs = [(kind, replace(one.spec, parameters=one.instance.parameters)) for kind, one in loaded]
                renewed = [(kind, self._construct(spec)) for kind, spec in specs]
            except (Exception, SystemExit) as error:
                served.map = old_map
                text = f"{type(error).__name__}: {error_text(error)}"
                raise ServerError(f"a plugin does not take {mesh_file}: {text}") from error
            for kind, plugin in renewed:
                self.plugins.replace(kind, plugin)
            served.parameters = self.config.sections["mesh_map"].parameters
            self.map_notes.forget()
            self._report_findings()
            served.report_configuration_warnings(anew=True)
        finally:
            for plugin in held:
                plugin.release(self)
        for plugin in held:
            plugin.retire()  # goals that waited for the old instance end: it is gone

    def save_map(self, file: Path | str, layout: str = "mesh_io") -> None:
        """Write the mesh with the present costs of all layers, as an HDF5 file that mesh_navigation reads.

        Parameters
        ----------
        file : path
            Absolute, or relative to the configuration; it must not exist yet.
        layout : str
            "mesh_io", or "channels" for programs built with lvr2 of before December 2024.

        Raises
        ------
        MeshError
            The file exists or cannot be written, or h5py is not installed; no part of one is left.
        """
        require_packages(Path(file), ".h5")
        from mbf_mesh_nav.files.lvr2_io import write_lvr2_map  # h5py only for those who use it

        write_lvr2_map(self.config.path.parent / file, self.mesh_map, layout)
        self.runtime.events.emit(EventKind.MAP, "mesh_map", message=f"the map was saved to {file}")

    def _report_findings(self) -> None:
        """One event for everything that was found in, or done to, the mesh of the map."""
        for found in self.mesh_map.report.findings:
            facts = {"finding": found.name, "count": found.count, "repaired": found.repaired}
            indices = found.indices[:SHOWN_INDICES]
            self.runtime.events.emit(EventKind.MAP, "mesh_map", message=str(found), indices=indices, **facts)

    def _build_map(self, config: Config, mesh_file: Path | str | None) -> MeshMap:
        """Read the mesh, the configured one without ``mesh_file``, and compute its layers."""
        section = config.sections["mesh_map"]
        parameters = cast(MeshMapParameters, section.parameters)
        folder = config.path.parent
        places = {"mesh_file": str(configured_file(folder, mesh_file or parameters.mesh_file))}
        if parameters.cache_dir:
            places["cache_dir"] = str(configured_file(folder, parameters.cache_dir))
        layer_classes: dict[str, Any] = {layer.type_name: layer.layer_class for layer in section.layers}
        try:
            return build_mesh_map(
                parameters.model_copy(update=places),
                {layer.name: cast(Any, layer.parameters) for layer in section.layers},
                frame_id=config.parameters.global_frame,
                load_layer=layer_classes.__getitem__,
            )
        except LayerListError as error:
            raise LayerListError(f"{config.path}: mesh_map: {error}") from error

    def make_context(self, kind: PluginKind, options: Mapping[str, Any], base: PluginContext) -> PluginContext:
        """Add the mesh map."""
        transforms = self.runtime.transforms
        return MeshContext(**vars(base), navigation_map=self.mesh_map, transforms=transforms, scans=self.scans)

    def ground_heights(self, x: float, y: float) -> tuple[float, ...]:
        """Heights [m] of all surfaces at a place x, y [m], the lowest free one first; see ``ground.ground_heights``."""
        return ground_heights(self.mesh_map, x, y)

    @property
    def survey(self) -> Survey | None:
        """That of the mesh's file."""
        return self.mesh_map.survey

    map_view_type = MeshView

    @property
    def map_views(self) -> tuple[str, ...]:
        """Names of the layers, the default layer first."""
        return tuple(sorted(self.mesh_map.layers, key=lambda name: name != self.mesh_map.default_layer))

    def map_view(self, name: str = "") -> MeshView:
        """The mesh with the costs of a layer, of the default layer without a name."""
        source = self.mesh_map.layers[name] if name else self.mesh_map.snapshot()
        costs = np.where(source.lethal, np.inf, source.costs).astype(np.float32)
        shown = name or self.mesh_map.default_layer
        unit = self.mesh_map.layers[shown].unit if shown else ""
        return MeshView(self.mesh_map.vertices, self.mesh_map.faces, costs, unit)

    def field_view(self, path: PlannedPath) -> FieldView | None:
        """Directions at the vertices from which the path's first vector field leads to its goal."""
        fields = path.guidance if isinstance(path.guidance, tuple) else ()
        if not (fields and isinstance(fields[0], VectorField)):
            return None
        leads = np.isfinite(fields[0].distances) & fields[0].directions.any(axis=1)
        return FieldView(self.mesh_map.vertices[leads], fields[0].directions[leads])

    @classmethod
    def config_for_map(cls, file: Path, unknown_is_free: bool = True) -> str | None:
        """Take every mesh format this package reads."""
        return BARE_MESH.format(file=json.dumps(str(file))) if file.suffix.lower() in known_endings() else None
