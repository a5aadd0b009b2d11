"""A car that keeps to its path where samples would cut its manoeuvres: regulated pure pursuit with given limits.

When to use: inside ``costmap.mppi``, for cars, as ``follow_path`` is used there for robots that turn on the spot. When
not: as a controller of its own; name ``costmap.regulated_pure_pursuit`` for that.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from mbf_abstract.config.registry import PluginRegistry
from mbf_abstract.plugins import PluginKind
from mbf_costmap_nav.control.regulated_speed import RegulatedFollower
from mbf_costmap_nav.plugins import CostmapContext


def car_on_path(context: CostmapContext, limits: Mapping[str, Any]) -> RegulatedFollower:
    """Regulated pure pursuit within another controller of this context; ``limits`` are parameters of it."""
    follower_class: Any = PluginRegistry("costmap").load(PluginKind.CONTROLLER, "regulated_pure_pursuit")
    parameters = follower_class.Parameters(**limits)
    follower: RegulatedFollower = follower_class(replace(context, name=f"{context.name}.car", parameters=parameters))
    return follower
