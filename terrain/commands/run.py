"""The command ``mbf run``, and the registration of those around it, each in a module of its own."""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from mbf_abstract.commands.completion import complete_backend, complete_controller, complete_planner
from mbf_abstract.commands.foxglove_options import AT, FOXGLOVE, ORIGIN, READ_ONLY, TOKEN, foxglove_of, refuse_without
from mbf_abstract.commands.reporting import FAILURE, readable_errors
from terrain.commands.command_line import command_line
from terrain.commands.compare import compare
from terrain.commands.completion import SCENARIO
from terrain.commands.new_run import RUNS, new_run_folder
from terrain.commands.replay import open_replay, replay, replay_page
from terrain.commands.rerun import rerun
from terrain.commands.scenarios import scenarios

if TYPE_CHECKING:
    from collections.abc import Callable
    from contextlib import AbstractContextManager

    from terrain.scenarios.scenario import Scenario
    from terrain.session.run_options import Progress
    from terrain.session.runner import RunOptions, RunResult

SERVERS = "mbf.servers"


def register(app: typer.Typer) -> None:
    """Add the commands to the application ``mbf``."""
    app.command("run")(run)
    app.command("rerun")(rerun)
    app.command("scenarios")(scenarios)
    app.command("replay")(replay)
    app.command("compare")(compare)


def run(
    context: typer.Context,
    scenario: str = SCENARIO,
    backend: str = typer.Option(
        "",
        "--backend",
        help="Map backend: mesh or costmap; the scenario's own if not given.",
        autocompletion=complete_backend,
    ),
    seed: int | None = typer.Option(None, "--seed", min=0, help="Seed of sensors and plugins; else the scenario's."),
    out: Path | None = typer.Option(None, "--out", help="Folder for the results; runs/<time> if not given."),
    map_file: Path | None = typer.Option(None, "--map", help="Drive in the building of this map_server yaml instead."),
    planner: str = typer.Option(
        "", "--planner", help="Planner to use: a name in the configuration, or a type.", autocompletion=complete_planner
    ),
    controller: str = typer.Option(
        "", "--controller", help="Controller to use, likewise.", autocompletion=complete_controller
    ),
    settings: list[str] = typer.Option(
        [], "--set", help="KEY=VALUE: world.KEY of the scenario, or a dotted path of the configuration; repeatable."
    ),
    wall_clock: bool = typer.Option(False, "--wall-clock", help="Real time instead of as fast as possible."),
    executive: str = typer.Option(
        "move_base",
        "--executive",
        help="Who decides: move_base, classic, a tree (see mbf tree list), or module:function.",
    ),
    view: bool = typer.Option(False, "--view", help="Serve a page to watch and steer the run, until Ctrl-C."),
    view_port: int = typer.Option(8080, "--view-port", min=1, max=65535, help="Port of the page; the next free one."),
    view_host: str = typer.Option(
        "127.0.0.1", "--view-host", help="Interface of the page; others than loopback are not encrypted."
    ),
    view_token: bool = typer.Option(
        True, "--view-token/--no-view-token", help="A token in the page's address, without which access is refused."
    ),
    view_read_only: bool = typer.Option(False, "--view-read-only", help="Watching only, no steering."),
    view_speed: float = typer.Option(
        1.0, "--view-speed", min=0.0, help="While watched: at most so many times real time; 0 = no limit."
    ),
    foxglove: bool = FOXGLOVE,
    foxglove_at: str = AT,
    foxglove_token: bool = TOKEN,
    foxglove_read_only: bool = READ_ONLY,
    foxglove_origin: list[str] = ORIGIN,
    ros2: bool = typer.Option(
        False, "--ros2", help="The robot is a node of ROS 2, and whoever publishes cmd_vel drives it; see docs/ros2.md."
    ),
    ros2_stamped: bool = typer.Option(False, "--ros2-stamped", help="With --ros2: cmd_vel is a TwistStamped."),
    ros2_lockstep: bool = typer.Option(
        False, "--ros2-lockstep", help="With --ros2: wait for the command of each control period while it moves."
    ),
    ros2_patience: float = typer.Option(
        60.0, "--ros2-patience", min=1.0, help="With --ros2: end after so long without a command to move, in s."
    ),
    stay: bool = typer.Option(True, "--stay/--no-stay", help="While watched: wait for goals from there at the end."),
    show: bool = typer.Option(
        False, "--open", help="Open the page of --view in the browser, and the replay at the end."
    ),
    quiet: bool = typer.Option(False, "--quiet", help="Print the result without progress."),
    as_json: bool = typer.Option(False, "--json", help="Print one JSON object with verdict and metrics."),
) -> None:
    """Drive a scenario in the simulator; exit code 0 only if the run is a success.

    Success: it arrived, broke no limit, did not tip over and touched nothing while it moved. Else the code is 1, and 2
    for a mistake in scenario, configuration or arguments.
    """
    chosen = settings_of(settings, planner=planner, controller=controller)
    if not ros2:
        refuse_without(context, "--ros2", "ros2_stamped", "ros2_lockstep", "ros2_patience")
    if not view:
        refuse_without(context, "--view", "view_port", "view_host", "view_token", "view_read_only")
    if not (view or foxglove):
        refuse_without(context, "--view or --foxglove", "view_speed", "stay")
    folder = out or new_run_folder(RUNS, datetime.now())
    with readable_errors(folder):
        from terrain.commands.live_line import LiveLine
        from terrain.session.runner import RunOptions
        from terrain.viewer.results import write_joint_results, write_results

        app = foxglove_of(context)
        with LiveLine(show=not (quiet or as_json)) as live:
            options = RunOptions(
                folder=folder,
                command=command_line(context),
                backend=backend or None,
                seed=seed,
                wall_clock=wall_clock,
                settings=chosen,
                on_progress=live.progress,
                on_step=live.step,
                on_note=live.note,
                executive=executive,
                geodesic=True,
                write_views=partial(write_results, on_step=live.step),
                write_joint_views=partial(write_joint_results, on_step=live.step),
            )
            if view or foxglove:
                from terrain.commands.watching import watched
                from terrain.viewer.live.session import ViewOptions

                page = ViewOptions(view_host, view_port, view_speed, view_token, view_read_only)
                options = watched(replace(options, stay=stay), page if view else None, app, view_speed, live, show)
            if ros2:
                from terrain.commands.robot_on_ros import driven_over_ros

                options = driven_over_ros(options, ros2_stamped, ros2_lockstep, ros2_patience)
            result = _driven(scenario, map_file, options, over_ros=ros2)
    _print_result(result, as_json)
    if show:
        open_replay(folder)
    if not result.success:
        raise typer.Exit(FAILURE)


