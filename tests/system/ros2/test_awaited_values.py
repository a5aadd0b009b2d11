"""A goal or a question that has its answer on another thread is answered at once, not with the next message."""

import subprocess

import pytest

from tests.system.ros2.conftest import PEERS, folder_of
from tests.system.ros2.environments import JAZZY, KILTED, clean_variables

pytestmark = [pytest.mark.ros2, pytest.mark.timeout(900, func_only=True)]
LONG = 60.0  # s; ends who is not woken


@pytest.mark.parametrize("distribution", [KILTED, JAZZY], ids=lambda one: one.name)
def test_a_coroutine_goes_on_when_its_value_comes_though_nothing_else_does(distribution):
    folder = folder_of(distribution)
    waiter = [folder / "venv" / "bin" / "python", PEERS / "waiter.py"]
    ended = subprocess.run(waiter, env=clean_variables(folder), capture_output=True, text=True, timeout=LONG)
    assert ended.stdout == "20\n", ended.stderr
