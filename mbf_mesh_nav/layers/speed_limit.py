"""Speed limit: regions where the robot must drive slowly, as polygons on the map.

When to use: ramps, crossings, places with people. When not: to keep the robot out, use ``keepout``. Cost: one look-up
per command. Known failure: the limit applies from the moment the robot's centre is inside, so draw a region with the
distance the robot needs to brake.

It has no costs, and is no default layer; whatever drives is slowed down, see
``mbf_abstract.maps.layers.obeyed_limits``. A limit of 0 m/s is none that can be driven at: paths through it
are blocked.
"""

from __future__ import annotations

import numpy as np

from mbf_abstract.geometry import Pose
from mbf_abstract.maps.layers.limits import LimitType, limit_warning, lowest
from mbf_abstract.parameters import parameter
from mbf_mesh_nav.layers.polygon_regions import Region
from mbf_mesh_nav.map.layer import CostArray, LayerParameters, LethalArray, MeshLayer


class SlowRegion(Region):
    """A polygon on one storey with a limit."""

    speed_limit: float = parameter(..., "Limit inside, in the unit of limit_type.", ge=0.0)


class SpeedLimitParameters(LayerParameters):
    """Parameters of ``speed_limit``."""

    regions: tuple[SlowRegion, ...] = parameter((), "Polygons to drive slowly in.")
    limit_type: LimitType = parameter("absolute", "Whether limits are m/s or % of full speed.")


class SpeedLimitLayer(MeshLayer):
    """Free everywhere, and slow inside the regions."""

    Parameters = SpeedLimitParameters
    parameters: SpeedLimitParameters
    has_costs = False

    @classmethod
    def reach(cls, parameters: SpeedLimitParameters) -> float:
        """0: it looks at nothing."""
        return 0.0

    def configuration_warning(self) -> str:
        """The first region whose polygon or limit is hardly meant as it is."""
        for index, region in enumerate(self.parameters.regions):
            if problem := region.warning() or limit_warning(region.speed_limit, self.parameters.limit_type):
                return f"{region.title('regions', index)}: {problem}"
        return ""

    def compute(self) -> tuple[CostArray, LethalArray]:
        """No cost and nothing lethal."""
        count = self.topology.vertex_count
        return np.zeros(count, dtype=np.float32), np.zeros(count, dtype=np.bool_)

    def speed_limit_at(self, pose: Pose, full_speed: float) -> float:
        """The lowest limit of the regions that the pose is in, seen from above and at its height."""
        p, place = self.parameters, np.array([pose.position])
        return lowest((one.speed_limit for one in p.regions if one.mask(place)[0]), p.limit_type, full_speed)
