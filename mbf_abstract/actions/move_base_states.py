"""What the ``move_base`` machine waits for, and why it recovers."""

from __future__ import annotations

from enum import Enum


class MoveBaseState(Enum):
    """What the machine waits for."""

    GET_PATH = "get_path"
    EXE_PATH = "exe_path"
    STOPPING = "stopping"
    RECOVERY = "recovery"
    CANCELING = "canceling"


class Trigger(Enum):
    """What made the last recovery necessary."""

    NONE = "none"
    PLAN = "plan"
    CONTROL = "control"
    OSCILLATION = "oscillation"
