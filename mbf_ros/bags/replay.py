"""A bag replayed through a navigation server, at the recorded times on a clock of its own.

Every message reaches the transform buffer and the layers when it was recorded, in simulated time, so a replay gives the
same results each time, however fast the computer is. A scan is placed as on a robot: by the transforms that had come
by then, see ``mbf_abstract.maps.scan_intake``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from mbf_abstract.config.configuration import Config
from mbf_abstract.drive_log import DriveLog
from mbf_abstract.events import Event, EventKind
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.plugins import PluginKind
from mbf_abstract.server.map_server import MapServer
from mbf_abstract.server.navigation_server import AbstractNavigationServer
from mbf_abstract.session import NavigationSession
from mbf_ros.bags.inputs import BagInputs, RecordedRobot
from mbf_ros.bags.observation import Observation
from mbf_ros.bags.planning import ReplayedPlan
from mbf_ros.bags.reading import Bag
from mbf_ros.bags.recorded_time import RecordedTime, check_end, steady_messages
from mbf_ros.bags.replay_options import ReplayOptions
from mbf_ros.bags.statistics import FrameStatistics, TopicStatistics
from mbf_ros.bags.topics import check_transforms, choose_topics
from mbf_ros.messages.geometry import MessageContext
from mbf_ros.robot_inputs import RobotInputs

SAMPLE_PERIOD = 0.1  # s
PICTURES = 10  # of the map, where the user asks for none
MOST_PICTURES = 200


@dataclass(frozen=True)
class Replayed:
    """What came of it; times in seconds from the beginning of the bag.

    Attributes
    ----------
    stamp_shift : float
        By how much stamps were moved onto the clock of the recording.
    topics, frames
        Statistics.
    poses_unknown : int
        Samples of a tenth of a second at which the robot's pose was unknown or old.
    sources_without_topic : tuple of str
        Observation sources of the configuration that the bag has no topic for; without those the user wants none for.
    faults : tuple of str
        What went wrong in the server: scans that a map did not take, layers that raised.
    plan : mapping, optional
        See ``ReplayedPlan.to_json``.
    """

    log: DriveLog
    duration: float
    stamp_shift: float
    topics: Mapping[str, TopicStatistics]
    frames: Mapping[str, FrameStatistics]
    poses_unknown: int
    sources_without_topic: tuple[str, ...]
    faults: tuple[str, ...]
    plan: Mapping[str, Any] | None


def replay_bag(
    bag: Bag,
    server_class: type[AbstractNavigationServer],
    config: Config,
    options: ReplayOptions,
    on_progress: Callable[[str], None] = lambda text: None,
) -> Replayed:
    """Replay a bag into a new server of a configuration.

    Raises
    ------
    BagError
        The bag is damaged, too long or without transforms, or it is not clear which of its topics is what.
    ValueError
        An option does not fit the bag or the configuration.
    """
    if not issubclass(server_class, MapServer):
        raise ValueError(f"the backend {config.backend!r} has no maps that sensors feed")
    check_end("--at", options.at, bag)
    with NavigationSession() as session:
        robot, transforms = RecordedRobot(), TransformBuffer(config.parameters.tf_cache_time)
        server = session.serve(server_class, config, robot, transforms)
        if options.goal is not None and (problem := server.plugins.problem(PluginKind.PLANNER, options.planner)):
            raise ValueError(f"--planner: {problem}")
        for transform in options.transforms:
            transforms.set(transform)
        maps = RobotInputs(session.clock.now, lambda: MessageContext(config.parameters.global_frame)).of_maps(server)
        sources, takes_any = _sources(server)
        topics = choose_topics(bag.types, options.topics, sources, takes_any, maps)
        check_transforms(bag, topics, options.transforms, options.odometry_as_transform)
        time = RecordedTime(bag, topics, config.parameters.global_frame)
        inputs = BagInputs(bag, topics, time, server, robot, options.odometry_as_transform)
        observation = Observation(server, robot, options.map_name, time.began, time.duration)
        inputs.scan_listeners.append(observation.take_scan)
        with server.using_map(PluginKind.PLANNER):
            player = _Player(session, server, time, observation, options, on_progress)
            plan = player.play(bag, inputs)
        found = {source for _, source in topics.sensors.values()}
        missing = tuple(one for one in sources if one not in found and one not in options.topics)
        return _replayed(bag, session.memory.events, time, inputs, observation, plan, missing)


class _Player:
    """Lets time pass up to each message, and looks at the server in between."""

    def __init__(
        self,
        session: NavigationSession,
        server: MapServer,
        time: RecordedTime,
        observation: Observation,
        options: ReplayOptions,
        on_progress: Callable[[str], None],
    ) -> None:
        self._clock, self._server, self._time = session.clock, server, time
        self._observation, self._on_progress = observation, on_progress
        self._plan = None
        if options.goal is not None:
            self._plan = ReplayedPlan(session.navigator, options.goal, options.planner, observation.frame_id)
        self._plan_at = time.began + options.at
        self._every = options.every or max(time.duration / PICTURES, SAMPLE_PERIOD)
        count = math.ceil(time.duration / self._every) + 1
        if count > MOST_PICTURES:
            raise ValueError(f"--every {self._every:g}: expected at most {MOST_PICTURES} pictures, got {count}")
        observation.check_pictures(count)
        self._samples = self._pictures = 0
        self._is_planned = False

    def play(self, bag: Bag, inputs: BagInputs) -> ReplayedPlan | None:
        """Play all messages; returns the plan, if one is asked for."""
        for recorded in steady_messages(bag):
            due = max(self._time.of_recording(recorded.time), self._clock.now())
            self._pass_time(due)
            inputs.take(recorded, due)
        self._pass_time(self._time.began + self._time.duration)
        for served in self._server.served.values():
            served.update()
        self._observation.look_at_map(self._clock.now())
        if self._plan is not None:
            if not self._is_planned:
                self._plan.begin(self._clock.now())
            self._plan.finish()
        return self._plan

    def _pass_time(self, until: float) -> None:
        while (tick := self._time.began + self._samples * SAMPLE_PERIOD) <= until:
            self._plan_if_due(tick)
            self._clock.sleep_until(tick)
            self._samples += 1
            self._look(tick)
        self._plan_if_due(until)
        self._clock.sleep_until(until)

    def _look(self, now: float) -> None:
        self._observation.sample(now)
        if now >= self._time.began + (self._pictures + 1) * self._every:
            self._pictures += 1
            self._observation.look_at_map(now)
            self._on_progress(f"replaying, {now - self._time.began:.0f} of {self._time.duration:.0f} s")
        if self._plan is not None:
            self._plan.look()

    def _plan_if_due(self, until: float) -> None:
        """Plan on the map of the time that was asked for: with a planner that does not wait, nothing comes between."""
        if self._plan is None or self._is_planned or self._plan_at > until:
            return
        self._is_planned = True
        self._clock.sleep_until(self._plan_at)
        self._plan.begin(self._plan_at)
        for _ in ("planned", "refined"):
            self._clock.settle()
            self._plan.look()


def _sources(server: MapServer) -> tuple[list[str], bool]:
    """Observation sources of all maps, and whether a layer takes any other."""
    maps = [served.map for served in server.served.values()]
    named = sorted({name for one in maps for name in one.source_names})
    return named, any(one.listens_to("") for one in maps)


def _replayed(
    bag: Bag,
    events: tuple[Event, ...],
    time: RecordedTime,
    inputs: BagInputs,
    observation: Observation,
    plan: ReplayedPlan | None,
    missing: tuple[str, ...],
) -> Replayed:
    kept = [replace(event, time=round(event.time - time.began, 9)) for event in events if event.time >= time.began]
    faults = [
        f"{event.time:.3f} s: {event.source}: {event.data.get('message', '')}"
        for event in kept
        if event.kind is EventKind.FAULT
    ]
    result = None if plan is None else plan.result
    log = observation.log(
        bag.path.name,
        plan,
        None if result is None else int(result.outcome),
        "replayed from a bag" if result is None else f"planned in a replay: {result.message}",
        kept,
    )
    as_json = None if plan is None else plan.to_json(time.began)
    return Replayed(
        log,
        time.duration,
        time.stamp_shift,
        inputs.topics,
        inputs.frames,
        observation.poses_unknown,
        missing,
        tuple(faults),
        as_json,
    )
