"""The YAML file of a map, and how it turns grey values into occupancies.

Occupancy is (255 - grey) / 255, or grey / 255 with ``negate``. Above ``occupied_thresh`` a cell is occupied (100),
below ``free_thresh`` free (0). What lies between is unknown (255, mode trinary) or ``1 + 98 * ratio`` (mode scale). In
mode raw the grey value itself is kept. These are map_server's rules.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum
from pathlib import Path

import numpy as np
import yaml
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

OccupancyArray = NDArray[np.uint8]

FREE_OCCUPANCY = 0
OCCUPIED = 100
UNKNOWN_OCCUPANCY = 255
MAX_DESCRIPTION_BYTES = 1 << 20


class MapError(Exception):
    """A map file that cannot be used.

    Attributes
    ----------
    file : pathlib.Path
    reason : str
    """

    def __init__(self, file: Path, reason: str) -> None:
        super().__init__(f"{file}: {reason}")
        self.file = file
        self.reason = reason


class MapMode(str, Enum):
    """How grey values between the two thresholds are read."""

    TRINARY = "trinary"
    SCALE = "scale"
    RAW = "raw"


class MapDescription(BaseModel):
    """The YAML file of a map; keys we do not know are ignored, as map_server does."""

    model_config = ConfigDict(frozen=True, extra="ignore", allow_inf_nan=False)

    image: str = Field(min_length=1)
    resolution: float = Field(ge=1e-4, le=1e3)
    origin: tuple[float, float, float]
    negate: bool = False
    occupied_thresh: float = Field(0.65, ge=0.0, le=1.0)
    free_thresh: float = Field(0.196, ge=0.0, le=1.0)
    mode: MapMode = MapMode.TRINARY

    @field_validator("origin", mode="before")
    @classmethod
    def _origin_is_a_list(cls, value: object) -> object:
        if isinstance(value, list | tuple) and len(value) == 3:
            return tuple(value)
        raise ValueError("expected a list [x, y, yaw]")

    @model_validator(mode="after")
    def _thresholds_are_ordered(self) -> MapDescription:
        if self.free_thresh >= self.occupied_thresh:
            raise ValueError(f"free_thresh {self.free_thresh} must be below occupied_thresh {self.occupied_thresh}")
        return self

    def occupancy_of_grey(self) -> OccupancyArray:
        """(256,) uint8: occupancy of each grey value of an opaque pixel."""
        grey = np.arange(256, dtype=np.float64)
        if self.negate:
            grey = 255.0 - grey
        if self.mode is MapMode.RAW:
            return grey.astype(np.uint8)
        occupancy = (255.0 - grey) / 255.0
        ratio = np.clip((occupancy - self.free_thresh) / (self.occupied_thresh - self.free_thresh), 0.0, 1.0)
        table = (1.0 + 98.0 * ratio).astype(np.uint8)
        if self.mode is MapMode.TRINARY:
            table[:] = UNKNOWN_OCCUPANCY
        table[occupancy > self.occupied_thresh] = OCCUPIED
        table[occupancy < self.free_thresh] = FREE_OCCUPANCY
        return table


def read_description(file: Path) -> MapDescription:
    """Read and check the YAML file alone.

    Raises
    ------
    MapError
        The file is missing, too large, no YAML mapping, or holds a bad value (all of them are named).
    """
    try:
        if file.stat().st_size > MAX_DESCRIPTION_BYTES:
            raise MapError(file, f"is larger than {MAX_DESCRIPTION_BYTES} bytes, which no map description is")
        content = yaml.safe_load(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise MapError(file, error.strerror or str(error)) from error
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise MapError(file, f"is no readable YAML: {error}") from error
    if not isinstance(content, dict):
        raise MapError(
            file, f"expected a mapping with the keys image, resolution, origin; got {type(content).__name__}"
        )
    return validated_description(file, content)


def validated_description(file: Path, keys: Mapping[str, object]) -> MapDescription:
    """Check the keys of a description; ``file`` is only named in the MapError."""
    try:
        return MapDescription.model_validate(keys)
    except ValidationError as error:
        findings = (f"{'.'.join(map(str, e['loc'])) or 'map'}: {e['msg']}, got {e['input']!r}" for e in error.errors())
        raise MapError(file, "; ".join(findings)) from error
