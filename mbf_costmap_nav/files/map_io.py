"""Maps on disk in map_server's format: a YAML file that describes a grey image (pgm, png or bmp).

Reading turns every grey value into an occupancy (see ``map_description``). Image rows run from top to bottom, map rows
from bottom to top. The channels of an image are averaged, then rounded: in mode trinary those of colour and opacity,
if there is one, as in map_server; else those of colour alone. In mode scale a pixel that is not opaque is unknown.

Origins with a yaw are kept in ``OccupancyMap``. A ``Costmap`` has axes parallel to its frame, so ``to_costmap``
resamples such a map onto the smallest axis-aligned grid around it (see ``rotated_map``).

A bad file raises one ``MapError`` that names the file and the reason. The number of cells, also of the axis-aligned
grid, is checked against a limit before memory is allocated.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from mbf_abstract.config.bounded_files import is_there, special_file
from mbf_abstract.config.findings import describe_value
from mbf_abstract.config.yaml_source import load_yaml
from mbf_costmap_nav.files.map_description import (
    OCCUPIED,
    UNKNOWN_OCCUPANCY,
    MapDescription,
    MapError,
    MapMode,
    OccupancyArray,
    read_description,
    validated_description,
)
from mbf_costmap_nav.grid.costmap import FREE, LETHAL, MAX_CELLS, UNKNOWN, Costmap
from mbf_costmap_nav.grid.rotated_map import axis_aligned_shape, rotated_to_axes

IMAGE_SUFFIXES = {".pgm", ".png", ".bmp"}
DESCRIPTION_SUFFIXES = {".yaml", ".yml"}
BARE_IMAGE_RESOLUTION = 0.05  # m, what most map makers use
IMAGE_FORMATS = ("PPM", "PNG", "BMP")
"""Formats that Pillow may try; for some of its other formats it starts external programs."""
GREY_MODES = {"1", "L", "LA", "P", "RGB", "RGBA"}
"""Pillow's names of the 8-bit pixel layouts we read."""


@dataclass(frozen=True, eq=False)
class OccupancyMap:
    """A map file's content, bottom row first.

    Attributes
    ----------
    occupancy : (height, width) uint8
        0 free .. 100 occupied, 255 unknown; any value in mode raw.
    resolution : float
        Side of a cell [m].
    origin : (x, y, yaw)
        Pose [m, m, rad] of the lower-left corner of cell (0, 0).
    """

    occupancy: OccupancyArray
    resolution: float
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def axis_aligned(self, max_cells: int = MAX_CELLS) -> OccupancyMap:
        """Return the same map with yaw 0, resampled if it has a yaw.

        Raises
        ------
        ValueError
            The smallest axis-aligned grid around it has more than ``max_cells`` cells.
        """
        x, y, yaw = self.origin
        if math.remainder(yaw, 2.0 * math.pi) == 0.0:
            return self
        occupancy, (dx, dy) = rotated_to_axes(self.occupancy, yaw, max_cells)
        return OccupancyMap(occupancy, self.resolution, (x + dx * self.resolution, y + dy * self.resolution, 0.0))

    def to_costmap(
        self,
        frame_id: str = "map",
        track_unknown_space: bool = True,
        max_cells: int = MAX_CELLS,
        *,
        lethal_threshold: int = OCCUPIED,
        trinary: bool = False,
    ) -> Costmap:
        """Costs of the map: occupied is lethal, free is free, anything between is scaled to 1..253.

        In mode raw all values from 100 to 254 are occupied, as for costmap_2d.

        Parameters
        ----------
        frame_id : str
            Frame the map's origin is given in.
        track_unknown_space : bool
            Keep unknown cells unknown; otherwise they become free.
        max_cells : int
            As for ``axis_aligned``, whose ValueError it raises.
        lethal_threshold : int
            Occupancy from which on a cell is occupied, 1 to 100.
        trinary : bool
            Take what lies below the threshold for free.
        """
        table = np.full(256, UNKNOWN if track_unknown_space else FREE, dtype=np.uint8)
        below = np.arange(lethal_threshold) * LETHAL // lethal_threshold
        table[:lethal_threshold] = FREE if trinary else below
        table[lethal_threshold:UNKNOWN_OCCUPANCY] = LETHAL
        flat = self.axis_aligned(max_cells)
        return Costmap(table[flat.occupancy], flat.resolution, flat.origin[0], flat.origin[1], frame_id)


