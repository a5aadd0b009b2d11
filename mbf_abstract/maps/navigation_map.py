"""The contract of a navigation map with the core: what every map answers, so that behaviours are written once.

``rotate``, ``back_up``, ``drive_on_heading``, ``move_away``, ``clear`` and ``relax`` know their map by this contract
only. A map of a backend derives ``NavigationMap``; a server hands it to its plugins in a ``MapContext``. A map without
sensors or layers writes ``obstacle_ahead`` and ``nearest_obstacle`` and inherits the rest.
"""

from __future__ import annotations

import math
import threading
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, Generic, TypeVar

from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.plugins import PluginContext


class NavigationMap(ABC):
    """A map. All poses are in its frame; its methods may be called from any thread.

    Attributes
    ----------
    frame_id : str
    layers : mapping of name to layer
        Each layer has its ``parameters``.
    inscribed_radius : float
        Radius [m] of the largest disc inside the robot's outline; 0 = unknown.
    """

    frame_id: str
    layers: Mapping[str, Any] = MappingProxyType({})
    inscribed_radius: float = 0.0

    def __init__(self) -> None:
        self._lock = threading.RLock()
        self._overridden: dict[str, tuple[Any, float]] = {}  # usual parameters of a layer, end of the override [s]

    # ----------------------------------------------------------------------------------------------- freshness
    def stale_reason(self, now: float) -> str:
        """Why no command may be computed on the map at ``now`` [s]; empty if it is fresh."""
        return ""

    def is_current(self, now: float) -> bool:
        """Whether a command may be computed on the map at ``now`` [s]."""
        return not self.stale_reason(now)

    def update(self, robot_pose: Pose | None, now: float) -> object:
        """Bring the map up to ``now`` [s], and end overrides of layer parameters that are over.

        ``robot_pose`` is None while it is unknown.
        """
        self.end_overrides(now)
        return None

    # -------------------------------------------------------------------------------------------------- motion
    @abstractmethod
    def obstacle_ahead(self, pose: Pose, command: Twist, duration: float) -> str:
        """What the robot would touch, and where, if it kept ``command`` for ``duration`` [s]; empty = nothing.

        The end of the map counts, and whatever else forbids the motion. A robot in a collision may leave it: what it
        touches already is no obstacle as long as the motion leads no deeper.
        """

    @abstractmethod
    def nearest_obstacle(self, pose: Pose, within: float) -> tuple[float, float, float] | None:
        """Offset [m] from ``pose`` to the nearest obstacle, along the axes of the map; None if none is ``within`` [m].

        What lies on another storey is none.
        """

    # -------------------------------------------------------------------------------------------------- layers
    def layer(self, name: str) -> Any:
        """One layer; raises KeyError with the known ones if there is none of that name."""
        if name not in self.layers:
            raise KeyError(f"the map has no layer {name!r}, only {list(self.layers)}")
        return self.layers[name]

    def clear(self, layer_names: Iterable[str] | None = None) -> list[str]:
        """Forget what sensors have marked in layers, in all by default; return the names of those cleared.

        Visible after the next ``update``. Raises KeyError where a name is no layer.
        """
        return [self.layer(name).name for name in layer_names or ()]

    def clear_area(
        self, center: Pose, size: float, layer_names: Iterable[str] | None = None, *, inside: bool = True
    ) -> list[str]:
        """Clear layers within a square of side ``size`` [m] around a pose, or all but it; as ``clear`` otherwise.

        By default these are the layers that sensors fill again.
        """
        return [self.layer(name).name for name in layer_names or ()]

    def set_layer_parameters(self, name: str, parameters: Any, until: float = math.inf) -> None:
        """Replace the parameters of one layer, all or none.

        With a time ``until`` [s] this is an override: the first ``update`` from then on restores the usual parameters.

        Raises
        ------
        KeyError
            There is no such layer.
        Exception
            Whatever the layer raises that cannot use them; the old ones stay.
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
            return self._overridden[name][0] if name in self._overridden else self.layer(name).parameters

    def end_overrides(self, now: float) -> None:
        """Restore the usual parameters of layers whose override is over at ``now`` [s]."""
        with self._lock:
            for name in [name for name, (_, until) in self._overridden.items() if until <= now]:
                self.set_layer_parameters(name, self.usual_parameters(name))

    def _replace_parameters(self, name: str, parameters: Any) -> None:
        """Give a layer its parameters; called under the lock of the map."""
        raise ValueError(f"the layer {name!r} has no parameters that can be changed")


M = TypeVar("M", bound=NavigationMap)


@dataclass(frozen=True)
class MapContext(PluginContext, Generic[M]):
    """What a plugin of a server with a map is constructed with.

    Attributes
    ----------
    navigation_map : NavigationMap
        The map the plugin is bound to.
    maps : mapping of name to NavigationMap
        All maps of a server that has several, e.g. ``local`` and ``global``.
    transforms : TransformBuffer
        The frames of the maps; a map may be in another one than goals, paths and robot poses.
    """

    navigation_map: M
    maps: Mapping[str, M] = field(default_factory=dict, kw_only=True)
    transforms: TransformBuffer = field(default_factory=TransformBuffer, kw_only=True)
