"""The time limit of a test counts no compilation; a loaded machine without kernels would fail tests that are right."""

import signal
import threading

import pytest
from numba import njit
from numba.core import event

pytestmark = pytest.mark.timeout(60)


class Look(event.Listener):
    """What is left of the limit when a compilation has begun, 0 = it does not run."""

    def __init__(self):
        self.left = []

    def on_start(self, event):
        self.left.append(signal.getitimer(signal.ITIMER_REAL)[0])

    def on_end(self, event):
        pass


def compile_one():
    njit(lambda number: number + 1)(1)


def compile_on_a_thread():
    thread = threading.Thread(target=compile_one)
    thread.start()
    thread.join()


@pytest.mark.parametrize("compile_something", [compile_one, compile_on_a_thread])
def test_the_time_limit_of_a_test_is_held_while_numba_compiles(compile_something):
    look, before = Look(), signal.getitimer(signal.ITIMER_REAL)[0]
    with event.install_listener("numba:compile", look):
        compile_something()
    assert look.left and set(look.left) == {0.0}
    assert 0.0 < signal.getitimer(signal.ITIMER_REAL)[0] <= before, "and goes on where it was"
