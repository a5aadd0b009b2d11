"""Refuses coordinates that no map in metres has: of another unit, of degrees, of digits lost, of places far apart."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from mbf_mesh_nav.arrays import FloatArray
from mbf_mesh_nav.mesh.mesh_report import MeshError

COARSEST_STEP = 0.005
"""Distance [m] of neighbouring four-byte floats above which a file has lost what a map needs."""
SHORTEST, LONGEST = 1.0, 50_000.0
"""Extents [m] of a plausible map."""
SAME_UNIT_RATIO = 200.0
"""Extents of two files of one map that differ by more are hardly in the same unit."""
MIXED_SHARE, RING_SHARE = 0.05, 0.01
"""Of a file that mixes units: least share of its points in either unit, greatest share around those of the larger."""


def refuse_lost_digits(file: Path, points: FloatArray, single_precision: bool, unit: float) -> None:
    """Refuse coordinates of a national grid in four-byte floats: a neighbour is half a metre away there."""
    if not single_precision:
        return
    largest = float(np.abs(points).max())
    step = float(np.spacing(np.float32(largest))) * unit
    if step > COARSEST_STEP:
        text = f"coordinates of {largest:.0f} in four-byte floats are only {step:.2g} m exact"
        raise MeshError(str(file), [text], "Export them as double, or with an offset")


def refuse_mixed_units(file: Path, points: FloatArray) -> None:
    """Refuse a file with points in metres and in millimetres: those in metres lie in one spot of all, as low as small.

    The spot is three cells wide, each one ``SAME_UNIT_RATIO``th of the extent, with hardly a point around it; the other
    points are as many times higher. A dense scan in a wide survey has neither.
    """
    lower = points[:, :2].min(axis=0)
    extent = float(np.ptp(points[:, :2], axis=0).max())
    if extent < SAME_UNIT_RATIO * SHORTEST:
        return
    side, columns = extent / SAME_UNIT_RATIO, int(SAME_UNIT_RATIO) + 1
    cells = np.minimum((points[:, :2] - lower) / side, SAME_UNIT_RATIO).astype(np.int32)
    counts = np.bincount(cells[:, 0] * columns + cells[:, 1], minlength=columns * columns)
    distances = np.abs(cells - np.divmod(int(counts.argmax()), columns)).max(axis=1)
    in_spot = distances <= 1
    share, around = float(in_spot.mean()), float((distances <= 4).mean())
    if not MIXED_SHARE <= share <= 1.0 - MIXED_SHARE or around - share > RING_SHARE:
        return
    heights = [float(np.ptp(np.percentile(points[chosen, 2], (10.0, 90.0)))) for chosen in (in_spot, ~in_spot)]
    if heights[1] >= SAME_UNIT_RATIO * heights[0]:
        text = f"{share:.0%} of its points lie within {3.0 * side:.3g} m, the others are up to {extent:.6g} m apart"
        raise MeshError(str(file), [f"expected one unit, {text}"], "Bring all of its points to metres first")


def refuse_units(files: Sequence[Path], parts: Sequence[FloatArray], is_stated: bool) -> None:
    """Refuse extents that no map in metres has."""
    extents = [float(max(np.ptp(part[:, 0]), np.ptp(part[:, 1]))) for part in parts]
    shortest, longest = int(np.argmin(extents)), int(np.argmax(extents))
    if extents[longest] > SAME_UNIT_RATIO * max(extents[shortest], SHORTEST):
        text = (
            f"{files[longest].name} is {extents[longest]:.6g} m long, {files[shortest].name} {extents[shortest]:.6g} m"
        )
        raise MeshError("point cloud", [f"the files probably have different units: {text}"])
    _refuse_far_apart(files, parts)
    lower = np.min([part.min(axis=0) for part in parts], axis=0)
    upper = np.max([part.max(axis=0) for part in parts], axis=0)
    length, height = float(max(upper[:2] - lower[:2])), float(upper[2] - lower[2])
    size = f"{upper[0] - lower[0]:.6g} x {upper[1] - lower[1]:.6g} x {height:.6g} m"
    if sum(map(len, parts)) == 1:
        raise MeshError(str(files[0]), ["there is a single point in it, of which no map can be made"])
    if length == 0.0:
        raise MeshError(str(files[0]), ["all of its points lie at one place in the plan view"])
    if is_degrees(lower, upper) and height > 10.0 * length:
        raise MeshError(str(files[0]), [f"x and y look like degrees ({size}); project them to metres first"])
    if not is_stated and length > LONGEST:
        text = f"in metres it is {size}: its unit is probably not the metre"
        raise MeshError(str(files[0]), [text], "Give the unit, e.g. --scale 0.001 for millimetres")
    if length < SHORTEST:
        hint = "" if is_stated else "If its unit is not the metre, give it with --scale"
        raise MeshError(str(files[0]), [f"it is only {size}, too small for a map"], hint)


def _refuse_far_apart(files: Sequence[Path], parts: Sequence[FloatArray]) -> None:
    """Refuse a file that lies beyond ``LONGEST`` from every other one, as in another coordinate system."""
    if len(parts) < 2:
        return
    lower = np.array([part[:, :2].min(axis=0) for part in parts])
    upper = np.array([part[:, :2].max(axis=0) for part in parts])
    for number, file in enumerate(files):
        gaps = np.maximum(lower - upper[number], lower[number] - upper).max(axis=1)
        gaps[number] = np.inf
        nearest = int(np.argmin(gaps))
        if gaps[nearest] > LONGEST:
            text = f"{file.name} lies {gaps[nearest]:.6g} m from {files[nearest].name}, expected at most {LONGEST:g} m"
            hint = "They probably differ in coordinate system or unit"
            raise MeshError("point cloud", [text], hint)


def is_degrees(lower: FloatArray, upper: FloatArray) -> bool:
    """Whether the bounds (3,) could be longitudes and latitudes of one region."""
    return bool(np.abs([lower[0], upper[0]]).max() <= 180.0 and np.abs([lower[1], upper[1]]).max() <= 90.0)
