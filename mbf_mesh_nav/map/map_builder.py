"""From a configuration to a mesh map with its layers.

The configuration is an ordered list of layers and a block of parameters for each::

    mesh_map:
      mesh_file: garage.ply
      repair: [zero_area]
      layers:
        - {name: border, type: border}
        - {name: slopes, type: steepness}
        - {name: sum, type: weighted_sum, inputs: [border, slopes]}
        - {name: inflation, type: inflation, inputs: [sum]}
      default_layer: inflation
      slopes: {threshold: 0.5}
      inflation: {inscribed_radius: 0.3, inflation_radius: 0.8}

Everything that is wrong with the layers is reported at once, before the mesh is read.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal, cast

import numpy as np
from numpy.typing import ArrayLike
from pydantic import field_validator

from mbf_abstract.maps.layers.layer_list import (
    LayerBlocks,
    LayerEntry,
    LayerListError,
    PlannedLayer,
    layer_loader,
    plan_layers,
)
from mbf_abstract.parameters import parameter
from mbf_mesh_nav.files.map_header import read_map_header
from mbf_mesh_nav.files.mesh_io import MAX_FACES, SPLIT_CORNERS, read_mesh
from mbf_mesh_nav.files.vertex_errors import errors_on_mesh, read_vertex_errors
from mbf_mesh_nav.map.height_error import with_height_error
from mbf_mesh_nav.map.layer import LayerContext, LayerParameters, MeshLayer
from mbf_mesh_nav.map.layer_cache import LayerCache
from mbf_mesh_nav.map.layer_graph import LayerGraph
from mbf_mesh_nav.map.map_findings import frame_findings, header_findings, map_findings
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.map.robot_outline import OutlineParameters
from mbf_mesh_nav.mesh.densify import densify
from mbf_mesh_nav.mesh.mesh_report import Finding
from mbf_mesh_nav.mesh.repair import REPAIRS, checked_mesh
from mbf_mesh_nav.mesh.topology import build_topology

JOIN, KEEP_APART = "duplicate_vertices", "-duplicate_vertices"


class MeshLayerEntry(LayerEntry):
    """One line of the ``layers`` list of a mesh map."""

    inputs: tuple[str, ...] = parameter((), "Names of the layers it reads.")

    @property
    def reads(self) -> tuple[str, ...]:
        """Its inputs."""
        return self.inputs


class MeshMapParameters(OutlineParameters):
    """Parameters of the ``mesh_map`` block, beside the blocks of the layers."""

    mesh_file: str = parameter("", "File of the mesh; empty if the mesh is given as arrays.", dynamic=False)
    mesh_part: str = parameter("", "Part of the file: path through the scene graph, or HDF5 group.", dynamic=False)
    up_axis: Literal["", "x", "y", "z"] = parameter(
        "",
        "Axis of the file that points up; empty = what the file says (COLLADA) or its format (glTF: y, others: z).",
        dynamic=False,
    )
    unit: float = parameter(
        0.0,
        "Length of the file's unit; 0 = what the file says (COLLADA), or 1.",
        unit="m",
        ge=0.0,
        le=1e6,
        dynamic=False,
    )
    max_faces: int = parameter(MAX_FACES, "Larger files are refused before they are read.", ge=1, dynamic=False)
    repair: tuple[str, ...] = parameter(
        (),
        "Defects of the mesh that may be repaired (see Mesh files). Files of formats without shared corners (STL, OBJ, "
        "DAE, glTF) get duplicate_vertices unasked; -duplicate_vertices keeps it off.",
        dynamic=False,
    )
    join_distance: float = parameter(
        0.0,
        "How far apart vertices at the boundaries of parts may be for duplicate_vertices to join them; "
        "0 = a millionth of the extent of the mesh.",
        unit="m",
        ge=0.0,
        dynamic=False,
    )
    densify: float = parameter(0.0, "Split edges longer than this; 0 = off.", unit="m", ge=0.0, dynamic=False)
    layers: tuple[MeshLayerEntry, ...] = parameter((), "The layers, in any order.", dynamic=False)
    default_layer: str = parameter("", "The layer planners and controllers see; empty = the last one.", dynamic=False)
    edge_cost_factor: float = parameter(0.0, "How much a cost of 1 lengthens an edge, in lengths.", ge=0.0, le=100.0)
    inscribed_radius: float = parameter(
        0.0,
        "Radius of the robot's inner circle; the mesh should be finer than half of it. 0 = unknown.",
        unit="m",
        ge=0.0,
    )
    max_turning_slope: float = parameter(
        0.35, "Steeper ground is not turned on in a recovery.", unit="rad", gt=0.0, le=1.5, dynamic=False
    )
    update_frequency: float = parameter(
        10.0, "How often the server updates the map.", unit="Hz", gt=0.0, le=1000.0, dynamic=False
    )
    cache_dir: str = parameter(
        "", "Folder for computed layers, relative to the configuration; empty = no cache.", dynamic=False
    )

    @field_validator("repair")
    @classmethod
    def _repairs_are_known(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        known = {*REPAIRS, KEEP_APART}
        if unknown := [name for name in names if name not in known]:
            raise ValueError(f"names of repairs ({', '.join(REPAIRS)}), not {', '.join(unknown)}")
        if {JOIN, KEEP_APART} <= set(names):
            raise ValueError(f"either {JOIN} or {KEEP_APART}")
        return names

    def repairs_for(self, file: str) -> tuple[str, ...]:
        """Names of ``REPAIRS`` to apply to a mesh from ``file``, "" for arrays: the listed ones and the format's."""
        listed = tuple(name for name in self.repair if name != KEEP_APART)
        joins = Path(file).suffix.lower() in SPLIT_CORNERS and KEEP_APART not in self.repair
        return (*listed, JOIN) if joins and JOIN not in listed else listed


