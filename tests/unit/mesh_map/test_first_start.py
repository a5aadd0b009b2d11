"""What is compiled ahead for a first start on a mesh is what such a start uses: the same kernels, of the same types."""

import os
import subprocess
import sys

import pytest

FIRST_START = """
from numba import typeof

from mbf_abstract.goals.goal_types import RefinePathGoal
from mbf_mesh_nav.kernels.first_start import kernels
from terrain.scenarios.world_types import GeneratedWorld
from terrain.scenarios.scenario import PlanarPose, load_scenario
from terrain.session.session import Session

world = GeneratedWorld(type="generated", size=(12.0, 10.0), spacing=0.25, median_slope=5.0)
places = {"start": PlanarPose(x=3.0, y=5.0), "goals": (PlanarPose(x=9.0, y=5.0),)}
with Session(load_scenario("outdoor").model_copy(update={"world": world, **places})) as session:
    plan = session.navigator.get_path(session.goals[0])
    assert plan.success, plan.message
    assert session.navigator.send(RefinePathGoal(plan.path, "string_pulling")).wait().success
for kernel, arguments in kernels():
    if tuple(map(typeof, arguments)) not in kernel.signatures:
        print(kernel.__name__, kernel.signatures)
"""


@pytest.mark.timeout(900)  # it may have to compile everything, on a busy machine
def test_every_kernel_that_is_compiled_ahead_is_used_by_a_start_with_just_these_types():
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, "-c", FIRST_START]
    done = subprocess.run(command, env=environment, check=True, capture_output=True, text=True)
    assert done.stdout == ""