def _driven(scenario: str, map_file: Path | None, options: RunOptions, over_ros: bool) -> RunResult:
    """Drive a scenario, on another map if one is given; raises all that is wrong with it where it cannot begin."""
    from mbf_abstract.config.findings import ConfigError
    from mbf_abstract.server.plugin_host import ServerError
    from terrain.scenarios.on_map import on_map
    from terrain.scenarios.scenario import load_scenario, scenario_file
    from terrain.session.runner import run_scenario

    def on_other_map(loaded: Scenario) -> Scenario:
        return loaded if map_file is None else on_map(loaded, map_file)

    try:
        loaded = load_scenario(scenario)
        if over_ros:
            from terrain.commands.robot_on_ros import require_one_robot

            require_one_robot(loaded, scenario_file(scenario))
        with _compiling_ahead(options.backend or loaded.backend) as look_after:

            def on_progress(progress: Progress) -> None:
                look_after()
                options.on_progress(progress)

            return run_scenario(on_other_map(loaded), replace(options, on_progress=on_progress))
    except (ConfigError, ServerError) as error:
        raise _all_that_is_wrong(error, scenario, options, on_other_map) from error.__cause__  # it may be the same


def _compiling_ahead(backend: str) -> AbstractContextManager[Callable[[], None]]:
    """Compile what a first start with a backend needs in a second process, where its package names that."""
    from mbf_abstract.compiling.ahead import compiling_ahead
    from mbf_abstract.config.installed_plugins import installed_points

    packages = [point.module.partition(".")[0] for point in installed_points(SERVERS) if point.name == backend]
    return compiling_ahead(f"{packages[0]}.kernels.first_start" if packages else "")


def _all_that_is_wrong(
    error: Exception, scenario: str, options: RunOptions, change: Callable[[Scenario], Scenario]
) -> Exception:
    """Return what ``mbf check`` finds for the backend of a run that could not begin, or else why it could not."""
    from mbf_abstract.config.findings import ConfigError
    from mbf_abstract.config.yaml_source import read_yaml
    from terrain.scenarios.scenario import scenario_file
    from terrain.session.scenario_check import check_scenario

    document = read_yaml(scenario_file(scenario), [])
    if document is None:
        return error
    backend = options.backend or document.data.get("backend")
    chosen = backend if isinstance(backend, str) else None
    findings = check_scenario(document, chosen, options.seed, options.settings, change=change).findings
    if isinstance(error, ConfigError) and not findings:  # of what only the run has found, such as robots in each other
        findings = tuple(document.located(one) if one.file == "scenario" else one for one in error.findings)
    return ConfigError(findings) if findings else error


def settings_of(texts: list[str], **chosen: str) -> dict[str, str]:
    """Return the settings of ``--set KEY=VALUE`` and those with an option of their own, each key once."""
    settings = {key: value for key, value in chosen.items() if value}
    for text in texts:
        key, _, value = text.partition("=")
        if not key or not value:
            raise typer.BadParameter(f"expected KEY=VALUE, got {text!r}", param_hint="--set")
        if key in settings:
            raise typer.BadParameter(f"{key} is set twice", param_hint="--set")
        settings[key] = value
    return settings


def _print_result(result: RunResult, as_json: bool) -> None:
    from terrain.commands.verdict_line import print_verdict

    metrics = result.metrics
    if as_json:
        typer.echo(json.dumps({**result.verdict.to_json(), "folder": str(result.folder), "metrics": metrics}))
        return
    print_verdict(result.verdict)
    typer.echo(
        f"{metrics['path_length_m']:.1f} m in {metrics['time_s']:.1f} s simulated, "
        f"{metrics['wall_time_s']:.1f} s of wall time: {metrics['real_time_factor']:.1f} x real time"
    )
    if "robots" in metrics:
        for name, own in metrics["robots"].items():
            typer.echo(f"  {name}: {own['verdict']}; {own['path_length_m']:.1f} m in {own['time_s']:.1f} s")
        typer.echo(f"  contacts between robots: {len(metrics['contacts_between_robots'])}")
        typer.echo(f"results in {result.folder}: replay.html, picture.png, metrics.json, and a folder for each robot")
    else:
        typer.echo(f"results in {result.folder}: replay.html, report.html, picture.png, run.mcap, metrics.json")
    page = replay_page(result.folder)
    if page is not None:
        typer.echo(f"replay: {page.as_uri()}")