def default_layers(inscribed_radius: float) -> tuple[MeshMapParameters, dict[str, dict[str, float]]]:
    """Return parameters and layer blocks for a bare mesh and a robot of ``inscribed_radius`` [m].

    Border, steepness, roughness and height steps are joined and inflated to twice the radius.
    """
    guards = ("border", "steepness", "roughness", "height_diff")
    entries = [MeshLayerEntry(name=guard, type=guard) for guard in guards]
    entries.append(MeshLayerEntry(name="lethal", type="max_combination", inputs=guards))
    entries.append(MeshLayerEntry(name="inflation", type="inflation", inputs=("lethal",)))
    blocks = {
        "steepness": {"threshold": 0.6},
        "roughness": {"threshold": 0.8},
        "height_diff": {"threshold": 0.2, "height_limit": 1.0},
        "inflation": {
            "inscribed_radius": inscribed_radius,
            "inflation_radius": 2.0 * inscribed_radius,
            "lethal_value": np.inf,
            "inscribed_value": 1.0,
            "cost_scaling_factor": 2.0,
        },
    }
    parameters = MeshMapParameters(layers=tuple(entries), edge_cost_factor=1.0, inscribed_radius=inscribed_radius)
    return parameters, blocks


def build_mesh_map(
    parameters: MeshMapParameters,
    layer_blocks: LayerBlocks | None = None,
    *,
    vertices: ArrayLike | None = None,
    faces: ArrayLike | None = None,
    frame_id: str = "map",
    load_layer: LayerLoader | None = None,
) -> MeshMap:
    """Read or take a mesh, check it, build the map and compute its layers.

    Parameters
    ----------
    layer_blocks : mapping, optional
        Layer name -> parameters, as read from the configuration or validated.
    vertices, faces : (V, 3) float, (F, 3) int, optional
        The mesh, instead of ``parameters.mesh_file``.
    frame_id : str
        Frame of the coordinates.
    load_layer : callable, optional
        Type -> class; without it the installed types.

    Raises
    ------
    LayerListError
        Unknown or duplicate names, unknown types, wrong parameters, circles: all findings in one text.
    MeshError
        The mesh cannot be read or has defects that may not be repaired.
    """
    plan = plan_mesh_layers(parameters, layer_blocks or {}, load_layer)
    file = ""
    if vertices is None or faces is None:
        file = parameters.mesh_file
        part, up_axis, unit = parameters.mesh_part, parameters.up_axis, parameters.unit
        vertices, faces = read_mesh(file, part, parameters.max_faces, up_axis=up_axis, unit=unit)
    repair = parameters.repairs_for(file)
    mesh, report = checked_mesh(vertices, faces, repair, file or "arrays", parameters.join_distance)
    if parameters.densify > 0.0:
        mesh = densify(mesh, parameters.densify, file=file or "arrays")
    mesh_map = MeshMap(build_topology(mesh), frame_id, report, parameters.inscribed_radius)
    mesh_map.footprint, mesh_map.max_turning_slope = parameters.footprint, parameters.max_turning_slope
    if plan:
        if (errors := read_vertex_errors(Path(file)) if file else None) is not None:
            mesh_map.height_errors = errors_on_mesh(errors, mesh_map.internal_to_input, mesh_map.faces)
        else:
            stated = height_error_of(file)
            plan = [replace(one, parameters=with_height_error(one.parameters, stated)) for one in plan]
        graph = compute_layers(mesh_map, plan, parameters.cache_dir)
        default = parameters.default_layer or parameters.layers[-1].name
        mesh_map.set_layers(graph, default, parameters.edge_cost_factor)
    report.findings += frame_findings(file, parameters.up_axis, parameters.unit)
    report.findings += [*header_findings(file), *map_findings(mesh_map)]
    return mesh_map


