"""An environment of Gymnasium: any scenario, driven step by step by whoever learns.

It runs in simulated time alone, in the lockstep clock of ``mbf run``: a step sends one command, and ``control_period``
seconds pass. An environment is reset and stepped by one thread, as its clock knows the one that has made the world. The
same seed and the same actions give the same bytes, on every CPU.

Example
-------
>>> import gymnasium
>>> environment = gymnasium.make("terrain.learning.ids:mbf/bench_indoor-v1", levels=[0, 1])
>>> observation, info = environment.reset(seed=40)
>>> observation, reward, terminated, truncated, info = environment.step([1.0, 0.0])
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from pydantic import ValidationError

from mbf_abstract.config.findings import format_key_path
from mbf_abstract.config.mistakes import mistakes_of
from mbf_abstract.geometry.tilt import tilt_of
from mbf_abstract.parameters import ParameterModel
from terrain.experiments.evaluation import indoor, moving, outdoor
from terrain.learning.command_range import CommandRange
from terrain.learning.episode import Ending, Episode
from terrain.learning.observation import Observation, ObservationParameters
from terrain.learning.reward import RewardParts, RewardWeights, StepFacts
from terrain.learning.worlds import Worlds, bench_indoor, bench_moving, bench_outdoor, one_world
from terrain.scenarios.scenario import Scenario
from terrain.session.simulation_session import SessionOptions
from terrain.urdf_robots.robot_choice import spec_of

Model = TypeVar("Model", bound=ParameterModel)
Values = Mapping[str, Any]

MOST_SEEDS = 2**31


class NavigationEnvironment(gymnasium.Env[dict[str, Any], NDArray[np.float32]]):
    """A robot that is to get to the goals of a scenario.

    Parameters
    ----------
    worlds : str, Scenario or callable
        Name of a shipped scenario, a file, a scenario with one robot, or a scenario for each seed, see
        ``terrain.learning.worlds``.
    backend : str, optional
        Map of planner and observation, instead of the scenario's own.
    settings : mapping of str to str
        Changes of world and configuration, as of ``mbf run --set``.
    observation : ObservationParameters or mapping, optional
        Parts of the observation; a scan only where the scenario has a lidar, if not given.
    commands : CommandRange or mapping, optional
        What actions mean; all that the robot can do, if not given. The limits of the configuration hold, too.
    control_period : float
        Length of a step [s]; at most ``command_timeout`` of the configuration.
    time_limit : float, optional
        Simulated time [s] at which an episode is truncated, instead of the scenario's own.
    seeds : (int, int)
        First seed, and one past the last one, of the worlds.

    Raises
    ------
    ConfigError
        The scenario is wrong; all findings. What its configuration lacks is found by ``reset``.
    ValueError
        Another argument is wrong.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012 - declared so by Gymnasium

    def __init__(
        self,
        worlds: str | Scenario | Worlds = "indoor",
        *,
        backend: str | None = None,
        settings: Mapping[str, str] | None = None,
        observation: ObservationParameters | Values | None = None,
        commands: CommandRange | Values | None = None,
        reward: RewardWeights | Values | None = None,
        control_period: float = 0.1,
        time_limit: float | None = None,
        seeds: tuple[int, int] = (0, MOST_SEEDS),
        render_mode: None = None,
    ) -> None:
        if not control_period > 0.0:
            raise ValueError(f"control_period: expected a time above 0 s, got {control_period}")
        if time_limit is not None and not time_limit > 0.0:
            raise ValueError(f"time_limit: expected a time above 0 s, got {time_limit}")
        if not (isinstance(seeds, tuple | list) and len(seeds) == 2 and 0 <= seeds[0] < seeds[1]):
            raise ValueError(f"seeds: expected a first one from 0 on, and a later one, got {seeds}")
        self.render_mode = render_mode
        self._worlds = worlds if callable(worlds) else one_world(worlds)
        first, _ = self._worlds(seeds[0])
        sees = ObservationParameters() if first.sensors else ObservationParameters(scan_sectors=0)
        self.observed = sees if observation is None else _model(ObservationParameters, observation)
        self.commands = _model(CommandRange, commands) if commands else CommandRange.of(spec_of(first.robot))
        self._weights = _model(RewardWeights, reward or {})
        self._options = SessionOptions(backend=backend, settings=dict(settings or {}))
        self._control_period, self._time_limit, self._seeds = control_period, time_limit, seeds
        self._episode: Episode | None = None
        bounds = self.observed.bounds()
        boxes: dict[str, spaces.Space[Any]] = {name: spaces.Box(*limits) for name, limits in bounds.items()}
        self.observation_space = spaces.Dict(boxes)
        self.action_space = spaces.Box(-1.0, 1.0, (self.commands.size,), np.float32)

    def reset(self, *, seed: int | None = None, options: Values | None = None) -> tuple[Observation, dict[str, Any]]:
        """Build a world, and return the first observation; ``info`` has the seed of the world.

        A seed of ``seeds`` is the one of the world, and any other one that is given is counted into ``seeds``, so that
        no episode is in a world that they leave out. Without one it is drawn from them, by the generator of the seed
        that was given last.

        Raises
        ------
        ConfigError, ValueError, RobotStateError
            As ``Episode``.
        """
        super().reset(seed=seed)
        first, end = self._seeds
        drawn = int(self.np_random.integers(first, end)) if seed is None else seed
        chosen = drawn if first <= drawn < end else first + drawn % (end - first)
        self.close()
        scenario, of_run = self._worlds(chosen)
        options_of_run = SessionOptions(backend=self._options.backend, seed=of_run, settings=self._options.settings)
        self._episode = episode = Episode(scenario, options_of_run, self.observed, self._control_period)
        self._ending = Ending.NOT_YET
        self._last_action = np.zeros(self.commands.size)
        self._limit = scenario.time_limit if self._time_limit is None else self._time_limit
        return episode.observe(), {"world_seed": chosen, "time": episode.time}

    def step(
        self, action: NDArray[np.float32] | Sequence[float]
    ) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Drive for ``control_period`` seconds.

        ``info`` has the parts of the reward, the simulated time [s] and, once the episode is over, its ``ending`` (see
        ``Ending``), the verdict of ``mbf run`` as a text, and whether it is a success.

        Raises
        ------
        gymnasium.error.ResetNeeded
            There is no episode, or it is over.
        ValueError
            The action has another shape, or is not finite.
        BaseException
            What has made the simulation fail; the episode is over.
        """
        episode = self._episode
        if episode is None or self._ending is not Ending.NOT_YET:
            raise gymnasium.error.ResetNeeded("call reset before the first step, and after an episode's end")
        command = self.commands.command(action)
        try:
            gained = episode.drive(command)
        except BaseException:
            self.close()
            raise
        self._ending = ending = episode.ending(self._limit)
        asked = np.clip(np.asarray(action, dtype=np.float64), -1.0, 1.0)
        facts = StepFacts(
            gained=gained,
            arrived=ending is Ending.ARRIVED,
            failed=ending in (Ending.CONTACT, Ending.TIPPED_OVER, Ending.LIMIT),
            tilt=tilt_of(episode.true_pose),
            change=float(np.square(asked - self._last_action).sum()),
            seconds=self._control_period,
        )
        self._last_action = asked
        parts = RewardParts.of(facts, self._weights)
        info: dict[str, Any] = {"reward_parts": parts.to_json(), "time": episode.time}
        if ending is not Ending.NOT_YET:
            verdict = episode.verdict(ending)
            info |= {"ending": ending.value, "verdict": str(verdict), "success": verdict.success}
        truncated = ending is Ending.TIME
        return episode.observe(), parts.total, ending is not Ending.NOT_YET and not truncated, truncated, info

    def close(self) -> None:
        """Free the world; idempotent."""
        if self._episode is not None:
            self._episode.close()
            self._episode = None


def of_bench_indoor(levels: Sequence[int] = range(indoor.LEVELS), **arguments: Any) -> NavigationEnvironment:
    """Make the environment over the rooms of ``mbf bench indoor``; ``arguments`` are those of the environment."""
    return NavigationEnvironment(bench_indoor(levels), **arguments)


def of_bench_outdoor(levels: Sequence[int] = range(outdoor.LEVELS), **arguments: Any) -> NavigationEnvironment:
    """Make the environment over the generated terrains of ``mbf bench outdoor``, likewise."""
    return NavigationEnvironment(bench_outdoor(levels), **arguments)


def of_bench_moving(
    levels: Sequence[int] = range(moving.LEVELS), people: str = moving.PARTS[0], **arguments: Any
) -> NavigationEnvironment:
    """Make the environment over the halls of ``mbf bench moving``, among people who yield or blind ones, likewise."""
    return NavigationEnvironment(bench_moving(levels, people), **arguments)


def _model(model: type[Model], values: Model | Values) -> Model:
    """Parameters of a dictionary; raises ValueError with a line for each that is wrong."""
    try:
        return values if isinstance(values, model) else model.model_validate(dict(values))
    except ValidationError as error:
        wrong = mistakes_of(model, dict(values), error.errors(include_url=False))
        known = ", ".join(model.model_fields)
        lines = [f"{format_key_path(one.loc)}: expected {one.expected}, got {one.got}" for one in wrong]
        raise ValueError("\n".join([*lines, f"known: {known}"])) from error
