"""The YAML file of a map, and how it turns grey values into occupancies.

Occupancy is (255 - grey) / 255, or grey / 255 with ``negate``. Above ``occupied_thresh`` a cell is occupied (100),
below ``free_thresh`` free (0). What lies between is unknown (255, mode trinary) or ``1 + 98 * ratio`` (mode scale). In
mode raw the grey value itself is kept. These are map_server's rules.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import Enum
from pathlib import Path
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from mbf_abstract.config.findings import ConfigError, Finding
from mbf_abstract.config.validation import findings_of
from mbf_abstract.config.yaml_source import YamlDocument, load_yaml
from mbf_abstract.geometry import FARTHEST_COORDINATE
from mbf_abstract.parameters import parameter

OccupancyArray = NDArray[np.uint8]
Near = Annotated[float, Field(ge=-FARTHEST_COORDINATE, le=FARTHEST_COORDINATE)]

FREE_OCCUPANCY = 0
OCCUPIED = 100
UNKNOWN_OCCUPANCY = 255
MAX_REPORTED = 10
"""Findings of one file that its MapError reports."""
REPORTED_WIDTH = 300
"""Characters reported of one finding; a key may be as long as the file."""


class MapError(Exception):
    """A map file that cannot be used; ``findings`` are those of a YAML file, which ``reason`` sums up."""

    def __init__(self, file: Path, reason: str, findings: Sequence[Finding] = ()) -> None:
        super().__init__(f"{file}: {reason}")
        self.file = file
        self.reason = reason
        self.findings = tuple(findings)

    def __reduce__(self) -> tuple[type, tuple[object, ...]]:
        """Support pickling, for errors raised in worker processes."""
        return type(self), (self.file, self.reason, self.findings)


class MapMode(str, Enum):
    """How grey values between the two thresholds are read."""

    TRINARY = "trinary"
    SCALE = "scale"
    RAW = "raw"


class MapDescription(BaseModel):
    """The YAML file of a map; keys we do not know are ignored, as map_server does."""

    model_config = ConfigDict(frozen=True, extra="ignore", allow_inf_nan=False)

    image: str = Field(min_length=1)
    resolution: float = parameter(..., "Edge of a cell.", unit="m", ge=1e-4, le=1e3)
    origin: tuple[Near, Near, Near]
    negate: bool = False
    occupied_thresh: float = Field(0.65, ge=0.0, le=1.0)
    free_thresh: float = Field(0.196, ge=0.0, le=1.0)
    mode: MapMode = MapMode.TRINARY

    @field_validator("image")
    @classmethod
    def _image_is_a_file_name(cls, value: str) -> str:
        if "\0" in value:
            raise ValueError("a file name without a null character")
        return value

    @field_validator("origin", mode="before")
    @classmethod
    def _origin_is_a_list(cls, value: object) -> object:
        if isinstance(value, list | tuple) and len(value) == 3:
            return tuple(value)
        raise ValueError("a list [x, y, yaw]")

    @model_validator(mode="after")
    def _thresholds_are_ordered(self) -> MapDescription:
        if self.free_thresh >= self.occupied_thresh:
            raise ValueError(f"free_thresh below occupied_thresh, not {self.free_thresh} and {self.occupied_thresh}")
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
        The file is missing, breaks a limit of ``mbf_abstract.config.yaml_source`` or holds a bad value (all of them are
        named).
    """
    document = read_mapping(file)
    return validated_description(file, document.data, document)


def read_mapping(file: Path) -> YamlDocument:
    """Read a YAML file whose top level is a mapping; raises MapError with all findings."""
    try:
        return load_yaml(file)
    except ConfigError as error:
        raise MapError(file, findings_text(error.findings), error.findings) from error


def validated_description(
    file: Path, keys: Mapping[str, object], document: YamlDocument | None = None
) -> MapDescription:
    """Check the keys of a description; ``file`` and the lines of ``document`` are only named in the MapError."""
    try:
        return MapDescription.model_validate(keys)
    except ValidationError as error:
        source = document or YamlDocument(file, {})
        findings = findings_of(MapDescription, keys, error.errors(include_url=False), source, ())
        raise MapError(file, findings_text(findings), findings) from error


def findings_text(findings: Sequence[Finding]) -> str:
    """Findings of one file as the reason of its MapError, the first ten of them."""
    texts = [f"line {one.line}: {one.text.removeprefix(f'{one.file}:{one.line}:').strip()}" for one in findings]
    lines = [text if len(text) <= REPORTED_WIDTH else f"{text[:REPORTED_WIDTH]}..." for text in texts[:MAX_REPORTED]]
    more = [f"and {len(findings) - MAX_REPORTED} more"] if len(findings) > MAX_REPORTED else []
    return "; ".join(lines + more)
