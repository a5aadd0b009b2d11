"""What the layers ``moving_obstacles`` of all maps share: scans in, tracked objects and predictions out.

A layer takes the points out of a scan that stand on its ground and are not part of its static map; the rest is here.
Scans wait for the next update of the map, as they may come while it is being updated.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import field_validator

from mbf_abstract.geometry import FloatArray, Pose
from mbf_abstract.geometry.arithmetic import norm
from mbf_abstract.maps.layers.layer import MapLayer
from mbf_abstract.maps.layers.source_watch import SourceWatch
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.maps.tracking.contact_parameters import ContactParameters
from mbf_abstract.maps.tracking.lost_contacts import LostContacts
from mbf_abstract.maps.tracking.objects import TrackedObject
from mbf_abstract.maps.tracking.prediction import NOWHERE, Prediction, PredictionParameters, predict
from mbf_abstract.maps.tracking.rays import Rays
from mbf_abstract.maps.tracking.robot_box import RobotBox
from mbf_abstract.maps.tracking.tracker import Tracker, TrackingParameters
from mbf_abstract.parameters import parameter

MAX_WAITING = 64
"""Scans that may wait for an update; older ones are dropped."""
ObstaclePoints = Callable[[RangeScan], tuple[FloatArray, NDArray[np.int64]]]
"""The points (n, 3) [m] of a scan that may be objects, on the ground below them, and the ray (n,) that hit each."""


class MovingObstaclesParameters(TrackingParameters, PredictionParameters):
    """Parameters of the layers ``moving_obstacles``, beside those of all layers."""

    sources: tuple[str, ...] = parameter(
        ..., "Names of the sensors it listens to, each of which must send scans.", dynamic=False
    )
    obstacle_min_range: float = parameter(
        0.0,
        "Points no farther from the sensor are ignored, such as those of the robot itself.",
        unit="m",
        was="min_obstacle_dist",
        ge=0.0,
    )
    obstacle_max_range: float = parameter(
        8.0, "Points farther from the sensor are ignored.", unit="m", was="max_obstacle_dist", gt=0.0, le=1e3
    )
    static_distance: float = parameter(
        0.15, "Points this near to the static map are part of it.", unit="m", ge=0.0, le=5.0
    )
    expected_update_rate: float = parameter(
        1.0, "Longest allowed time between two scans of a sensor; 0 switches the check off.", unit="s", ge=0.0
    )
    clear_trails: bool = parameter(True, "Free what obstacle layers keep where a moving object was seen and left.")

    @field_validator("sources")
    @classmethod
    def _has_a_source(cls, sources: tuple[str, ...]) -> tuple[str, ...]:
        if not sources:
            raise ValueError("the name of at least one sensor")
        return sources


class Sighting(NamedTuple):
    """What one scan has shown: points (n, 3) [m] off the static map, and whether each (n,) is of a moving object."""

    points: FloatArray
    of_moving: NDArray[np.bool_]


class MovingObstacles:
    """The objects that a layer tracks; any thread may ask for them while scans are taken in.

    It has a lock of its own, as two maps may share it: a map whose part in memory follows the robot, and the next part.

    Parameters
    ----------
    frame_id : str
        Frame of the map.

    Attributes
    ----------
    watches : dict of str to SourceWatch
        How fresh each sensor is.
    """

    def __init__(self, parameters: MovingObstaclesParameters, frame_id: str) -> None:
        self._tracker = Tracker(parameters, frame_id)
        self.watches = {name: SourceWatch(name) for name in parameters.sources}
        self._lost_contacts = LostContacts()
        self._waiting: deque[RangeScan] = deque(maxlen=MAX_WAITING)
        self._lock = threading.Lock()  # of the tracker and of who is lost
        self._sensor = NOWHERE  # where the last scan was taken [m]

    def insert_scan(self, scan: RangeScan) -> None:
        """Keep a scan for the next update; may be called on any thread."""
        self._waiting.append(scan)
        self.watches[scan.source].heard(scan.stamp)

    def take_in(self, parameters: MovingObstaclesParameters, obstacle_points: ObstaclePoints) -> Iterator[Sighting]:
        """Follow the objects through the scans that wait, one after the other; yield what each has shown."""
        with self._lock:
            self._tracker.parameters = parameters
        while self._waiting:
            scan = self._waiting.popleft()
            near = _near_hits(scan, parameters)
            points, of_near = obstacle_points(replace(scan, ends=scan.ends[near], hits=scan.hits[near]))
            rays = Rays(scan.ends, near[of_near])
            with self._lock:
                numbers = self._tracker.insert(points, scan.origin, scan.stamp, rays)
                of_moving = self._tracker.are_moving(numbers)
            self.watches[scan.source].used()
            self._sensor = scan.origin
            yield Sighting(points, of_moving)

    def objects(self, now: float) -> tuple[TrackedObject, ...]:
        """The tracked objects at ``now`` [s], without those that a clearing has hidden."""
        with self._lock:
            return self._tracker.objects(now)

    def guarded_objects(self, now: float) -> tuple[TrackedObject, ...]:
        """The objects before which the robot must stop, at ``now`` [s]; see ``Tracker.objects``."""
        with self._lock:
            return self._tracker.objects(now, guarded=True)

    def lost_contact(
        self, parameters: ContactParameters, box: RobotBox, pose: Pose, moving: Sequence[TrackedObject], now: float
    ) -> TrackedObject | None:
        """Whom the robot stands for, as they came within the margin and are out of sight; see ``LostContacts.held``."""
        margin, lasting = parameters.contact_margin, parameters.lost_contact_time
        with self._lock:
            return self._lost_contacts.held(box, pose, moving, margin, lasting, now)

    def predictions(
        self,
        parameters: MovingObstaclesParameters,
        inscribed_radius: float,
        now: float,
        *,
        for_plans: bool = True,
        robot: Pose | None = None,
    ) -> list[Prediction]:
        """Where the moving objects will be from ``now`` [s] on, for a robot of this radius [m].

        With ``for_plans`` also for as long as it takes to pass them; a controller would only be slow in such costs. See
        ``predict`` for the pose of the ``robot``.
        """
        sensor = self._sensor if for_plans else NOWHERE
        found = (predict(known, parameters, inscribed_radius, sensor, robot) for known in self.objects(now))
        return [prediction for prediction in found if len(prediction.costs)]

    def clear(self, within: Callable[[FloatArray], NDArray[np.bool_]] | None = None) -> None:
        """Forget the scans that wait; hide all objects, or those whose middles (n, 3) [m] are ``within`` an area.

        They are shown once they are seen again; until then, or until they are forgotten, the robot stops before them.
        """
        self._waiting.clear()
        with self._lock:
            self._tracker.clear(within)
        for watch in self.watches.values():
            watch.cleared()


class TrackingLayer(MapLayer):
    """The part of a moving obstacles layer that is the same on every map: what it asks for, and whom it follows."""

    parameters: MovingObstaclesParameters
    _objects: MovingObstacles

    @property
    def source_names(self) -> tuple[str, ...]:
        """Names of the configured sources."""
        return self.parameters.sources

    def insert_scan(self, scan: RangeScan) -> None:
        """Keep a scan for the next update."""
        self._objects.insert_scan(scan)

    def watched_sources(self) -> Iterator[tuple[SourceWatch, float]]:
        """All sensors, with one limit."""
        return ((watch, self.parameters.expected_update_rate) for watch in self._objects.watches.values())

    def tracked_objects(self, now: float) -> tuple[TrackedObject, ...]:
        """The objects it follows, without those that a clearing has hidden."""
        return self._objects.objects(now)

    def guarded_objects(self, now: float) -> tuple[TrackedObject, ...]:
        """The objects before which the robot must stop: the hidden ones too, and who has just begun to move."""
        return self._objects.guarded_objects(now)

    def lost_contact(
        self, box: RobotBox, pose: Pose, moving: Sequence[TrackedObject], now: float
    ) -> TrackedObject | None:
        """Who came within the margin and is out of sight since, for ``lost_contact_time``."""
        return self._objects.lost_contact(self.parameters, box, pose, moving, now)


def _near_hits(scan: RangeScan, limits: MovingObstaclesParameters) -> NDArray[np.int64]:
    """Which rays (n,) of a scan hit something at a distance within the limits."""
    distances = norm(scan.ends - scan.origin) if len(scan.ends) else np.zeros(0)
    near = scan.hits & (distances > limits.obstacle_min_range) & (distances <= limits.obstacle_max_range)
    return np.flatnonzero(near)
