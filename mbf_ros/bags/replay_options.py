"""What a user may choose about the replay of a bag."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from mbf_abstract.commands.coordinates import Place
from mbf_abstract.geometry.transform import Transform
from mbf_ros.bags.recorded_time import check_seconds


@dataclass(frozen=True)
class ReplayOptions:
    """How a bag is replayed.

    Attributes
    ----------
    topics : mapping of str to str
        Topics by what they are, where there is a choice, see ``choose_topics``.
    transforms : tuple of Transform
        Static ones that the bag lacks.
    odometry_as_transform : bool
        Take the poses of odometry for transforms.
    map_name : str
        Which map is shown; the one that plans are made on if empty.
    goal : Place, optional
        Where to plan to.
    at : float
        When to plan [s from the beginning of the bag]; at its end if infinite.
    planner : str
        Name; the first one if empty.
    every : float
        Time between two pictures of the map [s]; 0 makes ten pictures.

    Raises
    ------
    ValueError
        ``at`` or ``every`` are negative or NaN.
    """

    topics: Mapping[str, str] = field(default_factory=dict)
    transforms: tuple[Transform, ...] = ()
    odometry_as_transform: bool = False
    map_name: str = ""
    goal: Place | None = None
    at: float = math.inf
    planner: str = ""
    every: float = 0.0

    def __post_init__(self) -> None:
        for name in ("at", "every"):
            check_seconds(f"--{name}", getattr(self, name))
