"""All that is wrong with a scenario, in one list: its file, its configurations, its world, its places, its plugins.

What can be checked is checked, whatever else is wrong: configurations of a scenario with mistakes, plugins of one
backend where another one's configuration has mistakes.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from mbf_abstract.config.bounded_files import is_file
from mbf_abstract.config.findings import ConfigError, Finding, KeyPath, text_of
from mbf_abstract.config.yaml_source import YamlDocument
from mbf_abstract.server.factory import read_config
from mbf_abstract.server.standing_server import standing_server
from mbf_abstract.time.program_end import is_for_the_program
from terrain.description.placeholders import fill_in
from terrain.provenance.named_files import InputCopies
from terrain.scenarios.environment import build_environment, with_noise
from terrain.scenarios.noise import MapNoise
from terrain.scenarios.places import Place
from terrain.scenarios.scenario import Scenario, read_scenario, robot_scenarios
from terrain.scenarios.settings import apply_world_settings
from terrain.scenarios.world import ScenarioWorld
from terrain.session.navigation_config import errors_in_source, write_navigation_config
from terrain.session.robot_fit import notes_on_fit
from terrain.session.site import StartingRobot, overlapping_starts
from terrain.urdf_robots.robot_choice import RobotChoice, description_of, notes_on, spec_of
from terrain.worlds.generate import flat_terrain
from terrain.worlds.map_files import MapFiles

STAND_IN_SIZE, STAND_IN_SPACING = 20.0, 0.25  # m
STAND_IN_LETHAL_SLOPE = 30.0  # degrees; nothing of it is steep
STAND_IN = "husky"

Maps = Mapping[str, Path]


@dataclass(frozen=True)
class ScenarioReport:
    """What a check has found; ``scenario`` is None where the file is none."""

    scenario: Scenario | None
    findings: tuple[Finding, ...]
    notes: tuple[str, ...] = ()


def check_scenario(
    document: YamlDocument,
    backend: str | None = None,
    seed: int | None = None,
    settings: Mapping[str, str] | None = None,
    load: bool = True,
    change: Callable[[Scenario], Scenario] = lambda scenario: scenario,
) -> ScenarioReport:
    """Check a scenario and everything that it names.

    Parameters
    ----------
    document : YamlDocument
        The scenario's file.
    backend : str, optional
        Check the configuration of this backend only.
    seed : int, optional
        Of the world, instead of the scenario's own.
    settings : mapping, optional
        As for a run, see ``terrain.scenarios.settings``.
    load : bool
        Also build the world, read the maps and construct the plugins.
    change : callable
        What a run makes of the scenario, such as to take it to another map.
    """
    findings, notes, rest = list[Finding](), list[str](), dict[str, str]()
    scenario = read_scenario(document, findings)
    if scenario is not None and not findings:
        with _Collecting(findings, document, ("world",)):
            scenario, rest = apply_world_settings(change(scenario), settings or {})
    files: list[tuple[str, Path, RobotChoice]] = [(*pair, STAND_IN) for pair in _configurations(document).items()]
    if scenario is not None:
        views = robot_scenarios(scenario).values()
        files = list(dict.fromkeys((*pair, view.robot) for view in views for pair in view.navigation.items()))
    chosen = [(name, file, robot) for name, file, robot in files if backend in (None, name) and is_file(file)]
    known = list(dict.fromkeys(name for name, _, _ in files))
    if backend is not None and files and backend not in known:
        findings.append(document.finding(("navigation",), f"one of {', '.join(known)}", repr(backend)))
    if scenario is not None and not findings:
        notes += [note for view in robot_scenarios(scenario).values() for note in notes_on(view.robot)]
    good = [(name, file, robot) for name, file, robot in chosen if _reads_well(file, robot, rest, findings)]
    if load and scenario is not None and not any(finding.file == str(document.path) for finding in findings):
        with tempfile.TemporaryDirectory(prefix="mbf_check_") as folder:
            maps = _check_world(scenario, seed, document, Path(folder), findings)
            for name, file, robot in good if maps is not None else ():
                found = _check_server(file, robot, maps or {}, rest, Path(folder), findings)
                notes += [f"{name}: {note}" for note in found]
    return ScenarioReport(scenario, tuple(dict.fromkeys(findings)), tuple(dict.fromkeys(notes)))


def check_on_level_ground(file: Path) -> list[Finding]:
    """Load a configuration on level ground, with a Husky, instead of a scenario's world and robot; what is wrong."""
    findings: list[Finding] = []
    with tempfile.TemporaryDirectory(prefix="mbf_check_") as folder:
        ground = flat_terrain(STAND_IN_SIZE, STAND_IN_SIZE, STAND_IN_SPACING)
        files = MapFiles(Path(folder), MapNoise(), np.random.default_rng(0))
        maps = files.of_terrain(ground, STAND_IN_LETHAL_SLOPE)
        _check_server(file, STAND_IN, maps, {}, Path(folder), findings)
    return findings


