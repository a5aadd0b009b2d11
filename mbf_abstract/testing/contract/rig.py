"""A plugin under test with a simulated clock, a loopback robot and a context."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import numpy as np

from mbf_abstract.drive.robot import RobotInformation
from mbf_abstract.geometry import Pose
from mbf_abstract.parameters import PluginParameters
from mbf_abstract.plugins import Plugin, PluginContext
from mbf_abstract.testing.contract.report import Report
from mbf_abstract.testing.loopback import LoopbackRobot, LoopbackSession
from mbf_abstract.time.cancel import CancelToken
from mbf_abstract.time.clock import Clock, WallClock, wall_seconds

P = TypeVar("P", bound=Plugin)
ContextMaker = Callable[[PluginContext], PluginContext]

SHORTEST_CANCELED_RUN = 0.005  # s of wall time; a faster call need not check its token
CANCEL_MOMENTS = (0.1, 0.5, 0.9)  # as a share of the time of a whole call


def same_context(base: PluginContext) -> PluginContext:
    """Return the context unchanged, for plugins that need no map."""
    return base


@dataclass(frozen=True)
class Rig(Generic[P]):
    """A plugin with its clock and robot."""

    plugin: P
    clock: Clock
    robot: LoopbackRobot


@contextmanager
def rig(
    plugin_class: type[P], make_context: ContextMaker, parameters: PluginParameters | None, start: Pose
) -> Iterator[Rig[P]]:
    """Make a fresh plugin, always with the same seed, and end the robot's thread afterwards."""
    with LoopbackSession(start) as session:
        information = RobotInformation(session.robot, session.transforms, session.clock, start.frame_id)
        chosen = plugin_class.Parameters() if parameters is None else parameters
        base = PluginContext("dut", chosen, session.clock, np.random.default_rng(0), information)
        yield Rig(plugin_class(make_context(base)), session.clock, session.robot)


def cancel_latency(call: Callable[[CancelToken], Any], after: float) -> tuple[float, Any]:
    """Set the token of a call that runs, from another thread.

    Parameters
    ----------
    call : callable
        Runs the plugin with the token it is given.
    after : float
        When the token is set [s of wall time].

    Returns
    -------
    latency : float
        Wall time [s] from the cancel to the return; 0 if the call was over before.
    result : object
    """
    token, wall, times = CancelToken(), WallClock(), []

    def cancel() -> None:
        wall.sleep(after)
        times.append(wall_seconds())
        token.cancel()

    thread = wall.spawn(cancel, "contract cancel")
    result = call(token)
    returned = wall_seconds()
    thread.join()
    return max(0.0, returned - times[0]), result


def canceled_token() -> CancelToken:
    """Return a token that is set already."""
    token = CancelToken()
    token.cancel("set before the call")
    return token


def expect_idle_cancel_is_harmless(report: Report, plugin: Plugin) -> None:
    """Call ``cancel`` often, from two threads, while nothing runs; record what is wrong."""
    answers: list[Any] = []

    def cancel_often() -> None:
        try:
            answers.extend(plugin.cancel() for _ in range(20))
        except Exception as error:
            answers.append(error)

    thread = WallClock().spawn(cancel_often, "contract cancel")
    cancel_often()
    thread.join()
    for answer in answers:
        report.expect(isinstance(answer, bool), f"cancel() while idle gave {answer!r}, not a bool")
