"""Whether a blocked robot meets other robots: which failures that causes, how near their paths come, what is run then.

A robot without a path meets nobody: ``get_path`` then asks whom it may wait for, ``those_that_leave``.

Nobody has to configure it. A robot that announces its path and has loaded a recovery named ``give_way`` runs that one,
at the distance that ``give_way`` keeps. ``right_of_way_behavior`` names another one or none.
"""

from __future__ import annotations

from mbf_abstract.execution.runtime import Runtime
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome, MoveBaseOutcome
from mbf_abstract.plugins import PluginKind
from mbf_abstract.server.plugin_table import PluginTable
from mbf_abstract.traffic.announcement import Announcement
from mbf_abstract.traffic.right_of_way import MEETING_LENGTH

USUAL_NAME = "give_way"
"""The recovery that is run where no other is named."""
USUAL_DISTANCE = 0.8
"""Robots whose paths come nearer than this [m] meet, where neither the parameter nor the behaviour says how near."""
BLOCKED = frozenset(
    [
        GetPathOutcome.BLOCKED_START,
        GetPathOutcome.BLOCKED_GOAL,
        GetPathOutcome.NO_PATH_FOUND,
        GetPathOutcome.PAT_EXCEEDED,
        ExePathOutcome.NO_VALID_CMD,
        ExePathOutcome.PAT_EXCEEDED,
        ExePathOutcome.COLLISION,
        ExePathOutcome.OSCILLATION,
        ExePathOutcome.BLOCKED_GOAL,
        ExePathOutcome.BLOCKED_PATH,
        MoveBaseOutcome.OSCILLATION,
    ]
)
"""Failures that another robot in the way causes."""


def behavior_for_meetings(runtime: Runtime, plugins: PluginTable) -> str:
    """Name of the recovery that a blocked robot runs where it meets others, empty if none.

    Without a name in the configuration it is the usual one, if that can be run and the robot announces its path: alone
    it would meet nobody, and ``give_way`` stays among the usual recoveries.
    """
    named = runtime.parameters.right_of_way_behavior
    if named is not None:
        return named
    can_ask = runtime.traffic.connected and not plugins.problem(PluginKind.RECOVERY, USUAL_NAME)
    return USUAL_NAME if can_ask else ""


def meeting_distance(runtime: Runtime, plugins: PluginTable) -> float:
    """How near the paths of two robots come that meet [m]: as configured, else what the behaviour itself goes by."""
    configured = runtime.parameters.right_of_way_distance
    own = own_distance(runtime, plugins) if configured is None else configured
    return USUAL_DISTANCE if own is None else own


def meets_others(runtime: Runtime, plugins: PluginTable) -> bool:
    """Whether the robot meets robots that announce their paths."""
    distance = meeting_distance(runtime, plugins)
    return bool(runtime.traffic.rivals(runtime.clock.now(), distance, MEETING_LENGTH))


def those_that_leave(runtime: Runtime) -> tuple[Announcement, ...]:
    """Robots that a robot without a path may wait for: those that go somewhere, those that make room.

    The body of one that does not announce its size cannot be taken off a map, so it is none of them.
    """
    others = [other for other in runtime.traffic.others(runtime.clock.now()) if other.radius > 0.0]
    return tuple(one for one in others if one.remaining > 0.0 or (one.makes_room and not one.cannot_yield))


def distance_of_meetings(runtime: Runtime, plugins: PluginTable) -> float:
    """What a robot announces as its ``meeting_distance`` [m]; 0 where it runs nothing in meetings."""
    return meeting_distance(runtime, plugins) if behavior_for_meetings(runtime, plugins) else 0.0


def own_distance(runtime: Runtime, plugins: PluginTable) -> float | None:
    """From which distance [m] the behaviour itself sees others; None where it is not loaded or does not say."""
    named = runtime.parameters.right_of_way_behavior
    name = USUAL_NAME if named is None else named
    plugin = plugins.find(PluginKind.RECOVERY, name) if name else None
    return None if plugin is None else getattr(plugin.instance, "meeting_distance", None)
