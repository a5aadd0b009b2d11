"""What the arrays in the file of a tile must be: types, shapes, and values that the kernels can rely on.

Kernels do not check their indices, so nothing of a damaged file may pass.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

FORMAT: dict[str, tuple[Any, tuple[int | str, ...]]] = {
    "vertices": (np.float64, ("n", 3)),
    "numbers": (np.int64, ("n",)),
    "faces": (np.int32, ("m", 3)),
    "core_faces": (np.int64, (1,)),
    "normals": (np.float32, ("c", 3)),
    "offsets": (np.int32, ("c+1",)),
    "neighbours": (np.int32, ("e",)),
    "costs": (np.float32, ("L", "c")),
    "lethal": (np.bool_, ("L", "c")),
    "shared": (np.int32, ("s",)),
    "portals": (np.int64, ("p", 3)),
    "portal_of": (np.int32, ("s",)),
    "portal_costs": (np.float32, ("R", "p", "p")),
    "build": (np.uint8, (32,)),
    "values": (np.uint8, (32,)),
}
"""Type and shape of every array; a letter is the same number wherever it stands."""


def misfit(arrays: Mapping[str, NDArray[Any]]) -> str:
    """What is wrong with some or all arrays of a tile, by name: the first fault; empty if there is none."""
    return _wrong_type(arrays) or _wrong_shape(arrays) or _wrong_values(arrays) or _wrong_places(arrays)


def _wrong_type(arrays: Mapping[str, NDArray[Any]]) -> str:
    for name, values in arrays.items():
        expected = np.dtype(FORMAT[name][0])
        if values.dtype != expected:
            return f"'{name}' holds {values.dtype}, expected {expected}"
    return ""


def _wrong_shape(arrays: Mapping[str, NDArray[Any]]) -> str:
    sizes: dict[str, int] = {}
    for name, (_, letters) in FORMAT.items():
        if name not in arrays:
            continue
        shape = arrays[name].shape
        if len(shape) == len(letters):
            for letter, size in zip(letters, shape, strict=True):
                if isinstance(letter, str):
                    sizes.setdefault(letter, size)
        expected = tuple(one if isinstance(one, int) else sizes.get(one, one) for one in letters)
        if shape != expected:
            comma = "," if len(expected) == 1 else ""
            return f"'{name}' has the shape {shape}, expected ({', '.join(map(str, expected))}{comma})"
        if "c" in sizes:
            sizes["c+1"] = sizes["c"] + 1
    return ""


def _wrong_values(arrays: Mapping[str, NDArray[Any]]) -> str:
    for name in ("vertices", "normals"):
        if name in arrays and not np.isfinite(arrays[name]).all():
            return f"'{name}' holds values that are not finite"
    for name in ("costs", "portal_costs"):
        if name in arrays and not (arrays[name] >= 0.0).all():
            return f"'{name}' holds values that are negative or not a number"
    if "portals" in arrays:
        steps = np.diff(arrays["portals"], axis=0)
        first = steps[np.arange(len(steps)), (steps != 0).argmax(axis=1)]  # the first coordinate that differs
        if not (first > 0).all():
            return "'portals' does not ascend"
    return ""


def _wrong_places(arrays: Mapping[str, NDArray[Any]]) -> str:
    """Of what names places in other arrays; only where all arrays are there."""
    if len(arrays) < len(FORMAT):
        return ""
    vertices, core, faces = len(arrays["vertices"]), len(arrays["normals"]), arrays["faces"]
    if core > vertices:
        return f"'normals' has {core} rows, expected at most the {vertices} of 'vertices'"
    limits = {
        "numbers": (arrays["numbers"], 2**63 - 1),
        "faces": (faces, vertices),
        "core_faces": (arrays["core_faces"], len(faces) + 1),
        "neighbours": (arrays["neighbours"], core),
        "shared": (arrays["shared"], core),
        "portal_of": (arrays["portal_of"], len(arrays["portals"])),
    }
    for name, (values, limit) in limits.items():
        if values.size and (values.min() < 0 or values.max() >= limit):
            return f"'{name}' holds {values.min()} to {values.max()}, expected 0 to {limit - 1}"
    corners = faces[: int(arrays["core_faces"][0])]
    if corners.size and corners.max() >= core:
        return f"'faces' of the core holds 0 to {corners.max()}, expected 0 to {core - 1}"
    if not (np.diff(arrays["shared"]) > 0).all():
        return "'shared' does not ascend"
    offsets = arrays["offsets"]
    if offsets[0] != 0 or offsets[-1] != len(arrays["neighbours"]) or not (np.diff(offsets) >= 0).all():
        return "'offsets' does not ascend from 0 to the number of neighbours"
    return ""
