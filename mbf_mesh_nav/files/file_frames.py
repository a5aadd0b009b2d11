"""Which axis of a mesh file points up and how long its unit is; the map has z up and metres.

glTF is y up and in metres by its specification (Khronos Group, glTF 2.0, section 3.4). A COLLADA file may
state both (COLLADA 1.4.1, ``asset``); by default its y axis points up and its unit is a metre. PLY, STL, OBJ, OFF and
HDF5 files cannot state either: z up and metres is the convention of robotics, while tools of computer graphics write
y up. The configuration then states it.
"""

from __future__ import annotations

import math
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np

from mbf_mesh_nav.arrays import FloatArray
from mbf_mesh_nav.mesh.mesh_report import MeshError

GLTF_FORMATS = frozenset({".gltf", ".glb"})
COLLADA_UP = {"X_UP": "x", "Y_UP": "y", "Z_UP": "z"}
SMALLEST_UNIT, GREATEST_UNIT = 1e-6, 1e6


class FileFrame(NamedTuple):
    """Axes and unit of a file.

    Attributes
    ----------
    up_axis : str
        "x", "y" or "z".
    unit : float
        Length of one unit of the file [m].
    """

    up_axis: str = "z"
    unit: float = 1.0

    def __str__(self) -> str:
        return f"{self.up_axis} up, a unit of {self.unit:g} m"


def file_frame(path: Path, up_axis: str = "", unit: float = 0.0) -> FileFrame:
    """Axes and unit of a mesh file: the given ones, else those of the file or its format.

    Parameters
    ----------
    up_axis : str
        "x", "y" or "z"; "" = as the file states.
    unit : float
        [m]; 0 = as the file states.

    Raises
    ------
    MeshError
        The file states an invalid axis or unit.
    """
    ending = path.suffix.lower()
    if ending in GLTF_FORMATS:
        said = FileFrame("y")
    elif ending == ".dae" and not (up_axis and unit):
        said = _collada_frame(path)
    else:
        said = FileFrame()
    return FileFrame(up_axis or said.up_axis, unit or said.unit)


def on_the_map(points: FloatArray, frame: FileFrame) -> FloatArray:
    """Positions (n, 3) of a file in metres with z up.

    Nothing is mirrored. The axis that points to the viewer when the up axis points to the top of the page (COLLADA's
    "in" axis) becomes -y: what stood in front is to the south.
    """
    x, y, z = points.T
    turned = {"z": (x, y, z), "y": (x, -z, y), "x": (-y, -z, x)}[frame.up_axis]
    return np.stack(turned, axis=1) * frame.unit


def _collada_frame(path: Path) -> FileFrame:
    """Axis and unit in the first ``asset`` of a COLLADA file; only the file's beginning is read."""
    from lxml import etree

    up_axis, meter = "Y_UP", "1"
    try:
        # Entities are left alone: they could name other files, or grow without end.
        with path.open("rb") as file:
            parsed = etree.iterparse(file, tag="{*}asset", resolve_entities=False, no_network=True)
            for _, asset in islice(parsed, 1):
                up_axis = (asset.findtext("{*}up_axis") or up_axis).strip()
                unit = asset.find("{*}unit")
                meter = meter if unit is None else unit.get("meter", meter)
        length = float(meter)
    except (etree.XMLSyntaxError, ValueError) as error:
        raise MeshError(str(path), [f"cannot be read as dae: asset: {error}"]) from error
    if up_axis not in COLLADA_UP:
        known = ", ".join(COLLADA_UP)
        raise MeshError(str(path), [f"asset/up_axis: expected one of {known}, got '{up_axis:.40}'"])
    if not (math.isfinite(length) and SMALLEST_UNIT <= length <= GREATEST_UNIT):
        limits = f"{SMALLEST_UNIT:g}..{GREATEST_UNIT:g}"
        raise MeshError(str(path), [f"asset/unit: expected {limits} metres, got '{meter:.40}'"])
    return FileFrame(COLLADA_UP[up_axis], length)
