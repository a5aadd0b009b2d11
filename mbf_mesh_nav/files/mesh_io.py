"""Reading meshes from files: PLY, OBJ, STL, OFF, DAE, glTF through trimesh, the HDF5 layouts of lvr2, elevation models.

Whatever is wrong with a file comes out as one ``MeshError`` that names it. A file is only read, never changed.
Coordinates come out in metres with z up, whatever axis and unit the file has (``file_frames``); mesh_navigation leaves
a file's up axis alone.
"""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

from mbf_abstract.config.bounded_files import is_file
from mbf_mesh_nav.files.elevation_files import elevation_readers, read_elevation
from mbf_mesh_nav.files.file_frames import file_frame, on_the_map
from mbf_mesh_nav.files.scene_reader import MeshArrays, read_scene
from mbf_mesh_nav.mesh.mesh_report import MeshError

TRIMESH_FORMATS = frozenset({".ply", ".obj", ".stl", ".off", ".dae", ".gltf", ".glb"})
HDF5_FORMATS = frozenset({".h5", ".hdf5"})
SPLIT_CORNERS = frozenset({".stl", ".obj", ".dae", ".gltf", ".glb"})
"""Formats whose files, or readers, give faces, materials, parts or seams of a texture corners of their own."""
EXTRA_PACKAGES = {".h5": ("h5py",), ".hdf5": ("h5py",), ".dae": ("lxml", "collada")}
"""What an installation without the extra ``mesh-files`` may lack for an ending."""
MAX_FILE_BYTES = 4 * 2**30
MAX_FACES = 10_000_000


def read_mesh(
    file: str | Path, part: str = "", max_faces: int = MAX_FACES, *, up_axis: str = "", unit: float = 0.0
) -> MeshArrays:
    """Read one mesh.

    Parameters
    ----------
    file : path
        The ending decides the format.
    part : str
        Which part of the file: a path of node names through a scene graph ("building/floor_2"), the name of an OBJ
        file's object, or the group of an HDF5 file. "" and "/" mean everything, joined (HDF5: the only mesh in the
        file). Elevation models have none.
    max_faces : int
        Larger meshes are refused before anything is built from them.
    up_axis : str
        Axis of the file that points up, "x", "y" or "z"; "" = as the file or its format states.
    unit : float
        Length of the file's unit [m]; 0 = as the file states.

    Returns
    -------
    vertices : (V, 3) float64
        In the coordinates of the scene, rotated to z up [m].
    faces : (F, 3) int64

    Raises
    ------
    MeshError
        Missing, unreadable, cut off, too large, no such part, no triangle in it, or an extra is not installed.
    """
    path = Path(file)
    ending = path.suffix.lower()
    if ending not in (known := known_endings()):
        reason = f"unknown ending '{ending}'; known: {', '.join(sorted(known))}"
        raise MeshError(str(path), [reason], "Of a point cloud, mbf map build makes a mesh")
    require_packages(path, ending)
    if not is_file(path):
        raise MeshError(str(path), ["there is no such file"])
    if path.stat().st_size > MAX_FILE_BYTES:
        raise MeshError(str(path), [f"{path.stat().st_size} bytes, the limit is {MAX_FILE_BYTES}"])
    if ending in elevation_readers():
        if up_axis or unit:
            raise MeshError(str(path), ["an elevation model takes neither up_axis nor unit"])
        vertices, faces = read_elevation(path, max_faces)
    else:
        frame = file_frame(path, up_axis, unit)
        points, faces = _read_points(path, part, max_faces)
        vertices = on_the_map(points, frame)
    if len(faces) == 0:
        raise MeshError(str(path), ["there is no face in it"])
    return vertices, faces


def _read_points(path: Path, part: str, max_faces: int) -> MeshArrays:
    """Vertices in the coordinates of the file, and faces."""
    if path.suffix.lower() in HDF5_FORMATS:
        from mbf_mesh_nav.files.lvr2_io import read_lvr2_mesh  # h5py only for those who use it

        return read_lvr2_mesh(path, part, max_faces)
    return read_scene(path, part.strip("/"), max_faces)


def require_packages(path: Path, ending: str) -> None:
    """Check that what reads and writes files of an ending is installed.

    Raises
    ------
    MeshError
        It is not; the text names the extra to install.
    """
    if missing := [name for name in EXTRA_PACKAGES.get(ending, ()) if find_spec(name) is None]:
        text = f"{ending} files need {' and '.join(missing)}: pip install 'mbf-flex[mesh-files]'"
        raise MeshError(str(path), [text])


def known_endings() -> frozenset[str]:
    """Endings of the files that can be read, with their dots."""
    return TRIMESH_FORMATS | HDF5_FORMATS | frozenset(elevation_readers())
