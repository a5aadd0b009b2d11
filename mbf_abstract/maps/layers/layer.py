"""The base of the layers of every map: a name, typed parameters, the sensors it takes, and how fresh their data are.

What a layer computes depends on its map, so a map derives its own interface from ``MapLayer``: boxes of cells in
``mbf_costmap_nav.map.layer``, costs and lethal flags of vertices in ``mbf_mesh_nav.map.layer``.
"""

from __future__ import annotations

from abc import ABC
from collections.abc import Iterable, Sequence
from typing import Any, ClassVar

from mbf_abstract.geometry import Pose
from mbf_abstract.maps.layers.source_watch import SourceWatch, first_reason
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.maps.tracking.objects import TrackedObject
from mbf_abstract.maps.tracking.robot_box import RobotBox
from mbf_abstract.parameters import PluginParameters, parameter


class LayerParameters(PluginParameters):
    """Parameters every layer has."""

    enabled: bool = parameter(True, "Whether the layer takes part in the map; a disabled layer leaves it free.")


class MapLayer(ABC):
    """One source of costs.

    Attributes
    ----------
    name : str
        Name of the instance in the configuration.
    parameters : LayerParameters
        Validated instance of the class's ``Parameters``; replaced as a whole when changed at run time.
    """

    Parameters: ClassVar[type[LayerParameters]] = LayerParameters
    contract_check: ClassVar[str] = ""
    """Check of the contract of this map's layers, as ``module:function``."""

    parameters: Any

    def __init__(self, name: str, parameters: LayerParameters) -> None:
        self.name = name
        self.parameters = parameters

    @property
    def source_names(self) -> tuple[str, ...]:
        """Names of the observation sources that the layer asks for."""
        return ()

    def listens_to(self, source: str) -> bool:
        """Whether the layer takes scans of a source."""
        return source in self.source_names

    @property
    def forgets(self) -> bool:
        """Whether it holds anything that clearing the map removes: by default if it asks for a source."""
        return bool(self.source_names)

    def insert_scan(self, scan: RangeScan) -> None:  # noqa: B027 - for layers that name sources
        """Keep a scan of one of its sources, in the frame of the map and all of it finite, for the next update.

        Called on the thread of the sensor, also while the map is being updated; must be quick.
        """

    def watched_sources(self) -> Iterable[tuple[SourceWatch, float]]:
        """The sources whose freshness is watched, and how long [s] each may be silent, 0 = for ever; here none."""
        return ()

    def stale_reason(self, now: float) -> str:
        """Why the layer's data are too old at ``now`` [s]: which source is late; empty while they are fresh."""
        return first_reason(watch.stale_reason(now, limit) for watch, limit in self.watched_sources())

    def awaits_scan(self, now: float) -> bool:
        """Whether a source that has sent nothing since the layer was cleared may still do so in time."""
        return any(watch.awaits_scan(now, limit) for watch, limit in self.watched_sources())

    def tracked_objects(self, now: float) -> tuple[TrackedObject, ...]:
        """The objects that the layer follows, at ``now`` [s]; none if it follows none."""
        return ()

    def guarded_objects(self, now: float) -> tuple[TrackedObject, ...]:
        """The objects before which the robot must stop, at ``now`` [s]; none if the layer follows none.

        They are those of ``tracked_objects``, and those that a clearing has hidden, until they are seen again or
        forgotten. An object that was first seen a moment ago may be MOVING here while it still is WAITING there.
        """
        return self.tracked_objects(now)

    def lost_contact(
        self, box: RobotBox, pose: Pose, moving: Sequence[TrackedObject], now: float
    ) -> TrackedObject | None:
        """Whom the robot stands for because they touched it, or nearly, and are out of sight since; None if nobody.

        Parameters
        ----------
        box, pose
            Outline of the robot, and where it is in the frame of the objects.
        moving : sequence of TrackedObject
            Those of the ``guarded_objects`` that move on its storey.
        now : float
            [s]
        """
        return None

    def speed_limit_at(self, pose: Pose, full_speed: float) -> float:
        """Allowed speed [m/s] of a robot at ``pose`` in the frame of the map, at most ``full_speed``; as it is here.

        ``full_speed``, which may be inf, is what a limit in percent is a share of. See ``obeyed_limits``.
        """
        return full_speed

    def configuration_warning(self) -> str:
        """A legal but suspicious parameter of the layer; empty if there is none."""
        return ""
