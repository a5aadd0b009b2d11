"""PyBullet is optional: what does not need it works without, what needs it says so."""

import subprocess
import sys

WITHOUT_PYBULLET = """
import sys
sys.modules["pybullet"] = sys.modules["matplotlib"] = sys.modules["embreex"] = None
import terrain
from terrain import actors, dem_io, floor_plan, generate, indoor, kinematic_robot, multi_level, rays, robots, sensors
from terrain import simulation, slope_map, world
from terrain.bullet import SimulatorMissingError
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
