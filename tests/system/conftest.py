"""Fixtures of the tests that run whole scenarios."""

import pytest

from terrain.scenarios.scenario import PlanarPose, load_scenario
from terrain.scenarios.world_types import GarageWorld

SHORTER = {  # shorter runs that still need what the scenario proves
    "garage_roof": {"world": GarageWorld(type="garage", floors=2)},
    "outdoor": {"start": PlanarPose(x=72.0, y=73.0, yaw=0.8)},  # the last third, a slope bars the straight way
    "office_delivery": {"goals": ("meeting_room", "corridor_west")},
}


@pytest.fixture
def shipped():
    """Load a shipped scenario, shortened where that loses nothing."""
    return lambda name: load_scenario(name).model_copy(update=SHORTER.get(name, {}))
