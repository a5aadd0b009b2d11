"""Which maps of a server a recovery changes: the only one, or those that its parameter chooses."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import ValidationInfo, field_validator

from mbf_abstract.drive.robot import RobotStateError
from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.transform import TransformError
from mbf_abstract.maps.map_plugin import MapContext, MapPlugin
from mbf_abstract.maps.navigation_map import NavigationMap
from mbf_abstract.parameters import PluginParameters, parameter
from mbf_abstract.plugins import AbstractRecovery, RecoveryRequest


class ChosenMapsParameters(PluginParameters):
    """Parameters of a recovery that changes maps."""

    costmaps: Literal["local", "global", "both"] = parameter("both", "Which maps, of a server that has two.")

    @field_validator("costmaps")
    @classmethod
    def _names_maps_of_the_server(cls, costmaps: str, info: ValidationInfo) -> str:
        """Refuse a choice where a configuration's server has one map; without a context it is not known here."""
        if info.context is not None and costmaps not in ("both", *info.context["map_names"]):
            raise ValueError('"both", as the server has one map only')
        return costmaps


class ChosenMapsRecovery(MapPlugin, AbstractRecovery):
    """Base of the recoveries that change maps.

    Raises
    ------
    ValueError
        The parameter names a map that the server does not have.
    """

    parameters: ChosenMapsParameters

    def __init__(self, context: MapContext[Any]) -> None:
        super().__init__(context)
        self.parameters_changed()

    def parameters_changed(self) -> None:
        """Refuse a choice of maps where there is one only."""
        if not self.chosen_maps():
            raise ValueError(f"costmaps: {self.parameters.costmaps}: the server has one map only")

    def chosen_maps(self) -> dict[str, NavigationMap]:
        """Return the maps by name; the only one of a server has the name ""."""
        which, maps = self.parameters.costmaps, self.maps or {"": self.navigation_map}
        return {name: one for name, one in maps.items() if which in (name, "both")}

    def unknown_layer(self, names: tuple[str, ...]) -> str:
        """Return which of the layers no map has; empty if there is none."""
        maps = self.chosen_maps()
        missing = [name for name in names if all(name not in one.layers for one in maps.values())]
        known = described({name: list(one.layers) for name, one in maps.items()}, "no layers")
        return f"there is no layer {missing[0]!r}, only {known}" if missing else ""

    def update(self, navigation_map: NavigationMap, request: RecoveryRequest) -> None:
        """Make a change visible to the next plan."""
        pose: Pose | None = None
        try:
            pose = self.on_map(request.motion.pose(), navigation_map)
        except (RobotStateError, TransformError):
            pass  # a map may be updated without
        navigation_map.update(pose, self.clock.now())


def described(names: dict[str, list[str]], nothing: str) -> str:
    """Write names by map: "a, b" of an only map, else "local: a, b; global: a"."""
    parts = [f"{one}: {', '.join(of_map)}" if one else ", ".join(of_map) for one, of_map in names.items() if of_map]
    return "; ".join(parts) or nothing
