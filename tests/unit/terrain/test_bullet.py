"""PyBullet is optional: what does not need it works without, what needs it says so."""

import subprocess
import sys

WITHOUT_PYBULLET = """
import sys
sys.modules["pybullet"] = sys.modules["matplotlib"] = sys.modules["embreex"] = None
import terrain
from terrain.physics import actors
from terrain.worlds import elevation_files as dem_io
from terrain.worlds import floor_plan
from terrain.worlds import generate
from terrain.physics import kinematic_robot
from terrain.worlds import multi_level
from terrain.sensors import rays
from terrain.physics import robots
from terrain.sensors import lidar as sensors
from terrain.physics import simulation
from terrain.worlds import slope_map
from terrain.physics import world
from terrain.physics.bullet import SimulatorMissingError
try:
    world.BulletWorld()
except SimulatorMissingError as error:
    assert "pip install" in str(error), error
else:
    raise AssertionError("a world without a simulator")
"""


def test_the_package_imports_without_simulator_and_names_the_remedy() -> None:
    done = subprocess.run([sys.executable, "-c", WITHOUT_PYBULLET], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