def _configurations(document: YamlDocument) -> dict[str, Path]:
    """Configurations that a file names which is no legal scenario."""
    named = document.data.get("navigation")
    pairs = named.items() if isinstance(named, Mapping) else ()
    return {str(backend): document.path.parent / file for backend, file in pairs if isinstance(file, str)}


def _reads_well(file: Path, robot: RobotChoice, settings: Mapping[str, str], findings: list[Finding]) -> bool:
    """Whether a configuration has no mistakes before its map is known.

    Settings, and keys with numbers of the robot, are looked at when it is loaded.
    """
    if settings:
        return True
    with _Collecting(findings, file) as collecting:
        text = file.read_text(encoding="utf-8-sig")
        if fill_in(text, str(file), partial(description_of, robot)) == text:
            read_config(file)
    return not collecting.failed


def _check_world(
    scenario: Scenario, seed: int | None, document: YamlDocument, folder: Path, findings: list[Finding]
) -> Maps | None:
    """Build the world and look for start and goals on it; returns its map files."""
    with _Collecting(findings, document, ("world",)):
        world, _ = build_environment(with_noise(scenario), folder, scenario.seed if seed is None else seed)
        try:
            _check_places(scenario, world, document, findings)
            _check_starts(scenario, world, document, findings)
        finally:
            world.physics.close()
        return world.files
    return None  # not reached unless the world could not be built


def _check_places(scenario: Scenario, world: ScenarioWorld, document: YamlDocument, findings: list[Finding]) -> None:
    places: list[tuple[KeyPath, Place | None]] = []
    for number, view in enumerate(robot_scenarios(scenario).values()):
        block: KeyPath = ("robots", number) if scenario.robots else ()
        places.append(((*block, "start"), view.start))
        places += [((*block, "goals", index), goal) for index, goal in enumerate(view.goals)]
    for key, place in places:
        if place is None:  # read_scenario has reported it
            continue
        try:
            pose = world.pose_of(place)
        except ConfigError as error:
            findings += [document.finding(key, wrong.expected, wrong.got, wrong.hint) for wrong in error.findings]
            continue
        if world.has_wall_at(pose):
            findings.append(document.finding(key, "a place outside the walls", f"({pose.x:g}, {pose.y:g})"))
        for number, obstacle in enumerate(scenario.obstacles if key[-1] == "start" else ()):
            apart = abs(pose.z - world.height_at(obstacle.x, obstacle.y))
            if obstacle.holds(pose.x, pose.y) and apart < obstacle.size[2]:
                at = f"({pose.x:g}, {pose.y:g}), inside of obstacles[{number}]"
                findings.append(document.finding(key, "a place outside the obstacles", at))


def _check_starts(scenario: Scenario, world: ScenarioWorld, document: YamlDocument, findings: list[Finding]) -> None:
    """Compare the starts of several robots, once each of them is a place."""
    robots: dict[str, StartingRobot] = {}
    with suppress(ConfigError):  # _check_places has reported it
        for name, view in robot_scenarios(scenario).items():
            if view.start is not None:
                robots[name] = StartingRobot(spec_of(view.robot), world.pose_of(view.start))
        findings += map(document.located, overlapping_starts(robots))


def _check_server(
    source: Path, robot: RobotChoice, maps: Maps, settings: Mapping[str, str], folder: Path, findings: list[Finding]
) -> list[str]:
    """Read the maps and construct the plugins of a configuration; returns the notes of its server."""
    with _Collecting(findings, source) as collecting, errors_in_source(source, folder, settings):
        file = write_navigation_config(source, robot, maps, folder, settings, InputCopies(folder))
        collecting.renamed = {str(file): str(source), str(folder): str(source.parent)}
        with standing_server(*read_config(file), spec_of(robot).min_turning_radius) as server:
            return [*server.notes, *notes_on_fit(server, robot)]
    return []


class _Collecting:
    """Turns whatever is raised in its block into findings about a file, or about a key of a document."""

    def __init__(self, findings: list[Finding], where: Path | YamlDocument, key: KeyPath = ()) -> None:
        self.failed = False
        self.renamed: Mapping[str, str] = {}
        self._findings, self._where, self._key = findings, where, key

    def __enter__(self) -> _Collecting:
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> bool:
        if not isinstance(error, Exception) or is_for_the_program(error):
            return False
        self.failed = True
        self._findings += self._findings_of(error)
        return True

    def _findings_of(self, error: Exception) -> Iterable[Finding]:
        if isinstance(error, ConfigError):
            return [self._with_its_file(wrong) for wrong in error.findings]
        got = f"{type(error).__name__}: {text_of(error)}"
        for name, other in self.renamed.items():
            got = got.replace(name, other)
        if isinstance(self._where, YamlDocument):
            return [self._where.finding(self._key, "a world that can be built", got)]
        return [Finding(str(self._where), 1, "", "a map and plugins that can be built", got)]

    def _with_its_file(self, wrong: Finding) -> Finding:
        if isinstance(self._where, YamlDocument) and wrong.file == "scenario":  # as what builds a world calls it
            return self._where.located(wrong)
        return replace(wrong, file=self.renamed.get(wrong.file, wrong.file))
