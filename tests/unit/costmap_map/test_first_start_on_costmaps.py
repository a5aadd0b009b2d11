"""What is compiled ahead for a first start on costmaps is what it uses: the same kernels, of the same types."""

import os
import subprocess
import sys

import pytest

FIRST_START = """
from numba import typeof

from mbf_costmap_nav.kernels.first_start import kernels
from terrain.scenarios.scenario import load_scenario
from terrain.session.session import Session

with Session(load_scenario("indoor")) as session:
    plan = session.navigator.get_path(session.goals[0])
    assert plan.success, plan.message
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
