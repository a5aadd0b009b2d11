"""Outcome codes of the actions, with the numbers of ``mbf_msgs``.

The ranges are disjoint, so one integer identifies the action that produced it. Success is any value below 10:
0 is plain success, 1..9 are a plugin's own variants of it. The upper part of each range (71..99, 121..149,
171..199, 221..249) is reserved for plugin-specific failures.
"""

from __future__ import annotations

from enum import IntEnum

SUCCESS_LIMIT = 10


class GetPathOutcome(IntEnum):
    """What became of a ``get_path`` goal (50..99)."""

    SUCCESS = 0
    FAILURE = 50
    CANCELED = 51
    INVALID_START = 52
    INVALID_GOAL = 53
    BLOCKED_START = 54
    BLOCKED_GOAL = 55
    NO_PATH_FOUND = 56
    PAT_EXCEEDED = 57
    EMPTY_PATH = 58
    TF_ERROR = 59
    NOT_INITIALIZED = 60
    INVALID_PLUGIN = 61
    INTERNAL_ERROR = 62
    OUT_OF_MAP = 63
    MAP_ERROR = 64
    STOPPED = 65


PERMANENT_OUTCOMES = frozenset([GetPathOutcome.OUT_OF_MAP, GetPathOutcome.INVALID_START, GetPathOutcome.INVALID_GOAL])
"""What planning anew cannot change."""


class ExePathOutcome(IntEnum):
    """What became of an ``exe_path`` goal (100..149)."""

    SUCCESS = 0
    FAILURE = 100
    CANCELED = 101
    NO_VALID_CMD = 102
    PAT_EXCEEDED = 103
    COLLISION = 104
    OSCILLATION = 105
    ROBOT_STUCK = 106
    MISSED_GOAL = 107
    MISSED_PATH = 108
    BLOCKED_GOAL = 109
    BLOCKED_PATH = 110
    INVALID_PATH = 111
    TF_ERROR = 112
    NOT_INITIALIZED = 113
    INVALID_PLUGIN = 114
    INTERNAL_ERROR = 115
    OUT_OF_MAP = 116
    MAP_ERROR = 117
    STOPPED = 118


class RecoveryOutcome(IntEnum):
    """What became of a ``recovery`` goal (150..199)."""

    SUCCESS = 0
    FAILURE = 150
    CANCELED = 151
    PAT_EXCEEDED = 152
    TF_ERROR = 153
    NOT_INITIALIZED = 154
    INVALID_PLUGIN = 155
    INTERNAL_ERROR = 156
    STOPPED = 157
    IMPASSABLE = 158


class RefinePathOutcome(IntEnum):
    """What became of a ``refine_path`` goal (200..249)."""

    SUCCESS = 0
    FAILURE = 200
    CANCELED = 201
    DEPLETED = 202
    INVALID_PLUGIN = 203
    MAP_ERROR = 210
    INTERNAL_ERROR = 211
    STOPPED = 212


class MoveBaseOutcome(IntEnum):
    """What became of a ``move_base`` goal: its own codes, or a sub-action's code passed through."""

    SUCCESS = 0
    FAILURE = 10
    CANCELED = 11
    COLLISION = 12
    OSCILLATION = 13
    START_BLOCKED = 14
    GOAL_BLOCKED = 15
    TF_ERROR = 16
    INTERNAL_ERROR = 17
    PLAN_FAILURE = 50
    CTRL_FAILURE = 100


_RANGES: tuple[tuple[range, type[IntEnum], range], ...] = (
    (range(10, 50), MoveBaseOutcome, range(0)),
    (range(50, 100), GetPathOutcome, range(71, 100)),
    (range(100, 150), ExePathOutcome, range(121, 150)),
    (range(150, 200), RecoveryOutcome, range(171, 200)),
    (range(200, 250), RefinePathOutcome, range(221, 250)),
)


def is_success(outcome: int) -> bool:
    """Whether ``outcome`` (any action's) means success: 0, or a plugin's own variant 1..9."""
    return 0 <= outcome < SUCCESS_LIMIT


def outcome_name(outcome: int) -> str:
    """Return the readable name of an outcome code, e.g. ``NO_PATH_FOUND`` for 56.

    Plugin-specific and unknown codes come back as text with their number, never as an error.
    """
    if is_success(outcome):
        return "SUCCESS" if outcome == 0 else f"SUCCESS ({outcome})"
    for span, enum, plugin_range in _RANGES:
        if outcome in span:
            if outcome in plugin_range:
                return f"plugin-specific {enum.__name__.removesuffix('Outcome')} code {outcome}"
            try:
                return enum(outcome).name
            except ValueError:
                break
    return f"unknown outcome code {outcome}"


def outcome_text(outcome: int, message: str) -> str:
    """Return name and message of an outcome in one line; the name alone where the message says no more."""
    name = outcome_name(outcome)
    return name if message in ("", name) else f"{name}: {message}"
