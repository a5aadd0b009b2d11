"""Zones: polygons from YAML and mask images, for the keep-out and speed-limit layers.

A zones file is a YAML mapping with one list::

    zones:
      - {name: stairs, polygon: [[1.0, 2.0], [3.0, 2.0], [3.0, 4.0]]}
      - {name: ramp, polygon: [[5.0, 0.0], [7.0, 0.0], [7.0, 2.0], [5.0, 2.0]], speed_limit: 0.3}

Coordinates are metres in the costmap's frame, unless the layer names another one (``map_frame``). A mask image is a
map_server map; it may have another grid than the costmap (see ``resampling``).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from mbf_abstract.config.findings import Finding
from mbf_abstract.config.validation import validate
from mbf_abstract.geometry.polygon import inside_polygon
from mbf_abstract.maps.layers.drawn_area import DrawnArea
from mbf_abstract.parameters import ParameterModel, parameter
from mbf_costmap_nav.files.map_description import MapError, findings_text, read_mapping


class Zone(DrawnArea):
    """One polygon."""

    speed_limit: float | None = parameter(None, "Limit inside, for the speed-limit layer.", ge=0.0)

    def contains(self, x: float, y: float) -> bool:
        """Whether the point (x, y) [m] lies inside."""
        return bool(inside_polygon(np.array([[x, y]]), self.corners)[0])


class ZonesFile(ParameterModel):
    """Content of a zones file."""

    zones: tuple[Zone, ...] = parameter(..., "The zones.")


def load_zones(file: Path) -> tuple[Zone, ...]:
    """Read a zones file.

    Raises
    ------
    MapError
        The file is missing, breaks a limit of ``mbf_abstract.config.yaml_source``, or holds anything but zones.
    """
    document, findings = read_mapping(file), list[Finding]()
    content = validate(ZonesFile, document.data, document, (), findings)
    if content is None:
        raise MapError(file, findings_text(findings))
    return content.zones
