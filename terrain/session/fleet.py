"""Several robots in one world, each with its own navigation server, on one clock. They announce where they go.

Example
-------
>>> with FleetSession("two_couriers") as fleet:
...     for name, session in fleet.sessions.items():
...         session.navigator.send(MoveBaseGoal(session.goals[0]))
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import replace

from mbf_abstract.events import Event, EventSink
from mbf_abstract.server.announcer import Announcer
from mbf_abstract.time.clock import TIME_RESOLUTION, Clock
from mbf_abstract.traffic.traffic import SharedChannel
from terrain.scenarios.scenario import Scenario, robot_scenarios
from terrain.scenarios.settings import apply_world_settings
from terrain.session.navigation_config import errors_in_scenario
from terrain.session.session import DEFAULT_OPTIONS, Member, Session, SessionOptions
from terrain.session.simulation_session import SENSE_FIRST
from terrain.session.site import Site

ANNOUNCING_PERIOD = 0.5  # s


class Periodically:
    """Makes a call each ``period`` [s]; called with the time [s]."""

    def __init__(self, period: float, call: Callable[[], None]) -> None:
        self._period = period
        self._call = call
        self._next = 0.0

    def __call__(self, time: float) -> None:
        """Call if it is due."""
        if time >= self._next - TIME_RESOLUTION:
            self._next = time + self._period
            self._call()


class NamedSink(EventSink):
    """Hands the events of one robot on, its name before their sources: ``anna/move_base``.

    The sink stays open when this one is closed, because other robots share it.
    """

    def __init__(self, name: str, sink: EventSink) -> None:
        self._name = name
        self._sink = sink

    def write(self, event: Event) -> None:
        """Hand an event on."""
        self._sink.write(replace(event, source=f"{self._name}/{event.source}"))


class FleetSession:
    """A scenario with ``robots``, built and running; a context manager in which time passes.

    The robots are stepped and served in the order of the scenario. Each draws from a seed of its own, made of the run's
    seed and its name, so that a further robot does not change what the others draw.

    Parameters
    ----------
    scenario : Scenario or str
        A scenario, the name of a shipped one, or a file.
    options : SessionOptions
        Of all robots; each has a folder by its name in ``folder``.
    sinks : mapping of str to tuple of EventSink, optional
        Where the events of each robot go, beside its session's memory.

    Attributes
    ----------
    sessions : dict of str to Session
        Of the robots, by name.
    seed : int

    Raises
    ------
    ConfigError
        As ``Session`` does; or two robots would start in one place.
    """

    def __init__(
        self,
        scenario: Scenario | str,
        options: SessionOptions = DEFAULT_OPTIONS,
        sinks: Mapping[str, tuple[EventSink, ...]] | None = None,
    ) -> None:
        with errors_in_scenario(scenario) as loaded:
            self._build(loaded, options, sinks or {})

    def _build(self, loaded: Scenario, options: SessionOptions, sinks: Mapping[str, tuple[EventSink, ...]]) -> None:
        """The site, then the sessions of all robots in it."""
        self.scenario, settings = apply_world_settings(loaded, options.settings)
        self.seed = self.scenario.seed if options.seed is None else options.seed
        views = robot_scenarios(self.scenario)
        seeds = {name: seed_of(self.seed, name) for name in views}
        self.sessions: dict[str, Session] = {}
        with ExitStack() as closing:
            self._site = Site(self.scenario, options, self.seed, seeds)
            closing.callback(self._site.close)
            for name, view in views.items():
                own_sinks = (*options.sinks, *sinks.get(name, ()))
                own = replace(options, seed=seeds[name], settings=settings, sinks=own_sinks)
                session = Session(view, own, Member(self._site, name))
                closing.callback(session.close)
                self.sessions[name] = session
            channel = SharedChannel()
            for name, session in self.sessions.items():
                announcer = Announcer(session.navigator.server, name, channel)
                session.loop.on_tick.append(Periodically(ANNOUNCING_PERIOD, announcer.announce))
            self._leader, *others = [session.loop for session in self.sessions.values()]
            self._leader.lead(others)
            closing.callback(self._leader.stop)
            self._closing = closing.pop_all()

    @property
    def clock(self) -> Clock:
        """The clock of all robots."""
        return self._site.clock

    def run(self) -> None:
        """Let time pass: start stepping the simulator, and wait until sensors and maps are alive."""
        self._leader.start()
        self.clock.sleep(SENSE_FIRST)

    def close(self) -> None:
        """Stop the simulator, then all robots and their servers; once."""
        self._closing.close()

    def __enter__(self) -> FleetSession:
        self.run()
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()


def seed_of(seed: int, name: str) -> int:
    """Return the seed of one robot in a run."""
    return zlib.crc32(f"{seed} {name}".encode())
