"""A message of a run before it is made."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, eq=False)
class Stamped:
    """A message that has not been made yet: much of a live run is looked at by nobody.

    Attributes
    ----------
    time : float
        [s] of the run.
    make : callable
        Returns the protobuf message or the ``JsonMessage``.
    part : str, optional
        Which part of the present state it shows, so that one who comes later needs the newest message of each part;
        None of messages that only matter at their time.
    """

    time: float
    topic: str
    make: Callable[[], Any]
    part: str | None = None
