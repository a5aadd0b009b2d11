"""Areas with a meaning of their own: polygons from YAML and mask images, for the keep-out and speed-limit layers.

A zones file is a YAML mapping with one list::

    zones:
      - {name: stairs, polygon: [[1.0, 2.0], [3.0, 2.0], [3.0, 4.0]]}
      - {name: ramp, polygon: [[5.0, 0.0], [7.0, 0.0], [7.0, 2.0], [5.0, 2.0]], speed_limit: 0.3}

Coordinates are metres in the costmap's frame, unless the layer is told another (``map_frame``). A mask image is a
map_server map; it may have another grid than the costmap (see ``resampling``).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import yaml
from numpy.typing import NDArray
from pydantic import ValidationError, field_validator

from mbf_abstract.parameters import ParameterModel, parameter
from mbf_costmap_nav.map_description import MapError


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
