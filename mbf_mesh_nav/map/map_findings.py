"""Warnings about a usable map: rotated files, coarse edges, all ground lethal, a robot wider than its inflation."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from mbf_mesh_nav.arrays import FloatArray
from mbf_mesh_nav.files.elevation_files import elevation_readers
from mbf_mesh_nav.files.file_frames import GLTF_FORMATS, FileFrame, file_frame
from mbf_mesh_nav.files.map_header import read_map_header
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.map.places import FORBIDDEN_COST
from mbf_mesh_nav.mesh.mesh_report import Finding

LETHAL_SHARE = 0.95
"""A map with a greater share of lethal vertices is hardly intended."""
AXES = ("x", "y", "z")
STATES_UP = (*sorted(GLTF_FORMATS), ".dae")
FACING = 0.85
"""Cosine of the angle between a normal and an axis below which a face does not look along it."""
LYING = 1.75
"""A mesh lies on its side if so many times as much of it looks along one axis as along either side of the others."""
ROOM = 8.0
"""So many inscribed radii along either side are hardly room to drive: a mesh in another unit is likelier."""
NOWHERE = np.zeros(0, dtype=np.int64)


def frame_findings(file: str, up_axis: str, unit: float) -> Iterator[Finding]:
    """One finding if a mesh file was turned or scaled; the arguments as in ``file_frame``, "" for no file."""
    if not file or Path(file).suffix.lower() in elevation_readers():
        return
    frame = file_frame(Path(file), up_axis, unit)
    if frame != FileFrame():
        text = f"the file has {frame}; it is turned and scaled to z up and metres (see up_axis and unit)"
        yield Finding("file_frame", text, NOWHERE, harmless=True)


def survey_findings(mesh_map: MeshMap, file: str) -> Iterator[Finding]:
    """One finding where the file states its survey: origin, and of a map of ``mbf map build`` its error."""
    if mesh_map.survey is None:
        return
    text = f"(0, 0, 0) of the map lies at {mesh_map.survey}"
    if (header := read_map_header(Path(file))) is not None:
        text += (
            f", whose points are {header.error_rms:.3f} m (rms) from the surface; standard error of its heights "
            f"{header.height_error:.3f} m"
        )
    yield Finding("origin", text, NOWHERE, harmless=True)


def map_findings(mesh_map: MeshMap) -> Iterator[Finding]:
    """Findings about a map whose layers are computed."""
    yield from _coarse(mesh_map)
    yield from _lethal(mesh_map)
    yield from _narrow(mesh_map)
    yield from _bodies(mesh_map)


def lying_findings(mesh_map: MeshMap, file: str, up_axis: str) -> Iterator[Finding]:
    """One finding if a mesh seems to lie on its side; none where its file or ``up_axis`` states what is up.

    Walls of a building look along x as much as along y; a floor that stands upright looks along one of them only.
    """
    stated = up_axis or not file or Path(file).suffix.lower() in (*STATES_UP, *elevation_readers())
    if stated or (mesh_map.default_layer is not None and any(True for _ in _lethal(mesh_map))):  # that one says it, too
        return
    areas, normals = _doubled_areas(mesh_map), mesh_map.face_normals
    along = [(areas[column > FACING].sum(), areas[column < -FACING].sum()) for column in normals.T]
    looking = (np.max(along, axis=1) / max(float(areas.sum()), 1e-12)).tolist()
    axis = looking.index(max(looking))
    most, beside = looking[axis], max(looking[:axis] + looking[axis + 1 :])
    if axis != 2 and most >= LYING * beside:
        text = (
            f"{most:.0%} of the surface look to one side along {AXES[axis]}, at most {looking[2]:.0%} along z: if "
            f"{AXES[axis]} is up in the file, set up_axis: {AXES[axis]}"
        )
        yield Finding("lying", text, NOWHERE, harmless=True)


def _doubled_areas(mesh_map: MeshMap) -> FloatArray:
    """Twice the area (F,) [m^2] of each face; by columns, which is four times as fast as ``np.cross`` of rows."""
    (ux, vx), (uy, vy), (uz, vz) = (
        (column[:, 1] - column[:, 0], column[:, 2] - column[:, 0])
        for column in (mesh_map.vertices[:, axis][mesh_map.faces] for axis in range(3))
    )
    return np.asarray(np.sqrt((uy * vz - uz * vy) ** 2 + (uz * vx - ux * vz) ** 2 + (ux * vy - uy * vx) ** 2))


def _narrow(mesh_map: MeshMap) -> Iterator[Finding]:
    """Findings if the layers leave ground free which the robot's body would touch.

    A tilt layer puts the whole robot onto the ground, so beside it an inflation need not keep the robot's radius.
    """
    radius, layers = mesh_map.inscribed_radius, mesh_map.layers
    if not layers or any(hasattr(layer.parameters, "wheelbase") for layer in layers.values()):
        return
    inflations = {name: one.parameters for name, one in layers.items() if hasattr(one.parameters, "inflation_radius")}
    if radius > 0.0 and not inflations:
        text = f"planners treat the robot, whose inscribed radius is {radius:g} m, as a point"
        text = f"no inflation or tilt layer: {text}"
        yield Finding("narrow", text, NOWHERE, harmless=True)
    for name, parameters in inflations.items():
        own = float(getattr(parameters, "inscribed_radius", radius))
        if own < radius:
            text = (
                f"inscribed_radius {own:g} m of layer '{name}' is less than the robot's (mesh_map.inscribed_radius), "
                f"{radius:g} m, and no tilt layer looks at the whole robot: ground its body touches may count as free"
            )
            yield Finding("narrow", text, NOWHERE, harmless=True)
        cost = float(getattr(parameters, "inscribed_value", FORBIDDEN_COST))
        if cost < FORBIDDEN_COST:
            text = (
                f"inscribed_value {cost:g} of layer '{name}' is below {FORBIDDEN_COST:g}, the usual cost_limit of "
                "planners: they pass where the robot's body touches an obstacle, and controllers stop there"
            )
            yield Finding("narrow", text, NOWHERE, harmless=True)


def _bodies(mesh_map: MeshMap) -> Iterator[Finding]:
    """One finding if parts of the mesh are closed bodies, such as walls, which are not joined to the ground below."""
    topology = mesh_map.topology
    part_of_face = topology.components[topology.faces[:, 0]]
    faces = np.bincount(part_of_face)
    at_border = np.bincount(part_of_face, weights=(topology.face_neighbours < 0).any(axis=1))
    bodies, parts = np.flatnonzero((faces > 0) & (at_border == 0)), int(np.count_nonzero(faces))
    if len(bodies) and parts > 1:
        text = (
            f"{len(bodies)} of {parts} parts are closed bodies: where one, such as a wall, stands on the ground of "
            "another one, a plan leads through it; mbf map build makes a surface that ends there"
        )
        yield Finding("bodies", text, np.flatnonzero(np.isin(topology.components, bodies)), harmless=True)


def _lethal(mesh_map: MeshMap) -> Iterator[Finding]:
    """One finding if nearly every vertex of the default layer is lethal or forbidden, with the layers that are."""
    used, default = np.diff(mesh_map.neighbour_offsets) > 0, mesh_map.default_layer
    if default is None:
        return
    closed = {name: layer.lethal[used] for name, layer in mesh_map.layers.items()}
    closed[default] = closed[default] | (mesh_map.layers[default].costs[used] >= FORBIDDEN_COST)
    shares = {name: float(of_layer.mean()) for name, of_layer in closed.items()}
    if shares[default] < LETHAL_SHARE:
        return
    guilty = ", ".join(f"{name} {share:.0%}" for name, share in shares.items() if share >= LETHAL_SHARE)
    kind = "" if mesh_map.layers[default].lethal[used].mean() >= LETHAL_SHARE else " or costs 1, the usual cost_limit"
    text = f"nearly every vertex is lethal{kind}, so nothing can be planned (layers: {guilty})"
    first, second, third = (mesh_map.vertices[mesh_map.faces[:, corner]] for corner in range(3))
    seen_along = np.abs(np.cross(second - first, third - first)).sum(axis=0)  # doubled areas in the three plan views
    length, width, _ = np.ptp(mesh_map.vertices, axis=0).tolist()
    if seen_along.argmax() != 2:
        axis = AXES[int(seen_along.argmax())]
        text += f"; most faces look along {axis}: if that is up in the file, set up_axis: {axis}"
    elif min(length, width) < ROOM * mesh_map.inscribed_radius:
        text += f"; the mesh is {length:.3g} m x {width:.3g} m, hardly room for the robot: see unit"
    indices = np.flatnonzero(used)[closed[default]]
    yield Finding("lethal", text, indices, harmless=True)


def _coarse(mesh_map: MeshMap) -> Iterator[Finding]:
    """Findings if the mesh's edges are too long for the robot's wheels or radius, or for the reach of a layer.

    A layer that stands the robot's wheels on the faces sees ledges between vertices up to a wheelbase apart; farther
    apart the robot tilts more than the layer knows. Where none does, vertices are all that is known of the ground, and
    there have to be several under a robot.
    """
    mean_edge = mesh_map.topology.mean_edge_length
    blocks = {name: layer.parameters for name, layer in mesh_map.layers.items()}
    limits = {f"the wheelbase of layer '{name}'": getattr(block, "wheelbase", 0.0) for name, block in blocks.items()}
    if not any(limits.values()):
        limits["half the inscribed radius"] = 0.5 * mesh_map.inscribed_radius
        if mesh_map.inscribed_radius == 0.0:  # then that of an inflation is all that is known of the robot
            for name, block in blocks.items():
                limits[f"half the inscribed radius of layer '{name}'"] = 0.5 * getattr(block, "inscribed_radius", 0.0)
    limits |= {f"the radius of layer '{name}'": getattr(block, "radius", 0.0) for name, block in blocks.items()}
    for what, limit in limits.items():
        if 0.0 < limit < mean_edge:
            text = (
                f"edges are {mean_edge:.3g} m long on average, more than {what} ({limit:.3g} m); "
                "layers may miss obstacles and ledges; densify helps those that look around, a finer survey all; "
                "an inscribed_radius half an edge larger than the robot's keeps it off what lies between vertices"
            )
            everywhere = np.flatnonzero(np.diff(mesh_map.neighbour_offsets) > 0)
            yield Finding("coarse", text, everywhere, harmless=True)