def load_map(file: Path | str, max_cells: int = MAX_CELLS, *, confined: bool = False) -> OccupancyMap:
    """Read a map_server YAML file and the image it names, or a bare image.

    A bare image is described by the YAML file of the same name beside it; without one its cells have
    ``BARE_IMAGE_RESOLUTION`` and its lower left corner is the origin.

    Parameters
    ----------
    confined : bool
        Refuse an image outside the YAML file's folder; for files from untrusted sources.

    Raises
    ------
    MapError
        Either file is invalid, or the map has more than ``max_cells`` cells.
    """
    file = Path(file)
    if file.suffix.lower() in IMAGE_SUFFIXES:
        if not file.with_suffix(".yaml").is_file():
            return load_image(file, BARE_IMAGE_RESOLUTION, max_cells=max_cells)
        file = file.with_suffix(".yaml")
    elif file.suffix.lower() not in DESCRIPTION_SUFFIXES:
        known = ", ".join(sorted(DESCRIPTION_SUFFIXES | IMAGE_SUFFIXES))
        raise MapError(file, f"expected a map of map_server or an image ({known}), got '{file.suffix}'")
    description = read_description(file)
    image = file.parent / description.image
    if confined and not _lies_in(image, file.parent):
        got = describe_value(description.image)
        raise MapError(file, f"image: expected a file in the folder of the map (confine_images), got {got}")
    if not is_there(image):
        finding = load_yaml(file).finding(("image",), "an image", f"{description.image!r} (no file {image})")
        raise MapError(file, f"{finding.key}: expected {finding.expected}, got {finding.got}", [finding])
    return _decode(image, max_cells, description)


def _lies_in(file: Path, folder: Path) -> bool:
    try:
        return file.resolve().is_relative_to(folder.resolve())
    except (OSError, RuntimeError):  # a name too long, a circle of links
        return False


def load_image(
    file: Path | str,
    resolution: float,
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0),
    *,
    negate: bool = False,
    occupied_thresh: float = 0.65,
    free_thresh: float = 0.196,
    mode: MapMode = MapMode.TRINARY,
    max_cells: int = MAX_CELLS,
) -> OccupancyMap:
    """Read a bare image that has no YAML file; the arguments are the keys of one.

    Raises
    ------
    MapError
        The image is unusable, or an argument is.
    """
    file = Path(file)
    keys = {
        "image": file.name,
        "resolution": resolution,
        "origin": origin,
        "negate": negate,
        "occupied_thresh": occupied_thresh,
        "free_thresh": free_thresh,
        "mode": mode,
    }
    return _decode(file, max_cells, validated_description(file, keys))


def _read_pixels(file: Path, max_cells: int, mode: MapMode) -> NDArray[np.uint8]:
    """Grey and opacity (height, width, 2) uint8 of an image, top row first; ``mode`` decides which channels count."""
    if kind := special_file(file):
        raise MapError(file, f"expected an image, got {kind}")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)  # the limit below decides
            image = Image.open(file, formats=IMAGE_FORMATS)
        with image:
            width, height = image.size
            if width * height > max_cells:
                raise MapError(file, f"{width} x {height} pixels are more than the limit of {max_cells} cells")
            if image.mode not in GREY_MODES:
                raise MapError(file, f"expected 8-bit grey or colour, got pixels of type {image.mode!r}")
            has_opacity = "A" in image.mode or "transparency" in image.info
            pixels = np.asarray(image.convert("RGBA"), dtype=np.uint8)
    except Image.DecompressionBombError as error:
        raise MapError(file, f"has too many pixels: {error}") from error
    except UnidentifiedImageError as error:
        raise MapError(file, "expected an image (pgm, png, bmp), got a file of another kind") from error
    except (OSError, ValueError, SyntaxError) as error:  # Pillow raises any of these for damaged files
        raise MapError(file, getattr(error, "strerror", None) or f"damaged image: {error}") from error
    channels = 4 if mode is MapMode.TRINARY and has_opacity else 3
    total = pixels[..., :channels].sum(axis=2, dtype=np.uint16)
    return np.stack([((total + channels // 2) // channels).astype(np.uint8), pixels[..., 3]], axis=2)


def _decode(file: Path, max_cells: int, description: MapDescription) -> OccupancyMap:
    pixels = _read_pixels(file, max_cells, description.mode)
    try:
        axis_aligned_shape(pixels.shape[:2], description.origin[2], max_cells)
    except ValueError as error:
        raise MapError(file, str(error)) from error
    occupancy = description.occupancy_of_grey()[pixels[..., 0]]
    if description.mode is MapMode.SCALE:
        occupancy[pixels[..., 1] < 255] = UNKNOWN_OCCUPANCY
    return OccupancyMap(np.ascontiguousarray(occupancy[::-1]), description.resolution, description.origin)