def height_error_of(file: str) -> float:
    """Standard error [m] that a map file states of all its heights; 0 for every other one, and for "" (arrays)."""
    header = read_map_header(Path(file)) if file else None
    return 0.0 if header is None else header.height_error


LayerLoader = Callable[[str], type[MeshLayer]]


def plan_mesh_layers(
    parameters: MeshMapParameters, layer_blocks: LayerBlocks, load_layer: LayerLoader | None = None
) -> list[PlannedLayer[MeshLayer]]:
    """Check the layers of a configuration and order them, inputs first; ``LayerListError`` has all findings."""
    names = [entry.name for entry in parameters.layers]

    def check(planned: PlannedLayer[MeshLayer]) -> list[str]:
        return [*_wrong_inputs(planned), *_narrower_than_robot(planned, parameters.inscribed_radius)]

    unknown_default = bool(parameters.default_layer) and parameters.default_layer not in names
    findings = [f"default_layer {parameters.default_layer!r} is not a layer"] if unknown_default else []
    try:
        plan = plan_layers(parameters.layers, layer_blocks, load_layer or layer_loader("mesh", MeshLayer), check)
    except LayerListError as error:
        findings.append(str(error))
    if findings:
        raise LayerListError("; ".join(findings))
    return plan


def _narrower_than_robot(planned: PlannedLayer[MeshLayer], robot_radius: float) -> list[str]:
    radius = getattr(planned.parameters, "inflation_radius", robot_radius)
    if radius >= robot_radius:
        return []
    least = f"inflation_radius of at least the robot's radius (mesh_map.inscribed_radius), {robot_radius:g} m"
    touched = f"else ground the robot's body touches would be free, got {radius:g} m"
    return [f"layer {planned.entry.name!r}: {least}: {touched}"]


def _wrong_inputs(planned: PlannedLayer[MeshLayer]) -> list[str]:
    entry, (least, most) = planned.entry, planned.layer_class.inputs_allowed
    if least <= len(entry.reads) <= most:
        return []
    wanted = str(least) if least == most else f"at least {least}"
    return [f"layer {entry.name!r} of type {entry.type} takes {wanted} inputs, got {len(entry.reads)}"]


def digest_of(mesh_map: MeshMap) -> str:
    """Hexadecimal SHA-256 of the mesh and, where its file states them, of the errors of its heights."""
    errors, digest = mesh_map.height_errors, mesh_map.topology.digest()
    return digest if errors is None else hashlib.sha256(digest.encode() + errors.tobytes()).hexdigest()


def compute_layers(mesh_map: MeshMap, plan: Sequence[PlannedLayer[MeshLayer]], cache_dir: str) -> LayerGraph:
    """Compute planned layers on a map, or take them from the folder ``cache_dir``; "" = no cache."""
    cache = LayerCache(cache_dir, digest_of(mesh_map)) if cache_dir else None
    complaint = ""
    layers: dict[str, MeshLayer] = {}
    for planned in plan:
        inputs = tuple(layers[name] for name in planned.entry.reads)
        name, settings = planned.entry.name, cast(LayerParameters, planned.parameters)
        surface = mesh_map.topology, mesh_map.locator
        context = LayerContext(name, *surface, settings, inputs, mesh_map.frame_id, mesh_map.height_errors)
        layer = planned.layer_class(context)
        stored = cache.load(layer) if cache and layer.cacheable else None
        if stored is not None:
            layer.replace(*stored)
        else:
            layer.recompute()
            if cache and layer.cacheable and not complaint:
                complaint = cache.store(layer)
        layers[name] = layer
    if complaint:
        text = f"layers cannot be kept in {cache_dir}: {complaint}; they are computed at every start"
        mesh_map.report.findings.append(Finding("cache", text, np.zeros(0, dtype=np.int64), harmless=True))
    return LayerGraph(list(layers.values()))
