"""Parameters of the inflation layers of all maps: radii that ``relax`` may shrink for a time."""

from __future__ import annotations

from typing import TypeVar

from mbf_abstract.parameters import ParameterModel, parameter

Radii = TypeVar("Radii", bound="InflationRadii")


class InflationRadii(ParameterModel):
    """Parameters every inflation layer has."""

    inflation_radius: float = parameter(..., "Distance from obstacles at which the cost ends.", unit="m", ge=0.0)
    cost_scaling_factor: float = parameter(..., "Rate of decay beyond the inscribed radius.", unit="1/m", ge=0.0)

    def relaxed(self: Radii, factor: float, robot_radius: float) -> Radii:
        """Return these with ``factor`` of the radius and a decay faster by as much.

        Nothing gets narrower than ``robot_radius`` [m], that of the robot's inscribed circle; 0 = unknown.
        """
        radius = max(factor * self.inflation_radius, robot_radius)
        return self.model_copy(
            update={"inflation_radius": radius, "cost_scaling_factor": self.cost_scaling_factor / factor}
        )
