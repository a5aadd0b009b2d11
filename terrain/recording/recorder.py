"""Collects a run while it happens and turns it into a ``Recording``.

Use one per run, on one thread: the runner's, which steps the simulator. Give it samples at a steady rate of 10 to
20 Hz; more makes files larger and pictures no better.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence, Sized
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from mbf_abstract.event_values import well_formed
from mbf_abstract.events import Event
from mbf_abstract.geometry import Command, FloatArray, Pose, Quaternion, Twist
from mbf_abstract.geometry.transform import IDENTITY_ROTATION
from mbf_abstract.maps.tracking.objects import TrackedObject
from mbf_abstract.maps.view import GridView, MapView, MeshView
from terrain.physics.protocols import Actor
from terrain.recording.actor_track import ActorTrack
from terrain.recording.recorded_maps import RecordedGrid, RecordedLayer, RecordedMesh, add_if_changed, half_precision
from terrain.recording.recorded_objects import RecordedObjects
from terrain.recording.recorded_robot import NO_REPORT, REPORTED, Report, ReportRecorder, RobotShape
from terrain.recording.recording import Recording, StampedPoints
from terrain.recording.verdict import UNFINISHED, Verdict
from terrain.worlds.surface import Surface

MAP_PERIOD = 5.0  # s at least between two looks at the map
LOCAL_MAP_PERIOD = 1.0  # s between two looks at the map around the robot, and at its outline
OBJECTS_PERIOD = 0.2  # s at least between two looks at what moves
MAX_GRID_CELLS = 4_000_000  # larger maps are not recorded
MAX_MESH_VERTICES = 1_000_000  # nor are these
MAX_MAP_COSTS = 200_000_000  # of all maps of a run together, a byte or two each; later ones are not recorded


class Taken(NamedTuple):
    """How much of each kind has been taken from a recorder."""

    samples: int = 0
    paths: int = 0
    scans: int = 0
    grids: int = 0
    meshes: int = 0
    layers: int = 0
    objects: int = 0
    outlines: int = 0
    local_grids: int = 0


@dataclass(eq=False)
class Recorder:
    """Collects a run while it happens; everything given is copied.

    Parameters
    ----------
    scenario, backend : str
        Names, for titles.
    goals : sequence of Pose
        More may be added to ``goals`` during the run.
    actors : sequence of Actor
        What moves by itself; looked at with every sample.
    map_budget : int
        How many costs of maps may still be recorded.
    reports : ReportRecorder
        What is not a true value, but what the navigation had.
    """

    scenario: str
    backend: str
    robot: RobotShape
    start: Pose
    goals: list[Pose]
    ground: Surface | None = None
    walls: Surface | None = None
    obstacles: Surface | None = None
    paths: list[StampedPoints] = field(default_factory=list)
    scans: list[StampedPoints] = field(default_factory=list)
    scan_origins: list[FloatArray] = field(default_factory=list)
    grids: list[RecordedGrid] = field(default_factory=list)
    meshes: list[RecordedMesh] = field(default_factory=list)
    layers: list[RecordedLayer] = field(default_factory=list)
    objects: list[RecordedObjects] = field(default_factory=list)
    actors: Sequence[Actor] = ()
    map_budget: int = MAX_MAP_COSTS
    reports: ReportRecorder = field(default_factory=ReportRecorder)
    _actor_poses: list[list[list[float]]] = field(default_factory=list)
    _next_map: float = -math.inf
    _next_objects: float = -math.inf
    _samples: list[list[float]] = field(default_factory=list)
    _taken: Taken = field(default_factory=Taken)

    def sample(self, time: float, pose: Pose, velocity: Twist, command: Command, report: Report = NO_REPORT) -> None:
        """Add one sample; call at a steady rate (10 to 20 Hz). Commands of a car are its speed and zero turning."""
        asked = [command.vx, command.vy, command.wz] if isinstance(command, Twist) else [command.speed, 0.0, 0.0]
        row = [time, *pose.position, *pose.orientation, velocity.vx, velocity.vy, velocity.wz, *asked, *report.row()]
        self._samples.append(row)
        self._actor_poses.append([[*p.position, *p.orientation] for p in (actor.pose() for actor in self.actors)])

    def path(self, time: float, points: ArrayLike) -> None:
        """Add a plan (m, 3) [m] that the robot follows from now on."""
        self.paths.append((time, np.array(points, dtype=np.float64).reshape(-1, 3)))

    def scan(
        self,
        time: float,
        points: ArrayLike,
        origin: ArrayLike,
        sensor: str = "",
        orientation: Quaternion = IDENTITY_ROTATION,
    ) -> None:
        """Add the points (k, 3) [m] that a range sensor at ``origin`` (3,) [m] hit, in the map.

        Parameters
        ----------
        sensor : str
            Its frame, one of the mounts of ``reports``; empty if that is not known.
        orientation : (4,) float
            Its orientation in the map.
        """
        self.scans.append((time, np.array(points, dtype=np.float64).reshape(-1, 3)))
        self.scan_origins.append(np.array(origin, dtype=np.float64).reshape(3))
        self.reports.scan(sensor, orientation)

    def map(self, time: float, look: Callable[..., MapView | None], layers: Sequence[str] = ()) -> None:
        """Add what the map looks like now, unless it is too large or was looked at some seconds ago.

        Parameters
        ----------
        look : callable
            Gives the map, or what has the name that it is called with.
        layers : sequence of str
            Names of a mesh's layers, which are added with the first look.
        """
        if time < self._next_map or self.map_budget <= 0:
            return
        self._next_map = time + MAP_PERIOD
        view = look()
        self.map_budget -= 0 if view is None else view.costs.size
        if isinstance(view, GridView) and view.costs.size <= MAX_GRID_CELLS:
            self.grids.append(RecordedGrid.of(time, view))
        elif isinstance(view, MeshView) and view.costs.size <= MAX_MESH_VERTICES:
            add_if_changed(self.meshes, time, view)
            if not self.layers:
                self._add_layers(look, layers)

    def _add_layers(self, look: Callable[..., MapView | None], names: Sequence[str]) -> None:
        """Add the costs of layers, as many as there is room for."""
        for name in names:
            view = look(name) if self.map_budget > 0 else None
            if view is not None:
                self.map_budget -= view.costs.size
                self.layers.append(
                    RecordedLayer(name, half_precision(view.costs), view.unit if isinstance(view, MeshView) else "")
                )

    def tracked(self, time: float, look: Callable[[], Iterable[TrackedObject]]) -> None:
        """Add the objects that the robot knows of now, in the map, unless that was looked at just before.

        That there are none is added once, after the last ones.
        """
        if time < self._next_objects:
            return
        self._next_objects = time + OBJECTS_PERIOD
        found = RecordedObjects.of(time, look())
        if len(found.rows) or (self.objects and len(self.objects[-1].rows)):
            self.objects.append(found)

    def finish(self, verdict: Verdict = UNFINISHED, events: Sequence[Event] = (), began: float = 0.0) -> Recording:
        """Return what was recorded; ``began`` [s] is the events' time at which the samples' time was 0."""
        return self._recording(Taken(), self._all(), verdict, events, began)

    def take(self, events: Sequence[Event] = (), began: float = 0.0) -> Recording:
        """Return what has come since this was called last, with these events; surfaces the first time only."""
        part, self._taken = self.since(self._taken, events, began)
        return part

    def since(self, before: Taken, events: Sequence[Event] = (), began: float = 0.0) -> tuple[Recording, Taken]:
        """Return what has come since ``before``, with these events, and where the next part begins.

        Surfaces are in the first part only. ``began`` is as in ``finish``.
        """
        now = self._all()
        return self._recording(before, now, UNFINISHED, events, began), now

    def _all(self) -> Taken:
        kept: tuple[Sized, ...] = (self._samples, self.paths, self.scan_origins, self.grids, self.meshes, self.layers)
        return Taken(*map(len, (*kept, self.objects, self.reports.outlines, self.reports.local_grids)))

    def _recording(
        self, before: Taken, now: Taken, verdict: Verdict, events: Sequence[Event], began: float
    ) -> Recording:
        """Return all from ``before`` to ``now``."""
        rows = np.array(self._samples[before.samples : now.samples], dtype=np.float64).reshape(-1, 14 + REPORTED)
        meshes = self.meshes[before.meshes : now.meshes]
        if before.meshes:  # the surface has been taken
            meshes = [replace(mesh, vertices=np.zeros((0, 3)), faces=np.zeros((0, 3), np.int32)) for mesh in meshes]
        ground, walls, obstacles = (
            (self.ground, self.walls, self.obstacles) if before == Taken() else (None, None, None)
        )
        return Recording(
            scenario=well_formed(self.scenario),
            backend=well_formed(self.backend),
            robot=self.robot,
            ground=ground,
            walls=walls,
            obstacles=obstacles,
            start=self.start,
            goals=tuple(self.goals),
            times=rows[:, 0].copy(),
            poses=rows[:, 1:8].copy(),
            twists=rows[:, 8:11].copy(),
            commands=rows[:, 11:14].copy(),
            paths=self.paths[before.paths : now.paths],
            scans=self.scans[before.scans : now.scans],
            scan_origins=np.array(self.scan_origins[before.scans : now.scans]).reshape(-1, 3),
            events=tuple(replace(event, time=max(0.0, round(event.time - began, 9))) for event in events),
            verdict=verdict,
            grids=self.grids[before.grids : now.grids],
            meshes=meshes,
            layers=self.layers[before.layers : now.layers],
            actors=self._actor_tracks(before.samples, now.samples),
            objects=self.objects[before.objects : now.objects],
            reports=self.reports.between(
                rows[:, 14:].copy(),
                slice(before.scans, now.scans),
                slice(before.outlines, now.outlines),
                slice(before.local_grids, now.local_grids),
            ),
        )

    def actor_tracks(self) -> list[ActorTrack]:
        """Return what moves by itself, and where it was at each sample so far."""
        return self._actor_tracks(0, len(self._samples))

    def _actor_tracks(self, first: int, last: int) -> list[ActorTrack]:
        rows = self._actor_poses[first:last]
        poses = np.array(rows, dtype=np.float64).reshape(len(rows), len(self.actors), 7)
        return [ActorTrack(a.thing.value, *a.looks, poses[:, number]) for number, a in enumerate(self.actors)]
