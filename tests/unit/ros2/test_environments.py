"""The environments of the system tests: what killed tests leave behind does not stop the next ones."""

import os
import subprocess
import sys

import pytest

from tests.system.ros2.environments import locked

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="there are no wheels of ROS 2 for other systems")
PARENT = """
import subprocess, sys
from tests.system.ros2.environments import end_with_parent
child = subprocess.Popen(["sleep", "300"], preexec_fn=end_with_parent)
print("started", flush=True)
child.wait()
"""


def test_a_process_ends_when_the_tests_that_started_it_are_killed():
    paths = {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    with subprocess.Popen([sys.executable, "-c", PARENT], stdout=subprocess.PIPE, env=paths) as tests:
        assert tests.stdout.readline() == b"started\n"
        tests.kill()
        assert tests.stdout.read() == b""  # ends only when nobody is left who could write


def test_an_environment_that_another_process_keeps_locked_ends_the_wait_with_a_text_that_names_it(tmp_path):
    file = tmp_path / "lock"
    with locked(file, 0):
        with pytest.raises(TimeoutError, match=rf"lock has been locked for 0 s by process {os.getpid()}, "):
            with locked(file, 0):
                pass
    with locked(file, 0):
        pass
