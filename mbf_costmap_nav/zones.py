"""Areas with a meaning of their own: polygons from YAML and mask images, for the keep-out and speed-limit layers.

A zones file is a YAML mapping with one list::

    zones:
      - {name: stairs, polygon: [[1.0, 2.0], [3.0, 2.0], [3.0, 4.0]]}
      - {name: ramp, polygon: [[5.0, 0.0], [7.0, 0.0], [7.0, 2.0], [5.0, 2.0]], speed_limit: 0.3}

Coordinates are metres in the costmap's frame, unless the layer is told another (``map_frame``). A mask image is a
map_server map; it may have another grid than the costmap, each cell takes the value at its centre.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import yaml
from numpy.typing import NDArray
from pydantic import ValidationError, field_validator

from mbf_abstract.parameters import ParameterModel, parameter
from mbf_abstract.transform import Transform
from mbf_costmap_nav.costmap import LETHAL, CellArray, CellBox, Costmap, GridGeometry
from mbf_costmap_nav.map_description import MapError
from mbf_costmap_nav.placement import mapped


class Zone(ParameterModel):
    """One polygon."""

    name: str = parameter(..., "Name for messages.")
    polygon: tuple[tuple[float, float], ...] = parameter(..., "Corners in order, at least three.", unit="m")
    speed_limit: float | None = parameter(None, "Limit inside, for the speed-limit layer.", ge=0.0)

    @field_validator("polygon")
    @classmethod
    def _is_an_area(cls, corners: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
        if len(corners) < 3:
            raise ValueError(f"a zone needs at least 3 corners, got {len(corners)}")
        return corners

    @property
    def corners(self) -> NDArray[np.float64]:
        """Corners (n, 2) [m]."""
        return np.array(self.polygon, dtype=np.float64)

    def contains(self, x: float, y: float) -> bool:
        """Whether the point (x, y) [m] lies inside (crossing number; points on the border go either way)."""
        ax, ay = self.corners.T
        bx, by = np.roll(ax, -1), np.roll(ay, -1)
        spans = (ay > y) != (by > y)
        crossings = ax[spans] + (bx[spans] - ax[spans]) * (y - ay[spans]) / (by[spans] - ay[spans])
        return bool(np.count_nonzero(crossings > x) % 2)


class ZonesFile(ParameterModel):
    """Content of a zones file."""

    zones: tuple[Zone, ...] = parameter(..., "The zones.")


def load_zones(file: Path) -> tuple[Zone, ...]:
    """Read a zones file.

    Raises
    ------
    MapError
        The file is missing, no YAML, or holds something else than zones.
    """
    try:
        return ZonesFile.model_validate(yaml.safe_load(file.read_text(encoding="utf-8"))).zones
    except OSError as error:
        raise MapError(file, error.strerror or str(error)) from error
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise MapError(file, f"is no readable YAML: {error}") from error
    except ValidationError as error:
        findings = "; ".join(f"{'.'.join(map(str, e['loc'])) or 'file'}: {e['msg']}" for e in error.errors())
        raise MapError(file, findings) from error


def sample_costmap(
    source: Costmap, geometry: GridGeometry, box: CellBox, outside: int, T_source_grid: Transform | None = None
) -> CellArray:
    """Values of ``source`` at the centres of another grid's cells.

    Parameters
    ----------
    source : Costmap
    geometry : GridGeometry
    box : CellBox
        Cells of ``geometry`` to fill.
    outside : int
        Value of cells whose centre is not on ``source``.
    T_source_grid : Transform, optional
        From the grid's frame to the source's; none where they are the same. A turned grid can miss single cells, so
        lethal ones are written once more into the grid's cell their own centre lies in.

    Returns
    -------
    (box rows, box columns) uint8
    """
    if T_source_grid is not None:
        return _sample_transformed(source, geometry, box, outside, T_source_grid)
    x = geometry.origin_x + (np.arange(box.x0, box.x1) + 0.5) * geometry.resolution
    y = geometry.origin_y + (np.arange(box.y0, box.y1) + 0.5) * geometry.resolution
    ix = np.floor((x - source.origin_x) / source.resolution).astype(np.int64)
    iy = np.floor((y - source.origin_y) / source.resolution).astype(np.int64)
    columns, rows = (ix >= 0) & (ix < source.width), (iy >= 0) & (iy < source.height)
    values = np.full((len(y), len(x)), outside, dtype=np.uint8)
    values[np.ix_(rows, columns)] = source.cells[np.ix_(iy[rows], ix[columns])]
    return values


def _sample_transformed(
    source: Costmap, geometry: GridGeometry, box: CellBox, outside: int, T_source_grid: Transform
) -> CellArray:
    values = np.full((max(box.y1 - box.y0, 0), max(box.x1 - box.x0, 0)), outside, dtype=np.uint8)
    lower = np.array([geometry.origin_x, geometry.origin_y]) + np.array([box.x0, box.y0]) * geometry.resolution
    rows, columns = (axis.ravel() for axis in np.indices(values.shape))
    centres = lower + (np.column_stack([columns, rows]) + 0.5) * geometry.resolution
    cells, inside = source.world_to_cells(mapped(T_source_grid, centres))
    values[rows[inside], columns[inside]] = source.cells[cells[inside, 1], cells[inside, 0]]

    lethal = np.argwhere(source.cells == LETHAL)[:, ::-1]
    points = mapped(T_source_grid.inverse(), source.cells_to_world(lethal))
    x, y = np.floor((points - lower) / geometry.resolution).astype(np.int64).T
    seen = (x >= 0) & (x < values.shape[1]) & (y >= 0) & (y < values.shape[0])
    values[y[seen], x[seen]] = LETHAL
    return values
