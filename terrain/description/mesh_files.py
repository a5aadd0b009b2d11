"""Files that a URDF or a scenario names: where they are, and the convex hull of a mesh."""

from __future__ import annotations

import os
from importlib.util import find_spec
from pathlib import Path
from urllib.parse import unquote, urlsplit

import numpy as np

from mbf_abstract.config.bounded_files import is_file, special_file
from mbf_abstract.geometry import FloatArray
from terrain.description.solids import Hull

MAX_BYTES = 200_000_000
FORMATS = (".stl", ".obj", ".dae", ".ply", ".glb", ".gltf", ".off")


def read_hull(name: str, urdf: Path, scale: FloatArray) -> Hull | tuple[str, str]:
    """Read the hull of a mesh, or return what was expected and what is there.

    Parameters
    ----------
    name : str
        As the URDF spells it: a path beside the URDF, ``package://NAME/...`` or ``file://...``.
    scale : (3,) float
        Factors of the coordinates; negative ones mirror.
    """
    if not name:
        return 'filename="..."', "none"
    file = find_file(name, urdf.parent)
    if file is None:
        return "a mesh file", missing_text(name, urdf.parent)
    if file.suffix.lower() not in FORMATS:
        return f"a mesh ({', '.join(FORMATS)})", f"{name!r}"
    if special_file(file) or file.stat().st_size > MAX_BYTES:
        return f"a file of at most {MAX_BYTES} bytes", f"{name!r}"
    try:
        return _hull(file, scale)
    except ImportError as error:
        return "a mesh that can be read", f"{name!r}: {error}; pip install 'mbf-flex[mesh-files]'"
    except Exception as error:  # whatever a library raises at a damaged file
        return "a sound mesh", f"{name!r}: {type(error).__name__}: {error}"


def find_file(name: str, folder: Path) -> Path | None:
    """The file that a name in a URDF means, None if there is none; ``folder`` is where relative paths begin."""
    return next((place for place in places_of(name, folder) if is_file(place)), None)


def missing_text(name: str, folder: Path) -> str:
    """Where a file was looked for that is not there."""
    looked = ", ".join(f"no file {place}" for place in places_of(name, folder))
    return f"{name!r} ({looked or f'no package {urlsplit(name).netloc!r} is known'})"


def places_of(name: str, folder: Path) -> list[Path]:
    """Where a file may be, best first.

    A package is looked for among the folders above the URDF, in ROS_PACKAGE_PATH and AMENT_PREFIX_PATH, and among
    the installed Python packages, such as ``pybullet_data``.
    """
    try:
        parts = urlsplit(name)
    except ValueError:  # a bracket without its partner, as in package://[robot/a.stl
        return [folder / name]
    if parts.scheme == "file":
        return [Path(unquote(parts.path))]
    if parts.scheme not in ("package", "model"):
        return [folder / name]
    package, inside = parts.netloc, unquote(parts.path).lstrip("/")
    above = [parent for parent in folder.absolute().parents if parent.name == package]
    above += [folder.absolute()] if folder.absolute().name == package else []
    listed = [Path(entry) for entry in os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep) if entry]
    shares = [Path(entry) / "share" for entry in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if entry]
    roots = [*above, *(parent / package for parent in (*listed, *shares)), *_python_package(package)]
    return [root / inside for root in roots]


def _python_package(name: str) -> list[Path]:
    try:
        spec = find_spec(name) if name.isidentifier() else None
    except (ImportError, ValueError):
        return []
    return [] if spec is None else [Path(place) for place in spec.submodule_search_locations or ()]


def _hull(file: Path, scale: FloatArray) -> Hull:
    import trimesh

    loaded = trimesh.load(file, force="mesh", process=False)
    vertices = np.asarray(loaded.vertices, dtype=np.float64) * scale
    if len(vertices) < 4 or not np.isfinite(vertices).all():
        raise ValueError(f"{len(vertices)} vertices" if len(vertices) < 4 else "coordinates that are not finite")
    hull = trimesh.convex.convex_hull(vertices)
    corners, faces = np.asarray(hull.vertices, dtype=np.float64), np.asarray(hull.faces, dtype=np.int32)
    return Hull(file, corners, faces)
