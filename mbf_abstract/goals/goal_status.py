"""Where a goal is on its way through the server."""

from __future__ import annotations

from enum import Enum


class GoalStatus(Enum):
    """Where a goal is. The last four are final; a goal reaches exactly one of them, once."""

    PENDING = "pending"
    ACTIVE = "active"
    PAUSED = "paused"
    CANCELING = "canceling"
    SUCCEEDED = "succeeded"
    ABORTED = "aborted"
    CANCELED = "canceled"
    REJECTED = "rejected"

    @property
    def is_final(self) -> bool:
        """Whether the goal is over."""
        return self in _FINAL


_FINAL = {GoalStatus.SUCCEEDED, GoalStatus.ABORTED, GoalStatus.CANCELED, GoalStatus.REJECTED}
