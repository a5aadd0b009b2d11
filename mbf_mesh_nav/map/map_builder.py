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
from functools import partial
from pathlib import Path
from typing import cast

import numpy as np
from numpy.typing import ArrayLike

from mbf_abstract.maps.layers.layer_list import (
    LayerBlocks,
    LayerListError,
    PlannedLayer,
    layer_loader,
    made_layer,
    making,
    plan_layers,
)
from mbf_mesh_nav.files.map_header import read_map_header
from mbf_mesh_nav.files.mesh_io import read_mesh
from mbf_mesh_nav.files.surveys import survey_of
from mbf_mesh_nav.files.vertex_errors import errors_on_mesh, read_vertex_errors
from mbf_mesh_nav.map.height_error import with_height_error
from mbf_mesh_nav.map.layer import LayerContext, LayerParameters, MeshLayer
from mbf_mesh_nav.map.layer_cache import LayerCache
from mbf_mesh_nav.map.layer_graph import LayerGraph
from mbf_mesh_nav.map.map_findings import frame_findings, lying_findings, map_findings, survey_findings
from mbf_mesh_nav.map.map_parameters import MeshLayerEntry, MeshMapParameters
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.mesh.densify import densify
from mbf_mesh_nav.mesh.mesh_report import Finding, MeshError
from mbf_mesh_nav.mesh.repair import checked_mesh
from mbf_mesh_nav.mesh.topology import build_topology


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
    mesh_map.survey = survey_of(file)
    mesh_map.footprint, mesh_map.check_footprint = parameters.footprint, parameters.check_footprint
    mesh_map.max_turning_slope = parameters.max_turning_slope
    if plan:
        if (errors := read_vertex_errors(Path(file)) if file else None) is not None:
            on_mesh = errors_on_mesh(errors, mesh_map.internal_to_input, mesh_map.faces)
            mesh_map.height_errors, mesh_map.place_errors = on_mesh
        else:
            stated = height_error_of(file)
            plan = [replace(one, parameters=with_height_error(one.parameters, stated)) for one in plan]
        graph = compute_layers(mesh_map, plan, parameters.cache_dir)
        default = parameters.default_layer or last_with_costs(plan, parameters.layers)
        mesh_map.set_layers(graph, default, parameters.edge_cost_factor)
    report.findings += frame_findings(file, parameters.up_axis, parameters.unit)
    report.findings += [*survey_findings(mesh_map, file), *map_findings(mesh_map)]
    report.findings += lying_findings(mesh_map, file, parameters.up_axis)
    return mesh_map


def last_with_costs(plan: Sequence[PlannedLayer[MeshLayer]], listed: Sequence[MeshLayerEntry]) -> str:
    """Name of the last listed layer that has costs, of the last one if none has."""
    without = {planned.entry.name for planned in plan if not planned.layer_class.has_costs}
    return next((one.name for one in reversed(listed) if one.name not in without), listed[-1].name)


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
    digest, stated = mesh_map.topology.digest(), (mesh_map.height_errors, mesh_map.place_errors)
    content = b"".join(errors.tobytes() for errors in stated if errors is not None)
    return hashlib.sha256(digest.encode() + content).hexdigest() if content else digest


def compute_layers(mesh_map: MeshMap, plan: Sequence[PlannedLayer[MeshLayer]], cache_dir: str) -> LayerGraph:
    """Compute planned layers on a map, or take them from the folder ``cache_dir``; "" = no cache."""
    cache = LayerCache(cache_dir, digest_of(mesh_map)) if cache_dir else None
    complaint = ""
    layers: dict[str, MeshLayer] = {}
    for planned in plan:
        inputs = tuple(layers[name] for name in planned.entry.reads)
        name, settings = planned.entry.name, cast(LayerParameters, planned.parameters)
        surface, errors = (mesh_map.topology, mesh_map.locator), (mesh_map.height_errors, mesh_map.place_errors)
        context = LayerContext(name, *surface, settings, inputs, mesh_map.frame_id, *errors)
        layer = made_layer(name, partial(planned.layer_class, context), passing=(MeshError,))
        with making(name, passing=(MeshError,)):
            stored = cache.load(layer) if cache and layer.cacheable else None
            if stored is not None:
                layer.replace(*stored)
            else:
                layer.recompute()
        if stored is None and cache and layer.cacheable and not complaint:
            complaint = cache.store(layer)
        layers[name] = layer
    if complaint:
        text = f"layers cannot be kept in {cache_dir}: {complaint}; they are computed at every start"
        mesh_map.report.findings.append(Finding("cache", text, np.zeros(0, dtype=np.int64), harmless=True))
    return LayerGraph(list(layers.values()))
