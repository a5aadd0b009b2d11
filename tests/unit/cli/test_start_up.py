"""What a start of ``mbf`` leaves alone, so that it is there at once."""

import os
import subprocess
import sys

import pytest

THREADS = """
import os, sys
from mbf_abstract import cli
assert "numpy" not in sys.modules
sys.argv = ["mbf", "--version"]
try:
    cli.main()
except SystemExit:
    pass
import numpy
print(len(os.listdir("/proc/self/task")))
"""


@pytest.mark.skipif(not os.path.isdir("/proc/self/task"), reason="threads are counted in /proc, which only Linux has")
@pytest.mark.parametrize(("asked", "expected"), [({}, 1), ({"OPENBLAS_NUM_THREADS": "2"}, 2)])
def test_a_command_starts_no_threads_for_blas_unless_it_is_asked_to(asked, expected):
    inherited = {name: value for name, value in os.environ.items() if name != "OPENBLAS_NUM_THREADS"}
    command = [sys.executable, "-c", THREADS]
    done = subprocess.run(command, env=inherited | asked, capture_output=True, text=True, check=True)
    assert int(done.stdout.split()[-1]) == min(expected, len(os.sched_getaffinity(0)))
