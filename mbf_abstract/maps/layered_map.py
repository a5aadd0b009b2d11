"""The base of maps made of layers: scan intake, and parameters that are overridden for a time."""

from __future__ import annotations

import math
import threading
from abc import abstractmethod
from typing import Any

from numpy.typing import ArrayLike

from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.maps.layers.layer_stack import LayerStack
from mbf_abstract.maps.navigation_map import NavigationMap
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.maps.tracking.contact import in_the_way, moving_on_storey, out_of_sight, safe_share
from mbf_abstract.maps.tracking.contact_parameters import ContactParameters
from mbf_abstract.maps.tracking.objects import TrackedObject


class LayeredMap(NavigationMap):
    """A map with layers.

    Attributes
    ----------
    frame_id : str
        Frame of all coordinates.
    layers : LayerStack
        The layers by name.
    """

    layers: LayerStack[Any]

    def __init__(self) -> None:
        self._lock = threading.RLock()
        self._overridden: dict[str, tuple[Any, float]] = {}  # usual parameters of a layer, end of the override [s]

    @property
    def source_names(self) -> tuple[str, ...]:
        """Names of all observation sources that layers ask for, sorted."""
        return tuple(sorted({name for layer in self.layers.values() for name in layer.source_names}))

    def listens_to(self, source: str) -> bool:
        """Whether any layer takes scans of a source."""
        return any(layer.listens_to(source) for layer in self.layers.values())

    def insert_scan(self, scan: RangeScan) -> None:
        """Hand a scan to the layers that listen to its source; the next update takes it into the map.

        Never waits for an update. Rays whose end is not finite are left out; a scan of such rays only is ignored.

        Raises
        ------
        ValueError
            The scan is in another frame, no layer listens to its source, or its origin or stamp is not finite.
        """
        if scan.frame_id != self.frame_id:
            raise ValueError(f"the scan is in the frame {scan.frame_id!r}, the map in {self.frame_id!r}")
        listening = [layer for layer in self.layers.values() if layer.listens_to(scan.source)]
        if not listening:
            known = list(self.source_names)
            raise ValueError(f"no layer listens to the source {scan.source!r}; known: {known}")
        seen = scan.checked()
        if len(seen.ends) or not len(scan.ends):
            for layer in listening:
                layer.insert_scan(seen)

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

    def stale_reason(self, now: float) -> str:
        """Why the map is not current at ``now`` [s]: a layer that raised, or a silent sensor; empty if it is."""
        return self.layers.stale_reason(now)

    def awaits_scan(self, now: float) -> bool:
        """Whether any layer does, see ``MapLayer.awaits_scan``."""
        return any(layer.awaits_scan(now) for layer in self.layers.enabled)

    def configuration_warnings(self) -> list[str]:
        """Legal but suspicious parameters of the layers, a text each."""
        return self.layers.configuration_warnings()

    def tracked_objects(self, now: float) -> tuple[TrackedObject, ...]:
        """The objects of all layers that follow some, at ``now`` [s]."""
        with self._lock:
            return tuple(known for layer in self.layers.enabled for known in layer.tracked_objects(now))

    def safe_share(self, pose: Pose, velocity: Twist, command: Twist, now: float) -> tuple[float, str, float]:
        """The least share that any layer with moving objects allows."""
        least = super().safe_share(pose, velocity, command, now)
        with self._lock:
            tracking = [(layer, layer.guarded_objects(now)) for layer in self.layers.enabled]
        for layer, objects in tracking:
            limits = layer.parameters
            if not isinstance(limits, ContactParameters) or not limits.stop_before_contact:
                continue
            moving = moving_on_storey(objects, pose.z, self.same_storey)
            held = layer.lost_contact(self.robot_box, pose, moving, now)
            if held is not None and not command.is_stopped(1e-9, 1e-9):
                return 0.0, out_of_sight(held), limits.max_wait
            if not objects:
                continue
            share, touched = safe_share(self.robot_box, pose, velocity, command, objects, limits, self.same_storey)
            if touched is not None and share < least[0]:
                least = share, in_the_way(touched), limits.max_wait
        return least

    @property
    def max_wait(self) -> float:
        """The shortest time [s] that any layer with moving objects allows."""
        limits = [layer.parameters for layer in self.layers.enabled]
        return min((limit.max_wait for limit in limits if isinstance(limit, ContactParameters)), default=math.inf)

    def speed_limit_at(self, pose: Pose, full_speed: float) -> float:
        """The lowest speed [m/s] that any layer states; raises ValueError where what a layer states is no speed."""
        limit = full_speed
        with self._lock:
            for layer in self.layers.enabled:
                allowed: Any = layer.speed_limit_at(pose, full_speed)
                if allowed is None or not allowed >= 0.0:
                    raise ValueError(f"layer {layer.name!r} gives a speed limit of {allowed} m/s, expected 0 or more")
                limit = min(limit, allowed)
        return limit

    def set_layer_parameters(self, name: str, parameters: Any, until: float = math.inf) -> None:
        """Replace the parameters of one layer, all or none.

        With a time ``until`` [s] this is an override: the first ``update`` from then on restores the usual parameters.

        Raises
        ------
        KeyError
            There is no such layer.
        Exception
            What the layer raises where it cannot use them; the old ones stay.
        """
        with self._lock:
            usual = self.usual_parameters(name)
            self._replace_parameters(name, parameters)
            self._overridden.pop(name, None)
            if until < math.inf:
                self._overridden[name] = usual, until

    def usual_parameters(self, name: str) -> Any:
        """Parameters of a layer apart from an override; raises KeyError if there is none of that name."""
        with self._lock:
            return self._overridden[name][0] if name in self._overridden else self.layers[name].parameters

    def end_overrides(self, now: float) -> None:
        """Restore the usual parameters of layers whose override is over at ``now`` [s]."""
        with self._lock:
            for name in [name for name, (_, until) in self._overridden.items() if until <= now]:
                self.set_layer_parameters(name, self.usual_parameters(name))

    @abstractmethod
    def _replace_parameters(self, name: str, parameters: Any) -> None:
        """Give a layer its parameters, all or none; called under the lock of the map."""
