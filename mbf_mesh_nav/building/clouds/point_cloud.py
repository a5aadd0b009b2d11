"""Point clouds in metres with z up, near their own origin: several files as one.

Coordinates of a national grid are millions of metres. They are kept relative to an origin, so that what is stored and
computed later, in single precision too, loses no millimetre.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mbf_abstract.config.bounded_files import is_file, special_file
from mbf_abstract.config.findings import text_of
from mbf_mesh_nav.arrays import FloatArray
from mbf_mesh_nav.building.clouds.coordinate_system import given_system
from mbf_mesh_nav.building.clouds.las_points import read_las_points
from mbf_mesh_nav.building.clouds.map_projections import contradicts
from mbf_mesh_nav.building.clouds.mesh_points import MESH_ENDINGS, read_mesh_points
from mbf_mesh_nav.building.clouds.octomap_points import read_octomap_points
from mbf_mesh_nav.building.clouds.overlapping_files import disagreements
from mbf_mesh_nav.building.clouds.pcd_points import read_pcd_points
from mbf_mesh_nav.building.clouds.plausible_units import refuse_lost_digits, refuse_mixed_units, refuse_units
from mbf_mesh_nav.building.clouds.ply_points import has_faces, read_ply_points
from mbf_mesh_nav.building.clouds.run_points import read_run_points
from mbf_mesh_nav.building.clouds.stored_points import StoredPoints, refuse_count
from mbf_mesh_nav.building.clouds.text_points import read_text_points
from mbf_mesh_nav.files.elevation_files import elevation_readers
from mbf_mesh_nav.files.file_frames import FileFrame, on_the_map
from mbf_mesh_nav.mesh.mesh_report import MeshError

Reader = Callable[[Path, int], StoredPoints]
READERS: dict[str, Reader] = {
    ".ply": read_ply_points,
    ".pcd": read_pcd_points,
    ".las": read_las_points,
    ".laz": read_las_points,
    ".bt": read_octomap_points,
    ".ot": read_octomap_points,
    **dict.fromkeys((".xyz", ".txt", ".csv", ".pts"), read_text_points),
}
"""Readers by the ending of the file."""
MAX_POINTS = 50_000_000
"""Points of all files together unless the caller asks for more; each takes some hundred bytes while a map is built."""
CLEARANCE = 1.5
"""Free height [m] unless the caller needs another one."""
FAR = 10_000.0
"""Coordinates [m] beyond this are of a grid of a country: the map gets an origin of its own."""
ORIGIN_STEP = 100.0


@dataclass(frozen=True, eq=False)
class PointCloud:
    """Points [m], z up.

    Attributes
    ----------
    points : (n, 3) float64
        Relative to ``origin``.
    origin : tuple of float
        Where the map's (0, 0, 0) lies in the coordinates of the files [m]; zeros for clouds near zero.
    unit : float
        Length of the files' unit [m].
    notes : tuple of str
        What a user should know of the files.
    crs : str
        Coordinate system of the files; "" = unknown.
    """

    points: FloatArray
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    unit: float = 1.0
    notes: tuple[str, ...] = ()
    crs: str = ""


def read_clouds(
    files: Sequence[Path],
    *,
    up_axis: str = "",
    unit: float = 0.0,
    crs: str = "",
    max_points: int = MAX_POINTS,
    drop_invalid: bool = False,
    clearance: float = CLEARANCE,
    on_file: Callable[[Path], None] = lambda file: None,
) -> PointCloud:
    """Read one or several files, or folders of runs, as one cloud; their order does not matter for its coordinates.

    Parameters
    ----------
    up_axis : str
        Axis of the files that points up, "x", "y" or "z"; "" = z, for meshes as in ``files.file_frames``.
    unit : float
        Length of the files' unit [m]; 0 = as the files state, else 1.
    crs : str
        Coordinate system of all files as in ``coordinate_system.given_system``, such as "EPSG:25832"; "" = as they
        state. Nothing is transformed.
    max_points : int
        Files of more points, together, are refused before their points are read.
    drop_invalid : bool
        Leave out points that are not finite; without it they are an error.
    clearance : float
        Free height that the robot needs [m]; in lower gaps of solids, such as below a ramp, nothing is sampled.
    on_file : callable, optional
        Called with each file before it is read. What it raises ends the reading.

    Raises
    ------
    MeshError
        A file cannot be read, is given twice, holds points that are not finite, or coordinates that are no metres; or
        the files have different units or coordinate systems, or ``crs`` is none or contradicts what a file states.
    """
    system = given_system(crs)
    if not files:
        raise MeshError("point cloud", ["there is no input file"])
    parts, notes, stated = list[FloatArray](), list[str](), dict[Path, float]()
    systems = dict[str, str]()
    _refuse_twice(files)
    for file in files:
        on_file(file)
        stored, is_on_map = _read(file, max_points - sum(map(len, parts)), up_axis, unit, clearance)
        points, dropped = _finite(file, stored.points, drop_invalid)
        stated[file] = unit or stored.unit
        if stored.crs:
            systems.setdefault(stored.crs, file.name)
        refuse_lost_digits(file, points, stored.single_precision, stated[file] or 1.0)
        parts.append(points if is_on_map else on_the_map(points, FileFrame(up_axis or "z", stated[file] or 1.0)))
        refuse_mixed_units(file, parts[-1])
        notes += [f"{file.name}: {note}" for note in (*stored.notes, *dropped)]
    if len(set(stated.values())) > 1:
        text = ", ".join(f"{file.name} {f'{length:g} m' if length else 'none'}" for file, length in stated.items())
        raise MeshError("point cloud", [f"the files state different units ({text}); give one unit for all"])
    notes += _judge_systems(systems, system, crs)
    refuse_units(files, parts, is_stated=bool(stated[files[0]]))
    origin = _origin(parts)
    for part in parts:
        part -= origin
    notes += disagreements(files, parts)
    cloud = parts[0] if len(parts) == 1 else np.concatenate(parts)
    x, y, z = origin.tolist()
    return PointCloud(cloud, (x, y, z), stated[files[0]] or 1.0, tuple(notes), system or next(iter(systems), ""))


def _refuse_twice(files: Sequence[Path]) -> None:
    """Refuse a file that is given twice: its points would count twice in density, noise and errors."""
    seen = set[Path]()
    for file in files:
        if (place := file.resolve()) in seen:
            raise MeshError(str(file), ["is given twice"])
        seen.add(place)


def _judge_systems(systems: dict[str, str], given: str, crs: str) -> list[str]:
    """Refuse coordinate systems that differ or contradict the given one; notes where that is kept instead.

    ``systems`` are those that files state, each with the name of one; ``given`` is that of ``crs``, "" = none.
    """
    if not given:
        if len(systems) > 1:
            text = ", ".join(f"{name} {system}" for system, name in systems.items())
            reason = f"the files state different coordinate systems ({text})"
            raise MeshError("point cloud", [reason], "Transform them to one")
        return []
    known = given if given.startswith("EPSG:") else crs.strip()
    if against := [f"{name} {one}" for one, name in systems.items() if contradicts(one, known)]:
        text = f"the files state another coordinate system ({', '.join(against)}) than the one given ({given})"
        raise MeshError(
            "point cloud", [text], "Leave crs out, or transform the points, or correct what the files state"
        )
    return [f"{name} states {one}, the map keeps {given} as given" for one, name in systems.items() if one != given]


def _read(file: Path, max_points: int, up_axis: str, unit: float, clearance: float) -> tuple[StoredPoints, bool]:
    """Contents of a file, or of the folder of a run, and whether they are in metres with z up already."""
    if file.is_dir():
        return read_run_points(file, max_points), True
    ending = file.suffix.lower()
    if ending in elevation_readers():
        text = "expected points, got an elevation model; it is a map as it is, mbf plan and mesh_map.mesh_file read it"
        raise MeshError(str(file), [text])
    if ending not in READERS and ending not in MESH_ENDINGS:
        known = ", ".join(sorted({*READERS, *MESH_ENDINGS}))
        raise MeshError(str(file), [f"unknown ending '{file.suffix}'; known: {known}"])
    if kind := special_file(file):
        raise MeshError(str(file), [f"expected a file, got {kind}"])
    if not is_file(file):
        raise MeshError(str(file), ["there is no such file"])
    try:
        is_mesh = ending in MESH_ENDINGS or (ending == ".ply" and has_faces(file))
        if is_mesh:
            stored = read_mesh_points(file, max_points, up_axis, unit, clearance)
        else:
            stored = READERS[ending](file, max_points)
    except (OSError, MemoryError, ValueError) as error:
        if isinstance(error, MeshError):
            raise
        raise MeshError(str(file), [f"cannot be read: {text_of(error).removeprefix(f'{file}: ')}"]) from error
    refuse_count(file, len(stored.points), max_points)
    if len(stored.points) == 0:
        raise MeshError(str(file), ["there is no point in it"])
    return stored, is_mesh


def _finite(file: Path, points: FloatArray, drop_invalid: bool) -> tuple[FloatArray, list[str]]:
    """The finite points, and a note if others were left out."""
    is_finite = np.isfinite(points[:, 0]) & np.isfinite(points[:, 1]) & np.isfinite(points[:, 2])
    if is_finite.all():
        return points, []
    count, first = int((~is_finite).sum()), int(np.argmin(is_finite))
    if not drop_invalid:
        text = f"{count} of {len(points)} points are not finite, the first is point {first}"
        raise MeshError(str(file), [text], "Leave them out with --drop-invalid")
    if count == len(points):
        raise MeshError(str(file), ["no point in it is finite"])
    return points[is_finite], [f"{count} points that are not finite are left out"]


def _origin(parts: Sequence[FloatArray]) -> FloatArray:
    """Origin (3,) of the map [m]: zero, or the lower corner rounded down where an axis is far from zero."""
    lower = np.min([part.min(axis=0) for part in parts], axis=0)
    upper = np.max([part.max(axis=0) for part in parts], axis=0)
    is_far = np.maximum(np.abs(lower), np.abs(upper)) > FAR
    return np.where(is_far, np.floor(lower / ORIGIN_STEP) * ORIGIN_STEP, 0.0)
