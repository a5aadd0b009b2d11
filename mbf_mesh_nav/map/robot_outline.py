"""The robot's outline on maps of a surface: a disc for places and plans, its corners for turns and contacts."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydantic import field_validator

from mbf_abstract.geometry.arithmetic import norm
from mbf_abstract.maps.disc_map import disc_radius
from mbf_abstract.maps.layered_map import LayeredMap
from mbf_abstract.maps.tracking.robot_box import RobotBox
from mbf_abstract.parameters import ParameterError, ParameterModel, parameter
from mbf_mesh_nav.map.layer import LayerParameters
from mbf_mesh_nav.mesh.motion_check import UNKNOWN_RADIUS

Corners = tuple[tuple[float, float], ...]
"""Of an outline in the robot's frame [m]: x forward, y left; empty = unknown."""


class OutlineParameters(ParameterModel):
    """Part of the parameters of such a map."""

    footprint: Corners = parameter(
        (),
        "Corners of the robot's outline, x forward and y left, for turns on the spot and for contacts with what moves; "
        "empty = the disc of inscribed_radius, as for plans.",
        unit="m",
    )

    @field_validator("footprint")
    @classmethod
    def _footprint_holds_the_origin(cls, corners: Corners) -> Corners:
        if not corners:
            return corners
        if len(corners) < 3:
            raise ValueError(f"at least three corners [x, y], or none, got {len(corners)}")
        if (np.min(corners, axis=0) >= 0.0).any() or (np.max(corners, axis=0) <= 0.0).any():
            raise ValueError("corners on all sides of the robot's origin (0, 0)")
        return corners


def changes_of_radius(footprint: object) -> dict[str, Any]:
    """Changes of these parameters for a disc of a radius [m]; ParameterError for anything but a number."""
    return {"inscribed_radius": disc_radius(footprint), "footprint": ()}


def _fitted(layer: str, parameters: LayerParameters, old: float, new: float) -> LayerParameters:
    """Parameters of a layer for another inscribed radius [m]; the error of one that cannot have it names the layer."""
    try:
        return parameters.for_radius(old, new)
    except ParameterError as error:
        raise ParameterError(f"{layer}.{error}") from None


class OutlinedMap(LayeredMap):
    """A map that knows the outline of its robot.

    Attributes
    ----------
    footprint : tuple of (x, y)
        Corners [m] of the robot's outline; empty = the disc of the inscribed radius.
    """

    footprint: Corners = ()

    def fit_layers(self, radius: float) -> None:
        """Give the layers that know the robot its new inscribed radius [m], before the map takes it; 0 = unknown.

        Raises
        ------
        ValueError
            A layer cannot have it; none is changed.
        """
        old = self.inscribed_radius
        if radius in (0.0, old):
            return
        usual = {name: self.usual_parameters(name) for name in self.layers}
        fitted = {name: _fitted(name, one, old, radius) for name, one in usual.items()}
        changed: list[str] = []
        try:
            for name in (name for name in usual if fitted[name] is not usual[name]):
                self.set_layer_parameters(name, fitted[name])
                changed.append(name)
        except BaseException:
            for name in changed:
                self.set_layer_parameters(name, usual[name])
            raise

    @property
    def robot_box(self) -> RobotBox:
        """The box around the footprint; the disc if there is none."""
        return RobotBox.around(self.footprint) if self.footprint else super().robot_box

    @property
    def robot_reach(self) -> float:
        """How far [m] the robot reaches from its origin: its outline, else its disc."""
        return float(norm(self.footprint).max()) if self.footprint else self.disc_reach

    @property
    def disc_reach(self) -> float:
        """Radius [m] of the robot's disc; where it is unknown, the largest one that layers have, else a guess.

        So a robot may drive where its plans lead, whose costs are those of the layers.
        """
        inflated = (getattr(layer.parameters, "inscribed_radius", 0.0) for layer in self.layers.values())
        return self.inscribed_radius or max(inflated, default=0.0) or UNKNOWN_RADIUS
