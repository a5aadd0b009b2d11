"""Writing maps in map_server's format, the counterpart of ``map_io``: a YAML file and a grey image beside it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import yaml
from numpy.typing import NDArray
from PIL import Image

from mbf_costmap_nav.files.map_description import (
    UNKNOWN_OCCUPANCY,
    MapDescription,
    MapError,
    MapMode,
    OccupancyArray,
    validated_description,
)
from mbf_costmap_nav.files.map_io import OccupancyMap


def save_map(
    file: Path | str,
    content: OccupancyMap,
    *,
    image_format: str = "pgm",
    mode: MapMode | str = MapMode.TRINARY,
    negate: bool = False,
    occupied_thresh: float = 0.65,
    free_thresh: float = 0.196,
) -> None:
    """Write ``file`` (YAML) and an image of the same name beside it, so that ``load_map`` gives the same map.

    Parameters
    ----------
    image_format : {"pgm", "png", "bmp"}
    mode : MapMode or its value
        Trinary keeps 0, 100 and unknown; raw keeps every value; scale keeps 0..100, and unknown only in a png.
    occupied_thresh, free_thresh : float
        In scale mode 99 exists only if ``occupied_thresh`` is a multiple of 1/255, such as 0.6.

    Raises
    ------
    MapError
        The map is empty or holds an occupancy that this mode and these thresholds cannot express, an argument is not
        legal, ``file`` has the image's name, or a file cannot be written.
    """
    file = Path(file)
    image_file = file.with_suffix(f".{image_format}")
    if image_format not in ("pgm", "png", "bmp"):
        raise MapError(image_file, f"image_format must be pgm, png or bmp, got {image_format!r}")
    if image_file == file:
        raise MapError(file, "is the name of the image; the YAML file beside it needs another one, such as .yaml")
    if content.occupancy.dtype != np.uint8 or content.occupancy.ndim != 2 or content.occupancy.size == 0:
        got = f"{content.occupancy.dtype} {content.occupancy.shape}"
        raise MapError(file, f"expected occupancies as (height, width) uint8 with at least one cell, got {got}")
    keys: dict[str, object] = {
        "image": image_file.name,
        "mode": getattr(mode, "value", mode),
        "resolution": content.resolution,
        "origin": list(content.origin),
        "negate": int(negate),
        "occupied_thresh": occupied_thresh,
        "free_thresh": free_thresh,
    }
    description = validated_description(file, keys)
    grey, opaque = _encode(image_file, content.occupancy[::-1], description)
    try:
        image = Image.fromarray(grey)
        if not opaque.all():
            image.putalpha(Image.fromarray(np.where(opaque, np.uint8(255), np.uint8(0))))
        image.save(image_file, format="PPM" if image_format == "pgm" else image_format.upper())
        file.write_text(yaml.safe_dump(keys, sort_keys=False), encoding="utf-8")
    except OSError as error:
        raise MapError(file, error.strerror or str(error)) from error


def _encode(
    file: Path, occupancy: OccupancyArray, description: MapDescription
) -> tuple[NDArray[np.uint8], NDArray[np.bool_]]:
    """Grey values that decode to ``occupancy``, and which pixels are opaque."""
    occupancy_of_grey = description.occupancy_of_grey()
    grey_of_occupancy = np.zeros(256, dtype=np.uint8)
    grey_of_occupancy[occupancy_of_grey] = np.arange(256)  # of several grey values the brightest wins
    expressible = np.isin(np.arange(256), occupancy_of_grey)
    opaque = np.ones(occupancy.shape, dtype=bool)
    if description.mode is MapMode.SCALE and file.suffix == ".png":
        opaque = occupancy != UNKNOWN_OCCUPANCY
    lost = np.setdiff1d(np.unique(occupancy[opaque]), np.flatnonzero(expressible))
    if lost.size:
        raise MapError(file, f"mode {description.mode.value} cannot express the occupancies {lost.tolist()}")
    return grey_of_occupancy[occupancy], opaque
