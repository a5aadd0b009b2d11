"""The base of a map made of layers: what sensors bring in, and how fresh it is, the same on every backend."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

from numpy.typing import ArrayLike

from mbf_abstract.maps.layers.layer_stack import LayerStack
from mbf_abstract.maps.sensing import RangeScan


class LayeredMap(ABC):
    """A map with layers.

    Attributes
    ----------
    frame_id : str
        Frame of all coordinates.
    layers : LayerStack
        The layers by name.
    """

    frame_id: str
    layers: LayerStack[Any]

    @abstractmethod
    def stale_reason(self, now: float) -> str:
        """Why no command may be computed on this map at ``now`` [s]; empty if it is fresh."""

    @abstractmethod
    def take_in(self, scan: RangeScan) -> None:
        """Hand a checked scan in the frame of the map to the layers that listen to its source."""

    def is_current(self, now: float) -> bool:
        """Whether a command may be computed on this map at ``now`` [s]."""
        return not self.stale_reason(now)

    def insert_scan(self, scan: RangeScan) -> None:
        """Hand a scan to the layers that listen to its source. Rays whose end is not finite are left out.

        A scan that has only such rays says nothing and is passed over.

        Raises
        ------
        ValueError
            The scan is in another frame, no layer listens to its source, or its origin or stamp is not finite.
        """
        if scan.frame_id != self.frame_id:
            raise ValueError(f"the scan is in the frame {scan.frame_id!r}, the map in {self.frame_id!r}")
        if not self.layers.listens_to(scan.source):
            known = list(self.layers.source_names)
            raise ValueError(f"no layer listens to the source {scan.source!r}, known are {known}")
        seen = scan.checked()
        if len(seen.ends) or not len(scan.ends):
            self.take_in(seen)

    def insert_points(self, source: str, points: ArrayLike, sensor_origin: ArrayLike, stamp: float) -> None:
        """Insert a point cloud: a scan in which every ray hit something.

        Parameters
        ----------
        source : str
            Name of the sensor, as layers of the configuration call it.
        points : (n, 3) float
            Hits [m] in the frame of the map.
        sensor_origin : (3,) float
            Position of the sensor [m], for range limits and clearing.
        stamp : float
            Time of the measurement [s].

        Raises
        ------
        ValueError
            As ``insert_scan``.
        """
        self.insert_scan(RangeScan.of_points(source, points, sensor_origin, stamp, self.frame_id))
